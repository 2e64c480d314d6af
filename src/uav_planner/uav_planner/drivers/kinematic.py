"""The simulated UAV: a point that flies straight at a constant speed and height."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from msgs_json.drivers import CommandRefusedError, VehicleState

if TYPE_CHECKING:
    from msgs_json.drivers import DriverPorts, UavDriverSetup
    from msgs_json.geometry import Point


def make_driver(setup: UavDriverSetup, ports: DriverPorts) -> KinematicUav:
    """Return a simulated UAV at its home; it needs no topics."""
    return KinematicUav(setup)


class KinematicUav:
    """
    A constant-speed point.

    The position follows from where and when the present flight began, not from the position a
    step before: rounding does not add up, so a hop takes `geometry.whole_ticks` of its length.
    """

    def __init__(self, setup: UavDriverSetup) -> None:
        self._speed_mps = setup.speed_mps
        self._altitude_m = setup.altitude_m
        self._position = setup.home
        self._heading_rad = 0.0
        self._target = setup.home
        self._now_s: float | None = None
        """Time of the last step."""
        self._origin = setup.home
        """Where the present flight began."""
        self._origin_s: float | None = None
        """When it began; None before the first step, at which it then begins."""

    def go_to(self, target: Point) -> None:
        """Fly straight to a point and hold there, from the next step on."""
        distance_m = self._position.distance_m(target)
        if not math.isfinite(distance_m):
            raise CommandRefusedError(f'cannot fly to {target}: it must be finite')
        if target == self._target:
            return  # under way already; a new beginning in mid-flight would add rounding
        self._origin, self._origin_s = self._position, self._now_s
        self._target = target

    def step(self, now_s: float) -> VehicleState:
        """Move to ``now_s``; where time goes back, nothing moves until it has caught up."""
        self._now_s = now_s if self._now_s is None else max(now_s, self._now_s)
        if self._origin_s is None:
            self._origin_s = self._now_s
        flown_m = self._speed_mps * (self._now_s - self._origin_s)
        self._position = self._origin.toward(self._target, flown_m)
        arrived = self._position == self._target
        if not arrived:
            self._heading_rad = math.atan2(
                self._target.north_m - self._position.north_m,
                self._target.east_m - self._position.east_m,
            )
        return VehicleState(
            position=self._position,
            z_m=self._altitude_m,
            heading_rad=self._heading_rad,
            speed_mps=0.0 if arrived else self._speed_mps,
        )
