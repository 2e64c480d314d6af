"""The UAV: flies sorties, meets AUVs, relays their data and hands over their next paths."""

from __future__ import annotations

import itertools
from collections import deque
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from msgs_json.agent import Log, Output, Publish, Refuse, Transmit
from msgs_json.codec import Refusal
from msgs_json.geometry import (
    Cell,
    GridSpec,
    Point,
    is_before,
    path_length_m,
    path_problem,
    surface_deadline_s,
    whole_ticks,
)
from msgs_json.messages import (
    Acknowledged,
    Acknowledgement,
    ExpectedContact,
    GivenUp,
    HeardAgain,
    Leg,
    LegOutcome,
    Meeting,
    Message,
    Met,
    Missed,
    MissionOrder,
    PathAssignment,
    RecoveryOrder,
    RecoveryReason,
    RelayedSample,
    SearchBrokenOff,
    SortieDeparted,
    SortieOutlook,
    SortieReport,
    SortieReturned,
    SurfacingReport,
)
from msgs_json.ros_messages import TrackPath
from msgs_json.topics import ODOM, ROUTE
from uav_planner.exploration_map import ExplorationMap
from uav_planner.headway import Headway
from uav_planner.planning import (
    MissionSpec,
    Planner,
    PlanRequest,
    PlanResult,
    Prospect,
    SortieRequest,
    SurveyLeg,
)
from uav_planner.sortie import search_times_s, worst_case_s

if TYPE_CHECKING:
    from msgs_json.drivers import UavDriver
    from uav_planner.planning import SortiePlan
    from uav_planner.sortie import Route

HAND_OVER_TICKS = 5
"""
How long the UAV stays for an AUV's answer to its next path before it flies on.

Without loss the answer comes within the tick. Else every tick is one more chance to be heard, but
not for ever: an AUV that took its path is under water, and if its answer was lost none will come.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class UavSetup:
    """What the UAV knows before it gets its order."""

    c3: str
    """Name of the station."""
    speed_mps: float
    altitude_m: float
    tick_s: float
    arrival_radius_m: float
    """Closer than this to a waypoint counts as there; 0 for a vehicle that arrives exactly."""


@dataclass(slots=True, kw_only=True)
class _Auv:
    """What the UAV knows of an AUV."""

    speed_mps: float
    leg: Leg
    """The last one it was given."""
    behind: Cell | None = None
    """The neighbour of the leg's first cell toward which it began."""
    search: tuple[Point, ...] = ()
    """The waypoints from which the leg is searched."""
    searches_in_vain: int = 0
    """Since it was last met."""
    recovered: bool = False
    lost: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class _HandOver:
    """What an AUV was told after a leg and has not acknowledged."""

    ended_leg_id: int
    plan: PlanResult | None
    """Its next path; None where it is to stay up for recovery."""
    reason: RecoveryReason
    """Why, if it is."""
    way_m: float
    """From where it lies through that path."""
    begun_s: float

    def is_taken_by(self, report: SurfacingReport) -> bool:
        """Return whether a report shows that the AUV has taken its next path."""
        return self.plan is not None and report.leg_id == self.ended_leg_id + 1

    @property
    def acknowledgement(self) -> Acknowledgement:
        """Return the answer that ends it."""
        if self.plan is None:
            return Acknowledgement(
                acknowledges=Acknowledged.RECOVERY_ORDER, reference=self.ended_leg_id
            )
        return Acknowledgement(
            acknowledges=Acknowledged.PATH_ASSIGNMENT, reference=self.ended_leg_id + 1
        )


@dataclass(slots=True, kw_only=True)
class _Sortie:
    """A sortie, from its planning at C3 to the return."""

    number: int
    order: tuple[str, ...]
    plan: SortiePlan
    departed_s: float | None = None
    cursor: int = 0
    """Index of the waypoint flown to; past the last one it is C3."""
    met: dict[str, tuple[float, SurfacingReport]] = field(default_factory=dict)
    """AUVs met: when, and what they reported."""
    missed: set[str] = field(default_factory=set)
    """AUVs searched to the end and not heard."""
    not_reached: tuple[str, ...] = ()
    """AUVs that it gave up reaching, to be home in time."""

    def turn(self) -> str | None:
        """Return the AUV to be met next; None when only the way home is left."""
        for auv in self.order:
            if auv not in self.met and auv not in self.missed:
                return auv
        return None

    def goes_to(self, auv: str) -> bool:
        """Return whether an AUV is still to be met, as far as the sortie is concerned."""
        return auv in self.order and auv not in self.met and auv not in self.not_reached

    @property
    def rest(self) -> Route:
        """Return what is left of the route, without the AUVs that were met."""
        return tuple(each for each in self.plan.route[self.cursor :] if each.auv not in self.met)


