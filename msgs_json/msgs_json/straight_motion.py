"""A simulated point that moves straight to where it is sent, in wind or current too."""

from __future__ import annotations

import math
from dataclasses import dataclass

import msgspec

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


class Hop(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A straight way; where a vehicle is on it follows from the time."""

    origin: Point
    target: Point
    heading_rad: float
    """To the target, 0 = east, counter-clockwise; where that is the origin, as the hop before."""
    began_s: float | None
    """None before the first step, at which it then begins."""


class StraightMotion:
    """
    The horizontal motion of a simulated vehicle in frame ``map``.

    The position follows from where and when the present hop began, not from the position a step
    before: rounding does not add up, so a hop takes `geometry.whole_ticks` of its length, and the
    hop is all that another motion needs to know to go on as this one. ``speed_mps`` is through the
    air or the water; in a flow the way over ground takes accordingly longer or shorter.
    """

    def __init__(self, start: Point, speed_mps: float, flow: Flow = STILL) -> None:
        self._speed_mps = speed_mps
        self._flow = flow
        self.hop: Hop
        """The present one."""
        self.ground_speed_mps: float
        """On the way to the target."""
        self.position: Point
        self._now_s: float | None
        """Time of the last step, as far as it is known."""
        self.recall(Hop(origin=start, target=start, heading_rad=0.0, began_s=None))

    def head_for(self, target: Point) -> None:
        """Move straight to a point and hold there, from the next step on."""
        if target == self.hop.target:
            return  # under way already; a new beginning in mid-hop would add rounding
        here, heading_rad = self.position, self.hop.heading_rad
        if target != here:
            heading_rad = math.atan2(target.north_m - here.north_m, target.east_m - here.east_m)
        self._begin(Hop(origin=here, target=target, heading_rad=heading_rad, began_s=self._now_s))

    def recall(self, hop: Hop) -> None:
        """Go on, with the next step, as the motion whose hop this was."""
        self.position, self._now_s = hop.origin, hop.began_s
        self._begin(hop)

    def step(self, now_s: float) -> None:
        """
        Move to where the point is at ``now_s``.

        The first step does not move. Where time goes back nothing moves until it has caught up.
        """
        self._now_s = now_s if self._now_s is None else max(now_s, self._now_s)
        began_s = self.hop.began_s
        if began_s is None:
            began_s = self._now_s
            self.hop = msgspec.structs.replace(self.hop, began_s=began_s)
        moved_m = self.ground_speed_mps * (self._now_s - began_s)
        self.position = self.hop.origin.toward(self.hop.target, moved_m)

    def _begin(self, hop: Hop) -> None:
        self.hop = hop
        self.ground_speed_mps = self._flow.ground_speed_mps(
            self._speed_mps, hop.origin, hop.target
        )
