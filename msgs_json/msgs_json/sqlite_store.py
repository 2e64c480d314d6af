"""
A store in an SQLite file: what was committed is there after SIGKILL and after a power cut.

Two settings make it so. With ``journal_mode=WAL`` a commit is one append to the file's write-ahead
log, which a torn end of does not harm. With ``synchronous=FULL`` a commit waits until that is on
the disk. (See sqlite.org/wal.html and sqlite.org/pragma.html.)
"""

from __future__ import annotations

import contextlib
import sqlite3
from typing import TYPE_CHECKING

from msgs_json.store import BufferedStore, StoreError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping
    from pathlib import Path

FORMAT_VERSION = 1
"""Of the file; any change of its tables makes a new one."""

_BUSY_S = 0.5
"""A process that was just killed is gone by then."""

_PAGE_BYTES = 4096
_WAL_PAGES = 1000
"""
The log goes into the file at this length, SQLite's default, and is then written from its start.
"""

_IS_DAMAGED = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)


class SqliteStore(BufferedStore):
    """
    A store in a file of its own, which one process at a time has open.

    Parameters
    ----------
    path
        The file, made if there is none, in a folder that is there. Beside it SQLite keeps its log
        under the same name with ``-wal``; the two belong together.
    identity
        Whose memory this is, such as mission and agent; nobody else may open it.

    Raises
    ------
    StoreError
        The file is in use, damaged, somebody else's, of another version, or no store at all. It
        is left as it was.

    """

    def __init__(self, path: Path, *, identity: str) -> None:
        super().__init__()
        self._path = path
        with self._named_errors():
            # Without isolation level the module begins no transactions of its own.
            self._connection = sqlite3.connect(path, timeout=_BUSY_S, isolation_level=None)
        try:
            with self._named_errors():
                self._open(identity)
        except StoreError:
            self._connection.close()
            raise

    def __str__(self) -> str:
        return f'store {self._path}'

    def close(self) -> None:
        """Give the store back; what is not committed is lost."""
        self._changes = {}
        self._connection.close()

    def _open(self, identity: str) -> None:
        execute = self._connection.execute
        # The lock lasts until the process closes the file or dies. Set before the log is touched,
        # it also does without the memory that processes would share.
        execute('PRAGMA locking_mode = EXCLUSIVE')
        tables = {name for (name,) in execute('SELECT name FROM sqlite_schema')}
        if tables and 'store' not in tables:
            raise StoreError(
                f'{self}: is an SQLite file of something else, with {", ".join(sorted(tables))};'
                ' give another path'
            )
        execute('PRAGMA journal_mode = WAL')
        execute('PRAGMA synchronous = FULL')
        execute(f'PRAGMA wal_autocheckpoint = {_WAL_PAGES}')
        execute(f'PRAGMA journal_size_limit = {_WAL_PAGES * _PAGE_BYTES}')
        with self._transaction():
            if tables:
                self._check(identity)
            else:
                self._create(identity)

    def _create(self, identity: str) -> None:
        execute = self._connection.execute
        execute('CREATE TABLE store (version INTEGER NOT NULL, identity TEXT NOT NULL)')
        execute('INSERT INTO store VALUES (?, ?)', (FORMAT_VERSION, identity))
        execute(
            'CREATE TABLE entries (kind TEXT NOT NULL, key TEXT NOT NULL, value BLOB NOT NULL,'
            ' PRIMARY KEY (kind, key)) WITHOUT ROWID'
        )

    def _check(self, identity: str) -> None:
        execute = self._connection.execute
        (found,) = execute('PRAGMA quick_check(1)').fetchone()
        if found != 'ok':
            raise self._damaged(' '.join(found.split()))
        (version,) = execute('SELECT version FROM store').fetchone()
        if version != FORMAT_VERSION:
            raise StoreError(
                f'{self}: has format version {version}, this release reads {FORMAT_VERSION};'
                ' use the release that wrote it, or another path'
            )
        (owner,) = execute('SELECT identity FROM store').fetchone()
        if owner != identity:
            raise StoreError(
                f'{self}: is the memory of {owner!r}, not of {identity!r}; give another path'
            )

    def _read(self, kind: str) -> Iterable[tuple[str, bytes]]:
        with self._named_errors():
            return self._connection.execute(
                'SELECT key, value FROM entries WHERE kind = ? ORDER BY key', (kind,)
            ).fetchall()

    def _write(self, changes: Mapping[tuple[str, str], bytes | None]) -> None:
        put = [(*entry, data) for entry, data in changes.items() if data is not None]
        dropped = [entry for entry, data in changes.items() if data is None]
        with self._named_errors(), self._transaction():
            self._connection.executemany('REPLACE INTO entries VALUES (?, ?, ?)', put)
            self._connection.executemany('DELETE FROM entries WHERE kind = ? AND key = ?', dropped)

    @contextlib.contextmanager
    def _transaction(self) -> Iterator[None]:
        """Commit at the end, or roll back, if either fails."""
        with self._connection:
            self._connection.execute('BEGIN IMMEDIATE')
            yield

    @contextlib.contextmanager
    def _named_errors(self) -> Iterator[None]:
        """Turn SQLite's errors into ones that name the file and say what to do."""
        try:
            yield
        except sqlite3.Error as error:
            # The low byte: what comes above it are details.
            code = getattr(error, 'sqlite_errorcode', sqlite3.SQLITE_ERROR) & 0xFF
            if code in _IS_DAMAGED:
                raise self._damaged(str(error)) from error
            if code == sqlite3.SQLITE_BUSY:
                raise StoreError(f'{self}: is in use by another process; end that one') from error
            raise StoreError(f'{self}: {error}') from error

    def _damaged(self, detail: str) -> StoreError:
        return StoreError(
            f'{self}: is damaged or no store ({detail}); to go on without what it holds, move it'
            f' and {self._path.name}-wal away'
        )
