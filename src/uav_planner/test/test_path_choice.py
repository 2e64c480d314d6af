from __future__ import annotations

import zlib
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings

from msgs_json.geometry import Cell, GridSpec
from uav_planner.candidate_paths import (
    DOCUMENTED_TIE_ORDER,
    TIE_MARGIN,
    TieOrder,
    WalkTable,
    every_tie_order,
    walk_table,
)
from uav_planner.path_choice import SINGLE_CHECKS, best_path

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

Path = tuple[Cell, ...]

GRID = GridSpec(cols=6, rows=5, cell_m=10.0)
CELLS = st.tuples(st.integers(0, GRID.cols - 1), st.integers(0, GRID.rows - 1))
HALVINGS = st.sampled_from([1.0, 0.5, 0.25])
NEAR_TIES = st.integers(0, 8).map(lambda parts: 1.0 - 0.4 * TIE_MARGIN * parts)


@dataclass
class Allowed:
    """A set of paths like any other: all that ``rule`` is true for."""

    rule: Callable[[Path], bool]
    asked: list[Path] = field(default_factory=list)

    def allows(self, path: Path) -> bool:
        self.asked.append(path)
        return self.rule(path)

    def allows_each(self, tracks: NDArray[np.intp]) -> NDArray[np.bool_]:
        paths = [tuple(map(tuple, track.tolist()[::-1])) for track in tracks.transpose(2, 1, 0)]
        return np.array([self.allows(path) for path in paths], dtype=np.bool_)


@st.composite
def maps(draw: st.DrawFn) -> NDArray[np.float64]:
    values = draw(st.sampled_from([HALVINGS, NEAR_TIES]))
    cells = GRID.cells_total
    return np.array(draw(st.lists(values, min_size=cells, max_size=cells))).reshape(
        GRID.rows, GRID.cols
    )


@st.composite
def rules(draw: st.DrawFn) -> Callable[[Path], bool]:
    """Draw an arbitrary set; most are large or small, as where a limit binds little or much."""
    share = draw(st.sampled_from([0.0, 0.02, 0.5, 0.98, 1.0]))
    salt = draw(st.integers(0, 2**32 - 1))
    return lambda path: zlib.crc32(repr(path).encode(), salt) < share * 2**32


def best_by_enumeration(
    table: WalkTable, values: NDArray[np.float64], start: Cell, rule: Callable[[Path], bool]
) -> Path | None:
    """Compare all allowed walks in tie order; a later one wins if better by the margin."""
    best: Path | None = None
    best_score = 0.0
    for walk, score in enumerate(table.scores(values, start).tolist()):
        path = table.path(walk, start)
        if not all(GRID.contains(cell) for cell in path) or not rule(path):
            continue
        if best is None or score > best_score + TIE_MARGIN:
            best, best_score = path, score
    return best


@given(
    values=maps(),
    start=CELLS,
    moves=st.integers(1, 4),
    tie_order=st.sampled_from(every_tie_order()),
    rule=rules(),
)
@settings(max_examples=200)
def test_the_choice_is_that_of_a_loop_over_all_allowed_paths(
    values: NDArray[np.float64],
    start: Cell,
    moves: int,
    tie_order: TieOrder,
    rule: Callable[[Path], bool],
) -> None:
    table = walk_table(moves, tie_order)
    allowed = Allowed(rule)
    path = best_path(table, values, start, allowed)
    assert path == best_by_enumeration(table, values, start, rule)
    assert all(GRID.contains(cell) for asked in allowed.asked for cell in asked)


@pytest.mark.parametrize('place', [0, 100, -1], ids=['best', 'some', 'worst'])
def test_any_single_allowed_path_is_found(place: int) -> None:
    table = walk_table(4, DOCUMENTED_TIE_ORDER)
    values = np.ones((GRID.rows, GRID.cols))
    scores = table.scores(values, (2, 2))
    inside = np.flatnonzero(np.isfinite(scores))
    only = table.path(int(inside[np.argsort(-scores[inside])[place]]), (2, 2))
    assert best_path(table, values, (2, 2), Allowed(lambda path: path == only)) == only


def test_where_everything_is_allowed_few_paths_are_looked_at() -> None:
    table = walk_table(6, DOCUMENTED_TIE_ORDER)
    allowed = Allowed(lambda path: True)
    best_path(table, np.ones((GRID.rows, GRID.cols)), (0, 0), allowed)
    assert len(allowed.asked) == 1


def test_only_the_first_candidates_are_checked_one_by_one() -> None:
    class NoneOfMany(Allowed):
        def allows_each(self, tracks: NDArray[np.intp]) -> NDArray[np.bool_]:
            return np.zeros(tracks.shape[2], dtype=np.bool_)

    table = walk_table(3, DOCUMENTED_TIE_ORDER)
    allowed = NoneOfMany(lambda path: False)
    assert best_path(table, np.ones((GRID.rows, GRID.cols)), (2, 2), allowed) is None
    assert len(allowed.asked) == SINGLE_CHECKS


def test_there_is_no_path_where_none_stays_in_the_region() -> None:
    table = walk_table(2, DOCUMENTED_TIE_ORDER)
    assert best_path(table, np.ones((1, 1)), (0, 0), Allowed(lambda path: True)) is None
