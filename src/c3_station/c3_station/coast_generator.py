"""Random land for random scenarios: islands, shores and bays, with all the sea in one piece."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np

    from msgs_json.geometry import Cell, GridSpec

_ON_THE_EDGE = 0.5
"""How often land grows from the edge of the grid inward, and not as an island."""
_FAILURES_MAX = 20
"""After so many pieces of land for which there was no room there is enough of it."""
_AROUND = ((1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1))
"""The cells around one, in a circle: every second one, from the first, is a neighbour."""


def draw_coast(rng: np.random.Generator, grid: GridSpec, share: float) -> tuple[Cell, ...]:
    """
    Return cells to mask, row by row: a share of all cells, less where there is no room for it.

    The cells that are left hang together.

    Parameters
    ----------
    rng
        Draws where land lies and how it grows.
    grid
        Without land.
    share
        Of its cells, 0 to 1.

    """
    coast = _Coast(rng, grid)
    wanted = int(share * grid.cells_total)
    failures = 0
    while len(coast.land) < wanted and failures < _FAILURES_MAX:
        size = int(rng.integers(1, wanted - len(coast.land), endpoint=True))
        failures += not coast.grow(size)
    return tuple(cell for cell in grid.cells if cell in coast.land)


class _Coast:
    """Land that grows cell by cell."""

    def __init__(self, rng: np.random.Generator, grid: GridSpec) -> None:
        self.land: set[Cell] = set()
        self._rng = rng
        self._grid = grid

    def grow(self, size: int) -> bool:
        """Add a piece of land of a number of cells, or fewer; return whether there was room."""
        edge: list[Cell] = [self._begin()]
        grown = 0
        while edge and grown < size:
            cell = edge.pop(int(self._rng.integers(len(edge))))
            if self._can_become_land(cell):
                self.land.add(cell)
                grown += 1
                edge += [each for each in self._grid.neighbours(cell) if each not in edge]
        return grown > 0

    def _begin(self) -> Cell:
        grid, rng = self._grid, self._rng
        col, row = int(rng.integers(grid.cols)), int(rng.integers(grid.rows))
        if rng.random() >= _ON_THE_EDGE:
            return col, row
        sides = ((0, row), (grid.cols - 1, row), (col, 0), (col, grid.rows - 1))
        return sides[int(rng.integers(len(sides)))]

    def _can_become_land(self, cell: Cell) -> bool:
        """
        Return whether the sea surely stays in one piece without a cell of it.

        Whoever went through the cell came from a neighbour and went on to another one. If all the
        neighbours that are sea lie on one stretch of sea around the cell, there is a way round.
        """
        if not self._is_sea(cell):
            return False
        around = [self._is_sea((cell[0] + col, cell[1] + row)) for col, row in _AROUND]
        if all(around):
            return True
        start = around.index(False)
        stretches = itertools.groupby(range(start, start + 8), key=lambda place: around[place % 8])
        leading_on = (
            is_sea and any(place % 2 == 0 for place in places) for is_sea, places in stretches
        )
        return sum(leading_on) == 1

    def _is_sea(self, cell: Cell) -> bool:
        return self._grid.contains(cell) and cell not in self.land
