from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given
from msgspec import structs

from auv_sim.auv_agent import AuvAgent, AuvMission
from auv_sim.drivers.kinematic import KinematicAuv
from msgs_json.agent import Log, Output, Publish, Refuse, Transmit
from msgs_json.codec import Refusal
from msgs_json.custody import SampleCustody, samples_per_frame
from msgs_json.drivers import (
    AuvDriverSetup,
    AuvState,
    CommandRefusedError,
    VehicleUnavailableError,
)
from msgs_json.geometry import Cell, GridSpec, Point
from msgs_json.messages import (
    Acknowledged,
    Acknowledgement,
    CellEntered,
    Dived,
    Event,
    Leg,
    LegOutcome,
    Message,
    PathAssignment,
    RecoveryOrder,
    RecoveryReason,
    Sample,
    SampleBatch,
    SampleReceipt,
    SampleSpan,
    StayedUp,
    Surfaced,
    SurfacingReport,
)
from msgs_json.ros_messages import Odometry, TrackPath
from msgs_json.store import MemoryStore
from msgs_json.topics import ODOM, PATH

FRAME_BYTES = 1400
PER_FRAME = samples_per_frame(FRAME_BYTES)
REGION = GridSpec(cols=4, rows=3, cell_m=10.0, masked=((3, 2),))


class Eastings:
    """A field whose value at a place is its easting."""

    def sample(self, point: Point) -> float:
        return point.east_m


class StubbornAuv(KinematicAuv):
    """Takes its first leg and no other."""

    legs = 0

    def follow(self, waypoints: Sequence[Point]) -> None:
        self.legs += 1
        if self.legs > 1:
            raise CommandRefusedError('the thruster is broken')
        super().follow(waypoints)


class FaintAuv(KinematicAuv):
    """Is not heard of once, right after it came up as it was told to."""

    surfacings = 0

    def surface(self) -> None:
        super().surface()
        self.surfacings += 1

    def step(self, now_s: float) -> AuvState:
        if self.surfacings == 1:
            self.surfacings += 1
            raise VehicleUnavailableError('no link')
        return super().step(now_s)


class SluggishAuv(KinematicAuv):
    """Needs some seconds to come up."""

    told = 0

    def surface(self) -> None:
        self.told += 1
        if self.told > 3:
            super().surface()


class RisingAuv(KinematicAuv):
    """Is up three seconds after it was told to come up."""

    now_s = 0.0
    up_s = math.inf

    def follow(self, waypoints: Sequence[Point]) -> None:
        super().follow(waypoints)
        self.up_s = math.inf

    def surface(self) -> None:
        self.up_s = min(self.up_s, self.now_s + 3.0)

    def step(self, now_s: float) -> AuvState:
        self.now_s = now_s
        if now_s >= self.up_s:
            super().surface()
        return super().step(now_s)


class Bench:
    """An AUV in its water, driven second by second."""

    def __init__(
        self,
        *,
        path: tuple[Cell, ...] = ((0, 0), (1, 0)),
        surfacing: str = '{"model": "on_time"}',
        real_speed_mps: float = 1.0,
        vehicle: Callable[[AuvDriverSetup], KinematicAuv] = KinematicAuv,
        seed: int = 1,
    ) -> None:
        self.driver = vehicle(
            AuvDriverSetup(
                name='auv_1',
                start=REGION.centre(path[0]),
                speed_mps=real_speed_mps,
                depth_m=5.0,
                surfacing=surfacing,
                rng=np.random.default_rng(seed),
            )
        )
        self.mission = AuvMission(
            region=REGION,
            uav='uav',
            speed_mps=1.0,
            depth_m=5.0,
            initial_path=path,
            surface_margin_s=0.0,
            tick_s=1.0,
        )
        self.store = MemoryStore()
        self.agent = self.make_agent()
        self.now_s = -1.0
        self.last: SurfacingReport | None = None
        """What it said last."""

    def make_agent(self) -> AuvAgent:
        custody = SampleCustody(self.store, FRAME_BYTES, response_s=0.0)
        return AuvAgent('auv_1', self.mission, self.driver, Eastings(), self.store, custody)

    def restart(self) -> None:
        """Have another process go on, with the same vehicle."""
        self.store = self.store.reopened()
        self.agent = self.make_agent()

    def tick(self, seconds: int = 1) -> list[Output]:
        """Let time pass; return what came of the last second."""
        output: list[Output] = []
        for _ in range(seconds):
            self.now_s += 1.0
            output = self.agent.tick(self.now_s)
            self.store.commit()
            for body in said(output):
                if isinstance(body, SurfacingReport):
                    self.last = body
        return output

    def hear(self, message: Message) -> list[Output]:
        output = self.agent.receive('uav', message, self.now_s)
        self.store.commit()
        return output

    def relieve(self, first: int, until: int) -> list[Output]:
        """Have the UAV say that it holds some samples."""
        return self.hear(SampleReceipt(held=(span(first, until),), at_c3=()))

    def follow_on(self) -> list[Output]:
        """Assign a leg that begins where the last one ended, as far as is known."""
        if self.last is None:
            return []
        col, row = self.last.cell
        return self.assign(self.last.leg_id + 1, (col, row), (col ^ 1, row))

    def assign(self, leg_id: int, *path: Cell, seconds: float = 100.0) -> list[Output]:
        return self.hear(assignment(leg_id, *path, deadline_s=self.now_s + seconds))


