"""The simulated AUV: constant speed from waypoint to waypoint, with a surfacing model."""

from __future__ import annotations

import math
from bisect import bisect_right
from itertools import accumulate, pairwise
from typing import TYPE_CHECKING, Annotated

import msgspec
from msgspec.structs import replace

from auv_sim.drivers.survey_depth import survey_z_m
from auv_sim.surfacing import LegFate, surfacing_model
from msgs_json.driver_memory import DriverMemory
from msgs_json.drivers import AuvState, CommandRefusedError
from msgs_json.geometry import TIME_TOLERANCE_S, Point, is_before, path_length_m

if TYPE_CHECKING:
    from collections.abc import Sequence

    from msgs_json.drivers import AuvDriverSetup, DriverPorts


def make_driver(setup: AuvDriverSetup, ports: DriverPorts) -> KinematicAuv:
    """Return a simulated AUV, surfaced at its start; it needs no topics."""
    return KinematicAuv(setup)


class _Course(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """
    What the AUV was told last, and when: where it is follows from that and the time.

    Times that are None are that of the first step, which is still to come.
    """

    first_step_s: float | None = None
    legs: Annotated[int, msgspec.Meta(ge=0, le=1_000_000)] = 0
    """How many there were, with the present one; each drew its fate from the generator."""
    origin: Point
    """Where the present leg began; before the first one, where the AUV is."""
    heading_rad: float = 0.0
    """When the leg began."""
    waypoints: tuple[Point, ...] = ()
    began_s: float | None = None
    swims_s: float
    """How long, at most: until it was told to come up; infinite as long as it was not."""


class KinematicAuv:
    """
    A point of constant speed through the water on a polyline, which dives and surfaces at once.

    The position follows from where and when the present leg began, not from the position a step
    before: rounding does not add up, so no waypoint is reached a tick late, and a driver that is
    made anew can go on as this one. Whatever its fate is, it never leaves the polyline nor goes
    back on it; heading and speed are those over ground.

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
        self._memory = DriverMemory(_Course)
        self._now_s: float | None = None
        """Time of the last step, as far as it is known."""
        self._course: _Course
        self._fate: LegFate
        self._leg: tuple[Point, ...]
        """Where the present leg began, then its waypoints up to where the AUV comes up."""
        self._ground_mps: tuple[float, ...]
        """Speed over ground from each point of the leg to the next."""
        self._headings_rad: tuple[float, ...]
        """On the way to each point of the leg; before the first, when the leg began."""
        self._arrivals_s: tuple[float, ...]
        """When each point of the leg is reached, counted from the leg's beginning."""
        self._begin(_Course(origin=setup.start, swims_s=0.0), LegFate())

    def follow(self, waypoints: Sequence[Point]) -> None:
        """Dive and swim through the points, from the next step on; draws from the generator."""
        if not waypoints or not math.isfinite(path_length_m((self._position, *waypoints))):
            raise CommandRefusedError(
                f'waypoints are {list(waypoints)}; must be at least one, and finite'
            )
        course = _Course(
            first_step_s=self._course.first_step_s,
            legs=self._course.legs + 1,
            origin=self._position,
            heading_rad=self._heading_rad,
            waypoints=tuple(waypoints),
            began_s=self._now_s,
            swims_s=math.inf,
        )
        self._begin(course, self._surfacing.draw(len(waypoints), self._rng))

    def surface(self) -> None:
        """Be at the surface at once, and stay there until the next ``follow``; not if lost."""
        if not (self._surfaced or self._is_lost):
            self._course = replace(self._course, swims_s=self._swum_s)
            self._swim()

    def step(self, now_s: float) -> AuvState:
        """Swim to ``now_s``; where time goes back, nothing moves until it has caught up."""
        self._now_s = now_s if self._now_s is None else max(now_s, self._now_s)
        if self._course.first_step_s is None:
            self._course = replace(self._course, first_step_s=self._now_s, began_s=self._now_s)
        self._swim()
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

    def memory(self) -> bytes:
        """Return the present course; the generator's state is told by how many legs there were."""
        return self._memory.encode(self._course)

    def recall(self, memory: bytes) -> None:
        """Swim on, for a simulated vehicle does not vanish with its process."""
        course = self._memory.decode(memory)
        fate = LegFate()
        for _ in range(course.legs):  # A model draws equally often for every leg.
            fate = self._surfacing.draw(len(course.waypoints), self._rng)
        self._now_s = course.began_s
        self._begin(course, fate)

    def _begin(self, course: _Course, fate: LegFate) -> None:
        """Work out the leg of a course, up to where the AUV comes up, and be at its beginning."""
        leg = (course.origin, *course.waypoints)
        hops = list(pairwise(leg))
        speed_mps = self._speed_mps * fate.speed_factor
        ground_mps = [fate.current.ground_speed_mps(speed_mps, *hop) for hop in hops]
        # Ways through the water; without a current they are, bit for bit, those over ground.
        water_m = [
            start.distance_m(end) * (speed_mps / hop_mps) if hop_mps else math.inf
            for (start, end), hop_mps in zip(hops, ground_mps, strict=True)
        ]
        arrivals_s = [way_m / speed_mps for way_m in accumulate(water_m, initial=0.0)]
        points = len(leg) if fate.surfaces_at is None else fate.surfaces_at + 1
        self._course, self._fate = course, fate
        self._leg = leg[:points]
        self._ground_mps = tuple(ground_mps)
        self._headings_rad = tuple(accumulate(hops, _next_heading_rad, initial=course.heading_rad))
        self._arrivals_s = tuple(arrivals_s[:points])
        self._swim()

    @property
    def _swum_s(self) -> float:
        """How long it has swum on the present leg."""
        first_step_s, began_s = self._course.first_step_s, self._course.began_s
        if self._now_s is None or first_step_s is None or began_s is None:
            return 0.0
        lost_s = max(first_step_s + self._fate.lost_s, began_s)
        return min(self._now_s - began_s, lost_s - began_s, self._course.swims_s)

    @property
    def _is_lost(self) -> bool:
        return not self._surfaced and self._is_past(self._fate.lost_s)

    def _is_past(self, time_s: float) -> bool:
        """Return whether a time, in seconds since the first step, has come."""
        first_step_s = self._course.first_step_s
        if time_s == math.inf or self._now_s is None or first_step_s is None:
            return False  # the first of these for most AUVs at all times
        return not is_before(self._now_s, first_step_s + time_s)

    def _swim(self) -> None:
        """Be where it is after as long as it has swum, under water or up."""
        swum_s = self._swum_s
        self._reached = bisect_right(self._arrivals_s, swum_s + TIME_TOLERANCE_S) - 1
        self._position = self._leg[self._reached]
        self._at_end = self._reached == len(self._leg) - 1
        # Not at the moment of diving: the shortest dive lasts until the next step.
        comes_up = (
            self._at_end and self._fate.surfaces_at is not None and swum_s > TIME_TOLERANCE_S
        )
        self._surfaced = comes_up or self._course.swims_s < math.inf
        self._heading_rad = self._headings_rad[self._reached]
        if self._at_end:
            return
        self._heading_rad = self._headings_rad[self._reached + 1]
        past_s = swum_s - self._arrivals_s[self._reached]
        if past_s > TIME_TOLERANCE_S:  # else it is exactly at the point
            ahead = self._leg[self._reached + 1]
            self._position = self._position.toward(ahead, self._ground_mps[self._reached] * past_s)


def _next_heading_rad(heading_rad: float, hop: tuple[Point, Point]) -> float:
    """Return the heading on a hop; where that has no length, the one before."""
    start, end = hop
    if start == end:
        return heading_rad
    return math.atan2(end.north_m - start.north_m, end.east_m - start.east_m)
