"""
Static lanes: every AUV goes to and fro through a strip of its own, whatever the others do.

The usual way to survey a region with several vehicles. Who surveys which cells is decided before
the mission; the UAV relays, and sends nobody farther than keeps L.
"""

from __future__ import annotations

import functools
from collections import deque
from dataclasses import replace
from itertools import cycle, islice, pairwise
from typing import TYPE_CHECKING

from uav_planner.guarantee import GuaranteedPaths, guaranteed_sortie
from uav_planner.planning import Planner, Prospect
from uav_planner.standstill import is_at_a_standstill

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from msgs_json.geometry import Cell, GridSpec
    from uav_planner.planning import (
        PlanRequest,
        PlanResult,
        SortiePlan,
        SortieRequest,
        Tours,
    )


class LanesPlanner(Planner):
    """
    Boustrophedon strips of equally many cells, one for each AUV.

    They are cut before the first sortie and kept in mind as tours. An AUV that is done with its
    strip takes over those of AUVs that were given up; then it comes to C3, where it is in nobody's
    way.
    """

    guarantees_limit = True

    def plan_path(self, request: PlanRequest) -> PlanResult:
        """
        Go on along the lanes, as far as that is allowed; where it is not at all, stay in place.

        Raises
        ------
        ValueError
            The AUV has no leg among those of the request, or is not on it.

        """
        guaranteed = GuaranteedPaths(request)
        strips = request.tours or _strips_of(request)
        survey = _Survey(request, strips)
        path = _longest_allowed(request, guaranteed, survey.walk())
        if survey.is_to_make_room(path):
            path = _longest_allowed(request, guaranteed, survey.walk_home())
        return replace(guaranteed.plan(path), tours=strips)

    def plan_sortie(self, request: SortieRequest) -> SortiePlan:
        """
        Lay the route of the next sortie; leave so that its worst case is at most L.

        Raises
        ------
        ValueError
            L cannot be kept from the beginning.

        """
        return replace(guaranteed_sortie(request), tours=request.tours or _strips_of(request))


def make_lanes() -> LanesPlanner:
    """Let every AUV go to and fro through a strip of its own; keep L whatever they do."""
    return LanesPlanner()


# --- strips --------------------------------------------------------------------------------------


def _strips_of(request: PlanRequest | SortieRequest) -> Tours:
    """Return a strip for each AUV, from where they are before the first sortie."""
    starts = {leg.auv: leg.path[0] for leg in request.legs}
    return deal_strips(request.mission.grid, starts)


def deal_strips(grid: GridSpec, starts: Mapping[str, Cell]) -> Tours:
    """
    Return the strip of each AUV, the cells in the order of its lanes.

    Strips lie beside each other in visiting order, so that the UAV's round is short; from which
    side on is decided by which way the AUVs are nearer to them from their start cells.
    """
    strips = cut_strips(grid, len(starts))

    def way_cells(tours: Tours) -> int:
        return sum(
            min(abs(col - starts[auv][0]) + abs(row - starts[auv][1]) for col, row in strip)
            for auv, strip in tours.items()
            if strip
        )

    both = [dict(zip(starts, side, strict=True)) for side in (strips, strips[::-1])]
    return min(both, key=way_cells)


