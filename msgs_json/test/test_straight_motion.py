from __future__ import annotations

import math

import hypothesis.strategies as st
from hypothesis import given

from msgs_json.geometry import Point, whole_ticks
from msgs_json.straight_motion import StraightMotion

START = Point(east_m=50.0, north_m=0.0)


def toward(start: Point, angle_rad: float, length_m: float) -> Point:
    return Point(
        east_m=start.east_m + length_m * math.cos(angle_rad),
        north_m=start.north_m + length_m * math.sin(angle_rad),
    )


@given(
    speed_mps=st.sampled_from([0.8, 1.0, 3.7, 4.0, 25.0]) | st.floats(0.1, 50.0),
    tick_s=st.sampled_from([0.1, 0.25, 1 / 3, 1.0, 10.0]),
    first_tick=st.sampled_from([0, 1, 1000, 99_999]),
    hops=st.lists(
        st.tuples(
            st.integers(1, 300).map(float) | st.floats(0.01, 300.0), st.floats(-math.pi, math.pi)
        ),
        min_size=1,
        max_size=4,
    ),
)
def test_hop_takes_its_whole_ticks(
    speed_mps: float, tick_s: float, first_tick: int, hops: list[tuple[float, float]]
) -> None:
    motion = StraightMotion(START, speed_mps)
    tick = first_tick
    motion.step(tick * tick_s)
    for length_ticks, angle_rad in hops:
        start = motion.position
        target = toward(start, angle_rad, length_ticks * speed_mps * tick_s)
        motion.head_for(target)
        expected = whole_ticks(start.distance_m(target) / (speed_mps * tick_s))
        taken = 0
        while motion.position != target:
            assert taken < expected, 'lost a tick'
            taken += 1
            motion.step((tick + taken) * tick_s)
        assert taken == expected
        tick += taken


def test_many_small_steps_add_up_to_the_hop() -> None:
    motion = StraightMotion(START, 0.1)
    target = toward(START, 0.3, 100.0)
    motion.head_for(target)
    for tick in range(100_000):
        motion.step(tick * 0.01)
        assert motion.position != target
    motion.step(1000.0)
    assert motion.position == target


def test_nothing_moves_while_time_goes_back() -> None:
    motion = StraightMotion(START, 1.0)
    motion.step(10.0)
    motion.head_for(toward(START, 0.0, 100.0))
    motion.step(15.0)
    for now_s in (12.0, 15.0):
        motion.step(now_s)
        assert motion.position == Point(east_m=55.0, north_m=0.0)
    motion.step(16.0)
    assert motion.position == Point(east_m=56.0, north_m=0.0)


def test_sent_before_the_first_step_it_begins_there() -> None:
    motion = StraightMotion(START, 1.0)
    motion.head_for(toward(START, 0.0, 100.0))
    motion.step(1.7e9)
    assert motion.position == START
    motion.step(1.7e9 + 2.0)
    assert motion.position == Point(east_m=52.0, north_m=0.0)
