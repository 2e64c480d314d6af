"""
Theorems 1 and 2 of ECC 2009, on the code that flies.

A real UAV agent with its vehicle and its planner flies over a scripted sea: AUVs that come up
anywhere on their legs, between two cells too, at any tick until their deadlines. Who hears whom is
decided here, from true positions, and what the UAV says of its sorties is held against its track.

Theorem 1: every AUV is on its path, so every one is met. Theorem 2: contacts only skip waypoints
of a fixed list, so no sortie takes longer than its worst case at departure. A planner that
guarantees the limit promises that this is never more than L. Every planner there is flies here,
and is held at each meeting to what a planner promises.
"""

from __future__ import annotations

import itertools
import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace

import hypothesis.strategies as st
import msgspec
import pytest
from hypothesis import Phase, find, given, settings

from msgs_json.agent import Log, Output, Publish, Refuse, Transmit
from msgs_json.custody import SampleCustody
from msgs_json.drivers import NoPorts, UavDriverSetup
from msgs_json.geometry import Cell, GridSpec, Point, unreachable_cells
from msgs_json.messages import (
    Acknowledged,
    Acknowledgement,
    AuvOrder,
    Event,
    Leg,
    LegOutcome,
    Message,
    Met,
    Missed,
    MissionOrder,
    PathAssignment,
    RecoveryOrder,
    Sample,
    SampleBatch,
    SampleReceipt,
    SampleSpan,
    SearchBrokenOff,
    SortieDeparted,
    SortieReport,
    SortieReturned,
    SurfacingReport,
)
from msgs_json.ros_messages import Odometry
from msgs_json.store import MemoryStore
from uav_planner.drivers.kinematic import make_driver
from uav_planner.guarantee import least_limit_s
from uav_planner.mission_order import UavSetup
from uav_planner.oracle_boards import legs_of
from uav_planner.planners import PLANNERS, make_planner
from uav_planner.planning import (
    LookAhead,
    MissionSpec,
    Planner,
    PlanRequest,
    PlanResult,
    Prospect,
    SortiePlan,
    SortieRequest,
    track_of,
)
from uav_planner.sortie import Route, Waypoint, leg_waypoints, round_ticks, worst_case_s
from uav_planner.uav_agent import UavAgent

SORTIES = 3
"""So many are flown: later ones search the legs that earlier ones handed over."""
TICKS_MAX = 1500
"""More than any case takes: a UAV that never comes home fails its test."""
EPSILON_S = 1e-6
SLACK = 1.0 + 1e-9
"""Times a length: what every comparison of lengths forgives."""


# --- the sea -------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class Fate:
    """What becomes of an AUV on a leg, as shares of whatever that leg turns out to be."""

    hop: float
    """On which hop of its way it comes up, 0 ... 1 (excluded)."""
    along: float
    """How far it gets on this hop: 0 and 1 are centres of cells, or where the leg began."""
    when: float
    """From 0, at the first tick under water, to 1, its deadline."""
    deaf_ticks: int
    """For so many ticks after the UAV first spoke to it, it hears nothing."""
    samples: int
    """So many does it take; it says one at a time, in its reports."""


