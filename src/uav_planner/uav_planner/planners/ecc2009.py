"""The planner of ECC 2009: Algorithm 1, its gaps filled by the decisions in the method's text."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from msgs_json.geometry import TOLERANCE, whole_ticks
from uav_planner.candidate_paths import (
    DOCUMENTED_TIE_ORDER,
    TIE_MARGIN,
    TURN_COST,
    TieOrder,
    WalkTable,
    greedy_cell,
    walk_table,
)
from uav_planner.planning import PlanResult, PlanStatus, SortiePlan
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
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from msgs_json.geometry import Cell
    from uav_planner.planning import MissionSpec, PlanRequest, SurveyLeg

SINGLE_CHECKS = 8
"""So many of the best candidates are timed one by one: it takes as long as 100 at once."""
SCORE_DROPS = (2 * TURN_COST, 1.5, math.inf)
"""Candidates are ranked in parts that reach so far below the best score: a few first, then all."""


class Ecc2009Planner:
    """
    Algorithm 1 of ECC 2009: the best path that keeps the next sortie's flight time within L.

    The flight time has no waits in it, and where the AUVs not yet met will go is guessed: the
    limit is foreseen, not guaranteed.

    Parameters
    ----------
    tie_order
        Which of several equally good paths, and of equally good greedy cells, is taken.

    """

    meets_out_of_turn = False

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
        sortie = _NextSortie(mission=mission, flown=flown, after=_track(after))
        limit_ticks = -whole_ticks(-mission.sortie_limit_s / mission.tick_s)  # rounded down
        shortest, longest = mission.min_path_cells, mission.path_cells
        by_length = (
            self._best_path(request, moves, sortie, limit_ticks)
            for moves in range(longest, shortest - 1, -1)
        )
        path = next((path for path in by_length if path is not None), None)
        if path is None:
            status = PlanStatus.INFEASIBLE
            path = self._best_path(request, shortest, sortie, math.inf)
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

    def plan_sortie(
        self, mission: MissionSpec, legs: tuple[SurveyLeg, ...], now_s: float
    ) -> SortiePlan:
        """
        Lay the route (Section III.A); leave so as to reach the first waypoint at `S_1`.

        Raises
        ------
        ValueError
            The mission's paths are longer than `WalkTable` can hold.

        """
        walk_table(mission.path_cells, self._tie_order)  # made on the ground, not at a meeting
        route = lay_route(mission, legs)
        depart_s = punctual_departure_s(mission, route, now_s)
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
        if leg.auv in request.met:
            return leg.path
        grid, c3 = request.mission.grid, request.mission.c3
        guesses = [
            (end, greedy_cell(request.values, grid, end, self._tie_order))
            for end in (leg.path[-1], leg.path[0])
        ]
        far_m, near_end_m = (grid.centre(guess[1]).distance_m(c3) for guess in guesses)
        return guesses[1] if near_end_m > far_m * (1.0 + TOLERANCE) else guesses[0]

    def _best_path(
        self, request: PlanRequest, moves: int, sortie: _NextSortie, limit_ticks: float
    ) -> tuple[Cell, ...] | None:
        """Return the best path of so many moves that keeps the next sortie within a limit."""
        table = walk_table(moves, self._tie_order)
        scores = table.scores(request.values, request.cell)
        walk = _Choice(table, request.cell, scores, sortie, limit_ticks).best()
        return None if walk is None else table.path(walk, request.cell)


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

    def ticks_with(self, path: tuple[Cell, ...]) -> int:
        """Return the flight time with one path."""
        met = clear_track(self.mission, self.flown, itertools.chain(path[::-1], self.after))
        return met.home_ticks(self.mission)

    def ticks_with_each(self, tracks: NDArray[np.intp]) -> NDArray[np.int64]:
        """Return the flight time with each of many tracks."""
        return home_ticks_of_tracks(self.mission, self.flown, tracks, self.after)


@dataclass(frozen=True, slots=True)
class _Choice:
    """Which of the walks of a table from a cell is the best feasible one."""

    table: WalkTable
    start: Cell
    scores: NDArray[np.float64]
    sortie: _NextSortie
    limit_ticks: float

    def best(self) -> int | None:
        """
        Return the walk that a comparison of all feasible walks in tie order ends with.

        Best first, so that only a few need their flight timed.
        """
        best = self._first_feasible()
        if best is None:
            return None
        # Scores that differ by rounding only tie, and the one that comes first wins: follow them
        # down to the first gap and compare as the full comparison would.
        scores = self.scores
        floor = scores[best]
        while (lower := scores[(scores < floor) & (scores >= floor - TIE_MARGIN)]).size > 0:
            floor = lower.min()
        if floor == scores[best]:
            return best
        rivals = np.flatnonzero((scores >= floor) & (scores <= scores[best]))
        chosen, *later = rivals[self._are_feasible(rivals)].tolist()
        for walk in later:
            if scores[walk] > scores[chosen] + TIE_MARGIN:
                chosen = walk
        return int(chosen)

    def _first_feasible(self) -> int | None:
        """Return the first feasible walk in order of falling score, equal scores in tie order."""
        single_checks = SINGLE_CHECKS
        for walks in self._best_first():
            single, many = walks[:single_checks], walks[single_checks:]
            single_checks -= single.size
            for walk in single.tolist():
                if self.sortie.ticks_with(self.table.path(walk, self.start)) <= self.limit_ticks:
                    return int(walk)
            if many.size > 0:
                feasible = self._are_feasible(many)
                if feasible.any():
                    return int(many[feasible.argmax()])
        return None

    def _best_first(self) -> Iterator[NDArray[np.intp]]:
        """Yield all walks within the region in that order, in parts: sorting all is slow."""
        scores = self.scores
        ceiling = np.inf
        for floor in (scores.max() - drop for drop in SCORE_DROPS):
            walks = np.flatnonzero((scores >= floor) & (scores < ceiling) & (scores > -np.inf))
            yield walks[np.argsort(-scores[walks], kind='stable')]
            ceiling = floor

    def _are_feasible(self, walks: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Return for each walk whether the next sortie with it keeps the limit."""
        ticks = self.sortie.ticks_with_each(self.table.tracks(walks, self.start))
        feasible: NDArray[np.bool_] = ticks <= self.limit_ticks
        return feasible


def _turn(request: PlanRequest) -> int:
    """Return the place of the AUV that was met in the visiting order."""
    auvs = [leg.auv for leg in request.legs]
    if request.auv not in auvs:
        raise ValueError(f'{request.auv} has no leg among those of {auvs}')
    if not request.mission.grid.contains(request.cell):
        raise ValueError(f'cell {list(request.cell)} of {request.auv} is outside the region')
    return auvs.index(request.auv)


def _track(paths: list[tuple[Cell, ...]]) -> list[Cell]:
    """Return the cells of paths in searching order: each path from its end back to its start."""
    return [cell for path in paths for cell in reversed(path)]
