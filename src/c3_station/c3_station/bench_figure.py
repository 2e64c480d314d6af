"""What a benchmark measures: figures, each a ratio taken in one run, beside its aim."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """One line of the table."""

    what: str
    value: str
    aim: str = ''
    met: bool | None = None
    """Whether the aim is met; None where there is none."""


def at_least(what: str, ratios: Sequence[float], aim: float) -> Figure:
    """Return a figure whose median should be no smaller than its aim."""
    is_met = statistics.median(ratios) >= aim
    return Figure(what=what, value=spread(ratios), aim=f'>= {aim:g}', met=is_met)


def at_most(what: str, ratios: Sequence[float], aim: float) -> Figure:
    """Return a figure whose median should be no larger than its aim."""
    is_met = statistics.median(ratios) <= aim
    return Figure(what=what, value=spread(ratios), aim=f'<= {aim:g}', met=is_met)


def spread(ratios: Sequence[float]) -> str:
    """Return the median of ratios, with the smallest and the largest where there are several."""
    median = number(statistics.median(ratios))
    if len(ratios) == 1:
        return median
    return f'{median}  ({number(min(ratios))} ... {number(max(ratios))}, {len(ratios)} runs)'


def number(ratio: float) -> str:
    """Return a ratio in as many digits as it deserves."""
    return f'{ratio:,.0f}' if ratio >= 100 else f'{ratio:.3g}'
