"""The figures of a mission: their definitions, and the same figures from odometry alone."""

from __future__ import annotations

import functools
import itertools
import json
import random
import tracemalloc
from collections.abc import Iterator, Mapping

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from c3_station.bag import BagFacts
from c3_station.in_process import fly
from c3_station.scenario import Limits, PassConditions, Scenario
from c3_station.scenario_files import load_scenario, parse_scenario, scenario_json
from c3_station.summary import (
    Summarizer,
    Summary,
    check_conditions,
    failed_conditions,
    summarize,
)
from msgs_json import codec
from msgs_json.agent_shell import Frame
from msgs_json.geometry import Cell
from msgs_json.messages import (
    AuvStatus,
    CellEntered,
    ContactState,
    Directive,
    DirectiveTaken,
    Event,
    GivenUp,
    HeardAgain,
    LegOutcome,
    MessageRefused,
    Met,
    Missed,
    MissionCompleted,
    MissionStarted,
    MissionState,
    MissionStatus,
    MissionStopped,
    RadioStatus,
    RecoveryReason,
    SamplesDelivered,
    SearchBrokenOff,
    SortieDeparted,
    SortieReturned,
    StayedUp,
    Surfaced,
)
from msgs_json.ros_messages import Odometry, RosMessage, Text, TrackPath

# --- a mission by hand ---------------------------------------------------------------------------


ORDERED = Directive(
    revision=0, paused=False, aborted=False, recalled=(), sortie_limit_s=60.0, masked=()
)


def tiny() -> Scenario:
    """Return a scenario of one AUV on 2 x 2 cells."""
    content = json.loads(scenario_json(load_scenario('minimal')))
    content['region'] = {'cols': 2, 'rows': 2, 'cell_m': 10.0}
    return parse_scenario(json.dumps(content))


def started(scenario: Scenario) -> MissionStarted:
    return MissionStarted(
        scenario=msgspec.Raw(scenario_json(scenario)),
        planner='ecc2009',
        seed=3,
        software_version='0.1.0',
    )


def departed(sortie: int, *, worst_case_s: float = 12.0) -> SortieDeparted:
    return SortieDeparted(
        sortie=sortie,
        limit_s=30.0,
        predicted_s=11.0,
        worst_case_s=worst_case_s,
        order=('auv_1',),
    )


def met(sortie: int, leg_id: int, cell: Cell, path: tuple[Cell, ...]) -> Met:
    return Met(
        sortie=sortie,
        auv='auv_1',
        cell=cell,
        leg_id=leg_id,
        path=path,
        slack_s=20.0 if path else None,
        sortie_time_s=12.0 if path else None,
        plan_status='ok' if path else None,
    )


def surfaced(leg_id: int, cell: Cell, outcome: LegOutcome = LegOutcome.COMPLETED) -> Surfaced:
    return Surfaced(leg_id=leg_id, outcome=outcome, cell=cell)


def entered(number: int, cell: Cell) -> CellEntered:
    return CellEntered(cell=cell, sample_number=number)


def delivered(samples: int, *, cells: int, age_s: float | None) -> SamplesDelivered:
    return SamplesDelivered(samples=samples, cells_delivered=cells, oldest_age_s=age_s)


Log = list[tuple[float, str, Event]]

MISSION: Log = [
    (0.0, 'c3', started(tiny())),
    (0.0, 'auv_1', entered(0, (0, 0))),
    (10.0, 'auv_1', entered(1, (1, 0))),
    (10.0, 'auv_1', surfaced(0, (1, 0))),
    (12.0, 'uav', departed(1)),
    (14.0, 'uav', met(1, 0, (1, 0), ((1, 0), (0, 0), (0, 1)))),
    (16.0, 'uav', SortieReturned(sortie=1, duration_s=4.0)),
    (16.0, 'c3', delivered(2, cells=2, age_s=16.0)),
    (24.0, 'auv_1', entered(2, (0, 0))),
    (34.0, 'auv_1', entered(3, (0, 1))),
    (34.0, 'auv_1', surfaced(1, (0, 1))),
    (37.0, 'uav', departed(2)),
    (39.0, 'uav', met(2, 1, (0, 1), ((0, 1), (1, 1), (1, 0)))),
    (41.0, 'uav', SortieReturned(sortie=2, duration_s=4.0)),
    (41.0, 'c3', delivered(2, cells=3, age_s=17.0)),
    (49.0, 'auv_1', entered(4, (1, 1))),
    (59.0, 'auv_1', entered(5, (1, 0))),
    (59.0, 'auv_1', surfaced(2, (1, 0))),
    (60.0, 'uav', departed(3)),
    (64.0, 'uav', met(3, 2, (1, 0), ())),
    (97.0, 'uav', SortieReturned(sortie=3, duration_s=37.0)),
    (97.0, 'c3', delivered(2, cells=4, age_s=48.0)),
    (97.0, 'c3', MissionCompleted(cells_delivered=4, samples_delivered=6, lost=())),
]


