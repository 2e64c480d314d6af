"""The live view's figures: they agree with the summary, and no stranger can upset them."""

from __future__ import annotations

import re

import pytest
from msgspec.structs import replace
from rich.console import Console

from c3_station.in_process import fly
from c3_station.live_view import LiveView
from c3_station.mission_monitor import MissionMonitor
from c3_station.node_params import UAV
from c3_station.scenario_files import load_scenario
from msgs_json.agent_shell import Frame, Speaker
from msgs_json.messages import (
    AuvStatus,
    CellEntered,
    CommandRefused,
    CommandTaken,
    ContactState,
    Directive,
    DirectiveTaken,
    Dived,
    Event,
    GivenUp,
    HeardAgain,
    LegOutcome,
    Met,
    Missed,
    MissionCompleted,
    MissionState,
    MissionStatus,
    Pause,
    PlanningAhead,
    Recall,
    RecoveryReason,
    SearchBrokenOff,
    SortieDeparted,
    StayedUp,
    StorageFailed,
    StorageRestored,
    Surfaced,
)
from msgs_json.ros_messages import ClockTime, Text
from msgs_json.topics import MISSION_EVENTS, MISSION_STATUS

ORDERED = Directive(
    revision=0, paused=False, aborted=False, recalled=(), sortie_limit_s=60.0, masked=()
)


def watched() -> MissionMonitor:
    scenario = load_scenario('ecc2009')
    monitor = MissionMonitor(scenario, UAV)

    def take(name: str, frame: Frame) -> None:
        monitor.message(frame.topic.resolve(f'/{name}'), frame.message)

    fly(scenario, take)
    return monitor


def test_it_ends_with_the_figures_of_the_summary() -> None:
    monitor = watched()
    summary = monitor.summarizer.summary()
    assert monitor.explored_s == summary.explored_s
    assert monitor.now_s == summary.mission_s
    assert monitor.sorties_flown == len(summary.sorties)
    assert monitor.longest_sortie_s == max(s.duration_s or 0.0 for s in summary.sorties)
    assert {
        name: monitor.auv_neglect_s(auv) for name, auv in monitor.auvs.items()
    } == summary.neglect_s
    assert len(monitor.entered) == summary.cells_explored
    assert monitor.ended == 'completed'


def met(auv: str) -> Met:
    return Met(
        sortie=1,
        auv=auv,
        cell=(0, 0),
        leg_id=0,
        path=(),
        slack_s=None,
        sortie_time_s=None,
        plan_status=None,
    )


def test_events_of_strangers_are_passed_over() -> None:
    scenario = load_scenario('ecc2009')
    monitor = MissionMonitor(scenario, UAV)
    surfaced = Surfaced(leg_id=0, outcome=LegOutcome.COMPLETED, cell=(0, 0))
    for frame in (
        Speaker('stranger').frame(MISSION_EVENTS, surfaced, 1.0),
        Speaker('uav').frame(MISSION_EVENTS, met('auv_99'), 1.0),
        Speaker('uav').frame(MISSION_EVENTS, Missed(sortie=1, auv='auv_99'), 1.0),
        Speaker('uav').frame(MISSION_EVENTS, GivenUp(sortie=1, auv='auv_99'), 1.0),
        Speaker('uav').frame(MISSION_EVENTS, HeardAgain(auv='auv_99'), 1.0),
        Frame(MISSION_EVENTS, Text(b'{"schema":"MissionEvent"')),
    ):
        monitor.message(MISSION_EVENTS.name, frame.message)
    assert not monitor.log
    assert monitor.now_s == 0.0


def test_the_view_fits_narrow_and_wide_terminals() -> None:
    monitor = watched()
    for width in (60, 80, 120):
        console = Console(width=width)
        with console.capture() as capture:
            console.print(LiveView(monitor, 'ecc2009'))
        lines = capture.get().splitlines()
        assert any('100 of 100 cells' in line for line in lines)
        assert any('recovered' in line for line in lines)


