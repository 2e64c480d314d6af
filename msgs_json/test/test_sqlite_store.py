from __future__ import annotations

import random
import shutil
import sqlite3
import subprocess
import sys
from pathlib import Path

import pytest

from msgs_json.sqlite_store import SqliteStore
from msgs_json.store import StoreError

KILLED_WRITERS = Path(__file__).with_name('killed_writers.py')

ON_A_FULL_DISK = """
import resource, sys
from pathlib import Path
from msgs_json.sqlite_store import SqliteStore
from msgs_json.store import StoreError

path = Path(sys.argv[1])
store = SqliteStore(path, identity='test')
store.put('number', '0', b'')
store.commit()
roomy = resource.getrlimit(resource.RLIMIT_FSIZE)
resource.setrlimit(resource.RLIMIT_FSIZE, (400_000, roomy[1]))
failed = 0
for number in range(1, 100):
    store.put('number', str(number), bytes(1000))
    store.drop('number', str(number - 90))
    try:
        store.commit()
    except StoreError as error:
        failed += 1
        assert str(path) in str(error), error
        assert store.is_changed
assert 10 < failed < 90, failed
held = set(store.load('number', bytes))
assert '99' not in held, held
resource.setrlimit(resource.RLIMIT_FSIZE, roomy)
store.commit()
assert not store.is_changed
store.close()
store = SqliteStore(path, identity='test')
assert set(store.load('number', bytes)) == {str(number) for number in range(10, 100)}
"""
"""The limit makes writing fail as a full disk does. Python ignores the signal that comes too."""