def status_message(
    at_c3: Mapping[str, int],
    contacts: Mapping[str, ContactState | None] | None = None,
    stamp_s: float = 0.0,
) -> Text:
    status = MissionStatus(
        mission_id='minimal',
        state=MissionState.SURVEYING,
        sorties=0,
        cells_total=4,
        cells_delivered=0,
        samples_delivered=sum(at_c3.values()),
        directive=ORDERED,
        directive_taken=0,
        auvs=tuple(
            AuvStatus(
                name=name,
                leg_id=0,
                predicted_cells=(),
                surface_deadline_s=None,
                contact=(contacts or {}).get(name),
                next_contact_s=None,
                searches_in_vain=0,
                last_met_s=None,
                samples_delivered=samples,
            )
            for name, samples in at_c3.items()
        ),
    )
    return Text(codec.encode(status, src='c3', dst='*', seq=0, stamp_s=stamp_s))


def summary_of(
    events: Log, facts: BagFacts | None = None, at_c3: Mapping[str, int] | None = None
) -> Summary:
    """Return the summary; C3 shows that it has what it took over, if not something else."""
    summarizer = Summarizer()
    for stamp_s, source, event in events:
        summarizer.event(source, stamp_s, event)
    taken = sum(event.samples for *_, event in events if isinstance(event, SamplesDelivered))
    summarizer.message('/c3/mission_status', status_message(at_c3 or {'auv_1': taken}))
    return summarizer.summary(facts)


def without(kind: type[Event], after_s: float = -1.0) -> Log:
    return [each for each in MISSION if each[0] <= after_s or not isinstance(each[2], kind)]


def test_figures_of_a_mission_by_hand() -> None:
    summary = summary_of(MISSION, BagFacts(wall_s=2.0, real_time_factor=48.5, complete=True))
    assert (summary.scenario, summary.planner, summary.seed) == ('minimal', 'ecc2009', 3)
    assert summary.software_version == '0.1.0'
    assert summary.complete
    assert summary.explored_s == 49.0  # cell (1, 1) is the last one
    assert summary.delivered_s == summary.mission_s == 97.0
    assert (summary.cells_total, summary.cells_explored) == (4, 4)
    assert summary.moves_total == 4  # the one at 59 s comes after the region was explored
    assert summary.revisits == 1  # (0, 0) at 24 s
    assert summary.neglect_s == {'auv_1': 4.0 + 5.0}
    assert summary.neglect_fraction == 9.0 / 49.0
    assert (summary.samples_collected, summary.samples_delivered) == (6, 6)
    assert summary.samples_missing == {'auv_1': 0}
    assert summary.samples_lost == 0
    assert summary.data_age_max_s == 48.0
    assert summary.c3_wait_s == 12.0 + 21.0 + 19.0  # before 12, from 16 to 37, from 41 to 60 s
    assert summary.lower_bound_s == 30.0
    assert summary.sortie_limit_violations == 1  # 37 s, the limit is 30 s
    assert (summary.wall_s, summary.real_time_factor) == (2.0, 48.5)
    first, _, third = summary.sorties
    assert (first.index, first.departed_s, first.returned_s, first.duration_s) == (1, 12, 16, 4)
    assert (first.worst_case_s, first.predicted_s, first.limit_s) == (12.0, 11.0, 30.0)
    assert (first.bound_ratio, summary.bound_ratio_max) == (4.0 / 12.0, 37.0 / 12.0)
    assert (first.missed, first.given_up, first.not_reached) == ((), (), ())
    assert (summary.missed_total, summary.searches_broken_off) == (0, 0)
    assert (summary.lost, summary.heard_again, summary.aborted) == ((), (), ())
    (meeting,) = first.meetings
    assert (meeting.auv, meeting.time_s, meeting.cell) == ('auv_1', 14.0, (1, 0))
    assert (meeting.slack_s, meeting.plan_status) == (20.0, 'ok')
    assert meeting.path == ((1, 0), (0, 0), (0, 1))
    assert third.meetings[0].path == ()
    assert third.meetings[0].slack_s is None


