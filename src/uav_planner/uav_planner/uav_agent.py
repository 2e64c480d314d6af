"""The UAV: flies sorties, meets AUVs, relays their data and hands over their next paths."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from msgs_json.agent import Log, Output, Publish, Transmit
from msgs_json.geometry import Point, is_before, path_length_m, surface_deadline_s
from msgs_json.messages import (
    Acknowledged,
    Acknowledgement,
    Leg,
    Meeting,
    Message,
    MessageRefused,
    Met,
    Missed,
    MissionOrder,
    PathAssignment,
    RecoveryOrder,
    RecoveryReason,
    RelayedSample,
    SortieDeparted,
    SortieReport,
    SortieReturned,
    SurfacingReport,
)
from msgs_json.ros_messages import TrackPath
from msgs_json.topics import ODOM, ROUTE
from uav_planner.exploration_map import ExplorationMap
from uav_planner.planning import MissionSpec, Planner, PlanRequest, PlanResult, SurveyLeg
from uav_planner.sortie import worst_case_s

if TYPE_CHECKING:
    from msgs_json.drivers import UavDriver
    from uav_planner.planning import SortiePlan


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
    recovered: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class _HandOver:
    """A meeting under way: the AUV has its answer, but has not acknowledged it."""

    report: SurfacingReport
    answer: PathAssignment | RecoveryOrder
    plan: PlanResult | None


@dataclass(slots=True, kw_only=True)
class _Sortie:
    """A sortie, from its planning at C3 to the return."""

    number: int
    order: tuple[str, ...]
    plan: SortiePlan
    departed_s: float | None = None
    cursor: int = 0
    """Index of the waypoint flown to; past the last one it is C3."""
    met: set[str] = field(default_factory=set)
    missed: set[str] = field(default_factory=set)
    meetings: list[Meeting] = field(default_factory=list)

    def turn(self) -> str | None:
        """Return the AUV to be met next; None when only the way home is left."""
        for auv in self.order:
            if auv not in self.met and auv not in self.missed:
                return auv
        return None


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
        self._map: ExplorationMap | None = None
        self._auvs: dict[str, _Auv] = {}
        self._sortie: _Sortie | None = None
        """The one being flown, or waiting at C3 for its departure."""
        self._sorties_flown = 0
        self._heard: dict[str, SurfacingReport] = {}
        """Reports heard at this tick from AUVs whose turn it was not."""
        self._hand_overs: dict[str, _HandOver] = {}
        self._cargo: dict[tuple[str, int], RelayedSample] = {}
        """Samples in custody of the UAV, by AUV and number."""
        self._undelivered: SortieReport | None = None

    def tick(self, now_s: float) -> list[Output]:
        """Decide on what was heard until the tick before, fly to ``now_s``, report at C3."""
        output = self._decide()
        state = self._driver.step(now_s)
        self._now_s, self._position = now_s, state.position
        self._heard.clear()
        output.append(Publish(ODOM, state.odometry(self.name, now_s)))
        output += self._return_to_c3()
        if self._undelivered is not None:
            output.append(Transmit(self._setup.c3, self._undelivered))
        return output

    def receive(self, src: str, message: Message, now_s: float) -> list[Output]:
        """Take an order, a surfacing report or an acknowledgement."""
        match message:
            case MissionOrder() if src == self._setup.c3:
                return self._ordered(message)
            case SurfacingReport() if src == message.auv:
                return self._hear(message)
            case Acknowledgement():
                return self._acknowledged(src, message)
            case _:
                return [self._refuse(src, 'unexpected', f'{type(message).__name__} from {src}')]

    # --- the order -------------------------------------------------------------------------------

    def _ordered(self, order: MissionOrder) -> list[Output]:
        acknowledgement = Transmit(
            self._setup.c3, Acknowledgement(acknowledges=Acknowledged.MISSION_ORDER, reference=0)
        )
        if self._mission is not None:
            return [acknowledgement]  # repeated by C3: it missed our answer
        self._mission = MissionSpec(
            grid=order.region,
            c3=order.c3,
            radio_range_m=order.radio_range_m,
            uav_speed_mps=self._setup.speed_mps,
            tick_s=self._setup.tick_s,
            sortie_limit_s=order.sortie_limit_s,
            path_cells=order.path_cells,
            min_path_cells=order.min_path_cells,
        )
        self._surface_margin_s = order.surface_margin_s
        self._auvs = {auv.name: _Auv(speed_mps=auv.speed_mps, leg=auv.leg) for auv in order.auvs}
        self.peers = frozenset({self._setup.c3, *self._auvs})
        self._map = ExplorationMap(order.region, [auv.leg.path[0] for auv in order.auvs])
        for auv in order.auvs:
            self._map.assign(auv.leg.path)
        self._plan_sortie(self._mission)
        return [acknowledgement]

    # --- the sortie ------------------------------------------------------------------------------

    def _plan_sortie(self, mission: MissionSpec) -> None:
        legs = self._survey_legs()
        if not legs:
            self._sortie = None
            return
        self._sortie = _Sortie(
            number=self._sorties_flown + 1,
            order=tuple(leg.auv for leg in legs),
            plan=self._planner.plan_sortie(mission, legs, self._now_s),
        )

    def _survey_legs(self) -> tuple[SurveyLeg, ...]:
        return tuple(
            SurveyLeg(auv=name, path=auv.leg.path, surface_deadline_s=auv.leg.surface_deadline_s)
            for name, auv in self._auvs.items()
            if not auv.recovered
        )

    def _decide(self) -> list[Output]:
        """Leave C3 when it is time; go on to the next waypoint when this one is done with."""
        sortie, mission = self._sortie, self._mission
        if sortie is None or mission is None or self._position is None:
            return []
        output: list[Output] = []
        if sortie.departed_s is None:
            if is_before(self._now_s, sortie.plan.depart_s):
                return []
            output += self._depart(sortie, mission)
        output += self._advance(sortie, self._position)
        route = sortie.plan.route
        if self._hand_overs:
            self._driver.go_to(self._position)  # stay in range until the AUV has answered
        elif sortie.cursor < len(route):
            self._driver.go_to(route[sortie.cursor].point)
        else:
            self._driver.go_to(mission.c3)
        return output

    def _depart(self, sortie: _Sortie, mission: MissionSpec) -> list[Output]:
        sortie.departed_s = self._now_s
        points = (mission.c3, *(waypoint.point for waypoint in sortie.plan.route), mission.c3)
        departed = SortieDeparted(
            sortie=sortie.number,
            limit_s=mission.sortie_limit_s,
            predicted_s=sortie.plan.predicted_s,
            worst_case_s=worst_case_s(mission, sortie.plan.route, self._now_s),
            order=sortie.order,
        )
        track = TrackPath(stamp_s=self._now_s, points=points, z_m=self._setup.altitude_m)
        return [Log(departed, self._now_s), Publish(ROUTE, track)]

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
                    sortie.missed.add(waypoint.auv)
                    missed = Missed(sortie=sortie.number, auv=waypoint.auv)
                    output.append(Log(missed, self._now_s))
            sortie.cursor += 1
        return output

    def _is_at(self, point: Point, position: Point) -> bool:
        return position.distance_m(point) <= self._setup.arrival_radius_m

    def _return_to_c3(self) -> list[Output]:
        sortie, mission = self._sortie, self._mission
        if sortie is None or mission is None or self._position is None:
            return []
        if sortie.departed_s is None or sortie.cursor < len(sortie.plan.route):
            return []
        if self._hand_overs or not self._is_at(mission.c3, self._position):
            return []
        self._sorties_flown = sortie.number
        self._undelivered = SortieReport(
            sortie=sortie.number,
            departed_s=sortie.departed_s,
            returned_s=self._now_s,
            meetings=tuple(sortie.meetings),
            missed=tuple(auv for auv in sortie.order if auv in sortie.missed),
            samples=tuple(self._cargo.values()),
        )
        returned = SortieReturned(sortie=sortie.number, duration_s=self._now_s - sortie.departed_s)
        self._plan_sortie(mission)
        return [Log(returned, self._now_s)]

    # --- a meeting -------------------------------------------------------------------------------

    def _hear(self, report: SurfacingReport) -> list[Output]:
        sortie = self._sortie
        if sortie is None or self._auvs[report.auv].recovered:
            return []
        if report.auv in self._hand_overs:
            return self._answer(self._hand_overs[report.auv])  # it missed our answer
        if report.auv in sortie.met:
            return []
        if self._planner.meets_out_of_turn or report.auv == sortie.turn():
            return self._meet(report, sortie)
        self._heard[report.auv] = report
        return []

    def _meet(self, report: SurfacingReport, sortie: _Sortie) -> list[Output]:
        mission, exploration = self._mission, self._map
        if mission is None or exploration is None:
            return []
        leg = self._auvs[report.auv].leg
        problem = _problem_with(report, leg)
        if problem:
            return [self._refuse(report.auv, 'bad_report', problem)]
        output = self._depart(sortie, mission) if sortie.departed_s is None else []
        exploration.confirm(leg.path[1 : report.moves_done + 1])
        exploration.restore(leg.path[report.moves_done + 1 :])
        for sample in report.samples:
            self._cargo[report.auv, sample.number] = RelayedSample(auv=report.auv, sample=sample)
        if exploration.is_explored:
            order = RecoveryOrder(
                auv=report.auv, leg_id=report.leg_id, reason=RecoveryReason.EXPLORED
            )
            hand_over = _HandOver(report=report, answer=order, plan=None)
        else:
            hand_over = self._plan_leg(report, sortie, mission, exploration)
        self._hand_overs[report.auv] = hand_over
        return output + self._answer(hand_over)

    def _plan_leg(
        self,
        report: SurfacingReport,
        sortie: _Sortie,
        mission: MissionSpec,
        exploration: ExplorationMap,
    ) -> _HandOver:
        plan = self._planner.plan_path(
            PlanRequest(
                mission=mission,
                values=exploration.values,
                auv=report.auv,
                cell=report.cell,
                legs=self._survey_legs(),
                met=frozenset(sortie.met),
                now_s=self._now_s,
            )
        )
        exploration.assign(plan.path)
        way = [report.position, *(mission.grid.centre(cell) for cell in plan.path)]
        leg = Leg(
            leg_id=report.leg_id + 1,
            path=plan.path,
            surface_deadline_s=surface_deadline_s(
                self._now_s,
                path_length_m(way),
                self._auvs[report.auv].speed_mps,
                self._surface_margin_s,
                mission.tick_s,
            ),
        )
        return _HandOver(report=report, answer=PathAssignment(auv=report.auv, leg=leg), plan=plan)

    def _answer(self, hand_over: _HandOver) -> list[Output]:
        report = hand_over.report
        custody = Acknowledgement(
            acknowledges=Acknowledged.SURFACING_REPORT, reference=report.leg_id
        )
        return [Transmit(report.auv, custody), Transmit(report.auv, hand_over.answer)]

    def _acknowledged(self, src: str, message: Acknowledgement) -> list[Output]:
        match message.acknowledges:
            case Acknowledged.SORTIE_REPORT if src == self._setup.c3:
                self._delivered(message.reference)
            case Acknowledged.PATH_ASSIGNMENT | Acknowledged.RECOVERY_ORDER:
                return self._handed_over(src, message.reference)
        return []

    def _handed_over(self, auv: str, reference: int) -> list[Output]:
        sortie, hand_over = self._sortie, self._hand_overs.get(auv)
        if sortie is None or hand_over is None or reference != _reference(hand_over.answer):
            return []  # a late copy
        del self._hand_overs[auv]
        report, plan = hand_over.report, hand_over.plan
        match hand_over.answer:
            case PathAssignment(leg=leg):
                self._auvs[auv].leg = leg
                next_leg: Leg | None = leg
            case _:
                self._auvs[auv].recovered = True
                next_leg = None
        sortie.met.add(auv)
        sortie.missed.discard(auv)
        sortie.meetings.append(
            Meeting(
                auv=auv,
                time_s=self._now_s,
                cell=report.cell,
                ended_leg_id=report.leg_id,
                outcome=report.outcome,
                next_leg=next_leg,
            )
        )
        met = Met(
            sortie=sortie.number,
            auv=auv,
            cell=report.cell,
            leg_id=report.leg_id,
            path=next_leg.path if next_leg else (),
            slack_s=plan.slack_s if plan else None,
            sortie_time_s=plan.sortie_time_s if plan else None,
            plan_status=plan.status.value if plan else None,
        )
        output: list[Output] = [Log(met, self._now_s)]
        waiting = self._heard.pop(sortie.turn() or '', None)
        return output + self._hear(waiting) if waiting else output

    def _delivered(self, sortie_number: int) -> None:
        if self._undelivered is None or sortie_number != self._undelivered.sortie:
            return
        for relayed in self._undelivered.samples:
            self._cargo.pop((relayed.auv, relayed.sample.number), None)
        self._undelivered = None

    def _refuse(self, sender: str, reason: str, detail: str) -> Output:
        return Log(MessageRefused(sender=sender, reason=reason, detail=detail), self._now_s)


def _reference(answer: PathAssignment | RecoveryOrder) -> int:
    return answer.leg.leg_id if isinstance(answer, PathAssignment) else answer.leg_id


def _problem_with(report: SurfacingReport, leg: Leg) -> str | None:
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
    return None
