from __future__ import annotations

import math
from fractions import Fraction

import hypothesis.strategies as st
import msgspec
import numpy as np
import pytest
from hypothesis import given

from msgs_json.geometry import (
    TIME_TOLERANCE_S,
    TOLERANCE,
    Cell,
    GridSpec,
    Point,
    is_before,
    mask_problems,
    path_length_m,
    path_problem,
    surface_deadline_s,
    unreachable_cells,
    whole_ticks,
    within_range,
)

REGION = GridSpec(cols=4, rows=3, cell_m=10.0)
BAY = GridSpec(cols=4, rows=3, cell_m=10.0, masked=((1, 1), (3, 0), (2, 0)))
"""
In the terminal view, north up::

    . . . .
    . # . .
    . . # #
"""

coordinates_m = st.floats(-1e4, 1e4)
points = st.builds(Point, east_m=coordinates_m, north_m=coordinates_m)
regions = st.builds(
    GridSpec, cols=st.integers(1, 1000), rows=st.integers(1, 1000), cell_m=st.floats(0.1, 1e4)
)


# --- points --------------------------------------------------------------------------------------


def test_distance() -> None:
    assert Point(east_m=1.0, north_m=-1.0).distance_m(Point(east_m=4.0, north_m=3.0)) == 5.0


@given(points, points, st.floats(0, 1e5))
def test_going_toward_a_point_moves_by_the_length_or_arrives_exactly(
    start: Point, target: Point, length_m: float
) -> None:
    end = start.toward(target, length_m)
    whole_m = start.distance_m(target)
    if whole_m <= length_m:
        assert end == target
    else:
        assert start.distance_m(end) == pytest.approx(length_m, rel=1e-6, abs=1e-6)
        on_the_line_m = start.distance_m(end) + end.distance_m(target)
        assert on_the_line_m == pytest.approx(whole_m, rel=1e-6, abs=1e-6)


def test_arrival_forgives_rounding() -> None:
    target = Point(east_m=0.3, north_m=0.0)
    here = Point(east_m=0.0, north_m=0.0)
    assert here.toward(target, 0.1 + 0.1 + 0.1 - 1e-16) is target
    assert here.toward(target, 0.3 * (1 - 10 * TOLERANCE)) != target


def test_length_of_a_polyline() -> None:
    track = [REGION.centre(cell) for cell in ((0, 0), (1, 0), (1, 1), (1, 0))]
    assert path_length_m(track) == 30.0
    assert path_length_m(track[:1]) == path_length_m([]) == 0.0


# --- cells ---------------------------------------------------------------------------------------


def test_cells_count_from_the_south_west() -> None:
    assert REGION.centre((0, 0)) == Point(east_m=5.0, north_m=5.0)
    assert REGION.centre((3, 0)) == Point(east_m=35.0, north_m=5.0)
    assert REGION.index((3, 1)) == (1, 3)
    assert REGION.cells_total == 12


@pytest.mark.parametrize(
    ('cell', 'inside'),
    [((0, 0), True), ((3, 2), True), ((4, 0), False), ((0, 3), False), ((-1, 0), False)],
)
def test_region_contains_its_cells_only(cell: Cell, inside: bool) -> None:
    assert REGION.contains(cell) is inside


@given(regions, st.data())
def test_the_centre_of_a_cell_lies_in_it(region: GridSpec, data: st.DataObject) -> None:
    cell = (
        data.draw(st.integers(0, region.cols - 1)),
        data.draw(st.integers(0, region.rows - 1)),
    )
    assert region.cell_at(region.centre(cell)) == cell


@given(regions, points)
def test_a_point_outside_gets_the_nearest_cell(region: GridSpec, point: Point) -> None:
    cell = region.cell_at(point)
    assert region.contains(cell)
    extent_m = (region.cols * region.cell_m, region.rows * region.cell_m)
    nearest = Point(
        east_m=min(max(point.east_m, 0.0), extent_m[0]),
        north_m=min(max(point.north_m, 0.0), extent_m[1]),
    )
    centre = region.centre(cell)
    half_m = region.cell_m / 2 * (1 + 1e-6)
    assert abs(nearest.east_m - centre.east_m) <= half_m
    assert abs(nearest.north_m - centre.north_m) <= half_m


