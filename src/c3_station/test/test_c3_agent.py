from __future__ import annotations

from collections.abc import Iterable, Mapping

import hypothesis.strategies as st
import msgspec
import pytest
from hypothesis import given

from c3_station.c3_agent import C3Agent
from c3_station.scenario import (
    Auv,
    PlannerChoice,
    Radio,
    Scenario,
    ScheduledCommand,
    Sortie,
    Uav,
)
from msgs_json.agent import Log, Output, Publish, Refuse, Transmit
from msgs_json.codec import Refusal
from msgs_json.geometry import Cell, GridSpec, Point
from msgs_json.messages import (
    Abort,
    Acknowledged,
    Acknowledgement,
    AuvStatus,
    ChangeLimit,
    ChangeRegion,
    Command,
    CommandRefused,
    CommandTaken,
    ContactState,
    Directive,
    DirectiveRefused,
    Event,
    ExpectedContact,
    Leg,
    LegOutcome,
    Meeting,
    Message,
    MissionCompleted,
    MissionOrder,
    MissionStarted,
    MissionState,
    MissionStatus,
    Pause,
    Recall,
    Reset,
    Resume,
    Sample,
    SampleBatch,
    SampleReceipt,
    SamplesDelivered,
    SampleSpan,
    SortieOutlook,
    SortieReport,
)
from msgs_json.ros_messages import Diagnostics, Markers, Occupancy
from msgs_json.store import MemoryStore
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
    sortie=Sortie(limit_s=40.0, surface_margin_s=2.0, handover_s=0.5, lost_after_sorties=2),
    planner=PlannerChoice(name='ecc2009', path_cells=3, min_path_cells=2),
    seed=7,
    max_mission_s=500.0,
)
STATUS_PERIOD_S = 10.0


class WatchedStore(MemoryStore):
    """Tells what is put into it."""

    def __init__(self) -> None:
        super().__init__()
        self.entries: set[tuple[str, str]] = set()

    def put(self, kind: str, key: str, value: object) -> None:
        """Set the value of an entry at the next commit."""
        self.entries.add((kind, key))
        super().put(kind, key, value)


class Bench:
    """A station, driven second by second."""

    def __init__(self, *, start_s: float = 0.0, scenario: Scenario = SCENARIO) -> None:
        self._scenario = scenario
        self.store = MemoryStore()
        self.agent = self.make_agent()
        self.now_s = start_s - 1.0

    def make_agent(self) -> C3Agent:
        return C3Agent('c3', self._scenario, 'uav', STATUS_PERIOD_S, self.store)

    def restart(self) -> None:
        """Have another process go on."""
        self.store = self.store.reopened()
        self.agent = self.make_agent()

    def tick(self) -> list[Output]:
        self.now_s += 1.0
        output = self.agent.tick(self.now_s)
        self.store.commit()
        return output

    def hear(self, message: Message, src: str = 'uav') -> list[Output]:
        output = self.agent.receive(src, message, self.now_s)
        self.store.commit()
        return output

    def surveying(self) -> Bench:
        self.tick()
        self.hear(ORDER_TAKEN)
        return self

    def wait_until(self, time_s: float) -> list[Output]:
        """Tick up to a time and return what was put out on the way."""
        output: list[Output] = []
        while self.now_s < time_s:
            output += self.tick()
        return output


ORDER_TAKEN = Acknowledgement(acknowledges=Acknowledged.MISSION_ORDER, reference=0)


def taken(sortie: int) -> Transmit:
    return Transmit(
        'uav', Acknowledgement(acknowledges=Acknowledged.SORTIE_REPORT, reference=sortie)
    )


def receipt(*spans: SampleSpan) -> Transmit:
    return Transmit('uav', SampleReceipt(held=(), at_c3=spans))


def keys(spans: Iterable[SampleSpan]) -> set[tuple[str, int]]:
    return {(each.auv, number) for each in spans for number in range(each.first, each.until)}


def span(auv: str, first: int, until: int) -> SampleSpan:
    return SampleSpan(auv=auv, first=first, until=until)


def delivered(samples: int, *, cells: int, age_s: float | None = 0.0) -> SamplesDelivered:
    return SamplesDelivered(samples=samples, cells_delivered=cells, oldest_age_s=age_s)


def leg(auv: str, leg_id: int) -> Leg:
    col, row = (1, 0) if auv == 'auv_1' else (1, 1)
    return Leg(leg_id=leg_id, path=((col, row), (col + 1, row)), surface_deadline_s=90.0)