def assignment(leg_id: int, *path: Cell, deadline_s: float = 1e6) -> PathAssignment:
    leg = Leg(leg_id=leg_id, path=path, surface_deadline_s=deadline_s)
    return PathAssignment(auv='auv_1', leg=leg)


def span(first: int, until: int) -> SampleSpan:
    return SampleSpan(auv='auv_1', first=first, until=until)


def keys(spans: Sequence[SampleSpan]) -> set[int]:
    return {number for each in spans for number in range(each.first, each.until)}


def recovery(leg_id: int) -> RecoveryOrder:
    return RecoveryOrder(auv='auv_1', leg_id=leg_id, reason=RecoveryReason.EXPLORED)


def said(output: list[Output]) -> list[Message]:
    assert all(each.dst == 'uav' for each in output if isinstance(each, Transmit))
    return [each.body for each in output if isinstance(each, Transmit)]


def report(output: list[Output]) -> SurfacingReport:
    (body,) = said(output)
    assert isinstance(body, SurfacingReport)
    return body


def events(output: list[Output]) -> list[Event]:
    return [each.event for each in output if isinstance(each, Log)]


def refused(output: list[Output]) -> Refusal:
    (refuse,) = output
    assert isinstance(refuse, Refuse)
    assert refuse.sender == 'uav'
    return refuse.refusal


def taken(leg_id: int, what: Acknowledged = Acknowledged.PATH_ASSIGNMENT) -> Acknowledgement:
    return Acknowledgement(acknowledges=what, reference=leg_id)


# --- a leg ---------------------------------------------------------------------------------------


def test_it_dives_at_once_and_samples_its_start() -> None:
    output = Bench().tick()
    assert events(output) == [
        Dived(leg_id=0, path=((0, 0), (1, 0)), surface_deadline_s=10.0),
        CellEntered(cell=(0, 0), sample_number=0),
    ]
    shown = {each.topic: each.message for each in output if isinstance(each, Publish)}
    odometry, track = shown[ODOM], shown[PATH]
    assert isinstance(odometry, Odometry)
    assert odometry.z_m == -5.0
    assert odometry.stamp_s == 0.0
    assert isinstance(track, TrackPath)
    assert track.points == (REGION.centre((0, 0)), REGION.centre((1, 0)))
    assert track.z_m == -5.0


def test_under_water_it_says_nothing() -> None:
    bench = Bench()
    assert [said(bench.tick()) for _ in range(10)] == [[]] * 10