@pytest.mark.parametrize(
    ('east_m', 'north_m', 'neighbour'),
    [
        (15.0, 15.0, None),  # at the centre
        (15.0 + 1e-9, 15.0, None),  # as good as at the centre
        (15.1, 15.0, (2, 1)),
        (10.0, 15.0, (0, 1)),  # on the edge between the two
        (15.0, 24.0, (1, 2)),  # well inside the neighbour
        (15.0, 14.9, (1, 0)),
        (17.0, 18.0, (1, 2)),  # on two sides: the one it is farther on
        (17.0, 13.5, (2, 1)),
    ],
)
def test_neighbour_toward_a_point(east_m: float, north_m: float, neighbour: Cell | None) -> None:
    point = Point(east_m=east_m, north_m=north_m)
    assert REGION.neighbour_toward((1, 1), point, REGION.neighbours((1, 1))) == neighbour


def test_only_some_neighbours_may_count() -> None:
    point = Point(east_m=17.0, north_m=18.0)
    assert REGION.neighbour_toward((1, 1), point, [(2, 1), (0, 1)]) == (2, 1)
    assert REGION.neighbour_toward((1, 1), point, [(0, 1)]) is None
    assert REGION.neighbour_toward((1, 1), point, []) is None


def test_outside_the_region_there_is_no_neighbour() -> None:
    corner = (3, 2)
    beside = REGION.neighbours(corner)
    assert beside == ((2, 2), (3, 1))
    assert REGION.neighbour_toward(corner, Point(east_m=38.0, north_m=25.0), beside) is None
    assert REGION.neighbour_toward(corner, Point(east_m=38.0, north_m=24.0), beside) == (3, 1)


@given(regions, st.data(), st.floats(1e-6, 1.0))
def test_on_the_way_to_a_neighbour_a_point_lies_toward_it(
    region: GridSpec, data: st.DataObject, share: float
) -> None:
    cell = (
        data.draw(st.integers(0, region.cols - 1)),
        data.draw(st.integers(0, region.rows - 1)),
    )
    east, north = data.draw(st.sampled_from([(1, 0), (0, 1), (-1, 0), (0, -1)]))
    neighbour = (cell[0] + east, cell[1] + north)
    between = region.centre(cell).toward(region.centre(neighbour), share * region.cell_m)
    expected = neighbour if region.contains(neighbour) else None
    assert region.neighbour_toward(cell, between, region.neighbours(cell)) == expected


# --- masked cells --------------------------------------------------------------------------------

grids = st.builds(
    GridSpec,
    cols=st.integers(1, 5),
    rows=st.integers(1, 5),
    cell_m=st.just(1.0),
    masked=st.lists(st.tuples(st.integers(0, 6), st.integers(0, 6)), max_size=20).map(tuple),
)
"""Some cells are masked, some of them twice or beside the grid."""


def test_masked_cells_are_no_cells_of_the_region() -> None:
    assert BAY.cells_total == 9
    assert BAY.cells == (
        *((0, 0), (1, 0)),
        *((0, 1), (2, 1), (3, 1)),
        *((0, 2), (1, 2), (2, 2), (3, 2)),
    )
    assert not BAY.contains((1, 1))
    assert BAY.is_on_grid((1, 1))
    assert BAY.neighbours((0, 1)) == ((0, 2), (0, 0))
    assert BAY.neighbours((1, 2)) == ((2, 2), (0, 2))


def test_a_point_over_land_is_in_its_masked_cell() -> None:
    assert BAY.cell_at(Point(east_m=15.0, north_m=15.0)) == (1, 1)


