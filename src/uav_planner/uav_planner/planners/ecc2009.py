"""The planner of ECC 2009: Algorithm 1, its gaps filled by the decisions in the method's text."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from msgs_json.geometry import TOLERANCE
from uav_planner.candidate_paths import (
    DOCUMENTED_TIE_ORDER,
    TieOrder,
    check_listed,
    greedy_cell,
    walk_table,
)
from uav_planner.path_choice import best_path
from uav_planner.planning import Planner, PlanResult, PlanStatus, Prospect, SortiePlan
from uav_planner.sortie import (
    Flown,
    clear_track,
    flight_time_s,
    home_ticks_of_tracks,
    lay_route,
    punctual_departure_s,
    worst_case_s,
)

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from msgs_json.geometry import Cell
    from uav_planner.planning import MissionSpec, PlanRequest, SortieRequest, SurveyLeg


class Ecc2009Planner(Planner):
    """
    Algorithm 1 of ECC 2009: the best path that keeps the next sortie's flight time within L.

    The flight time has no waits in it, and where the AUVs not yet met will go is guessed: the
    limit is foreseen, not guaranteed.

    Parameters
    ----------
    tie_order
        Which of several equally good paths, and of equally good greedy cells, is taken.

    """

    guarantees_limit = False

    def __init__(self, *, tie_order: TieOrder = DOCUMENTED_TIE_ORDER) -> None:
        self._tie_order = tie_order

    def plan_path(self, request: PlanRequest) -> PlanResult:
        """
        Choose the next path of the AUV that was just met (Algorithm 1).

        Where no path of q moves is feasible, shorter ones are tried down to Delta moves. Where
        none of those is, the last resort is the best path of Delta moves, the limit ignored; for
        Delta = 1 that is the greedy cell.

        Raises
        ------
        ValueError
            The AUV has no leg among those of the request, its cell lies outside the region, or
            the region has no path of Delta moves or more than `WalkTable` can hold.

        """
        mission = request.mission
        turn = _turn(request)
        # Lines 1-9: where the others go next, known or guessed.
        before = [self._expected_path(request, leg) for leg in request.legs[:turn]]
        after = [self._expected_path(request, leg) for leg in request.legs[turn + 1 :]]
        # Lines 10-21: L-, the sortie without this AUV, and lambda, what it leaves of L.
        flown = clear_track(mission, Flown(point=mission.c3, ticks=0), _track(before))
        committed_ticks = clear_track(mission, flown, _track(after)).home_ticks(mission)
        slack_s = mission.sortie_limit_s - committed_ticks * mission.tick_s
        # Line 22: getPath(q, P_k0, M, lambda).
        sortie = _NextSortie(
            mission=mission, flown=flown, after=_track(after), limit_ticks=mission.limit_ticks
        )
        shortest, longest = mission.min_path_cells, mission.path_cells
        by_length = (
            self._best_path(request, moves, sortie) for moves in range(longest, shortest - 1, -1)
        )
        path = next((path for path in by_length if path is not None), None)
        if path is None:
            status = PlanStatus.INFEASIBLE
            path = self._best_path(request, shortest, replace(sortie, limit_ticks=math.inf))
        elif len(path) - 1 < longest:
            status = PlanStatus.SHORTENED
        else:
            status = PlanStatus.OK
        if path is None:
            raise ValueError(
                f'no path of {shortest} moves from cell {list(request.cell)} in the region'
            )
        return PlanResult(
            status=status,
            path=path,
            slack_s=slack_s,
            sortie_time_s=sortie.ticks_with(path) * mission.tick_s,
        )

    def plan_sortie(self, request: SortieRequest) -> SortiePlan:
        """
        Lay the route (Section III.A); leave so as to reach the first waypoint at `S_1`.

        Raises
        ------
        ValueError
            The mission's paths are longer than can be listed.

        """
        mission = request.mission
        check_listed(mission.path_cells)
        walk_table(mission.path_cells, self._tie_order)  # made on the ground, not at a meeting
        route = lay_route(mission, request.legs)
        depart_s = punctual_departure_s(mission, route, request.now_s)
        return SortiePlan(
            route=route,
            depart_s=depart_s,
            predicted_s=flight_time_s(mission, route),
            worst_case_s=worst_case_s(mission, route, depart_s),
        )

    def _expected_path(self, request: PlanRequest, leg: SurveyLeg) -> tuple[Cell, ...]:
        """
        Return the path on which the next sortie has to look for another AUV.

        An AUV met in this sortie has its new path. For another one both ends of its present path
        are tried with the greedy cell it would get there (``wcell`` at `P_kq` and ``bcell`` at
        `P_k0`, lines 4 and 5); the greedy cell farther from C3 counts (``determine tau``, line
        17).
        """
        if leg.prospect is Prospect.STAYS:
            return leg.path
        grid, c3 = request.mission.grid, request.mission.c3
        guesses = [
            (end, greedy_cell(request.values, grid, end, self._tie_order))
            for end in (leg.path[-1], leg.path[0])
        ]
        far_m, near_end_m = (grid.centre(guess[1]).distance_m(c3) for guess in guesses)
        return guesses[1] if near_end_m > far_m * (1.0 + TOLERANCE) else guesses[0]

    def _best_path(
        self, request: PlanRequest, moves: int, sortie: _NextSortie
    ) -> tuple[Cell, ...] | None:
        """Return the best path of so many moves that keeps the next sortie within its limit."""
        return best_path(walk_table(moves, self._tie_order), request.values, request.cell, sortie)


def make_ecc2009(*, tie_order: str = DOCUMENTED_TIE_ORDER.name) -> Ecc2009Planner:
    """
    Plan as ECC 2009 does, by Algorithm 1; its promise about L fails where AUVs surface early.

    Options are as in scenario files: ``tie_order``, see `TieOrder.named`.
    """
    return Ecc2009Planner(tie_order=TieOrder.named(tie_order))


@dataclass(frozen=True, slots=True, kw_only=True)
class _NextSortie:
    """The flight of the next sortie, all known but the path of the AUV that was met."""

    mission: MissionSpec
    flown: Flown
    """The part before that AUV's turn."""
    after: list[Cell]
    """The track of the AUVs after it."""
    limit_ticks: float

    def allows(self, path: tuple[Cell, ...]) -> bool:
        """Return whether the sortie with one path keeps the limit."""
        return self.ticks_with(path) <= self.limit_ticks

    def allows_each(self, tracks: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Return for each of many tracks whether the sortie with it keeps the limit."""
        ticks = home_ticks_of_tracks(self.mission, self.flown, tracks, self.after)
        feasible: NDArray[np.bool_] = ticks <= self.limit_ticks
        return feasible

    def ticks_with(self, path: tuple[Cell, ...]) -> int:
        """Return the flight time with one path."""
        met = clear_track(self.mission, self.flown, itertools.chain(path[::-1], self.after))
        return met.home_ticks(self.mission)


def _turn(request: PlanRequest) -> int:
    """Return the place of the AUV that was met in the visiting order."""
    auvs = [leg.auv for leg in request.legs]
    if request.auv not in auvs:
        raise ValueError(f'{request.auv} has no leg among those of {auvs}')
    problem = request.mission.grid.problem_with(request.cell)
    if problem:
        raise ValueError(f'{request.auv}: {problem}')
    return auvs.index(request.auv)


def _track(paths: list[tuple[Cell, ...]]) -> list[Cell]:
    """Return the cells of paths in searching order: each path from its end back to its start."""
    return [cell for path in paths for cell in reversed(path)]