class Auv:
    """Comes up where and when its fates say, reports at every tick, dives when it is told."""

    def __init__(self, name: str, mission: MissionSpec, leg: Leg, fates: Iterable[Fate]) -> None:
        self.name = name
        self.finished = False
        self._taken: list[Sample] = []
        """All samples of all legs."""
        self._held = 0
        """So many of them, the oldest, does the UAV say to have."""
        self._mission = mission
        self._fates = itertools.cycle(fates)
        self.position = mission.grid.centre(leg.path[0])
        self._begin(leg, first_tick=0)

    def _begin(self, leg: Leg, first_tick: int) -> None:
        self._leg, self._fate = leg, next(self._fates)
        self._spoken_to_tick: int | None = None
        centres = [self._mission.grid.centre(cell) for cell in leg.path]
        self.leg_began_between_cells = self.position != centres[0]
        way = [self.position, *centres] if self.leg_began_between_cells else centres
        hop = int(self._fate.hop * (len(way) - 1))
        self.position = _between(way[hop], way[hop + 1], self._fate.along)
        self.is_between_cells = self.position not in centres
        reached = hop + (self.position == way[hop + 1])
        self._moves_done = max(0, reached - self.leg_began_between_cells)
        for _ in range(self._fate.samples):
            number = len(self._taken)
            sample = Sample(
                auv=self.name, number=number, cell=leg.path[0], entered_s=0.0, value=1.0
            )
            self._taken.append(sample)
        deadline_tick = round(leg.surface_deadline_s / self._mission.tick_s)
        self._up_tick = first_tick + round(self._fate.when * (deadline_tick - first_tick))

    def is_up(self, tick: int) -> bool:
        return tick >= self._up_tick

    def report(self) -> SurfacingReport:
        return SurfacingReport(
            auv=self.name,
            leg_id=self._leg.leg_id,
            outcome=LegOutcome.EARLY,
            moves_done=self._moves_done,
            cell=self._leg.path[self._moves_done],
            position=self.position,
            surfaced_s=self._up_tick * self._mission.tick_s,
            samples_taken=len(self._taken),
            samples=tuple(self._taken[self._held : self._held + 1]),
        )

    def receive(self, message: Message, tick: int) -> Acknowledgement | None:
        if self._spoken_to_tick is None:
            self._spoken_to_tick = tick
        if tick < self._spoken_to_tick + self._fate.deaf_ticks:
            return None
        match message:
            case SampleReceipt(held=held, at_c3=at_c3):
                self._held = max([0, *(span.until for span in (*held, *at_c3))])
                return None
            case PathAssignment(leg=leg):
                if leg.leg_id > self._leg.leg_id:
                    self._begin(leg, first_tick=tick + 1)
                return Acknowledgement(
                    acknowledges=Acknowledged.PATH_ASSIGNMENT, reference=leg.leg_id
                )
            case RecoveryOrder(leg_id=leg_id):
                self.finished = True
                return Acknowledgement(acknowledges=Acknowledged.RECOVERY_ORDER, reference=leg_id)
            case _:
                return None


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A mission, its initial legs and what the sea does."""

    mission: MissionSpec
    paths: tuple[tuple[Cell, ...], ...]
    deadline_ticks: tuple[int, ...]
    auv_speed_mps: float
    fates: tuple[tuple[Fate, ...], ...]
    """By AUV and leg; over again when they are used up."""

    def order(self) -> MissionOrder:
        mission = self.mission
        return MissionOrder(
            mission_id='theorems',
            region=mission.grid,
            c3=mission.c3,
            radio_range_m=mission.radio_range_m,
            sortie_limit_s=mission.sortie_limit_s,
            path_cells=mission.path_cells,
            min_path_cells=mission.min_path_cells,
            surface_margin_s=0.0,
            handover_s=mission.handover_s,
            lost_after_sorties=3,
            auvs=tuple(
                AuvOrder(
                    name=f'auv_{number}',
                    speed_mps=self.auv_speed_mps,
                    leg=Leg(
                        leg_id=0, path=path, surface_deadline_s=deadline_ticks * mission.tick_s
                    ),
                )
                for number, (path, deadline_ticks) in enumerate(
                    zip(self.paths, self.deadline_ticks, strict=True), 1
                )
            ),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Contact:
    """A meeting, as the UAV says and as it was."""

    auv: str
    time_s: float
    distance_m: float
    is_between_cells: bool
    leg_began_between_cells: bool


@dataclass(slots=True, kw_only=True)
class Sortie:
    """What became of a sortie."""

    departed_s: float
    departed: SortieDeparted
    surveying: list[str]
    """AUVs that are not up for recovery when it begins."""
    returned_s: float = math.inf
    contacts: list[Contact] = field(default_factory=list)
    heard: list[tuple[float, str]] = field(default_factory=list)
    """When reports arrived at the UAV, and whose."""
    missed: list[str] = field(default_factory=list)
    is_broken_off: bool = False

    @property
    def duration_s(self) -> float:
        return self.returned_s - self.departed_s

    @property
    def met(self) -> list[str]:
        return [contact.auv for contact in self.contacts]


class Flight:
    """A mission flown until `SORTIES` sorties are back, or until nothing is left to explore."""

    def __init__(self, case: Case, planner: str) -> None:
        mission = case.mission
        self.mission = mission
        self.track: list[Point] = []
        """Where the UAV was at each tick."""
        self.sorties: list[Sortie] = []
        order = case.order()
        self._auvs = {
            auv.name: Auv(auv.name, mission, auv.leg, fates)
            for auv, fates in zip(order.auvs, case.fates, strict=True)
        }
        self._agent = _uav(mission, planner)
        self.told_to_wait = 0
        """So often an AUV was told only which samples the UAV has, not what comes next."""
        self._tick = 0
        self._air: deque[tuple[str, str, Message]] = deque([('c3', 'uav', order)])
        """Said and not yet heard: by whom, to whom, what."""
        while not self._agent.finished and len(self._sorties_back) < SORTIES:
            assert self._tick < TICKS_MAX, 'the UAV does not come home'
            self._step()
            self._tick += 1
        self.sorties = self._sorties_back  # the next one may have begun in the same tick

    @property
    def _sorties_back(self) -> list[Sortie]:
        return [sortie for sortie in self.sorties if math.isfinite(sortie.returned_s)]

    @property
    def _now_s(self) -> float:
        return self._tick * self.mission.tick_s

    def _step(self) -> None:
        self._take(self._agent.tick(self._now_s))
        up = [auv for auv in self._auvs.values() if auv.is_up(self._tick)]
        # One that is told to dive is still there to say so.
        places = {auv.name: auv.position for auv in up} | {'c3': self.mission.c3}
        self._air += [(auv.name, 'uav', auv.report()) for auv in up if not auv.finished]
        while self._air:
            src, dst, message = self._air.popleft()
            place = places.get(dst if src == 'uav' else src)
            if place is None or self.track[-1].distance_m(place) > self._reach_m:
                continue
            if dst == 'uav':
                self._take(self._agent.receive(src, message, self._now_s))
                if self.sorties and isinstance(message, SurfacingReport):
                    self.sorties[-1].heard.append((self._now_s, src))
            elif dst == 'c3':
                if (reply := _answer_of_c3(message)) is not None:
                    self._air.append(('c3', 'uav', reply))
            elif (answer := self._auvs[dst].receive(message, self._tick)) is not None:
                self._air.append((dst, 'uav', answer))

    @property
    def _reach_m(self) -> float:
        return self.mission.radio_range_m * SLACK

    def _take(self, output: Iterable[Output]) -> None:
        for each in output:
            match each:
                case Transmit(dst, message):
                    self._air.append(('uav', dst, message))
                    self.told_to_wait += isinstance(message, SampleReceipt)
                    self.told_to_wait -= isinstance(message, PathAssignment | RecoveryOrder)
                case Publish(message=Odometry(position=position)):
                    self.track.append(position)
                case Log(event, stamp_s):
                    self._note(event, stamp_s)
                case Refuse():
                    raise AssertionError(each)

    def _note(self, event: Event, stamp_s: float) -> None:
        if isinstance(event, SortieDeparted):
            surveying = [name for name, auv in self._auvs.items() if not auv.finished]
            self.sorties.append(Sortie(departed_s=stamp_s, departed=event, surveying=surveying))
        sortie = self.sorties[-1]
        match event:
            case Met(auv=name):
                auv = self._auvs[name]
                distance_m = self.track[-1].distance_m(auv.position)
                sortie.contacts.append(
                    Contact(
                        auv=name,
                        time_s=stamp_s,
                        distance_m=distance_m,
                        is_between_cells=auv.is_between_cells,
                        leg_began_between_cells=auv.leg_began_between_cells,
                    )
                )
            case Missed(auv=name):
                sortie.missed.append(name)
            case SearchBrokenOff():
                sortie.is_broken_off = True
            case SortieReturned():
                sortie.returned_s = stamp_s


def _answer_of_c3(message: Message) -> Message | None:
    match message:
        case SortieReport(sortie=sortie):
            return Acknowledgement(acknowledges=Acknowledged.SORTIE_REPORT, reference=sortie)
        case SampleBatch(samples=samples):
            spans = (
                SampleSpan(auv=each.auv, first=each.number, until=each.number + 1)
                for each in samples
            )
            return SampleReceipt(held=(), at_c3=tuple(spans))
        case _:
            return None


def _uav(mission: MissionSpec, planner: str) -> UavAgent:
    driver = make_driver(
        UavDriverSetup(
            name='uav', home=mission.c3, speed_mps=mission.uav_speed_mps, altitude_m=30.0
        ),
        NoPorts(),
    )
    setup = UavSetup(
        c3='c3',
        speed_mps=mission.uav_speed_mps,
        altitude_m=30.0,
        tick_s=mission.tick_s,
        arrival_radius_m=0.0,
    )
    options = LITTLE_WORK.get(planner, {})
    store = MemoryStore()
    held = HeldToItsPromise(make_planner(planner, **options))
    custody = SampleCustody(store, frame_bytes=1_048_576, response_s=0.0)
    return UavAgent('uav', setup, held, driver, store, custody)


def _between(start: Point, end: Point, share: float) -> Point:
    if share == 1.0:
        return end
    return Point(
        east_m=start.east_m + share * (end.east_m - start.east_m),
        north_m=start.north_m + share * (end.north_m - start.north_m),
    )


# --- what a planner promises at a meeting --------------------------------------------------------


TRIED_MOST = ('ecc2009', 'robust')
"""Planners on which the theorems are tried most in the fast part; all share the guaranteed set."""

LITTLE_WORK = {'adaptive': {'effort': 'minimal'}}
"""What the theorems say hangs on no planner's diligence."""


