"""What was heard before is not heard again: a sliding window over sequence numbers (RFC 4303)."""

from __future__ import annotations

WINDOW = 64
"""So many numbers up to the highest one are told apart; RFC 4303 (3.4.3) has 64 as its default."""

_ALL_HEARD = (1 << WINDOW) - 1


class ReplayWindow:
    """
    The sequence numbers of one sender that may still be accepted.

    Each number is accepted at most once. Messages may overtake one another by less than
    ``WINDOW``; what is older is refused, heard before or not. Gaps may be of any size.

    Parameters
    ----------
    highest
        The highest number that was accepted before, by a process that has died; everything up to
        it is refused. -1: nothing was.

    """

    __slots__ = ('_heard', '_highest')

    def __init__(self, highest: int = -1) -> None:
        self._highest = highest
        # Bit i: highest - i was accepted.
        self._heard = _ALL_HEARD

    @property
    def highest(self) -> int:
        """Return the highest number accepted, -1 if none was: all that a restart needs to know."""
        return self._highest

    def is_fresh(self, seq: int) -> bool:
        """Return whether a message with this number may be accepted."""
        age = self._highest - seq
        return age < 0 or (age < WINDOW and not self._heard >> age & 1)

    def accept(self, seq: int) -> None:
        """
        Take note that a message with this number was accepted.

        Only of one whose signature is right, or a stranger could move the window on.

        Raises
        ------
        ValueError
            The number is not fresh.

        """
        if not self.is_fresh(seq):
            raise ValueError(
                f'seq {seq} was accepted before or is {WINDOW} or more below {self._highest}'
            )
        step = seq - self._highest
        if step < 0:
            self._heard |= 1 << -step
            return
        # A restarted sender is 2**32 ahead: such a step is not shifted by.
        self._heard = (self._heard << step | 1) & _ALL_HEARD if step < WINDOW else 1
        self._highest = seq
