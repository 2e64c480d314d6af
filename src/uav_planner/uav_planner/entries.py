"""What is kept in a store entry by entry, so that a commit writes what has changed and no more."""

from __future__ import annotations

from collections.abc import ItemsView, Iterable, Iterator, KeysView, Mapping, MutableMapping
from typing import TYPE_CHECKING, Any, Generic, TypeVar

if TYPE_CHECKING:
    from msgs_json.store import Store

T = TypeVar('T')


class Entry(Generic[T]):
    """
    A value that is stored as a whole; it is changed by setting another one.

    Parameters
    ----------
    kind
        Names the entry in the store.
    value
        What it is before anything was stored; it is stored, too.

    """

    def __init__(self, kind: str, value: T) -> None:
        self._kind = kind
        self._value = value
        self.is_changed = True
        """Whether it is another value than the one that was put last."""

    @property
    def value(self) -> T:
        """Return the value; nobody changes it in place."""
        return self._value

    @value.setter
    def value(self, value: T) -> None:
        if value != self._value:
            self._value, self.is_changed = value, True

    def load(self, store: Store, value_type: type[T]) -> None:
        """Take the value that is stored, if there is one."""
        stored = store.load(self._kind, value_type)
        if stored:
            self._value, self.is_changed = stored[''], False

    def save(self, store: Store) -> None:
        """Put the value."""
        self.is_changed = False
        store.put(self._kind, '', self._value)


class Entries(MutableMapping[str, T]):
    """
    Values by key, each stored for itself; one is changed by setting another one.

    One that stays the same is not stored again.

    Parameters
    ----------
    kind
        Of the entries of the store; the keys are theirs, too.

    """

    def __init__(self, kind: str) -> None:
        self._kind = kind
        self._values: dict[str, T] = {}
        self._changed: dict[str, None] = {}
        self.is_changed = False
        """Whether anything was set, or removed, since it was put last."""

    def load(self, store: Store, value_type: type[T]) -> None:
        """Take the values that are stored, in the order of their keys."""
        self._values, self._changed = store.load(self._kind, value_type), {}
        self.is_changed = False

    def save(self, store: Store) -> None:
        """Put the values that were set since the last time, drop the others."""
        for key in self._changed:
            if key in self._values:
                store.put(self._kind, key, self._values[key])
            else:
                store.drop(self._kind, key)
        self._changed, self.is_changed = {}, False

    def become(self, values: Mapping[str, T]) -> None:
        """Hold these values and no others."""
        for key in self._values.keys() - values.keys():
            del self[key]
        self.update(values)

    def __getitem__(self, key: str) -> T:
        return self._values[key]

    def __setitem__(self, key: str, value: T) -> None:
        if key not in self._values or self._values[key] != value:
            self._values[key] = value
            self._note(key)

    def __delitem__(self, key: str) -> None:
        del self._values[key]
        self._note(key)

    def _note(self, key: str) -> None:
        self._changed[key] = None
        self.is_changed = True

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    # Asked at every tick; those of the base class take ten times as long.

    def __contains__(self, key: object) -> bool:
        return key in self._values

    def keys(self) -> KeysView[str]:
        """Return the keys."""
        return self._values.keys()

    def items(self) -> ItemsView[str, T]:
        """Return keys and values."""
        return self._values.items()


def save_changed(store: Store, kept: Iterable[Entry[Any] | Entries[Any]]) -> None:
    """Put what has changed since the last time."""
    for each in kept:
        if each.is_changed:
            each.save(store)
