from __future__ import annotations

from itertools import pairwise

import hypothesis.strategies as st
import pytest
from hypothesis import example, given

from msgs_json.number_set import NumberSet

UNTIL = 40
"""Small, so that spans touch and overlap often."""

spans = st.lists(
    st.tuples(st.integers(0, UNTIL - 1), st.integers(1, UNTIL)).filter(
        lambda span: span[0] < span[1]
    )
)


def members(spans: object) -> set[int]:
    return {number for first, until in spans for number in range(first, until)}


@given(spans)
@example([(0, 2), (4, 6), (2, 4)])  # fills a gap exactly
@example([(5, 6), (0, 9)])  # covers what is there
def test_holds_what_a_set_holds(added: list[tuple[int, int]]) -> None:
    numbers = NumberSet()
    model: set[int] = set()
    for first, until in added:
        numbers.add(first, until)
        model |= set(range(first, until))
        assert [number for number in range(-1, UNTIL + 1) if number in numbers] == sorted(model)
        assert len(numbers) == len(model)
        assert members(numbers.spans) == model
        assert numbers.prefix == min(set(range(UNTIL + 1)) - model)


@given(spans)
def test_spans_are_apart_and_ascending_and_give_the_set_back(added: list[tuple[int, int]]) -> None:
    numbers = NumberSet.from_spans(added)

    assert all(first < until for first, until in numbers.spans)
    assert all(until < first for (_, until), (first, _) in pairwise(numbers.spans))
    assert NumberSet.from_spans(reversed(numbers.spans)).spans == numbers.spans


def test_numbers_in_a_row_are_one_span() -> None:
    numbers = NumberSet()
    for number in range(10_000):
        numbers.add(number, number + 1)

    assert numbers.spans == ((0, 10_000),)


@pytest.mark.parametrize('span', [(-1, 2), (3, 3), (4, 3)])
def test_what_is_no_span_is_refused_and_changes_nothing(span: tuple[int, int]) -> None:
    numbers = NumberSet.from_spans([(1, 5)])

    with pytest.raises(ValueError, match=r'0 <= first < until must hold'):
        numbers.add(*span)
    assert numbers.spans == ((1, 5),)
