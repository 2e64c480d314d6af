"""The UAV behind an autopilot on ROS topics (`msgs_json.autopilot_link`), such as MAVROS."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec

from msgs_json.autopilot_link import AutopilotLink
from msgs_json.driver_memory import DriverMemory
from msgs_json.drivers import CommandRefusedError, VehicleState
from msgs_json.geometry import Point
from msgs_json.ros_messages import PoseSetpoint

if TYPE_CHECKING:
    from msgs_json.drivers import DriverPorts, UavDriverSetup


def make_driver(setup: UavDriverSetup, ports: DriverPorts) -> TopicsUav:
    """Return the driver of the UAV whose autopilot is behind ``ports``."""
    return TopicsUav(setup, ports)


class _Aim(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Where the autopilot is sent: all that it cannot tell."""

    target: Point
    heading_rad: float


class TopicsUav:
    """
    Sends the autopilot to a position setpoint and reports the pose it measures.

    Until it is sent elsewhere the UAV is held over its home. The speed is the autopilot's own
    setting and must be the mission's.
    """

    def __init__(self, setup: UavDriverSetup, ports: DriverPorts) -> None:
        self._altitude_m = setup.altitude_m
        self._aim = _Aim(target=setup.home, heading_rad=0.0)
        self._memory = DriverMemory(_Aim)
        self._link = AutopilotLink(ports)
        self._now_s: float | None = None

    def go_to(self, target: Point) -> None:
        """Send the autopilot to a point at once, and again at every step."""
        here = self._aim.target if self._link.last_pose is None else self._link.last_pose.position
        distance_m = here.distance_m(target)
        if not math.isfinite(distance_m):
            raise CommandRefusedError(f'cannot fly to {target}; must be finite')
        if target == self._aim.target:
            return  # under way already; the heading to a point close by would be noise
        heading_rad = math.atan2(target.north_m - here.north_m, target.east_m - here.east_m)
        self._aim = _Aim(target=target, heading_rad=heading_rad)
        self._send()

    def step(self, now_s: float) -> VehicleState:
        """Repeat the setpoint and return the measured state."""
        self._now_s = now_s
        self._send()
        pose = self._link.pose(now_s)
        return VehicleState(
            position=pose.position,
            z_m=pose.z_m,
            heading_rad=pose.heading_rad,
            speed_mps=pose.speed_mps,
        )

    def memory(self) -> bytes:
        """Return where the autopilot is sent."""
        return self._memory.encode(self._aim)

    def recall(self, memory: bytes) -> None:
        """Send the autopilot to where it was sent before."""
        self._aim = self._memory.decode(memory)

    def _send(self) -> None:
        if self._now_s is None:
            return  # the first step sends it
        self._link.send(
            PoseSetpoint(
                stamp_s=self._now_s,
                position=self._aim.target,
                z_m=self._altitude_m,
                heading_rad=self._aim.heading_rad,
            )
        )
