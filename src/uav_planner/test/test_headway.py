from __future__ import annotations

import pytest

from msgs_json.geometry import Point
from uav_planner.headway import ALLOWANCE, SETTLED_TICKS, SLOWEST, Headway

STEP_M = 4.0
ORIGIN = Point(east_m=0.0, north_m=0.0)
EAST = Point(east_m=100.0, north_m=0.0)
NORTH = Point(east_m=0.0, north_m=100.0)


def fly(headway: Headway, start: Point, target: Point, ways_m: list[float]) -> Point:
    """Fly toward a target with a given way at every tick; return where that ends."""
    here = start
    for way_m in ways_m:
        there = here.toward(target, way_m)
        headway.note(here, there, target)
        here = there
    return here


def test_who_was_told_nothing_reckons_with_the_speed_it_knows() -> None:
    assert Headway(STEP_M).safe_step_m == STEP_M


def test_without_wind_the_way_home_is_reckoned_exactly() -> None:
    """Not nearly so: a tick more would break a sortie off that keeps L as planned."""
    headway = Headway(0.1)
    there = fly(headway, ORIGIN, Point(east_m=1 / 3, north_m=20.0), [0.1] * 250)
    fly(headway, there, ORIGIN, [0.1] * 250)
    assert headway.safe_step_m == 0.1


@pytest.mark.parametrize('way_m', [3.0, 5.0], ids=['head_wind', 'tail_wind'])
def test_what_holds_it_up_or_pushes_it_may_hold_it_up_on_the_way_home(way_m: float) -> None:
    headway = Headway(STEP_M)
    fly(headway, ORIGIN, EAST, [way_m] * SETTLED_TICKS)
    assert headway.safe_step_m == pytest.approx(STEP_M - ALLOWANCE * 1.0)
    assert headway.next_sortie().safe_step_m == headway.safe_step_m
    assert headway.next_sortie().next_sortie().safe_step_m == STEP_M


def test_the_worst_of_all_hops_counts() -> None:
    headway = Headway(STEP_M)
    there = fly(headway, ORIGIN, EAST, [2.5] * 10)
    fly(headway, there, NORTH, [3.9] * 10)
    assert headway.safe_step_m == pytest.approx(STEP_M - ALLOWANCE * 1.5)


def test_it_takes_some_ticks_of_a_hop_to_tell() -> None:
    """A vehicle that turns or speeds up is slow at first, without any wind."""
    headway = Headway(STEP_M)
    there = fly(headway, ORIGIN, EAST, [2.0] * (SETTLED_TICKS - 1))
    assert headway.safe_step_m == STEP_M
    fly(headway, there, EAST, [2.0])
    assert headway.safe_step_m == pytest.approx(STEP_M - ALLOWANCE * 2.0)


def test_a_slow_start_is_forgiven_as_far_as_it_is_made_up_for() -> None:
    headway = Headway(STEP_M)
    fly(headway, ORIGIN, EAST, [3.4, *[4.0] * (SETTLED_TICKS - 1)])
    assert headway.safe_step_m == pytest.approx(STEP_M - ALLOWANCE * 0.6 / SETTLED_TICKS)


def test_the_last_tick_of_a_hop_may_be_short_and_tells_nothing() -> None:
    headway = Headway(STEP_M)
    there = fly(headway, ORIGIN, Point(east_m=18.5, north_m=0.0), [STEP_M] * 5)
    assert there.east_m == 18.5
    assert headway.safe_step_m == STEP_M


def test_who_has_arrived_and_waits_is_not_held_up() -> None:
    headway = Headway(STEP_M)
    fly(headway, EAST, EAST, [0.0] * 10)
    assert headway.safe_step_m == STEP_M


def test_with_another_target_the_ticks_are_counted_anew() -> None:
    headway = Headway(STEP_M)
    there = fly(headway, ORIGIN, EAST, [1.0] * (SETTLED_TICKS - 1))
    there = fly(headway, there, NORTH, [1.0] * (SETTLED_TICKS - 1))
    fly(headway, there, EAST, [1.0] * (SETTLED_TICKS - 1))
    assert headway.safe_step_m == STEP_M


def test_the_way_home_stays_finite_even_where_it_is_blown_back() -> None:
    headway = Headway(STEP_M)
    for _ in range(SETTLED_TICKS):
        headway.note(ORIGIN, Point(east_m=-20.0, north_m=0.0), EAST)
    assert headway.safe_step_m == SLOWEST * STEP_M