def test_json_has_the_promised_keys() -> None:
    content = json.loads(summary_of(MISSION).to_json())
    promised = (
        'schema_version scenario planner seed explored_s delivered_s mission_s cells_total'
        ' cells_explored moves_total revisits sorties sortie_limit_violations neglect_s'
        ' neglect_fraction samples_collected samples_delivered lower_bound_s radio wall_s'
        ' real_time_factor'
        ' bound_ratio_max c3_wait_s missed_total searches_broken_off lost heard_again aborted'
        ' samples_missing data_age_max_s'
    )
    assert set(promised.split()) <= set(content)
    sortie = content['sorties'][0]
    assert {
        *('index', 'departed_s', 'returned_s', 'duration_s', 'worst_case_s', 'predicted_s'),
        *('limit_s', 'meetings', 'bound_ratio', 'missed', 'given_up', 'not_reached'),
    } <= set(sortie)
    assert {'auv', 'time_s', 'cell', 'slack_s', 'path'} <= set(sortie['meetings'][0])
    assert sortie['meetings'][0]['path'] == [[1, 0], [0, 0], [0, 1]]
    assert content['wall_s'] is None
    assert content['radio'] is None


def test_mission_that_starts_late_on_the_clock_has_the_same_figures() -> None:
    # At sea, ROS time counts from 1970; an AUV may log before C3 does.
    shifted = [(stamp_s + 1.75e9, source, event) for stamp_s, source, event in MISSION]
    assert summary_of(shifted) == summary_of(MISSION)


def test_sortie_still_being_flown_counts_once_it_is_over_the_limit() -> None:
    in_time = [each for each in MISSION if each[0] < 91.0]
    late = [*in_time, (90.5, 'auv_1', MessageRefused(sender='x', reason='y', detail='z'))]
    assert summary_of(in_time).sortie_limit_violations == 0
    assert summary_of(late).sortie_limit_violations == 1
    assert summary_of(late).sorties[2].duration_s is None
    assert summary_of(late).sorties[2].returned_s is None
    assert summary_of(late).sorties[2].bound_ratio is None
    assert summary_of(late).bound_ratio_max == 4.0 / 12.0
    assert summary_of(late).c3_wait_s == 52.0


def test_a_wait_after_a_return_that_was_not_recorded_is_unknown() -> None:
    gap = [each for each in MISSION if each[0] != 16.0]
    assert summary_of(gap).c3_wait_s == 12.0 + 19.0


def test_mission_that_broke_off_has_nulls_and_a_reason() -> None:
    stopped = (40.0, 'world', MissionStopped(reason='node died', node='auv_1'))
    summary = summary_of([*[each for each in MISSION if each[0] < 40.0], stopped])
    assert not summary.complete
    assert summary.stopped == 'node died (auv_1)'
    assert summary.explored_s is None
    assert summary.delivered_s is None
    assert summary.mission_s is None
    assert summary.neglect_fraction is None
    assert summary.neglect_s == {'auv_1': 9.0}
    assert (summary.cells_explored, summary.moves_total, summary.revisits) == (3, 3, 1)
    assert (summary.samples_collected, summary.samples_delivered) == (4, 2)


def test_neglect_of_an_auv_that_is_never_met_counts_to_the_end() -> None:
    events = [each for each in MISSION if each[0] <= 12.0]
    assert summary_of(events).neglect_s == {'auv_1': 2.0}


def test_delivery_is_not_complete_while_a_sample_is_missing() -> None:
    mission = [*without(SamplesDelivered), (97.0, 'c3', delivered(5, cells=4, age_s=97.0))]
    summary = summary_of(mission)
    assert summary.delivered_s is None
    assert summary.samples_missing == {'auv_1': 1}
    assert summary.samples_lost == 1


def test_delivery_is_not_complete_while_c3_has_nothing_of_a_cell() -> None:
    # Entered by an AUV that is lost: explored, but nobody at C3 will ever know how it is there.
    mission = [*without(SamplesDelivered, after_s=50.0), (95.0, 'uav', given_up(3))]
    summary = summary_of(mission)
    assert (summary.explored_s, summary.samples_lost) == (49.0, 0)
    assert summary.delivered_s is None


def test_a_return_without_samples_delivers_nothing() -> None:
    mission = [*MISSION, (99.0, 'c3', delivered(0, cells=4, age_s=None))]
    assert summary_of(mission).delivered_s == 97.0


