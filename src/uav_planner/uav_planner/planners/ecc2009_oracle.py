"""
The paths of `ecc2009` by a plain loop over all ``4 ** q`` candidates, written to be obvious.

It is in the package because two programs outside the unit tests need the same one: the tests
check that the planner gives the same answers, and the benchmark measures how much faster it
gives them. Nothing flies with it. It shares only the geometry and the tie order's values with
the planner: the UAV is flown tick by tick, and the paper's set of feasible paths is gone through
one path after another.
"""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING

from msgs_json.geometry import TOLERANCE, is_before, whole_ticks, within_range
from uav_planner.candidate_paths import (
    DOCUMENTED_TIE_ORDER,
    TIE_MARGIN,
    TURN_COST,
    TieOrder,
    check_listed,
)
from uav_planner.planning import PlanResult, PlanStatus, Prospect

if TYPE_CHECKING:
    from collections.abc import Iterator

    from msgs_json.geometry import Cell
    from uav_planner.planning import MissionSpec, PlanRequest, SurveyLeg

Path = tuple['Cell', ...]


def plan_path_by_enumeration(
    request: PlanRequest, tie_order: TieOrder = DOCUMENTED_TIE_ORDER
) -> PlanResult:
    """
    Return what `Ecc2009Planner.plan_path` returns (ECC 2009, Algorithm 1).

    Raises
    ------
    ValueError
        There are more paths than can be gone through, or none of Delta moves.

    """
    mission = request.mission
    check_listed(mission.path_cells)
    paths = {
        leg.auv: leg.path
        if leg.prospect is Prospect.STAYS
        else _guessed_path(request, leg, tie_order)
        for leg in request.legs
        if leg.auv != request.auv
    }
    committed_s = _flight_time_s(mission, list(paths.values()))
    order = [leg.auv for leg in request.legs]

    def sortie_time_s(path: Path) -> float:
        return _flight_time_s(
            mission, [path if auv == request.auv else paths[auv] for auv in order]
        )

    def best_path(moves: int, limit_s: float) -> Path | None:
        best: Path | None = None
        best_score = 0.0
        for path in _walks(request.cell, moves, tie_order):
            if not all(mission.grid.contains(cell) for cell in path):
                continue
            if is_before(limit_s, sortie_time_s(path)):
                continue
            score = _score(request, path)
            if best is None or score > best_score + TIE_MARGIN:
                best, best_score = path, score
        return best

    status = PlanStatus.OK
    path = best_path(mission.path_cells, mission.sortie_limit_s)
    for moves in range(mission.path_cells - 1, mission.min_path_cells - 1, -1):
        if path is None:
            status = PlanStatus.SHORTENED
            path = best_path(moves, mission.sortie_limit_s)
    if path is None:
        status = PlanStatus.INFEASIBLE
        path = best_path(mission.min_path_cells, math.inf)
    if path is None:
        raise ValueError(f'no path of {mission.min_path_cells} moves from {request.cell}')
    return PlanResult(
        status=status,
        path=path,
        slack_s=mission.sortie_limit_s - committed_s,
        sortie_time_s=sortie_time_s(path),
    )


def _walks(start: Cell, moves: int, tie_order: TieOrder) -> Iterator[Path]:
    """Yield every walk from a cell in tie order, whether or not it stays in the region."""
    for walk in itertools.product(tie_order.directions, repeat=moves):
        path = [start]
        for direction in reversed(walk) if tie_order.first_move_fastest else walk:
            east, north = direction.value
            path.append((path[-1][0] + east, path[-1][1] + north))
        yield tuple(path)


def _score(request: PlanRequest, path: Path) -> float:
    """Return the values of a path's cells, halved at every visit, less its turns."""
    score = 0.0
    for moved in range(1, len(path)):
        col, row = path[moved]
        score += float(request.values[row, col]) * 0.5 ** path[:moved].count(path[moved])
    moves = [
        (after[0] - before[0], after[1] - before[1]) for before, after in itertools.pairwise(path)
    ]
    return score - TURN_COST * sum(last != new for last, new in itertools.pairwise(moves))


def _flight_time_s(mission: MissionSpec, paths: list[Path]) -> float:
    """Return how long the UAV flies to clear the paths in turn, each from its end, and return."""
    here, ticks = mission.c3, 0
    for path in paths:
        for cell in reversed(path):
            centre = mission.grid.centre(cell)
            while not within_range(here.distance_m(centre), mission.radio_range_m):
                here = here.toward(centre, mission.step_m)
                ticks += 1
    return (ticks + whole_ticks(here.distance_m(mission.c3) / mission.step_m)) * mission.tick_s


def _guessed_path(request: PlanRequest, leg: SurveyLeg, tie_order: TieOrder) -> Path:
    """Return where an AUV not yet met is expected next: an end of its path and its greedy cell."""
    mission = request.mission
    far_path: Path = ()
    far_m = -math.inf
    for end in (leg.path[-1], leg.path[0]):
        greedy: Cell | None = None
        greedy_value = 0.0
        for direction in tie_order.directions:
            neighbour = (end[0] + direction.value[0], end[1] + direction.value[1])
            if mission.grid.contains(neighbour):
                value = float(request.values[neighbour[1], neighbour[0]])
                if greedy is None or value > greedy_value + TIE_MARGIN:
                    greedy, greedy_value = neighbour, value
        if greedy is None:
            raise ValueError(f'cell {end} has no neighbour')
        distance_m = mission.grid.centre(greedy).distance_m(mission.c3)
        if distance_m > far_m * (1.0 + TOLERANCE):
            far_path, far_m = (end, greedy), distance_m
    return far_path
