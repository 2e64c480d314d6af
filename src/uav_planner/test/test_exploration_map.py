from __future__ import annotations

from collections import Counter

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from msgs_json.geometry import Cell, GridSpec
from uav_planner.exploration_map import HALVINGS_MAX, ExplorationMap

GRID = GridSpec(cols=4, rows=3, cell_m=10.0)


def value_at(exploration: ExplorationMap, cell: Cell) -> float:
    return float(exploration.values[GRID.index(cell)])


def test_start_cells_are_visited_and_all_others_worth_one() -> None:
    exploration = ExplorationMap(GRID, [(3, 0), (0, 2)])
    expected = np.ones((3, 4))
    expected[0, 3] = expected[2, 0] = 0.5
    np.testing.assert_array_equal(exploration.values, expected)


def test_assigning_halves_every_entered_cell_but_not_the_first() -> None:
    exploration = ExplorationMap(GRID, [(0, 0)])
    exploration.assign([(0, 0), (1, 0), (2, 0), (1, 0), (0, 0)])
    assert value_at(exploration, (0, 0)) == 0.25  # at the start, and by the way back
    assert value_at(exploration, (1, 0)) == 0.25  # entered twice
    assert value_at(exploration, (2, 0)) == 0.5


def test_only_confirmed_cells_are_explored() -> None:
    grid = GridSpec(cols=2, rows=1, cell_m=10.0)
    exploration = ExplorationMap(grid, [(0, 0)])
    exploration.assign([(0, 0), (1, 0)])
    assert not exploration.is_explored(grid.cells)
    exploration.confirm([(1, 0)])
    assert exploration.is_explored(grid.cells)


def test_values_are_a_live_view_that_planners_cannot_write() -> None:
    exploration = ExplorationMap(GRID, [(0, 0)])
    values = exploration.values
    with pytest.raises(ValueError, match='read-only'):
        values[0, 0] = 1.0
    exploration.assign([(0, 0), (0, 1)])
    assert values[1, 0] == 0.5


@pytest.mark.parametrize('cell', [(-1, 0), (4, 0), (0, 3), (0, -1)])
def test_cells_outside_the_region_are_refused(cell: Cell) -> None:
    exploration = ExplorationMap(GRID, [(0, 0)])
    message = r'cell \[.*\] lies outside the region of 4 x 3 cells'
    with pytest.raises(ValueError, match=message):
        ExplorationMap(GRID, [cell])
    with pytest.raises(ValueError, match=message):
        exploration.assign([(0, 0), cell])
    with pytest.raises(ValueError, match=message):
        exploration.restore([cell])
    with pytest.raises(ValueError, match=message):
        exploration.confirm([cell])


def test_masked_cells_are_worth_nothing_and_nobody_has_to_go_there() -> None:
    grid = GridSpec(cols=3, rows=2, cell_m=10.0, masked=((1, 0), (2, 1)))
    exploration = ExplorationMap(grid, [(0, 0)])
    np.testing.assert_array_equal(exploration.values, [[0.5, 0.0, 1.0], [1.0, 1.0, 0.0]])
    exploration.assign([(0, 0), (0, 1), (1, 1)])
    exploration.confirm([(0, 1), (1, 1)])
    assert exploration.is_explored(grid.moves_from([(0, 0)]))
    assert not exploration.is_explored(grid.cells)  # (2, 0) is behind land
    exploration.assign([(1, 1), (2, 0)])
    exploration.confirm([(2, 0)])
    assert exploration.is_explored(grid.cells)
    with pytest.raises(ValueError, match=r'cell \[1, 0\] is masked'):
        exploration.assign([(0, 0), (1, 0)])
    with pytest.raises(ValueError, match=r'cell \[2, 1\] is masked'):
        exploration.confirm([(2, 1)])
    np.testing.assert_array_equal(exploration.values == 0.0, grid.mask)


def test_a_cell_entered_over_and_over_is_never_taken_for_land() -> None:
    exploration = ExplorationMap(GRID, [(0, 0)])
    to_and_fro = [(0, 0), (1, 0)] * (2 * HALVINGS_MAX)
    exploration.assign(to_and_fro)
    assert value_at(exploration, (0, 0)) > 0.0
    exploration.restore(to_and_fro[1:])
    assert value_at(exploration, (0, 0)) == 0.5


def test_what_was_not_assigned_can_be_neither_restored_nor_confirmed() -> None:
    exploration = ExplorationMap(GRID, [(0, 0)])
    exploration.assign([(0, 0), (1, 0)])
    before = exploration.values.copy()
    with pytest.raises(ValueError, match=r'cell \[2, 0\] has no assigned entry'):
        exploration.restore([(1, 0), (2, 0)])
    with pytest.raises(ValueError, match=r'cell \[0, 0\] has no assigned entry'):
        exploration.restore([(0, 0)])  # the AUV was there at the start
    with pytest.raises(ValueError, match=r'cell \[2, 0\] is reported visited'):
        exploration.confirm([(1, 0), (2, 0)])
    np.testing.assert_array_equal(exploration.values, before)
    exploration.restore([(1, 0)])  # so (1, 0) was not confirmed by the refused call