def test_an_entry_of_the_log_that_is_said_again_counts_once() -> None:
    # A process says the last entries of the one before again, which may have died before it did.
    summarizer = Summarizer()
    for number, (stamp_s, source, event) in enumerate(MISSION):
        entry = Text(codec.encode(event, src=source, dst='*', seq=number, stamp_s=stamp_s))
        assert summarizer.message('/mission_events', entry)
        assert not summarizer.message('/mission_events', entry)
    summarizer.message('/c3/mission_status', status_message({'auv_1': 6}))
    assert summarizer.summary() == summary_of(MISSION)


def test_to_tell_entries_that_are_said_again_takes_little_memory() -> None:
    summarizer = Summarizer()
    tracemalloc.start()
    for number in range(300):
        # No figure is made of what cannot be read, so nothing else is kept of it.
        entry = Text(b'%d' % number * 10_000)
        assert summarizer.message('/mission_events', entry)
        assert not summarizer.message('/mission_events', entry)
    kept_bytes, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert kept_bytes < 300 * 500


def test_cells_that_the_operator_took_out_are_not_waited_for() -> None:
    without_one = msgspec.structs.replace(ORDERED, revision=1, masked=((1, 1),))
    taken = (12.0, 'uav', DirectiveTaken(directive=without_one))
    mission = [*[each for each in MISSION if each[0] < 49.0], taken]
    summary = summary_of(mission)
    assert summary.cells_total == 3
    assert (summary.explored_s, summary.delivered_s) == (34.0, 41.0)
    assert summary.cells_explored == 3
    assert summary.lower_bound_s is None  # it is that of the region as it was ordered
    # It may take them in again.
    assert (
        summary_of([*mission, (45.0, 'uav', DirectiveTaken(directive=ORDERED))]).cells_total == 4
    )


WALL: tuple[Cell, ...] = ((2, 0), (2, 1), (2, 2))


def wanted(**changes: object) -> Directive:
    """Return what an operator wants of the scenario below."""
    return msgspec.structs.replace(ORDERED, **{'revision': 1, 'masked': WALL, **changes})


def divided(planner: str) -> Scenario:
    """Return a scenario of two parts with 2 x 3 cells, and an AUV in each."""
    content = json.loads(scenario_json(load_scenario('minimal')))
    content['region'] = {'cols': 5, 'rows': 3, 'cell_m': 10.0}
    content['region']['masked'] = WALL
    content['c3'] = {'east_m': -20.0, 'north_m': 15.0}
    content['planner'] |= {'name': planner}
    first = content['auvs'][0] | {'initial_path': [[0, 0], [0, 1]]}
    second = first | {'name': 'auv_2', 'initial_path': [[3, 0], [3, 1]]}
    content['auvs'] = [first, second]
    return parse_scenario(json.dumps(content))


EAST: tuple[Cell, ...] = ((3, 1), (3, 2), (4, 0), (4, 1), (4, 2))


@pytest.mark.parametrize(
    ('log', 'out_of_reach'),
    [
        ([], ()),
        ([(9.0, 'uav', GivenUp(sortie=1, auv='auv_2'))], EAST),
        ([(9.0, 'uav', GivenUp(sortie=1, auv='auv_1'))], ((0, 1), (0, 2), (1, 0), (1, 1), (1, 2))),
        ([(9.0, 'auv_2', StayedUp(reason=RecoveryReason.ABORTED))], EAST),
        ([(9.0, 'uav', DirectiveTaken(directive=wanted(recalled=('auv_2',))))], EAST),
        # Nobody is left: that is what the operator wanted.
        ([(9.0, 'uav', DirectiveTaken(directive=wanted(recalled=('auv_1', 'auv_2'))))], ()),
        # What is taken out is not missed.
        (
            [
                (9.0, 'uav', DirectiveTaken(directive=wanted(masked=(*WALL, *EAST[1:])))),
                (10.0, 'uav', GivenUp(sortie=1, auv='auv_2')),
            ],
            EAST[:1],
        ),
    ],
    ids=['none', 'lost', 'other_lost', 'asks_for_help', 'recalled', 'all_recalled', 'taken_out'],
)
def test_cells_are_out_of_reach_of_all_who_are_left(
    log: Log, out_of_reach: tuple[Cell, ...]
) -> None:
    starts: Log = [
        (0.0, 'c3', started(divided('ecc2009'))),
        (0.0, 'auv_1', entered(0, (0, 0))),
        (0.0, 'auv_2', entered(0, (3, 0))),
    ]
    assert summary_of([*starts, *log]).out_of_reach == out_of_reach


