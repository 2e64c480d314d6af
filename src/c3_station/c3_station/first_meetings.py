"""
How soon the UAV can have met the AUVs for the first time, whatever the order.

Until its first meeting an AUV swims its initial path and then waits. The UAV comes from C3, and at
a meeting it is within R of the AUV; so it has to fly from disc to disc. Where it is within a disc
is not known: the disc is cut into squares, and from one square to another it flies at least the
gap between them. The best order is found over all subsets of AUVs that may have been met already
(the dynamic programme of Held and Karp for the travelling salesman, with release times).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from msgs_json.geometry import TOLERANCE
from uav_planner.sortie import whole_ticks_of_each

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from c3_station.fleet_limits import AuvLimits, FleetLimits

_SUBSETS_KEPT = 12
"""With more AUVs only their number is kept of who was met before: 2 to the power of this rows."""
_SUBSETS_TRIED = 16
"""With more AUVs the order is not searched at all."""
_WORK = 3e7
"""Sums in the search over orders: a few tenths of a second."""
_FINEST = 6
"""Squares along a disc's diameter, if there are few AUVs."""


class FirstMeetings:
    """
    The earliest ticks of all first meetings.

    Attributes
    ----------
    least_ticks
        Shape (rows, AUVs): no AUV is met for the first time before this tick. The row says whom
        the UAV has then met, this AUV included: as the bits of the row's number, or in a large
        fleet only how many, the row's number plus one. Infinite where that cannot be.

    """

    def __init__(self, limits: FleetLimits) -> None:
        auvs = len(limits.auvs)
        self._keeps_subsets = auvs <= _SUBSETS_KEPT
        flight = _DiscFlight(limits, _squares_along(auvs))
        if auvs > _SUBSETS_TRIED:
            self.least_ticks = flight.least_ticks_of_each_rank()
            return
        of_subsets = flight.least_ticks_of_each_subset()
        self.least_ticks = of_subsets if self._keeps_subsets else _of_each_rank(of_subsets)

    def most(self, worth: NDArray[np.float64]) -> float:
        """
        Return the most that all AUVs can be worth together, in the best order of first meetings.

        Parameters
        ----------
        worth
            What each AUV is worth if it is met as in `least_ticks`, of the same shape, not
            negative, and less the later it is met.

        """
        if not self._keeps_subsets:
            # Each rank with its best AUV, or each AUV at its best rank.
            return float(min(worth.max(axis=1).sum(), worth.max(axis=0).sum()))
        rows, auvs = worth.shape
        met = np.arange(rows)
        most = np.zeros(rows)
        for subsets in _by_size(auvs)[1:]:
            for auv in range(auvs):
                ending = subsets[subsets >> auv & 1 == 1]
                before = met[ending] ^ (1 << auv)
                most[ending] = np.maximum(most[ending], most[before] + worth[ending, auv])
        return float(most[-1])


def _squares_along(auvs: int) -> int:
    """Return in how many squares a disc is cut along its diameter."""
    for squares in range(_FINEST, 1, -1):
        if 2.0**auvs * (auvs * squares**2) ** 2 <= _WORK:
            return squares
    return 1


def _by_size(auvs: int) -> list[NDArray[np.intp]]:
    """Return the subsets of so many AUVs as bits, those of the same size together."""
    subsets = np.arange(1 << auvs)
    sizes = sum((subsets >> auv & 1 for auv in range(auvs)), start=np.zeros_like(subsets))
    return [subsets[sizes == size] for size in range(auvs + 1)]


