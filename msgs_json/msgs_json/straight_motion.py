"""A simulated point that moves straight to where it is sent, at a constant speed."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from msgs_json.geometry import Point


class StraightMotion:
    """
    The horizontal motion of a simulated vehicle in frame ``map``.

    The position follows from where and when the present hop began, not from the position a step
    before: rounding does not add up, so a hop takes `geometry.whole_ticks` of its length.
    """

    def __init__(self, start: Point, speed_mps: float) -> None:
        self.position = start
        self.target = start
        self._speed_mps = speed_mps
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

    def step(self, now_s: float) -> None:
        """
        Move to where the point is at ``now_s``.

        The first step does not move. Where time goes back nothing moves until it has caught up.
        """
        self._now_s = now_s if self._now_s is None else max(now_s, self._now_s)
        if self._origin_s is None:
            self._origin_s = self._now_s
        moved_m = self._speed_mps * (self._now_s - self._origin_s)
        self.position = self._origin.toward(self.target, moved_m)
