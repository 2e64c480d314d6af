"""
Where a real vehicle plugs in: the driver protocols, their errors, and how drivers are found.

A vehicle's package registers a factory under the entry-point group ``uav_planner.drivers`` or
``auv_sim.drivers`` and ships without any change here. `driver_checks` holds the conformance suite
that every driver passes. All positions are in frame ``map`` (ENU, metres), ``z_m`` is up.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import TYPE_CHECKING, Any, Protocol

import msgspec

from msgs_json.ros_messages import Odometry
from msgs_json.straight_motion import STILL, Flow

if TYPE_CHECKING:
    import numpy as np

    from msgs_json.geometry import Point
    from msgs_json.ros_messages import RosMessage
    from msgs_json.topics import Topic

SUBMERGED_Z_M = -1.0
"""At this height or below a vehicle counts as submerged; between it and 0 it is on its way."""


class DriverError(Exception):
    """Base of what a driver may raise."""


class CommandRefusedError(DriverError):
    """The vehicle cannot do what was asked (bad target, wrong mode); it goes on as before."""


class VehicleUnavailableError(DriverError):
    """The vehicle's state is not known (no position yet, link to the autopilot lost)."""


class VehicleState(msgspec.Struct, frozen=True, kw_only=True):
    """Where a vehicle is."""

    position: Point
    z_m: float
    heading_rad: float
    """0 = east, counter-clockwise."""
    speed_mps: float

    def odometry(self, vehicle: str, stamp_s: float) -> Odometry:
        """Return the state as the vehicle's odometry message (REP-105 frame names)."""
        return Odometry(
            stamp_s=stamp_s,
            child_frame_id=f'{vehicle}/base_link',
            position=self.position,
            z_m=self.z_m,
            heading_rad=self.heading_rad,
            speed_mps=self.speed_mps,
        )


class AuvState(VehicleState, frozen=True, kw_only=True):
    """Where an AUV is, and how far along its leg."""

    surfaced: bool
    """At the surface, radio out of the water."""
    waypoints_reached: int
    """How many points of the present leg it has reached."""
    needs_help: bool = False
    """
    It has a fault that ends its survey (a leak, a weak battery), and keeps it.

    Its agent brings it up, says so, and sends it on no further leg.
    """


class Vehicle(Protocol):
    """What every driver can do: die with its process while its vehicle goes on."""

    def memory(self) -> bytes:
        """
        Return what to `recall` in a new process, as far as the vehicle itself cannot tell it.

        It changes with commands only, or where the course changes by itself; as long as it does
        not, the same object is returned.
        """
        ...

    def recall(self, memory: bytes) -> None:
        """
        Go on where the driver of another process left off; before anything else is asked.

        The next thing is a step, which shows where the vehicle has got to meanwhile.

        Raises
        ------
        ValueError
            This is not the memory of such a driver.

        """
        ...


class UavDriver(Vehicle, Protocol):
    """Moves the UAV."""

    def go_to(self, target: Point) -> None:
        """
        Fly straight to a point and hold there, from the next step on; replaces the target before.

        Raises
        ------
        CommandRefusedError
            The point is not finite; the vehicle goes on as before.

        """
        ...

    def step(self, now_s: float) -> VehicleState:
        """
        Return the state at ``now_s``; a simulated vehicle moves there.

        The first step does not move, nor does one at the time of the step before; the latter
        shows the state as commands since then have changed it.

        Raises
        ------
        VehicleUnavailableError
            The position is not known.

        """
        ...


class AuvDriver(Vehicle, Protocol):
    """Moves an AUV."""

    def follow(self, waypoints: Sequence[Point]) -> None:
        """
        Dive and swim through the points in order, starting with the next step.

        The points are the centres of P_1 ... P_q where the vehicle is exactly at the centre of
        P_0, else those of P_0 ... P_q. The leg begins where the vehicle is: its present position
        is not among the points and does not count in ``waypoints_reached``. Under water at the
        last point it waits there for ``surface``. A vehicle that comes up by itself, at once or
        at a point, stays up until the next ``follow``.

        Raises
        ------
        CommandRefusedError
            There is no point to swim to, or one is not finite; the vehicle goes on as before.

        """
        ...

    def surface(self) -> None:
        """
        Come up here and now, and stay up until the next ``follow``.

        Told again before it is up, it goes on coming up.
        """
        ...

    def step(self, now_s: float) -> AuvState:
        """
        Return the state at ``now_s``; a simulated vehicle moves there.

        The first step does not move, nor does one at the time of the step before; the latter
        shows the state as commands since then have changed it.

        Raises
        ------
        VehicleUnavailableError
            The position is not known.

        """
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class UavDriverSetup:
    """What a UAV driver is made from."""

    name: str
    home: Point
    """C3, where the UAV starts."""
    speed_mps: float
    """Through the air."""
    altitude_m: float
    wind: Flow = STILL
    """Over the simulator's UAV; others ignore it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AuvDriverSetup:
    """What an AUV driver is made from."""

    name: str
    start: Point
    speed_mps: float
    depth_m: float
    """Depth of survey, metres, positive down."""
    surfacing: str
    """Surfacing model of the simulator as JSON (``{"model": "on_time"}``); others ignore it."""
    rng: np.random.Generator
    """Owned by the driver."""


class DriverPorts(Protocol):
    """How a driver reaches its vehicle over topics; the node host provides it."""

    def publish(self, topic: Topic, message: RosMessage) -> None:
        """Publish on a topic."""
        ...

    def subscribe_odometry(self, topic: Topic, callback: Callable[[Odometry], None]) -> None:
        """Call back with every odometry message of a topic."""
        ...


class NoPorts:
    """The ports of a run without ROS: a driver that needs topics is told so."""

    def publish(self, topic: Topic, message: RosMessage) -> None:
        """Refuse."""
        raise VehicleUnavailableError(f'no topic {topic.name} without ROS')

    def subscribe_odometry(self, topic: Topic, callback: Callable[[Odometry], None]) -> None:
        """Refuse."""
        raise VehicleUnavailableError(
            f'no topic {topic.name} without ROS; use driver "kinematic" in this run'
        )


@cache
def registered_drivers(group: str) -> Mapping[str, EntryPoint]:
    """Return the drivers that installed packages register in a group, by name."""
    # Asking importlib reads the metadata of every installed package, some 50 ms each time.
    return {entry.name: entry for entry in sorted(entry_points(group=group))}


def find_driver(group: str, name: str) -> Any:  # noqa: ANN401  factories differ by vehicle kind
    """
    Return the driver factory registered under a name.

    Raises
    ------
    ValueError
        No installed package registers that name; the text lists those there are.

    """
    found = registered_drivers(group)
    if name not in found:
        names = ', '.join(found) or 'none installed'
        raise ValueError(f'driver: {name!r} is not registered in {group}; there are: {names}')
    return found[name].load()
