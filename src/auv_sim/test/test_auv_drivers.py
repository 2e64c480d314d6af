from __future__ import annotations

import math
from collections import Counter
from typing import TYPE_CHECKING

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from auv_sim.drivers import kinematic, topics
from auv_sim.drivers.survey_depth import survey_z_m
from auv_sim.drivers.topics import CAPTURE_RADIUS_M, SURFACED_Z_M
from msgs_json.driver_checks import check_auv_driver
from msgs_json.drivers import AuvDriverSetup, NoPorts, VehicleUnavailableError
from msgs_json.geometry import GridSpec, Point, path_length_m, whole_ticks
from msgs_json.simulated_autopilot import SimulatedAutopilot
from msgs_json.topics import SETPOINT

if TYPE_CHECKING:
    from types import ModuleType

    from msgs_json.drivers import AuvState

REGION = GridSpec(cols=10, rows=10, cell_m=10.0)
START = REGION.centre((3, 7))
LEG = [REGION.centre(cell) for cell in ((4, 7), (5, 7), (5, 6))]


def setup(
    *, surfacing: str = '{"model": "on_time"}', seed: int = 1, speed_mps: float = 1.0
) -> AuvDriverSetup:
    return AuvDriverSetup(
        name='auv_1',
        start=START,
        speed_mps=speed_mps,
        depth_m=5.0,
        surfacing=surfacing,
        rng=np.random.default_rng(seed),
    )


# --- kinematic -----------------------------------------------------------------------------------


def test_kinematic_conforms() -> None:
    check_auv_driver(kinematic.make_driver)


def kinematic_auv(**settings: str | float) -> kinematic.KinematicAuv:
    return kinematic.make_driver(setup(**settings), NoPorts())  # type: ignore[arg-type]


def test_kinematic_leg_cell_by_cell() -> None:
    auv = kinematic_auv()
    assert auv.step(0.0).surfaced
    auv.follow(LEG)
    states = [auv.step(float(tick)) for tick in range(34)]
    assert [states[tick].waypoints_reached for tick in (0, 9, 10, 19, 20, 29, 30, 33)] == [
        *(0, 0, 1, 1, 2, 2, 3, 3)
    ]
    assert [states[tick].position for tick in (0, 10, 20, 30, 33)] == [START, *LEG, LEG[-1]]
    assert {state.z_m for state in states} == {-5.0}
    headings_rad = [states[tick].heading_rad for tick in (0, 15, 25, 33)]
    assert headings_rad == [0.0, 0.0, -math.pi / 2, -math.pi / 2]
    assert [states[tick].speed_mps for tick in (0, 29, 30)] == [1.0, 1.0, 0.0]


def test_kinematic_surfaces_between_two_cells() -> None:
    auv = kinematic_auv()
    auv.step(0.0)
    auv.follow(LEG)
    auv.step(14.0)
    auv.surface()
    place = Point(east_m=49.0, north_m=75.0)
    for now_s in (14.0, 15.0, 99.0):
        state = auv.step(now_s)
        assert (state.position, state.z_m, state.surfaced) == (place, 0.0, True)
    assert state.waypoints_reached == 1
    auv.follow([REGION.centre((4, 7)), REGION.centre((4, 6))])
    state = auv.step(99.0)
    assert (state.position, state.z_m, state.surfaced) == (place, -5.0, False)
    assert [auv.step(99.0 + ticks).waypoints_reached for ticks in (3.0, 4.0, 13.0, 14.0)] == [
        *(0, 1, 1, 2)
    ]


def test_kinematic_is_exactly_at_a_waypoint_it_reaches_with_a_tick() -> None:
    auv = kinematic_auv(speed_mps=10 / 2.1)
    auv.step(86_400.1)  # a day into the mission times are rounded to 1e-11 s
    auv.follow(LEG)
    places = [auv.step(86_400.1 + tick * 0.3).position for tick in (7, 14, 21)]
    assert places == LEG


def test_kinematic_counts_from_0_on_every_leg() -> None:
    auv = kinematic_auv()
    auv.step(0.0)
    auv.follow(LEG)
    assert auv.step(25.0).waypoints_reached == 2
    auv.follow(LEG)
    auv.surface()
    assert auv.step(25.0).waypoints_reached == 0


