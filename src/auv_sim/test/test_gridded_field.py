from __future__ import annotations

import random
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.io import netcdf_file

from auv_sim.gridded_field import read_grid_file
from msgs_json.geometry import GridSpec, Point

if TYPE_CHECKING:
    from pathlib import Path

REGION = GridSpec(cols=3, rows=2, cell_m=10.0)  # cell centres 5 ... 25 and 5 ... 15 m
EAST_M = np.array([0.0, 10.0, 30.0])
NORTH_M = np.array([0.0, 20.0])
VALUES = np.array(
    [[1.0, 2.0, 4.0], [11.0, 12.0, 14.0]]
)  # [north, east]: 1 + east / 10 + north / 2


def value_at(point: Point) -> float:
    """Bilinear interpolation, spelled out."""
    col = 0 if point.east_m < 10.0 else 1
    east = (point.east_m - EAST_M[col]) / (EAST_M[col + 1] - EAST_M[col])
    north = point.north_m / 20.0
    south_value = (1.0 - east) * VALUES[0, col] + east * VALUES[0, col + 1]
    north_value = (1.0 - east) * VALUES[1, col] + east * VALUES[1, col + 1]
    return float((1.0 - north) * south_value + north * north_value)


def csv_lines() -> list[str]:
    return [
        f'{east},{north},{VALUES[row, col]}'
        for row, north in enumerate(NORTH_M)
        for col, east in enumerate(EAST_M)
    ]


def write_csv(path: Path, lines: list[str], header: str = 'east_m,north_m,value') -> Path:
    path.write_text('\n'.join([header, *lines]) + '\n', encoding='utf-8')
    return path


def write_netcdf(path: Path, **changed: Any) -> Path:  # noqa: ANN401
    """Write a good file; ``changed`` maps a variable to (dimensions, array), or None for none."""
    variables: dict[str, Any] = {
        'east_m': (('x',), EAST_M),
        'north_m': (('y',), NORTH_M),
        'value': (('y', 'x'), VALUES),
        **changed,
    }
    with netcdf_file(path, 'w') as file:
        file.createDimension('x', 3)
        file.createDimension('y', 2)
        for name, content in variables.items():
            if content is not None:
                dimensions, array = content
                variable = file.createVariable(name, array.dtype, dimensions)
                variable[:] = array
    return path


@pytest.mark.parametrize('kind', ['csv', 'csv shuffled', 'csv other columns', 'nc', 'nc falling'])
def test_values_on_the_grid_and_in_between(tmp_path: Path, kind: str) -> None:
    if kind == 'csv':
        path = write_csv(tmp_path / 'field.csv', csv_lines())
    elif kind == 'csv shuffled':
        lines = random.Random(1).sample([*csv_lines(), ''], 7)
        path = write_csv(tmp_path / 'field.csv', lines)
    elif kind == 'csv other columns':
        lines = [','.join(line.split(',')[::-1]) for line in csv_lines()]
        path = write_csv(tmp_path / 'field.csv', lines, header='\ufeffvalue,north_m,east_m')
    elif kind == 'nc':
        path = write_netcdf(tmp_path / 'field.nc')
    else:
        path = write_netcdf(
            tmp_path / 'field.nc',
            north_m=(('y',), NORTH_M[::-1]),
            value=(('y', 'x'), VALUES[::-1]),
        )
    field = read_grid_file(path, REGION)
    for east_m in (0.0, 5.0, 10.0, 12.5, 30.0):
        for north_m in (0.0, 5.0, 20.0):
            point = Point(east_m=east_m, north_m=north_m)
            assert field.sample(point) == pytest.approx(value_at(point))


def test_outside_the_grid_its_edge_counts(tmp_path: Path) -> None:
    field = read_grid_file(write_csv(tmp_path / 'field.csv', csv_lines()), REGION)
    assert field.sample(Point(east_m=-3.0, north_m=900.0)) == 11.0


def test_packed_netcdf_is_unpacked(tmp_path: Path) -> None:
    path = write_netcdf(tmp_path / 'field.nc', value=None)
    with netcdf_file(path, 'a') as file:
        variable = file.createVariable('value', 'i2', ('y', 'x'))
        variable[:] = [[0, 10, 20], [30, 40, 50]]
        variable.scale_factor, variable.add_offset = 0.5, 12.0
    field = read_grid_file(path, REGION)
    assert field.sample(Point(east_m=10.0, north_m=20.0)) == pytest.approx(32.0)


@pytest.mark.parametrize(
    ('line', 'text', 'message'),
    [
        (3, '10,0,warm', r"line 3: value is 'warm'; must be a number"),
        (3, '10,0,', r"line 3: value is ''; must be a number"),
        (4, '30,0,nan', r'line 4: value is nan; must be within'),
        (4, '30,0,1e10', r'line 4: value is 1e10; must be within \+-1e\+09'),
        (5, 'inf,20,1', r'line 5: east_m is inf'),
        (2, '0,0', r'line 2: has 2 columns; must have 3'),
        (3, '0,0,5', r'line 3: point \(0, 0\) is there twice'),
        (3, '11,0,2', r'point \(10, 0\) is missing; the points must form a grid of 4 x 2'),
    ],
)
def test_bad_line_is_named(tmp_path: Path, line: int, text: str, message: str) -> None:
    lines = csv_lines()
    lines[line - 2] = text
    path = write_csv(tmp_path / 'field.csv', lines)
    with pytest.raises(ValueError, match=message) as refused:
        read_grid_file(path, REGION)
    assert str(refused.value).startswith(str(path))


