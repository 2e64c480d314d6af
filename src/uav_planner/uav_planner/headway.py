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
    difference_m
        The same in this sortie so far, of one that is gone on with.

    """

    def __init__(self, step_m: float, known_m: float = 0.0, difference_m: float = 0.0) -> None:
        self._step_m = step_m
        self._known_m = known_m
        self._hop: Point | None = None
        self._covered_m = 0.0
        self._ticks = 0
        self._difference_m = difference_m
        """The largest between a tick's way and what it should have been."""

    def note(self, before: Point, after: Point, target: Point) -> bool:
        """
        Take one tick of a hop to ``target``; return whether it makes a difference.

        The last one, which may be short, says nothing.
        """
        if target != self._hop:
            self._hop, self._covered_m, self._ticks = target, 0.0, 0
        left_m = after.distance_m(target)
        if left_m <= self._step_m:
            return False
        self._covered_m += before.distance_m(target) - left_m
        self._ticks += 1
        difference_m = abs(self._covered_m / self._ticks - self._step_m)
        if self._ticks < SETTLED_TICKS or difference_m <= self._difference_m:
            return False
        self._difference_m = difference_m
        return True

    @property
    def difference_m(self) -> float:
        """Return the largest difference seen in this sortie so far, metres."""
        return self._difference_m

    @property
    def known_m(self) -> float:
        """Return that of the sortie before, metres."""
        return self._known_m

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