def cut_strips(grid: GridSpec, strips: int) -> tuple[tuple[Cell, ...], ...]:
    """
    Return a region as strips side by side, whose numbers of cells differ by one at most.

    Strips go along the longer side, their lanes across them, from one end to the other and every
    second one backwards. So the AUVs advance side by side, and the round is short as long as it
    can be; with lanes along the strips they come to the far end early and keep each other there.
    Masked cells are left out: lanes may be broken.
    """
    is_wide = grid.cols > grid.rows

    def side_by_side(cell: Cell) -> Cell:
        return cell[::-1] if is_wide else cell

    def to_and_fro(cell: Cell) -> Cell:
        across, lane = side_by_side(cell)
        return (lane, across if lane % 2 == 0 else -across)

    cells = sorted(grid.cells, key=side_by_side)
    edges = [len(cells) * number // strips for number in range(strips + 1)]
    return tuple(tuple(sorted(cells[first:end], key=to_and_fro)) for first, end in pairwise(edges))


@functools.lru_cache(maxsize=8)
def _basins(grid: GridSpec) -> dict[Cell, Cell]:
    """Return for each cell the first one of all that a way leads to from there."""
    basins: dict[Cell, Cell] = {}
    for first in grid.cells:
        if first not in basins:
            basins.update(dict.fromkeys(grid.moves_from([first]), first))
    return basins


# --- at a meeting --------------------------------------------------------------------------------


class _Survey:
    """What is left to do, and for whom."""

    def __init__(self, request: PlanRequest, strips: Tours) -> None:
        self._request = request
        self._grid = grid = request.mission.grid
        self._basins = basins = _basins(grid)
        basin_of = {leg.auv: basins[leg.path[0]] for leg in request.legs}
        left = {
            owner: [cell for cell in strip if request.values[grid.index(cell)] == 1.0]
            for owner, strip in strips.items()
        }
        # Nobody's: the owner is given up, or no way leads there from where it is.
        orphaned = [
            [cell for cell in cells if basin_of.get(owner) != basins[cell]]
            for owner, cells in left.items()
        ]
        self._duties = {
            auv: [
                [cell for cell in cells if basins[cell] == basin]
                for cells in (left.get(auv, []), *orphaned)
            ]
            for auv, basin in basin_of.items()
        }

    def walk(self) -> list[Cell]:
        """Return the next cells of the AUV's lanes, from where it is; home where none are left."""
        mission = self._request.mission
        walk = [self._request.cell]
        for cells in self._duties[self._request.auv]:
            left = deque(cell for cell in cells if cell not in walk)
            while left and len(walk) <= mission.path_cells:
                walk += self._way_to_nearer(walk[-1], (left[0], left[-1]))
                while left and left[0] in walk:
                    left.popleft()
                while left and left[-1] in walk:
                    left.pop()
        return walk[: mission.path_cells + 1] if len(walk) > 1 else self.walk_home()

    def walk_home(self) -> list[Cell]:
        """Return a way from where the AUV is to the cell nearest to C3."""
        here, grid = self._request.cell, self._grid
        in_reach = [cell for cell in grid.cells if self._basins[cell] == self._basins[here]]
        c3 = self._request.mission.c3
        home = min(in_reach, key=lambda cell: grid.centre(cell).distance_m(c3))
        way = [here] if here == home else [here, *self._way_to_nearer(here, (home,))]
        return way[: self._request.mission.path_cells + 1]

    def is_to_make_room(self, path: tuple[Cell, ...] | None) -> bool:
        """
        Return whether an AUV with nothing new on its path is to let another one go first.

        AUVs in different corners may keep each other from the last cells there. The first one in
        visiting order that has something left to do has the right of way.
        """
        values, index_of = self._request.values, self._grid.index
        finds_new = any(values[index_of(cell)] == 1.0 for cell in (path or ())[1:])
        if finds_new or not is_at_a_standstill(self._request):
            return False
        busy = (
            leg.auv
            for leg in self._request.legs
            if leg.prospect is not Prospect.ASTRAY and any(self._duties[leg.auv])
        )
        return next(busy, self._request.auv) != self._request.auv

    def _way_to_nearer(self, here: Cell, goals: Sequence[Cell]) -> list[Cell]:
        """Return the cells after one on a shortest way to the nearer of some goals."""
        beside = self._grid.neighbours(here)
        for goal in goals:
            if goal in beside:
                return [goal]
        moves = self._grid.moves_from([here])
        way = [min(goals, key=moves.__getitem__)]
        while (moved := moves[way[-1]]) > 1:
            before = self._grid.neighbours(way[-1])
            way.append(next(cell for cell in before if moves[cell] == moved - 1))
        return way[::-1]


def _longest_allowed(
    request: PlanRequest, guaranteed: GuaranteedPaths, walk: Sequence[Cell]
) -> tuple[Cell, ...] | None:
    """
    Return as much of a walk as may be handed over; None if nothing of it may be.

    Where that is little it ends with moves to and fro. An AUV that lies between two cells is slow:
    on a leg of one move it would come up there again and again.
    """
    mission = request.mission
    least = mission.min_path_cells if request.behind is None else mission.path_cells
    for moves in range(len(walk) - 1, 0, -1):
        to_and_fro = islice(cycle(walk[moves - 1 : moves + 1]), max(0, least - moves))
        path = (*walk[: moves + 1], *to_and_fro)
        if guaranteed.allows(path):
            return path
    return None