@st.composite
def walks(draw: st.DrawFn) -> list[Cell]:
    col, row = draw(st.integers(0, GRID.cols - 1)), draw(st.integers(0, GRID.rows - 1))
    path: list[Cell] = [(col, row)]
    for east, north in draw(
        st.lists(st.sampled_from([(1, 0), (0, 1), (-1, 0), (0, -1)]), max_size=8)
    ):
        cell = (path[-1][0] + east, path[-1][1] + north)
        if GRID.contains(cell):
            path.append(cell)
    return path


@given(legs=st.lists(st.tuples(walks(), st.integers(0, 8)), max_size=8))
def test_a_value_is_always_a_half_to_the_power_of_the_entries(
    legs: list[tuple[list[Cell], int]],
) -> None:
    """Legs overlap in time: all are assigned before the first is reported, each cut anywhere."""
    exploration = ExplorationMap(GRID, [(0, 0)])
    entries = Counter([(0, 0)])
    visited = {(0, 0)}

    def check() -> None:
        for row in range(GRID.rows):
            for col in range(GRID.cols):
                assert value_at(exploration, (col, row)) == 0.5 ** entries[col, row]
        assert exploration.values.max() <= 1.0
        assert all(value_at(exploration, cell) <= 0.5 for cell in visited)
        assert exploration.is_explored(GRID.cells) == (len(visited) == GRID.cells_total)

    for path, _ in legs:
        exploration.assign(path)
        entries.update(path[1:])
        check()
    for path, reached in legs:
        exploration.confirm(path[1 : reached + 1])
        exploration.restore(path[reached + 1 :])
        visited.update(path[1 : reached + 1])
        entries.subtract(path[reached + 1 :])
        check()


# --- the region changes --------------------------------------------------------------------------

cells = st.tuples(st.integers(0, 3), st.integers(0, 2))


def test_a_cell_that_is_masked_is_worth_nothing_and_nobody_waits_for_it() -> None:
    whole = ExplorationMap(GridSpec(cols=3, rows=1, cell_m=10.0), [(0, 0)])
    whole.assign([(0, 0), (1, 0)])
    whole.confirm([(1, 0)])
    without_last = GridSpec(cols=3, rows=1, cell_m=10.0, masked=((2, 0),))
    part = whole.of_region(without_last)
    assert not whole.is_explored([(0, 0), (1, 0), (2, 0)])
    assert part.is_explored(without_last.cells)
    assert part.values.tolist() == [[0.5, 0.5, 0.0]]
    with pytest.raises(ValueError, match=r'cell \[2, 0\] is masked'):
        part.assign([(1, 0), (2, 0)])


@given(
    path=st.lists(cells, max_size=12),
    reached=st.integers(0, 12),
    masks=st.lists(st.frozensets(cells), max_size=4),
)
def test_cells_that_come_back_are_known_as_before(
    path: list[Cell], reached: int, masks: list[frozenset[Cell]]
) -> None:
    exploration = ExplorationMap(GRID, [])
    exploration.assign([(0, 0), *path])
    exploration.confirm(path[:reached])
    changed = exploration
    for mask in masks:
        region = GridSpec(cols=4, rows=3, cell_m=10.0, masked=tuple(sorted(mask)))
        changed = changed.of_region(region)
        for cell in GRID.cells:
            expected = 0.0 if cell in mask else value_at(exploration, cell)
            assert value_at(changed, cell) == expected
        assert changed.is_explored(region.cells) == ({*region.cells} <= {*path[:reached]})
    back = changed.of_region(GRID)
    np.testing.assert_array_equal(back.values, exploration.values)
    assert back.is_explored(GRID.cells) == exploration.is_explored(GRID.cells)
    assert back.changed_rows() == exploration.changed_rows()


@given(st.lists(st.lists(cells, max_size=6), max_size=6))
def test_rows_that_have_changed_are_all_that_another_map_needs_to_be_told(
    paths: list[list[Cell]],
) -> None:
    exploration = ExplorationMap(GRID, [(0, 0)])
    told = exploration.changed_rows()
    assert len(told) == GRID.rows
    assert exploration.changed_rows() == {}
    for path in paths:
        exploration.assign([(0, 0), *path])
        exploration.confirm(path[:2])
        exploration.restore(path[2:])
        rows = exploration.changed_rows()
        assert rows.keys() == {row for _, row in path}
        told |= rows
    again = ExplorationMap(GRID, [])
    again.recall(told)
    np.testing.assert_array_equal(again.values, exploration.values)
    assert again.changed_rows() == {}
    assert exploration.of_region(GRID).changed_rows() == {}
