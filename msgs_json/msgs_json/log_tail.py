"""The latest entries of an agent's log, kept in its store until they are recorded."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

    from msgs_json.store import Store

_KIND = 'log'

_KEPT_MAX = 256
"""Not recorded; the world waits for the recorder after so many messages of all nodes."""


class LogTail:
    """
    Entries by number, as they were or will be published.

    A process that dies may have stored more than it has said, and a recorder that dies may have
    heard more than it has written: the next process says all of these again, bit for bit.

    Parameters
    ----------
    store
        The agent's; whoever commits to it makes this last.

    """

    def __init__(self, store: Store) -> None:
        self._store = store
        kept = store.load(_KIND, bytes)
        self._kept = deque(int(number) for number in kept)
        self.unsaid = list(kept.values())
        """What processes before this one may not have said, or said in vain."""
        self._next = self._kept[-1] + 1 if self._kept else 0
        self._recorded: int | None = None
        """None: what is said is recorded at once."""

    @property
    def said(self) -> int:
        """Return the number below which this process, or one before it, has said all entries."""
        return self._kept[0] if self.unsaid else self._next

    def say_again(self) -> list[bytes]:
        """Return what is unsaid, and take it for said from now on."""
        unsaid, self.unsaid = self.unsaid, []
        return unsaid

    def recorded(self, below: int) -> None:
        """Note that entries below a number need not be said again, and all others must be."""
        self._recorded = below

    def keep(self, entries: Iterable[bytes]) -> None:
        """Put entries that are said once they are stored; drop those that need not be kept."""
        below = self.said if self._recorded is None else self._recorded
        for entry in entries:
            self._store.put(_KIND, _key(self._next), entry)
            self._kept.append(self._next)
            self._next += 1
        while self._kept and (self._kept[0] < below or len(self._kept) > _KEPT_MAX):
            self._store.drop(_KIND, _key(self._kept.popleft()))


def _key(number: int) -> str:
    """Return the key of an entry; keys are in the order of their numbers."""
    return f'{number:012}'
