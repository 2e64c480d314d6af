"""The simulated UAV: a point that flies straight at a constant air speed and height."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from msgs_json.drivers import CommandRefusedError, VehicleState
from msgs_json.straight_motion import StraightMotion

if TYPE_CHECKING:
    from msgs_json.drivers import DriverPorts, UavDriverSetup
    from msgs_json.geometry import Point


def make_driver(setup: UavDriverSetup, ports: DriverPorts) -> KinematicUav:
    """Return a simulated UAV at its home; it needs no topics."""
    return KinematicUav(setup)


class KinematicUav:
    """
    A point of constant air speed, at its height from the beginning.

    It holds its straight track in the setup's wind; heading and speed are those over ground.
    """

    def __init__(self, setup: UavDriverSetup) -> None:
        self._altitude_m = setup.altitude_m
        self._motion = StraightMotion(setup.home, setup.speed_mps, setup.wind)
        self._heading_rad = 0.0

    def go_to(self, target: Point) -> None:
        """Fly straight to a point and hold there, from the next step on."""
        if not math.isfinite(self._motion.position.distance_m(target)):
            raise CommandRefusedError(f'cannot fly to {target}; must be finite')
        self._motion.head_for(target)

    def step(self, now_s: float) -> VehicleState:
        """Move to ``now_s``; where time goes back, nothing moves until it has caught up."""
        self._motion.step(now_s)
        position, target = self._motion.position, self._motion.target
        arrived = position == target
        if not arrived:
            self._heading_rad = math.atan2(
                target.north_m - position.north_m, target.east_m - position.east_m
            )
        return VehicleState(
            position=position,
            z_m=self._altitude_m,
            heading_rad=self._heading_rad,
            speed_mps=0.0 if arrived else self._motion.ground_speed_mps,
        )
