"""Sets of numbers that mostly follow one another, such as those of samples that were received."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from typing import TYPE_CHECKING, Self

if TYPE_CHECKING:
    from collections.abc import Iterable


class NumberSet:
    """
    A set of non-negative ints, kept as spans: what follows one another takes no more memory.

    A span is ``(first, until)``, ``until`` not being in it. Those of a set are in ascending order
    and do not touch one another. (Not a library's: interval libraries take ten times as long, and
    compiled sets of ints do not give their spans.)
    """

    __slots__ = ('_firsts', '_untils')

    def __init__(self) -> None:
        self._firsts: list[int] = []
        self._untils: list[int] = []

    @classmethod
    def from_spans(cls, spans: Iterable[tuple[int, int]]) -> Self:
        """Return the numbers of spans, which may overlap and be in any order; see `add`."""
        numbers = cls()
        for first, until in spans:
            numbers.add(first, until)
        return numbers

    def add(self, first: int, until: int) -> None:
        """
        Add the numbers from ``first`` up to, not including, ``until``.

        Raises
        ------
        ValueError
            It is no span: ``0 <= first < until`` does not hold.

        """
        if not 0 <= first < until:
            raise ValueError(f'({first}, {until}) is no span: 0 <= first < until must hold')
        # The spans [low, high) touch the new one, which takes their place.
        low = bisect_left(self._untils, first)
        high = bisect_right(self._firsts, until)
        if low < high:
            first = min(first, self._firsts[low])
            until = max(until, self._untils[high - 1])
        self._firsts[low:high] = [first]
        self._untils[low:high] = [until]

    @property
    def spans(self) -> tuple[tuple[int, int], ...]:
        """Return the spans of the set."""
        return tuple(zip(self._firsts, self._untils, strict=True))

    @property
    def prefix(self) -> int:
        """Return how many numbers from 0 on are in the set without a gap."""
        return self._untils[0] if self._firsts and self._firsts[0] == 0 else 0

    def __contains__(self, number: int) -> bool:
        at = bisect_right(self._firsts, number)
        return at > 0 and number < self._untils[at - 1]

    def __len__(self) -> int:
        return sum(self._untils) - sum(self._firsts)
