from __future__ import annotations

import math
from dataclasses import replace
from types import ModuleType

import hypothesis.strategies as st
import pytest
from hypothesis import given

from msgs_json.agent_shell import AgentSetting
from msgs_json.autopilot_link import POSE_LIMIT_S
from msgs_json.driver_checks import check_uav_driver
from msgs_json.drivers import (
    CommandRefusedError,
    NoPorts,
    UavDriverSetup,
    VehicleUnavailableError,
)
from msgs_json.geometry import Point
from msgs_json.simulated_autopilot import SimulatedAutopilot
from msgs_json.store import MemoryStore
from msgs_json.straight_motion import Flow
from uav_planner.drivers import kinematic, topics
from uav_planner.uav_params import UavParams, make_uav

HOME = Point(east_m=50.0, north_m=0.0)
NORTH = Point(east_m=50.0, north_m=40.0)
SETUP = UavDriverSetup(name='uav', home=HOME, speed_mps=4.0, altitude_m=30.0)


def test_kinematic_conforms() -> None:
    check_uav_driver(kinematic.make_driver)


def test_topics_conforms() -> None:
    check_uav_driver(topics.make_driver)


def test_kinematic_arrives_bit_for_bit() -> None:
    driver = kinematic.make_driver(SETUP, NoPorts())
    target = Point(east_m=0.1 + 0.2, north_m=1 / 3)
    driver.step(0.0)
    driver.go_to(target)
    states = [driver.step(float(tick)) for tick in range(1, 14)]
    assert [state.position == target for state in states] == [False] * 12 + [True]
    driver.go_to(HOME)
    assert [driver.step(float(tick)) for tick in range(14, 30)][-1].position == HOME


def test_kinematic_faces_where_it_flies() -> None:
    driver = kinematic.make_driver(SETUP, NoPorts())
    assert driver.step(0.0).speed_mps == 0.0
    driver.go_to(NORTH)
    state = driver.step(1.0)
    assert (state.heading_rad, state.speed_mps, state.z_m) == (math.pi / 2, 4.0, 30.0)
    state = driver.step(10.0)
    assert (state.heading_rad, state.speed_mps) == (math.pi / 2, 0.0)


def test_kinematic_holds_its_track_in_the_wind() -> None:
    driver = kinematic.make_driver(replace(SETUP, wind=Flow(east_mps=2.4)), NoPorts())
    driver.step(0.0)
    driver.go_to(NORTH)
    state = driver.step(1.0)
    assert state.position.east_m == HOME.east_m
    assert (state.position.north_m, state.speed_mps) == pytest.approx((3.2, 3.2))
    assert [driver.step(now_s).position == NORTH for now_s in (12.4, 12.5)] == [False, True]
    driver.go_to(Point(east_m=66.0, north_m=40.0))
    assert driver.step(15.0).position == Point(
        east_m=66.0, north_m=40.0
    )  # 6.4 m/s before the wind


def test_wind_comes_from_the_parameters() -> None:
    params = UavParams(name='uav', driver='kinematic', wind_east_mps=2.0, wind_north_mps=-3.0)
    seen: list[UavDriverSetup] = []

    def factory(setup: UavDriverSetup, ports: NoPorts) -> kinematic.KinematicUav:
        seen.append(setup)
        return kinematic.make_driver(setup, ports)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr('uav_planner.uav_params.find_driver', lambda group, name: factory)
        make_uav(params, NoPorts(), AgentSetting(store=MemoryStore(), authenticator=None))
    assert [setup.wind for setup in seen] == [Flow(east_mps=2.0, north_mps=-3.0)]


@given(
    events=st.lists(
        st.sampled_from([HOME, NORTH, Point(east_m=-3.0, north_m=1 / 3)])
        | st.sampled_from([0.0, 1 / 3, 1.0, 20.0])
        | st.none(),
        max_size=40,
    )
)
def test_kinematic_goes_on_bit_for_bit_from_its_memory(
    events: list[Point | float | None],
) -> None:
    windy = replace(SETUP, wind=Flow(east_mps=1.0, north_mps=-0.3))
    uav, undisturbed = (kinematic.make_driver(windy, NoPorts()) for _ in range(2))
    now_s = 86_400.3
    for event in events:
        if event is None:
            memory = uav.memory()
            uav = kinematic.make_driver(windy, NoPorts())
            uav.recall(memory)
            assert uav.memory() == memory
            continue
        now_s += event if isinstance(event, float) else 0.0
        # A process that has just begun steps before it is told anything.
        assert uav.step(now_s) == undisturbed.step(now_s)
        if isinstance(event, Point):
            uav.go_to(event)
            undisturbed.go_to(event)
    assert uav.step(now_s) == undisturbed.step(now_s)