def test_it_surfaces_at_the_end_of_its_path_and_reports_it() -> None:
    bench = Bench()
    output = bench.tick(11)
    assert events(output) == [
        CellEntered(cell=(1, 0), sample_number=1),
        Surfaced(leg_id=0, outcome=LegOutcome.COMPLETED, cell=(1, 0)),
    ]
    found = report(output)
    assert (found.leg_id, found.outcome, found.moves_done) == (0, LegOutcome.COMPLETED, 1)
    assert (found.cell, found.position) == ((1, 0), REGION.centre((1, 0)))
    assert found.surfaced_s == 10.0
    assert [(s.number, s.cell, s.entered_s, s.value) for s in found.samples] == [
        (0, (0, 0), 0.0, 5.0),
        (1, (1, 0), 10.0, 15.0),
    ]


def test_the_report_is_repeated_as_it_was_and_logged_once() -> None:
    bench = Bench()
    first = report(bench.tick(11))
    for _ in range(5):
        output = bench.tick()
        assert report(output) == first
        assert events(output) == []


def test_a_slow_auv_surfaces_at_its_deadline_between_two_cells() -> None:
    bench = Bench(path=((0, 0), (1, 0), (2, 0)), real_speed_mps=0.75)
    found = report(bench.tick(21))  # the deadline is 20 s: 15 m of 20
    assert (found.outcome, found.moves_done, found.cell) == (LegOutcome.DEADLINE, 1, (1, 0))
    assert found.position == Point(east_m=20.0, north_m=5.0)
    assert [sample.cell for sample in found.samples] == [(0, 0), (1, 0)]


def test_a_failure_while_it_comes_up_at_its_deadline_does_not_make_it_early() -> None:
    path = ((0, 0), (1, 0), (2, 0))
    bench = Bench(path=path, real_speed_mps=0.75, vehicle=FaintAuv)
    bench.tick(20)
    with pytest.raises(VehicleUnavailableError):
        bench.tick()
    assert report(bench.tick()).outcome is LegOutcome.DEADLINE


def test_from_between_two_cells_the_next_leg_first_goes_back_to_the_last_cell() -> None:
    bench = Bench(path=((0, 0), (1, 0), (2, 0)), real_speed_mps=0.75)
    bench.tick(21)
    bench.relieve(0, 2)
    bench.assign(1, (1, 0), (1, 1))
    assert said(bench.tick(19)) == []
    found = report(bench.tick())  # 5 m back and 10 m on, at 0.75 m/s
    assert (found.outcome, found.moves_done, found.cell) == (LegOutcome.COMPLETED, 1, (1, 1))
    # P_0 was entered on the leg before: no second sample.
    assert [(sample.number, sample.cell) for sample in found.samples] == [(2, (1, 1))]


def test_an_auv_that_comes_up_by_itself_reports_early() -> None:
    bench = Bench(
        path=((0, 0), (1, 0), (2, 0), (3, 0)), surfacing='{"model": "early", "probability": 1.0}'
    )
    output = bench.tick(2)
    while not said(output):
        output = bench.tick()
    found = report(output)
    assert found.outcome is LegOutcome.EARLY
    assert found.cell == (found.moves_done, 0)
    assert found.moves_done < 3
    assert len(found.samples) == found.moves_done + 1


def test_it_reports_no_sooner_than_it_is_up() -> None:
    bench = Bench(vehicle=SluggishAuv)
    for _ in range(13):
        output = bench.tick()
        assert said(output) == []
        assert not any(isinstance(event, Surfaced) for event in events(output))
    output = bench.tick()
    assert events(output) == [Surfaced(leg_id=0, outcome=LegOutcome.COMPLETED, cell=(1, 0))]
    assert report(output).surfaced_s == 13.0


# --- distress ------------------------------------------------------------------------------------

THREE_CELLS = ((0, 0), (1, 0), (2, 0))


def test_an_auv_that_needs_help_comes_up_between_two_cells_and_says_so() -> None:
    bench = Bench(path=THREE_CELLS, surfacing='{"model": "abort", "at_s": 14}')
    output = bench.tick(15)
    assert events(output) == [Surfaced(leg_id=0, outcome=LegOutcome.ABORTED, cell=(1, 0))]
    found = report(output)
    assert (found.outcome, found.moves_done, found.cell) == (LegOutcome.ABORTED, 1, (1, 0))
    assert (found.position, found.surfaced_s) == (Point(east_m=19.0, north_m=5.0), 14.0)
    assert len(found.samples) == 2