OPEN = """
import sys
from pathlib import Path
from msgs_json.sqlite_store import SqliteStore
SqliteStore(Path(sys.argv[1]), identity='test')
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / 'auv_1.db'


def stored(path: Path, **entries: int) -> None:
    """Make a store of these numbers, and close it."""
    store = SqliteStore(path, identity='test')
    for key, value in entries.items():
        store.put('number', key, value)
    store.commit()
    store.close()


def run(code: str, path: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, '-c', code, str(path)], capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize('kills', [20, pytest.param(400, marks=pytest.mark.slow)])
def test_what_was_committed_survives_sigkill_whole(path: Path, kills: int) -> None:
    writers = subprocess.run(
        [sys.executable, KILLED_WRITERS, path, str(kills)],
        capture_output=True,
        text=True,
        check=False,
    )

    assert writers.returncode == 0, writers.stderr
    # Most writers live long enough to commit, or nothing was tested.
    assert int(writers.stdout) > kills


def test_a_torn_log_holds_whole_commits_up_to_where_it_is_torn(path: Path, tmp_path: Path) -> None:
    store = SqliteStore(path, identity='test')
    for number in range(20):
        store.put('number', 'left', number)
        store.put('text', str(number), 'x' * 300 * number)
        store.put('number', 'right', number)
        store.commit()
    image = tmp_path / 'image'
    shutil.copy(path, image)
    log = Path(f'{path}-wal').read_bytes()
    store.close()

    rng = random.Random(5)
    found = set()
    # Below the first 30,000 bytes the store itself was being made.
    for length in sorted(rng.sample(range(30_000, len(log)), 60)):
        torn = tmp_path / f'torn_{length}'
        shutil.copy(image, torn)
        garbage = rng.randbytes(min(5000, len(log) - length))
        Path(f'{torn}-wal').write_bytes(log[:length] + garbage)
        store = SqliteStore(torn, identity='test')
        numbers = store.load('number', int)
        texts = store.load('text', str)
        store.close()
        assert set(numbers) == {'left', 'right'}
        assert numbers['left'] == numbers['right'] >= max(found, default=0)
        assert set(texts) == {str(number) for number in range(numbers['left'] + 1)}
        found.add(numbers['left'])
    assert len(found) > 10


def test_commits_wait_for_the_disk(path: Path) -> None:
    store = SqliteStore(path, identity='test')

    assert store._connection.execute('PRAGMA journal_mode').fetchone() == ('wal',)
    assert store._connection.execute('PRAGMA synchronous').fetchone() == (2,)  # FULL
    store.close()


def test_a_commit_that_fails_half_way_is_undone_and_tried_again(path: Path) -> None:
    store = SqliteStore(path, identity='test')
    store._connection.execute(
        "CREATE TEMP TRIGGER refuse BEFORE INSERT ON main.entries WHEN NEW.key = 'bad'"
        " BEGIN SELECT RAISE(ABORT, 'told to fail'); END"
    )
    store.put('number', 'good', 1)
    store.put('number', 'bad', 2)

    for _ in range(2):
        with pytest.raises(StoreError, match=r'auv_1\.db: told to fail'):
            store.commit()
        assert store.load('number', int) == {}
    store._connection.execute('DROP TRIGGER refuse')
    store.put('number', 'later', 3)
    store.commit()
    assert store.load('number', int) == {'bad': 2, 'good': 1, 'later': 3}
    store.close()


def test_a_full_disk_loses_nothing(path: Path) -> None:
    writer = run(ON_A_FULL_DISK, path)

    assert writer.returncode == 0, writer.stderr


def test_files_stay_small_while_entries_come_and_go(path: Path) -> None:
    store = SqliteStore(path, identity='test')
    store._connection.execute('PRAGMA synchronous = OFF')  # for speed
    sizes = []
    for number in range(4000):
        store.put('sample', str(number), bytes(200))
        store.drop('sample', str(number - 50))
        store.put('state', 'seq', number)
        store.commit()
        sizes.append(path.stat().st_size)

    assert sizes[-1] == sizes[len(sizes) // 2]
    assert sizes[-1] < 50 * 200 * 4
    assert Path(f'{path}-wal').stat().st_size < 5e6
    store.close()
    assert [each.name for each in path.parent.iterdir()] == [path.name]


def test_a_writer_that_died_before_it_wrote_anything_left_an_empty_file(path: Path) -> None:
    path.touch()
    stored(path, one=1)

    store = SqliteStore(path, identity='test')
    assert store.load('number', int) == {'one': 1}
    store.close()


def test_one_store_is_open_once(path: Path) -> None:
    store = SqliteStore(path, identity='test')

    with pytest.raises(StoreError, match=r'auv_1\.db: is in use by another process'):
        SqliteStore(path, identity='test')
    other = run(OPEN, path)
    assert f'store {path}: is in use by another process' in other.stderr
    store.put('number', 'one', 1)
    store.commit()
    store.close()

    assert run(OPEN, path).returncode == 0


def test_somebody_elses_memory_is_refused(path: Path) -> None:
    stored(path, one=1)

    with pytest.raises(StoreError, match=r"auv_1\.db: is the memory of 'test', not of 'other'"):
        SqliteStore(path, identity='other')
    stored(path, two=2)


def test_another_version_is_refused(path: Path) -> None:
    stored(path, one=1)
    with sqlite3.connect(path) as connection:
        connection.execute('UPDATE store SET version = 2')
    connection.close()

    with pytest.raises(StoreError, match=r'auv_1\.db: has format version 2, this release reads 1'):
        SqliteStore(path, identity='test')


def test_another_programs_database_is_refused_and_left_as_it_is(path: Path) -> None:
    with sqlite3.connect(path) as connection:
        connection.execute('CREATE TABLE messages (number INTEGER)')
    connection.close()
    before = path.read_bytes()

    with pytest.raises(
        StoreError, match=r'auv_1\.db: is an SQLite file of something else, with m'
    ):
        SqliteStore(path, identity='test')
    assert path.read_bytes() == before


def test_a_damaged_file_is_refused_and_the_error_says_what_to_do(path: Path) -> None:
    stored(path, **{f'n{number}': number for number in range(1000)})
    whole = path.read_bytes()
    rng = random.Random(5)
    for damaged in (
        rng.randbytes(10_000),
        b'not a store',
        whole[: len(whole) // 2],
        whole[:100],
        whole[:4096] + bytes(len(whole) - 4096),
        whole[:-4096] + rng.randbytes(4096),
    ):
        path.write_bytes(damaged)
        with pytest.raises(StoreError, match=r'auv_1\.db: is damaged .*move it and auv_1\.db-wal'):
            SqliteStore(path, identity='test')


def test_a_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match=r'gone/auv_1\.db: unable to open database file'):
        SqliteStore(tmp_path / 'gone' / 'auv_1.db', identity='test')
