"""The paper's values and straightness, chosen from the paths with which L can always be kept."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from uav_planner.candidate_paths import (
    DOCUMENTED_TIE_ORDER,
    TIE_MARGIN,
    TieOrder,
    walk_table,
)
from uav_planner.guarantee import GuaranteedPaths, guaranteed_sortie
from uav_planner.planning import Planner, Prospect
from uav_planner.standstill import is_at_a_standstill

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from msgs_json.geometry import Cell, GridSpec
    from uav_planner.candidate_paths import WalkTable
    from uav_planner.planning import (
        MissionSpec,
        PlanRequest,
        PlanResult,
        SortiePlan,
        SortieRequest,
    )

ROUND_COST = 3.0
"""
What a round as long as L takes off a path's score (in cell values).

A shorter round lets the UAV leave earlier and leaves the AUVs met next more room. Of 0, 3, 4, 5
and 6 this one explored the reference mission soonest, and hung less on the order of ties than 0.
"""

DISTANCE_COST = 0.2
"""
What each cell between a path's end and the nearest unexplored one takes off its score.

Less than a cell visited twice is worth, so that it decides only where little is left nearby.
"""

BLOCKS = (64, 256, 1024)
"""So many paths are looked at at once, best first: often a few are enough."""


class RobustPlanner(Planner):
    """
    ECC 2009's values and straightness with the guaranteed set in the place of its prediction.

    Of two paths alike in these, the one with the shorter round is better, and the one that ends
    nearer to something unexplored. That keeps missions from hanging on the order of ties.

    Parameters
    ----------
    tie_order
        Which of several equally good paths is taken.

    """

    guarantees_limit = True

    def __init__(self, *, tie_order: TieOrder = DOCUMENTED_TIE_ORDER) -> None:
        self._tie_order = tie_order

    def plan_path(self, request: PlanRequest) -> PlanResult:
        """
        Choose the best guaranteed path of q moves; where none was found, stay in place.

        Raises
        ------
        ValueError
            The AUV has no leg among those of the request, or its paths are longer than
            `WalkTable` can hold.

        """
        guaranteed = GuaranteedPaths(request)
        table = walk_table(request.mission.path_cells, self._tie_order)
        return guaranteed.plan(_best_path(request, table, guaranteed))

    def plan_sortie(self, request: SortieRequest) -> SortiePlan:
        """
        Lay the route of the next sortie; leave so that its worst case is at most L.

        Raises
        ------
        ValueError
            L cannot be kept from the beginning, or paths are longer than `WalkTable` can hold.

        """
        walk_table(request.mission.path_cells, self._tie_order)  # made on the ground
        return guaranteed_sortie(request)


def _best_path(
    request: PlanRequest, table: WalkTable, guaranteed: GuaranteedPaths
) -> tuple[Cell, ...] | None:
    """
    Return the best of the walks that are allowed, None if none is.

    If it neither finds anything new nor ends nearer to it, it is the best of those that do, if one
    is allowed: a longer round may take off more than that is worth, and the AUV would move to and
    fro for ever. Where nobody finds anything new, AUVs in two corners may keep each other from it:
    then the nearest one goes there, and the others make room, nearer to C3.
    """
    moves_left = _moves_to_unexplored(request.mission.grid, request.values)
    moves_left_here = moves_left[request.mission.grid.index(request.cell)]
    at_ends = table.at_ends(moves_left, request.cell)
    scores = table.scores(request.values, request.cell)
    inside = scores > -np.inf
    if moves_left_here < np.inf:
        scores[inside] -= DISTANCE_COST * at_ends[inside]
    best = _best_walk(request, table, guaranteed, scores)
    if best is None:
        return None
    finds_new = table.finds_new(request.values, request.cell)
    gets_on = finds_new | (at_ends < moves_left_here)
    if not gets_on[best]:
        other = _best_walk(request, table, guaranteed, np.where(gets_on, scores, -np.inf))
        best = best if other is None else other
    if not finds_new[best] and _is_to_make_room(request, moves_left):
        # A move nearer to C3 counts as much as a whole round.
        room = -ROUND_COST * table.at_ends(_moves_to_c3(request.mission), request.cell)
        away = _best_walk(request, table, guaranteed, np.where(inside, room, -np.inf))
        best = best if away is None else away
    return table.path(best, request.cell)


def _is_to_make_room(request: PlanRequest, moves_left: NDArray[np.float64]) -> bool:
    """Return whether no other AUV finds anything new, and one is nearer to what is left."""
    if not is_at_a_standstill(request):
        return False
    index_of = request.mission.grid.index
    legs = [leg for leg in request.legs if leg.prospect is not Prospect.ASTRAY]
    ends = {leg.auv: leg.path[-1] for leg in legs} | {request.auv: request.cell}
    nearest = min(ends, key=lambda auv: moves_left[index_of(ends[auv])])  # the first of several
    return nearest != request.auv


def _best_walk(
    request: PlanRequest,
    table: WalkTable,
    guaranteed: GuaranteedPaths,
    scores: NDArray[np.float64],
) -> int | None:
    """
    Return the walk of the best score, less its round's cost, among those allowed; None if none is.

    Looks at them by falling score, until no round could be short enough to make up for it.
    """
    cost_per_tick = ROUND_COST / request.mission.limit_ticks
    # The round costs at least what it costs without this AUV.
    scores_at_most = scores - cost_per_tick * guaranteed.others_ticks
    walks = np.argsort(-scores_at_most)[: np.count_nonzero(scores > -np.inf)]
    best, best_score = None, -np.inf
    for block in _blocks(walks):
        if scores_at_most[block[0]] < best_score - TIE_MARGIN:
            break
        ticks = guaranteed.round_ticks_each(table.tracks(block, request.cell))
        full_scores = scores[block] - cost_per_tick * ticks
        score = float(full_scores.max())
        if score < best_score - TIE_MARGIN or score == -np.inf:
            continue
        first = int(block[full_scores >= score - TIE_MARGIN].min())  # in tie order
        if best is None or score > best_score + TIE_MARGIN:
            best, best_score = first, score
        else:
            best = min(best, first)
    return best


def _blocks(walks: NDArray[np.intp]) -> Iterator[NDArray[np.intp]]:
    """Yield the walks in blocks, the last size again and again."""
    first = 0
    for size in itertools.chain(BLOCKS, itertools.repeat(BLOCKS[-1])):
        if first >= walks.size:
            return
        yield walks[first : first + size]
        first += size


def _moves_to_unexplored(grid: GridSpec, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """
    Return for every cell how many moves the nearest unexplored one is away.

    Infinite where none can be reached, and for masked cells.
    """
    moves = np.where(values == 1.0, 0.0, np.inf)
    if grid.masked:
        unexplored = np.argwhere(values == 1.0)[:, ::-1].tolist()
        for cell, count in grid.moves_from(map(tuple, unexplored)).items():
            moves[grid.index(cell)] = count
        return moves
    for along in (moves, moves.T):  # views: along columns, then rows, in place
        places = np.arange(float(len(along))).reshape(-1, 1)
        from_before = np.minimum.accumulate(along - places) + places
        from_behind = np.minimum.accumulate((along + places)[::-1])[::-1] - places
        np.minimum(from_before, from_behind, out=along)
    return moves


def _moves_to_c3(mission: MissionSpec) -> NDArray[np.float64]:
    """Return how far every cell is from C3, as the crow flies, in moves."""
    cols, rows = np.arange(mission.grid.cols), np.arange(mission.grid.rows).reshape(-1, 1)
    c3_col = mission.c3.east_m / mission.grid.cell_m - 0.5
    c3_row = mission.c3.north_m / mission.grid.cell_m - 0.5
    moves: NDArray[np.float64] = np.hypot(cols - c3_col, rows - c3_row)
    return moves


def make_robust(*, tie_order: str = DOCUMENTED_TIE_ORDER.name) -> RobustPlanner:
    """
    Plan by the paper's value and straightness, and keep L whatever the AUVs do.

    Options are as in scenario files: ``tie_order``, see `TieOrder.named`.
    """
    return RobustPlanner(tie_order=TieOrder.named(tie_order))
