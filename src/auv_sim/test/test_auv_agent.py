from __future__ import annotations

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
    StayedUp,
    Surfaced,
    SurfacingReport,
)
from msgs_json.ros_messages import Odometry, TrackPath
from msgs_json.topics import ODOM, PATH

REGION = GridSpec(cols=4, rows=3, cell_m=10.0, masked=((3, 2),))
CUSTODY = Acknowledged.SURFACING_REPORT


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
        driver = vehicle(
            AuvDriverSetup(
                name='auv_1',
                start=REGION.centre(path[0]),
                speed_mps=real_speed_mps,
                depth_m=5.0,
                surfacing=surfacing,
                rng=np.random.default_rng(seed),
            )
        )
        mission = AuvMission(
            region=REGION,
            uav='uav',
            speed_mps=1.0,
            depth_m=5.0,
            initial_path=path,
            surface_margin_s=0.0,
            tick_s=1.0,
        )
        self.agent = AuvAgent('auv_1', mission, driver, Eastings())
        self.now_s = -1.0

    def tick(self, seconds: int = 1) -> list[Output]:
        """Let time pass; return what came of the last second."""
        output: list[Output] = []
        for _ in range(seconds):
            self.now_s += 1.0
            output = self.agent.tick(self.now_s)
        return output

    def hear(self, message: Message) -> list[Output]:
        return self.agent.receive('uav', message, self.now_s)

    def acknowledge(self, leg_id: int) -> list[Output]:
        return self.hear(Acknowledgement(acknowledges=CUSTODY, reference=leg_id))

    def assign(self, leg_id: int, *path: Cell, seconds: float = 100.0) -> list[Output]:
        return self.hear(assignment(leg_id, *path, deadline_s=self.now_s + seconds))


def assignment(leg_id: int, *path: Cell, deadline_s: float = 1e6) -> PathAssignment:
    leg = Leg(leg_id=leg_id, path=path, surface_deadline_s=deadline_s)
    return PathAssignment(auv='auv_1', leg=leg)


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
    bench.acknowledge(0)
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


def test_acknowledged_samples_are_not_said_again() -> None:
    bench = Bench()
    assert len(report(bench.tick(11)).samples) == 2
    assert bench.acknowledge(0) == []
    assert report(bench.tick()).samples == ()


def test_samples_that_nobody_acknowledged_come_with_the_next_report() -> None:
    bench = Bench()
    bench.tick(11)
    bench.assign(1, (1, 0), (2, 0))  # the acknowledgement before it was lost
    assert [sample.number for sample in report(bench.tick(10)).samples] == [0, 1, 2]


@pytest.mark.parametrize('leg_id', [0, 2])
def test_custody_of_another_leg_relieves_it_of_nothing(leg_id: int) -> None:
    bench = Bench()
    bench.tick(11)
    bench.acknowledge(0)
    bench.assign(1, (1, 0), (2, 0))
    bench.tick(10)
    bench.acknowledge(leg_id)
    assert [sample.number for sample in report(bench.tick()).samples] == [2]


def test_nobody_can_take_custody_of_what_was_not_said() -> None:
    bench = Bench(path=((0, 0), (1, 0), (2, 0)))
    bench.tick(15)  # under way, one cell further
    bench.acknowledge(0)
    assert [sample.number for sample in report(bench.tick(6)).samples] == [0, 1, 2]


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


orders = st.one_of(
    st.builds(Acknowledgement, acknowledges=st.sampled_from(Acknowledged), reference=leg_ids),
    st.tuples(leg_ids, walks(), st.floats(0, 500)).map(
        lambda parts: assignment(parts[0], *parts[1], deadline_s=parts[2])
    ),
    st.builds(recovery, leg_ids),
)
PASS_TIME = st.integers(1, 25)
FOLLOW_ON = st.just('follow on')
"""A well-made next leg, so that the AUV gets around; its custody is sometimes lost."""


@given(st.lists(PASS_TIME | FOLLOW_ON | orders, max_size=30), st.integers(0, 5))
def test_whatever_it_hears_no_sample_is_lost_or_said_twice_after_custody(
    inputs: list[int | str | Message], seed: int
) -> None:
    bench = Bench(surfacing='{"model": "early", "probability": 0.5}', seed=seed)
    entered = 0
    relieved = 0
    last: SurfacingReport | None = None

    def check(output: list[Output]) -> None:
        nonlocal entered, last
        entered += sum(isinstance(event, CellEntered) for event in events(output))
        for body in said(output):
            if isinstance(body, SurfacingReport):
                last = body
                numbers = [sample.number for sample in body.samples]
                assert numbers == list(range(relieved, entered))
        if any(isinstance(event, Dived) for event in events(output)):
            last = None

    for step in [1, *inputs]:
        match step:
            case int(seconds):
                for _ in range(seconds):
                    check(bench.tick())
            case str():
                if last is not None:
                    col, row = last.cell
                    check(bench.assign(last.leg_id + 1, (col, row), (col ^ 1, row)))
            case _:
                if last is not None and step == taken(last.leg_id, CUSTODY):
                    relieved = entered
                check(bench.hear(step))
