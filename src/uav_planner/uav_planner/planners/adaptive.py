"""Whole-mission tours, flown ahead in the planner, from the paths with which L can be kept."""

from __future__ import annotations

import enum
import functools
import itertools
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np

from uav_planner.guarantee import GuaranteedPaths, guaranteed_sortie
from uav_planner.mission_rollout import CellTours, CoolingSchedule
from uav_planner.planners.robust import RobustPlanner
from uav_planner.planning import LookAhead
from uav_planner.tours import (
    TourProblem,
    carried_on,
    check_region,
    improved,
    lanes,
    strips,
    warm_up,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from msgs_json.geometry import Cell, Point
    from uav_planner.planning import (
        MissionSpec,
        PlanRequest,
        PlanResult,
        SortiePlan,
        SortieRequest,
        SurveyLeg,
    )


Option = TypeVar('Option', bound=enum.Enum)


@dataclass(frozen=True, slots=True, kw_only=True)
class Work:
    """How much work planning is, counted, not timed."""

    changes_per_cell: int
    """Changes tried, before take-off, to make tours short and of equal length; per cell ..."""
    start_slices: int
    """... in all slices together, for several such starts where they are few ..."""
    flown_starts: int
    """... of which so many of the best are improved by flying them ..."""
    flown_slices: int
    """... in so many slices each ..."""
    slice_meetings: int
    """... with so many meetings in a slice."""
    meetings_in_flight: int
    """Meetings flown when one path is planned."""


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
        meetings_in_flight=75_000,
    ),
}


class VisitingOrder(enum.Enum):
    """In which order sorties go to the AUVs."""

    FIXED = 'fixed'
    """In which they come in the scenario."""
    PLANNED = 'planned'
    """Chosen once, before take-off."""


PERMUTED_AUVS_MAX = 5
"""All orders of so many AUVs are tried; of more those in which one is visited out of turn."""
FLOWN_ORDERS = 3
"""With so many of the best of them tours are improved by flying them."""

START_SLICES_MAX = 10
"""A start takes no more slices than this, however many cells there are."""
SLICE_CHANGES = 50_000
SLICE_CELLS = 40_000_000
"""Changes tried in a slice, and cells moved by them, at most: less than a second."""

# Temperatures are in ticks by which tours may be worse: at first about as much as a revisit, so
# that tours change a lot, at last less than anything counts. Nothing hangs on the exact figures:
# with half or twice as much at first the reference mission takes as long, on average over seeds.
START_TEMPERATURES = (2.5, 10.0, 5.0, 5.0, 10.0, 2.5)
"""Starts differ in how much disorder they begin with, strips and lanes by turns."""
STARTS_MIN = 2
"""One from strips and one from lanes."""
START_END_TEMPERATURE = 0.1
"""Then hardly any detour is taken any more."""
GROUND_TEMPERATURES = (6.0, 0.3)
"""At the beginning and at the end of improving tours by flying them before take-off ..."""
STRIPS_TEMPERATURES = (2.5, 0.3)
"""... strips as they are, which would not outlast the other ones ..."""
FLIGHT_TEMPERATURES = (2.0, 0.3)
"""... and in flight, where tours are good already."""


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
            requests = _other_orders(request)
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
        for ahead in _look_ahead(problems, self._work):
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
            _flights(problem, self._work.meetings_in_flight), *FLIGHT_TEMPERATURES
        )
        tours = improved(problem, tours, True, schedule, np.random.default_rng(0)).best
        problem = _kept_busy(problem, tours)
        path = _next_path(problem, tours, guaranteed)
        if path is None and problem.foreseen(tours).left > 0:
            plan = self._leg_planner.plan_path(request)
        else:
            plan = guaranteed.plan(path)
        return replace(plan, tours=problem.named(tours))


class _Start(NamedTuple):
    """Tours to begin with, and how they are made short and of equal length."""

    tours: CellTours
    schedules: list[CoolingSchedule]
    number: int


