from __future__ import annotations

import hypothesis.strategies as st
import msgspec
import pytest
from hypothesis import given

from c3_station.c3_agent import C3Agent
from c3_station.scenario import Auv, PlannerChoice, Radio, Scenario, Sortie, Uav
from msgs_json.agent import Log, Output, Publish, Refuse, Transmit
from msgs_json.codec import Refusal
from msgs_json.geometry import Cell, GridSpec, Point
from msgs_json.messages import (
    Acknowledged,
    Acknowledgement,
    Event,
    Leg,
    LegOutcome,
    Meeting,
    Message,
    MissionCompleted,
    MissionOrder,
    MissionStarted,
    MissionState,
    MissionStatus,
    RelayedSample,
    Sample,
    SamplesDelivered,
    SortieReport,
)
from msgs_json.ros_messages import Diagnostics, Markers, Occupancy
from msgs_json.topics import DIAGNOSTICS, EXPLORATION_MAP, MARKERS, MISSION_STATUS, Topic

SCENARIO = Scenario(
    name='pond',
    description='two AUVs, six cells',
    region=GridSpec(cols=3, rows=2, cell_m=10.0),
    c3=Point(east_m=0.0, north_m=-5.0),
    uav=Uav(speed_mps=5.0),
    auvs=(
        Auv(name='auv_1', initial_path=((0, 0), (1, 0))),
        Auv(name='auv_2', initial_path=((0, 1), (1, 1)), speed_mps=0.6),
    ),
    radio=Radio(range_m=12.0),
    sortie=Sortie(limit_s=40.0, surface_margin_s=2.0),
    planner=PlannerChoice(name='ecc2009', path_cells=3, min_path_cells=2),
    seed=7,
    max_mission_s=500.0,
)
STATUS_PERIOD_S = 10.0


class Bench:
    """A station, driven second by second."""

    def __init__(self, *, start_s: float = 0.0) -> None:
        self.agent = C3Agent('c3', SCENARIO, 'uav', STATUS_PERIOD_S)
        self.now_s = start_s - 1.0

    def tick(self) -> list[Output]:
        self.now_s += 1.0
        return self.agent.tick(self.now_s)

    def hear(self, message: Message) -> list[Output]:
        return self.agent.receive('uav', message, self.now_s)

    def surveying(self) -> Bench:
        self.tick()
        self.hear(ORDER_TAKEN)
        return self


ORDER_TAKEN = Acknowledgement(acknowledges=Acknowledged.MISSION_ORDER, reference=0)


def taken(sortie: int) -> Transmit:
    return Transmit(
        'uav', Acknowledgement(acknowledges=Acknowledged.SORTIE_REPORT, reference=sortie)
    )


def leg(auv: str, leg_id: int) -> Leg:
    col, row = (1, 0) if auv == 'auv_1' else (1, 1)
    return Leg(leg_id=leg_id, path=((col, row), (col + 1, row)), surface_deadline_s=90.0)


def meeting(auv: str, leg_id: int = 0, *, is_last: bool = False) -> Meeting:
    return Meeting(
        auv=auv,
        time_s=14.0,
        cell=(1, 0),
        ended_leg_id=leg_id,
        outcome=LegOutcome.COMPLETED,
        next_leg=None if is_last else leg(auv, leg_id + 1),
    )


def sample(auv: str, number: int, cell: Cell, value: float = 1.0) -> RelayedSample:
    return RelayedSample(
        auv=auv, sample=Sample(number=number, cell=cell, entered_s=0.0, value=value)
    )


def report(sortie: int, *parts: Meeting | RelayedSample) -> SortieReport:
    return SortieReport(
        sortie=sortie,
        departed_s=6.0,
        returned_s=44.0,
        meetings=tuple(part for part in parts if isinstance(part, Meeting)),
        missed=(),
        samples=tuple(part for part in parts if isinstance(part, RelayedSample)),
    )


def events(output: list[Output]) -> list[Event]:
    return [each.event for each in output if isinstance(each, Log)]


def said(output: list[Output]) -> list[Message]:
    return [each.body for each in output if isinstance(each, Transmit)]


def shown(output: list[Output], topic: Topic) -> object:
    (message,) = (
        each.message for each in output if isinstance(each, Publish) and each.topic is topic
    )
    return message


def status(output: list[Output]) -> MissionStatus:
    message = shown(output, MISSION_STATUS)
    assert isinstance(message, MissionStatus)
    return message


def refused(output: list[Output]) -> Refusal:
    (refuse,) = output
    assert isinstance(refuse, Refuse)
    assert refuse.sender == 'uav'
    return refuse.refusal


# --- the order -----------------------------------------------------------------------------------