def test_kinematic_waits_while_time_goes_back() -> None:
    auv = kinematic_auv()
    auv.step(100.0)
    auv.follow(LEG)
    state = auv.step(104.0)
    assert auv.step(101.0) == state
    assert auv.step(105.0).position == Point(east_m=40.0, north_m=75.0)


@given(
    speed_mps=st.sampled_from([0.7, 0.8, 1.0, 1.3]) | st.floats(0.1, 5.0),
    tick_s=st.sampled_from([0.1, 0.25, 1 / 3, 1.0]),
    first_tick=st.sampled_from([0, 73, 99_999]),
    moves=st.lists(st.sampled_from([(1, 0), (0, 1), (-1, 0), (0, -1)]), min_size=1, max_size=8),
)
def test_kinematic_reaches_every_waypoint_in_whole_ticks(
    speed_mps: float, tick_s: float, first_tick: int, moves: list[tuple[int, int]]
) -> None:
    auv = kinematic_auv(speed_mps=speed_mps)
    line = [START]
    for east, north in moves:
        line.append(
            Point(east_m=line[-1].east_m + 10.0 * east, north_m=line[-1].north_m + 10.0 * north)
        )
    auv.step(first_tick * tick_s)
    auv.follow(line[1:])
    for number in range(1, len(line)):
        due = whole_ticks(path_length_m(line[: number + 1]) / (speed_mps * tick_s))
        assert auv.step((first_tick + due - 1) * tick_s).waypoints_reached == number - 1
        assert auv.step((first_tick + due) * tick_s).waypoints_reached == number
    assert auv.step((first_tick + due) * tick_s).position == line[-1]


def swim_until_surfaced(auv: kinematic.KinematicAuv) -> tuple[int, AuvState]:
    """Swim the leg; return at which tick the AUV is first surfaced, and its state then."""
    auv.step(0.0)
    auv.follow(LEG)
    for tick in range(100):
        state = auv.step(float(tick))
        if state.surfaced:
            return tick, state
    raise AssertionError('stayed under water')


def test_early_surfaces_at_every_cell_but_the_last() -> None:
    seen: Counter[tuple[int, Point, int]] = Counter()
    for seed in range(300):
        auv = kinematic_auv(surfacing='{"model": "early", "probability": 1}', seed=seed)
        tick, state = swim_until_surfaced(auv)
        seen[tick, state.position, state.waypoints_reached] += 1
        assert state.z_m == 0.0
    # At P_0 without moving, with the first step; elsewhere exactly in the middle of the cell.
    assert set(seen) == {(1, START, 0), (10, LEG[0], 1), (20, LEG[1], 2)}
    assert all(70 < times < 130 for times in seen.values())  # 100 each, standard deviation 8


def test_early_stays_up_where_it_came_up_until_the_next_leg() -> None:
    auv = kinematic_auv(surfacing='{"model": "early", "probability": 1}', speed_mps=0.7)
    _, up = swim_until_surfaced(auv)
    assert auv.step(500.0) == up
    auv.surface()
    assert auv.step(500.0) == up
    auv.follow(LEG)
    assert not auv.step(500.0).surfaced


def test_early_draws_alike_whatever_comes_out() -> None:
    """The fate of the second leg does not hang on that of the first."""
    second_legs = []
    for probability in (0.0, 1.0):
        rng = np.random.default_rng(3)
        model = f'{{"model": "early", "probability": {probability}}}'
        auv = kinematic.make_driver(
            AuvDriverSetup(
                name='auv_1', start=START, speed_mps=1.0, depth_m=5.0, surfacing=model, rng=rng
            ),
            NoPorts(),
        )
        auv.follow(LEG)
        second_legs.append(rng.bit_generator.state)
    assert second_legs[0] == second_legs[1]


def test_slow_takes_the_speed_that_it_drew_for_the_leg() -> None:
    auv = kinematic_auv(surfacing='{"model": "slow", "least_factor": 0.5}', seed=8)
    rng = np.random.default_rng(8)
    for now_s in (0.0, 4.0):
        factor = rng.uniform(0.5, 1.0)
        before = auv.step(now_s).position
        auv.follow(LEG)
        state = auv.step(now_s + 4.0)
        assert before.distance_m(state.position) == pytest.approx(4.0 * factor)
        assert state.speed_mps == pytest.approx(factor)


CURRENT = '{"model": "slow", "current_north_mps": %g}'


