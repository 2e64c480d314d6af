"""A simulated point that moves straight to where it is sent, in wind or current too."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from msgs_json.geometry import Point


@dataclass(frozen=True, slots=True, kw_only=True)
class Flow:
    """A steady wind or current in frame ``map``: where the air or the water moves."""

    east_mps: float = 0.0
    north_mps: float = 0.0

    @property
    def speed_mps(self) -> float:
        """Return how fast it flows."""
        return math.hypot(self.east_mps, self.north_mps)

    def ground_speed_mps(self, speed_mps: float, start: Point, end: Point) -> float:
        """
        Return how fast a vehicle gets on that holds its straight track through the flow (crabs).

        It points as far upstream as cancels the flow across the track; what is left of its own
        speed and the flow along the track carry it on. 0 where the flow is too strong for that:
        it is never carried back. In a flow of 0 the speed is returned bit for bit.
        """
        distance_m = start.distance_m(end)
        if distance_m == 0.0:
            return speed_mps
        east = (end.east_m - start.east_m) / distance_m
        north = (end.north_m - start.north_m) / distance_m
        along_mps = east * self.east_mps + north * self.north_mps
        across_mps = east * self.north_mps - north * self.east_mps
        if abs(across_mps) > speed_mps:
            return 0.0
        return max(0.0, along_mps + math.sqrt(speed_mps**2 - across_mps**2))


STILL = Flow()


class StraightMotion:
    """
    The horizontal motion of a simulated vehicle in frame ``map``.

    The position follows from where and when the present hop began, not from the position a step
    before: rounding does not add up, so a hop takes `geometry.whole_ticks` of its length.
    ``speed_mps`` is through the air or the water; in a flow the way over ground takes accordingly
    longer or shorter.
    """

    def __init__(self, start: Point, speed_mps: float, flow: Flow = STILL) -> None:
        self.position = start
        self.target = start
        self.ground_speed_mps = speed_mps
        """On the way to the target."""
        self._speed_mps = speed_mps
        self._flow = flow
        self._now_s: float | None = None
        """Time of the last step."""
        self._origin = start
        """Where the present hop began."""
        self._origin_s: float | None = None
        """When it began; None before the first step, at which it then begins."""

    def head_for(self, target: Point) -> None:
        """Move straight to a point and hold there, from the next step on."""
        if target == self.target:
            return  # under way already; a new beginning in mid-hop would add rounding
        self.target = target
        self._origin, self._origin_s = self.position, self._now_s
        self.ground_speed_mps = self._flow.ground_speed_mps(self._speed_mps, self.position, target)

    def step(self, now_s: float) -> None:
        """
        Move to where the point is at ``now_s``.

        The first step does not move. Where time goes back nothing moves until it has caught up.
        """
        self._now_s = now_s if self._now_s is None else max(now_s, self._now_s)
        if self._origin_s is None:
            self._origin_s = self._now_s
        moved_m = self.ground_speed_mps * (self._now_s - self._origin_s)
        self.position = self._origin.toward(self.target, moved_m)
