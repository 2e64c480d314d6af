"""Agents are killed, starved and lied to, and the mission comes to what it would come to."""

from __future__ import annotations

from collections import Counter

import pytest

from c3_station.fault_schedule import Moment
from c3_station.faults_in_process import FaultTally
from c3_station.faulty_store import FaultyStore, ProcessDied
from c3_station.in_process import fly
from c3_station.scenario_changes import read_change
from c3_station.scenario_files import load_scenario, with_choices
from c3_station.summary import Summarizer, Summary
from msgs_json.messages import CellEntered, Event, NodeRestarted, StorageFailed, StorageRestored
from msgs_json.store import MemoryStore, StoreError

Flown = tuple[Summary, list[Event], FaultTally]


def flown(*changes: str, seed: int = 1, name: str = 'ecc2009') -> Flown:
    scenario = with_choices(
        load_scenario(name),
        planner='robust',
        seed=seed,
        changes=[read_change(text) for text in changes],
    )
    summarizer = Summarizer()
    tally = fly(scenario, summarizer.frame)
    return summarizer.summary(), [each.event for each in summarizer.events], tally


def keeps_its_promises(summary: Summary) -> bool:
    return (
        summary.complete
        and summary.samples_lost == 0
        and summary.samples_doubled == 0
        and summary.sortie_limit_violations == 0
    )


def cells_entered(events: list[Event]) -> list[Event]:
    return [event for event in events if isinstance(event, CellEntered)]


# --- the store -----------------------------------------------------------------------------------


def test_a_process_dies_before_what_it_did_is_stored_or_after() -> None:
    store = FaultyStore(MemoryStore())
    for moment, expected in ((Moment.BEFORE_COMMIT, {}), (Moment.AFTER_COMMIT, {'a': 1})):
        store.put('number', 'a', 1)
        store.dies = moment
        with pytest.raises(ProcessDied):
            store.commit()
        store.reopen()
        assert store.load('number', int) == expected
        assert not store.is_changed
    store.put('number', 'a', 2)
    store.commit()
    assert store.load('number', int) == {'a': 2}


def test_on_a_full_disk_nothing_is_stored_and_nothing_is_forgotten() -> None:
    store = FaultyStore(MemoryStore())
    store.is_full = True
    store.put('number', 'a', 1)
    with pytest.raises(StoreError, match='no space left'):
        store.commit()
    assert store.load('number', int) == {}
    store.is_full = False
    store.commit()
    assert store.load('number', int) == {'a': 1}


# --- missions ------------------------------------------------------------------------------------


def test_who_dies_between_two_inputs_leaves_no_trace_in_the_mission() -> None:
    # Hangs end so. On an ideal radio nothing is said again, so all is as if nobody had died.
    calm, calm_events, _ = flown()
    summary, events, _ = flown('faults.hangs=10')
    assert sum(isinstance(event, NodeRestarted) for event in events) == 10
    assert cells_entered(events) == cells_entered(calm_events)
    assert (summary.explored_s, summary.mission_s) == (calm.explored_s, calm.mission_s)


def test_kills_at_any_moment_cost_no_sample_and_no_limit() -> None:
    summary, events, _ = flown('faults.kills=40')
    restarts = Counter(event.node for event in events if isinstance(event, NodeRestarted))
    assert restarts.keys() == {'auv_1', 'auv_2', 'auv_3', 'uav', 'c3'}
    assert restarts.total() > 35  # some wait for a message that does not come any more
    assert keeps_its_promises(summary)


def test_who_cannot_store_is_silent_and_speaks_again() -> None:
    # The radio takes a gap in what a station says for somebody else's.
    summary, events, _ = flown('faults.disk_full_s=40')
    assert sum(isinstance(event, StorageFailed) for event in events) > 0
    kinds = Counter(type(event) for event in events)
    assert kinds[StorageFailed] == kinds[StorageRestored]
    assert keeps_its_promises(summary)


def test_strangers_are_refused_one_and_all_and_change_nothing() -> None:
    calm, calm_events, _ = flown()
    summary, events, tally = flown('faults.forged=600')
    assert tally == FaultTally(forged=600, obeyed=0, refused=600)
    assert cells_entered(events) == cells_entered(calm_events)
    assert summary.mission_s == calm.mission_s


def test_a_stranger_forges_nothing_after_what_the_radio_has_damaged() -> None:
    summary, _, tally = flown('faults.forged=300', 'radio.corruption=0.5')
    assert (tally.forged, tally.obeyed) == (300, 0)
    assert keeps_its_promises(summary)


def test_a_clock_that_is_set_changes_nothing_even_for_who_dies() -> None:
    _, calm_events, _ = flown('faults.kills=10')
    _, events, _ = flown('faults.kills=10', 'faults.clock_jump_s=500')
    assert cells_entered(events) == cells_entered(calm_events)


def test_an_auv_whose_cell_is_off_by_one_is_found_out_and_stays_up() -> None:
    summary, events, _ = flown('faults.off_by_one=auv_2', 'faults.until_s=100')
    stayed = [event for event in events if type(event).__name__ == 'StayedUp']
    assert [event.reason.value for event in stayed].count('off_course') == 1  # type: ignore[attr-defined]
    assert keeps_its_promises(summary)
    assert summary.cells_explored == summary.cells_total


@pytest.mark.slow
@pytest.mark.parametrize('seed', range(10))
@pytest.mark.parametrize(
    'changes',
    [
        ('faults.kills=25',),
        ('faults.kills=25', 'radio.loss=0.3'),
        ('faults.disk_full_s=60',),
        ('faults.off_by_one=auv_1',),
        (
            'faults.kills=10',
            'faults.hangs=5',
            'faults.forged=500',
            'faults.disk_full_s=20',
            'faults.clock_jump_s=60',
            'radio.loss=0.1',
            'radio.corruption=0.1',
        ),
    ],
    ids=' '.join,
)
def test_promises_hold_over_faults_and_seeds(changes: tuple[str, ...], seed: int) -> None:
    summary, _, tally = flown(*changes, seed=seed)
    assert tally.obeyed == 0
    assert keeps_its_promises(summary)
