"""The UAV: flies sorties, meets AUVs, relays their data and hands over their next paths."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import msgspec

from msgs_json.agent import Log, Output, Publish, Refuse, Transmit
from msgs_json.codec import Refusal
from msgs_json.geometry import Point, is_before, whole_ticks, within_range
from msgs_json.messages import (
    Acknowledged,
    Acknowledgement,
    Directive,
    DirectiveRefused,
    DirectiveTaken,
    ExpectedContact,
    GivenUp,
    HeardAgain,
    Meeting,
    Message,
    Met,
    Missed,
    MissionOrder,
    PlanningAhead,
    RecoveryReason,
    SampleBatch,
    SampleReceipt,
    SearchBrokenOff,
    SortieDeparted,
    SortieOutlook,
    SortieReport,
    SortieReturned,
    SurfacingReport,
)
from msgs_json.ros_messages import TrackPath
from msgs_json.topics import ODOM, ROUTE
from uav_planner.directives import (
    problem_with_guarantee,
    problem_with_limit,
    problem_with_region,
)
from uav_planner.fleet import Fleet
from uav_planner.hand_over import HandOver
from uav_planner.headway import Headway
from uav_planner.mission_order import UavSetup, mission_spec, problem_with_order
from uav_planner.planning import MissionSpec, Planner, Prospect, SortiePlan
from uav_planner.sample_intake import SampleIntake
from uav_planner.sortie import Route, hop_ticks, search_times_s, worst_case_s

if TYPE_CHECKING:
    from collections.abc import Iterator

    from msgs_json.custody import SampleCustody
    from msgs_json.drivers import UavDriver
    from msgs_json.store import Store

_ORDER, _DIRECTIVE, _FLIGHT = 'order', 'directive', 'flight'
_ANSWERED, _REPORT, _TICK = 'answered', 'report', 'tick'
"""Kinds of entries of the store, beside the samples."""


@dataclass(slots=True, kw_only=True)
class _Sortie:
    """A sortie, from its planning at C3 to the return."""

    fleet: Fleet
    number: int
    plan: SortiePlan
    order: tuple[str, ...]
    """The AUVs that it goes to."""
    overlooked: frozenset[str]
    """AUVs that the one before did not reach."""
    ready_s: float
    """When it may leave as far as the one before is concerned."""
    departed_s: float | None = None
    cursor: int = 0
    """Index of the waypoint flown to; past the last one it is C3."""
    listens_from_s: float | None = None
    """Since when it listens at the last waypoint of an AUV; None elsewhere."""
    met: dict[str, tuple[float, SurfacingReport]] = field(default_factory=dict)
    """AUVs met: when, and what they reported."""
    missed: set[str] = field(default_factory=set)
    """AUVs searched to the end and not heard."""
    not_reached: tuple[str, ...] = ()
    """AUVs that it gave up reaching, to be home in time."""

    def memory(self) -> _SortieMemory:
        """Return what to go on from after a crash."""
        return _SortieMemory(
            number=self.number,
            route=self.plan.route,
            depart_s=self.plan.depart_s,
            predicted_s=self.plan.predicted_s,
            worst_case_s=self.plan.worst_case_s,
            order=self.order,
            overlooked=tuple(self.overlooked),
            ready_s=self.ready_s,
            departed_s=self.departed_s,
            cursor=self.cursor,
            listens_from_s=self.listens_from_s,
            met={
                auv: (met_s, msgspec.structs.replace(report, samples=()))
                for auv, (met_s, report) in self.met.items()
            },
            missed=tuple(self.missed),
            not_reached=self.not_reached,
        )

    @property
    def mission(self) -> MissionSpec:
        """Return what stays the same for all sorties."""
        return self.fleet.mission

    @property
    def back_by_s(self) -> float:
        """Return when it has to be back at C3 to keep L; infinite before it has departed."""
        if self.departed_s is None:
            return math.inf
        return self.departed_s + self.mission.sortie_limit_s

    @property
    def goes_home(self) -> bool:
        """Return whether nothing of the route is left but the way home."""
        return self.cursor == len(self.plan.route)

    @property
    def rest(self) -> Route:
        """Return what is left of the route, without the AUVs that were met."""
        return tuple(each for each in self.plan.route[self.cursor :] if each.auv not in self.met)

    @property
    def turn(self) -> str | None:
        """Return the AUV to be met next; None when only the way home is left."""
        for auv in self.order:
            if auv not in self.met and auv not in self.missed:
                return auv
        return None

    @property
    def to_meet(self) -> frozenset[str]:
        """Return the AUVs that may still be met, as far as the sortie is concerned."""
        return frozenset(self.order) - self.met.keys() - frozenset(self.not_reached)


class _SortieMemory(msgspec.Struct, frozen=True, kw_only=True):
    """A `_Sortie` as it is stored."""

    number: int
    route: Route
    depart_s: float
    predicted_s: float
    worst_case_s: float
    order: tuple[str, ...]
    overlooked: tuple[str, ...]
    ready_s: float
    departed_s: float | None
    cursor: int
    listens_from_s: float | None
    met: dict[str, tuple[float, SurfacingReport]]
    missed: tuple[str, ...]
    not_reached: tuple[str, ...]

    def sortie(self, fleet: Fleet) -> _Sortie:
        """Return the sortie, to be gone on with."""
        return _Sortie(
            fleet=fleet,
            number=self.number,
            plan=SortiePlan(
                route=self.route,
                depart_s=self.depart_s,
                predicted_s=self.predicted_s,
                worst_case_s=self.worst_case_s,
            ),
            order=self.order,
            overlooked=frozenset(self.overlooked),
            ready_s=self.ready_s,
            departed_s=self.departed_s,
            cursor=self.cursor,
            listens_from_s=self.listens_from_s,
            met=dict(self.met),
            missed=set(self.missed),
            not_reached=self.not_reached,
        )


class _Taken(msgspec.Struct, frozen=True, kw_only=True):
    """A directive by which the UAV flies, and why it is not all that the operator wanted."""

    directive: Directive
    problem: str | None


class _Answered(msgspec.Struct, frozen=True, kw_only=True):
    """That an AUV was answered: within a tick more than that is said only of what is new."""

    at_s: float
    says_next: bool
    """Whether it was told what comes next."""
    is_owed: bool = False
    """Whether more of its data has come since."""


class _FlightMemory(msgspec.Struct, frozen=True, kw_only=True):
    """What the UAV must still know of its flight after its process died."""

    sortie: _SortieMemory | None
    heard: dict[str, tuple[float, SurfacingReport]]
    is_called_home: bool
    plans_ahead_from_s: float | None
    finished: bool
    known_difference_m: float
    difference_m: float


class UavAgent:
    """
    Sans-I/O behaviour of the UAV; its vehicle is behind ``driver``.

    What it finds in ``store`` is of a process that died: it goes on from there, wherever it is.
    """

    def __init__(
        self,
        name: str,
        setup: UavSetup,
        planner: Planner,
        driver: UavDriver,
        store: Store,
        custody: SampleCustody,
    ) -> None:
        self.name = name
        self.peers = frozenset({setup.c3})
        self.finished = False
        self.is_busy = False
        self._setup = setup
        self._planner = planner
        self._driver = driver
        self._store = store
        self._custody = custody
        self._intake = SampleIntake(store, custody)
        self._now_s = 0.0
        self._position: Point | None = None
        self._fleet: Fleet | None = None
        """None before the order."""
        self._taken: _Taken | None = None
        """What the operator wants beside the order, if anything."""
        self._is_called_home = False
        """Whether an abort was heard in the air, where no directive is taken."""
        self._sortie: _Sortie | None = None
        """The one being flown, or waiting at C3 for its departure."""
        self._look_ahead: Iterator[float] = iter(())
        """Plans the whole mission before the first one."""
        self._plans_ahead_from_s: float | None = None
        """When it got the order for that; None once it is done, or there is no time for it."""
        self._headway = Headway(setup.speed_mps * setup.tick_s)
        self._untold: list[Output] = []
        """
        What was decided and not said: the vehicle may fail between the two.

        It need not outlive the process: the next input stores what was decided, and tells it.
        """
        self._heard: dict[str, tuple[float, SurfacingReport]] = {}
        """When AUVs were heard last whose turn it was not, and what they said."""
        self._answered: dict[str, _Answered] = {}
        self._undelivered: deque[SortieReport] = deque()
        """Reports that C3 has not acknowledged, oldest first; it gets them one by one."""
        self._is_changed = False
        """Whether its flight is another than the store knows."""
        self._recall()

    def tick(self, now_s: float) -> list[Output]:
        """Decide on what was heard until the tick before, fly to ``now_s``, report at C3."""
        output = self._tick(now_s)
        self._remember()
        return output

    def receive(self, src: str, message: Message, now_s: float) -> list[Output]:
        """Take an order, a report or samples of an AUV, an acknowledgement or a receipt."""
        self._look(now_s)
        # What is decided is stored with this input, so this input must tell it.
        output = [*self._tell(), *self._receive(src, message)]
        self._remember()
        return output

    def work(self, now_s: float) -> list[Output]:
        """Plan the whole mission ahead, one slice further; that ends with the first departure."""
        output = self._work(now_s)
        if not self.is_busy:
            self._remember()  # not after each slice: another process would begin anew
        return output

    # --- what outlives the process ---------------------------------------------------------------

    def _remember(self) -> None:
        """Store what has changed."""
        fleet = self._fleet
        if fleet is not None:
            fleet.save(self._store)
        if self._is_changed:
            self._is_changed = False
            flight = _FlightMemory(
                sortie=self._sortie.memory() if self._sortie is not None else None,
                heard=self._heard,
                is_called_home=self._is_called_home,
                plans_ahead_from_s=self._plans_ahead_from_s,
                finished=self.finished,
                known_difference_m=self._headway.known_m,
                difference_m=self._headway.difference_m,
            )
            self._store.put(_FLIGHT, '', flight)
        if self._store.is_changed:
            self._store.put(_TICK, '', self._now_s)

    def _recall(self) -> None:
        """Go on where a process before this one left off."""
        order = self._store.load(_ORDER, MissionOrder).get('')
        if order is None:
            return
        setup = self._setup
        self._fleet = Fleet(order, mission_spec(order, setup), self._planner)
        self._taken = self._store.load(_DIRECTIVE, _Taken).get('')
        if self._taken is not None:
            self._fleet.direct(self._taken.directive)
        self._fleet.load(self._store)
        flight = self._store.load(_FLIGHT, _FlightMemory)['']
        self._sortie = flight.sortie.sortie(self._fleet) if flight.sortie is not None else None
        self._headway = Headway(
            setup.speed_mps * setup.tick_s, flight.known_difference_m, flight.difference_m
        )
        self.finished = flight.finished
        reports = self._store.load(_REPORT, SortieReport).values()
        self._undelivered = deque(sorted(reports, key=lambda report: report.sortie))
        self.peers = frozenset({setup.c3, *self._fleet.names})
        self._heard = flight.heard
        self._answered = self._store.load(_ANSWERED, _Answered)
        self._is_called_home = flight.is_called_home
        self._now_s = self._store.load(_TICK, float)['']
        if flight.plans_ahead_from_s is not None:
            self._plan_ahead(self._fleet, flight.plans_ahead_from_s)

    def _look(self, at_s: float) -> None:
        """Learn where the vehicle is, if a process before this one has sent it somewhere."""
        if self._position is None and self._fleet is not None:
            self._now_s, self._position = at_s, self._driver.step(at_s).position

    # --- a tick ----------------------------------------------------------------------------------

    def _tick(self, now_s: float) -> list[Output]:
        # The process before this one may have lived to see this tick, and heard of what it is to
        # decide on at the next one only.
        is_seen = self._now_s >= now_s
        self._look(now_s if is_seen else now_s - self._setup.tick_s)
        target = None
        if not is_seen:
            self._untold += self._decide()
            target = self._steer()
        state = self._driver.step(now_s)
        is_next_tick = now_s - self._now_s < 1.5 * self._setup.tick_s
        if target is not None and self._position is not None and is_next_tick:
            self._is_changed |= self._headway.note(self._position, state.position, target)
        self._now_s, self._position = now_s, state.position
        output = self._tell()
        if not is_seen:
            output += self._answer_owed()
        output.append(Publish(ODOM, state.odometry(self.name, now_s)))
        if self._sortie is not None:
            output += self._return_to_c3(self._sortie, state.position)
        output += self._report_to_c3()
        return output

    def _receive(self, src: str, message: Message) -> list[Output]:
        fleet = self._fleet
        match message:
            case MissionOrder() if src == self._setup.c3:
                return self._ordered(message)
            case SurfacingReport() if fleet is not None and src == message.auv in fleet.names:
                return self._hear(fleet, message)
            case SampleBatch() if fleet is not None and src in fleet.names:
                return self._take_samples(fleet, src, message)
            case Directive() if fleet is not None and src == self._setup.c3:
                return self._directed(message, fleet)
            case SampleReceipt() if src == self._setup.c3:
                return self._relieved(message)
            case Acknowledgement():
                return self._acknowledged(src, message)
            case _:
                detail = f'the UAV takes no {type(message).__name__} from {src}'
                return [Refuse(src, Refusal.UNEXPECTED, detail)]

    def _work(self, now_s: float) -> list[Output]:
        share = next(self._look_ahead, None)
        self.is_busy = share is not None
        if share is None:
            self._plans_ahead_from_s, self._is_changed = None, True
            return []
        sortie = self._sortie
        if sortie is not None and sortie.order != sortie.fleet.visiting_order:
            self._plan_anew(sortie)
        return [Log(PlanningAhead(share=round(share, 2)), now_s)]

    # --- the order -------------------------------------------------------------------------------

    def _ordered(self, order: MissionOrder) -> list[Output]:
        acknowledgement = Transmit(
            self._setup.c3, Acknowledgement(acknowledges=Acknowledged.MISSION_ORDER, reference=0)
        )
        if self._fleet is not None:
            return [acknowledgement]  # repeated by C3: it missed our answer
        problem = problem_with_order(order, self._setup)
        if problem:
            return [Refuse(self._setup.c3, Refusal.CONTRADICTORY, problem)]
        fleet = Fleet(order, mission_spec(order, self._setup), self._planner)
        try:
            self._sortie = self._plan_sortie(fleet, 1, frozenset(), self._now_s)
        except ValueError as error:
            return [Refuse(self._setup.c3, Refusal.NOT_POSSIBLE, str(error))]
        self._fleet, self._is_changed = fleet, True
        self._store.put(_ORDER, '', order)
        self._plan_ahead(fleet, self._now_s)
        self.peers = frozenset({self._setup.c3, *fleet.names})
        return [acknowledgement]

    def _plan_ahead(self, fleet: Fleet, from_s: float) -> None:
        """Begin to plan the whole mission."""
        self._look_ahead, self.is_busy = fleet.look_ahead(from_s), True
        self._plans_ahead_from_s = from_s

    # --- what the operator wants -----------------------------------------------------------------

    @property
    def _may_depart(self) -> bool:
        if self._taken is None:
            return not self._is_called_home
        wanted = self._taken.directive
        return not (wanted.paused or wanted.aborted or self._is_called_home)

    def _directed(self, directive: Directive, fleet: Fleet) -> list[Output]:
        """Fly by a directive from now on; C3 repeats it until it is told what became of it."""
        sortie, taken = self._sortie, self._taken
        if taken is not None and directive.revision <= taken.directive.revision:
            is_late = directive.revision < taken.directive.revision
            return [] if is_late else [self._answer_to_directive(taken)]
        if sortie is not None and sortie.departed_s is not None:
            return self._call_home(sortie) if directive.aborted else []
        self._taken = taken = self._flyable(directive, fleet)
        self._is_called_home, self._is_changed = False, True
        fleet.direct(taken.directive)
        self._store.put(_DIRECTIVE, '', taken)
        if sortie is not None:
            self._plan_anew(sortie)
        if self._plans_ahead_from_s is not None:
            self._plan_ahead(fleet, self._now_s)
        logged = Log(DirectiveTaken(directive=taken.directive), self._now_s)
        return [self._answer_to_directive(taken), logged]

    def _call_home(self, sortie: _Sortie) -> list[Output]:
        """Take an abort in the air; all else that a directive says has time until the landing."""
        if self._is_called_home:
            return []
        self._is_called_home, self._is_changed = True, True
        return [] if sortie.goes_home else self._turn_home(sortie)

    def _answer_to_directive(self, taken: _Taken) -> Transmit:
        directive = taken.directive
        if taken.problem is None:
            answer: Message = Acknowledgement(
                acknowledges=Acknowledged.DIRECTIVE, reference=directive.revision
            )
        else:
            answer = DirectiveRefused(
                revision=directive.revision,
                problem=taken.problem,
                sortie_limit_s=directive.sortie_limit_s,
                masked=directive.masked,
            )
        return Transmit(self._setup.c3, answer)

    def _flyable(self, directive: Directive, fleet: Fleet) -> _Taken:
        """Return a directive with the limit and the region as they are, if they must stay so."""
        mission = fleet.mission
        surveyors = {leg.auv for leg in fleet.survey_legs()} - {*directive.recalled}
        problems = []
        if directive.sortie_limit_s != mission.sortie_limit_s:
            problem = self._problem_with_limit(directive.sortie_limit_s, fleet)
            if problem:
                problems.append(f'{problem}; it stays {mission.sortie_limit_s:g}')
                directive = msgspec.structs.replace(
                    directive, sortie_limit_s=mission.sortie_limit_s
                )
        if directive.masked != mission.grid.masked:
            problem = problem_with_region(
                directive.masked, fleet.ordered_region, fleet.legs_out, surveyors
            )
            if problem is None and self._sortie is not None:
                problem = fleet.planner_problem(directive.masked, self._now_s)
            if problem:
                problems.append(f'{problem}; the region stays as it is')
                directive = msgspec.structs.replace(directive, masked=mission.grid.masked)
        return _Taken(directive=directive, problem='. '.join(problems) or None)

    def _problem_with_limit(self, limit_s: float, fleet: Fleet) -> str | None:
        problem = problem_with_limit(limit_s, fleet.mission)
        if problem or self._sortie is None or not self._planner.guarantees_limit:
            return problem
        route = self._sortie.plan.route
        return problem_with_guarantee(limit_s, fleet.mission, route, fleet.legs_out)

    # --- the sortie ------------------------------------------------------------------------------

    def _next_sortie(self, before: _Sortie, overlooked: frozenset[str]) -> _Sortie | None:
        """Return the sortie after one that is over; None where nobody is left to be met."""
        fleet, ready_s = before.fleet, self._now_s
        legs = fleet.survey_legs()
        if not legs:
            return None
        if all(leg.prospect is Prospect.ASTRAY for leg in legs):
            # To search them again at once would tell nothing new, and soon give them up.
            ready_s = max(ready_s, before.back_by_s)
        return self._plan_sortie(fleet, before.number + 1, overlooked, ready_s)

    def _plan_anew(self, sortie: _Sortie) -> None:
        """Plan a sortie again that has not departed."""
        self._is_changed = True
        self._sortie = self._plan_sortie(
            sortie.fleet, sortie.number, sortie.overlooked, sortie.ready_s
        )

    def _plan_sortie(
        self, fleet: Fleet, number: int, overlooked: frozenset[str], ready_s: float
    ) -> _Sortie:
        plan = fleet.plan_sortie(overlooked, max(ready_s, self._now_s))
        return _Sortie(
            fleet=fleet,
            number=number,
            plan=plan,
            order=tuple(dict.fromkeys(waypoint.auv for waypoint in plan.route)),
            overlooked=overlooked,
            ready_s=ready_s,
        )

    def _decide(self) -> list[Output]:
        """Leave C3 when it is time; turn to the next waypoint when this one is done with."""
        sortie, position = self._sortie, self._position
        if sortie is None or position is None:
            return []
        output: list[Output] = []
        if sortie.departed_s is None:
            if is_before(self._now_s, sortie.plan.depart_s) or not self._may_depart:
                return []
            output += self._depart(sortie)
        output += self._advance(sortie, position)
        if self._must_turn_home(sortie, position):
            output += self._break_off(sortie)
        # It may have searched the last AUV from C3 itself, and is home without another step.
        return output + self._return_to_c3(sortie, position)

    def _steer(self) -> Point | None:
        """Send the vehicle where it is to be next, and return where that is."""
        sortie, position = self._sortie, self._position
        if sortie is None or sortie.departed_s is None or position is None:
            return None
        target = self._target(sortie, position)
        self._driver.go_to(target)
        return target

    def _target(self, sortie: _Sortie, position: Point) -> Point:
        if self._awaits_answer(sortie, position):
            return position
        return sortie.mission.c3 if sortie.goes_home else sortie.plan.route[sortie.cursor].point

    def _must_turn_home(self, sortie: _Sortie, position: Point) -> bool:
        """Return whether one more tick of searching could break L; the plan alone never does."""
        if not self._planner.guarantees_limit or sortie.goes_home:
            return False
        mission = sortie.mission
        ahead = position.toward(self._target(sortie, position), mission.step_m)
        home_s = self._home_s(mission, ahead, self._now_s + mission.tick_s)
        return is_before(sortie.back_by_s, home_s)

    def _home_s(self, mission: MissionSpec, point: Point, now_s: float) -> float:
        """Return when the UAV is home from a point, as slow as it has been seen to be."""
        ticks = whole_ticks(point.distance_m(mission.c3) / self._headway.safe_step_m)
        return now_s + ticks * mission.tick_s

    def _awaits_answer(self, sortie: _Sortie, position: Point) -> bool:
        """Return whether the UAV stays where it is, to be heard by an AUV and to hear it."""
        if sortie.not_reached or self._is_called_home:
            return False
        if not sortie.fleet.is_awaiting(sortie.met, self._now_s):
            return False
        if not self._planner.guarantees_limit:
            return True
        mission = sortie.mission
        later_s = self._now_s + mission.tick_s
        back_s = later_s + worst_case_s(mission, sortie.rest, later_s, position)
        back_s = max(back_s, self._home_s(mission, position, later_s))
        return not is_before(sortie.back_by_s, back_s)

    def _turn_home(self, sortie: _Sortie) -> list[Output]:
        self._is_changed = True
        sortie.not_reached = tuple(dict.fromkeys(waypoint.auv for waypoint in sortie.rest))
        sortie.cursor = len(sortie.plan.route)
        broken_off = SearchBrokenOff(sortie=sortie.number, not_reached=sortie.not_reached)
        return [Log(broken_off, self._now_s)]

    def _break_off(self, sortie: _Sortie) -> list[Output]:
        """Turn home to keep L."""
        output = self._turn_home(sortie)
        if not (sortie.met or sortie.missed):
            # All of a sortie was not enough for it: one that is always out of reach is lost, too.
            output += self._searched_in_vain(sortie, sortie.not_reached[0])
        return output

    def _tell(self) -> list[Output]:
        untold, self._untold = self._untold, []
        return untold

    def _depart(self, sortie: _Sortie, met: tuple[str, ...] = ()) -> list[Output]:
        """Begin a sortie, at the time to leave or with an AUV that is met at C3."""
        mission = sortie.mission
        sortie.departed_s, self._is_changed = self._now_s, True
        # What is planned for the ground is out of date, and from now on the visiting order stays.
        self._look_ahead, self.is_busy = iter(()), False
        self._plans_ahead_from_s = None
        self._headway = self._headway.next_sortie()
        points = (mission.c3, *(waypoint.point for waypoint in sortie.plan.route), mission.c3)
        departed = SortieDeparted(
            sortie=sortie.number,
            limit_s=mission.sortie_limit_s,
            predicted_s=sortie.plan.predicted_s,
            worst_case_s=self._worst_case_s(sortie, met),
            order=sortie.order,
        )
        track = TrackPath(stamp_s=self._now_s, points=points, z_m=self._setup.altitude_m)
        return [Log(departed, self._now_s), Publish(ROUTE, track)]

    def _worst_case_s(self, sortie: _Sortie, met: tuple[str, ...]) -> float:
        """Return how long a sortie takes at worst that begins now, with some AUVs met at C3."""
        mission = sortie.mission
        rest = tuple(waypoint for waypoint in sortie.plan.route if waypoint.auv not in met)
        handovers_s = len(met) * mission.handover_ticks * mission.tick_s
        return handovers_s + worst_case_s(mission, rest, self._now_s + handovers_s)

    def _advance(self, sortie: _Sortie, position: Point) -> list[Output]:
        """Move the cursor to the next waypoint that is still of use (ECC 2009, Theorem 1)."""
        output: list[Output] = []
        route = sortie.plan.route
        while not sortie.goes_home:
            waypoint = route[sortie.cursor]
            if waypoint.auv not in sortie.met:
                if not self._is_at(waypoint.point, position, sortie.mission):
                    break
                if is_before(self._now_s, waypoint.surface_deadline_s):
                    break
                if sortie.cursor + 1 == len(route) or route[sortie.cursor + 1].auv != waypoint.auv:
                    if self._may_be_on_the_air(sortie):
                        break
                    output += self._miss(sortie, waypoint.auv)
            sortie.cursor += 1
            sortie.listens_from_s, self._is_changed = None, True
        return output

    def _may_be_on_the_air(self, sortie: _Sortie) -> bool:
        """Return whether what an AUV says may not yet be heard at the last of its waypoints."""
        if sortie.listens_from_s is None:
            sortie.listens_from_s, self._is_changed = self._now_s, True
        return is_before(self._now_s, sortie.listens_from_s + self._setup.hearing_s)

    def _miss(self, sortie: _Sortie, auv: str) -> list[Output]:
        """Note that an AUV was searched to the end and not heard."""
        sortie.missed.add(auv)
        self._is_changed = True
        missed = Missed(sortie=sortie.number, auv=auv)
        return [Log(missed, self._now_s), *self._searched_in_vain(sortie, auv)]

    def _searched_in_vain(self, sortie: _Sortie, auv: str) -> list[Output]:
        if sortie.fleet.searched_in_vain(auv):
            return [Log(GivenUp(sortie=sortie.number, auv=auv), self._now_s)]
        return []

    def _is_at(self, point: Point, position: Point, mission: MissionSpec) -> bool:
        # What the plan counts as no flight at all must not cost a tick.
        if hop_ticks(mission, position, point) == 0:
            return True
        return position.distance_m(point) <= self._setup.arrival_radius_m

    # --- back at C3 ------------------------------------------------------------------------------

    def _return_to_c3(self, sortie: _Sortie, position: Point) -> list[Output]:
        """End a sortie if it is over: plan the next one, and put together what C3 is told."""
        fleet = sortie.fleet
        if sortie.departed_s is None or not sortie.goes_home:
            return []
        if not self._is_at(sortie.mission.c3, position, sortie.mission) or self._awaits_answer(
            sortie, position
        ):
            return []
        searched = sortie.met.keys() | sortie.missed
        overlooked = tuple(leg.auv for leg in fleet.survey_legs() if leg.auv not in searched)
        self._sortie = self._next_sortie(sortie, frozenset(overlooked))
        self._is_changed = True
        report = SortieReport(
            sortie=sortie.number,
            departed_s=sortie.departed_s,
            returned_s=self._now_s,
            meetings=tuple(
                Meeting(
                    auv=auv,
                    time_s=time_s,
                    cell=report.cell,
                    ended_leg_id=report.leg_id,
                    outcome=report.outcome,
                    next_leg=fleet.next_leg(auv),
                )
                for auv, (time_s, report) in sortie.met.items()
            ),
            missed=tuple(auv for auv in sortie.order if auv in sortie.missed),
            not_reached=overlooked,
            lost=fleet.lost,
            cargo=self._custody.spans,
            next_sortie=_outlook(self._sortie) if self._sortie is not None else None,
        )
        self._undelivered.append(report)
        self._store.put(_REPORT, str(report.sortie), report)
        returned = SortieReturned(sortie=sortie.number, duration_s=self._now_s - sortie.departed_s)
        return [Log(returned, self._now_s)]

    def _report_to_c3(self) -> list[Output]:
        """Say the oldest report that C3 lacks while it may hear, on the ground samples, too."""
        if not self._reaches_c3():
            return []
        c3 = self._setup.c3
        output: list[Output] = [Transmit(c3, report) for report in tuple(self._undelivered)[:1]]
        if self._sortie is None or self._sortie.departed_s is None:
            output += [Transmit(c3, batch) for batch in self._custody.batches(self._now_s)]
        return output

    def _reaches_c3(self) -> bool:
        """Return whether C3 is within radio range, as far as the UAV knows."""
        if self._fleet is None or self._position is None:
            return False
        mission = self._fleet.mission
        range_m = mission.radio_range_m + self._setup.short_of_range_m
        return within_range(self._position.distance_m(mission.c3), range_m)

    def _acknowledged(self, src: str, message: Acknowledgement) -> list[Output]:
        if src == self._setup.c3 and message.acknowledges is Acknowledged.SORTIE_REPORT:
            return self._delivered(message.reference)
        if self._fleet is not None:
            self._fleet.acknowledged(src, message)
        return []

    def _delivered(self, sortie_number: int) -> list[Output]:
        if not self._undelivered or sortie_number != self._undelivered[0].sortie:
            return []  # a late copy
        self._undelivered.popleft()
        self._store.drop(_REPORT, str(sortie_number))
        self._look_for_end()
        return self._report_to_c3()

    def _relieved(self, receipt: SampleReceipt) -> list[Output]:
        """Note which samples are at C3; say those that it lacks."""
        self._custody.passed_on(receipt)
        self._look_for_end()
        return self._report_to_c3()

    def _look_for_end(self) -> None:
        """Note whether nothing is left to do."""
        is_relieved = not self._undelivered and not self._custody.spans
        if self._sortie is None and is_relieved and not self.finished:
            self.finished = self._is_changed = True

    # --- a meeting -------------------------------------------------------------------------------

    def _hear(self, fleet: Fleet, report: SurfacingReport) -> list[Output]:
        sortie, auv = self._sortie, report.auv
        fleet.heard(report)
        if self._is_met(fleet, auv):
            return self._go_on(fleet, report)
        if sortie is None:
            return []
        if self._may_meet(sortie, auv):
            return self._meet(sortie, report)
        self._heard[auv], self._is_changed = (self._now_s, report), True
        return []

    def _is_met(self, fleet: Fleet, auv: str) -> bool:
        """Return whether this sortie has met an AUV, or one has told it to stay up."""
        is_recovered = fleet.next_leg(auv) is None
        return is_recovered or (self._sortie is not None and auv in self._sortie.met)

    def _go_on(self, fleet: Fleet, report: SurfacingReport) -> list[Output]:
        """Go on with the hand-over to an AUV that was met and is still there."""
        if fleet.hand_over(report) is None:
            return []
        refused = self._intake.take(report.auv, report.samples, fleet.ordered_region)
        return [*refused, *self._answer(fleet, report.auv)]

    def _take_samples(self, fleet: Fleet, auv: str, batch: SampleBatch) -> list[Output]:
        refused = self._intake.take(auv, batch.samples, fleet.ordered_region)
        answer = self._answer(fleet, auv)
        if not answer:
            self._note_answered(auv, msgspec.structs.replace(self._answered[auv], is_owed=True))
        return [*refused, *answer]

    def _answer_owed(self) -> list[Output]:
        """Answer the data that has come since its AUV was answered."""
        if self._fleet is None:
            return []
        owed = [auv for auv, answered in self._answered.items() if answered.is_owed]
        return [each for auv in owed for each in self._answer(self._fleet, auv)]

    def _answer(self, fleet: Fleet, auv: str) -> list[Output]:
        """
        Say which samples are held; when no more are to come, or time is up, what is next.

        Once a tick, and once more when only then it is time for what is next.
        """
        says_next = self._says_next(fleet, auv)
        before = self._answered.get(auv)
        if before and before.at_s == self._now_s and before.says_next >= says_next:
            return []
        self._note_answered(auv, _Answered(at_s=self._now_s, says_next=says_next))
        receipt = Transmit(auv, self._custody.receipt(auv))
        return [receipt, *fleet.answer(auv, self._now_s)] if says_next else [receipt]

    def _note_answered(self, auv: str, answered: _Answered) -> None:
        self._answered[auv] = answered
        self._store.put(_ANSWERED, auv, answered)

    def _says_next(self, fleet: Fleet, auv: str) -> bool:
        """Return whether an AUV is to be told now what comes next."""
        hand_over = fleet.hand_over_to(auv)
        if hand_over is None or not self._is_met(fleet, auv):
            # What comes from others was on the air when that sortie ended: to be told its path
            # now, by a later deadline than the next one is planned with, it must be met again.
            return False
        if self._is_called_home and hand_over.plan is not None:
            return False  # it waits where it lies, like those who are not met any more
        has_all = self._intake.has_all(auv, hand_over.samples_taken)
        return has_all or not self._waits_for_data(fleet, hand_over, auv)

    def _waits_for_data(self, fleet: Fleet, hand_over: HandOver, auv: str) -> bool:
        """Return whether an AUV is to hand over more data before it is told what comes next."""
        if hand_over.plan is None:
            # It stays here anyway; but who knows what an AUV that is off course has measured.
            return hand_over.reason is not RecoveryReason.OFF_COURSE
        sortie, position = self._sortie, self._position
        may_stay = sortie is None or position is None or self._awaits_answer(sortie, position)
        return may_stay and fleet.is_time_for_data(auv, self._now_s)

    def _may_meet(self, sortie: _Sortie, auv: str) -> bool:
        """Return whether an AUV that is heard is met now."""
        if self._is_called_home:
            return False
        if not self._planner.guarantees_limit:
            is_turn = auv == sortie.turn or auv in sortie.fleet.lost
            return is_turn and (sortie.departed_s is not None or self._may_depart)
        if sortie.departed_s is not None:
            return True
        if not self._may_depart:
            return False
        # To meet it at C3 starts the sortie: only if what remains then still keeps L.
        return not is_before(sortie.mission.sortie_limit_s, self._worst_case_s(sortie, (auv,)))

    def _meet(self, sortie: _Sortie, report: SurfacingReport) -> list[Output]:
        fleet, auv = sortie.fleet, report.auv
        output: list[Output] = []
        problem = fleet.problem_with(report)
        if problem:
            output.append(Refuse(auv, Refusal.CONTRADICTORY, problem))
            if not fleet.is_off_course(report, self._now_s):
                return output
            encounter = fleet.take_off_course(report, self._now_s)
        else:
            position = self._position or fleet.mission.c3
            encounter = fleet.meet(report, sortie.to_meet, position, self._now_s)
        output += self._intake.take(auv, report.samples, fleet.ordered_region)
        if sortie.departed_s is None:
            output += self._depart(sortie, met=(auv,))
        if encounter.was_lost:
            output.append(Log(HeardAgain(auv=auv), self._now_s))
        self._is_changed = True
        sortie.met[auv] = (self._now_s, report)
        sortie.missed.discard(auv)
        plan = encounter.plan
        met = Met(
            sortie=sortie.number,
            auv=auv,
            cell=report.cell,
            leg_id=report.leg_id,
            path=plan.path if plan else (),
            slack_s=plan.slack_s if plan else None,
            sortie_time_s=plan.sortie_time_s if plan else None,
            plan_status=plan.status.value if plan else None,
        )
        output += [Log(met, self._now_s), *self._answer(fleet, auv)]
        heard_s, waiting = self._heard.pop(sortie.turn or '', (-math.inf, report))
        # What was said at an earlier tick is out of date.
        return output + self._hear(fleet, waiting) if heard_s == self._now_s else output


def _outlook(sortie: _Sortie) -> SortieOutlook:
    """Return what C3 may expect of a sortie that waits for its departure."""
    plan = sortie.plan
    times_s = search_times_s(sortie.mission, plan.route, plan.depart_s)
    return SortieOutlook(
        departs_s=plan.depart_s,
        returns_by_s=plan.depart_s + plan.worst_case_s,
        contacts=tuple(ExpectedContact(auv=auv, time_s=time_s) for auv, time_s in times_s.items()),
    )