class HeldToItsPromise:
    """A planner with a witness: no path of it is flown that it should not have handed over."""

    def __init__(self, planner: Planner) -> None:
        self._planner = planner
        self.guarantees_limit = planner.guarantees_limit

    def plan_path(self, request: PlanRequest) -> PlanResult:
        plan = self._planner.plan_path(request)
        check_path(request, plan.path)
        if self.guarantees_limit:
            check_search(request, plan)
            check_invariant(request, plan)
        return plan

    def plan_sortie(self, request: SortieRequest) -> SortiePlan:
        return self._planner.plan_sortie(request)

    def look_ahead(self, request: SortieRequest) -> Iterator[LookAhead]:
        return self._planner.look_ahead(request)


def check_path(request: PlanRequest, path: tuple[Cell, ...]) -> None:
    """It begins where the AUV is, and goes on by as many moves to neighbours as are allowed."""
    mission = request.mission
    assert path[0] == request.cell
    assert mission.min_path_cells <= len(path) - 1 <= mission.path_cells
    for cell, following in itertools.pairwise(path):
        assert following in mission.grid.neighbours(cell)


def check_search(request: PlanRequest, plan: PlanResult) -> None:
    """All between two cells of the track is heard from some one waypoint."""
    reach_m = request.mission.radio_range_m * SLACK
    track = track_of(plan.path, request.behind)
    centres = [request.mission.grid.centre(cell) for cell in track]
    for edge in itertools.pairwise(centres):
        assert any(all(point.distance_m(end) <= reach_m for end in edge) for point in plan.search)