def test_kinematic_looks_where_it_flew_when_it_is_sent_to_where_it_is() -> None:
    uav = kinematic.make_driver(SETUP, NoPorts())
    uav.step(0.0)
    uav.go_to(NORTH)
    uav.go_to(uav.step(5.0).position)
    recalled = kinematic.make_driver(SETUP, NoPorts())
    recalled.recall(uav.memory())
    assert recalled.step(6.0) == uav.step(6.0)
    assert uav.step(6.0).heading_rad == math.pi / 2


def test_kinematic_is_recalled_at_a_time_before_its_hop_began() -> None:
    uav = kinematic.make_driver(SETUP, NoPorts())
    uav.step(100.0)
    uav.go_to(NORTH)
    recalled = kinematic.make_driver(SETUP, NoPorts())
    recalled.recall(uav.memory())
    assert recalled.step(50.0).position == HOME  # the clock was set back; it waits
    assert recalled.step(105.0).position == Point(east_m=50.0, north_m=20.0)


@pytest.mark.parametrize('module', [kinematic, topics])
@pytest.mark.parametrize('memory', [b'', b'{}', b'\x80'])
def test_what_is_no_memory_is_refused(module: ModuleType, memory: bytes) -> None:
    driver = module.make_driver(SETUP, SimulatedAutopilot(HOME, 30.0, 4.0, 1.0))
    with pytest.raises(ValueError, match='memory is not that of this driver'):
        driver.recall(memory)


@pytest.fixture
def autopilot() -> SimulatedAutopilot:
    return SimulatedAutopilot(HOME, 30.0, speed_mps=4.0, vertical_mps=1.0)


def test_topics_streams_setpoints_before_and_without_poses(autopilot: SimulatedAutopilot) -> None:
    driver = topics.make_driver(SETUP, autopilot)
    for now_s in (0.0, 1.0):
        with pytest.raises(VehicleUnavailableError):
            driver.step(now_s)
    autopilot.step(2.0)
    driver.step(2.0)
    autopilot.is_silent = True
    driver.go_to(NORTH)
    driver.step(2.0 + POSE_LIMIT_S)
    with pytest.raises(VehicleUnavailableError):
        driver.step(2.1 + POSE_LIMIT_S)
    sent = [
        (setpoint.stamp_s, setpoint.position, setpoint.z_m) for setpoint in autopilot.setpoints
    ]
    assert sent == [
        (0.0, HOME, 30.0),
        (1.0, HOME, 30.0),
        (2.0, HOME, 30.0),
        (2.0, NORTH, 30.0),  # at once: the vehicle starts with this tick
        (7.0, NORTH, 30.0),
        (7.1, NORTH, 30.0),
    ]


def test_topics_turns_the_vehicle_to_its_target(autopilot: SimulatedAutopilot) -> None:
    driver = topics.make_driver(SETUP, autopilot)
    driver.go_to(NORTH)
    for tick in range(5):
        autopilot.step(float(tick))
        driver.step(float(tick))
    driver.go_to(Point(east_m=0.0, north_m=16.0))
    headings_rad = [setpoint.heading_rad for setpoint in autopilot.setpoints]
    assert headings_rad == [math.pi / 2] * 5 + [math.pi]


def test_topics_does_not_turn_a_vehicle_that_is_there(autopilot: SimulatedAutopilot) -> None:
    driver = topics.make_driver(SETUP, autopilot)
    for tick in range(15):
        driver.go_to(NORTH)
        autopilot.step(float(tick))
        driver.step(float(tick))
    assert autopilot.position == NORTH
    assert {setpoint.heading_rad for setpoint in autopilot.setpoints} == {math.pi / 2}


def test_topics_refuses_to_go_nowhere_before_it_is_heard(autopilot: SimulatedAutopilot) -> None:
    driver = topics.make_driver(SETUP, autopilot)
    with pytest.raises(CommandRefusedError, match='nan'):
        driver.go_to(Point(east_m=math.nan, north_m=0.0))
    with pytest.raises(VehicleUnavailableError):
        driver.step(0.0)
    assert autopilot.setpoints[-1].position == HOME


def test_topics_reports_what_is_measured(autopilot: SimulatedAutopilot) -> None:
    driver = topics.make_driver(SETUP, autopilot)
    autopilot.z_m = 29.5
    autopilot.step(0.0)
    assert driver.step(0.0).z_m == 29.5