def test_it_needs_help_even_if_it_has_just_completed_its_path() -> None:
    bench = Bench(surfacing='{"model": "abort", "at_s": 10}')
    found = report(bench.tick(11))
    assert (found.outcome, found.moves_done) == (LegOutcome.ABORTED, 1)


def test_a_fault_at_the_surface_changes_the_report_and_nothing_else() -> None:
    bench = Bench(surfacing='{"model": "abort", "at_s": 14}')
    before = report(bench.tick(14))
    assert before.outcome is LegOutcome.COMPLETED
    output = bench.tick()
    assert report(output) == structs.replace(before, outcome=LegOutcome.ABORTED)
    assert events(output) == []
    assert report(bench.tick()).outcome is LegOutcome.ABORTED


def test_an_auv_that_needs_help_takes_no_path_and_stays_up_when_told_so() -> None:
    bench = Bench(path=THREE_CELLS, surfacing='{"model": "abort", "at_s": 14}')
    before = report(bench.tick(15))
    assert refused(bench.assign(1, (1, 0), (2, 0))) is Refusal.NOT_POSSIBLE
    assert report(bench.tick()) == before
    order = RecoveryOrder(auv='auv_1', leg_id=0, reason=RecoveryReason.ABORTED)
    output = bench.hear(order)
    assert said(output) == [taken(0, Acknowledged.RECOVERY_ORDER)]
    assert events(output) == [StayedUp(reason=RecoveryReason.ABORTED)]
    (odometry,) = bench.tick(50)
    assert isinstance(odometry, Publish)
    assert isinstance(odometry.message, Odometry)
    assert odometry.message.z_m == 0.0


def test_a_fault_with_the_first_dive_is_reported_too() -> None:
    output = Bench(surfacing='{"model": "abort", "at_s": 0}').tick()
    found = report(output)
    assert (found.outcome, found.moves_done, found.cell) == (LegOutcome.ABORTED, 0, (0, 0))


def test_a_lost_auv_is_not_heard_of_again() -> None:
    bench = Bench(path=THREE_CELLS, surfacing='{"model": "lost", "from_s": 14}')
    bench.tick(14)
    for _ in range(100):
        (odometry,) = bench.tick()
        assert isinstance(odometry, Publish)
        assert isinstance(odometry.message, Odometry)
        assert odometry.message.z_m == -5.0


# --- custody -------------------------------------------------------------------------------------


def numbers(samples: Sequence[Sample]) -> list[int]:
    assert all(sample.auv == 'auv_1' for sample in samples)
    return [sample.number for sample in samples]


def test_samples_that_the_uav_holds_are_not_said_again() -> None:
    bench = Bench()
    assert numbers(report(bench.tick(11)).samples) == [0, 1]
    assert bench.relieve(0, 2) == []
    assert report(bench.tick()).samples == ()
    assert report(bench.tick()).samples_taken == 2


def test_samples_that_nobody_holds_come_with_the_next_report() -> None:
    bench = Bench()
    bench.tick(11)
    bench.assign(1, (1, 0), (2, 0))  # the receipt before it was lost
    assert numbers(report(bench.tick(10)).samples) == [0, 1, 2]


def test_the_uav_may_hold_any_of_them() -> None:
    bench = Bench()
    bench.tick(11)
    bench.relieve(1, 2)
    assert numbers(report(bench.tick()).samples) == [0]


def test_what_is_at_c3_is_forgotten() -> None:
    bench = Bench()
    bench.tick(11)
    bench.hear(SampleReceipt(held=(), at_c3=(span(0, 1),)))
    bench.restart()
    assert numbers(report(bench.tick()).samples) == [1]


def test_what_the_uav_holds_is_not_forgotten() -> None:
    bench = Bench()
    bench.tick(11)
    bench.relieve(0, 2)
    bench.restart()
    assert numbers(report(bench.tick()).samples) == [0, 1]


TEN_CELLS = (*((0, 0), (1, 0), (2, 0), (3, 0), (3, 1), (2, 1), (1, 1), (0, 1), (0, 2), (1, 2)),)


