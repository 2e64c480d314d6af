"""The simulated UAV: a point that flies straight at a constant air speed and height."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from msgs_json.driver_memory import DriverMemory
from msgs_json.drivers import CommandRefusedError, VehicleState
from msgs_json.straight_motion import Hop, StraightMotion

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
        self._memory = DriverMemory(Hop)

    def go_to(self, target: Point) -> None:
        """Fly straight to a point and hold there, from the next step on."""
        if not math.isfinite(self._motion.position.distance_m(target)):
            raise CommandRefusedError(f'cannot fly to {target}; must be finite')
        self._motion.head_for(target)

    def step(self, now_s: float) -> VehicleState:
        """Move to ``now_s``; where time goes back, nothing moves until it has caught up."""
        self._motion.step(now_s)
        position, hop = self._motion.position, self._motion.hop
        return VehicleState(
            position=position,
            z_m=self._altitude_m,
            heading_rad=hop.heading_rad,
            speed_mps=0.0 if position == hop.target else self._motion.ground_speed_mps,
        )

    def memory(self) -> bytes:
        """Return the present hop: where the UAV is on it follows from the time."""
        return self._memory.encode(self._motion.hop)

    def recall(self, memory: bytes) -> None:
        """Fly on, for a simulated vehicle does not vanish with its process."""
        self._motion.recall(self._memory.decode(memory))