def test_the_view_shows_land_and_the_station_on_it() -> None:
    harbour = load_scenario('harbour')
    console = Console(width=120)
    with console.capture() as capture:
        console.print(LiveView(MissionMonitor(harbour, UAV), 'harbour'))
    lines = [re.sub('[│╭╮─ ]*│ │ ?', '', line, count=1) for line in capture.get().splitlines()]
    rows = lines[2 : 2 + harbour.region.rows]
    assert [row.count('▒') for row in rows] == [
        2 * sum((col, row) in harbour.region.masked for col in range(harbour.region.cols))
        - (row == harbour.region.cell_at(harbour.c3)[1])  # the UAV is on the quay
        for row in reversed(range(harbour.region.rows))
    ]
    assert rows[1].startswith('▒' * 9 + '✈')
    assert lines[14].startswith('⌂ C3')
    assert lines[15].startswith('▒ land, no-go')


# --- lost, late and broken off -------------------------------------------------------------------


class Log:
    """A mission's log, written by hand into a monitor."""

    def __init__(self) -> None:
        self.monitor = MissionMonitor(load_scenario('ecc2009'), UAV)
        self._speakers: dict[str, Speaker] = {}

    def add(self, source: str, stamp_s: float, event: Event) -> str | None:
        """Add an event and return its line in the log of the view."""
        speaker = self._speakers.setdefault(source, Speaker(source))
        before = len(self.monitor.log)
        self.monitor.message(
            MISSION_EVENTS.name, speaker.frame(MISSION_EVENTS, event, stamp_s).message
        )
        return self.monitor.log[-1][2] if len(self.monitor.log) > before else None

    def departed(self) -> Log:
        order = ('auv_1', 'auv_2', 'auv_3')
        self.add(
            'uav',
            5.0,
            SortieDeparted(
                sortie=1, limit_s=60.0, predicted_s=50.0, worst_case_s=55.0, order=order
            ),
        )
        return self

    def target(self) -> str | None:
        assert self.monitor.sortie is not None
        return self.monitor.sortie.target()

    def shown(self, width: int = 120) -> str:
        console = Console(width=width)
        with console.capture() as capture:
            console.print(LiveView(self.monitor, 'ecc2009'))
        return capture.get()


def test_the_view_shows_how_far_planning_ahead_has_come_while_time_stands_still() -> None:
    log = Log()
    assert 'UAV   at C3, waiting for the next departure' in log.shown()
    assert log.add('uav', 0.0, PlanningAhead(share=0.0)) is None
    assert 'UAV   at C3, planning ahead 0%' in log.shown()
    assert log.add('uav', 0.0, PlanningAhead(share=0.4)) is None
    assert 'UAV   at C3, planning ahead 40%' in log.shown(60)
    told = log.add('uav', 0.0, PlanningAhead(share=1.0))
    assert told == 'has planned the whole mission ahead'
    log.monitor.message('/clock', ClockTime(time_s=1.0))
    assert 'UAV   at C3, waiting for the next departure' in log.shown()


def test_the_uav_looks_for_the_next_one_after_it_searched_in_vain() -> None:
    log = Log().departed()
    assert log.target() == 'auv_1'
    assert log.add('uav', 20.0, Missed(sortie=1, auv='auv_1')) == 'auv_1 not heard on its path'
    assert log.target() == 'auv_2'
    log.add('uav', 25.0, met('auv_2'))
    assert log.target() == 'auv_3'


def test_the_uav_flies_home_once_it_has_broken_its_search_off() -> None:
    log = Log().departed()
    broken_off = SearchBrokenOff(sortie=1, not_reached=('auv_1', 'auv_2', 'auv_3'))
    line = log.add('uav', 20.0, broken_off)
    assert line == 'turns home to keep its limit, not reached: auv_1, auv_2, auv_3'
    assert log.target() is None
    assert 'flying home' in log.shown()


