from __future__ import annotations

import subprocess
import sys
from typing import TYPE_CHECKING

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings

from auv_sim.gridded_field import GriddedField
from auv_sim.survey_field import (
    GRADIENT_C,
    MEAN_C,
    PLUME_C,
    PLUMES,
    SyntheticField,
    make_field,
)
from msgs_json.geometry import GridSpec, Point

if TYPE_CHECKING:
    from pathlib import Path

REGION = GridSpec(cols=10, rows=8, cell_m=10.0)
CENTRES = [REGION.centre((col, row)) for col in range(REGION.cols) for row in range(REGION.rows)]


def test_same_seed_is_the_same_field_for_every_auv() -> None:
    one, other = (make_field('{"kind": "synthetic", "seed": 7}', REGION) for _ in range(2))
    assert [one.sample(point) for point in CENTRES] == [other.sample(point) for point in CENTRES]


def test_another_seed_is_another_field() -> None:
    values = {SyntheticField(seed, REGION).sample(CENTRES[0]) for seed in range(20)}
    assert len(values) == 20


def test_seed_is_0_where_none_is_given() -> None:
    field = make_field('{"kind": "synthetic"}', REGION)
    assert field.sample(CENTRES[5]) == SyntheticField(0, REGION).sample(CENTRES[5])


def test_synthetic_field_does_not_change_by_sampling() -> None:
    field = SyntheticField(3, REGION)
    first = field.sample(CENTRES[0])
    field.sample(CENTRES[1])
    assert field.sample(CENTRES[0]) == first


@pytest.mark.parametrize(
    'region',
    [REGION, GridSpec(cols=1, rows=1, cell_m=0.1), GridSpec(cols=500, rows=3, cell_m=1e3)],
)
def test_synthetic_field_is_a_sea_temperature(region: GridSpec) -> None:
    least_c, most_c = MEAN_C - GRADIENT_C / 2, MEAN_C + GRADIENT_C / 2 + PLUMES * PLUME_C[1]
    for seed in range(20):
        field = SyntheticField(seed, region)
        for cell in ((0, 0), (region.cols - 1, 0), (region.cols // 2, region.rows // 2)):
            assert least_c <= field.sample(region.centre(cell)) <= most_c


def test_synthetic_field_is_smooth_and_has_structure() -> None:
    for seed in range(20):
        field = SyntheticField(seed, REGION)
        values_c = [field.sample(point) for point in CENTRES]
        assert max(values_c) - min(values_c) > 0.5
        for point in CENTRES:
            beside = Point(east_m=point.east_m + 0.1, north_m=point.north_m)
            assert abs(field.sample(beside) - field.sample(point)) < 0.1


@pytest.mark.parametrize(
    ('spec', 'parts'),
    [
        ('{"kind": "synthtic"}', ['synthtic', '$.kind', '"synthetic"', '"grid_file"']),
        ('{"kind": "synthetic", "seed": -1}', ['$.seed', '-1', '>= 0']),
        ('{"kind": "synthetic", "seed": 1.5}', ['$.seed', '1.5', 'int']),
        ('{"kind": "synthetic", "path": "a.csv"}', ['unknown field `path`']),
        ('{"kind": "grid_file"}', ['missing required field `path`']),
        ('{"kind": "grid_file", "path": ""}', ['$.path', 'length >= 1']),
        ('', ["''", '"synthetic"']),
    ],
)
def test_bad_specification_is_refused(spec: str, parts: list[str]) -> None:
    with pytest.raises(ValueError, match=r'^field is ') as refused:
        make_field(spec, REGION)
    assert [part for part in parts if part not in str(refused.value)] == []


def test_grid_file_is_read(tmp_path: Path) -> None:
    path = tmp_path / 'plane.csv'
    lines = [f'{east},{north},{2 * east - north}' for east in (0, 100) for north in (0, 80)]
    path.write_text('east_m,north_m,value\n' + '\n'.join(lines))
    field = make_field(f'{{"kind": "grid_file", "path": "{path}"}}', REGION)
    assert isinstance(field, GriddedField)
    assert field.sample(Point(east_m=35.0, north_m=75.0)) == pytest.approx(-5.0)


def test_missions_without_a_file_do_not_load_scipy() -> None:
    code = (
        'import sys; from auv_sim.survey_field import make_field;'
        ' from msgs_json.geometry import GridSpec;'
        ' make_field(\'{"kind": "synthetic"}\', GridSpec(cols=2, rows=2, cell_m=1.0));'
        ' sys.exit("scipy" in sys.modules)'
    )
    assert subprocess.run([sys.executable, '-c', code], check=False).returncode == 0


@settings(max_examples=50)
@given(east_m=st.floats(-1e4, 1e4), north_m=st.floats(-1e4, 1e4), seed=st.integers(0, 2**53))
def test_synthetic_field_is_finite_everywhere(east_m: float, north_m: float, seed: int) -> None:
    assert np.isfinite(SyntheticField(seed, REGION).sample(Point(east_m=east_m, north_m=north_m)))
