"""
The paths an AUV can be given: all ``4 ** q`` walks from its cell, in their tie order, scored.

Section III.B of ECC 2009: AUVs move from cell centre to cell centre in four directions, so there
are ``4 ** q`` paths of q moves. Everything about them that does not depend on the map is worked
out once and kept in a `WalkTable`.
"""

from __future__ import annotations

import enum
import functools
import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from msgs_json.geometry import Cell, GridSpec

TURN_COST = 0.05
"""
What a turn between two moves takes off a path's score (in cell values).

ECC 2009, Section IV: straight paths weigh more. Small enough that five turns, the most a path of
six moves has, never outweigh the step from an unexplored cell to one visited once.
"""

TIE_MARGIN = 1e-9
"""A later candidate wins only if its score is better by more than this (in cell values)."""

LISTED_MOVES_MAX = 9
"""Longest walks that are listed: 4 ** 9 of them take 31 MB, ten moves would take 138 MB."""

SEARCHED_MOVES_MAX = 24
"""Longest paths that are searched (`leg_search`), which needs no list of them all."""


class Direction(enum.Enum):
    """A move of one cell, as (columns east, rows north)."""

    EAST = (1, 0)
    NORTH = (0, 1)
    WEST = (-1, 0)
    SOUTH = (0, -1)


@dataclass(frozen=True, slots=True, kw_only=True)
class TieOrder:
    """
    The order in which walks are compared; of equally good ones the first is taken.

    The paper does not say it, and missions differ much by it: compare planners over
    `every_tie_order`.
    """

    directions: tuple[Direction, ...] = tuple(Direction)
    """All four directions; the first is compared first."""
    first_move_fastest: bool = True
    """Whether the first move varies fastest from one walk to the next, or the last one does."""

    def __post_init__(self) -> None:
        if len(self.directions) != len(Direction) or set(self.directions) != set(Direction):
            raise ValueError(
                f'directions must be {[each.name for each in Direction]} in any order, '
                f'not {[each.name for each in self.directions]}'
            )

    @classmethod
    def named(cls, name: str) -> TieOrder:
        """
        Return the tie order of a name such as ``enws-first``.

        Raises
        ------
        ValueError
            There is none of that name.

        """
        for tie_order in every_tie_order():
            if tie_order.name == name:
                return tie_order
        raise ValueError(
            f"tie order must be the letters e, n, w, s in any order, then '-first' or '-last' "
            f"for the move that varies fastest, as in '{DOCUMENTED_TIE_ORDER.name}', not {name!r}"
        )

    @property
    def name(self) -> str:
        """Return the name: the directions' initials, then the move that varies fastest."""
        initials = ''.join(direction.name[0].lower() for direction in self.directions)
        return f'{initials}-{"first" if self.first_move_fastest else "last"}'


DOCUMENTED_TIE_ORDER = TieOrder()
"""East, north, west, south; the first move varies fastest. It reproduces the paper's mission."""