@given(grids)
def test_all_ways_to_look_at_a_mask_agree(region: GridSpec) -> None:
    everything = [(col, row) for row in range(region.rows) for col in range(region.cols)]
    inside = [cell for cell in everything if cell not in region.masked]
    assert list(region.cells) == inside == [cell for cell in everything if region.contains(cell)]
    assert region.cells_total == len(inside)
    assert region.mask.shape == (region.rows, region.cols)
    assert inside == [cell for cell in everything if not region.mask[region.index(cell)]]
    assert inside == [cell for cell in everything if region.problem_with(cell) is None]


def test_a_size_is_said_in_words() -> None:
    assert str(REGION) == '4 x 3 cells of 10 m'
    assert str(BAY) == '4 x 3 cells of 10 m, 3 of them masked'


def test_nobody_can_change_a_mask() -> None:
    with pytest.raises(ValueError, match='read-only'):
        BAY.mask[0, 0] = True


def test_a_region_with_a_mask_is_a_value() -> None:
    again = msgspec.json.decode(msgspec.json.encode(BAY), type=GridSpec)
    assert again == BAY
    assert hash(again) == hash(BAY)
    assert again.cells == BAY.cells
    assert msgspec.structs.replace(BAY, masked=()) == REGION
    assert msgspec.structs.replace(BAY, masked=()).cells_total == 12  # nothing kept of the other


def test_masked_cells_that_are_none_are_told() -> None:
    assert list(mask_problems(BAY)) == []
    region = msgspec.structs.replace(BAY, masked=((1, 1), (4, 0), (1, 1), (0, 3)))
    assert list(mask_problems(region)) == [
        (1, 'is [4, 0], outside the grid; allowed: columns 0 to 3, rows 0 to 2'),
        (2, 'is [1, 1], which is masked already; allowed: each cell once'),
        (3, 'is [0, 3], outside the grid; allowed: columns 0 to 3, rows 0 to 2'),
    ]


def test_moves_go_around_what_is_masked() -> None:
    assert BAY.moves_from([(1, 0)])[2, 1] == 6
    assert REGION.moves_from([(1, 0)])[2, 1] == 2
    assert BAY.moves_from([(1, 0), (3, 2)])[2, 1] == 2  # from the nearest
    assert BAY.moves_from([]) == {}


@given(grids, st.data())
def test_moves_from_a_cell_are_those_of_the_shortest_path(
    region: GridSpec, data: st.DataObject
) -> None:
    sources = data.draw(st.lists(st.sampled_from(region.cells or ((0, 0),)), max_size=3))
    sources = [cell for cell in sources if region.contains(cell)]
    # As it is written: no cell is nearer than one more than its nearest neighbour, to the end.
    moves = np.full((region.rows, region.cols), np.inf)
    for cell in sources:
        moves[region.index(cell)] = 0.0
    for _ in region.cells:
        for cell in region.cells:
            for beside in region.neighbours(cell):
                farther = moves[region.index(beside)] + 1
                moves[region.index(cell)] = min(moves[region.index(cell)], farther)
    found = region.moves_from(sources)
    for cell in region.cells:
        assert found.get(cell, np.inf) == moves[region.index(cell)]
    reached = {cell for cell in region.cells if np.isfinite(moves[region.index(cell)])}
    assert unreachable_cells(region, sources) == tuple(
        cell for cell in region.cells if cell not in reached
    )


def test_cells_behind_land_are_unreachable_row_by_row() -> None:
    region = GridSpec(cols=4, rows=2, cell_m=1.0, masked=((1, 0), (1, 1)))
    assert unreachable_cells(region, [(0, 1)]) == ((2, 0), (3, 0), (2, 1), (3, 1))
    assert unreachable_cells(region, [(0, 1), (3, 1)]) == ()


def test_a_path_through_land_is_told_from_one_that_leaves() -> None:
    assert path_problem([(0, 1), (1, 1)], BAY) == 'cell [1, 1] is masked (land, no-go)'
    assert path_problem([(3, 1), (4, 1)], BAY) == (
        'cell [4, 1] lies outside the region of 4 x 3 cells'
    )
    assert path_problem([(0, 1), (0, 0)], BAY) is None