def check_invariant(request: PlanRequest, plan: PlanResult) -> None:
    """
    (I) of ``docs/guarantee.md`` holds after the meeting: choice by choice, as it is written.

    Nobody is astray on these flights, so that there is no other way out.
    """
    mission = request.mission
    choices = []
    for leg in request.legs:
        if leg.auv == request.auv:
            searches = [plan.search]
        elif leg.prospect is Prospect.ENDS:
            searches = [(point,) for point in leg.search]
        else:
            assert leg.prospect is Prospect.STAYS
            searches = [leg.search]
        choices.append([leg_waypoints(leg, search) for search in searches])
    for chosen in itertools.product(*choices):
        route = tuple(itertools.chain.from_iterable(chosen))
        assert round_ticks(mission, route) <= mission.limit_ticks


# --- missions and what the sea does --------------------------------------------------------------


def numbers(least: float, most: float) -> st.SearchStrategy[float]:
    """Return whole numbers as often as others, where some are in range."""
    thousandths = st.integers(math.ceil(least * 1000), math.floor(most * 1000))
    whole = st.integers(math.ceil(least), math.floor(most))
    return st.one_of(whole.map(float), thousandths.map(lambda number: number / 1000))


@st.composite
def missions(draw: st.DrawFn, range_in_cells: float) -> MissionSpec:
    """Return missions of all sizes, with a radio range of so many cells at least; L is to come."""
    cols = draw(st.integers(1, 7))
    rows = draw(st.integers(2 if cols == 1 else 1, 7))
    cell_m = draw(numbers(1, 50))
    tick_s = draw(numbers(0.1, 5))
    path_cells = draw(st.integers(1, 3))
    radio_range_in_cells = draw(st.one_of(st.just(range_in_cells), numbers(range_in_cells, 3)))
    return MissionSpec(
        grid=GridSpec(cols=cols, rows=rows, cell_m=cell_m),
        c3=Point(east_m=draw(numbers(-3, 9)) * cell_m, north_m=draw(numbers(-3, 9)) * cell_m),
        radio_range_m=radio_range_in_cells * cell_m,
        uav_speed_mps=draw(numbers(0.2, 4)) * cell_m / tick_s,
        tick_s=tick_s,
        sortie_limit_s=1e6,
        path_cells=path_cells,
        min_path_cells=draw(st.integers(1, path_cells)),
        handover_s=draw(st.sampled_from([0.0, 0.0, 0.4, 1.0, 3.0])) * tick_s,
    )


