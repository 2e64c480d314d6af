"""A UAV on the bench: two AUVs that a test speaks for, a planner that is easy to foresee."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable
from dataclasses import replace

import msgspec
import pytest

from msgs_json.agent import Log, Output, Publish, Refuse, Transmit
from msgs_json.codec import Refusal
from msgs_json.custody import SampleCustody
from msgs_json.drivers import (
    NoPorts,
    UavDriver,
    UavDriverSetup,
    VehicleState,
    VehicleUnavailableError,
)
from msgs_json.geometry import Cell, GridSpec, Point
from msgs_json.messages import (
    Acknowledged,
    Acknowledgement,
    AuvOrder,
    Event,
    Leg,
    LegOutcome,
    Message,
    MissionOrder,
    PathAssignment,
    RecoveryOrder,
    Sample,
    SampleBatch,
    SampleReceipt,
    SampleSpan,
    SortieDeparted,
    SortieReport,
    SortieReturned,
    SurfacingReport,
)
from msgs_json.ros_messages import Odometry
from msgs_json.store import MemoryStore
from msgs_json.straight_motion import STILL, Flow
from uav_planner.drivers.kinematic import make_driver
from uav_planner.mission_order import UavSetup
from uav_planner.planning import (
    Planner,
    PlanRequest,
    PlanResult,
    PlanStatus,
    SortiePlan,
    SortieRequest,
)
from uav_planner.sortie import flight_time_s, lay_route, punctual_departure_s, worst_case_s
from uav_planner.uav_agent import UavAgent

# Two AUVs on a strip of 6 x 2 cells; C3 lies in its south-west corner. The UAV flies 5 m a tick
# and hears 5 m far, so it is at most 5 m from the centre of a cell that it clears.
REGION = GridSpec(cols=6, rows=2, cell_m=10.0)
C3 = Point(east_m=0.0, north_m=0.0)
SETUP = UavSetup(c3='c3', speed_mps=5.0, altitude_m=30.0, tick_s=1.0, arrival_radius_m=0.0)
PATHS: dict[str, tuple[Cell, ...]] = {'auv_1': ((1, 0), (2, 0)), 'auv_2': ((4, 0), (5, 0))}


FRAME_BYTES = 1_048_576
"""All samples of a test fit into a frame of that length."""

BOTH_KINDS = pytest.mark.parametrize(
    'guarantees_limit', [False, True], ids=['as_in_the_paper', 'with_a_guarantee']
)
"""Of planners."""


class OneStep(Planner):
    """Plans sorties as ECC 2009 does; every path is one cell to the east, or to the west."""

    def __init__(self, *, guarantees_limit: bool = False) -> None:
        self.guarantees_limit = guarantees_limit
        self.requests: list[PlanRequest] = []

    def plan_path(self, request: PlanRequest) -> PlanResult:
        self.requests.append(replace(request, values=request.values.copy()))
        col, row = request.cell
        path = (request.cell, (col + 1 if col + 1 < REGION.cols else col - 1, row))
        return PlanResult(status=PlanStatus.OK, path=path, slack_s=7.0, sortie_time_s=9.0)

    def plan_sortie(self, request: SortieRequest) -> SortiePlan:
        mission = request.mission
        route = lay_route(mission, request.legs)
        depart_s = punctual_departure_s(mission, route, request.now_s)
        return SortiePlan(
            route=route,
            depart_s=depart_s,
            predicted_s=flight_time_s(mission, route),
            worst_case_s=worst_case_s(mission, route, depart_s),
        )


class Bench:
    """
    A UAV in the air, driven second by second; its store is written after each input.

    Before the inputs of the numbers in ``crashes``, counted from 0, it is restarted.
    """

    def __init__(
        self,
        planner: Planner | None = None,
        driver: UavDriver | None = None,
        setup: UavSetup = SETUP,
        frame_bytes: int = FRAME_BYTES,
        crashes: Container[int] = (),
        store: MemoryStore | None = None,
    ) -> None:
        self.planner = planner or OneStep()
        self.now_s = -1.0
        self.here = C3
        self.store = store or MemoryStore()
        self._driver = driver or vehicle()
        self._setup = setup
        self._frame_bytes = frame_bytes
        self._crashes = crashes
        self.outputs: list[list[Output]] = []
        """What came of each input."""
        self.agent = self._begin()

    def restart(self) -> None:
        """Throw the agent away; what it has not stored is lost. Its vehicle flies on."""
        self.store = self.store.reopened()
        self.agent = self._begin()

    def _begin(self) -> UavAgent:
        custody = SampleCustody(self.store, self._frame_bytes, response_s=0.0)
        return UavAgent('uav', self._setup, self.planner, self._driver, self.store, custody)

    def tick(self, seconds: int = 1) -> list[Output]:
        """Let time pass; return all that came of it."""
        output: list[Output] = []
        for _ in range(seconds):
            self.now_s += 1.0
            shown = self._put_in(lambda agent: agent.tick(self.now_s))
            for each in shown:
                if isinstance(each, Publish) and isinstance(each.message, Odometry):
                    self.here = each.message.position
            output += shown
        return output

    def until(self, kind: type[Event], *, at_most_s: int = 200) -> list[Output]:
        """Let time pass until something happens; return all that came of it."""
        output: list[Output] = []
        for _ in range(at_most_s):
            output += self.tick()
            if of(kind, events(output)):
                return output
        raise AssertionError(f'no {kind.__name__} within {at_most_s} s')

    def home(self, **legs: int) -> tuple[list[Output], SortieReport]:
        """
        Fly the sortie to its end; return all that came of it and its report, acknowledged.

        AUVs named in ``legs`` are heard all the time from its departure on, at the end of a leg.
        """
        output = self.until(SortieDeparted) if legs else []
        for _ in range(200):
            for auv, leg_id in legs.items():
                output += self.meet(auv, leg_id)
            output += self.tick()
            if of(SortieReturned, events(output)):
                break
        (delivered,) = (body for body in said(output, 'c3') if isinstance(body, SortieReport))
        return [*output, *self.deliver(output)], delivered

    def deliver(self, output: list[Output]) -> list[Output]:
        """Let C3 take what is said to it; return what came of that."""
        answers: list[Output] = []
        for body in said(output, 'c3'):
            match body:
                case SortieReport(sortie=sortie):
                    answers += self.hear('c3', taken(Acknowledged.SORTIE_REPORT, sortie))
                case SampleBatch(samples=samples):
                    answers += self.hear('c3', receipt(samples))
        return answers

    def hear(self, src: str, message: Message) -> list[Output]:
        return self._put_in(lambda agent: agent.receive(src, message, self.now_s))

    def plan_ahead(self) -> list[Output]:
        """Let the UAV do all that it is busy with; return what it says meanwhile."""
        output: list[Output] = []
        while self.agent.is_busy:
            output += self._put_in(lambda agent: agent.work(self.now_s))
        return output

    def _put_in(self, give: Callable[[UavAgent], list[Output]]) -> list[Output]:
        if len(self.outputs) in self._crashes:
            self.restart()
        self.outputs.append(give(self.agent))
        self.store.commit()
        return self.outputs[-1]

    def ordered(self, **changes: object) -> Bench:
        self.tick()
        self.hear('c3', order(**changes))
        return self

    def meet(
        self, auv: str, leg_id: int = 0, *, acknowledges: bool = True, **changes: object
    ) -> list[Output]:
        """Let an AUV report and, if it is to, acknowledge what it is told."""
        output = self.hear(auv, report(auv, leg_id, **changes))
        if acknowledges:
            for body in said(output, auv):
                match body:
                    case PathAssignment(leg=leg):
                        output += self.hear(auv, taken(Acknowledged.PATH_ASSIGNMENT, leg.leg_id))
                    case RecoveryOrder():
                        output += self.hear(auv, taken(Acknowledged.RECOVERY_ORDER, leg_id))
        return output

    def position(self) -> Point:
        """Return where the UAV is a second later."""
        self.tick()
        return self.here


def vehicle(*, speed_mps: float = 5.0, wind: Flow = STILL) -> UavDriver:
    """Return the UAV's vehicle; the agent believes that it makes 5 m/s."""
    setup = UavDriverSetup(name='uav', home=C3, speed_mps=speed_mps, altitude_m=30.0, wind=wind)
    return make_driver(setup, NoPorts())