# --- paths ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('path', 'problem'),
    [
        ([(0, 0), (1, 0), (1, 1), (0, 1), (0, 0)], None),
        ([(0, 0), (1, 1)], 'from [0, 0] to [1, 1]'),
        ([(0, 0), (2, 0)], 'from [0, 0] to [2, 0]'),
        ([(1, 1), (1, 1)], 'from [1, 1] to [1, 1]'),
        ([(3, 2), (4, 2)], 'cell [4, 2] lies outside the region of 4 x 3 cells'),
        ([], None),
    ],
)
def test_path_problem(path: list[Cell], problem: str | None) -> None:
    found = path_problem(path, REGION)
    assert found == problem if problem is None else problem in str(found)


def test_without_a_region_a_path_may_lie_anywhere() -> None:
    assert path_problem([(800, 7), (801, 7)]) is None


# --- ticks ---------------------------------------------------------------------------------------


@given(st.integers(0, 10**6), st.floats(0.001, 1000), st.integers(1, 1000))
def test_a_whole_number_of_ticks_stays_one_however_it_was_computed(
    ticks: int, tick_s: float, parts: int
) -> None:
    assert whole_ticks((ticks * tick_s) / tick_s) == ticks
    assert whole_ticks(sum([ticks / parts] * parts)) == ticks  # adding up rounds each time


@given(st.fractions(0, 10**6, max_denominator=10**6))
def test_other_numbers_of_ticks_are_rounded_up(ticks: Fraction) -> None:
    assert whole_ticks(float(ticks)) == math.ceil(ticks) or ticks - math.floor(ticks) < 1e-3


def test_what_is_clearly_more_than_whole_takes_one_more() -> None:
    assert whole_ticks(14.0 + 1e-6) == 15
    assert whole_ticks(14.0 + 1e-9) == 14
    assert whole_ticks(1e-10) == 0
    assert whole_ticks(-3.5) == -3


@pytest.mark.parametrize(
    ('distance_m', 'inside'), [(20.0, True), (20.0 + 1e-9, True), (20.001, False)]
)
def test_the_edge_of_the_disc_belongs_to_it(distance_m: float, inside: bool) -> None:
    assert within_range(distance_m, 20.0) is inside


def test_times_as_good_as_equal_are_not_before_each_other() -> None:
    assert is_before(1.0, 1.1)
    assert not is_before(1.1, 1.0)
    assert not is_before(1.0, 1.0 + TIME_TOLERANCE_S / 2)
    now_s = 1.8e9  # ROS time of a sea trial, where a float's step is 2e-7 s
    assert not is_before(now_s, now_s + 2.4e-7)
    assert is_before(now_s, now_s + 0.001)


@pytest.mark.parametrize(
    ('way_m', 'margin_s', 'tick_s', 'deadline_s'),
    [
        (60.0, 0.0, 1.0, 160.0),
        (60.5, 0.0, 1.0, 161.0),  # rounded up to a tick
        (60.0, 2.5, 1.0, 163.0),
        (60.0, 0.0, 0.1, 160.0),  # 600 ticks, although 60 / 0.1 is not exact
        (0.0, 0.0, 1.0, 100.0),
    ],
)
def test_surface_deadline(way_m: float, margin_s: float, tick_s: float, deadline_s: float) -> None:
    assert surface_deadline_s(100.0, way_m, 1.0, margin_s, tick_s) == pytest.approx(deadline_s)


def test_the_part_of_a_cell_is_what_can_be_reached_from_it() -> None:
    # Masked: a wall with no gate in it, and a corner that is cut off.
    grid = GridSpec(cols=5, rows=4, cell_m=1.0, masked=((2, 0), (2, 1), (2, 2), (2, 3), (3, 0)))
    for cell in grid.cells:
        assert grid.part_of(cell) == frozenset(grid.moves_from([cell]))
    assert len({grid.part_of(cell) for cell in grid.cells}) == 2
