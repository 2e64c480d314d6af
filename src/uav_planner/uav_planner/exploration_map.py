"""The exploration map of the UAV: what every cell is still worth and which are surveyed."""

from __future__ import annotations

import math
from collections import Counter
from typing import TYPE_CHECKING

import msgspec
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from numpy.typing import NDArray

    from msgs_json.geometry import Cell, GridSpec

HALVINGS_MAX = 1000
"""A value is halved no further: soon after it would be 0, which stands for a masked cell."""


class MapRow(msgspec.Struct, frozen=True, kw_only=True):
    """All that an `ExplorationMap` knows of a row, by column."""

    entries: tuple[int, ...]
    visited: tuple[bool, ...]
    """Whether a cell was really visited."""


class ExplorationMap:
    """
    Cell values ``V(C)`` of ECC 2009, Section III.B: 1 when unexplored, halved at every visit.

    A visit counts from the moment a path is assigned, so that other AUVs avoid its cells, and is
    taken back where the report says that the cell was not reached. The map counts entries and
    derives each value from its count: a value is always ``2 ** -entries``, whatever the order of
    calls, and a confirmed cell has at least one entry. A call that would break this is refused
    as a whole and changes nothing. A masked cell is worth 0; what is known of it is kept.

    Parameters
    ----------
    grid
        The surveyed region.
    start_cells
        Where the AUVs are at the start of the mission, one per AUV: entered at t = 0.

    Raises
    ------
    ValueError
        Here and in every method: a cell lies outside the region, or is masked.

    """

    def __init__(self, grid: GridSpec, start_cells: Iterable[Cell]) -> None:
        self._grid = grid
        self._entries = np.zeros((grid.rows, grid.cols), dtype=np.int64)
        self._visited = np.zeros((grid.rows, grid.cols), dtype=np.bool_)
        self._values = np.where(grid.mask, 0.0, 1.0)
        self._values_view = self._values.view()
        self._values_view.flags.writeable = False
        self._changed_rows: set[int] = set(range(grid.rows))
        """Those that `changed_rows` has not told."""
        starts = list(start_cells)
        self._add_entries(starts, 1)
        self.confirm(starts)

    @property
    def values(self) -> NDArray[np.float64]:
        """
        Return a live, read-only view of the values, shape (rows, cols), ``[row, col]``.

        In (0, 1]; 0 where a cell is masked.
        """
        return self._values_view

    def is_explored(self, cells: Iterable[Cell]) -> bool:
        """Return whether each of some cells is confirmed as really visited."""
        return all(self._visited[self._grid.index(cell)] for cell in cells)

    def assign(self, path: Sequence[Cell]) -> None:
        """Halve every cell of a new path as often as it enters it; `P_0` was entered before."""
        self._add_entries(path[1:], 1)

    def restore(self, cells: Iterable[Cell]) -> None:
        """
        Take back the entries of assigned cells that the AUV did not reach.

        Confirm the cells it did reach first.

        Raises
        ------
        ValueError
            A cell has no such entry: never assigned, or only the one that was confirmed.

        """
        self._add_entries(list(cells), -1)

    def confirm(self, cells: Iterable[Cell]) -> None:
        """
        Mark cells as really visited; once is enough.

        Raises
        ------
        ValueError
            A cell was never assigned.

        """
        indices = [self._index(cell) for cell in cells]
        for row, col in indices:
            if self._entries[row, col] == 0:
                raise ValueError(f'cell {[col, row]} is reported visited but was never assigned')
        for index in indices:
            self._visited[index] = True
            self._changed_rows.add(index[0])

    def of_region(self, grid: GridSpec) -> ExplorationMap:
        """Return what is known of a region of the same grid with other cells masked."""
        other = ExplorationMap(grid, ())
        other.recall({row: self._row(row) for row in range(grid.rows)})
        other._changed_rows = set(self._changed_rows)
        return other

    def changed_rows(self) -> dict[int, MapRow]:
        """Return what to `recall` of the rows that have changed since this was called last."""
        if not self._changed_rows:
            return {}
        changed = {row: self._row(row) for row in sorted(self._changed_rows)}
        self._changed_rows.clear()
        return changed

    def _row(self, row: int) -> MapRow:
        return MapRow(
            entries=tuple(self._entries[row].tolist()), visited=tuple(self._visited[row].tolist())
        )

    def recall(self, rows: Mapping[int, MapRow]) -> None:
        """
        Know again what a map of the same grid knew.

        Raises
        ------
        ValueError
            It was of another grid.

        """
        for row, known in rows.items():
            self._entries[row] = known.entries
            self._visited[row] = known.visited
        self._changed_rows -= rows.keys()
        halvings = np.minimum(self._entries, HALVINGS_MAX)
        self._values[:] = np.where(self._grid.mask, 0.0, np.ldexp(1.0, -halvings))

    def _add_entries(self, cells: Sequence[Cell], sign: int) -> None:
        """Change the entries of each cell by ``sign`` per occurrence, and its value with them."""
        changed: dict[tuple[int, int], int] = {}
        for cell, occurrences in Counter(cells).items():
            index = self._index(cell)
            changed[index] = int(self._entries[index]) + sign * occurrences
            if changed[index] < int(self._visited[index]):
                raise ValueError(f'cell {list(cell)} has no assigned entry left to take back')
        for index, entries in changed.items():
            self._entries[index] = entries
            self._values[index] = math.ldexp(1.0, -min(entries, HALVINGS_MAX))
            self._changed_rows.add(index[0])

    def _index(self, cell: Cell) -> tuple[int, int]:
        """Return the array index of a cell of the region (numpy would wrap a negative one)."""
        problem = self._grid.problem_with(cell)
        if problem:
            raise ValueError(problem)
        return self._grid.index(cell)