class NotHeard:
    """A vehicle whose state is unknown at one tick."""

    def __init__(self, driver: UavDriver, at_s: float) -> None:
        self._driver = driver
        self._at_s = at_s

    def go_to(self, target: Point) -> None:
        self._driver.go_to(target)

    def step(self, now_s: float) -> VehicleState:
        if now_s == self._at_s:
            raise VehicleUnavailableError('no position')
        return self._driver.step(now_s)


def order(**changes: object) -> MissionOrder:
    base = MissionOrder(
        mission_id='strip',
        region=REGION,
        c3=C3,
        radio_range_m=5.0,
        sortie_limit_s=100.0,
        path_cells=1,
        min_path_cells=1,
        surface_margin_s=0.0,
        handover_s=0.0,
        lost_after_sorties=3,
        auvs=tuple(auv_order(name, path) for name, path in PATHS.items()),
    )
    return msgspec.structs.replace(base, **changes)


def auv_order(name: str, path: tuple[Cell, ...], surface_deadline_s: float = 10.0) -> AuvOrder:
    leg = Leg(leg_id=0, path=path, surface_deadline_s=surface_deadline_s)
    return AuvOrder(name=name, speed_mps=1.0, leg=leg)


def cells_of(auv: str, leg_id: int) -> tuple[Cell, Cell]:
    """Return the path of an AUV's leg as `OneStep` plans it: there, on, and back."""
    path = PATHS[auv]
    for _ in range(leg_id):
        col, row = path[-1]
        path = (path[-1], (col + 1 if col + 1 < REGION.cols else col - 1, row))
    return path[0], path[1]


