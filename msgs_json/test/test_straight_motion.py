from __future__ import annotations

import math

import hypothesis.strategies as st
import pytest
from hypothesis import assume, given

from msgs_json.geometry import Point, whole_ticks
from msgs_json.straight_motion import STILL, Flow, StraightMotion

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


# --- in wind or current --------------------------------------------------------------------------

EAST = Point(east_m=START.east_m + 10.0, north_m=START.north_m)

speeds_mps = st.sampled_from([0.1, 1.0, 4.0]) | st.floats(0.01, 100.0)
flows = st.builds(
    Flow,
    east_mps=st.sampled_from([0.0, 1.0, -4.0]) | st.floats(-120.0, 120.0),
    north_mps=st.sampled_from([0.0, 1.0, -4.0]) | st.floats(-120.0, 120.0),
)
points = st.builds(Point, east_m=st.floats(-1e5, 1e5), north_m=st.floats(-1e5, 1e5))


@given(speeds_mps, flows, points, points)
def test_the_vehicle_makes_good_its_track_as_fast_as_it_can(
    speed_mps: float, flow: Flow, start: Point, end: Point
) -> None:
    length_m = start.distance_m(end)
    assume(length_m > 1e-3)
    east, north = (end.east_m - start.east_m) / length_m, (end.north_m - start.north_m) / length_m
    along_mps = flow.east_mps * east + flow.north_mps * north
    across_mps = flow.north_mps * east - flow.east_mps * north
    ground_mps = flow.ground_speed_mps(speed_mps, start, end)
    if ground_mps > 0.0:
        # What it does over ground, less what the flow does, is what it does itself.
        own_mps = math.hypot(
            ground_mps * east - flow.east_mps, ground_mps * north - flow.north_mps
        )
        assert own_mps == pytest.approx(speed_mps, rel=1e-6, abs=1e-6)
        assert ground_mps >= along_mps  # of the two headings that hold the track the better one
    else:
        assert ground_mps == 0.0
        cannot_hold_its_track = abs(across_mps) > speed_mps * (1.0 - 1e-9)
        cannot_get_on = along_mps <= 0.0 and flow.speed_mps > speed_mps * (1.0 - 1e-9)
        assert cannot_hold_its_track or cannot_get_on


@pytest.mark.parametrize(
    ('flow', 'expected_mps'),
    [
        (Flow(east_mps=2.0), 7.0),
        (Flow(east_mps=-2.0), 3.0),
        (Flow(north_mps=3.0), 4.0),
        (Flow(east_mps=-1.0, north_mps=-3.0), 3.0),
        (Flow(north_mps=5.0), 0.0),
        (Flow(north_mps=5.1), 0.0),
        (Flow(east_mps=-5.0), 0.0),
        (Flow(east_mps=-50.0), 0.0),
        (Flow(east_mps=50.0, north_mps=5.1), 0.0),  # it would leave its track
    ],
)
def test_ground_speed(flow: Flow, expected_mps: float) -> None:
    assert flow.ground_speed_mps(5.0, START, EAST) == expected_mps


@given(speeds_mps, points, points)
def test_without_a_flow_the_speed_is_the_same_bit_for_bit(
    speed_mps: float, start: Point, end: Point
) -> None:
    assert STILL.ground_speed_mps(speed_mps, start, end) == speed_mps


def test_a_hop_in_the_wind_takes_its_time_over_ground() -> None:
    motion = StraightMotion(START, 5.0, Flow(north_mps=3.0))
    motion.step(7.0)
    motion.head_for(EAST)
    motion.step(8.0)
    assert motion.position == Point(east_m=54.0, north_m=0.0)
    motion.step(9.5)
    assert motion.position == EAST
    assert motion.ground_speed_mps == 4.0
    motion.head_for(Point(east_m=60.0, north_m=-4.0))
    motion.step(11.5)
    assert motion.position == motion.hop.target


def test_too_strong_a_wind_keeps_it_where_it_is() -> None:
    motion = StraightMotion(START, 5.0, Flow(east_mps=-6.0))
    motion.head_for(EAST)
    for now_s in (0.0, 100.0):
        motion.step(now_s)
        assert motion.position == START
