"""Whole missions planned before take-off, slice by slice."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from uav_planner.guarantee import guaranteed_sortie, least_limit_s
from uav_planner.mission_rollout import CellTours, CoolingSchedule
from uav_planner.planning import LookAhead
from uav_planner.sortie import searches_of
from uav_planner.tours import TourProblem, carried_on, improved, lanes, strips

if TYPE_CHECKING:
    from collections.abc import Iterator

    from uav_planner.planning import SortieRequest, SurveyLeg


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


PERMUTED_AUVS_MAX = 5
"""All visiting orders of so many AUVs are looked at, ..."""
PLACES_MAX = 3
"""... of more AUVs those in which one of them is moved by up to so many places, ..."""
ORDERS_MAX = 24
"""... tours are flown once in so many with the shortest rounds, ..."""
FLOWN_ORDERS = 3
"""... and are improved in so many of the best: that takes nearly all of the time."""

START_SLICES_MAX = 10
"""A start takes no more slices than this, however many cells there are."""
SLICE_CHANGES = 50_000
SLICE_CELLS = 40_000_000
"""Changes tried in a slice, and cells moved by them, at most: less than a second."""

# Temperatures are in ticks by which tours may be worse: at first about as much as a revisit, so
# that tours change a lot, at last less than anything counts.
START_TEMPERATURES = (2.5, 10.0, 5.0, 5.0, 10.0, 2.5)
"""Starts differ in how much disorder they begin with, strips and lanes by turns."""
STARTS_MIN = 2
"""One from strips and one from lanes."""
START_END_TEMPERATURE = 0.1
"""Then hardly any detour is taken any more."""
GROUND_TEMPERATURES = (6.0, 0.3)
"""At the beginning and at the end of improving tours by flying them ..."""
STRIPS_TEMPERATURES = (2.5, 0.3)
"""... and of strips as they are, which would not outlast the other ones."""


class _Candidate(NamedTuple):
    """
    Tours planned before take-off, for one visiting order; they are ranked by their cost.

    No two have the same start and order, so that tours themselves are never compared.
    """

    cost: float
    start: int
    """Number of the start that they come from."""
    order: int
    """Number of the visiting order."""
    tours: CellTours


def planned_ahead(problems: list[TourProblem], work: Work) -> Iterator[LookAhead]:
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
        tries = flights(problem, work.slice_meetings)
        for each in [each for each in found if each.order == order][:flown_starts]:
            rng = np.random.default_rng(each.start)
            temperatures = GROUND_TEMPERATURES if each.start > 0 else STRIPS_TEMPERATURES
            tours = each.tours
            for schedule in _schedule(*temperatures, tries, work.flown_slices):
                tours, candidate, cost = improved(problem, tours, True, schedule, rng)
                if cost < best.cost:
                    best = _Candidate(cost, each.start, order, candidate)
                yield ahead()


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


def in_other_orders(request: SortieRequest) -> list[SortieRequest]:
    """
    Return the first sortie in its visiting order and in others with the shortest rounds within L.

    The searches of the first legs are laid for each order.
    """
    mission = request.mission
    requests = [request]
    ranked = sorted(
        (least_limit_s(mission, legs), number, legs)
        for number, legs in enumerate(_orders(request.legs))
    )
    for needed_s, _, legs in ranked[:ORDERS_MAX]:
        if needed_s > mission.limit_ticks * mission.tick_s:
            break
        unlaid = tuple(replace(leg, search=()) for leg in legs)
        searches = searches_of(guaranteed_sortie(replace(request, legs=unlaid)).route)
        legs = tuple(replace(leg, search=searches[leg.auv]) for leg in legs)
        requests.append(replace(request, legs=legs))
    return requests


def _orders(legs: tuple[SurveyLeg, ...]) -> Iterator[tuple[SurveyLeg, ...]]:
    """Yield legs in other orders than this, each once."""
    if len(legs) <= PERMUTED_AUVS_MAX:
        yield from itertools.islice(itertools.permutations(legs), 1, None)
        return
    for here, leg in enumerate(legs):
        rest = [*legs[:here], *legs[here + 1 :]]
        for there in range(max(0, here - PLACES_MAX), min(len(rest), here + PLACES_MAX) + 1):
            # One place forward is the same as the one before it one place back.
            if there not in (here, here - 1):
                yield (*rest[:there], leg, *rest[there:])


def _schedule(first: float, last: float, tries: int, slices: int) -> list[CoolingSchedule]:
    """Return one cooling cut into slices."""
    steps = np.geomspace(first, last, slices + 1).tolist()
    return [CoolingSchedule(tries, *pair) for pair in itertools.pairwise(steps)]


def flights(problem: TourProblem, meetings: int) -> int:
    """Return how many missions can be flown to their end with a number of meetings."""
    cells, auvs = int((problem.values == 1.0).sum()), len(problem.legs)
    each = auvs + cells // problem.mission.path_cells
    return max(1, meetings // each)
