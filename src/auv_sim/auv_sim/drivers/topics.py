"""An AUV behind an autopilot on ROS topics (`msgs_json.autopilot_link`), such as MAVROS."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from auv_sim.drivers.survey_depth import survey_z_m
from msgs_json.autopilot_link import AutopilotLink
from msgs_json.drivers import SUBMERGED_Z_M, AuvState, CommandRefusedError
from msgs_json.geometry import within_range
from msgs_json.ros_messages import PoseSetpoint

if TYPE_CHECKING:
    from collections.abc import Sequence

    from msgs_json.drivers import AuvDriverSetup, DriverPorts
    from msgs_json.geometry import Point
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
        self._waypoints: tuple[Point, ...] = ()
        self._reached = 0
        self._coming_up = True
        """Whether it is to be at the surface, or already is."""
        self._has_dived = False
        """Whether it has been under water on this leg; only then can it have come up by itself."""
        self._target = setup.start
        self._heading_rad = 0.0
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
        self._waypoints, self._reached = tuple(waypoints), 0
        self._coming_up = self._has_dived = False
        self._aim(waypoints[0])
        self._send()

    def surface(self) -> None:
        """Send the autopilot up to the surface where the vehicle is."""
        if not self._coming_up:
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
        surfaced = self._coming_up and pose.z_m >= SURFACED_Z_M
        return AuvState(
            position=pose.position,
            z_m=0.0 if surfaced else pose.z_m,
            heading_rad=pose.heading_rad,
            speed_mps=pose.speed_mps,
            surfaced=surfaced,
            waypoints_reached=self._reached,
        )

    @property
    def _position(self) -> Point:
        return self._target if self._link.last_pose is None else self._link.last_pose.position

    def _proceed(self, pose: Odometry) -> None:
        if self._coming_up:
            return
        reached_before = self._reached
        while self._reached < len(self._waypoints) and within_range(
            pose.position.distance_m(self._waypoints[self._reached]), CAPTURE_RADIUS_M
        ):
            self._reached += 1
        if reached_before < self._reached < len(self._waypoints):
            self._aim(self._waypoints[self._reached])
        self._has_dived = self._has_dived or pose.z_m <= SUBMERGED_Z_M
        if self._has_dived and pose.z_m >= SURFACED_Z_M:
            self._hold_at_surface()  # it came up by itself, and must not be sent down again

    def _hold_at_surface(self) -> None:
        self._coming_up = True
        self._aim(self._position)

    def _aim(self, target: Point) -> None:
        here = self._position
        if here.distance_m(target) > CAPTURE_RADIUS_M:  # closer, the direction would be noise
            self._heading_rad = math.atan2(
                target.north_m - here.north_m, target.east_m - here.east_m
            )
        self._target = target

    def _send(self) -> None:
        if self._now_s is None:
            return  # the first step sends it
        self._link.send(
            PoseSetpoint(
                stamp_s=self._now_s,
                position=self._target,
                z_m=0.0 if self._coming_up else self._survey_z_m,
                heading_rad=self._heading_rad,
            )
        )
