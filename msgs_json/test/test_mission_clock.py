"""The mission's clock goes on whatever becomes of the ROS clock, and of the process."""

from __future__ import annotations

from msgs_json.mission_clock import MissionClock
from msgs_json.store import MemoryStore


def clock(
    store: MemoryStore,
    ros_s: float,
    steady_s: float,
    boot_id: str = 'first',
    latest_s: float = 0.0,
) -> MissionClock:
    return MissionClock(store, ros_s=ros_s, steady_s=steady_s, boot_id=boot_id, latest_s=latest_s)


def test_it_begins_with_the_ros_clock_and_goes_on_with_the_steady_one() -> None:
    each = clock(MemoryStore(), ros_s=1_700_000_000.0, steady_s=50.0)
    assert each.now_s(50.0) == 1_700_000_000.0
    assert each.now_s(53.5) == 1_700_000_003.5


def test_a_new_process_of_the_same_boot_does_not_see_that_the_ros_clock_was_set() -> None:
    store = MemoryStore()
    clock(store, ros_s=1000.0, steady_s=50.0)
    store.commit()
    again = clock(store.reopened(), ros_s=400.0, steady_s=60.0)
    assert again.now_s(61.0) == 1011.0


def test_after_a_boot_the_ros_clock_is_asked_again() -> None:
    store = MemoryStore()
    clock(store, ros_s=1000.0, steady_s=5000.0)
    store.commit()
    again = clock(store.reopened(), ros_s=1200.0, steady_s=7.0, boot_id='second')
    assert again.now_s(8.0) == 1201.0


def test_after_a_boot_in_the_past_time_goes_on_from_where_it_was_last() -> None:
    store = MemoryStore()
    clock(store, ros_s=1000.0, steady_s=5000.0)
    store.commit()
    again = clock(store.reopened(), ros_s=0.0, steady_s=7.0, boot_id='second', latest_s=1100.0)
    assert again.now_s(8.0) == 1101.0


def test_what_was_not_committed_is_asked_again() -> None:
    store = MemoryStore()
    clock(store, ros_s=1000.0, steady_s=50.0)
    again = clock(store.reopened(), ros_s=1300.0, steady_s=51.0)
    assert again.now_s(51.0) == 1300.0