def test_the_mission_starts_with_the_whole_scenario_in_the_log() -> None:
    output = Bench().tick()
    (started,) = events(output)
    assert isinstance(started, MissionStarted)
    assert msgspec.json.decode(started.scenario, type=Scenario) == SCENARIO
    assert (started.planner, started.seed) == ('ecc2009', 7)
    assert started.software_version


def test_the_order_is_the_scenario_seen_from_the_uav() -> None:
    (order,) = said(Bench().tick())
    assert isinstance(order, MissionOrder)
    assert (order.mission_id, order.region, order.c3) == ('pond', SCENARIO.region, SCENARIO.c3)
    assert (order.radio_range_m, order.sortie_limit_s) == (12.0, 40.0)
    assert (order.path_cells, order.min_path_cells, order.surface_margin_s) == (3, 2, 2.0)
    assert [(auv.name, auv.speed_mps) for auv in order.auvs] == [('auv_1', 1.0), ('auv_2', 0.6)]
    # 10 m at 1 m/s and at 0.6 m/s (16.7 s, so 18.7 s with the margin: 19 ticks), from t = 0.
    deadlines_s = [auv.leg.surface_deadline_s for auv in order.auvs]
    assert deadlines_s == [12.0, 19.0]
    assert [auv.leg.leg_id for auv in order.auvs] == [0, 0]
    assert [auv.leg.path for auv in order.auvs] == [auv.initial_path for auv in SCENARIO.auvs]


def test_deadlines_count_from_the_start_of_the_mission() -> None:
    (order,) = said(Bench(start_s=1000.0).tick())
    assert isinstance(order, MissionOrder)
    assert order.auvs[0].leg.surface_deadline_s == 1012.0


def test_the_order_is_repeated_unchanged_until_it_is_acknowledged() -> None:
    bench = Bench()
    first = said(bench.tick())
    assert said(bench.tick()) == first
    output = bench.hear(ORDER_TAKEN)
    assert status(output).state is MissionState.SURVEYING
    assert said(bench.tick()) == []
    assert bench.hear(ORDER_TAKEN) == []  # a late copy


# --- custody -------------------------------------------------------------------------------------


def test_a_report_is_acknowledged_and_stored() -> None:
    bench = Bench().surveying()
    output = bench.hear(
        report(1, meeting('auv_1'), sample('auv_1', 0, (0, 0)), sample('auv_1', 1, (1, 0), 3.0))
    )
    assert output[0] == taken(1)
    assert events(output) == [SamplesDelivered(sortie=1, samples=2, cells_delivered=2)]
    grid = shown(output, EXPLORATION_MAP)
    assert isinstance(grid, Occupancy)
    assert grid.values == ((0, 0, -1), (-1, -1, -1))
    markers = shown(output, MARKERS)
    assert isinstance(markers, Markers)
    assert len(markers.cells[0].centres) == 2
    found = status(output)
    assert (found.sorties, found.cells_delivered, found.samples_delivered) == (1, 2, 2)


def test_a_repeated_report_is_acknowledged_and_nothing_else() -> None:
    bench = Bench().surveying()
    first = report(1, meeting('auv_1'), sample('auv_1', 0, (0, 0)))
    bench.hear(first)
    assert bench.hear(first) == [taken(1)]
    bench.hear(report(2, sample('auv_1', 1, (1, 0))))
    assert bench.hear(first) == [taken(1)]


def test_a_sample_that_comes_twice_counts_once() -> None:
    bench = Bench().surveying()
    bench.hear(report(1, sample('auv_1', 0, (0, 0))))
    output = bench.hear(report(2, sample('auv_1', 0, (0, 0)), sample('auv_2', 0, (0, 1))))
    assert events(output) == [SamplesDelivered(sortie=2, samples=1, cells_delivered=2)]
    assert status(output).samples_delivered == 2


def test_two_samples_of_a_cell_are_two_samples_and_one_cell() -> None:
    bench = Bench().surveying()
    output = bench.hear(report(1, sample('auv_1', 0, (0, 0)), sample('auv_1', 2, (0, 0))))
    assert events(output) == [SamplesDelivered(sortie=1, samples=2, cells_delivered=1)]


@pytest.mark.parametrize(
    'bad',
    [
        report(2, sample('auv_1', 0, (0, 0))),
        report(1, meeting('auv_9')),
        report(1, sample('auv_9', 0, (0, 0))),
        report(1, sample('auv_1', 0, (3, 0))),
        report(1, meeting('auv_1'), sample('auv_1', 0, (0, 0)), sample('c3', 1, (0, 0))),
    ],
    ids=['gap', 'unknown_auv_met', 'unknown_auv_sampled', 'outside', 'one_of_three'],
)
def test_a_report_that_cannot_be_is_refused_as_a_whole(bad: SortieReport) -> None:
    bench = Bench().surveying()
    assert refused(bench.hear(bad)) is Refusal.CONTRADICTORY
    output = bench.hear(report(1, sample('auv_2', 0, (0, 1))))
    assert output[0] == taken(1)
    assert status(output).samples_delivered == 1