@functools.cache
def every_tie_order() -> tuple[TieOrder, ...]:
    """Return all 48 tie orders, the documented one first."""
    return tuple(
        TieOrder(directions=directions, first_move_fastest=first_move_fastest)
        for first_move_fastest in (True, False)
        for directions in itertools.permutations(Direction)
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WalkTable:
    """
    Every walk of a number of moves, by its place in the tie order; all arrays are read-only.

    The last axis runs over the ``4 ** moves`` walks.
    """

    moves: int
    offsets: NDArray[np.int16]
    """
    Cells seen from `P_0`, which is the first one: shape (2, moves + 1, walks).

    ``offsets[0]`` are columns east, ``offsets[1]`` rows north.
    """
    value_indices: NDArray[np.intp]
    """
    Where the value of each cell after `P_0` stands in `_windows`, flat: shape (moves, walks).

    Window k is for cells that the walk was in k times before, `P_0` included.
    """
    turn_costs: NDArray[np.float64]
    """`TURN_COST` times the turns of the walk, shape (walks,)."""

    def scores(self, values: NDArray[np.float64], start: Cell) -> NDArray[np.float64]:
        """
        Return the score of every walk from a cell of the map.

        The sum of the values of its cells, each halved once more for every time the walk was
        there before (`P_0` is not scored, coming back to it counts half), less the turns.

        Parameters
        ----------
        values
            Exploration map, shape (rows, cols), `[row, col]`; 0 where a cell is masked.
        start
            `P_0`.

        Returns
        -------
        NDArray[np.float64]
            Shape (walks,); minus infinity where a walk leaves the region, as one through a masked
            cell does.

        """
        scores: NDArray[np.float64] = self._windows(values, start)[self.value_indices].sum(axis=0)
        scores -= self.turn_costs
        return scores

    def _windows(self, values: NDArray[np.float64], start: Cell) -> NDArray[np.float64]:
        """Return the values around a cell, minus infinity outside; whole, halved, and so on."""
        halvings = 0.5 ** np.arange(self.moves + 1).reshape(-1, 1, 1)
        window = window_around(values, start, self.moves)
        window[window == 0.0] = -np.inf  # masked
        windows: NDArray[np.float64] = halvings * window
        return windows.ravel()

    def path(self, walk: int, start: Cell) -> tuple[Cell, ...]:
        """Return the cells of one walk from a start cell, `P_0` included."""
        col, row = start
        east, north = self.offsets[:, :, walk].tolist()
        return tuple((col + cols, row + rows) for cols, rows in zip(east, north, strict=True))

    def tracks(self, walks: NDArray[np.intp], start: Cell) -> NDArray[np.intp]:
        """Return the cells of many walks in searching order, `P_q` first: (2, cells, walks)."""
        origin = np.array(start, dtype=np.intp).reshape(2, 1, 1)
        tracks: NDArray[np.intp] = origin + self.offsets[:, ::-1, walks]
        return tracks


def window_around(cells: NDArray[np.float64], start: Cell, reach: int) -> NDArray[np.float64]:
    """Return the part of a map up to so many cells from one, minus infinity outside the map."""
    col, row = start
    rows, cols = cells.shape
    window = np.full((2 * reach + 1, 2 * reach + 1), -np.inf)
    south, west = max(row - reach, 0), max(col - reach, 0)
    north, east = min(row + reach + 1, rows), min(col + reach + 1, cols)
    window[south - row + reach : north - row + reach, west - col + reach : east - col + reach] = (
        cells[south:north, west:east]
    )
    return window


def check_listed(path_cells: int) -> None:
    """
    Check that all paths of a mission can be listed.

    Raises
    ------
    ValueError
        q is more than `LISTED_MOVES_MAX`.

    """
    if path_cells > LISTED_MOVES_MAX:
        raise ValueError(
            f'path_cells is {path_cells}; allowed with planner ecc2009: 1 to {LISTED_MOVES_MAX}'
            ' (it lists all 4^path_cells paths)'
        )


@functools.lru_cache(maxsize=8)
def walk_table(moves: int, tie_order: TieOrder) -> WalkTable:
    """
    Return the table of all walks of a number of moves in a tie order.

    Raises
    ------
    ValueError
        ``moves`` is not in 1 ... `LISTED_MOVES_MAX`.

    """
    if not 1 <= moves <= LISTED_MOVES_MAX:
        raise ValueError(f'a walk has 1 to {LISTED_MOVES_MAX} moves, not {moves}')
    place = np.arange(moves) if tie_order.first_move_fastest else np.arange(moves)[::-1]
    move = (np.arange(4**moves) // 4 ** place[:, np.newaxis]) % 4
    steps = np.array([direction.value for direction in tie_order.directions], dtype=np.int16)
    offsets = np.zeros((2, moves + 1, 4**moves), dtype=np.int16)
    offsets[:, 1:] = steps.T[:, move].cumsum(axis=1)
    east, north = offsets
    side = 2 * moves + 1
    window_indices = (north + moves).astype(np.intp) * side + (east + moves)
    visits_before = np.array(
        [
            (window_indices[:moved] == window_indices[moved]).sum(axis=0)
            for moved in range(1, moves + 1)
        ]
    )
    turns = (move[1:] != move[:-1]).sum(axis=0)
    table = WalkTable(
        moves=moves,
        offsets=offsets,
        value_indices=visits_before * side**2 + window_indices[1:],
        turn_costs=TURN_COST * turns,
    )
    for array in (
        table.offsets,
        table.value_indices,
        table.turn_costs,
    ):
        array.flags.writeable = False
    return table


def greedy_cell(
    values: NDArray[np.float64], grid: GridSpec, cell: Cell, tie_order: TieOrder
) -> Cell:
    """
    Return the neighbour of the highest value (``getGreedyCell`` of ECC 2009, Algorithm 1).

    Raises
    ------
    ValueError
        The region has no cell beside this one.

    """
    best: Cell | None = None
    best_value = 0.0
    for direction in tie_order.directions:
        east, north = direction.value
        neighbour = (cell[0] + east, cell[1] + north)
        if grid.contains(neighbour):
            value = values[grid.index(neighbour)]
            if best is None or value > best_value + TIE_MARGIN:
                best, best_value = neighbour, value
    if best is None:
        raise ValueError(f'cell {list(cell)} has no neighbour in the region')
    return best
