"""
Survey fields from files: values on a rectangular grid, linear in between.

CSV with the columns ``east_m``, ``north_m`` and ``value``, one line per grid point in any order;
or NetCDF 3 with the variables ``east_m(x)``, ``north_m(y)`` and ``value(y, x)``. Positions are in
frame ``map``; lines of the grid may lie unevenly. The grid must hold the centres of all cells.
"""

from __future__ import annotations

import csv
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.interpolate import RegularGridInterpolator
from scipy.io import netcdf_file

from msgs_json.geometry import TOLERANCE

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from msgs_json.geometry import GridSpec, Point

VALUE_LIMIT = 1e9
"""Largest size of a value that a survey sample may have (`msgs_json.messages.Sample`)."""

COLUMNS = ('east_m', 'north_m', 'value')


class GriddedField:
    """
    Values on a grid, interpolated; outside the grid the value at its nearest edge.

    Parameters
    ----------
    east_m, north_m
        Lines of the grid in frame ``map``, strictly rising or falling.
    values
        Indexed ``[north, east]``, finite.

    """

    def __init__(
        self,
        east_m: NDArray[np.float64],
        north_m: NDArray[np.float64],
        values: NDArray[np.float64],
    ) -> None:
        self._east_range_m = (float(east_m.min()), float(east_m.max()))
        self._north_range_m = (float(north_m.min()), float(north_m.max()))
        self._values = RegularGridInterpolator((north_m, east_m), values)

    def sample(self, point: Point) -> float:
        """Return the value at a point, in the file's unit."""
        place_m = (
            np.clip(point.north_m, *self._north_range_m),
            np.clip(point.east_m, *self._east_range_m),
        )
        return float(self._values(place_m).item())


def read_grid_file(path: Path, region: GridSpec) -> GriddedField:
    """
    Return the field that a file holds.

    Raises
    ------
    ValueError
        Names the file, the line or variable, the value, and what is allowed.

    """
    readers = {'.csv': _read_csv, '.nc': _read_netcdf}
    if path.suffix not in readers:
        raise ValueError(f'{path}: a survey field file must end in {" or ".join(readers)}')
    try:
        east_m, north_m, values = readers[path.suffix](path)
    except OSError as error:
        raise ValueError(f'{path}: {error.strerror or error}') from None
    except csv.Error as error:
        raise ValueError(f'{path}: not a CSV file ({error})') from None
    _check_cover(path, 'east_m', east_m, region.cols, region.cell_m)
    _check_cover(path, 'north_m', north_m, region.rows, region.cell_m)
    return GriddedField(east_m, north_m, values)


_Grid = tuple['NDArray[np.float64]', 'NDArray[np.float64]', 'NDArray[np.float64]']
"""Lines east, lines north, values ``[north, east]``."""


def _check_cover(
    path: Path, axis: str, lines_m: NDArray[np.float64], cells: int, cell_m: float
) -> None:
    first_m, last_m = 0.5 * cell_m, (cells - 0.5) * cell_m
    slack_m = TOLERANCE * last_m
    if lines_m.min() > first_m + slack_m or lines_m.max() < last_m - slack_m:
        raise ValueError(
            f'{path}: {axis} goes from {lines_m.min():g} to {lines_m.max():g} m; it must hold the'
            f' cell centres from {first_m:g} to {last_m:g} m'
        )


# --- CSV -----------------------------------------------------------------------------------------