def _of_each_rank(of_subsets: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.array(
        [of_subsets[subsets].min(axis=0) for subsets in _by_size(of_subsets.shape[1])[1:]]
    )


class _DiscFlight:
    """The UAV's flight between squares in which it is at first meetings."""

    def __init__(self, limits: FleetLimits, along: int) -> None:
        boxes = np.array([_positions(limits, auv) for auv in limits.auvs])
        squares = [_squares(limits, box, along) for box in boxes]
        first_ticks = np.array([auv.first_tick for auv in limits.auvs])
        self._auv = np.repeat(np.arange(len(boxes)), [len(each) for each in squares])
        """The AUV of each square."""
        self._first_ticks = first_ticks[self._auv]
        box_of_each, square_of_each = boxes[self._auv], np.concatenate(squares)
        c3 = np.array([[limits.c3.east_m, limits.c3.north_m] * 2])
        range_m = limits.range_m * (1.0 + TOLERANCE)  # of `within_range`
        self._hops = _hop_ticks(
            limits,
            np.maximum(
                _gaps_m(square_of_each, square_of_each),
                _gaps_m(box_of_each, box_of_each) - 2 * range_m,
            ),
        )
        """Between each two squares, ticks."""
        from_c3_m = np.maximum(_gaps_m(c3, square_of_each), _gaps_m(c3, box_of_each) - range_m)
        self._direct = np.maximum(_hop_ticks(limits, from_c3_m)[0], self._first_ticks)
        """Tick at which each square is reached at the earliest, straight from C3."""

    def least_ticks_of_each_subset(self) -> NDArray[np.float64]:
        """Return `FirstMeetings.least_ticks` by subsets."""
        auvs = int(self._auv[-1]) + 1
        of_auv = [self._auv == auv for auv in range(auvs)]
        least = np.full((1 << auvs, len(self._auv)), math.inf)
        least[1 << self._auv, np.arange(len(self._auv))] = self._direct
        after = self._after_each_subset(of_auv)
        for subsets in _by_size(auvs)[1:-1]:
            for square, auv in enumerate(self._auv.tolist()):
                before = subsets[subsets >> auv & 1 == 0]
                ticks = (least[before] + self._hops[:, square]).min(axis=1)
                ticks = np.maximum(ticks, after[before, square])
                least[before | 1 << auv, square] = ticks
        return np.stack([least[:, squares].min(axis=1) for squares in of_auv], axis=1)

    def _after_each_subset(self, of_auv: list[NDArray[np.bool_]]) -> NDArray[np.float64]:
        """
        Return when each square is reached at the earliest, by way of each AUV of a subset alone.

        Shape (subsets, squares). A way by several AUVs, square by square, may look shorter than
        that, since within a square it costs nothing to go on from another place.
        """
        after = np.empty((1 << len(of_auv), len(self._auv)))
        after[0] = self._direct
        for auv, squares in enumerate(of_auv):
            by_way_of = (self._direct[squares, None] + self._hops[squares]).min(axis=0)
            after[1 << auv : 2 << auv] = np.maximum(after[: 1 << auv], by_way_of)
        return after

    def least_ticks_of_each_rank(self) -> NDArray[np.float64]:
        """Return `FirstMeetings.least_ticks` by ranks, from the shortest hops to each AUV."""
        direct = self._direct
        hops = np.where(self._auv[:, None] == self._auv, math.inf, self._hops)
        shortest = np.sort(np.minimum(hops.min(axis=0), direct))
        least: NDArray[np.float64] = np.maximum(direct, np.cumsum(shortest)[:, None])
        return least


def _positions(limits: FleetLimits, auv: AuvLimits) -> tuple[float, float, float, float]:
    """Return a box (west, south, east, north) that holds an AUV that was not met yet, metres."""
    centres = [limits.region.centre(cell) for cell in auv.first_cells]
    east_m = [centre.east_m for centre in centres]
    north_m = [centre.north_m for centre in centres]
    return min(east_m), min(north_m), max(east_m), max(north_m)


def _squares(
    limits: FleetLimits, box: Sequence[float] | NDArray[np.float64], along: int
) -> NDArray[np.float64]:
    """Return boxes that hold the UAV when it meets an AUV of which a box is known."""
    west_m, south_m, east_m, north_m = box
    range_m = limits.range_m * (1.0 + TOLERANCE)
    easts_m = np.linspace(west_m - range_m, east_m + range_m, along + 1)
    norths_m = np.linspace(south_m - range_m, north_m + range_m, along + 1)
    west, south = (each.ravel() for each in np.meshgrid(easts_m[:-1], norths_m[:-1]))
    east, north = (each.ravel() for each in np.meshgrid(easts_m[1:], norths_m[1:]))
    squares = np.stack([west, south, east, north], axis=1)
    is_in_range: NDArray[np.bool_] = _gaps_m(squares, np.array([box]))[:, 0] <= range_m
    return squares[is_in_range]


def _gaps_m(boxes: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distances between boxes, shape (boxes, others), 0 where they touch."""
    west_m, south_m, east_m, north_m = (boxes[:, side, None] for side in range(4))
    other_west_m, other_south_m, other_east_m, other_north_m = others.T
    wide_m = np.maximum(other_west_m - east_m, west_m - other_east_m)
    high_m = np.maximum(other_south_m - north_m, south_m - other_north_m)
    gaps_m: NDArray[np.float64] = np.hypot(np.maximum(wide_m, 0.0), np.maximum(high_m, 0.0))
    return gaps_m


def _hop_ticks(limits: FleetLimits, gaps_m: NDArray[np.float64]) -> NDArray[np.float64]:
    return whole_ticks_of_each(np.maximum(gaps_m, 0.0) / limits.step_m)
