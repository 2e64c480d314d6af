"""An AUV behind an autopilot on ROS topics (`msgs_json.autopilot_link`), such as MAVROS."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
from msgspec.structs import replace

from auv_sim.drivers.survey_depth import survey_z_m
from msgs_json.autopilot_link import AutopilotLink
from msgs_json.driver_memory import DriverMemory
from msgs_json.drivers import SUBMERGED_Z_M, AuvState, CommandRefusedError
from msgs_json.geometry import Point, within_range
from msgs_json.ros_messages import PoseSetpoint

if TYPE_CHECKING:
    from collections.abc import Sequence

    from msgs_json.drivers import AuvDriverSetup, DriverPorts
    from msgs_json.ros_messages import Odometry

CAPTURE_RADIUS_M = 2.0
"""
A waypoint this close counts as reached.

ArduPilot's default (WPNAV_RADIUS), and well inside a cell of 10 m. The way of one tick must not be
longer, else the vehicle stops at every waypoint until the tick is over.
"""

SURFACED_Z_M = -0.5
"""At this height or above a vehicle that comes up is at the surface: waves move it by as much."""


def make_driver(setup: AuvDriverSetup, ports: DriverPorts) -> TopicsAuv:
    """Return the driver of the AUV whose autopilot is behind ``ports``."""
    return TopicsAuv(setup, ports)


class _Course(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What the autopilot is to do, and for which leg: all that it cannot tell."""

    target: Point
    heading_rad: float = 0.0
    coming_up: bool = True
    """Whether it is to be at the surface, or already is."""
    waypoints: tuple[Point, ...] = ()
    reached: int = 0
    """How many of them it has reached."""
    has_dived: bool = False
    """Whether it has been under water on this leg; only then can it have come up by itself."""


class TopicsAuv:
    """
    Leads the autopilot from setpoint to setpoint and reports the pose it measures.

    Until its first leg the AUV is held at the surface at its start. The speed is the autopilot's
    own setting and must be the mission's.

    Raises
    ------
    ValueError
        A vehicle at the setup's depth would not count as submerged.

    """

    def __init__(self, setup: AuvDriverSetup, ports: DriverPorts) -> None:
        self._survey_z_m = survey_z_m(setup.depth_m)
        self._course = _Course(target=setup.start)
        self._memory = DriverMemory(_Course)
        self._link = AutopilotLink(ports)
        self._now_s: float | None = None

    def follow(self, waypoints: Sequence[Point]) -> None:
        """Send the autopilot to the first point, under water."""
        if not waypoints or not all(
            math.isfinite(point.east_m) and math.isfinite(point.north_m) for point in waypoints
        ):
            raise CommandRefusedError(
                f'waypoints are {list(waypoints)}; must be at least one, and finite'
            )
        self._course = _Course(
            target=waypoints[0],
            heading_rad=self._heading_rad(waypoints[0]),
            coming_up=False,
            waypoints=tuple(waypoints),
        )
        self._send()

    def surface(self) -> None:
        """Send the autopilot up to the surface where the vehicle is."""
        if not self._course.coming_up:
            self._hold_at_surface()
        self._send()

    def step(self, now_s: float) -> AuvState:
        """Lead on to the next setpoint, or repeat the present one, and return the state."""
        self._now_s = now_s
        try:
            pose = self._link.pose(now_s)
            self._proceed(pose)
        finally:
            self._send()
        surfaced = self._course.coming_up and pose.z_m >= SURFACED_Z_M
        return AuvState(
            position=pose.position,
            z_m=0.0 if surfaced else pose.z_m,
            heading_rad=pose.heading_rad,
            speed_mps=pose.speed_mps,
            surfaced=surfaced,
            waypoints_reached=self._course.reached,
        )

    def memory(self) -> bytes:
        """Return where the autopilot is led, and how far along its leg it is."""
        return self._memory.encode(self._course)

    def recall(self, memory: bytes) -> None:
        """Lead the autopilot on along its leg, or hold it where it was to come up."""
        self._course = self._memory.decode(memory)

    @property
    def _position(self) -> Point:
        last = self._link.last_pose
        return self._course.target if last is None else last.position

    def _proceed(self, pose: Odometry) -> None:
        course = self._course
        if course.coming_up:
            return
        reached = course.reached
        while reached < len(course.waypoints) and within_range(
            pose.position.distance_m(course.waypoints[reached]), CAPTURE_RADIUS_M
        ):
            reached += 1
        if reached > course.reached:
            course = replace(course, reached=reached)
            if reached < len(course.waypoints):
                target = course.waypoints[reached]
                course = replace(course, target=target, heading_rad=self._heading_rad(target))
        if not course.has_dived and pose.z_m <= SUBMERGED_Z_M:
            course = replace(course, has_dived=True)
        self._course = course
        if course.has_dived and pose.z_m >= SURFACED_Z_M:
            self._hold_at_surface()  # it came up by itself, and must not be sent down again

    def _hold_at_surface(self) -> None:
        self._course = replace(self._course, coming_up=True, target=self._position)

    def _heading_rad(self, target: Point) -> float:
        here = self._position
        if here.distance_m(target) <= CAPTURE_RADIUS_M:  # so close, it would be noise
            return self._course.heading_rad
        return math.atan2(target.north_m - here.north_m, target.east_m - here.east_m)

    def _send(self) -> None:
        if self._now_s is None:
            return  # the first step sends it
        self._link.send(
            PoseSetpoint(
                stamp_s=self._now_s,
                position=self._course.target,
                z_m=0.0 if self._course.coming_up else self._survey_z_m,
                heading_rad=self._course.heading_rad,
            )
        )