def test_cells_are_out_of_reach_of_sorties_that_are_too_short() -> None:
    # The UAV hears an AUV in the last column from 45 m away from C3: 12 s there at 4 m/s.
    far: tuple[Cell, ...] = ((4, 0), (4, 1), (4, 2))
    starts: Log = [
        (0.0, 'c3', started(divided('robust'))),
        (0.0, 'auv_1', entered(0, (0, 0))),
        (0.0, 'auv_2', entered(0, (3, 0))),
    ]
    for limit_s, out_of_reach in ((24.0, ()), (23.0, far)):
        taken = DirectiveTaken(directive=wanted(sortie_limit_s=limit_s))
        assert summary_of([*starts, (1.0, 'uav', taken)]).out_of_reach == out_of_reach


def test_the_oldest_sample_that_was_never_delivered_ages_until_the_end() -> None:
    mission = without(SamplesDelivered, after_s=20.0)  # those of 24, 34, 49 and 59 s stay away
    assert summary_of(mission).data_age_max_s == 97.0 - 24.0
    late = (120.0, 'auv_1', MessageRefused(sender='x', reason='y', detail='z'))
    assert summary_of([*mission, late]).data_age_max_s == 97.0 - 24.0
    running = [each for each in mission if each[0] <= 60.0]
    assert summary_of(running).data_age_max_s == 60.0 - 24.0


def test_what_c3_has_of_an_auv_is_what_c3_says() -> None:
    # Five of six arrived, whatever the log of deliveries claims.
    assert summary_of(MISSION, at_c3={'auv_1': 5}).samples_missing == {'auv_1': 1}
    silent = Summarizer()
    for stamp_s, source, event in MISSION:
        silent.event(source, stamp_s, event)
    summary = silent.summary()
    assert (summary.samples_missing, summary.samples_lost) == (None, None)
    assert (summary.delivered_s, summary.data_age_max_s) == (None, None)


# --- lost, late and broken off -------------------------------------------------------------------


def given_up(sortie: int, auv: str = 'auv_1') -> GivenUp:
    return GivenUp(sortie=sortie, auv=auv)


def test_what_a_lost_auv_has_on_board_is_missing_but_no_fault_of_the_mission() -> None:
    other = [(0.0, 'auv_2', entered(0, (1, 1))), (10.0, 'auv_2', entered(1, (1, 0)))]
    lost = (41.0, 'uav', given_up(2, 'auv_2'))
    summary = summary_of([*MISSION, *other, lost], at_c3={'auv_1': 6, 'auv_2': 0})
    assert summary.lost == ('auv_2',)
    assert summary.samples_missing == {'auv_1': 0, 'auv_2': 2}
    assert summary.samples_lost == 0
    assert summary.delivered_s == 97.0
    assert summary.data_age_max_s == 97.0  # its first sample grew old until the end
    assert summary_of([*MISSION, *other], at_c3={'auv_1': 6, 'auv_2': 0}).samples_lost == 2


@pytest.mark.parametrize(
    ('given_up_s', 'heard_again_s', 'lost', 'heard_again'),
    [
        ([41.0], [], ('auv_1',), ()),
        ([41.0], [64.0], (), ('auv_1',)),
        ([41.0, 70.0], [64.0], ('auv_1',), ('auv_1',)),
        ([41.0], [41.0], (), ('auv_1',)),  # within a tick the UAV first decides and then listens
    ],
    ids=['for_good', 'heard_again', 'twice', 'in_the_same_tick'],
)
def test_lost_is_who_was_given_up_and_not_heard_again(
    given_up_s: list[float],
    heard_again_s: list[float],
    lost: tuple[str, ...],
    heard_again: tuple[str, ...],
) -> None:
    events: Log = [(time_s, 'uav', given_up(2)) for time_s in given_up_s]
    events += [(time_s, 'uav', HeardAgain(auv='auv_1')) for time_s in heard_again_s]
    for order in (events, events[::-1]):
        summary = summary_of([*order, *MISSION])
        assert (summary.lost, summary.heard_again) == (lost, heard_again)


def test_a_sortie_tells_whom_it_missed_gave_up_and_left_out() -> None:
    missed = [(40.0, 'uav', Missed(sortie=2, auv=auv)) for auv in ('auv_3', 'auv_2')]
    broken_off = SearchBrokenOff(sortie=2, not_reached=('auv_5', 'auv_4'))
    again = (90.0, 'uav', Missed(sortie=3, auv='auv_2'))
    summary = summary_of(
        [*MISSION, *missed, (40.0, 'uav', given_up(2, 'auv_3')), (40.0, 'uav', broken_off), again]
    )
    assert (summary.missed_total, summary.searches_broken_off) == (3, 1)
    second, third = summary.sorties[1:]
    assert (second.missed, second.given_up) == (('auv_2', 'auv_3'), ('auv_3',))
    assert second.not_reached == ('auv_5', 'auv_4')  # in the order of the route
    assert (third.missed, third.given_up, third.not_reached) == (('auv_2',), (), ())


