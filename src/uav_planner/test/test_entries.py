"""What is kept entry by entry comes back as it was, and is stored only where it has changed."""

from __future__ import annotations

from collections.abc import Mapping

import hypothesis.strategies as st
from hypothesis import given

from msgs_json.store import MemoryStore
from uav_planner.entries import Entries, Entry, save_changed


class Watched(MemoryStore):
    """Says which entries a commit has changed."""

    def __init__(self) -> None:
        super().__init__()
        self.written: list[tuple[str, str]] = []

    def _write(self, changes: Mapping[tuple[str, str], bytes | None]) -> None:
        super()._write(changes)
        self.written = sorted(changes)


steps = st.one_of(
    st.tuples(st.sampled_from('abc'), st.integers(0, 2)),
    st.sampled_from('abc'),
    st.dictionaries(st.sampled_from('abc'), st.integers(0, 2)),
    st.just(None),
)


@given(st.lists(steps))
def test_what_was_saved_comes_back(
    inputs: list[tuple[str, int] | str | dict[str, int] | None],
) -> None:
    store = Watched()
    entries: Entries[int] = Entries('some')
    model: dict[str, int] = {}
    for step in [*inputs, None]:
        match step:
            case (key, value):
                entries[key] = model[key] = value
            case str(key):
                entries.pop(key, None)
                model.pop(key, None)
            case dict(values):
                entries.become(values)
                model = dict(values)
            case None:
                entries.save(store)
                store.commit()
        assert dict(entries) == model
    again: Entries[int] = Entries('some')
    again.load(store, int)
    assert dict(again) == model


def test_only_what_has_changed_is_stored() -> None:
    store = Watched()
    entries: Entries[int] = Entries('some')
    entries.become({'a': 1, 'b': 2, 'c': 3})
    save_changed(store, [entries])
    store.commit()
    save_changed(store, [entries])
    assert not store.is_changed
    entries.become({'a': 1, 'b': 5})
    save_changed(store, [entries])
    store.commit()
    assert store.written == [('some', 'b'), ('some', 'c')]


def test_a_single_entry_is_stored_when_it_is_another() -> None:
    store = Watched()
    entry = Entry('one', (1, 2))
    save_changed(store, [entry])
    store.commit()
    entry.value = (1, 2)
    save_changed(store, [entry])
    assert not store.is_changed
    entry.value = (3, 4)
    save_changed(store, [entry])
    store.commit()
    again = Entry('one', (0, 0))
    again.load(store, tuple[int, int])
    assert again.value == (3, 4)
    save_changed(store, [again])
    assert not store.is_changed


def test_an_entry_that_is_not_stored_is_what_it_was_made_with() -> None:
    entry = Entry('one', 7)
    entry.load(MemoryStore(), int)
    assert entry.value == 7
