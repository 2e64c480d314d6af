"""
Stores: what an agent must still know after its process has died.

A store holds entries. An entry is a value under a kind (``sample``) and a key (``auv_1/17``).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Protocol, TypeVar

import msgspec

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

T = TypeVar('T')


class StoreError(Exception):
    """What is stored cannot be read, or what is to be stored cannot be written."""


class Store(Protocol):
    """
    Entries that outlive the process.

    Puts and drops are collected, and `commit` stores them all or, should the process die
    meanwhile, none. A later one for the same entry replaces an earlier one. Nothing lasts before
    `commit` has returned.
    """

    @property
    def is_changed(self) -> bool:
        """Return whether there is something to commit."""

    def load(self, kind: str, value_type: type[T]) -> dict[str, T]:
        """
        Return the committed values of a kind by key, in the order of their keys.

        Raises
        ------
        StoreError
            They cannot be read, or one is not of this type.

        """

    def put(self, kind: str, key: str, value: object) -> None:
        """
        Set the value of an entry at the next commit, as the value is now.

        Parameters
        ----------
        kind, key
            Name the entry.
        value
            A msgspec Struct, a dataclass or a builtin, such as msgspec encodes.

        """

    def drop(self, kind: str, key: str) -> None:
        """Remove an entry at the next commit; one that is not there may be dropped."""

    def commit(self) -> None:
        """
        Store all that was put and dropped since the last commit, in one piece.

        Raises
        ------
        StoreError
            This failed. The next commit tries again, with what has come since.

        """

    def close(self) -> None:
        """Give the store back; what is not committed is lost."""


class BufferedStore(ABC):
    """What stores have in common: values become bytes at once, and changes wait for a commit."""

    def __init__(self) -> None:
        self._changes: dict[tuple[str, str], bytes | None] = {}
        """The encoded value by kind and key; None removes the entry."""
        self._encode = msgspec.msgpack.Encoder().encode

    @property
    def is_changed(self) -> bool:
        """Return whether there is something to commit."""
        return bool(self._changes)

    def load(self, kind: str, value_type: type[T]) -> dict[str, T]:
        """Return the committed values of a kind by key, in the order of their keys."""
        decoder = msgspec.msgpack.Decoder(value_type)
        values = {}
        for key, data in self._read(kind):
            try:
                values[key] = decoder.decode(data)
            except msgspec.DecodeError as error:
                raise StoreError(
                    f'{self}: {kind} {key!r} is no {value_type.__name__}: {error}'
                ) from error
        return values

    def put(self, kind: str, key: str, value: object) -> None:
        """Set the value of an entry at the next commit, as the value is now."""
        self._changes[kind, key] = self._encode(value)

    def drop(self, kind: str, key: str) -> None:
        """Remove an entry at the next commit; one that is not there may be dropped."""
        self._changes[kind, key] = None

    def commit(self) -> None:
        """Store all that was put and dropped since the last commit, in one piece."""
        if self._changes:
            self._write(self._changes)
            self._changes = {}

    @abstractmethod
    def close(self) -> None:
        """Give the store back; what is not committed is lost."""

    @abstractmethod
    def _read(self, kind: str) -> Iterable[tuple[str, bytes]]:
        """Return the keys of a kind and their encoded values, in the order of the keys."""

    @abstractmethod
    def _write(self, changes: Mapping[tuple[str, str], bytes | None]) -> None:
        """Store all the changes, or none and raise `StoreError`."""


class MemoryStore(BufferedStore):
    """A store in memory: it outlives its agent, not its process."""

    def __init__(self) -> None:
        super().__init__()
        self._entries: dict[tuple[str, str], bytes] = {}
        self._is_open = True

    def __str__(self) -> str:
        return 'store in memory'

    def reopened(self) -> MemoryStore:
        """Return what a new process would find, and close this store, as its death would."""
        store = MemoryStore()
        store._entries = self._entries
        self.close()
        return store

    def close(self) -> None:
        """Give the store back; what is not committed is lost."""
        self._changes = {}
        self._is_open = False

    def _read(self, kind: str) -> Iterable[tuple[str, bytes]]:
        return sorted((key, data) for (of, key), data in self._entries.items() if of == kind)

    def _write(self, changes: Mapping[tuple[str, str], bytes | None]) -> None:
        if not self._is_open:
            raise StoreError(f'{self}: is closed')
        for entry, data in changes.items():
            if data is None:
                self._entries.pop(entry, None)
            else:
                self._entries[entry] = data