def meeting(
    auv: str,
    leg_id: int = 0,
    *,
    is_last: bool = False,
    outcome: LegOutcome = LegOutcome.COMPLETED,
) -> Meeting:
    return Meeting(
        auv=auv,
        time_s=14.0,
        cell=(1, 0),
        ended_leg_id=leg_id,
        outcome=outcome,
        next_leg=None if is_last else leg(auv, leg_id + 1),
    )


def sample(
    auv: str, number: int, cell: Cell, value: float = 1.0, *, entered_s: float = 0.0
) -> Sample:
    return Sample(auv=auv, number=number, cell=cell, entered_s=entered_s, value=value)


def batch(*samples: Sample) -> SampleBatch:
    return SampleBatch(samples=samples)


def report(
    sortie: int,
    *meetings: Meeting,
    cargo: tuple[SampleSpan, ...] = (),
    missed: tuple[str, ...] = (),
    not_reached: tuple[str, ...] = (),
    lost: tuple[str, ...] = (),
    contacts_s: Mapping[str, float] | None = None,
    is_last: bool = False,
) -> SortieReport:
    """Return a report with the next sortie's contacts; with none of it where it is the last."""
    outlook = SortieOutlook(
        departs_s=60.0,
        returns_by_s=100.0,
        contacts=tuple(
            ExpectedContact(auv=auv, time_s=time_s) for auv, time_s in (contacts_s or {}).items()
        ),
    )
    return SortieReport(
        sortie=sortie,
        departed_s=6.0,
        returned_s=44.0,
        meetings=meetings,
        missed=missed,
        not_reached=not_reached,
        lost=lost,
        cargo=cargo,
        next_sortie=None if is_last else outlook,
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


def auvs(output: list[Output]) -> dict[str, AuvStatus]:
    return {auv.name: auv for auv in status(output).auvs}


def contacts(output: list[Output]) -> list[ContactState | None]:
    return [auv.contact for auv in status(output).auvs]


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
    assert (order.handover_s, order.lost_after_sorties) == (0.5, 2)
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
    output = bench.hear(report(1, meeting('auv_1'), cargo=(span('auv_1', 0, 2),)))
    assert output[0] == taken(1)
    assert events(output) == []
    assert (status(output).sorties, status(output).samples_delivered) == (1, 0)


def test_samples_are_stored_and_a_receipt_says_so() -> None:
    bench = Bench().surveying()
    output = bench.hear(batch(sample('auv_1', 0, (0, 0)), sample('auv_1', 1, (1, 0), 3.0)))
    assert output[0] == receipt(span('auv_1', 0, 2))
    assert events(output) == [delivered(2, cells=2)]
    grid = shown(output, EXPLORATION_MAP)
    assert isinstance(grid, Occupancy)
    assert grid.values == ((0, 0, -1), (-1, -1, -1))
    markers = shown(output, MARKERS)
    assert isinstance(markers, Markers)
    assert len(markers.cells[0].centres) == 2
    found = status(output)
    assert (found.cells_delivered, found.samples_delivered) == (2, 2)


def test_a_receipt_names_all_that_is_here_of_the_auvs_of_the_batch() -> None:
    # So one that was lost is made up for by the next.
    bench = Bench().surveying()
    bench.hear(batch(sample('auv_1', 0, (0, 0)), sample('auv_1', 2, (1, 0))))
    bench.hear(batch(sample('auv_2', 0, (0, 1))))
    output = bench.hear(batch(sample('auv_1', 4, (1, 0))))
    held = (span('auv_1', 0, 1), span('auv_1', 2, 3), span('auv_1', 4, 5))
    assert output[0] == receipt(*held)
    both = batch(sample('auv_2', 1, (0, 1)), sample('auv_1', 1, (1, 0)))
    expected = (span('auv_2', 0, 2), span('auv_1', 0, 3), span('auv_1', 4, 5))
    assert bench.hear(both)[0] == receipt(*expected)


def test_a_repeated_report_is_acknowledged_and_nothing_else() -> None:
    bench = Bench().surveying()
    first = report(1, meeting('auv_1'))
    bench.hear(first)
    assert bench.hear(first) == [taken(1)]
    bench.hear(report(2))
    assert bench.hear(first) == [taken(1)]


def test_a_repeated_batch_gets_its_receipt_and_nothing_else() -> None:
    bench = Bench().surveying()
    first = batch(sample('auv_1', 0, (0, 0)))
    bench.hear(first)
    assert bench.hear(first) == [receipt(span('auv_1', 0, 1))]


def test_a_sample_that_comes_twice_counts_once() -> None:
    bench = Bench().surveying()
    bench.hear(batch(sample('auv_1', 0, (0, 0))))
    output = bench.hear(batch(sample('auv_1', 0, (0, 0)), sample('auv_2', 0, (0, 1))))
    assert events(output) == [delivered(1, cells=2)]
    assert status(output).samples_delivered == 2


def test_a_sample_that_is_twice_in_a_batch_counts_once() -> None:
    bench = Bench().surveying()
    output = bench.hear(batch(*[sample('auv_1', 0, (0, 0))] * 2))
    assert events(output) == [delivered(1, cells=1)]
    assert auvs(output)['auv_1'].samples_delivered == 1


def test_two_samples_of_a_cell_are_two_samples_and_one_cell() -> None:
    bench = Bench().surveying()
    output = bench.hear(batch(sample('auv_1', 0, (0, 0)), sample('auv_1', 2, (0, 0))))
    assert events(output) == [delivered(2, cells=1)]


@pytest.mark.parametrize(
    'bad',
    [
        report(2),
        report(1, meeting('auv_9')),
        report(1, meeting('auv_1'), cargo=(span('auv_9', 0, 1),)),
        report(1, missed=('auv_9',)),
        report(1, not_reached=('auv_9',)),
        report(1, lost=('auv_9',)),
        report(1, contacts_s={'auv_9': 70.0}),
    ],
    ids=[
        *('gap', 'unknown_auv_met', 'unknown_auv_sampled'),
        *('unknown_missed', 'unknown_not_reached', 'unknown_lost', 'unknown_next'),
    ],
)
def test_a_report_that_cannot_be_is_refused_as_a_whole(bad: SortieReport) -> None:
    bench = Bench().surveying()
    assert refused(bench.hear(bad)) is Refusal.CONTRADICTORY
    output = bench.hear(report(1))
    assert output[0] == taken(1)
    assert auvs(output)['auv_1'].leg_id == 0


@pytest.mark.parametrize(
    'bad',
    [
        batch(sample('auv_9', 0, (0, 0))),
        batch(sample('auv_1', 0, (3, 0))),
        batch(sample('auv_1', 0, (0, 0)), sample('c3', 1, (0, 0)), sample('auv_1', 1, (1, 0))),
    ],
    ids=['unknown_auv', 'outside', 'one_of_three'],
)
def test_a_batch_that_cannot_be_is_refused_as_a_whole(bad: SampleBatch) -> None:
    bench = Bench().surveying()
    assert refused(bench.hear(bad)) is Refusal.CONTRADICTORY
    output = bench.hear(batch(sample('auv_2', 0, (0, 1))))
    assert status(output).samples_delivered == 1


def test_before_the_mission_begins_nothing_is_taken() -> None:
    for message in (batch(sample('auv_1', 0, (0, 0))), report(1), ORDER_TAKEN):
        assert refused(Bench().hear(message)) is Refusal.UNEXPECTED


def test_the_age_of_a_delivery_is_that_of_its_oldest_new_sample() -> None:
    bench = Bench().surveying()
    bench.wait_until(44.0)
    old, older = (sample('auv_1', n, (n, 0), entered_s=20.0 - 10.0 * n) for n in (0, 1))
    assert events(bench.hear(batch(old))) == [delivered(1, cells=1, age_s=24.0)]
    bench.wait_until(50.0)
    assert events(bench.hear(batch(old, older))) == [delivered(1, cells=2, age_s=40.0)]
    assert events(bench.hear(batch(old, older))) == []  # of which nothing is new


def test_a_sample_from_the_future_has_no_age() -> None:
    # At sea clocks differ a little; a negative age would be refused by whoever reads it.
    bench = Bench().surveying()
    output = bench.hear(batch(sample('auv_1', 0, (0, 0), entered_s=2.5)))
    assert events(output)[0] == delivered(1, cells=1, age_s=0.0)


def test_other_messages_are_refused() -> None:
    (order,) = said(Bench().tick())
    answer = Acknowledgement(acknowledges=Acknowledged.SORTIE_REPORT, reference=1)
    bench = Bench().surveying()
    for message in (order, answer):
        assert refused(bench.hear(message)) is Refusal.UNEXPECTED


# --- the end -------------------------------------------------------------------------------------


def completed(samples: int, *, cells: int, lost: tuple[str, ...] = ()) -> MissionCompleted:
    return MissionCompleted(cells_delivered=cells, samples_delivered=samples, lost=lost)


def test_the_mission_is_complete_when_every_auv_stays_up_and_its_data_is_here() -> None:
    bench = Bench().surveying()
    cells = [(col, row) for col in range(3) for row in range(2)]
    samples = [sample('auv_1', number, cell) for number, cell in enumerate(cells)]
    bench.hear(batch(*samples))
    output = bench.hear(report(1, meeting('auv_1', is_last=True), cargo=(span('auv_1', 0, 6),)))
    assert not bench.agent.finished
    assert status(output).state is MissionState.RECOVERING
    cargo = (span('auv_1', 4, 6), span('auv_2', 0, 1))
    output = bench.hear(report(2, meeting('auv_2', is_last=True), cargo=cargo, is_last=True))
    assert (bench.agent.finished, events(output)) == (False, [])  # auv_2's sample is still to come
    output = bench.hear(batch(sample('auv_2', 0, (0, 1))))
    assert bench.agent.finished
    assert events(output) == [delivered(1, cells=6), completed(7, cells=6)]
    assert status(output).state is MissionState.COMPLETED
    assert contacts(output) == [None, None]


def test_the_mission_ends_without_a_lost_auv_and_says_so() -> None:
    bench = Bench().surveying()
    bench.hear(batch(sample('auv_1', 0, (0, 0))))
    bench.hear(report(1, meeting('auv_1', is_last=True)))
    output = bench.hear(report(2, missed=('auv_2',), lost=('auv_2',), is_last=True))
    assert bench.agent.finished
    assert events(output)[-1] == completed(1, cells=1, lost=('auv_2',))
    assert contacts(output) == [None, ContactState.LOST]


def test_the_mission_ends_unexplored_when_all_are_lost_or_asked_for_help() -> None:
    bench = Bench().surveying()
    aborted = meeting('auv_1', is_last=True, outcome=LegOutcome.ABORTED)
    output = bench.hear(report(1, aborted, missed=('auv_2',), lost=('auv_2',), is_last=True))
    assert events(output)[-1] == completed(0, cells=0, lost=('auv_2',))
    assert status(output).state is MissionState.COMPLETED


def test_who_stays_up_for_recovery_is_not_lost_whatever_else_is_said_of_it() -> None:
    bench = Bench().surveying()
    met = (meeting('auv_1', is_last=True), meeting('auv_2', is_last=True))
    output = bench.hear(report(1, *met, lost=('auv_2',), is_last=True))
    assert events(output)[-1] == completed(0, cells=0)
    assert contacts(output) == [None, None]


def test_the_mission_goes_on_while_the_uav_will_fly_again() -> None:
    # It may still look for a lost one.
    bench = Bench().surveying()
    bench.hear(report(1, meeting('auv_1', is_last=True), lost=('auv_2',)))
    assert not bench.agent.finished
    bench.hear(report(2, meeting('auv_2', is_last=True), is_last=True))
    assert bench.agent.finished


def test_a_last_report_while_an_auv_is_out_ends_nothing_and_loses_nothing() -> None:
    bench = Bench().surveying()
    output = bench.hear(report(1, meeting('auv_1'), cargo=(span('auv_1', 0, 1),), is_last=True))
    assert output[0] == taken(1)
    output = bench.hear(batch(sample('auv_1', 0, (0, 0))))
    assert not bench.agent.finished
    assert status(output).samples_delivered == 1
    both = (meeting('auv_1', 1, is_last=True), meeting('auv_2', is_last=True))
    bench.hear(report(2, *both, is_last=True))
    assert bench.agent.finished


# --- silence is not failure ----------------------------------------------------------------------


def test_silence_is_expected_until_the_deadline_and_then_it_is_due() -> None:
    bench = Bench()
    assert contacts(bench.tick()) == [ContactState.EXPECTED_SILENT] * 2
    bench.hear(ORDER_TAKEN)
    bench.wait_until(11.0)
    assert contacts(bench.tick()) == [ContactState.DUE, ContactState.EXPECTED_SILENT]  # 12 s
    bench.wait_until(18.0)
    assert contacts(bench.tick()) == [ContactState.DUE] * 2  # 19 s


def test_who_was_searched_in_vain_is_overdue_until_it_is_met() -> None:
    bench = Bench().surveying()
    first = auvs(bench.hear(report(1, missed=('auv_1',), not_reached=('auv_2',))))
    assert (first['auv_1'].contact, first['auv_1'].searches_in_vain) == (ContactState.OVERDUE, 1)
    # Not searched to the end: nothing was learned of it.
    assert first['auv_2'].contact is ContactState.EXPECTED_SILENT
    assert first['auv_2'].searches_in_vain == 0
    again = auvs(bench.hear(report(2, missed=('auv_1',))))
    assert (again['auv_1'].contact, again['auv_1'].searches_in_vain) == (ContactState.OVERDUE, 2)
    met = auvs(bench.hear(report(3, meeting('auv_1'))))
    assert met['auv_1'].contact is ContactState.EXPECTED_SILENT
    assert met['auv_1'].searches_in_vain == 0


def test_lost_is_who_the_uav_gave_up_until_it_is_heard_again() -> None:
    bench = Bench().surveying()
    bench.hear(report(1, missed=('auv_1',)))
    lost = auvs(bench.hear(report(2, missed=('auv_1',), lost=('auv_1',))))['auv_1']
    assert lost.contact is ContactState.LOST
    assert lost.predicted_cells == ((0, 0), (1, 0))  # where to look for it
    still = auvs(bench.hear(report(3, lost=('auv_1',))))['auv_1']
    assert (still.contact, still.searches_in_vain) == (ContactState.LOST, 2)
    bench.hear(report(4, meeting('auv_1')))
    output = bench.hear(batch(sample('auv_1', 0, (0, 0))))
    assert auvs(output)['auv_1'].contact is ContactState.EXPECTED_SILENT
    assert auvs(output)['auv_1'].samples_delivered == 1
    bench.wait_until(89.0)
    assert contacts(bench.tick())[0] is ContactState.DUE


def test_the_next_contact_is_what_the_uav_plans() -> None:
    bench = Bench()
    assert auvs(bench.tick())['auv_1'].next_contact_s is None
    bench.hear(ORDER_TAKEN)
    planned = auvs(bench.hear(report(1, contacts_s={'auv_1': 70.0, 'auv_2': 82.5})))
    assert [auv.next_contact_s for auv in planned.values()] == [70.0, 82.5]
    later = auvs(
        bench.hear(report(2, meeting('auv_1', is_last=True), contacts_s={'auv_2': 130.0}))
    )
    assert [auv.next_contact_s for auv in later.values()] == [None, 130.0]


def test_a_repeated_report_counts_no_search_twice() -> None:
    bench = Bench().surveying()
    missed = report(1, missed=('auv_1',))
    bench.hear(missed)
    assert bench.hear(missed) == [taken(1)]
    again = bench.hear(report(2))
    assert auvs(again)['auv_1'].searches_in_vain == 1


def test_a_change_is_shown_at_once_and_only_once() -> None:
    bench = Bench().surveying()
    shown_s = [bench.now_s for _ in range(35) if any(isinstance(o, Publish) for o in bench.tick())]
    # Every 10 s after the last time; auv_1 is due at 12 s, auv_2 at 19 s.
    assert shown_s == [10.0, 12.0, 19.0, 29.0]


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


def test_diagnostics_name_who_asked_for_help() -> None:
    bench = Bench().surveying()
    aborted = meeting('auv_2', is_last=True, outcome=LegOutcome.ABORTED)
    shown_diagnostics = shown(bench.hear(report(1, meeting('auv_1'), aborted)), DIAGNOSTICS)
    assert isinstance(shown_diagnostics, Diagnostics)
    _, first, second = shown_diagnostics.statuses
    assert [dict(each.values)['asked for help'] for each in (first, second)] == ['no', 'yes']


def test_what_is_known_of_an_auv_follows_its_meetings() -> None:
    bench = Bench().surveying()
    bench.hear(report(1, meeting('auv_1')))
    output = bench.hear(batch(sample('auv_1', 0, (0, 0))))
    first, second = status(output).auvs
    assert (first.leg_id, first.predicted_cells) == (1, ((1, 0), (2, 0)))
    assert (first.surface_deadline_s, first.last_met_s, first.samples_delivered) == (90.0, 14.0, 1)
    assert second.leg_id == 0
    output = bench.hear(report(2, meeting('auv_1', 1, is_last=True)))
    first, _ = status(output).auvs
    assert (first.leg_id, first.predicted_cells, first.surface_deadline_s) == (1, (), None)


# --- the operator --------------------------------------------------------------------------------


def wanted(revision: int, **changes: object) -> Directive:
    ordered = Directive(
        revision=revision,
        paused=False,
        aborted=False,
        recalled=(),
        sortie_limit_s=40.0,
        masked=(),
    )
    return msgspec.structs.replace(ordered, **changes)


def directive_taken(revision: int) -> Acknowledgement:
    return Acknowledgement(acknowledges=Acknowledged.DIRECTIVE, reference=revision)


def test_what_the_operator_wants_is_said_until_the_uav_has_taken_it() -> None:
    bench = Bench()
    bench.tick()
    output = bench.hear(Pause(), src='operator')
    assert events(output) == [CommandTaken(command=Pause(), revision=1)]
    assert said(output) == []
    (first,) = said(bench.tick())
    assert isinstance(first, MissionOrder)  # without which it means nothing
    bench.hear(ORDER_TAKEN)
    for _ in range(3):
        assert said(bench.tick()) == [wanted(1, paused=True)]
    shown_before = status(bench.hear(Recall(), src='operator'))
    assert (shown_before.directive.revision, shown_before.directive_taken) == (2, 0)
    bench.hear(directive_taken(1))  # it is out of date by now
    assert said(bench.tick()) == [wanted(2, paused=True, recalled=('auv_1', 'auv_2'))]
    assert status(bench.hear(directive_taken(2))).directive_taken == 2
    assert said(bench.tick()) == []


def test_a_command_that_makes_no_sense_is_answered_and_changes_nothing() -> None:
    bench = Bench().surveying()
    output = bench.hear(Recall(auvs=('auv_9',)), src='operator')
    assert output == [
        Log(
            CommandRefused(
                command=Recall(auvs=('auv_9',)),
                problem='auv_9: no such AUV; allowed: auv_1, auv_2',
            ),
            bench.now_s,
        )
    ]
    assert said(bench.tick()) == []


def test_what_the_uav_cannot_fly_by_is_told_once_and_no_longer_wanted() -> None:
    bench = Bench().surveying()
    bench.hear(ChangeLimit(sortie_limit_s=5.0), src='operator')
    bench.hear(Abort(), src='operator')
    refusal = DirectiveRefused(revision=2, problem='too short', sortie_limit_s=40.0, masked=())
    output = bench.hear(refusal)
    assert events(output) == [CommandRefused(command=None, problem='too short')]
    assert status(output).directive == wanted(2, aborted=True)
    assert status(output).directive_taken == 2
    assert bench.hear(refusal) == []
    assert said(bench.tick()) == []


@pytest.mark.parametrize(
    ('src', 'message'), [('uav', Abort()), ('operator', ORDER_TAKEN)], ids=['uav', 'operator']
)
def test_only_the_operator_commands_and_he_does_nothing_else(src: str, message: Message) -> None:
    (refused,) = Bench().surveying().hear(message, src=src)
    assert isinstance(refused, Refuse)
    assert (refused.sender, refused.refusal) == (src, Refusal.UNEXPECTED)


def test_a_command_before_the_mission_is_refused_so_that_it_is_said_again() -> None:
    (refused,) = Bench().hear(Pause(), src='operator')
    assert isinstance(refused, Refuse)


def test_the_state_is_what_the_operator_wants() -> None:
    bench = Bench().surveying()
    states = [
        status(bench.hear(command, src='operator')).state
        for command in (Pause(), Abort(), Reset(), Resume(), Recall(auvs=('auv_1',)), Recall())
    ]
    assert states == [
        MissionState.PAUSED,
        MissionState.ABORTED,
        MissionState.PAUSED,
        MissionState.SURVEYING,
        MissionState.SURVEYING,
        MissionState.RECOVERING,
    ]


def test_cells_that_are_taken_out_count_nowhere() -> None:
    bench = Bench().surveying()
    bench.hear(batch(sample('auv_1', 0, (0, 0)), sample('auv_1', 1, (2, 0))))
    shown_now = status(bench.hear(ChangeRegion(masked=((2, 0),)), src='operator'))
    assert (shown_now.cells_delivered, shown_now.cells_total) == (1, 5)
    cells = [(1, 0), (0, 1), (1, 1), (2, 1)]
    output = bench.hear(batch(*(sample('auv_1', 2 + n, cell) for n, cell in enumerate(cells))))
    assert status(output).state is MissionState.RECOVERING
    assert events(output) == [delivered(4, cells=5)]


# --- every input in every state ------------------------------------------------------------------

names = st.sampled_from(['auv_1', 'auv_2', 'auv_3'])
few = st.integers(0, 3)
times_s = st.sampled_from([0.0, 10.0, 20.0])
values = st.floats(0.0, 9.0)
samples_of_any = st.builds(
    sample,
    names,
    few,
    st.tuples(st.integers(0, 3), st.integers(0, 1)),
    values,
    entered_s=times_s,
)
batches = st.builds(
    lambda samples: batch(*samples), st.lists(samples_of_any, min_size=1, max_size=4)
)
meetings_of_any = st.builds(meeting, names, few, is_last=st.booleans())
some = st.lists(names, max_size=2).map(tuple)
cargo_of_any = st.lists(st.builds(span, names, few, st.integers(4, 6)), max_size=2).map(tuple)
reports = st.builds(
    lambda sortie, meetings, **said: report(sortie, *meetings, **said),
    st.integers(1, 4),
    st.lists(meetings_of_any, max_size=4),
    cargo=cargo_of_any | st.just(()),
    missed=some,
    lost=some,
    contacts_s=st.dictionaries(names, st.floats(0.0, 100.0), max_size=2),
    is_last=st.booleans(),
)
answers = st.builds(
    Acknowledgement, acknowledges=st.sampled_from(Acknowledged), reference=st.integers(0, 3)
)
refusals = st.builds(
    DirectiveRefused,
    revision=few,
    problem=st.just('too short'),
    sortie_limit_s=st.sampled_from([40.0, 80.0]),
    masked=st.sampled_from([(), ((2, 1),)]),
)
commands = st.builds(Recall, auvs=some) | st.sampled_from([Pause(), Resume(), Abort(), Reset()])
commands |= st.builds(ChangeLimit, sortie_limit_s=st.sampled_from([40.0, 80.0]))
heard = reports | batches | answers | refusals | commands


def give(bench: Bench, message: Message | None) -> list[Output]:
    """Let C3 hear something, or time pass."""
    if message is None:
        return bench.tick()
    return bench.hear(message, src='operator' if isinstance(message, Command) else 'uav')


@given(st.lists(st.none() | heard, max_size=20))
def test_whatever_it_hears_it_counts_once_what_it_gave_a_receipt_for(
    inputs: list[Message | None],
) -> None:
    bench = Bench()
    bench.tick()
    stored: set[tuple[str, int]] = set()
    counted = 0
    for message in inputs:
        output = give(bench, message)
        if isinstance(message, SampleBatch):
            of_the_batch = {(each.auv, each.number) for each in message.samples}
            for answer in said(output):
                assert isinstance(answer, SampleReceipt)
                stored |= of_the_batch
                named = {auv for auv, _ in of_the_batch}
                assert keys(answer.at_c3) == {key for key in stored if key[0] in named}
        if isinstance(message, SortieReport) and len(output) > 1:
            assert output[0] == taken(message.sortie)
        counted += sum(e.samples for e in events(output) if isinstance(e, SamplesDelivered))
        assert counted == len(stored)
        for each in output:
            if isinstance(each, Publish) and isinstance(each.message, MissionStatus):
                assert each.message.samples_delivered == counted
                ended = each.message.state is MissionState.COMPLETED
                out = {auv.contact for auv in each.message.auvs} - {None, ContactState.LOST}
                assert not (ended and out)
                assert ended == bench.agent.finished


# --- another process goes on ---------------------------------------------------------------------


def said_and_logged(output: list[Output]) -> list[Output]:
    return [each for each in output if not isinstance(each, Publish)]


def as_seen(output: list[Output]) -> list[object]:
    """Return what is put out, cells drawn in an order that does not tell when they came."""
    seen: list[object] = []
    for each in output:
        if isinstance(each, Publish) and isinstance(each.message, Markers):
            drawn = (zip(part.centres, part.colours, strict=True) for part in each.message.cells)
            seen.append([sorted(cells, key=repr) for cells in drawn])
        else:
            seen.append(each)
    return seen


@given(st.lists(st.tuples(st.none() | heard, st.booleans()), max_size=20))
def test_a_new_process_does_what_the_one_before_would_have_done(
    inputs: list[tuple[Message | None, bool]],
) -> None:
    unharmed, killed = Bench(), Bench()
    for message, dies in [(None, False), *inputs]:
        if dies:
            killed.restart()
        expected, output = give(unharmed, message), give(killed, message)
        if message is None:
            # A new process shows at its first tick what it knows.
            assert said_and_logged(output) == said_and_logged(expected)
        else:
            assert as_seen(output) == as_seen(expected)
        assert killed.agent.finished == unharmed.agent.finished
    killed.restart()
    unharmed.wait_until(unharmed.now_s + 2 * STATUS_PERIOD_S)
    killed.wait_until(unharmed.now_s)
    last = batch(sample('auv_1', 9, (0, 0)))
    assert as_seen(killed.hear(last)) == as_seen(unharmed.hear(last))


def test_a_new_process_ends_the_mission_when_all_that_was_announced_is_here() -> None:
    bench = Bench().surveying()
    both = (meeting('auv_1', is_last=True), meeting('auv_2', is_last=True))
    bench.hear(report(1, *both, cargo=(span('auv_1', 0, 2),), is_last=True))
    for number, ends in ((0, False), (1, True)):
        bench.restart()
        bench.hear(batch(sample('auv_1', number, (number, 0))))
        assert bench.agent.finished == ends


def test_a_limit_may_leave_cells_out_of_reach_that_are_here() -> None:
    # Only [2, 1] is farther: 20 m beyond the range, 5 ticks there and 5 back, 1 to hand over.
    robust = msgspec.structs.replace(SCENARIO.planner, name='robust')
    bench = Bench(scenario=msgspec.structs.replace(SCENARIO, planner=robust)).surveying()
    shorter = ChangeLimit(sortie_limit_s=10.0)
    (refused,) = events(bench.hear(shorter, src='operator'))
    assert isinstance(refused, CommandRefused)
    assert refused.problem.startswith('sortie_limit_s is 10; allowed: at least 11, or no sortie')
    bench.hear(batch(sample('auv_2', 0, (2, 1))))
    (taken,) = events(bench.hear(shorter, src='operator'))
    assert isinstance(taken, CommandTaken)


def test_what_is_stored_is_what_has_changed() -> None:
    bench = Bench()
    bench.store = watched = WatchedStore()
    bench.agent = bench.make_agent()
    bench.surveying()
    both_auvs = {('auv', 'auv_1'), ('auv', 'auv_2')}
    assert watched.entries == {('order', ''), ('progress', ''), *both_auvs}
    watched.entries.clear()
    bench.hear(batch(sample('auv_1', 0, (0, 0)), sample('auv_2', 4, (0, 1))))
    assert watched.entries == {('sample', 'auv_1/0'), ('sample', 'auv_2/4')}
    watched.entries.clear()
    bench.hear(Pause(), src='operator')
    assert watched.entries == {('desk', '')}
    watched.entries.clear()
    bench.hear(report(1, meeting('auv_1')))
    assert watched.entries == {('progress', ''), *both_auvs}
    watched.entries.clear()
    bench.tick()
    assert watched.entries == set()


def test_a_command_of_the_scenario_is_given_once_by_all_processes() -> None:
    scheduled = ScheduledCommand(at_s=5.0, command={'command': 'pause'})
    bench = Bench(scenario=msgspec.structs.replace(SCENARIO, operator=(scheduled,))).surveying()
    assert events(bench.wait_until(5.0)) == [CommandTaken(command=Pause(), revision=1)]
    bench.restart()
    output = bench.tick()
    assert events(output) == []
    assert status(output).directive.paused


def test_a_process_that_died_before_it_stored_its_order_begins_anew() -> None:
    bench = Bench()
    bench.agent.tick(0.0)  # and nothing is committed
    bench.restart()
    assert [type(event) for event in events(bench.tick())] == [MissionStarted]


def test_a_new_process_shows_what_it_knows_since_latched_topics_die_with_theirs() -> None:
    bench = Bench().surveying()
    before = bench.hear(batch(sample('auv_1', 0, (0, 0)), sample('auv_2', 0, (0, 1))))
    bench.restart()
    output = bench.tick()
    assert events(output) == []
    grid, markers = shown(output, EXPLORATION_MAP), shown(output, MARKERS)
    assert isinstance(grid, Occupancy)
    assert grid.values == ((0, -1, -1), (0, -1, -1))
    assert isinstance(markers, Markers)
    assert len(markers.cells[0].centres) == 2
    assert status(output) == status(before)
    assert not any(isinstance(each, Publish) for each in bench.tick())


def test_a_new_process_shows_the_same_of_a_cell_that_two_auvs_entered_at_a_time() -> None:
    # It finds samples in another order than that in which they came.
    unharmed, killed = Bench().surveying(), Bench().surveying()
    for bench in (unharmed, killed):
        bench.hear(batch(sample('auv_2', 0, (0, 0), 1.0), sample('auv_2', 1, (1, 0), 9.0)))
        bench.hear(batch(sample('auv_1', 0, (0, 0), 5.0)))
    killed.restart()
    last = batch(sample('auv_1', 1, (2, 0), 0.0))
    assert as_seen(killed.hear(last)) == as_seen(unharmed.hear(last))