class UavAgent:
    """Sans-I/O behaviour of the UAV; its vehicle is behind ``driver``."""

    def __init__(self, name: str, setup: UavSetup, planner: Planner, driver: UavDriver) -> None:
        self.name = name
        self.peers = frozenset({setup.c3})
        self.finished = False
        self._setup = setup
        self._planner = planner
        self._driver = driver
        self._now_s = 0.0
        self._position: Point | None = None
        self._mission: MissionSpec | None = None
        self._surface_margin_s = 0.0
        self._lost_after_sorties = 0
        self._map: ExplorationMap | None = None
        self._auvs: dict[str, _Auv] = {}
        self._sortie: _Sortie | None = None
        """The one being flown, or waiting at C3 for its departure."""
        self._sorties_flown = 0
        self._headway = Headway(setup.speed_mps * setup.tick_s)
        self._untold: list[Output] = []
        """What was decided and not said: the vehicle may fail between the two."""
        self._heard: dict[str, SurfacingReport] = {}
        """Reports heard at this tick from AUVs whose turn it was not."""
        self._hand_overs: dict[str, _HandOver] = {}
        """By AUV, until it acknowledges or reports from its next leg."""
        self._cargo: dict[tuple[str, int], RelayedSample] = {}
        """Samples taken over in this sortie, by AUV and number."""
        self._undelivered: deque[SortieReport] = deque()
        """Reports that C3 has not acknowledged, oldest first; it gets them one by one."""

    def tick(self, now_s: float) -> list[Output]:
        """Decide on what was heard until the tick before, fly to ``now_s``, report at C3."""
        self._untold += self._decide()
        target = self._steer()
        state = self._driver.step(now_s)
        is_next_tick = now_s - self._now_s < 1.5 * self._setup.tick_s
        if target is not None and self._position is not None and is_next_tick:
            self._headway.note(self._position, state.position, target)
        self._now_s, self._position = now_s, state.position
        self._heard.clear()
        output = self._tell()
        output.append(Publish(ODOM, state.odometry(self.name, now_s)))
        output += self._return_to_c3()
        output += self._report_to_c3()
        return output

    def receive(self, src: str, message: Message, now_s: float) -> list[Output]:
        """Take an order, a surfacing report or an acknowledgement."""
        match message:
            case MissionOrder() if src == self._setup.c3:
                return self._ordered(message)
            case SurfacingReport() if src == message.auv and src in self._auvs:
                return [*self._tell(), *self._hear(message)]
            case Acknowledgement():
                return self._acknowledged(src, message)
            case _:
                detail = f'the UAV takes no {type(message).__name__} from {src}'
                return [Refuse(src, Refusal.UNEXPECTED, detail)]

    # --- the order -------------------------------------------------------------------------------

    def _ordered(self, order: MissionOrder) -> list[Output]:
        acknowledgement = Transmit(
            self._setup.c3, Acknowledgement(acknowledges=Acknowledged.MISSION_ORDER, reference=0)
        )
        if self._mission is not None:
            return [acknowledgement]  # repeated by C3: it missed our answer
        problem = _problem_with_order(order, self._setup)
        if problem:
            return [Refuse(self._setup.c3, Refusal.CONTRADICTORY, problem)]
        mission = mission_spec(order, self._setup)
        self._auvs = {auv.name: _Auv(speed_mps=auv.speed_mps, leg=auv.leg) for auv in order.auvs}
        try:
            self._plan_sortie(mission, overlooked=frozenset())
        except ValueError as error:
            self._auvs = {}
            return [Refuse(self._setup.c3, Refusal.NOT_POSSIBLE, str(error))]
        self._mission = mission
        self._surface_margin_s = order.surface_margin_s
        self._lost_after_sorties = order.lost_after_sorties
        self.peers = frozenset({self._setup.c3, *self._auvs})
        self._map = ExplorationMap(order.region, [auv.leg.path[0] for auv in order.auvs])
        for auv in order.auvs:
            self._map.assign(auv.leg.path)
        return [acknowledgement]

    # --- the sortie ------------------------------------------------------------------------------

    def _plan_sortie(self, mission: MissionSpec, overlooked: frozenset[str]) -> None:
        legs = self._survey_legs(None)
        if not legs:
            self._sortie = None
            return
        now_s = self._now_s
        departed_s = self._sortie.departed_s if self._sortie else None
        if departed_s is not None and all(leg.prospect is Prospect.ASTRAY for leg in legs):
            # To search them again at once would tell nothing new, and soon give them up.
            now_s = max(now_s, departed_s + mission.sortie_limit_s)
        plan = self._planner.plan_sortie(
            SortieRequest(mission=mission, legs=legs, overlooked=overlooked, now_s=now_s)
        )
        for auv, waypoints in itertools.groupby(plan.route, key=lambda each: each.auv):
            self._auvs[auv].search = tuple(waypoint.point for waypoint in waypoints)
        self._sortie = _Sortie(
            number=self._sorties_flown + 1,
            order=tuple(dict.fromkeys(waypoint.auv for waypoint in plan.route)),
            plan=plan,
        )

    def _survey_legs(self, sortie: _Sortie | None) -> tuple[SurveyLeg, ...]:
        """Return the legs of the AUVs that survey, as they look within a sortie or before it."""
        return tuple(
            SurveyLeg(
                auv=name,
                path=auv.leg.path,
                surface_deadline_s=auv.leg.surface_deadline_s,
                behind=auv.behind,
                search=auv.search,
                prospect=self._prospect(name, sortie),
            )
            for name, auv in self._auvs.items()
            if not (auv.recovered or auv.lost)
        )

    def _prospect(self, auv: str, sortie: _Sortie | None) -> Prospect:
        if self._auvs[auv].searches_in_vain > 0:
            return Prospect.ASTRAY
        if sortie is None or not sortie.goes_to(auv):
            return Prospect.STAYS
        # One that did not confirm its path will be told the same again.
        return Prospect.STAYS if auv in self._hand_overs else Prospect.ENDS

    def _decide(self) -> list[Output]:
        """Leave C3 when it is time; turn to the next waypoint when this one is done with."""
        sortie, mission = self._sortie, self._mission
        if sortie is None or mission is None or self._position is None:
            return []
        output: list[Output] = []
        if sortie.departed_s is None:
            if is_before(self._now_s, sortie.plan.depart_s):
                return []
            output += self._depart(sortie, mission)
        output += self._advance(sortie, self._position)
        if self._must_turn_home(sortie, mission, self._position):
            output += self._break_off(sortie)
        # It may have searched the last AUV from C3 itself, and is home without another step.
        return output + self._return_to_c3()

    def _steer(self) -> Point | None:
        """Send the vehicle where it is to be next, and return where that is."""
        sortie, mission = self._sortie, self._mission
        if sortie is None or mission is None or self._position is None:
            return None
        if sortie.departed_s is None:
            return None
        target = self._target(sortie, mission, self._position)
        self._driver.go_to(target)
        return target

    def _target(self, sortie: _Sortie, mission: MissionSpec, position: Point) -> Point:
        if self._awaits_answer(sortie, mission, position):
            return position
        route = sortie.plan.route
        return route[sortie.cursor].point if sortie.cursor < len(route) else mission.c3

    def _must_turn_home(self, sortie: _Sortie, mission: MissionSpec, position: Point) -> bool:
        """Return whether one more tick of searching could break L; the plan alone never does."""
        if not self._planner.guarantees_limit or sortie.departed_s is None or not sortie.rest:
            return False
        ahead = position.toward(self._target(sortie, mission, position), mission.step_m)
        home_s = self._home_s(mission, ahead, self._now_s + mission.tick_s)
        return is_before(sortie.departed_s + mission.sortie_limit_s, home_s)

    def _home_s(self, mission: MissionSpec, point: Point, now_s: float) -> float:
        """Return when the UAV is home from a point, as slow as it has been seen to be."""
        ticks = whole_ticks(point.distance_m(mission.c3) / self._headway.safe_step_m)
        return now_s + ticks * mission.tick_s

    def _break_off(self, sortie: _Sortie) -> list[Output]:
        sortie.not_reached = tuple(dict.fromkeys(waypoint.auv for waypoint in sortie.rest))
        sortie.cursor = len(sortie.plan.route)
        broken_off = SearchBrokenOff(sortie=sortie.number, not_reached=sortie.not_reached)
        output: list[Output] = [Log(broken_off, self._now_s)]
        if not (sortie.met or sortie.missed):
            # All of a sortie was not enough for it: one that is always out of reach is lost, too.
            output += self._searched_in_vain(sortie, sortie.not_reached[0])
        return output

    def _tell(self) -> list[Output]:
        untold, self._untold = self._untold, []
        return untold

    def _depart(
        self, sortie: _Sortie, mission: MissionSpec, met: tuple[str, ...] = ()
    ) -> list[Output]:
        """Begin a sortie, at the time to leave or with an AUV that is met at C3."""
        sortie.departed_s = self._now_s
        self._headway = self._headway.next_sortie()
        points = (mission.c3, *(waypoint.point for waypoint in sortie.plan.route), mission.c3)
        departed = SortieDeparted(
            sortie=sortie.number,
            limit_s=mission.sortie_limit_s,
            predicted_s=sortie.plan.predicted_s,
            worst_case_s=self._worst_case_s(sortie, mission, met),
            order=sortie.order,
        )
        track = TrackPath(stamp_s=self._now_s, points=points, z_m=self._setup.altitude_m)
        return [Log(departed, self._now_s), Publish(ROUTE, track)]

    def _worst_case_s(self, sortie: _Sortie, mission: MissionSpec, met: tuple[str, ...]) -> float:
        """Return how long a sortie takes at worst that begins now, with some AUVs met at C3."""
        rest = tuple(waypoint for waypoint in sortie.plan.route if waypoint.auv not in met)
        handovers_s = len(met) * mission.handover_ticks * mission.tick_s
        return handovers_s + worst_case_s(mission, rest, self._now_s + handovers_s)

    def _advance(self, sortie: _Sortie, position: Point) -> list[Output]:
        """Move the cursor to the next waypoint that is still of use (ECC 2009, Theorem 1)."""
        output: list[Output] = []
        route = sortie.plan.route
        while sortie.cursor < len(route):
            waypoint = route[sortie.cursor]
            if waypoint.auv not in sortie.met:
                if not self._is_at(waypoint.point, position):
                    break
                if is_before(self._now_s, waypoint.surface_deadline_s):
                    break
                if sortie.cursor + 1 == len(route) or route[sortie.cursor + 1].auv != waypoint.auv:
                    output += self._miss(sortie, waypoint.auv)
            sortie.cursor += 1
        return output

    def _miss(self, sortie: _Sortie, auv: str) -> list[Output]:
        """Note that an AUV was searched to the end and not heard."""
        sortie.missed.add(auv)
        missed = Missed(sortie=sortie.number, auv=auv)
        return [Log(missed, self._now_s), *self._searched_in_vain(sortie, auv)]

    def _searched_in_vain(self, sortie: _Sortie, auv: str) -> list[Output]:
        """Count a search of an AUV, and give it up after so many."""
        known = self._auvs[auv]
        known.searches_in_vain += 1
        if known.searches_in_vain < self._lost_after_sorties or self._map is None:
            return []
        known.lost = True
        self._map.restore(known.leg.path[1:])
        return [Log(GivenUp(sortie=sortie.number, auv=auv), self._now_s)]

    def _is_at(self, point: Point, position: Point) -> bool:
        return position.distance_m(point) <= self._setup.arrival_radius_m

    def _return_to_c3(self) -> list[Output]:
        sortie, mission = self._sortie, self._mission
        if sortie is None or mission is None or self._position is None:
            return []
        if sortie.departed_s is None or sortie.cursor < len(sortie.plan.route):
            return []
        if self._awaits_answer(sortie, mission, self._position):
            return []
        if not self._is_at(mission.c3, self._position):
            return []
        self._sorties_flown = sortie.number
        searching = [name for name, auv in self._auvs.items() if not (auv.recovered or auv.lost)]
        overlooked = [
            auv for auv in searching if auv not in sortie.met and auv not in sortie.missed
        ]
        self._plan_sortie(mission, frozenset(overlooked))
        self._undelivered.append(
            SortieReport(
                sortie=sortie.number,
                departed_s=sortie.departed_s,
                returned_s=self._now_s,
                meetings=tuple(self._meeting(*contact) for contact in sortie.met.values()),
                missed=tuple(auv for auv in sortie.order if auv in sortie.missed),
                not_reached=tuple(overlooked),
                lost=tuple(name for name, auv in self._auvs.items() if auv.lost),
                samples=tuple(self._cargo.values()),
                next_sortie=self._outlook(mission),
            )
        )
        self._cargo.clear()
        returned = SortieReturned(sortie=sortie.number, duration_s=self._now_s - sortie.departed_s)
        return [Log(returned, self._now_s)]

    def _outlook(self, mission: MissionSpec) -> SortieOutlook | None:
        if self._sortie is None:
            return None
        plan = self._sortie.plan
        times_s = search_times_s(mission, plan.route, plan.depart_s)
        return SortieOutlook(
            departs_s=plan.depart_s,
            returns_by_s=plan.depart_s + plan.worst_case_s,
            contacts=tuple(
                ExpectedContact(auv=auv, time_s=time_s) for auv, time_s in times_s.items()
            ),
        )

    def _meeting(self, time_s: float, report: SurfacingReport) -> Meeting:
        auv = self._auvs[report.auv]
        return Meeting(
            auv=report.auv,
            time_s=time_s,
            cell=report.cell,
            ended_leg_id=report.leg_id,
            outcome=report.outcome,
            next_leg=None if auv.recovered else auv.leg,
        )

    def _report_to_c3(self) -> list[Output]:
        return [Transmit(self._setup.c3, report) for report in tuple(self._undelivered)[:1]]

    def _delivered(self, sortie_number: int) -> list[Output]:
        if not self._undelivered or sortie_number != self._undelivered[0].sortie:
            return []  # a late copy
        self._undelivered.popleft()
        self.finished = self._sortie is None and not self._undelivered
        return self._report_to_c3()

    # --- a meeting -------------------------------------------------------------------------------

    def _hear(self, report: SurfacingReport) -> list[Output]:
        sortie, auv = self._sortie, report.auv
        hand_over = self._hand_overs.get(auv)
        if hand_over is not None and hand_over.is_taken_by(report):
            del self._hand_overs[auv]  # it speaks of its next leg
        if report.outcome is LegOutcome.ABORTED and self._missed_answer(report):
            self._call_off(report)
        if self._auvs[auv].recovered or (sortie is not None and auv in sortie.met):
            return self._answer(auv) if self._missed_answer(report) else []
        if sortie is None:
            return []
        if self._may_meet(auv, sortie):
            return self._meet(report, sortie)
        self._heard[auv] = report
        return []

    def _may_meet(self, auv: str, sortie: _Sortie) -> bool:
        """Return whether an AUV that is heard is met now."""
        if not self._planner.guarantees_limit:
            return auv == sortie.turn() or self._auvs[auv].lost
        if sortie.departed_s is not None or self._mission is None:
            return True
        # To meet it at C3 starts the sortie: only if what remains then still keeps L.
        sortie_s = self._worst_case_s(sortie, self._mission, (auv,))
        return not is_before(self._mission.sortie_limit_s, sortie_s)

    def _call_off(self, report: SurfacingReport) -> None:
        """Take back the path that an AUV has not taken: it asks for help since."""
        hand_over, exploration = self._hand_overs[report.auv], self._map
        if hand_over.plan is None or exploration is None:
            return
        if not self._auvs[report.auv].lost:
            exploration.restore(hand_over.plan.path[1:])
        self._hand_overs[report.auv] = replace(hand_over, plan=None, reason=RecoveryReason.ABORTED)

    def _missed_answer(self, report: SurfacingReport) -> bool:
        """Return whether this leg's end was answered, but the AUV has not acknowledged it."""
        hand_over = self._hand_overs.get(report.auv)
        return hand_over is not None and report.leg_id == hand_over.ended_leg_id

    def _meet(self, report: SurfacingReport, sortie: _Sortie) -> list[Output]:
        mission, exploration = self._mission, self._map
        if mission is None or exploration is None:
            return []
        known = self._auvs[report.auv]
        was_answered = self._missed_answer(report)  # in a sortie before
        if not was_answered:
            problem = _problem_with_report(report, known.leg, mission.grid)
            if problem:
                return [Refuse(report.auv, Refusal.CONTRADICTORY, problem)]
            self._take_over(report, exploration)
        was_lost, known.lost = known.lost, False
        was_astray, known.searches_in_vain = known.searches_in_vain > 0, 0
        plan = self._hand_overs[report.auv].plan if was_answered else None
        # It still lies where the path begins that it was given then: the same path again, unless
        # the others were given theirs without a thought of it.
        if plan is None or was_astray:
            if plan is not None and not was_lost:
                exploration.restore(plan.path[1:])
            plan = self._plan_path(report, sortie, mission, exploration)
        path = plan.path if plan else ()
        way = [report.position, *(mission.grid.centre(cell) for cell in path)]
        is_aborted = report.outcome is LegOutcome.ABORTED
        self._hand_overs[report.auv] = _HandOver(
            ended_leg_id=report.leg_id,
            plan=plan,
            reason=RecoveryReason.ABORTED if is_aborted else RecoveryReason.EXPLORED,
            way_m=path_length_m(way),
            begun_s=self._now_s,
        )
        output: list[Output] = []
        if sortie.departed_s is None:
            output += self._depart(sortie, mission, met=(report.auv,))
        if was_lost:
            output.append(Log(HeardAgain(auv=report.auv), self._now_s))
        sortie.met[report.auv] = (self._now_s, report)
        sortie.missed.discard(report.auv)
        met = Met(
            sortie=sortie.number,
            auv=report.auv,
            cell=report.cell,
            leg_id=report.leg_id,
            path=path,
            slack_s=plan.slack_s if plan else None,
            sortie_time_s=plan.sortie_time_s if plan else None,
            plan_status=plan.status.value if plan else None,
        )
        output += [Log(met, self._now_s), *self._answer(report.auv)]
        waiting = self._heard.pop(sortie.turn() or '', None)
        return output + self._hear(waiting) if waiting else output

    def _take_over(self, report: SurfacingReport, exploration: ExplorationMap) -> None:
        """Note on the map what the AUV really visited, and take custody of its samples."""
        known = self._auvs[report.auv]
        path = known.leg.path
        if known.lost:  # its cells were given to the others
            exploration.assign(path)
        exploration.confirm(path[1 : report.moves_done + 1])
        exploration.restore(path[report.moves_done + 1 :])
        for sample in report.samples:
            relayed = RelayedSample(auv=report.auv, sample=sample)
            self._cargo[report.auv, sample.number] = relayed

    def _plan_path(
        self,
        report: SurfacingReport,
        sortie: _Sortie,
        mission: MissionSpec,
        exploration: ExplorationMap,
    ) -> PlanResult | None:
        """Return the AUV's next path, already noted on the map; None where none is needed."""
        if exploration.is_explored or report.outcome is LegOutcome.ABORTED:
            return None
        behind = mission.grid.neighbour_toward(report.cell, report.position)
        plan = self._planner.plan_path(
            PlanRequest(
                mission=mission,
                values=exploration.values,
                auv=report.auv,
                cell=report.cell,
                behind=behind,
                legs=self._survey_legs(sortie),
                now_s=self._now_s,
            )
        )
        exploration.assign(plan.path)
        known = self._auvs[report.auv]
        known.behind, known.search = behind, plan.search
        return plan

    def _answer(self, auv: str) -> list[Output]:
        """Confirm custody and say what comes next; said again, the deadline counts from then."""
        hand_over, known = self._hand_overs[auv], self._auvs[auv]
        custody = Acknowledgement(
            acknowledges=Acknowledged.SURFACING_REPORT, reference=hand_over.ended_leg_id
        )
        if hand_over.plan is None:
            known.recovered = True
            order = RecoveryOrder(auv=auv, leg_id=hand_over.ended_leg_id, reason=hand_over.reason)
            return [Transmit(auv, custody), Transmit(auv, order)]
        known.leg = Leg(
            leg_id=hand_over.ended_leg_id + 1,
            path=hand_over.plan.path,
            surface_deadline_s=surface_deadline_s(
                self._now_s,
                hand_over.way_m,
                known.speed_mps,
                self._surface_margin_s,
                self._setup.tick_s,
            ),
        )
        return [Transmit(auv, custody), Transmit(auv, PathAssignment(auv=auv, leg=known.leg))]

    def _awaits_answer(self, sortie: _Sortie, mission: MissionSpec, position: Point) -> bool:
        """Return whether the UAV stays where it is, to be heard by an AUV and to hear it."""
        patience_s = max(HAND_OVER_TICKS * mission.tick_s, mission.handover_s)
        is_awaited = any(
            auv in sortie.met and is_before(self._now_s, hand_over.begun_s + patience_s)
            for auv, hand_over in self._hand_overs.items()
        )
        if not is_awaited or sortie.not_reached or sortie.departed_s is None:
            return False
        if not self._planner.guarantees_limit:
            return True
        later_s = self._now_s + mission.tick_s
        back_s = later_s + worst_case_s(mission, sortie.rest, later_s, position)
        back_s = max(back_s, self._home_s(mission, position, later_s))
        return not is_before(sortie.departed_s + mission.sortie_limit_s, back_s)

    def _acknowledged(self, src: str, message: Acknowledgement) -> list[Output]:
        if src == self._setup.c3 and message.acknowledges is Acknowledged.SORTIE_REPORT:
            return self._delivered(message.reference)
        hand_over = self._hand_overs.get(src)
        if hand_over is not None and message == hand_over.acknowledgement:
            del self._hand_overs[src]
        return []


