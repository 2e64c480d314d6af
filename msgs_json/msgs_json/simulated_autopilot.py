"""An ideal vehicle behind driver ports: it follows setpoints and measures its pose exactly."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from msgs_json.drivers import VehicleUnavailableError
from msgs_json.geometry import TOLERANCE
from msgs_json.ros_messages import Odometry, PoseSetpoint
from msgs_json.straight_motion import StraightMotion
from msgs_json.topics import SETPOINT, VEHICLE_ODOM

if TYPE_CHECKING:
    from collections.abc import Callable

    from msgs_json.geometry import Point
    from msgs_json.ros_messages import RosMessage
    from msgs_json.topics import Topic


class SimulatedAutopilot:
    """
    The ports of a ``topics`` driver (`drivers.DriverPorts`) with a simulated vehicle behind them.

    It moves straight to the last setpoint at a constant speed, up and down at another, and
    publishes its pose at every ``step``; ``is_silent`` stops the publishing.
    """

    def __init__(self, start: Point, z_m: float, speed_mps: float, vertical_mps: float) -> None:
        self.z_m = z_m
        self.is_silent = False
        self.setpoints: list[PoseSetpoint] = []
        """All that were sent, oldest first."""
        self._speed_mps = speed_mps
        self._vertical_mps = vertical_mps
        self._motion = StraightMotion(start, speed_mps)
        self._now_s: float | None = None
        self._listeners: list[Callable[[Odometry], None]] = []

    @property
    def position(self) -> Point:
        """Where the vehicle is."""
        return self._motion.position

    def publish(self, topic: Topic, message: RosMessage) -> None:
        """Take a setpoint; the vehicle makes for it from the next step on."""
        if topic is not SETPOINT or not isinstance(message, PoseSetpoint):
            raise VehicleUnavailableError(f'the autopilot listens to {SETPOINT.name} only')
        self.setpoints.append(message)
        self._motion.head_for(message.position)

    def subscribe_odometry(self, topic: Topic, callback: Callable[[Odometry], None]) -> None:
        """Call back with the pose at every step."""
        if topic is not VEHICLE_ODOM:
            raise VehicleUnavailableError(f'the autopilot publishes {VEHICLE_ODOM.name} only')
        self._listeners.append(callback)

    def step(self, now_s: float) -> None:
        """Move to ``now_s`` and publish the pose."""
        elapsed_s = 0.0 if self._now_s is None else now_s - self._now_s
        self._now_s = now_s
        before = self.position
        self._motion.step(now_s)
        if self.setpoints and elapsed_s > 0.0:
            self.z_m = _approach(self.z_m, self.setpoints[-1].z_m, self._vertical_mps * elapsed_s)
        if self.is_silent:
            return
        odometry = Odometry(
            stamp_s=now_s,
            child_frame_id='base_link',
            position=self.position,
            z_m=self.z_m,
            heading_rad=self.setpoints[-1].heading_rad if self.setpoints else 0.0,
            speed_mps=self._speed_mps if self.position != before else 0.0,
        )
        for listener in self._listeners:
            listener(odometry)


def _approach(value: float, target: float, length: float) -> float:
    if abs(target - value) <= length * (1.0 + TOLERANCE):
        return target
    return value + math.copysign(length, target - value)
