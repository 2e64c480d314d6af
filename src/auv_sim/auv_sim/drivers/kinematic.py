"""The simulated AUV: constant speed from waypoint to waypoint, with a surfacing model."""

from __future__ import annotations

import math
from bisect import bisect_right
from itertools import accumulate, pairwise
from typing import TYPE_CHECKING

from auv_sim.drivers.survey_depth import survey_z_m
from auv_sim.surfacing import LegFate, surfacing_model
from msgs_json.drivers import AuvState, CommandRefusedError
from msgs_json.geometry import TIME_TOLERANCE_S, is_before

if TYPE_CHECKING:
    from collections.abc import Sequence

    from msgs_json.drivers import AuvDriverSetup, DriverPorts
    from msgs_json.geometry import Point


def make_driver(setup: AuvDriverSetup, ports: DriverPorts) -> KinematicAuv:
    """Return a simulated AUV, surfaced at its start; it needs no topics."""
    return KinematicAuv(setup)


class KinematicAuv:
    """
    A point of constant speed through the water on a polyline, which dives and surfaces at once.

    The position follows from where and when the present leg began, not from the position a step
    before: rounding does not add up, so no waypoint is reached a tick late. Whatever its fate is,
    it never leaves the polyline nor goes back on it; heading and speed are those over ground.

    Raises
    ------
    ValueError
        The setup's depth or surfacing model is not one that can be simulated.

    """

    def __init__(self, setup: AuvDriverSetup) -> None:
        self._speed_mps = setup.speed_mps
        self._survey_z_m = survey_z_m(setup.depth_m)
        self._surfacing = surfacing_model(setup.surfacing)
        self._rng = setup.rng
        self._surfaced = True
        self._position = setup.start
        self._heading_rad = 0.0
        self._first_s = 0.0
        """Time of the first step."""
        self._now_s: float | None = None
        """Time of the last step."""
        self._fate = LegFate()
        self._leg: tuple[Point, ...] = (setup.start,)
        """Where the present leg began, then its waypoints up to where the AUV comes up."""
        self._ground_mps: tuple[float, ...] = ()
        """Speed over ground from each point of the leg to the next."""
        self._arrivals_s: tuple[float, ...] = (0.0,)
        """When each point of the leg is reached, counted from the leg's beginning."""
        self._began_s: float | None = None
        """When the leg began; None before the first step, at which it then begins."""
        self._reached = 0
        """Index of the last point of the leg that was reached; the leg's beginning is point 0."""

    def follow(self, waypoints: Sequence[Point]) -> None:
        """Dive and swim through the points, from the next step on; draws from the generator."""
        leg = (self._position, *waypoints)
        lengths_m = [start.distance_m(end) for start, end in pairwise(leg)]
        if not lengths_m or not math.isfinite(sum(lengths_m)):
            raise CommandRefusedError(
                f'waypoints are {list(waypoints)}; must be at least one, and finite'
            )
        fate = self._surfacing.draw(len(waypoints), self._rng)
        speed_mps = self._speed_mps * fate.speed_factor
        ground_mps = [fate.current.ground_speed_mps(speed_mps, *hop) for hop in pairwise(leg)]
        # Ways through the water; without a current they are, bit for bit, those over ground.
        water_m = [
            length_m * (speed_mps / hop_mps) if hop_mps else math.inf
            for length_m, hop_mps in zip(lengths_m, ground_mps, strict=True)
        ]
        arrivals_s = [way_m / speed_mps for way_m in accumulate(water_m, initial=0.0)]
        points = len(leg) if fate.surfaces_at is None else fate.surfaces_at + 1
        self._fate = fate
        self._leg = leg[:points]
        self._ground_mps = tuple(ground_mps)
        self._arrivals_s = tuple(arrivals_s[:points])
        self._began_s = self._now_s
        self._reached = 0
        self._surfaced = False

    def surface(self) -> None:
        """Be at the surface at once, and stay there until the next ``follow``; not if lost."""
        self._surfaced = not self._is_lost

    def step(self, now_s: float) -> AuvState:
        """Swim to ``now_s``; where time goes back, nothing moves until it has caught up."""
        if self._now_s is None:
            self._first_s = self._now_s = now_s
        self._now_s = max(now_s, self._now_s)
        if self._began_s is None:
            self._began_s = self._now_s
        if not self._surfaced:
            lost_s = max(self._first_s + self._fate.lost_s, self._began_s)
            self._swim(min(self._now_s, lost_s) - self._began_s)
        is_swimming = not (self._surfaced or self._is_lost or self._at_end)
        return AuvState(
            position=self._position,
            z_m=0.0 if self._surfaced else self._survey_z_m,
            heading_rad=self._heading_rad,
            speed_mps=self._ground_mps[self._reached] if is_swimming else 0.0,
            surfaced=self._surfaced,
            waypoints_reached=self._reached,
            needs_help=self._is_past(self._fate.needs_help_s),
        )

    @property
    def _at_end(self) -> bool:
        return self._reached == len(self._leg) - 1

    @property
    def _is_lost(self) -> bool:
        return not self._surfaced and self._is_past(self._fate.lost_s)

    def _is_past(self, time_s: float) -> bool:
        """Return whether a time, in seconds since the first step, has come."""
        return self._now_s is not None and not is_before(self._now_s, self._first_s + time_s)

    def _swim(self, elapsed_s: float) -> None:
        self._reached = bisect_right(self._arrivals_s, elapsed_s + TIME_TOLERANCE_S) - 1
        self._position = self._leg[self._reached]
        if self._at_end:
            # Not at the moment of diving: the shortest dive lasts until the next step.
            comes_up = self._fate.surfaces_at is not None
            self._surfaced = comes_up and elapsed_s > TIME_TOLERANCE_S
            return
        ahead = self._leg[self._reached + 1]
        self._heading_rad = math.atan2(
            ahead.north_m - self._position.north_m, ahead.east_m - self._position.east_m
        )
        past_s = elapsed_s - self._arrivals_s[self._reached]
        if past_s > TIME_TOLERANCE_S:  # else it is exactly at the point
            self._position = self._position.toward(ahead, self._ground_mps[self._reached] * past_s)
