from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import hypothesis.strategies as st
import msgspec
import pytest
from hypothesis import given, settings

from msgs_json.sqlite_store import SqliteStore
from msgs_json.store import MemoryStore, Store, StoreError

KINDS = ('sample', 'seen')


class Fix(msgspec.Struct, frozen=True):
    depth_m: float
    cell: tuple[int, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class Leg:
    number: int
    fixes: tuple[Fix, ...]
    note: str | None = None


@dataclass(frozen=True)
class Put:
    kind: str
    key: str
    value: list[int]


@dataclass(frozen=True)
class Drop:
    kind: str
    key: str


@dataclass(frozen=True)
class Commit:
    pass


@dataclass(frozen=True)
class Crash:
    pass


kinds = st.sampled_from(KINDS)
keys = st.sampled_from(['', 'auv_1/9', 'auv_1/10', 'Ü', '\U0001f40b', 'a\0b', "'; --"])
operations = st.lists(
    st.one_of(
        st.builds(Put, kinds, keys, st.lists(st.integers(-(2**63), 2**64 - 1), max_size=2)),
        st.builds(Drop, kinds, keys),
        st.just(Commit()),
        st.just(Crash()),
    ),
    max_size=30,
)


def crashed(store: SqliteStore, folder: Path) -> SqliteStore:
    """Return a store of the files as they are now, while the old one has them open."""
    old = store._path
    new = folder / f'{old.name}+'
    for suffix in ('', '-wal'):
        shutil.copy(folder / f'{old.name}{suffix}', folder / f'{new.name}{suffix}')
    store.close()
    return SqliteStore(new, identity='test')


def check(store: Store, crash: Callable[[Store], Store], operations: list[object]) -> None:
    committed: dict[tuple[str, str], list[int]] = {}
    changed = dict(committed)
    for operation in operations:
        match operation:
            case Put(kind, key, value):
                store.put(kind, key, value)
                changed[kind, key] = list(value)
                value.append(0)  # the store has the value as it was
            case Drop(kind, key):
                store.drop(kind, key)
                changed.pop((kind, key), None)
            case Commit():
                store.commit()
                assert not store.is_changed
                committed = dict(changed)
            case Crash():
                store = crash(store)
                assert not store.is_changed
                changed = dict(committed)
        if changed != committed:
            assert store.is_changed
        for kind in KINDS:
            expected = [
                (key, value) for (of, key), value in sorted(committed.items()) if of == kind
            ]
            assert list(store.load(kind, list[int]).items()) == expected
    store.close()


@given(operations)
def test_memory_holds_what_was_committed(operations: list[object]) -> None:
    check(MemoryStore(), lambda store: store.reopened(), operations)


@given(operations)
@settings(max_examples=25)  # each commit waits for the disk
def test_a_file_holds_what_was_committed(operations: list[object]) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        store = SqliteStore(folder / 'store', identity='test')
        check(store, lambda store: crashed(store, folder), operations)


@pytest.fixture(params=['memory', 'file'])
def store(request: pytest.FixtureRequest, tmp_path: Path) -> Store:
    if request.param == 'memory':
        return MemoryStore()
    return SqliteStore(tmp_path / 'store', identity='test')


def test_values_come_back_as_they_were(store: Store) -> None:
    leg = Leg(number=2**40, fixes=(Fix(depth_m=0.1 + 0.2, cell=(3, 4)),))
    store.put('leg', 'auv_1', leg)
    store.put('blob', 'driver', b'\0\xff')
    store.commit()

    assert store.load('leg', Leg) == {'auv_1': leg}
    assert store.load('blob', bytes) == {'driver': b'\0\xff'}
    store.close()


def test_values_come_in_the_order_of_their_keys(store: Store) -> None:
    keys = ['b', '\U0001f40b', 'a/9', '\uffee', 'a/10', '']
    for key in keys:
        store.put('leg', key, 0)
    store.commit()

    assert list(store.load('leg', int)) == sorted(keys)
    store.close()


def test_a_value_of_another_type_is_an_error_that_names_it(store: Store) -> None:
    store.put('leg', 'auv_1', 'not a leg')
    store.commit()

    with pytest.raises(StoreError, match=r"store .*: leg 'auv_1' is no Leg: Expected `object`"):
        store.load('leg', Leg)
    store.close()


def test_a_value_that_cannot_be_encoded_changes_nothing(store: Store) -> None:
    with pytest.raises(TypeError):
        store.put('leg', 'auv_1', object())

    assert not store.is_changed
    store.close()


def test_a_closed_store_stores_nothing_more(store: Store) -> None:
    store.put('leg', 'auv_1', 1)
    store.close()
    assert not store.is_changed
    store.put('leg', 'auv_1', 2)

    with pytest.raises(StoreError, match=r'closed'):
        store.commit()


def test_an_agent_that_lives_on_after_its_crash_cannot_write() -> None:
    old = MemoryStore()
    new = old.reopened()
    old.put('leg', 'auv_1', 1)

    with pytest.raises(StoreError, match=r'store in memory: is closed'):
        old.commit()
    assert new.load('leg', int) == {}