def test_in_a_current_it_holds_its_track_and_gets_on_as_fast_as_it_can() -> None:
    auv = kinematic_auv(surfacing=CURRENT % 3.0, speed_mps=5.0)
    auv.step(0.0)
    auv.follow(LEG)  # twice east across the current at 4 m/s, then south against it at 2 m/s
    states = [auv.step(0.5 * number) for number in range(1, 22)]
    assert [state.waypoints_reached for state in states] == [0] * 4 + [1] * 5 + [2] * 10 + [3] * 2
    assert {state.position.north_m for state in states[:10]} == {START.north_m}
    assert states[6].position == Point(east_m=49.0, north_m=75.0)
    assert states[13].position == Point(east_m=55.0, north_m=71.0)
    assert [states[number].speed_mps for number in (0, 8, 9, 18, 19)] == [4.0, 4.0, 2.0, 2.0, 0.0]
    assert [states[number].heading_rad for number in (0, 12)] == [0.0, -math.pi / 2]


def test_before_the_current_it_is_there_before_its_time() -> None:
    auv = kinematic_auv(surfacing=CURRENT % -1.0, speed_mps=1.0)
    auv.step(0.0)
    auv.follow([Point(east_m=START.east_m, north_m=START.north_m - 10.0)])
    assert [auv.step(now_s).waypoints_reached for now_s in (4.9, 5.0)] == [0, 1]


@pytest.mark.parametrize('current_mps', [5.1, -50.0])
def test_too_strong_a_current_stops_it_but_never_carries_it_back(current_mps: float) -> None:
    auv = kinematic_auv(surfacing=CURRENT % current_mps, speed_mps=5.0)
    auv.step(0.0)
    auv.follow(LEG)
    state = auv.step(1000.0)
    assert (state.position, state.waypoints_reached, state.speed_mps) == (START, 0, 0.0)
    auv.surface()
    state = auv.step(1001.0)
    assert (state.position, state.surfaced) == (START, True)


def test_a_current_that_stops_it_on_the_way_stops_it_at_that_corner() -> None:
    auv = kinematic_auv(surfacing=CURRENT % -5.1, speed_mps=5.0)
    auv.step(0.0)
    auv.follow([Point(east_m=START.east_m, north_m=START.north_m - 10.1), *LEG])
    states = [auv.step(now_s) for now_s in (0.9, 1.0, 1000.0)]
    assert [state.waypoints_reached for state in states] == [0, 1, 1]
    assert states[1].position == states[2].position


def test_abort_asks_for_help_from_its_time_on() -> None:
    auv = kinematic_auv(surfacing='{"model": "abort", "at_s": 12}')
    auv.step(500.0)  # times count from here
    auv.follow(LEG)
    states = [auv.step(500.0 + seconds) for seconds in (0.0, 11.9, 12.0, 12.1, 300.0)]
    assert [state.needs_help for state in states] == [False, False, True, True, True]
    assert not states[2].surfaced  # its agent brings it up, here and now
    assert states[2].position == Point(east_m=47.0, north_m=75.0)


def test_abort_may_come_while_it_lies_at_the_surface() -> None:
    auv = kinematic_auv(surfacing='{"model": "abort", "at_s": 12}')
    auv.step(0.0)
    auv.follow(LEG)
    auv.step(4.0)
    auv.surface()
    states = [auv.step(now_s) for now_s in (4.0, 11.0, 12.0)]
    assert [(state.surfaced, state.needs_help) for state in states] == [
        *((True, False), (True, False), (True, True))
    ]


def test_lost_it_lies_where_it_was_and_never_comes_up() -> None:
    auv = kinematic_auv(surfacing='{"model": "lost", "from_s": 12.5}')
    auv.step(500.0)
    auv.follow(LEG)
    place = Point(east_m=47.5, north_m=75.0)
    for now_s in (513.0, 515.0, 9e9):
        auv.step(now_s)
        auv.surface()
        state = auv.step(now_s)
        assert (state.position, state.z_m, state.surfaced) == (place, -5.0, False)
        assert (state.speed_mps, state.waypoints_reached) == (0.0, 1)
    auv.follow(LEG)
    auv.surface()
    state = auv.step(9e9 + 1.0)
    assert (state.position, state.surfaced) == (place, False)


