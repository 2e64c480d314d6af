"""How fast the UAV really gets along, for the way home: wind is in no plan."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from msgs_json.geometry import Point

SETTLED_TICKS = 3
"""A hop tells something after so many whole ticks: the first ones may be spent speeding up."""

NOISE = 1e-6
"""Of a tick's way; smaller differences are rounding."""

ALLOWANCE = 1.5
"""
The way home may differ by so many times what was seen.

A hop at an angle to the wind feels only part of it: this is enough up to 48 degrees.
"""

SLOWEST = 0.1
"""Of a tick's way; slower than that no estimate gets, so that the way home stays finite."""


class Headway:
    """
    Watches the UAV's way per tick on the hops of a sortie; knows that of the sortie before.

    A wind that holds the UAV up on one hop, or pushes it, may hold it up as much on the way home.

    Parameters
    ----------
    step_m
        How far the UAV flies in a tick without wind, metres.
    known_m
        What a tick's way differed from that in the sortie before, metres.

    """

    def __init__(self, step_m: float, known_m: float = 0.0) -> None:
        self._step_m = step_m
        self._known_m = known_m
        self._hop: Point | None = None
        self._covered_m = 0.0
        self._ticks = 0
        self._difference_m = 0.0
        """The largest between a tick's way and what it should have been."""

    def note(self, before: Point, after: Point, target: Point) -> None:
        """Take one tick of a hop to ``target``; the last one, which may be short, says nothing."""
        if target != self._hop:
            self._hop, self._covered_m, self._ticks = target, 0.0, 0
        left_m = after.distance_m(target)
        if left_m <= self._step_m:
            return
        self._covered_m += before.distance_m(target) - left_m
        self._ticks += 1
        if self._ticks >= SETTLED_TICKS:
            difference_m = abs(self._covered_m / self._ticks - self._step_m)
            self._difference_m = max(self._difference_m, difference_m)

    def next_sortie(self) -> Headway:
        """Return a new one for the next sortie: the wind will not have changed very much."""
        return Headway(self._step_m, self._difference_m)

    @property
    def safe_step_m(self) -> float:
        """Return the way per tick to reckon with on the way home, metres."""
        difference_m = max(self._known_m, self._difference_m)
        if difference_m <= NOISE * self._step_m:
            return self._step_m
        return max(self._step_m - ALLOWANCE * difference_m, SLOWEST * self._step_m)
