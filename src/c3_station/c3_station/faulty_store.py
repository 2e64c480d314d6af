"""A store whose disk fills up, and in which its process dies, when it is told so."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

from c3_station.fault_schedule import Moment
from msgs_json.store import MemoryStore, StoreError

if TYPE_CHECKING:
    T = TypeVar('T')


class ProcessDied(BaseException):
    """The process is gone: no agent may handle it, as none could handle SIGKILL."""


class FaultyStore:
    """A `Store` over one in memory, which stays when the process dies."""

    def __init__(self, memory: MemoryStore) -> None:
        self.is_full = False
        """Whether nothing can be written."""
        self.dies: Moment | None = None
        """Where in the next commit its process dies; None if it does not."""
        self._memory = memory

    def __str__(self) -> str:
        return str(self._memory)

    @property
    def is_changed(self) -> bool:
        """Return whether there is something to commit."""
        return self._memory.is_changed

    def load(self, kind: str, value_type: type[T]) -> dict[str, T]:
        """Return the committed values of a kind by key, in the order of their keys."""
        return self._memory.load(kind, value_type)

    def put(self, kind: str, key: str, value: object) -> None:
        """Set the value of an entry at the next commit, as the value is now."""
        self._memory.put(kind, key, value)

    def drop(self, kind: str, key: str) -> None:
        """Remove an entry at the next commit; one that is not there may be dropped."""
        self._memory.drop(kind, key)

    def commit(self) -> None:
        """Store all that was put and dropped since the last commit, in one piece."""
        if self.dies is Moment.BEFORE_COMMIT:
            raise ProcessDied
        if self.is_full:
            raise StoreError(f'{self}: no space left on device')
        self._memory.commit()
        if self.dies is Moment.AFTER_COMMIT:
            raise ProcessDied

    def close(self) -> None:
        """Give the store back; what is not committed is lost."""
        self._memory.close()

    def reopen(self) -> None:
        """Hold what a new process would find, and nothing else."""
        self._memory = self._memory.reopened()
        self.is_full, self.dies = False, None
