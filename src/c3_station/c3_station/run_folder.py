"""The folder of one run, and what is in it."""

from __future__ import annotations

import shutil
from datetime import UTC, datetime
from pathlib import Path

from c3_station.scenario import Scenario
from msgs_json.key_file import new_key, read_key, write_key

_RUNS = Path('runs')
SCENARIO = 'scenario.json'
"""Is in every run folder; `--force` replaces no folder without it."""


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
        self.scenario = path / SCENARIO
        self.summary = path / 'summary.json'
        self.report = path / 'report.html'


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