def test_lost_at_the_surface_it_is_lost_with_its_next_dive() -> None:
    auv = kinematic_auv(surfacing='{"model": "lost", "from_s": 12}')
    auv.step(0.0)
    auv.follow(LEG)
    auv.step(4.0)
    auv.surface()
    assert all(auv.step(now_s).surfaced for now_s in (4.0, 11.0, 12.0, 13.0))
    auv.surface()
    assert auv.step(14.0).surfaced
    auv.follow(LEG)
    for now_s in (14.0, 15.0, 100.0):
        auv.surface()
        state = auv.step(now_s)
        assert (state.surfaced, state.z_m) == (False, -5.0)
        assert state.position == Point(east_m=39.0, north_m=75.0)


def test_silent_swims_as_if_nothing_were_wrong() -> None:
    silent = kinematic_auv(surfacing='{"model": "silent", "from_s": 0, "sorties": 9}')
    on_time = kinematic_auv()
    for auv in (silent, on_time):
        auv.step(0.0)
        auv.follow(LEG)
    assert [silent.step(float(tick)) for tick in range(40)] == [
        on_time.step(float(tick)) for tick in range(40)
    ]


def test_refused_leg_draws_nothing() -> None:
    settings = setup(surfacing='{"model": "early", "probability": 0.5}')
    auv = kinematic.make_driver(settings, NoPorts())
    before = settings.rng.bit_generator.state
    with pytest.raises(kinematic.CommandRefusedError):
        auv.follow([])
    assert settings.rng.bit_generator.state == before


def test_bad_surfacing_model_is_refused_when_the_driver_is_made() -> None:
    with pytest.raises(ValueError, match='surfacing is'):
        kinematic_auv(surfacing='{"model": "eary"}')


@pytest.mark.parametrize('depth_m', [0.0, 0.99, -5.0, math.nan])
def test_depth_that_is_no_depth_is_refused(depth_m: float) -> None:
    with pytest.raises(ValueError, match=r'depth_m is .*; must be at least 1 m'):
        survey_z_m(depth_m)


def test_depth_is_down_and_z_is_up() -> None:
    assert survey_z_m(1.0) == -1.0


# --- a driver made anew --------------------------------------------------------------------------

MODELS = (
    '{"model": "on_time"}',
    '{"model": "early", "probability": 0.7}',
    '{"model": "slow", "least_factor": 0.5, "current_east_mps": 0.2}',
    CURRENT % -5.1,
    '{"model": "abort", "at_s": 40}',
    '{"model": "lost", "from_s": 60.5}',
)


@given(
    surfacing=st.sampled_from(MODELS),
    seed=st.integers(0, 1000),
    first_s=st.sampled_from([0.0, 86_400.3]),
    events=st.lists(
        st.sampled_from(['follow', 'surface', 'restart'])
        | st.sampled_from([0.0, 1 / 3, 1.0, 7.7, 30.0]),
        max_size=40,
    ),
)
def test_kinematic_goes_on_bit_for_bit_from_its_memory(
    surfacing: str, seed: int, first_s: float, events: list[str | float]
) -> None:
    now_s = first_s
    auv, undisturbed = (kinematic_auv(surfacing=surfacing, seed=seed) for _ in range(2))
    for event in events:
        if event == 'restart':
            memory = auv.memory()
            auv = kinematic_auv(surfacing=surfacing, seed=seed)
            auv.recall(memory)
            assert auv.memory() == memory
        elif event == 'follow':
            auv.step(now_s)  # A process that has just begun steps before it is told anything.
            undisturbed.step(now_s)
            auv.follow([START, *LEG])
            undisturbed.follow([START, *LEG])
        elif event == 'surface':
            auv.step(now_s)
            undisturbed.step(now_s)
            auv.surface()
            undisturbed.surface()
        else:
            now_s += float(event)
            assert auv.step(now_s) == undisturbed.step(now_s)
    assert auv.step(now_s) == undisturbed.step(now_s)


def test_kinematic_sent_off_before_the_first_step_begins_there_in_another_process() -> None:
    auv = kinematic_auv()
    auv.follow(LEG)
    recalled = kinematic_auv()
    recalled.recall(auv.memory())
    assert recalled.step(100.0).position == START
    assert recalled.step(110.0).position == LEG[0]


def test_kinematic_is_recalled_at_a_time_before_its_leg_began() -> None:
    auv = kinematic_auv()
    auv.step(100.0)
    auv.follow(LEG)
    recalled = kinematic_auv()
    recalled.recall(auv.memory())
    assert recalled.step(50.0).position == START  # the clock was set back; it waits
    assert recalled.step(104.0).position == Point(east_m=39.0, north_m=75.0)