def test_what_does_not_fit_into_the_report_goes_in_batches_while_the_uav_listens() -> None:
    bench = Bench(path=TEN_CELLS)
    first = report(bench.tick(91))
    assert (numbers(first.samples), first.samples_taken) == (list(range(PER_FRAME)), 10)
    (batch,) = said(bench.relieve(0, PER_FRAME))
    assert isinstance(batch, SampleBatch)
    assert numbers(batch.samples) == list(range(PER_FRAME, 10))
    # Nothing is said twice at a time: the answer may be on its way.
    assert bench.relieve(0, PER_FRAME) == []
    assert numbers(report(bench.tick()).samples) == list(range(PER_FRAME, 10))


def test_a_receipt_under_water_is_noted_and_not_answered() -> None:
    # At sea it was on its way when the AUV dived.
    bench = Bench()
    bench.tick(11)
    bench.assign(1, (1, 0), (2, 0))
    assert bench.relieve(0, 1) == []
    assert numbers(report(bench.tick(10)).samples) == [1, 2]


def test_with_its_last_path_done_it_is_still_relieved() -> None:
    bench = Bench()
    bench.tick(11)
    bench.hear(recovery(0))
    bench.tick()
    (batch,) = said(bench.relieve(0, 1))
    assert isinstance(batch, SampleBatch)
    assert numbers(batch.samples) == [1]


# --- the next leg --------------------------------------------------------------------------------


def test_it_takes_its_next_leg_and_dives() -> None:
    bench = Bench()
    bench.tick(11)
    output = bench.assign(1, (1, 0), (2, 0), (2, 1), seconds=20.0)
    assert said(output) == [taken(1)]
    assert events(output) == [
        Dived(leg_id=1, path=((1, 0), (2, 0), (2, 1)), surface_deadline_s=30.0)
    ]
    assert said(bench.tick()) == []


@pytest.mark.parametrize('leg_id', [0, 1])
def test_a_repeated_or_late_assignment_is_acknowledged_but_not_swum_again(leg_id: int) -> None:
    bench = Bench()
    bench.tick(11)
    bench.assign(1, (1, 0), (2, 0))
    bench.tick(5)
    assert bench.assign(leg_id, (1, 0), (1, 1)) == [Transmit('uav', taken(leg_id))]
    assert report(bench.tick(5)).cell == (2, 0)
    assert bench.assign(leg_id, (1, 0), (1, 1)) == [Transmit('uav', taken(leg_id))]
    assert report(bench.tick()).leg_id == 1


def test_an_assignment_under_way_is_refused() -> None:
    bench = Bench()
    bench.tick(5)
    assert refused(bench.assign(1, (0, 0), (0, 1))) is Refusal.UNEXPECTED
    assert report(bench.tick(6)).cell == (1, 0)


def test_an_assignment_before_the_first_tick_is_refused() -> None:
    bench = Bench()
    assert refused(bench.hear(assignment(1, (0, 0), (0, 1)))) is Refusal.UNEXPECTED


@pytest.mark.parametrize(
    'path',
    [
        ((0, 0), (0, 1)),
        ((2, 0), (3, 0)),
        ((1, 0), (1, 1), (1, 2), (1, 3)),
        ((1, 0), (1, 1), (1, 2), (2, 2), (3, 2)),
    ],
    ids=['from_elsewhere', 'from_ahead', 'out_of_the_region', 'through_land'],
)
def test_a_leg_that_cannot_be_is_refused_and_the_auv_stays_up(path: tuple[Cell, ...]) -> None:
    bench = Bench()
    before = report(bench.tick(11))
    assert refused(bench.assign(1, *path)) is Refusal.CONTRADICTORY
    assert report(bench.tick()) == before


@pytest.mark.parametrize('seconds', [-5.0, 0.0])
def test_a_leg_whose_deadline_is_past_is_not_begun(seconds: float) -> None:
    # It could only leave the cell where the UAV will look for it.
    bench = Bench()
    before = report(bench.tick(11))
    assert refused(bench.assign(1, (1, 0), (2, 0), seconds=seconds)) is Refusal.CONTRADICTORY
    assert report(bench.tick()) == before