@st.composite
def cases(
    draw: st.DrawFn,
    mission: MissionSpec,
    along: st.SearchStrategy[float],
    longer_deaf_ticks: int = 0,
    samples: int = 1,
) -> Case:
    """
    Return what can be on a mission.

    AUVs may be deaf so much longer than `handover_s`, and take up to so many samples on a leg.
    """
    kept_free_ticks = math.ceil(mission.handover_s / mission.tick_s - EPSILON_S)
    fates = st.builds(
        Fate,
        hop=st.integers(0, 999).map(lambda number: number / 1000),
        along=along,
        when=numbers(0, 1),
        deaf_ticks=st.integers(0, kept_free_ticks + longer_deaf_ticks),
        samples=st.integers(0, samples),
    )
    paths = draw(st.lists(walks(mission.grid), min_size=1, max_size=4))
    return Case(
        mission=replace(mission, grid=draw(with_land(mission.grid, paths))),
        paths=tuple(paths),
        deadline_ticks=tuple(draw(st.integers(0, 40)) for _ in paths),
        auv_speed_mps=mission.grid.cell_m / (mission.tick_s * draw(numbers(0.7, 6))),
        fates=tuple(tuple(draw(st.lists(fates, min_size=1, max_size=SORTIES + 1))) for _ in paths),
    )