def test_kinematic_looks_where_it_looked_before_a_leg_without_length() -> None:
    auv = kinematic_auv()
    auv.step(0.0)
    auv.follow(LEG)
    assert auv.step(30.0).heading_rad == -math.pi / 2
    auv.follow([LEG[-1], LEG[-1]])
    recalled = kinematic_auv()
    recalled.recall(auv.memory())
    assert recalled.step(31.0) == auv.step(31.0)
    assert auv.step(32.0).heading_rad == -math.pi / 2


def test_kinematic_memory_changes_with_commands_alone() -> None:
    auv = kinematic_auv(surfacing='{"model": "early", "probability": 1}')
    auv.step(0.0)
    before = auv.memory()
    auv.follow(LEG)
    under_way = auv.memory()
    assert under_way != before
    for tick in range(40):
        auv.step(float(tick))
        assert auv.memory() is under_way
    auv.surface()  # up already
    assert auv.memory() is under_way


@pytest.mark.parametrize('module', [kinematic, topics])
@pytest.mark.parametrize('memory', [b'', b'{}', b'\x80'])
def test_what_is_no_memory_is_refused(module: ModuleType, memory: bytes) -> None:
    driver = module.make_driver(setup(), SimulatedAutopilot(START, 0.0, 1.0, 0.5))
    with pytest.raises(ValueError, match='memory is not that of this driver'):
        driver.recall(memory)


def test_topics_sends_the_same_setpoints_after_a_restart() -> None:
    dive, undisturbed = Dive(), Dive()
    for tick in range(60):
        for each in (dive, undisturbed):
            each.ticks(1)
            if tick == 1:
                each.driver.follow(LEG)
            if tick == 30:
                each.driver.surface()
        memory = dive.driver.memory()
        dive.driver = topics.make_driver(setup(), dive.vehicle)
        dive.driver.recall(memory)
    assert dive.vehicle.setpoints == undisturbed.vehicle.setpoints


def test_topics_remembers_that_it_came_up_by_itself() -> None:
    dive = Dive()
    dive.driver.follow(LEG)
    dive.ticks(8)
    dive.vehicle.z_m = -0.1  # its own failsafe, while the process is dead
    memory = dive.driver.memory()
    dive.driver = topics.make_driver(setup(), dive.vehicle)
    dive.driver.recall(memory)
    dive.vehicle.step(dive.now_s)
    assert dive.driver.step(dive.now_s).surfaced


# --- topics --------------------------------------------------------------------------------------


def test_topics_conforms() -> None:
    check_auv_driver(topics.make_driver, capture_radius_m=CAPTURE_RADIUS_M, vertical_mps=0.5)


class Dive:
    """A topics driver and its vehicle, tick by tick."""

    def __init__(self) -> None:
        self.vehicle = SimulatedAutopilot(START, 0.0, speed_mps=1.0, vertical_mps=0.5)
        self.driver = topics.make_driver(setup(), self.vehicle)
        self.now_s = -1.0

    def ticks(self, number: int) -> list[AuvState]:
        states = []
        for _ in range(number):
            self.now_s += 1.0
            self.vehicle.step(self.now_s)
            states.append(self.driver.step(self.now_s))
        return states

    def setpoint(self) -> tuple[Point, float]:
        return self.vehicle.setpoints[-1].position, self.vehicle.setpoints[-1].z_m


def test_topics_leads_from_setpoint_to_setpoint() -> None:
    dive = Dive()
    dive.ticks(1)
    assert dive.setpoint() == (START, 0.0)
    dive.driver.follow(LEG)
    assert dive.setpoint() == (LEG[0], -5.0)
    states = dive.ticks(8)
    # Captured 2 m before; the setpoint goes on with the same tick.
    assert [state.waypoints_reached for state in states[-2:]] == [0, 1]
    assert dive.setpoint() == (LEG[1], -5.0)
    dive.ticks(40)
    assert dive.setpoint() == (LEG[2], -5.0)
    assert dive.vehicle.position == LEG[2]