def test_who_asked_for_help_is_named_whether_it_came_up_for_it_or_was_up() -> None:
    assert summary_of(MISSION).aborted == ()
    under_way = (70.0, 'auv_3', surfaced(4, (0, 0), LegOutcome.ABORTED))
    at_the_surface = (70.0, 'auv_2', StayedUp(reason=RecoveryReason.ABORTED))
    planned = (70.0, 'auv_1', StayedUp(reason=RecoveryReason.EXPLORED))
    assert summary_of([*MISSION, under_way, at_the_surface, planned]).aborted == ('auv_2', 'auv_3')


def test_a_sortie_that_had_no_way_to_go_has_no_ratio() -> None:
    at_home = [(98.0, 'uav', departed(4, worst_case_s=0.0))]
    at_home.append((98.0, 'uav', SortieReturned(sortie=4, duration_s=0.0)))
    summary = summary_of([*MISSION, *at_home])
    assert summary.sorties[3].bound_ratio is None
    assert summary.bound_ratio_max == 37.0 / 12.0


def test_changes_of_what_silence_means_are_kept_once() -> None:
    summarizer = Summarizer()
    for stamp_s, contact in (
        (0.0, ContactState.EXPECTED_SILENT),
        (10.0, ContactState.EXPECTED_SILENT),
        (12.0, ContactState.DUE),
        (16.0, None),
    ):
        message = status_message({'auv_1': 0}, {'auv_1': contact}, stamp_s)
        summarizer.message('/c3/mission_status', message)
    assert summarizer.contacts == {
        'auv_1': [(0.0, ContactState.EXPECTED_SILENT), (12.0, ContactState.DUE), (16.0, None)]
    }


def test_nothing_recorded_gives_a_summary_of_nulls() -> None:
    summary = summary_of([])
    assert summary.scenario is None
    assert summary.cells_total is None
    assert (summary.samples_lost, summary.samples_missing) == (None, {})
    assert summarize([]).samples_missing is None
    assert (summary.bound_ratio_max, summary.data_age_max_s) == (None, None)
    assert summary.c3_wait_s == 0.0
    assert json.loads(summary.to_json())['sorties'] == []


@given(st.randoms(use_true_random=False), st.integers(0, len(MISSION)))
def test_order_of_arrival_does_not_matter(shuffler: random.Random, end: int) -> None:
    events = MISSION[:end]
    shuffled = list(events)
    shuffler.shuffle(shuffled)
    assert summary_of(shuffled) == summary_of(events)


# --- pass conditions -----------------------------------------------------------------------------


def with_conditions(**conditions: Limits) -> Scenario:
    return msgspec.structs.replace(tiny(), pass_conditions=PassConditions(**conditions))


def test_met_conditions_say_nothing() -> None:
    scenario = with_conditions(
        explored_s=Limits(min=49.0, max=49.0), sortie_limit_violations=Limits(max=1)
    )
    assert failed_conditions(summary_of(MISSION), scenario) == []
    checks = check_conditions(summary_of(MISSION), scenario)
    assert [(check.name, check.value, check.allowed) for check in checks] == [
        ('explored_s', 49.0, 'at least 49 and at most 49'),
        ('sortie_limit_violations', 1, 'at most 1'),
        ('samples_lost', 0, 'at most 0'),
    ]


def test_failed_conditions_are_told_with_figure_and_limit() -> None:
    scenario = with_conditions(
        explored_s=Limits(min=50.0, max=60.0),
        neglect_fraction=Limits(max=0.1),
        sortie_limit_violations=Limits(max=0),
    )
    assert failed_conditions(summary_of(MISSION), scenario) == [
        'explored_s is 49, less than allowed: at least 50 and at most 60',
        'neglect_fraction is 0.183673, more than allowed: at most 0.1',
        'sortie_limit_violations is 1, more than allowed: at most 0',
    ]


def test_null_figures_never_pass() -> None:
    scenario = with_conditions(explored_s=Limits(max=60.0), delivered_s=Limits(min=1.0, max=2.0))
    assert failed_conditions(summary_of([]), scenario) == [
        'explored_s has no value, it must be at most 60',
        'delivered_s has no value, it must be at least 1 and at most 2',
        'samples_lost has no value, it must be at most 0',
    ]
    unconditional = with_conditions(samples_lost=Limits())
    assert failed_conditions(summary_of([]), unconditional) == []