def mission_spec(order: MissionOrder, setup: UavSetup) -> MissionSpec:
    """Return what an order means for the planners of a UAV."""
    return MissionSpec(
        grid=order.region,
        c3=order.c3,
        # It may hold that much short of a waypoint, and all of the leg must be heard there.
        radio_range_m=order.radio_range_m - setup.arrival_radius_m,
        uav_speed_mps=setup.speed_mps,
        tick_s=setup.tick_s,
        sortie_limit_s=order.sortie_limit_s,
        path_cells=order.path_cells,
        min_path_cells=order.min_path_cells,
        handover_s=order.handover_s,
    )


def _problem_with_order(order: MissionOrder, setup: UavSetup) -> str | None:
    """Return why an order is no mission, or None."""
    if order.radio_range_m <= setup.arrival_radius_m:
        return (
            f'radio_range_m must be more than the arrival radius of {setup.arrival_radius_m:g} m,'
            f' is {order.radio_range_m:g}'
        )
    names = [auv.name for auv in order.auvs]
    if len(set(names)) < len(names):
        return f'AUVs must have different names, are {", ".join(names)}'
    if order.min_path_cells > order.path_cells:
        return f'min_path_cells is {order.min_path_cells}, path_cells {order.path_cells}'
    for auv in order.auvs:
        problem = path_problem(auv.leg.path, order.region)
        if problem:
            return f'path of {auv.name}: {problem}'
    return None


def _problem_with_report(report: SurfacingReport, leg: Leg, region: GridSpec) -> str | None:
    """Return what contradicts the leg that was handed over, or None."""
    if report.leg_id != leg.leg_id:
        return f'leg_id must be {leg.leg_id}, is {report.leg_id}'
    if report.moves_done >= len(leg.path):
        return f'moves_done must be 0 ... {len(leg.path) - 1}, is {report.moves_done}'
    if report.cell != leg.path[report.moves_done]:
        return (
            f'after {report.moves_done} moves cell must be {list(leg.path[report.moves_done])},'
            f' is {list(report.cell)}'
        )
    for sample in report.samples:
        if not region.contains(sample.cell):
            return f'sample {sample.number} is from cell {list(sample.cell)}, outside the region'
    return None
