"""The paper's values and straightness, chosen from the paths with which L can always be kept."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from uav_planner.candidate_paths import DOCUMENTED_TIE_ORDER, TieOrder
from uav_planner.guarantee import GuaranteedPaths, guaranteed_sortie
from uav_planner.leg_search import LegScore, best_leg, check_moves, warm_up
from uav_planner.planning import Planner
from uav_planner.standstill import is_at_a_standstill

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from msgs_json.geometry import Cell, GridSpec
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
        warm_up()

    def plan_path(self, request: PlanRequest) -> PlanResult:
        """
        Choose the best guaranteed path of q moves; where none was found, stay in place.

        Raises
        ------
        ValueError
            The AUV has no leg among those of the request, or its paths are longer than are
            searched.

        """
        guaranteed = GuaranteedPaths(request)
        return guaranteed.plan(_best_path(request, self._tie_order, guaranteed))

    def plan_sortie(self, request: SortieRequest) -> SortiePlan:
        """
        Lay the route of the next sortie; leave so that its worst case is at most L.

        Raises
        ------
        ValueError
            L cannot be kept from the beginning, or paths are longer than are searched.

        """
        check_moves(request.mission)
        return guaranteed_sortie(request)


def _best_path(
    request: PlanRequest, tie_order: TieOrder, guaranteed: GuaranteedPaths
) -> tuple[Cell, ...] | None:
    """
    Return the best of the paths of q moves that are allowed, None if none is.

    If it neither finds anything new nor ends nearer to it, it is the best of those that do, if one
    is allowed: a longer round may take off more than that is worth, and the AUV would move to and
    fro for ever. Where nobody finds anything new, AUVs in two corners may keep each other from it:
    then the nearest one goes there, and the others make room, nearer to C3.
    """
    mission, values = request.mission, request.values
    index_of = mission.grid.index
    moves_left = _moves_to_unexplored(mission.grid, values)
    moves_left_here = moves_left[index_of(request.cell)]
    ends = np.zeros_like(values) if moves_left_here == np.inf else -DISTANCE_COST * moves_left

    def best_by(score: LegScore) -> tuple[Cell, ...] | None:
        moves = mission.path_cells
        return best_leg(request, guaranteed, score, moves_min=moves, tie_order=tie_order).path

    def finds_new(path: tuple[Cell, ...]) -> bool:
        return any(values[index_of(cell)] == 1.0 for cell in path if cell != request.cell)

    score = LegScore(values=values, ends=ends[np.newaxis], round_cost=ROUND_COST)
    best = best_by(score)
    if best is None:
        return None
    if not finds_new(best) and moves_left[index_of(best[-1])] >= moves_left_here:
        nearer = np.where(moves_left < moves_left_here, ends, -np.inf)
        best = best_by(replace(score, ends=np.array([nearer, ends]))) or best
    if not finds_new(best) and _is_to_make_room(request, moves_left):
        # A move nearer to C3 counts as much as a whole round.
        room = LegScore(
            values=np.zeros_like(values),
            ends=-ROUND_COST * _moves_to_c3(mission)[np.newaxis],
            round_cost=ROUND_COST,
            turn_cost=0.0,
        )
        best = best_by(room) or best
    return best


def _is_to_make_room(request: PlanRequest, moves_left: NDArray[np.float64]) -> bool:
    """Return whether no other AUV finds anything new, and one is nearer to what is left."""
    if not is_at_a_standstill(request):
        return False
    index_of = request.mission.grid.index
    ends = {leg.auv: leg.path[-1] for leg in request.round_legs} | {request.auv: request.cell}
    nearest = min(ends, key=lambda auv: moves_left[index_of(ends[auv])])  # the first of several
    return nearest != request.auv


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
