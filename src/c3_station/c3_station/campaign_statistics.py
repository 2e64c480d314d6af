"""
What many missions say together, and how sure one may be of it.

All intervals hold with 95 % confidence. Nothing is drawn: the same results give the same figures.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

_Z = 1.959964
"""The normal distribution is within this many standard deviations with 95 %."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Interval:
    """A closed interval."""

    low: float
    high: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Share:
    """How many of a number of missions something holds for."""

    count: int
    total: int

    @property
    def fraction(self) -> float:
        """Return the share; 0 of none."""
        return self.count / self.total if self.total else 0.0

    @property
    def interval(self) -> Interval:
        """
        Return where the true share is.

        Wilson's score interval: it holds for few missions and for shares near 0 and 1, too; after
        0 of 10,000 it ends at 0.04 %.
        """
        if not self.total:
            return Interval(low=0.0, high=1.0)
        squared = _Z * _Z
        weight = 1.0 / (1.0 + squared / self.total)
        centre = weight * (self.fraction + squared / (2 * self.total))
        spread = self.fraction * (1.0 - self.fraction) / self.total
        half = weight * _Z * math.sqrt(spread + squared / (4 * self.total**2))
        # The ends at shares of 0 and 1 are these themselves, but for rounding.
        return Interval(
            low=min(self.fraction, max(0.0, centre - half)),
            high=max(self.fraction, min(1.0, centre + half)),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """How a figure is distributed over missions."""

    total: int
    """Missions that have the figure."""
    least: float
    low: float
    """A tenth of the missions is below."""
    quarter: float
    median: float
    three_quarters: float
    high: float
    """A tenth of the missions is above."""
    most: float
    median_interval: Interval
    """Where the true median is."""


def spread_of(values: Iterable[float | None]) -> Spread | None:
    """Return how values are distributed; None counts as no value, and so does the answer."""
    ordered = np.sort(np.array([value for value in values if value is not None], dtype=float))
    if not ordered.size:
        return None
    least, low, quarter, median, three_quarters, high, most = np.quantile(
        ordered, (0.0, 0.1, 0.25, 0.5, 0.75, 0.9, 1.0)
    ).tolist()
    return Spread(
        total=ordered.size,
        least=least,
        low=low,
        quarter=quarter,
        median=median,
        three_quarters=three_quarters,
        high=high,
        most=most,
        median_interval=_median_interval(ordered.tolist()),
    )


def _median_interval(ordered: Sequence[float]) -> Interval:
    """
    Return where the true median is, whatever the distribution.

    The number of values below it is binomial with probability 1/2, so two of the ordered values
    enclose it; which, is taken from the normal approximation, rounded outward.
    """
    half = _Z * math.sqrt(len(ordered)) / 2.0
    middle = len(ordered) / 2.0
    first = max(0, math.floor(middle - half) - 1)
    last = min(len(ordered) - 1, math.ceil(middle + half))
    return Interval(low=ordered[first], high=ordered[last])