# --- whole missions ------------------------------------------------------------------------------


@functools.cache
def flown(name: str, probability: float, seed: int) -> list[tuple[str, float, RosMessage]]:
    """Fly a mission in which AUVs surface early on some legs; return all its messages."""
    content = json.loads(scenario_json(load_scenario(name)))
    content['seed'] = seed
    for auv in content['auvs']:
        auv['surfacing'] = {'model': 'early', 'probability': probability}
    records: list[tuple[str, float, RosMessage]] = []

    def sink(node: str, frame: Frame) -> None:
        records.append((frame.topic.resolve(f'/{node}'), 0.0, frame.message))

    fly(parse_scenario(json.dumps(content)), sink)
    return records


MISSIONS = [('ecc2009', 0.0, 0), ('ecc2009', 0.3, 1), ('ecc2009', 0.5, 2), ('minimal', 0.5, 3)]


def odometry(records: list[tuple[str, float, RosMessage]], vehicle: str) -> list[Odometry]:
    return [
        message
        for topic, _, message in records
        if topic == f'/{vehicle}/odom' and isinstance(message, Odometry)
    ]


def dives_s(records: list[tuple[str, float, RosMessage]], vehicle: str) -> list[float]:
    """Return when a vehicle was given its paths."""
    return [
        message.stamp_s
        for topic, _, message in records
        if topic == f'/{vehicle}/path' and isinstance(message, TrackPath)
    ]


def cell_entries(track: list[Odometry], cell_m: float) -> Iterator[tuple[float, Cell]]:
    """Yield time and cell whenever a vehicle comes to the centre of another cell."""
    last: Cell | None = None
    for state in track:
        col, row = (x / cell_m - 0.5 for x in (state.position.east_m, state.position.north_m))
        cell = (round(col), round(row))
        if cell != last and abs(col - cell[0]) < 1e-6 and abs(row - cell[1]) < 1e-6:
            last = cell
            yield state.stamp_s, cell


def runs(flags: list[tuple[float, bool]]) -> Iterator[tuple[float, float]]:
    """Yield first and last time of every run of true values."""
    for is_true, run in itertools.groupby(flags, key=lambda each: each[1]):
        times_s = [time_s for time_s, _ in run]
        if is_true:
            yield times_s[0], times_s[-1]


@pytest.mark.parametrize(('name', 'probability', 'seed'), MISSIONS)
def test_odometry_alone_shows_the_same_mission(name: str, probability: float, seed: int) -> None:
    records = flown(name, probability, seed)
    summary = summarize(records)
    scenario = load_scenario(name)
    tracks = {auv.name: odometry(records, auv.name) for auv in scenario.auvs}

    entries = [list(cell_entries(track, scenario.region.cell_m)) for track in tracks.values()]
    first_s: dict[Cell, float] = {}
    for time_s, cell in sorted(entry for each in entries for entry in each):
        first_s.setdefault(cell, time_s)
    assert len(first_s) == scenario.region.cells_total
    explored_s = max(first_s.values())
    assert summary.explored_s == explored_s
    moves = [entry for each in entries for entry in each[1:] if entry[0] <= explored_s]
    assert summary.moves_total == len(moves)
    assert summary.revisits == len(moves) - (len(first_s) - len(scenario.auvs))

    for auv, track in tracks.items():
        up = [(state.stamp_s, state.z_m == 0.0) for state in track]
        assert all(state.z_m == 0.0 or state.z_m <= -1.0 for state in track)
        # Met at the last tick at the surface: under way from the next one on.
        waits_s = [min(last_s, explored_s) - begin_s for begin_s, last_s in runs(up)]
        # One that comes up again where it dived is under water for less than a tick; that tick is
        # no wait, but only its new path shows it.
        dives = sum(
            begin_s <= dived_s < min(last_s, explored_s)
            for begin_s, last_s in runs(up)
            for dived_s in dives_s(records, auv)
        )
        waited_s = sum(max(0.0, wait_s) for wait_s in waits_s) - dives * scenario.tick_s
        assert summary.neglect_s[auv] == waited_s

    tick_s = scenario.tick_s
    uav = [(state.stamp_s, state.position != scenario.c3) for state in odometry(records, 'uav')]
    flights = [(begin_s - tick_s, end_s + tick_s) for begin_s, end_s in runs(uav)]
    sorties = [(each.departed_s, each.returned_s or 0.0) for each in summary.sorties]
    # An AUV within reach of C3 may be met without leaving it.
    at_c3 = [sortie for sortie in sorties if sortie not in flights]
    assert [sortie for sortie in sorties if sortie in flights] == flights
    for departed_s, returned_s in at_c3:
        assert not any(is_away for time_s, is_away in uav if departed_s <= time_s <= returned_s)
    assert [each.duration_s for each in summary.sorties] == [end - begin for begin, end in sorties]
    over = [end_s - begin_s > scenario.sortie.limit_s for begin_s, end_s in flights]
    assert summary.sortie_limit_violations == sum(over)