def _starts(problem: TourProblem, work: Work) -> list[_Start]:
    """
    Return tours of several kinds to begin with.

    Strips are the safe choice where a sortie takes nearly all of L; what begins with disorder is
    often shorter where it does not.
    """
    along_strips, along_lanes = strips(problem), lanes(problem)
    cells = along_strips.cells.size
    changes_max = max(1, min(SLICE_CHANGES, SLICE_CELLS // cells))
    slices_each = min(START_SLICES_MAX, -(-work.changes_per_cell * cells // changes_max))
    changes = min(changes_max, work.changes_per_cell * cells // slices_each)
    starts = [_Start(along_strips, [], 0)]
    for kind in range(max(STARTS_MIN, work.start_slices // slices_each)):
        schedules = _schedule(
            START_TEMPERATURES[kind % len(START_TEMPERATURES)],
            START_END_TEMPERATURE,
            changes,
            slices_each,
        )
        tours = (along_strips, along_lanes)[kind % 2]
        starts.append(_Start(tours, schedules, kind + 1))
    return starts


def _other_orders(request: SortieRequest) -> list[SortieRequest]:
    """
    Return the first sortie in its visiting order and in others that keep L.

    The searches of the first legs are laid for each order.
    """
    requests = [request]
    for legs in _orders(request.legs):
        in_order = replace(request, legs=tuple(replace(leg, search=()) for leg in legs))
        try:
            route = guaranteed_sortie(in_order).route
        except ValueError:
            continue  # the round is too long with this one
        searches: dict[str, tuple[Point, ...]] = {}
        for waypoint in route:
            searches[waypoint.auv] = (*searches.get(waypoint.auv, ()), waypoint.point)
        legs = tuple(replace(leg, search=searches[leg.auv]) for leg in legs)
        requests.append(replace(request, legs=legs))
    return requests


def _orders(legs: tuple[SurveyLeg, ...]) -> Iterator[tuple[SurveyLeg, ...]]:
    """Yield legs in other orders than this."""
    if len(legs) <= PERMUTED_AUVS_MAX:
        yield from itertools.islice(itertools.permutations(legs), 1, None)
        return
    for here, there in itertools.permutations(range(len(legs)), 2):
        if here != there + 1:  # that is the same as the other one moved the other way
            rest = [*legs[:here], *legs[here + 1 :]]
            yield (*rest[:there], legs[here], *rest[there:])


class _Candidate(NamedTuple):
    """Tours planned before take-off, for one visiting order; they are ranked by their cost."""

    cost: float
    start: int
    """Number of the start that they come from."""
    order: int
    """Number of the visiting order."""
    tours: CellTours


def _look_ahead(problems: list[TourProblem], work: Work) -> Iterator[LookAhead]:
    """Yield the best tours so far, slice by slice; the problems differ in the visiting order."""
    starts = _starts(problems[0], work)
    flown_starts = min(len(starts), work.flown_starts)
    flown_orders = min(len(problems), FLOWN_ORDERS)
    slices = sum(len(start.schedules) for start in starts)
    slices += flown_orders * flown_starts * work.flown_slices
    done = itertools.count(1)
    best = _Candidate(math.inf, 0, 0, starts[0].tours)

    def ahead() -> LookAhead:
        problem = problems[best.order]
        return LookAhead(
            share=next(done) / slices,
            tours=problem.named(best.tours),
            visiting_order=tuple(leg.auv for leg in problem.legs),
        )

    found: list[_Candidate] = []
    for start in starts:
        rng = np.random.default_rng(start.number)
        tours = shortest = start.tours
        length = math.inf
        for schedule in start.schedules:
            tours, candidate, cost = improved(problems[0], tours, False, schedule, rng)
            if cost < length:
                length, shortest = cost, candidate
            yield ahead()
        by_auv = problems[0].named(shortest)
        for order, problem in enumerate(problems):
            tours = carried_on(problem, by_auv)
            found.append(_Candidate(problem.cost(tours), start.number, order, tours))
        best = min(found)
    found.sort()
    for order in list(dict.fromkeys(each.order for each in found))[:flown_orders]:
        problem = problems[order]
        flights = _flights(problem, work.slice_meetings)
        for each in [each for each in found if each.order == order][:flown_starts]:
            rng = np.random.default_rng(each.start)
            temperatures = GROUND_TEMPERATURES if each.start > 0 else STRIPS_TEMPERATURES
            tours = each.tours
            for schedule in _schedule(*temperatures, flights, work.flown_slices):
                tours, candidate, cost = improved(problem, tours, True, schedule, rng)
                if cost < best.cost:
                    best = _Candidate(cost, each.start, order, candidate)
                yield ahead()


def _schedule(first: float, last: float, tries: int, slices: int) -> list[CoolingSchedule]:
    """Return one cooling cut into slices."""
    steps = np.geomspace(first, last, slices + 1).tolist()
    return [CoolingSchedule(tries, *pair) for pair in itertools.pairwise(steps)]


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


def _flights(problem: TourProblem, meetings: int) -> int:
    """Return how many missions can be flown to their end with a number of meetings."""
    cells, auvs = int((problem.values == 1.0).sum()), len(problem.legs)
    each = auvs + cells // problem.mission.path_cells
    return max(1, meetings // each)


def _kept_busy(problem: TourProblem, tours: CellTours) -> TourProblem:
    """
    Return the problem with as many moves for the AUV that is met as it should make at least.

    At the end of its tour it goes on until all is explored, unless others have to wait for it: to
    lie at the surface, where ships are, would not be sooner done.
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
