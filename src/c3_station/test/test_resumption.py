"""What is left of a run whose processes have all ended."""

from __future__ import annotations

import fcntl
from typing import TYPE_CHECKING

import msgspec
import pytest

from c3_station.bag import BagFacts, BagWriter
from c3_station.recorded_topics import mission_topics
from c3_station.resumption import bags_aside, resumption, set_bag_aside
from c3_station.run_folder import RunFolder, Way
from c3_station.scenario_files import load_scenario, scenario_json
from msgs_json.ros_messages import ClockTime, to_cdr
from msgs_json.topics import CLOCK

if TYPE_CHECKING:
    from pathlib import Path

SCENARIO = load_scenario('minimal')


@pytest.fixture
def folder(tmp_path: Path) -> RunFolder:
    """Return the folder of a run that was flown by nodes."""
    folder = RunFolder(tmp_path)
    folder.scenario.write_bytes(scenario_json(SCENARIO))
    folder.way.write_bytes(msgspec.json.encode(Way(rate=60.0, ros=True, bag=True)))
    return folder


def record(folder: RunFolder, seconds: int, *, complete: bool = False) -> None:
    with BagWriter(folder.bag, mission_topics(SCENARIO)) as bag:
        for now_s in range(seconds):
            bag.write(CLOCK.name, to_cdr(ClockTime(time_s=float(now_s))), now_s * 10**9)
        bag.close(BagFacts(complete=complete))


def test_a_run_is_resumed_as_it_was_flown(folder: RunFolder) -> None:
    record(folder, 3)
    left = resumption(folder.path)
    assert (left.scenario, left.way) == (SCENARIO, Way(rate=60.0, ros=True, bag=True))


def test_a_bag_that_was_not_closed_does_not_hinder(folder: RunFolder) -> None:
    record(folder, 3, complete=True)
    (folder.bag / 'metadata.yaml').unlink()
    assert resumption(folder.path).scenario == SCENARIO


def test_what_cannot_be_resumed_is_refused_with_the_reason(folder: RunFolder) -> None:
    with pytest.raises(ValueError, match='nowhere: there is no such folder'):
        resumption(folder.path / 'nowhere')
    empty = folder.path / 'empty'
    empty.mkdir()
    with pytest.raises(ValueError, match=r'there is no scenario\.json'):
        resumption(empty)
    record(folder, 3, complete=True)
    with pytest.raises(ValueError, match='its mission is over; see it with: python3 orch'):
        resumption(folder.path)
    folder.way.write_bytes(msgspec.json.encode(Way(rate=0.0, ros=False, bag=True)))
    with pytest.raises(ValueError, match='flown in one process'):
        resumption(folder.path)
    folder.way.write_text('{"rate": "fast"}')
    with pytest.raises(ValueError, match=r'run\.json: Expected'):
        resumption(folder.path)
    folder.way.unlink()
    with pytest.raises(ValueError, match=r'there is no run\.json'):
        resumption(folder.path)


def test_the_longest_bag_is_the_one_to_go_on_with(folder: RunFolder) -> None:
    assert set_bag_aside(folder) is None
    record(folder, 5)
    first = set_bag_aside(folder)
    assert first in bags_aside(folder)
    assert not folder.bag.exists()
    record(folder, 2)  # killed while it copied the first
    assert set_bag_aside(folder) == first
    record(folder, 9)
    assert set_bag_aside(folder) == folder.path / 'bag_before_3'


def test_a_bag_without_a_message_is_none(folder: RunFolder) -> None:
    record(folder, 0)
    assert set_bag_aside(folder) is None


def test_a_folder_is_held_once(folder: RunFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('c3_station.run_folder._ENDING_S', 0.0)
    with folder.held():
        assert len(folder.lock_files) == 1
        with (
            pytest.raises(ValueError, match='its mission is still flown'),
            RunFolder(folder.path).held(),
        ):
            pytest.fail('held twice')
    assert folder.lock_files == ()
    with folder.lock.open('w') as file:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # free again