@pytest.mark.parametrize(('name', 'probability', 'seed'), MISSIONS)
def test_no_mission_beats_the_lower_bound_and_nothing_is_lost(
    name: str, probability: float, seed: int
) -> None:
    summary = summarize(flown(name, probability, seed))
    assert summary.complete
    assert summary.explored_s is not None
    assert summary.lower_bound_s is not None
    assert summary.delivered_s is not None
    assert summary.lower_bound_s <= summary.explored_s <= summary.delivered_s
    assert summary.samples_lost == 0
    assert summary.delivered_s == summary.mission_s


def test_reference_mission_shows_what_the_paper_does() -> None:
    summary = summarize(flown('ecc2009', 0.0, 0))
    assert failed_conditions(summary, load_scenario('ecc2009')) == []
    times_s = [meeting.time_s for meeting in summary.sorties[0].meetings]
    assert [*times_s, summary.sorties[0].returned_s] == [14.0, 20.0, 33.0, 44.0]
    assert summary.radio is not None
    assert summary.radio.delivered > 0


@settings(max_examples=25)
@given(data=st.data())
def test_every_beginning_of_a_mission_has_a_summary(data: st.DataObject) -> None:
    records = flown('minimal', 0.5, 3)
    end = data.draw(st.integers(0, len(records)))
    summary = summarize(records[:end])
    whole = summarize(records)
    assert summary.samples_delivered <= summary.samples_collected <= whole.samples_collected
    assert summary.cells_explored <= whole.cells_explored
    assert summary.explored_s in (None, whole.explored_s)
    assert summary.mission_s in (None, whole.mission_s)
    assert summary.sorties[:-1] == whole.sorties[: max(0, len(summary.sorties) - 1)]
    assert json.loads(summary.to_json())['schema_version'] == 1


def test_events_and_messages_give_the_same_summary() -> None:
    records = flown('minimal', 0.5, 3)
    summarizer = Summarizer()
    for topic, _, message in records:
        if topic == '/mission_events' and isinstance(message, Text):
            envelope, body = codec.decode(message.data)
            assert isinstance(body, Event)
            summarizer.event(envelope.src, envelope.stamp, body)
        elif topic == '/c3/mission_status':
            summarizer.message(topic, message)
    from_events = summarizer.summary()
    assert from_events.radio is None
    assert msgspec.structs.replace(from_events, radio=summarize(records).radio) == summarize(
        records
    )


def test_payload_that_is_no_event_is_counted_and_changes_nothing() -> None:
    records = flown('minimal', 0.5, 3)
    broken: list[tuple[str, float, RosMessage]] = [
        ('/mission_events', 0.0, Text(b'{"schema": "MissionEvent"}')),
        ('/world/radio_status', 0.0, Text(b'\xff')),
        ('/auv_1/radio/tx', 0.0, Text(b'not looked at')),
    ]
    summary = summarize([*broken, *records])
    assert summary.unreadable == 2
    assert msgspec.structs.replace(summary, unreadable=0) == summarize(records)


def test_radio_counters_are_the_last_that_were_shown() -> None:
    def status(delivered: int) -> tuple[str, float, RosMessage]:
        body = RadioStatus(delivered=delivered, blocked={'range': 2 * delivered})
        data = codec.encode(body, src='world', dst='*', seq=delivered, stamp_s=0.0)
        return ('/world/radio_status', 0.0, Text(data))

    radio = summarize([status(1), status(5)]).radio
    assert radio is not None
    assert (radio.delivered, radio.blocked) == (5, {'range': 10})


def test_refusals_are_listed() -> None:
    refused = MessageRefused(sender='uav', reason='malformed', detail='`$.seq`')
    (refusal,) = summary_of([(3.0, 'auv_1', refused)]).refusals
    assert (refusal.node, refusal.sender, refusal.reason) == ('auv_1', 'uav', 'malformed')
