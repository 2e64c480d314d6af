"""
Region geometry and the one tolerant conversion from lengths to whole ticks.

Frame ``map``: ENU, metres, origin at the region's south-west corner (REP-103).
Arrays over cells are indexed ``[row, col]``; files and messages write a cell as
``[col, row]``. `GridSpec` is the only place that converts between the two.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated

import msgspec
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

TOLERANCE = 1e-9
"""
Relative slack of every length and time comparison (dimensionless).

Adding a step of a few metres some thousand times loses about 1e-12 of it; 1e-9 is far above that
and far below anything a vehicle can do.
"""

TIME_TOLERANCE_S = 1e-6
"""Times closer than this are the same; absolute, since ROS time may count from 1970."""

ColIndex = Annotated[int, msgspec.Meta(ge=0, le=9999, description='column, 0 = west')]
RowIndex = Annotated[int, msgspec.Meta(ge=0, le=9999, description='row, 0 = south')]
Cell = tuple[ColIndex, RowIndex]
"""A cell as ``(col, row)``; ``[col, row]`` in JSON and YAML."""

Metres = Annotated[float, msgspec.Meta(ge=-1e7, le=1e7, extra_json_schema={'x-unit': 'm'})]


class Point(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A horizontal position in frame ``map``."""

    east_m: Metres
    north_m: Metres

    def distance_m(self, other: Point) -> float:
        """Return the horizontal distance to another point, in metres."""
        return math.hypot(other.east_m - self.east_m, other.north_m - self.north_m)

    def toward(self, target: Point, length_m: float) -> Point:
        """
        Return the point ``length_m`` along the straight line to a target.

        The target itself (bit for bit) is returned where the line is not longer than
        ``length_m``, so that a vehicle that arrives is exactly where it was sent.
        """
        distance_m = self.distance_m(target)
        if distance_m <= length_m * (1.0 + TOLERANCE):
            return target
        share = length_m / distance_m
        return Point(
            east_m=self.east_m + share * (target.east_m - self.east_m),
            north_m=self.north_m + share * (target.north_m - self.north_m),
        )


class GridSpec(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, dict=True):
    """
    The surveyed region: ``cols x rows`` square cells, cell (0, 0) in the south-west.

    Masked cells are not part of it: no AUV goes there. So it need be neither a rectangle nor in
    one piece. Whoever takes a region from outside asks `mask_problems` and `unreachable_cells`.
    """

    cols: Annotated[int, msgspec.Meta(ge=1, le=1000, description='cells from west to east')]
    rows: Annotated[int, msgspec.Meta(ge=1, le=1000, description='cells from south to north')]
    cell_m: Annotated[
        float,
        msgspec.Meta(gt=0, le=1e5, description='cell width w', extra_json_schema={'x-unit': 'm'}),
    ]
    masked: Annotated[
        tuple[Cell, ...],
        msgspec.Meta(description='cells that are not part of the region: land, no-go'),
    ] = ()

    def __str__(self) -> str:
        """Return the size in a person's words."""
        land = f', {len(self._masked_cells)} of them masked' if self.masked else ''
        return f'{self.cols} x {self.rows} cells of {self.cell_m:g} m{land}'

    @cached_property
    def _masked_cells(self) -> frozenset[Cell]:
        return frozenset(cell for cell in self.masked if self.is_on_grid(cell))

    @cached_property
    def mask(self) -> NDArray[np.bool_]:
        """Return which cells are masked: shape (rows, cols), ``[row, col]``, read-only."""
        mask = np.zeros((self.rows, self.cols), dtype=np.bool_)
        for cell in self._masked_cells:
            mask[self.index(cell)] = True
        mask.flags.writeable = False
        return mask

    @cached_property
    def cells(self) -> tuple[Cell, ...]:
        """Return the cells of the region, row by row from the south-west corner."""
        return tuple(
            (col, row)
            for row in range(self.rows)
            for col in range(self.cols)
            if (col, row) not in self._masked_cells
        )

    @property
    def cells_total(self) -> int:
        """Return the number of cells of the region."""
        return self.cols * self.rows - len(self._masked_cells)

    def is_on_grid(self, cell: Cell) -> bool:
        """Return whether a cell is one of ``cols x rows``, masked or not."""
        col, row = cell
        return 0 <= col < self.cols and 0 <= row < self.rows

    def contains(self, cell: Cell) -> bool:
        """Return whether a cell is one of the region."""
        col, row = cell
        return 0 <= col < self.cols and 0 <= row < self.rows and cell not in self._masked_cells

    def problem_with(self, cell: Cell) -> str | None:
        """Return why a cell is none of the region, or None if it is one."""
        if not self.is_on_grid(cell):
            return f'cell {list(cell)} lies outside the region of {self.cols} x {self.rows} cells'
        if cell in self._masked_cells:
            return f'cell {list(cell)} is masked (land, no-go)'
        return None

    def centre(self, cell: Cell) -> Point:
        """Return the centre of a cell in frame ``map``."""
        return Point(east_m=(cell[0] + 0.5) * self.cell_m, north_m=(cell[1] + 0.5) * self.cell_m)

    def cell_at(self, point: Point) -> Cell:
        """Return the cell that holds a point, masked or not; one outside gives the nearest."""
        col = math.floor(point.east_m / self.cell_m)
        row = math.floor(point.north_m / self.cell_m)
        return (min(max(col, 0), self.cols - 1), min(max(row, 0), self.rows - 1))

    @cached_property
    def _neighbours(self) -> dict[Cell, tuple[Cell, ...]]:
        return {}  # filled as they are asked for

    def neighbours(self, cell: Cell) -> tuple[Cell, ...]:
        """Return the up to 4 cells of the region beside a cell: east, north, west, south."""
        known = self._neighbours.get(cell)
        if known is None:
            col, row = cell
            around = ((col + 1, row), (col, row + 1), (col - 1, row), (col, row - 1))
            known = tuple(each for each in around if self.contains(each))
            self._neighbours[cell] = known
        return known

    def moves_from(self, sources: Iterable[Cell]) -> dict[Cell, int]:
        """Return how many moves each cell is from the nearest source; only those in reach."""
        moves = dict.fromkeys(sources, 0)
        waiting = deque(moves)
        while waiting:
            cell = waiting.popleft()
            for neighbour in self.neighbours(cell):
                if neighbour not in moves:
                    moves[neighbour] = moves[cell] + 1
                    waiting.append(neighbour)
        return moves

    @cached_property
    def _parts(self) -> dict[Cell, frozenset[Cell]]:
        return {}  # filled as they are asked for

    def part_of(self, cell: Cell) -> frozenset[Cell]:
        """Return the cells that can be reached from a cell of the region, itself included."""
        part = self._parts.get(cell)
        if part is None:
            part = frozenset(self.moves_from([cell]))
            self._parts.update(dict.fromkeys(part, part))
        return part

    def neighbour_toward(self, cell: Cell, point: Point, among: Iterable[Cell]) -> Cell | None:
        """Return the neighbour on whose side of a cell's centre a point lies, None if on none."""
        centre = self.centre(cell)
        sides = [
            (
                (col - cell[0]) * (point.east_m - centre.east_m)
                + (row - cell[1]) * (point.north_m - centre.north_m),
                (col, row),
            )
            for col, row in among
        ]
        side_m, neighbour = max(sides, default=(0.0, cell))
        return neighbour if side_m > self.cell_m * TOLERANCE else None

    def index(self, cell: Cell) -> tuple[int, int]:
        """Return the ``[row, col]`` array index of a cell."""
        return (cell[1], cell[0])