def _read_csv(path: Path) -> _Grid:
    points: dict[tuple[float, float], float] = {}
    with path.open(newline='', encoding='utf-8-sig', errors='replace') as file:
        reader = csv.reader(file)
        header = next(reader, [])
        if sorted(header) != sorted(COLUMNS):
            raise ValueError(f'{path}, line 1: columns are {header}; must be {", ".join(COLUMNS)}')
        for row in filter(None, reader):
            where = f'{path}, line {reader.line_num}'
            east_m, north_m, value = _numbers(row, header, where)
            if (east_m, north_m) in points:
                raise ValueError(f'{where}: point ({east_m:g}, {north_m:g}) is there twice')
            points[east_m, north_m] = value
    east_m_lines = sorted({east_m for east_m, _ in points})
    north_m_lines = sorted({north_m for _, north_m in points})
    _check_lines(path, 'east_m', np.array(east_m_lines))
    _check_lines(path, 'north_m', np.array(north_m_lines))
    for north_m, east_m in product(north_m_lines, east_m_lines):
        if (east_m, north_m) not in points:
            raise ValueError(
                f'{path}: point ({east_m:g}, {north_m:g}) is missing; the points must form a grid'
                f' of {len(east_m_lines)} x {len(north_m_lines)}'
            )
    values = [[points[east_m, north_m] for east_m in east_m_lines] for north_m in north_m_lines]
    return np.array(east_m_lines), np.array(north_m_lines), np.array(values)


def _numbers(row: list[str], header: list[str], where: str) -> tuple[float, float, float]:
    if len(row) != len(header):
        raise ValueError(f'{where}: has {len(row)} columns; must have {len(header)}')
    numbers = {}
    for column, text in zip(header, row, strict=True):
        try:
            numbers[column] = float(text)
        except ValueError:
            raise ValueError(f'{where}: {column} is {text!r}; must be a number') from None
        if not abs(numbers[column]) <= VALUE_LIMIT:
            raise ValueError(f'{where}: {column} is {text}; must be within +-{VALUE_LIMIT:g}')
    return numbers['east_m'], numbers['north_m'], numbers['value']


def _check_lines(path: Path, axis: str, lines_m: NDArray[np.float64]) -> None:
    steps_m = np.diff(lines_m)
    if len(lines_m) < 2 or not (np.all(steps_m > 0) or np.all(steps_m < 0)):
        raise ValueError(
            f'{path}: {axis} is {lines_m.tolist()[:10]}; it must have at least 2 different values,'
            ' rising or falling'
        )


# --- NetCDF 3 ------------------------------------------------------------------------------------

_Variable = tuple[tuple[str, ...], Any]
"""Names of the dimensions, and the array: masked where values are missing."""


def _read_netcdf(path: Path) -> _Grid:
    variables = _netcdf_variables(path)
    missing = [name for name in COLUMNS if name not in variables]
    if missing:
        raise ValueError(f'{path}: variable {missing[0]} is missing; must have {COLUMNS}')
    (east, _), (north, _), (dimensions, _) = (variables[name] for name in COLUMNS)
    if len(east) != 1 or len(north) != 1 or dimensions != north + east:
        raise ValueError(
            f'{path}: the dimensions are east_m{east}, north_m{north}, value{dimensions}; they'
            ' must be east_m(x), north_m(y), value(y, x)'
        )
    east_m, north_m, values = (_numeric(path, name, variables[name][1]) for name in COLUMNS)
    _check_lines(path, 'east_m', east_m)
    _check_lines(path, 'north_m', north_m)
    return east_m, north_m, values


def _netcdf_variables(path: Path) -> dict[str, _Variable]:
    try:
        with netcdf_file(path, 'r', mmap=False, maskandscale=True) as file:
            return {
                name: (variable.dimensions, variable[:])
                for name, variable in file.variables.items()
                if name in COLUMNS
            }
    # What scipy's reader raises for files of another kind, cut short or damaged.
    except (LookupError, TypeError, ValueError, OverflowError, MemoryError) as error:
        raise ValueError(f'{path}: not a whole NetCDF 3 file ({error})') from None


def _numeric(path: Path, name: str, array: Any) -> NDArray[np.float64]:  # noqa: ANN401  from scipy
    if array.dtype.kind not in 'iuf':
        raise ValueError(f'{path}: variable {name} has type {array.dtype}; must be a number')
    numbers: NDArray[np.float64] = np.ma.filled(array.astype(np.float64), np.nan)
    bad = np.argwhere(~(np.abs(numbers) <= VALUE_LIMIT))
    if bad.size:
        index = tuple(int(i) for i in bad[0])
        raise ValueError(
            f'{path}: {name}{list(index)} is {numbers[index]}; must be within +-{VALUE_LIMIT:g}'
        )
    return numbers
