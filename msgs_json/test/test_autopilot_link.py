from __future__ import annotations

import math

import pytest

from msgs_json.autopilot_link import POSE_LIMIT_S, AutopilotLink
from msgs_json.drivers import NoPorts, VehicleUnavailableError
from msgs_json.geometry import Point
from msgs_json.ros_messages import PoseSetpoint, Text
from msgs_json.simulated_autopilot import SimulatedAutopilot
from msgs_json.topics import ODOM, RADIO_TX, SETPOINT, VEHICLE_ODOM

START = Point(east_m=5.0, north_m=5.0)


@pytest.fixture
def autopilot() -> SimulatedAutopilot:
    return SimulatedAutopilot(START, 0.0, speed_mps=1.0, vertical_mps=0.5)


def test_no_pose_is_told(autopilot: SimulatedAutopilot) -> None:
    link = AutopilotLink(autopilot)
    assert link.last_pose is None
    with pytest.raises(VehicleUnavailableError, match=r'no pose on local_position/odom yet'):
        link.pose(0.0)


def test_pose_is_good_up_to_its_limit(autopilot: SimulatedAutopilot) -> None:
    link = AutopilotLink(autopilot)
    autopilot.step(100.0)
    assert link.pose(100.0).position == START
    assert link.pose(100.0 + POSE_LIMIT_S).position == START
    with pytest.raises(VehicleUnavailableError, match=r'for 5\.1 s; limit is 5 s'):
        link.pose(105.1)
    assert link.last_pose is not None
    autopilot.step(105.2)
    assert link.pose(105.2).position == START


def test_age_does_not_depend_on_the_autopilots_clock(autopilot: SimulatedAutopilot) -> None:
    link = AutopilotLink(autopilot)
    autopilot.step(3.0)  # counts from its own start
    assert link.pose(1.7e9).stamp_s == 3.0


def test_without_ros_it_says_so() -> None:
    with pytest.raises(VehicleUnavailableError, match='kinematic'):
        AutopilotLink(NoPorts())


def test_simulated_vehicle_climbs_at_its_own_pace(autopilot: SimulatedAutopilot) -> None:
    target = Point(east_m=8.0, north_m=5.0)
    autopilot.step(0.0)
    autopilot.publish(
        SETPOINT, PoseSetpoint(stamp_s=0.0, position=target, z_m=-1.2, heading_rad=0.0)
    )
    heights_m = []
    for tick in range(1, 5):
        autopilot.step(float(tick))
        heights_m.append(autopilot.z_m)
    assert heights_m == [-0.5, -1.0, -1.2, -1.2]
    assert autopilot.position == target


@pytest.mark.parametrize('vertical_mps', [0.0, math.inf])
def test_simulated_vehicle_needs_time_to_climb(vertical_mps: float) -> None:
    autopilot = SimulatedAutopilot(START, 0.0, speed_mps=1.0, vertical_mps=vertical_mps)
    autopilot.publish(
        SETPOINT, PoseSetpoint(stamp_s=0.0, position=START, z_m=-5.0, heading_rad=0.0)
    )
    autopilot.step(0.0)
    autopilot.step(0.0)
    assert autopilot.z_m == 0.0
    autopilot.step(1.0)
    assert autopilot.z_m == (-5.0 if vertical_mps else 0.0)


def test_simulated_vehicle_knows_no_other_topics(autopilot: SimulatedAutopilot) -> None:
    with pytest.raises(VehicleUnavailableError, match=SETPOINT.name):
        autopilot.publish(RADIO_TX, Text(b'{}'))
    with pytest.raises(VehicleUnavailableError, match=VEHICLE_ODOM.name):
        autopilot.subscribe_odometry(ODOM, lambda odometry: None)
