"""The folder of one run, and what is in it."""

from __future__ import annotations

import fcntl
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from threading import Event as Pause
from time import monotonic
from typing import IO

import msgspec

from c3_station.scenario import Scenario
from msgs_json.key_file import new_key, read_key, write_key

_RUNS = Path('runs')
SCENARIO = 'scenario.json'
"""Is in every run folder; `--force` replaces no folder without it."""


_ENDING_S = 10.0
"""Nodes whose orchestrator was killed end within this time."""
_LOOK_AGAIN_S = 0.1


class Way(msgspec.Struct, frozen=True, kw_only=True):
    """How a mission is flown, for whoever resumes it."""

    rate: float
    """Times real time; 0 as fast as possible."""
    ros: bool
    bag: bool


class RunFolder:
    """The files of a run; see docs/architecture.md."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.bag = path / 'bag'
        self.logs = path / 'logs'
        self.params = path / 'params.yaml'
        self.key = path / 'key'
        self.stores = path / 'stores'
        self.domain = path / 'domain'
        self.lock = path / 'lock'
        self.way = path / 'run.json'
        self.scenario = path / SCENARIO
        self.summary = path / 'summary.json'
        self.report = path / 'report.html'
        self.lock_files: tuple[int, ...] = ()
        """The open file that holds the lock, for processes that are to hold it, too."""

    @contextmanager
    def held(self) -> Iterator[None]:
        """
        Hold the folder, until this process and all its nodes have ended.

        Raises
        ------
        ValueError
            Somebody else holds it.

        """
        with self.lock.open('w') as file:
            give_up_s = monotonic() + _ENDING_S
            while not _locked(file):
                if monotonic() > give_up_s:
                    raise ValueError(f'{self.path}: its mission is still flown')
                Pause().wait(_LOOK_AGAIN_S)
            self.lock_files = (file.fileno(),)
            try:
                yield
            finally:
                self.lock_files = ()


def _locked(file: IO[str]) -> bool:
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def new_run_folder(
    out: Path | None, scenario: Scenario, *, force: bool, key_file: Path | None = None
) -> RunFolder:
    """
    Make the folder of a run, with the key of its mission: a new one, or that of a file.

    Raises
    ------
    ValueError
        It exists and may not be replaced, or cannot be made; or the key is not usable.

    """
    key = read_key(str(key_file)) if key_file is not None else new_key()
    if out is None:
        # Local time: a person looks for "the run of this morning".
        now = datetime.now(UTC).astimezone()
        out = _RUNS / f'{scenario.name}-{now:%Y%m%d-%H%M%S-%f}'
    if out.exists():
        if not force:
            raise ValueError(f'--out {out}: exists already; name another, or add --force')
        if not (out / SCENARIO).is_file() and any(out.iterdir()):
            raise ValueError(
                f'--out {out}: is not the folder of a run, so --force leaves it alone'
            )
        shutil.rmtree(out)
    folder = RunFolder(out)
    try:
        folder.logs.mkdir(parents=True)
        folder.stores.mkdir()
        write_key(folder.key, key)
    except OSError as error:
        raise ValueError(f'--out {out}: cannot be made, {error.strerror}') from None
    return folder