@st.composite
def with_land(draw: st.DrawFn, grid: GridSpec, paths: list[tuple[Cell, ...]]) -> GridSpec:
    """Return a grid with land where no path is, and wherever no AUV could ever come."""
    free = sorted(set(grid.cells).difference(*paths))
    land = draw(st.sets(st.sampled_from(free), max_size=len(free) // 2)) if free else set()
    sea = msgspec.structs.replace(grid, masked=tuple(sorted(land)))
    cut_off = unreachable_cells(sea, [path[0] for path in paths])
    return msgspec.structs.replace(sea, masked=(*sea.masked, *cut_off))


@st.composite
def guaranteed_cases(draw: st.DrawFn, longer_deaf_ticks: int = 0, samples: int = 1) -> Case:
    """Return missions that a guarantee takes, L its least up to twice that; AUVs anywhere."""
    case = draw(cases(draw(missions(1.0)), numbers(0, 1), longer_deaf_ticks, samples))
    least_s = least_limit_s(case.mission, legs_of(case.paths))
    limit_s = max(case.mission.tick_s, draw(numbers(1, 2)) * least_s)
    return replace(case, mission=replace(case.mission, sortie_limit_s=limit_s))


@st.composite
def paper_cases(draw: st.DrawFn) -> Case:
    """Return missions of the paper: any L, a radio that may not reach across a cell, no halves."""
    case = draw(cases(draw(missions(0.3)), st.sampled_from([0.0, 1.0])))
    limit_s = draw(st.integers(1, 100)) * case.mission.tick_s
    return replace(case, mission=replace(case.mission, sortie_limit_s=limit_s))


@st.composite
def walks(draw: st.DrawFn, grid: GridSpec) -> tuple[Cell, ...]:
    path = [draw(st.tuples(st.integers(0, grid.cols - 1), st.integers(0, grid.rows - 1)))]
    for _ in range(draw(st.integers(1, 4))):
        path.append(draw(st.sampled_from(grid.neighbours(path[-1]))))
    return tuple(path)


# --- what is claimed -----------------------------------------------------------------------------


def check_track(flight: Flight) -> None:
    """Hold what the UAV says of its sorties against where it was."""
    mission = flight.mission
    away = {tick for tick, at in enumerate(flight.track) if at != mission.c3}
    for sortie in flight.sorties:
        first = round(sortie.departed_s / mission.tick_s)
        last = round(sortie.returned_s / mission.tick_s)
        assert flight.track[first] == flight.track[last] == mission.c3
        away -= set(range(first, last))
        for contact in sortie.contacts:
            assert contact.distance_m <= mission.radio_range_m * SLACK
            assert sortie.departed_s <= contact.time_s <= sortie.returned_s
    assert not away, 'away from C3 without a sortie'
    # A hop ends at its target within a billionth of its length, which may be many steps.
    longest_hop_m = 2.0 * max(at.distance_m(mission.c3) for at in flight.track)
    step_m = mission.step_m + longest_hop_m * (SLACK - 1.0)
    for before, after in itertools.pairwise(flight.track):
        assert before.distance_m(after) <= step_m * SLACK


def check_everybody_is_met(flight: Flight) -> None:
    """Theorem 1."""
    for sortie in flight.sorties:
        assert sorted(sortie.met) == sorted(sortie.departed.order)
        assert sortie.missed == []
        assert not sortie.is_broken_off


def check_worst_case(flight: Flight) -> None:
    """Theorem 2."""
    for sortie in flight.sorties:
        assert sortie.duration_s <= sortie.departed.worst_case_s + EPSILON_S


# --- what happens on the flights -----------------------------------------------------------------


def is_met_out_of_turn(flight: Flight) -> bool:
    return any(sortie.met != list(sortie.departed.order) for sortie in flight.sorties)


def is_met_between_cells(flight: Flight) -> bool:
    return any(each.is_between_cells for each in contacts_of(flight))


def is_met_before_it_reached_its_first_cell(flight: Flight) -> bool:
    return any(
        each.is_between_cells and each.leg_began_between_cells for each in contacts_of(flight)
    )


def begins_with_a_contact_at_c3(flight: Flight) -> bool:
    return any(
        sortie.contacts[0].time_s == sortie.departed_s and sortie.duration_s > 0.0
        for sortie in flight.sorties
    )


def waits_for_a_deadline(flight: Flight) -> bool:
    """It stands still away from C3, and not for an answer: those come within the tick."""
    return flight.mission.handover_s == 0.0 and any(
        before == after != flight.mission.c3 for before, after in itertools.pairwise(flight.track)
    )


def takes_the_worst_case_and_all_of_the_limit(flight: Flight) -> bool:
    limit_s = flight.mission.sortie_limit_s
    return any(sortie.duration_s > limit_s - EPSILON_S for sortie in flight.sorties)


def hears_one_before_it_is_met(flight: Flight) -> bool:
    return any(
        contact.auv == name and time_s < contact.time_s
        for sortie in flight.sorties
        for contact in sortie.contacts
        for time_s, name in sortie.heard
    )


def contacts_of(flight: Flight) -> list[Contact]:
    return [contact for sortie in flight.sorties for contact in sortie.contacts]


# --- the theorems on flights ---------------------------------------------------------------------

looked_for_long = settings(phases=[Phase.generate], max_examples=5000)
"""The rarest event is in 2 of 100 cases: it is never missed, whatever the examples drawn first."""


def holds_for(
    some: st.SearchStrategy[Case],
    *,
    guarantees_limit: bool,
    few: int,
    many: int,
    covering: Iterable[Callable[[Flight], bool]] = (),
) -> Callable[[Callable[[Case, str], Flight]], Callable[[str, int], None]]:
    """
    Make a test of a property that says how a case was flown by a planner, for all of a kind.

    In the fast part a few cases, in the slow part many. All that the
    theorems speak of must have happened: what did not by chance is looked for on further cases.
    """
    planners = [
        name for name in PLANNERS if make_planner(name).guarantees_limit is guarantees_limit
    ]

    def decorate(holds: Callable[[Case, str], Flight]) -> Callable[[str, int], None]:
        @pytest.mark.parametrize(
            ('planner', 'examples'),
            [(name, few if name in TRIED_MOST else few // 4) for name in planners]
            + [pytest.param(name, many, marks=pytest.mark.slow) for name in planners],
        )
        def test(planner: str, examples: int) -> None:
            unseen = set(covering)

            @settings(max_examples=examples)
            @given(case=some)
            def fly(case: Case) -> None:
                flight = holds(case, planner)
                unseen.difference_update([happens for happens in unseen if happens(flight)])

            fly()
            for happens in unseen:

                def is_seen(case: Case, happens: Callable[[Flight], bool] = happens) -> bool:
                    return happens(holds(case, planner))

                find(some, is_seen, settings=looked_for_long)

        test.__doc__ = holds.__doc__
        return test

    return decorate


@holds_for(
    guaranteed_cases(),
    guarantees_limit=True,
    few=80,
    many=160,
    covering=[
        is_met_out_of_turn,
        is_met_between_cells,
        is_met_before_it_reached_its_first_cell,
        begins_with_a_contact_at_c3,
        waits_for_a_deadline,
        takes_the_worst_case_and_all_of_the_limit,
    ],
)
def test_everybody_is_met_within_the_worst_case_and_this_is_within_the_limit(
    case: Case, planner: str
) -> Flight:
    flight = Flight(case, planner)
    check_track(flight)
    check_everybody_is_met(flight)
    check_worst_case(flight)
    for sortie in flight.sorties:
        assert list(sortie.departed.order) == sortie.surveying
        assert sortie.departed.worst_case_s <= case.mission.sortie_limit_s + EPSILON_S
    return flight


def test_a_hop_that_only_rounding_makes_takes_no_tick() -> None:
    """Two AUVs are searched from one place, whose coordinates differ in the last bit."""
    at_once = Fate(hop=0.0, along=0.0, when=0.0, deaf_ticks=0, samples=0)
    further_on = replace(at_once, along=1.0)
    case = Case(
        mission=MissionSpec(
            grid=GridSpec(cols=4, rows=2, cell_m=1.743),
            c3=Point(east_m=0.0, north_m=0.0),
            radio_range_m=1.743,
            uav_speed_mps=3.486,
            tick_s=1.0,
            sortie_limit_s=4.0,
            path_cells=2,
            min_path_cells=1,
        ),
        paths=(((0, 0), (0, 1)), ((2, 1), (3, 1)), ((0, 0), (1, 0))),
        deadline_ticks=(0, 0, 0),
        auv_speed_mps=1.743,
        fates=((further_on,), (at_once,), (at_once, further_on)),
    )
    flight = Flight(case, 'robust')
    check_everybody_is_met(flight)
    check_worst_case(flight)


def hands_data_over_for_ticks(flight: Flight) -> bool:
    return flight.told_to_wait > 1


@holds_for(
    guaranteed_cases(longer_deaf_ticks=8, samples=8),
    guarantees_limit=True,
    few=40,
    many=80,
    covering=[hands_data_over_for_ticks],
)
def test_the_limit_is_kept_where_hand_overs_take_longer_than_planned(
    case: Case, planner: str
) -> Flight:
    flight = Flight(case, planner)
    check_track(flight)
    check_everybody_is_met(flight)
    for sortie in flight.sorties:
        assert sortie.duration_s <= case.mission.sortie_limit_s + EPSILON_S
    return flight


@holds_for(
    paper_cases(),
    guarantees_limit=False,
    few=60,
    many=160,
    covering=[begins_with_a_contact_at_c3, waits_for_a_deadline, hears_one_before_it_is_met],
)
def test_without_a_guarantee_everybody_is_met_in_turn_within_the_worst_case(
    case: Case, planner: str
) -> Flight:
    """The paper's AUVs surface at the centres of cells; about L it promises nothing that holds."""
    flight = Flight(case, planner)
    check_track(flight)
    check_everybody_is_met(flight)
    check_worst_case(flight)
    for sortie in flight.sorties:
        assert sortie.met == list(sortie.departed.order) == sortie.surveying
    return flight


# --- Theorem 2 without vehicles: a list of waypoints ---------------------------------------------

HOME = Point(east_m=0.0, north_m=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Errand:
    """An AUV on a route, and when it is heard."""

    auv: str
    search: tuple[Point, ...]
    deadline_tick: int
    heard_tick: int | None
    """After the departure, wherever the UAV then is; None for at its last waypoint only."""


@st.composite
def errands(draw: st.DrawFn) -> tuple[Errand, ...]:
    """Return errands with waypoints in whole metres: lengths are whole ticks or far from it."""
    metres = st.integers(-12, 12).map(float)
    points = st.builds(Point, east_m=metres, north_m=metres)
    return tuple(
        Errand(
            auv=f'auv_{number}',
            search=tuple(draw(st.lists(points, min_size=1, max_size=4))),
            deadline_tick=draw(st.integers(0, 60)),
            heard_tick=draw(st.none() | st.integers(0, 90)),
        )
        for number in range(draw(st.integers(1, 4)))
    )


@given(
    errands=errands(),
    step_m=st.sampled_from([1.0, 1.5, 2.0, 4.0, 5.0, 7.0, 30.0]),
    tick_s=st.sampled_from([0.1, 0.3, 1.0, 2.5]),
    handover_ticks=st.integers(0, 3),
    depart_tick=st.integers(0, 30),
    left_out=st.sets(st.integers(0, 15)),
)
def test_whatever_is_skipped_a_list_of_waypoints_takes_no_longer(
    errands: tuple[Errand, ...],
    step_m: float,
    tick_s: float,
    handover_ticks: int,
    depart_tick: int,
    left_out: set[int],
) -> None:
    """And where everybody is heard at the last possible moment it takes exactly its worst case."""
    mission = MissionSpec(
        grid=GridSpec(cols=2, rows=1, cell_m=1.0),
        c3=HOME,
        radio_range_m=1.0,
        uav_speed_mps=step_m / tick_s,
        tick_s=tick_s,
        sortie_limit_s=1e6,
        path_cells=1,
        min_path_cells=1,
        handover_s=handover_ticks * tick_s,
    )
    route = tuple(
        Waypoint(point=point, auv=errand.auv, surface_deadline_s=errand.deadline_tick * tick_s)
        for errand in errands
        for point in errand.search
    )
    worst_ticks = ticks(mission, route, depart_tick)
    latest = tuple(replace(errand, heard_tick=None) for errand in errands)
    assert ticks_flown(latest, step_m, handover_ticks, depart_tick) == worst_ticks
    assert ticks_flown(errands, step_m, handover_ticks, depart_tick) <= worst_ticks
    rest = tuple(each for number, each in enumerate(route) if number not in left_out)
    assert ticks(mission, rest, depart_tick) <= worst_ticks


def ticks(mission: MissionSpec, route: Route, depart_tick: int) -> int:
    return round(worst_case_s(mission, route, depart_tick * mission.tick_s) / mission.tick_s)


def ticks_flown(
    errands: tuple[Errand, ...], step_m: float, handover_ticks: int, depart_tick: int
) -> int:
    """Fly a list of waypoints tick by tick, as the method's text says, and count."""
    waiting = {errand.auv: errand for errand in errands}
    ahead = [
        (errand.auv, complex(p.east_m, p.north_m)) for errand in errands for p in errand.search
    ]
    at, tick, stay_ticks = 0j, 0, 0

    def met(auv: str) -> None:
        nonlocal ahead, stay_ticks
        del waiting[auv]
        ahead = [each for each in ahead if each[0] != auv]
        stay_ticks += handover_ticks

    while True:
        for errand in list(waiting.values()):
            if errand.heard_tick == tick:
                met(errand.auv)
        while ahead and stay_ticks == 0 and ahead[0][1] == at:
            auv = ahead[0][0]
            if depart_tick + tick < waiting[auv].deadline_tick:
                break
            del ahead[0]
            if all(other != auv for other, _ in ahead):
                met(auv)
        if stay_ticks > 0:
            stay_ticks -= 1
        elif not ahead and at == 0j:
            return tick
        else:
            target = ahead[0][1] if ahead else 0j
            left_m = abs(target - at)
            is_there = left_m < step_m * (1 + 1e-7)
            at = target if is_there else at + (target - at) / left_m * step_m
        tick += 1