def report(auv: str, leg_id: int = 0, **changes: object) -> SurfacingReport:
    """Return an honest report of a leg that was completed, with the samples of that leg."""
    path = cells_of(auv, leg_id)
    entered = path if leg_id == 0 else path[1:]
    first = 0 if leg_id == 0 else leg_id + 1
    samples = tuple(
        Sample(auv=auv, number=number, cell=cell, entered_s=0.0, value=1.0)
        for number, cell in enumerate(entered, first)
    )
    base = SurfacingReport(
        auv=auv,
        leg_id=leg_id,
        outcome=LegOutcome.COMPLETED,
        moves_done=1,
        cell=path[-1],
        position=REGION.centre(path[-1]),
        surfaced_s=10.0,
        samples_taken=first + len(entered),
        samples=samples,
    )
    if changes.get('samples') == ():
        changes['samples_taken'] = 0
    return msgspec.structs.replace(base, **changes)


def taken(what: Acknowledged, reference: int) -> Acknowledgement:
    return Acknowledgement(acknowledges=what, reference=reference)


def receipt(samples: Iterable[Sample]) -> SampleReceipt:
    """Return C3's word that it has samples."""
    return SampleReceipt(
        held=(),
        at_c3=tuple(
            SampleSpan(auv=each.auv, first=each.number, until=each.number + 1) for each in samples
        ),
    )


def said(output: list[Output], dst: str) -> list[Message]:
    return [each.body for each in output if isinstance(each, Transmit) and each.dst == dst]


def events(output: list[Output]) -> list[Event]:
    return [each.event for each in output if isinstance(each, Log)]


def stamps_of(kind: type[Event], output: list[Output]) -> list[float]:
    logs = (each for each in output if isinstance(each, Log))
    return [each.stamp_s for each in logs if isinstance(each.event, kind)]


def of(kind: type[Event], some: list[Event]) -> list[Event]:
    return [event for event in some if isinstance(event, kind)]


def duration_s(output: list[Output]) -> float:
    (returned,) = of(SortieReturned, events(output))
    assert isinstance(returned, SortieReturned)
    return returned.duration_s


def refused(output: list[Output]) -> tuple[str, Refusal]:
    (refuse,) = output
    assert isinstance(refuse, Refuse)
    return refuse.sender, refuse.refusal


def path_handed_over(output: list[Output], auv: str) -> Leg:
    receipt, assignment = said(output, auv)
    assert isinstance(receipt, SampleReceipt)
    assert isinstance(assignment, PathAssignment)
    assert assignment.auv == auv
    return assignment.leg


def brought(bench: Bench) -> set[tuple[str, int]]:
    """Return the samples that C3 was told: AUV and number."""
    return {
        (sample.auv, sample.number)
        for output in bench.outputs
        for body in said(output, 'c3')
        if isinstance(body, SampleBatch)
        for sample in body.samples
    }
