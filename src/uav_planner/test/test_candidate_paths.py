from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import hypothesis.strategies as st
import msgspec
import numpy as np
import pytest
from hypothesis import given

from msgs_json.geometry import Cell, GridSpec
from uav_planner.candidate_paths import (
    DOCUMENTED_TIE_ORDER,
    LISTED_MOVES_MAX,
    Direction,
    TieOrder,
    every_tie_order,
    greedy_cell,
    walk_table,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

GRID = GridSpec(cols=5, rows=4, cell_m=10.0)

starts = st.tuples(st.integers(0, 4), st.integers(0, 3))
masks = st.lists(starts, max_size=6)
"""More often than not there is land; never where the walks begin."""


def map_of(
    halvings: list[int], masked: list[Cell], start: Cell
) -> tuple[NDArray[np.float64], GridSpec]:
    region = msgspec.structs.replace(GRID, masked=tuple(cell for cell in masked if cell != start))
    return np.where(region.mask, 0.0, 0.5 ** np.array(halvings).reshape(4, 5)), region


def test_documented_order_is_east_north_west_south_first_move_fastest() -> None:
    table = walk_table(2, DOCUMENTED_TIE_ORDER)
    assert [table.path(walk, (5, 5))[1] for walk in range(4)] == [(6, 5), (5, 6), (4, 5), (5, 4)]
    assert [table.path(walk, (5, 5))[2] for walk in range(4)] == [(7, 5), (6, 6), (5, 5), (6, 4)]
    assert table.path(4, (5, 5)) == ((5, 5), (6, 5), (6, 6))


@pytest.mark.parametrize('tie_order', every_tie_order(), ids=lambda order: order.name)
def test_every_order_tables_every_walk_in_its_order(tie_order: TieOrder) -> None:
    moves = 3
    table = walk_table(moves, tie_order)
    expected = []
    for walk in itertools.product(tie_order.directions, repeat=moves):
        path = [(7, 7)]
        for direction in walk[::-1] if tie_order.first_move_fastest else walk:
            path.append((path[-1][0] + direction.value[0], path[-1][1] + direction.value[1]))
        expected.append(tuple(path))
    assert [table.path(walk, (7, 7)) for walk in range(4**moves)] == expected
    walks = np.array([5, 0, 63])
    tracks = table.tracks(walks, (7, 7))
    assert tracks.shape == (2, moves + 1, 3)
    for place, walk in enumerate(walks):
        assert tuple(zip(*tracks[:, :, place].tolist(), strict=True)) == expected[walk][::-1]


def test_there_are_48_orders_and_each_has_its_name() -> None:
    orders = every_tie_order()
    assert len(set(orders)) == len({order.name for order in orders}) == 48
    assert orders[0] == DOCUMENTED_TIE_ORDER
    assert DOCUMENTED_TIE_ORDER.name == 'enws-first'
    assert all(TieOrder.named(order.name) == order for order in orders)


@pytest.mark.parametrize('name', ['', 'enws', 'enww-first', 'ENWS-first', None, 3])
def test_unknown_order_names_are_refused(name: str) -> None:
    with pytest.raises(ValueError, match=r"as in 'enws-first', not "):
        TieOrder.named(name)


def test_an_order_has_all_four_directions() -> None:
    with pytest.raises(ValueError, match='EAST'):
        TieOrder(directions=(Direction.EAST, Direction.EAST, Direction.WEST, Direction.SOUTH))


def test_straight_fresh_cells_score_their_number() -> None:
    scores = walk_table(3, DOCUMENTED_TIE_ORDER).scores(np.ones((4, 5)), (0, 0))
    assert scores[0] == 3.0  # east, east, east


def test_coming_back_counts_half_and_every_turn_costs() -> None:
    values = np.ones((1, 3))
    values[0, 0] = 0.5  # the AUV was there
    table = walk_table(3, DOCUMENTED_TIE_ORDER)
    walk = next(
        walk for walk in range(64) if table.path(walk, (0, 0)) == ((0, 0), (1, 0), (0, 0), (1, 0))
    )
    assert table.scores(values, (0, 0))[walk] == 1.0 + 0.25 + 0.5 - 2 * 0.05


@given(
    halvings=st.lists(st.integers(0, 6), min_size=20, max_size=20),
    masked=masks,
    start=starts,
    moves=st.integers(1, 4),
    tie_order=st.sampled_from(every_tie_order()),
)
def test_scores_are_those_of_entering_cell_by_cell(
    halvings: list[int], masked: list[Cell], start: Cell, moves: int, tie_order: TieOrder
) -> None:
    values, region = map_of(halvings, masked, start)
    table = walk_table(moves, tie_order)
    scores = table.scores(values, start)
    for walk in range(4**moves):
        path = table.path(walk, start)
        if not all(region.contains(cell) for cell in path):
            assert scores[walk] == -np.inf
            continue
        left = values.copy()
        left[GRID.index(start)] /= 2
        score = 0.0
        for cell in path[1:]:
            score += left[GRID.index(cell)]
            left[GRID.index(cell)] /= 2
        for before, turn, after in zip(path, path[1:], path[2:], strict=False):
            straight_on = (2 * turn[0] - before[0], 2 * turn[1] - before[1])
            score -= 0.05 * (after != straight_on)
        assert scores[walk] == pytest.approx(score, abs=1e-12)


def test_tables_are_shared_and_read_only() -> None:
    table = walk_table(2, DOCUMENTED_TIE_ORDER)
    assert walk_table(2, TieOrder()) is table
    for array in (
        table.offsets,
        table.value_indices,
        table.turn_costs,
    ):
        with pytest.raises(ValueError, match='read-only'):
            array[...] = 0


@pytest.mark.parametrize('moves', [0, -1, LISTED_MOVES_MAX + 1])
def test_walks_too_short_or_too_many_are_refused(moves: int) -> None:
    with pytest.raises(ValueError, match=f'1 to {LISTED_MOVES_MAX} moves, not {moves}'):
        walk_table(moves, DOCUMENTED_TIE_ORDER)


def test_greedy_cell_is_the_first_of_the_best_neighbours() -> None:
    values = np.ones((4, 5))
    north_first = TieOrder.named('nwse-first')
    assert greedy_cell(values, GRID, (2, 2), DOCUMENTED_TIE_ORDER) == (3, 2)
    assert greedy_cell(values, GRID, (2, 2), north_first) == (2, 3)
    assert greedy_cell(values, GRID, (4, 3), DOCUMENTED_TIE_ORDER) == (3, 3)  # north-east corner
    values[2, 3] = 1.0 - 1e-10  # east is worse, but by less than counts
    assert greedy_cell(values, GRID, (2, 2), DOCUMENTED_TIE_ORDER) == (3, 2)
    values[2, 3] = 0.5
    assert greedy_cell(values, GRID, (2, 2), DOCUMENTED_TIE_ORDER) == (2, 3)


def test_the_greedy_cell_is_never_land() -> None:
    island = GridSpec(cols=3, rows=3, cell_m=10.0, masked=((2, 1), (1, 2), (0, 1)))
    values = np.where(island.mask, 0.0, 1.0)
    assert greedy_cell(values, island, (1, 1), DOCUMENTED_TIE_ORDER) == (1, 0)
    with pytest.raises(ValueError, match=r'cell \[2, 2\] has no neighbour in the region'):
        greedy_cell(values, island, (2, 2), DOCUMENTED_TIE_ORDER)


def test_a_single_cell_has_no_greedy_neighbour() -> None:
    grid = GridSpec(cols=1, rows=1, cell_m=10.0)
    with pytest.raises(ValueError, match='no neighbour'):
        greedy_cell(np.ones((1, 1)), grid, (0, 0), DOCUMENTED_TIE_ORDER)