def test_a_leg_that_the_vehicle_refuses_is_not_acknowledged() -> None:
    bench = Bench(vehicle=StubbornAuv)
    before = report(bench.tick(11))
    assert refused(bench.assign(1, (1, 0), (2, 0))) is Refusal.NOT_POSSIBLE
    assert report(bench.tick()) == before


# --- the end -------------------------------------------------------------------------------------


def test_up_for_recovery_it_stays_up_and_says_no_more() -> None:
    bench = Bench()
    bench.tick(11)
    output = bench.hear(recovery(0))
    assert said(output) == [taken(0, Acknowledged.RECOVERY_ORDER)]
    assert events(output) == [StayedUp(reason=RecoveryReason.EXPLORED)]
    assert bench.agent.finished
    (odometry,) = bench.tick()
    assert isinstance(odometry, Publish)
    assert odometry.topic is ODOM


def test_a_repeated_recovery_order_is_acknowledged_and_not_logged_again() -> None:
    bench = Bench()
    bench.tick(11)
    bench.hear(recovery(0))
    assert bench.hear(recovery(0)) == [Transmit('uav', taken(0, Acknowledged.RECOVERY_ORDER))]


def test_up_for_recovery_it_takes_no_further_leg() -> None:
    bench = Bench()
    bench.tick(11)
    bench.hear(recovery(0))
    assert refused(bench.assign(1, (1, 0), (2, 0))) is Refusal.UNEXPECTED
    assert said(bench.tick(30)) == []


@pytest.mark.parametrize('seconds', [5, 11])
def test_a_recovery_order_under_way_or_for_another_leg_is_refused(seconds: int) -> None:
    # Obeyed, the AUV would come up with samples and never say so.
    bench = Bench()
    bench.tick(seconds)
    assert refused(bench.hear(recovery(0 if seconds < 11 else 1))) is Refusal.UNEXPECTED
    assert not bench.agent.finished
    assert len(report(bench.tick(11 - seconds or 1)).samples) == 2


def test_other_messages_are_refused() -> None:
    bench = Bench()
    mine = report(bench.tick(11))
    for message in (mine, taken(0), taken(0, Acknowledged.MISSION_ORDER)):
        assert refused(bench.hear(message)) is Refusal.UNEXPECTED


# --- every input in every state ------------------------------------------------------------------

cells = st.tuples(st.integers(0, 4), st.integers(0, 3))
leg_ids = st.integers(0, 4)


@st.composite
def walks(draw: st.DrawFn) -> tuple[Cell, ...]:
    path = [draw(cells)]
    for east, north in draw(
        st.lists(st.sampled_from([(1, 0), (0, 1), (-1, 0), (0, -1)]), min_size=1, max_size=4)
    ):
        path.append((abs(path[-1][0] + east), abs(path[-1][1] + north)))
    return tuple(path)


few_spans = st.lists(st.tuples(st.integers(0, 20), st.integers(1, 8)), max_size=3).map(
    lambda parts: tuple(span(first, first + length) for first, length in parts)
)
receipts = st.builds(SampleReceipt, held=few_spans, at_c3=few_spans)
orders = st.one_of(
    receipts,
    st.builds(Acknowledgement, acknowledges=st.sampled_from(Acknowledged), reference=leg_ids),
    st.tuples(leg_ids, walks(), st.floats(0, 500)).map(
        lambda parts: assignment(parts[0], *parts[1], deadline_s=parts[2])
    ),
    st.builds(recovery, leg_ids),
)
PASS_TIME = st.integers(1, 25)
FOLLOW_ON = st.just('follow on')
"""A well-made next leg, so that the AUV gets around; its custody is sometimes lost."""


inputs_of_any_kind = st.lists(PASS_TIME | FOLLOW_ON | orders, max_size=30)


def give(bench: Bench, step: int | str | Message) -> list[list[Output]]:
    """Give an AUV one input, and return what came of it, second by second."""
    match step:
        case int(seconds):
            return [bench.tick() for _ in range(seconds)]
        case str():
            return [bench.follow_on()]
        case _:
            return [bench.hear(step)]