def test_who_is_given_up_and_heard_again_is_in_the_log() -> None:
    log = Log()
    line = log.add('uav', 20.0, GivenUp(sortie=1, auv='auv_2'))
    assert line == 'auv_2 given up for lost, its cells go to the others'
    assert log.add('uav', 90.0, HeardAgain(auv='auv_2')) == 'auv_2 heard again'
    ended = MissionCompleted(cells_delivered=100, samples_delivered=120, lost=('auv_1', 'auv_3'))
    assert log.add('c3', 99.0, ended) == 'mission completed without auv_1, auv_3'
    assert log.monitor.ended == 'completed without auv_1, auv_3'


def test_who_asks_for_help_is_seen_while_it_waits_and_when_it_is_up() -> None:
    log = Log()
    log.add('auv_1', 20.0, Surfaced(leg_id=0, outcome=LegOutcome.ABORTED, cell=(4, 7)))
    log.add('auv_2', 25.0, Surfaced(leg_id=0, outcome=LegOutcome.COMPLETED, cell=(3, 9)))
    assert 'asks for help 5 s' in log.shown()
    log.add('auv_1', 30.0, StayedUp(reason=RecoveryReason.ABORTED))
    log.add('auv_2', 30.0, StayedUp(reason=RecoveryReason.EXPLORED))
    rows = log.shown().splitlines()
    assert any('auv_1' in row and 'up, needs help' in row for row in rows)
    assert any('auv_2' in row and 'recovered' in row for row in rows)


def test_the_start_cell_is_no_move_of_the_first_path() -> None:
    log = Log()
    log.add('auv_1', 0.0, Dived(leg_id=0, path=((3, 7), (4, 7)), surface_deadline_s=10.0))
    for number, cell in enumerate(((3, 7), (4, 7))):
        log.add('auv_1', 10.0 * number, CellEntered(cell=cell, sample_number=number))
    assert log.monitor.auvs['auv_1'].cells_entered == 1


def status(contact: ContactState | None, next_contact_s: float | None) -> MissionStatus:
    return MissionStatus(
        mission_id='ecc2009',
        state=MissionState.SURVEYING,
        sorties=2,
        cells_total=100,
        cells_delivered=20,
        samples_delivered=22,
        directive=ORDERED,
        directive_taken=0,
        auvs=tuple(
            AuvStatus(
                name=name,
                leg_id=2,
                predicted_cells=((4, 7), (4, 6)),
                surface_deadline_s=74.0,
                contact=contact,
                next_contact_s=next_contact_s,
                searches_in_vain=2,
                last_met_s=14.0,
                samples_delivered=8,
            )
            for name in ('auv_1', 'stranger')
        ),
    )


@pytest.mark.parametrize('width', [60, 80, 120])
@pytest.mark.parametrize(
    ('contact', 'words'),
    [
        (ContactState.EXPECTED_SILENT, 'expected silent'),
        (ContactState.DUE, 'due'),
        (ContactState.OVERDUE, 'overdue, 2 in'),
        (ContactState.LOST, 'LOST'),
    ],
)
def test_the_view_shows_what_c3_makes_of_an_auvs_silence(
    contact: ContactState, words: str, width: int
) -> None:
    log = Log()
    frame = Speaker('c3').frame(MISSION_STATUS, status(contact, 131.0), 50.0)
    log.monitor.message('/c3/mission_status', frame.message)
    assert set(log.monitor.auvs) == {'auv_1', 'auv_2', 'auv_3'}
    (row,) = (line for line in log.shown(width).splitlines() if 'auv_1' in line)
    assert words in row
    assert '131 s' in row


def test_before_c3_knows_the_next_contact_there_is_none() -> None:
    log = Log()
    assert log.monitor.auvs['auv_1'].status is None
    frame = Speaker('c3').frame(MISSION_STATUS, status(None, None), 50.0)
    log.monitor.message('/c3/mission_status', frame.message)
    (row,) = (line for line in log.shown().splitlines() if '1 auv_1' in line)
    assert [word for word in row.split() if word == '-'] == ['-'] * 3  # contact, next, last met


# --- the operator --------------------------------------------------------------------------------

