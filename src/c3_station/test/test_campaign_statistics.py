"""Figures of many missions: shares and medians, and whether their intervals hold."""

from __future__ import annotations

import math
import statistics

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from c3_station.campaign_statistics import Share, spread_of


def chance_of(successes: int, trials: int, fraction: float) -> float:
    """Return the binomial probability."""
    return (
        math.comb(trials, successes) * fraction**successes * (1 - fraction) ** (trials - successes)
    )


# --- shares --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('count', 'total', 'low', 'high'),
    [
        # Newcombe 1998, "Two-sided confidence intervals for the single proportion", table I.
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ],
)
def test_interval_of_a_share_is_that_of_wilson(
    count: int, total: int, low: float, high: float
) -> None:
    interval = Share(count=count, total=total).interval
    assert (interval.low, interval.high) == pytest.approx((low, high), abs=6e-5)


def test_none_of_ten_thousand_says_much_and_none_of_none_nothing() -> None:
    assert Share(count=0, total=10_000).interval.high == pytest.approx(0.000384, abs=1e-6)
    nothing = Share(count=0, total=0)
    assert (nothing.fraction, nothing.interval.low, nothing.interval.high) == (0.0, 0.0, 1.0)


@given(total=st.integers(1, 10_000), data=st.data())
def test_interval_of_a_share_holds_the_share(total: int, data: st.DataObject) -> None:
    count = data.draw(st.integers(0, total))
    share, mirrored = Share(count=count, total=total), Share(count=total - count, total=total)
    assert 0.0 <= share.interval.low <= share.fraction <= share.interval.high <= 1.0
    assert share.interval.low == pytest.approx(1.0 - mirrored.interval.high)


@pytest.mark.parametrize('fraction', [0.02, 0.3, 0.5])
def test_interval_of_a_share_is_right_about_nineteen_times_of_twenty(fraction: float) -> None:
    total = 200
    right = sum(
        chance_of(count, total, fraction)
        for count in range(total + 1)
        if Share(count=count, total=total).interval.low
        <= fraction
        <= Share(count=count, total=total).interval.high
    )
    assert 0.93 < right < 0.98


# --- figures -------------------------------------------------------------------------------------


def test_a_spread_has_the_order_statistics() -> None:
    spread = spread_of([float(value) for value in range(101)])
    assert spread is not None
    assert (spread.total, spread.low, spread.quarter, spread.median) == (101, 10.0, 25.0, 50.0)
    assert (spread.three_quarters, spread.high) == (75.0, 90.0)
    assert (spread.median_interval.low, spread.median_interval.high) == (39.0, 61.0)


def test_what_has_no_value_is_left_out() -> None:
    assert spread_of([None, None]) is None
    spread = spread_of([None, 3.0, None, 1.0, 2.0])
    assert spread is not None
    assert (spread.total, spread.median) == (3, 2.0)
    assert (spread.median_interval.low, spread.median_interval.high) == (1.0, 3.0)


@given(values=st.lists(st.floats(-1e6, 1e6), min_size=1))
def test_a_spread_does_not_depend_on_the_order(values: list[float]) -> None:
    spread = spread_of(values)
    assert spread == spread_of(sorted(values, reverse=True))
    assert spread is not None
    assert spread.median == pytest.approx(statistics.median(values))
    assert spread.median_interval.low <= spread.median <= spread.median_interval.high


@pytest.mark.parametrize('total', [*range(6, 60), 200, 1000, 2000])
def test_the_interval_of_a_median_holds_it_with_the_confidence_it_claims(total: int) -> None:
    # Of values without ties, the true median is above the k lowest with binomial probability.
    spread = spread_of(np.arange(total, dtype=float).tolist())
    assert spread is not None
    first, last = int(spread.median_interval.low), int(spread.median_interval.high)
    inside = sum(math.comb(total, below) for below in range(first + 1, last + 1)) / 2**total
    assert inside >= 0.95
    if total >= 60:
        assert inside < 0.97