@given(inputs_of_any_kind, st.integers(0, 5))
def test_whatever_it_hears_it_says_the_oldest_samples_that_nobody_holds(
    inputs: list[int | str | Message], seed: int
) -> None:
    bench = Bench(surfacing='{"model": "early", "probability": 0.5}', seed=seed)
    entered = 0
    held: set[int] = set()
    at_c3: set[int] = set()
    for step in [1, *inputs]:
        if isinstance(step, SampleReceipt):
            held = keys(step.held)
            at_c3 |= keys(step.at_c3)
        for output in give(bench, step):
            entered += sum(isinstance(event, CellEntered) for event in events(output))
            waiting = [number for number in range(entered) if number not in held | at_c3]
            for body in said(output):
                if isinstance(body, SurfacingReport):
                    assert body.samples_taken == entered
                    assert numbers(body.samples) == waiting[:PER_FRAME]
                elif isinstance(body, SampleBatch):
                    assert set(numbers(body.samples)) <= set(waiting)
    kept = keys(SampleCustody(bench.store, FRAME_BYTES, response_s=0.0).spans)
    assert kept == set(range(entered)) - at_c3


# --- another process goes on ---------------------------------------------------------------------


def as_said(output: list[Output]) -> list[Output]:
    """
    Return what is said, shown and logged, but for samples.

    Which ones the UAV holds a new process hears with the next receipt, and says some once more.
    """
    plain: list[Output] = []
    for each in output:
        match each:
            case Transmit(body=SampleBatch()):
                continue
            case Transmit(dst, SurfacingReport() as body):
                plain.append(Transmit(dst, structs.replace(body, samples=())))
            case _:
                plain.append(each)
    return plain


VEHICLES = (KinematicAuv, SluggishAuv, RisingAuv, StubbornAuv)
SURFACINGS = (
    '{"model": "on_time"}',
    '{"model": "early", "probability": 0.5}',
    '{"model": "abort", "at_s": 25}',
)


@given(
    st.lists(st.tuples(PASS_TIME | FOLLOW_ON | orders, st.integers(0, 3)), max_size=20),
    st.sampled_from(VEHICLES),
    st.sampled_from(SURFACINGS),
    st.sampled_from([1.0, 0.75]),
)
def test_a_new_process_does_what_the_one_before_would_have_done(
    inputs: list[tuple[int | str | Message, int]],
    vehicle: type[KinematicAuv],
    surfacing: str,
    real_speed_mps: float,
) -> None:
    def bench() -> Bench:
        return Bench(
            path=THREE_CELLS,
            surfacing=surfacing,
            real_speed_mps=real_speed_mps,
            vehicle=vehicle,
        )

    unharmed, killed = bench(), bench()
    for step, seconds_to_live in [(1, 0), *inputs]:
        if seconds_to_live and isinstance(step, int):
            # It dies within that time, too.
            for _ in range(min(step, seconds_to_live)):
                assert as_said(unharmed.tick()) == as_said(killed.tick())
        killed.restart()
        assert killed.agent.finished == unharmed.agent.finished
        for output, expected in zip(give(killed, step), give(unharmed, step), strict=True):
            assert as_said(output) == as_said(expected)
    for each in (unharmed, killed):
        each.hear(SampleReceipt(held=(), at_c3=(span(0, 1000),)))
    assert unharmed.tick() == killed.tick()


@pytest.mark.parametrize('vehicle', VEHICLES)
@pytest.mark.parametrize('seconds', range(1, 31))
def test_a_leg_is_the_same_with_a_death_at_any_second_of_it(
    seconds: int, vehicle: type[KinematicAuv]
) -> None:
    benches = [Bench(path=THREE_CELLS, real_speed_mps=0.75, vehicle=vehicle) for _ in range(2)]
    unharmed, killed = benches
    for now in range(40):
        if now == seconds:
            killed.restart()
        assert unharmed.tick() == killed.tick()
        if now == 26:
            assert unharmed.follow_on() == killed.follow_on()


def test_up_for_recovery_a_new_process_stays_up() -> None:
    bench = Bench()
    bench.tick(11)
    bench.hear(recovery(0))
    bench.restart()
    assert bench.agent.finished
    assert said(bench.tick()) == []
    assert said(bench.hear(recovery(0))) == [taken(0, Acknowledged.RECOVERY_ORDER)]