WANTED = replace(ORDERED, revision=3, recalled=('auv_2',), sortie_limit_s=80.0, masked=((0, 0),))


def commanded(directive: Directive, *, is_taken: bool) -> Log:
    """Return the log of a mission whose operator wants something."""
    log = Log()
    shown = replace(
        status(ContactState.EXPECTED_SILENT, None),
        directive=directive,
        directive_taken=directive.revision if is_taken else 0,
    )
    frame = Speaker('c3').frame(MISSION_STATUS, shown, 50.0)
    log.monitor.message('/c3/mission_status', frame.message)
    return log


@pytest.mark.parametrize(
    ('source', 'event', 'line'),
    [
        ('c3', CommandTaken(command=Pause(), revision=1), 'takes from the operator: pause'),
        (
            'c3',
            CommandRefused(command=Recall(auvs=('auv_9',)), problem='no such AUV'),
            'refuses "recall auv_9": no such AUV',
        ),
        (
            'c3',
            CommandRefused(command=None, problem='too short'),
            'the UAV cannot fly so: too short',
        ),
        (
            'uav',
            DirectiveTaken(directive=WANTED),
            'flies as the operator wants: auv_2 recalled, limit 80 s, 1 cell taken out',
        ),
        ('auv_1', StayedUp(reason=RecoveryReason.RECALLED), 'recalled, stays up'),
        (
            'auv_1',
            StorageFailed(problem='disk full'),
            'cannot store what it learns, and is silent: disk full',
        ),
        ('auv_1', StorageRestored(), 'stores again what it learns, and speaks'),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, Event) else '',
)
def test_what_the_operator_and_the_stores_do_is_in_the_log(
    source: str, event: Event, line: str
) -> None:
    assert Log().add(source, 5.0, event) == line


def test_nothing_is_shown_of_an_operator_who_wants_what_was_ordered() -> None:
    assert 'operator' not in Log().shown()
    assert 'operator' not in commanded(ORDERED, is_taken=True).shown()


@pytest.mark.parametrize('width', [60, 80, 120])
@pytest.mark.parametrize(
    ('is_taken', 'line'),
    [
        (True, 'operator   paused, auv_2 recalled'),
        (False, 'operator   paused, auv_2 recalled; not yet taken'),
    ],
)
def test_the_view_shows_what_the_operator_wants(width: int, is_taken: bool, line: str) -> None:
    directive = replace(ORDERED, revision=3, paused=True, recalled=('auv_2',))
    shown = commanded(directive, is_taken=is_taken).shown(width)
    assert line in shown
    assert 'UAV   at C3, paused' in shown
    (row,) = (each for each in shown.splitlines() if '2 auv_2' in each)
    assert 'recalled' in row


def test_the_view_shows_an_abort() -> None:
    log = commanded(replace(ORDERED, revision=1, aborted=True), is_taken=True)
    assert 'UAV   at C3, aborted until a reset' in log.shown(60)
    log.departed()
    broken_off = SearchBrokenOff(sortie=1, not_reached=('auv_1',))
    line = log.add('uav', 20.0, broken_off)
    assert line == 'turns home by the abort, not reached: auv_1'


def test_the_view_counts_the_cells_that_the_operator_has_left() -> None:
    log = commanded(WANTED, is_taken=True)
    log.add('uav', 5.0, DirectiveTaken(directive=WANTED))
    assert '0 of 99 cells' in log.shown()
    assert 'of 80 s' in log.shown()
    cells = list(log.monitor.scenario.region.cells)
    for number, cell in enumerate(cells[:-1]):
        told = log.add('auv_1', 9.0, CellEntered(cell=cell, sample_number=number))
        assert told is None
    assert '98 of 99 cells' in log.shown()
    without_last = replace(WANTED, revision=4, masked=(cells[-1],))
    log.add('uav', 10.0, DirectiveTaken(directive=without_last))
    assert log.monitor.explored_s == 10.0
    log.add('uav', 11.0, DirectiveTaken(directive=replace(WANTED, revision=5, masked=())))
    assert log.monitor.explored_s is None
