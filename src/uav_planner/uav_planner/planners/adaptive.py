"""Whole-mission tours, flown ahead in the planner, from the paths with which L can be kept."""

from __future__ import annotations

import enum
import functools
from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from uav_planner.guarantee import GuaranteedPaths
from uav_planner.look_ahead import Work, flights, in_other_orders, planned_ahead
from uav_planner.mission_rollout import CellTours, CoolingSchedule
from uav_planner.planners.robust import RobustPlanner
from uav_planner.planning import LookAhead
from uav_planner.tours import (
    TourProblem,
    carried_on,
    check_region,
    improved,
    warm_up,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from msgs_json.geometry import Cell
    from uav_planner.planning import (
        MissionSpec,
        PlanRequest,
        PlanResult,
        SortiePlan,
        SortieRequest,
        SurveyLeg,
    )


Option = TypeVar('Option', bound=enum.Enum)


class Effort(enum.Enum):
    """How thoroughly to plan."""

    MINIMAL = 'minimal'
    FAST = 'fast'
    NORMAL = 'normal'
    THOROUGH = 'thorough'


WORK = {
    Effort.MINIMAL: Work(
        changes_per_cell=50,
        start_slices=1,
        flown_starts=1,
        flown_slices=1,
        slice_meetings=3_000,
        meetings_in_flight=500,
    ),
    Effort.FAST: Work(
        changes_per_cell=500,
        start_slices=4,
        flown_starts=2,
        flown_slices=6,
        slice_meetings=50_000,
        meetings_in_flight=5_000,
    ),
    Effort.NORMAL: Work(
        changes_per_cell=500,
        start_slices=12,
        flown_starts=4,
        flown_slices=18,
        slice_meetings=100_000,
        meetings_in_flight=20_000,
    ),
    Effort.THOROUGH: Work(
        changes_per_cell=500,
        start_slices=24,
        flown_starts=8,
        flown_slices=24,
        slice_meetings=100_000,
        meetings_in_flight=50_000,
    ),
}


class VisitingOrder(enum.Enum):
    """In which order sorties go to the AUVs."""

    FIXED = 'fixed'
    """In which they come in the scenario."""
    PLANNED = 'planned'
    """Chosen once, before take-off."""


FLIGHT_TEMPERATURES = (2.0, 0.3)
"""At the beginning and at the end of improving tours in flight, where they are good already."""


class AdaptivePlanner:
    """
    Plans tours of all AUVs to the end of the mission and cuts the next path from them.

    Parameters
    ----------
    effort
        How thoroughly.
    visiting_order
        Whether to choose it.

    """

    guarantees_limit = True

    def __init__(
        self,
        *,
        effort: Effort = Effort.NORMAL,
        visiting_order: VisitingOrder = VisitingOrder.FIXED,
    ) -> None:
        self._work = WORK[effort]
        self._visiting_order = visiting_order
        self._leg_planner = RobustPlanner()
        warm_up()

    def look_ahead(self, request: SortieRequest) -> Iterator[LookAhead]:
        """
        Plan tours of all AUVs from their initial paths to the end of the mission.

        First many sets of tours that are short and of equal length, then the best of them better
        by flying them.
        """
        if request.values is None or not (request.values == 1.0).any():
            return
        values = request.values.tobytes()
        known = _known(
            request.mission, request.legs, values, request.now_s, self._work, self._visiting_order
        )
        if known:
            yield from known
            return
        requests = [request]
        if self._visiting_order is VisitingOrder.PLANNED:
            requests = in_other_orders(request)
        problems = [
            TourProblem(
                mission=each.mission,
                legs=each.legs,
                values=request.values.copy(),
                now_s=each.now_s,
                position=each.mission.c3,
            )
            for each in requests
        ]
        slices = []
        for ahead in planned_ahead(problems, self._work):
            slices.append(ahead)
            yield ahead
        known += slices  # all or nothing: this one may be broken off

    def plan_sortie(self, request: SortieRequest) -> SortiePlan:
        """
        Lay the route of the next sortie; leave so that its worst case is at most L.

        Raises
        ------
        ValueError
            L cannot be kept from the beginning, paths are longer than `robust` searches, or
            the region has a mask and too many cells for ways around it.

        """
        check_region(request.mission.grid)
        return replace(self._leg_planner.plan_sortie(request), tours=request.tours)

    def plan_path(self, request: PlanRequest) -> PlanResult:
        """
        Choose the longest allowed part of the tour that the AUV should make from here.

        Raises
        ------
        ValueError
            The AUV has no leg among those of the request.

        """
        guaranteed = GuaranteedPaths(request)
        problem = TourProblem(
            mission=request.mission,
            legs=request.round_legs,
            values=request.values,
            now_s=request.now_s,
            position=request.mission.c3 if request.position is None else request.position,
            met=request.auv,
            cell=request.cell,
            behind=request.behind,
        )
        tours = carried_on(problem, request.tours)
        if tours.cells.size == 0:
            return guaranteed.plan(None)
        schedule = CoolingSchedule(
            flights(problem, self._work.meetings_in_flight), *FLIGHT_TEMPERATURES
        )
        tours = improved(problem, tours, True, schedule, np.random.default_rng(0)).best
        problem = _kept_busy(problem, tours)
        path = _next_path(problem, tours, guaranteed)
        if path is None and problem.foreseen(tours).left > 0:
            plan = self._leg_planner.plan_path(request)
        else:
            plan = guaranteed.plan(path)
        return replace(plan, tours=problem.named(tours))


@functools.lru_cache(maxsize=16)
def _known(
    mission: MissionSpec,
    legs: tuple[SurveyLeg, ...],
    values: bytes,
    now_s: float,
    work: Work,
    visiting_order: VisitingOrder,
) -> list[LookAhead]:
    """Return what was planned for the same mission; those that differ only in chance share it."""
    return []


def _kept_busy(problem: TourProblem, tours: CellTours) -> TourProblem:
    """
    Return the problem with as many moves for the AUV that is met as it should make at least.

    At the end of its tour it goes on for as many moves as cost the least, the most of those that
    cost the same: a shorter path would leave it at the surface, among ships, for nothing.
    """
    moves = len(problem.path_along(tours)) - 1
    moves_max = min(problem.mission.path_cells, problem.moves_until_explored(tours))
    trials = [replace(problem, moves_least=least) for least in range(moves_max, moves, -1)]
    return min([*trials, problem], key=lambda trial: trial.cost(tours))


def _next_path(
    problem: TourProblem, tours: CellTours, guaranteed: GuaranteedPaths
) -> tuple[Cell, ...] | None:
    """Return the longest allowed path along a tour, None if none is."""
    path = problem.path_along(tours)
    while len(path) > problem.mission.min_path_cells:
        if guaranteed.allows(path):
            return path
        path = path[:-1]
    return None


def make_adaptive(
    *, effort: str = Effort.NORMAL.value, visiting_order: str = VisitingOrder.FIXED.value
) -> AdaptivePlanner:
    """
    Plan whole missions ahead, and keep L whatever the AUVs do.

    Options are as in scenario files: ``effort``, 'minimal', 'fast', 'normal' or 'thorough', and
    ``visiting_order``, 'fixed' or 'planned'.

    Raises
    ------
    ValueError
        There is no such effort, or no such visiting order.

    """
    return AdaptivePlanner(
        effort=_member(Effort, 'effort', effort),
        visiting_order=_member(VisitingOrder, 'visiting_order', visiting_order),
    )


def _member(kind: type[Option], option: str, value: str) -> Option:
    """Return the member of an enumeration that has a value."""
    try:
        return kind(value)
    except ValueError:
        allowed = ', '.join(each.value for each in kind)
        raise ValueError(f"{option} must be one of {allowed}, not '{value}'") from None