@pytest.mark.parametrize('header', ['', 'east,north,value', 'east_m,north_m,value,depth_m'])
def test_bad_header_is_named(tmp_path: Path, header: str) -> None:
    path = write_csv(tmp_path / 'field.csv', csv_lines(), header=header)
    with pytest.raises(ValueError, match=r'line 1: columns are .* must be east_m, north_m, value'):
        read_grid_file(path, REGION)


@pytest.mark.parametrize(
    ('content', 'message'),
    [
        (b'', r'line 1: columns are \[\]'),
        (b'\xff\xfe\x00', r'line 1: columns are'),
        (b'east_m,north_m,value\n', r'east_m is \[\]; it must have at least 2'),
        (b'east_m,north_m,value\n1,1,\xff\n', r'line 2: value is'),
        (b'east_m,north_m,value\n1,1,' + b'9' * 200_000, r'not a CSV file'),
    ],
)
def test_file_that_is_no_grid_is_refused(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / 'field.csv'
    path.write_bytes(content)
    with pytest.raises(ValueError, match=message):
        read_grid_file(path, REGION)


def test_single_line_is_no_grid(tmp_path: Path) -> None:
    path = write_csv(tmp_path / 'field.csv', ['5,5,1', '25,5,1'])
    with pytest.raises(ValueError, match=r'north_m is \[5.0\]; it must have at least 2'):
        read_grid_file(path, REGION)


@pytest.mark.parametrize(
    ('changed', 'message'),
    [
        ({'value': None}, r'variable value is missing'),
        ({'value': (('x', 'y'), VALUES.T)}, r"value\('x', 'y'\); they must be .* value\(y, x\)"),
        ({'east_m': (('y',), NORTH_M)}, r"east_m\('y',\)"),
        ({'north_m': (('y', 'x'), VALUES)}, r'they must be east_m\(x\), north_m\(y\)'),
        ({'east_m': (('x',), np.array([b'a', b'b', b'c']))}, r'east_m has type \|S1'),
        ({'east_m': (('x',), np.array([0.0, 10.0, 10.0]))}, r'east_m is .* rising or falling'),
        ({'value': (('y', 'x'), VALUES * 1e9)}, r'value\[0, 1\] is 2000000000\.0; must be within'),
        (
            {'value': (('y', 'x'), np.where(VALUES > 13.0, np.nan, VALUES))},
            r'value\[1, 2\] is nan',
        ),
    ],
)
def test_bad_variable_is_named(tmp_path: Path, changed: dict[str, Any], message: str) -> None:
    path = write_netcdf(tmp_path / 'field.nc', **changed)
    with pytest.raises(ValueError, match=message) as refused:
        read_grid_file(path, REGION)
    assert str(refused.value).startswith(str(path))


def test_missing_netcdf_value_is_named(tmp_path: Path) -> None:
    path = write_netcdf(tmp_path / 'field.nc', value=None)
    with netcdf_file(path, 'a') as file:
        variable = file.createVariable('value', 'f8', ('y', 'x'))
        variable[:] = np.where(VALUES > 13.0, -99.0, VALUES)
        variable._FillValue = -99.0
    with pytest.raises(ValueError, match=r'value\[1, 2\] is nan'):
        read_grid_file(path, REGION)


def test_damaged_netcdf_is_refused_or_read(tmp_path: Path) -> None:
    whole = write_netcdf(tmp_path / 'whole.nc').read_bytes()
    path = tmp_path / 'field.nc'
    for length in range(0, len(whole) - 8, 3):
        path.write_bytes(whole[:length])
        with pytest.raises(ValueError, match=r'field\.nc: '):
            read_grid_file(path, REGION)


def test_netcdf_of_another_kind_is_refused(tmp_path: Path) -> None:
    path = tmp_path / 'field.nc'
    path.write_bytes(b'\x89HDF\r\n\x1a\n' + bytes(100))  # NetCDF 4
    with pytest.raises(ValueError, match=r'not a whole NetCDF 3 file'):
        read_grid_file(path, REGION)


@pytest.mark.parametrize(
    ('region', 'message'),
    [
        (GridSpec(cols=4, rows=2, cell_m=10.0), r'east_m goes from 0 to 30 m; .* from 5 to 35 m'),
        (GridSpec(cols=3, rows=3, cell_m=10.0), r'north_m goes from 0 to 20 m; .* from 5 to 25 m'),
    ],
)
def test_grid_must_hold_every_cell_centre(tmp_path: Path, region: GridSpec, message: str) -> None:
    path = write_csv(tmp_path / 'field.csv', csv_lines())
    with pytest.raises(ValueError, match=message):
        read_grid_file(path, region)


def test_grid_of_just_the_cell_centres_is_enough(tmp_path: Path) -> None:
    lines = [f'{east},{north},1' for east in (5, 15, 25) for north in (5, 15)]
    field = read_grid_file(write_csv(tmp_path / 'field.csv', lines), REGION)
    assert field.sample(REGION.centre((2, 1))) == 1.0


@pytest.mark.parametrize(
    ('name', 'message'),
    [
        ('field.txt', r'must end in \.csv or \.nc'),
        ('nowhere.csv', r'nowhere\.csv: No such file'),
        ('nowhere.nc', r'nowhere\.nc: No such file'),
    ],
)
def test_file_that_is_not_there_is_named(tmp_path: Path, name: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        read_grid_file(tmp_path / name, REGION)