def test_other_messages_are_refused() -> None:
    (order,) = said(Bench().tick())
    answer = Acknowledgement(acknowledges=Acknowledged.SORTIE_REPORT, reference=1)
    bench = Bench().surveying()
    for message in (order, answer):
        assert refused(bench.hear(message)) is Refusal.UNEXPECTED


# --- the end -------------------------------------------------------------------------------------


def test_the_mission_is_complete_when_every_auv_stays_up_and_its_data_is_here() -> None:
    bench = Bench().surveying()
    cells = [(col, row) for col in range(3) for row in range(2)]
    samples = [sample('auv_1', number, cell) for number, cell in enumerate(cells)]
    output = bench.hear(report(1, meeting('auv_1', is_last=True), *samples))
    assert not bench.agent.finished
    assert status(output).state is MissionState.RECOVERING
    output = bench.hear(report(2, meeting('auv_2', is_last=True), sample('auv_2', 0, (0, 1))))
    assert bench.agent.finished
    assert events(output)[-1] == MissionCompleted(cells_delivered=6, samples_delivered=7)
    assert status(output).state is MissionState.COMPLETED


# --- what people see -----------------------------------------------------------------------------


def test_before_anything_is_delivered_nothing_is_known() -> None:
    output = Bench().tick()
    grid = shown(output, EXPLORATION_MAP)
    assert isinstance(grid, Occupancy)
    assert grid.values == ((-1,) * 3,) * 2
    found = status(output)
    assert (found.state, found.cells_total) == (MissionState.STARTING, 6)
    first, second = found.auvs
    assert (first.name, first.leg_id, first.surface_deadline_s) == ('auv_1', 0, 12.0)
    assert first.predicted_cells == ((0, 0), (1, 0))
    assert (second.last_met_s, second.samples_delivered) == (None, 0)
    assert isinstance(shown(output, DIAGNOSTICS), Diagnostics)


def test_the_status_is_shown_once_a_period() -> None:
    bench = Bench().surveying()
    times_s = [bench.now_s for _ in range(35) if any(isinstance(o, Publish) for o in bench.tick())]
    assert times_s == [10.0, 20.0, 30.0]


def test_what_is_known_of_an_auv_follows_its_meetings() -> None:
    bench = Bench().surveying()
    output = bench.hear(report(1, meeting('auv_1'), sample('auv_1', 0, (0, 0))))
    first, second = status(output).auvs
    assert (first.leg_id, first.predicted_cells) == (1, ((1, 0), (2, 0)))
    assert (first.surface_deadline_s, first.last_met_s, first.samples_delivered) == (90.0, 14.0, 1)
    assert second.leg_id == 0
    output = bench.hear(report(2, meeting('auv_1', 1, is_last=True)))
    first, _ = status(output).auvs
    assert (first.leg_id, first.predicted_cells, first.surface_deadline_s) == (1, (), None)


# --- every input in every state ------------------------------------------------------------------

names = st.sampled_from(['auv_1', 'auv_2', 'auv_3'])
few = st.integers(0, 3)
samples_of_any = st.builds(sample, names, few, st.tuples(st.integers(0, 3), st.integers(0, 1)))
meetings_of_any = st.builds(meeting, names, few, is_last=st.booleans())
reports = st.tuples(st.integers(1, 4), st.lists(samples_of_any | meetings_of_any, max_size=6)).map(
    lambda parts: report(parts[0], *parts[1])
)
answers = st.builds(
    Acknowledgement, acknowledges=st.sampled_from(Acknowledged), reference=st.integers(0, 3)
)


@given(st.lists(st.none() | reports | answers, max_size=20))
def test_whatever_it_hears_it_counts_what_it_acknowledged_once(
    inputs: list[Message | None],
) -> None:
    bench = Bench()
    bench.tick()
    stored: set[tuple[str, int]] = set()
    delivered = 0
    for message in inputs:
        output = bench.tick() if message is None else bench.hear(message)
        if isinstance(message, SortieReport) and len(output) > 1:
            assert output[0] == taken(message.sortie)
            stored |= {(each.auv, each.sample.number) for each in message.samples}
        delivered += sum(e.samples for e in events(output) if isinstance(e, SamplesDelivered))
        assert delivered == len(stored)