def mask_problems(region: GridSpec) -> Iterator[tuple[int, str]]:
    """Yield what is wrong with masked cells: the place of each in ``masked``, and why."""
    seen: set[Cell] = set()
    for index, cell in enumerate(region.masked):
        if not region.is_on_grid(cell):
            allowed = f'columns 0 to {region.cols - 1}, rows 0 to {region.rows - 1}'
            yield index, f'is {list(cell)}, outside the grid; allowed: {allowed}'
        elif cell in seen:
            yield index, f'is {list(cell)}, which is masked already; allowed: each cell once'
        seen.add(cell)


def unreachable_cells(region: GridSpec, starts: Iterable[Cell]) -> tuple[Cell, ...]:
    """Return the cells of a region to which no way leads from any of the starts, row by row."""
    starts = list(starts)
    if starts and not region.masked:
        return ()
    reachable = region.moves_from(starts)
    return tuple(cell for cell in region.cells if cell not in reachable)


def path_problem(path: Sequence[Cell], region: GridSpec | None = None) -> str | None:
    """Return why cells are no path of single moves (inside a region), or None if they are one."""
    for cell in path:
        problem = region.problem_with(cell) if region else None
        if problem:
            return problem
    for (col_a, row_a), (col_b, row_b) in pairwise(path):
        if abs(col_a - col_b) + abs(row_a - row_b) != 1:
            return (
                f'it goes from [{col_a}, {row_a}] to [{col_b}, {row_b}];'
                ' each move must lead to one of the 4 neighbour cells'
            )
    return None


def whole_ticks(ticks: float) -> int:
    """
    Return the number of whole ticks that hold a duration or length given in ticks.

    Rounds up, but forgives `TOLERANCE`, so that a hop of exactly n ticks takes n and not n + 1.
    Every conversion of a distance or a time into ticks goes through here.
    """
    # Written without max: some ten thousand of these are asked for in each mission.
    return math.ceil(
        ticks - TOLERANCE * (ticks if ticks > 1.0 else 1.0 if ticks > -1.0 else -ticks)
    )


def within_range(distance_m: float, range_m: float) -> bool:
    """Return whether a distance is inside a radio disc (its edge included, `TOLERANCE`)."""
    return distance_m <= range_m * (1.0 + TOLERANCE)


def is_before(earlier_s: float, later_s: float) -> bool:
    """Return whether one time lies before another by more than `TIME_TOLERANCE_S`."""
    return earlier_s < later_s - TIME_TOLERANCE_S


def path_length_m(points: Sequence[Point]) -> float:
    """Return the length of a polyline."""
    return sum(a.distance_m(b) for a, b in pairwise(points))


def surface_deadline_s(
    start_s: float, way_m: float, speed_mps: float, margin_s: float, tick_s: float
) -> float:
    """
    Return when an AUV that starts a leg at a tick is surfaced at the latest (S_i).

    The way at nominal speed plus a margin, rounded up to a tick.
    """
    return start_s + whole_ticks((way_m / speed_mps + margin_s) / tick_s) * tick_s