def test_topics_is_not_surfaced_while_it_dives_nor_before_it_is_up() -> None:
    dive = Dive()
    assert dive.ticks(1)[0].surfaced
    dive.driver.follow(LEG)
    dive.ticks(1)
    dive.vehicle.z_m = 0.3  # a wave; it has not gone down yet
    assert not dive.ticks(1)[0].surfaced
    below = dive.ticks(10)[-1]
    assert (below.z_m, below.surfaced) == (-5.0, False)
    dive.driver.surface()
    assert dive.setpoint() == (below.position, 0.0)
    states = dive.ticks(10)
    assert [state.surfaced for state in states] == [False] * 8 + [True] * 2
    assert [state.z_m for state in states[-3:]] == [-1.0, 0.0, 0.0]
    assert dive.vehicle.z_m == 0.0


def test_topics_surface_is_where_waves_are() -> None:
    dive = Dive()
    dive.vehicle.z_m = SURFACED_Z_M
    state = dive.ticks(1)[0]
    assert (state.surfaced, state.z_m) == (True, 0.0)
    dive.vehicle.z_m = -2.0
    assert not dive.ticks(1)[0].surfaced


def test_topics_does_not_send_down_what_came_up_by_itself() -> None:
    dive = Dive()
    dive.driver.follow(LEG)
    place = dive.ticks(8)[-1].position
    dive.vehicle.z_m = -0.1  # its own failsafe
    state = dive.driver.step(dive.now_s)
    assert not state.surfaced  # not measured yet
    dive.vehicle.step(dive.now_s)
    assert dive.driver.step(dive.now_s).surfaced
    assert dive.setpoint() == (place, 0.0)
    assert all(state.surfaced for state in dive.ticks(5))
    assert dive.vehicle.position == place


def test_topics_counts_no_waypoint_that_it_drifts_to_at_the_surface() -> None:
    dive = Dive()
    dive.driver.follow(LEG)
    dive.ticks(7)
    dive.driver.surface()
    setpoint = dive.setpoint()
    dive.vehicle.publish(SETPOINT, dive.vehicle.setpoints[0])  # the current takes it on
    assert dive.vehicle.position.distance_m(LEG[0]) > CAPTURE_RADIUS_M
    dive.vehicle.step(dive.now_s + 5.0)
    state = dive.driver.step(dive.now_s + 5.0)
    assert state.position.distance_m(LEG[0]) < CAPTURE_RADIUS_M
    assert (state.waypoints_reached, dive.setpoint()) == (0, setpoint)


def test_topics_told_again_to_surface_holds_the_place_where_it_was_told_first() -> None:
    dive = Dive()
    dive.driver.follow(LEG)
    dive.ticks(7)
    dive.driver.surface()
    setpoint = dive.setpoint()
    dive.vehicle.publish(SETPOINT, dive.vehicle.setpoints[0])  # the current takes it on
    dive.vehicle.step(dive.now_s + 1.0)
    dive.driver.step(dive.now_s + 1.0)
    dive.driver.surface()
    assert dive.setpoint() == setpoint


def test_topics_counts_all_waypoints_it_is_close_to() -> None:
    dive = Dive()
    beside = Point(east_m=START.east_m + 1.0, north_m=START.north_m)
    dive.driver.follow([START, beside, *LEG])
    assert dive.ticks(1)[0].waypoints_reached == 2
    assert dive.setpoint() == (LEG[0], -5.0)


def test_topics_streams_setpoints_without_poses() -> None:
    dive = Dive()
    dive.vehicle.is_silent = True
    for _ in range(2):
        with pytest.raises(VehicleUnavailableError):
            dive.ticks(1)
    dive.driver.follow(LEG)
    with pytest.raises(VehicleUnavailableError):
        dive.ticks(1)
    assert [setpoint.stamp_s for setpoint in dive.vehicle.setpoints] == [0.0, 1.0, 1.0, 2.0]
    assert dive.setpoint() == (LEG[0], -5.0)


def test_topics_faces_where_it_swims() -> None:
    dive = Dive()
    dive.ticks(1)
    dive.driver.follow(LEG)
    dive.ticks(30)
    dive.driver.surface()
    east_rad = 0.0
    corner_rad = dive.vehicle.setpoints[-1].heading_rad
    headings_rad = {setpoint.heading_rad for setpoint in dive.vehicle.setpoints}
    assert headings_rad == {east_rad, corner_rad}
    assert -math.pi / 2 < corner_rad < -math.pi / 4  # round the corner, which it cuts
