"""
What a campaign has flown so far: one SQLite file, written as results come.

Who wants more than the report shows asks the file, for example
``select planner, avg(explored_s) from mission_of_case group by planner``. Times are seconds.
"""

from __future__ import annotations

import fcntl
import os
import sqlite3
from contextlib import closing, contextmanager
from typing import TYPE_CHECKING, Self

import msgspec

from c3_station.campaign_mission import MissionResult
from c3_station.campaign_plan import Campaign

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

STORE = 'campaign.sqlite'

_LAYOUT = 2
"""Number of the tables below; it is raised with every change of them."""

_TABLES = """
create table campaign (definition text not null);  -- JSON of campaign_plan.Campaign

create table cases (
    id integer primary key,  -- from 0
    scenario text not null,
    variation text not null,
    planner text not null
);

create table missions (
    number integer primary key,  -- from 1
    case_id integer not null references cases,
    seed integer not null,
    exit text not null,  -- complete, stopped or error
    reason text,
    explored_s real,
    delivered_s real,
    mission_s real,
    lower_bound_s real,
    neglect_fraction real,
    c3_wait_s real,
    data_age_max_s real,
    sorties_total integer not null,
    violations integer not null,  -- sorties over their limit
    longest_sortie_s real,
    bound_ratio_max real,  -- largest realised sortie time over its worst case
    missed integer not null,  -- searches in vain of AUVs that were on their path
    searches_broken_off integer not null,
    auvs_lost integer not null,
    samples_collected integer not null,
    samples_delivered integer not null,
    samples_lost integer,  -- of AUVs that are not lost
    samples_doubled integer,  -- that C3 counts more than once
    restarts integer not null,  -- of nodes
    forged integer not null,  -- hostile messages
    obeyed integer not null,  -- those of them that were not refused
    refused integer not null,  -- all messages refused; counted in missions with faults
    moves_total integer not null,
    revisits integer not null,
    sortie_times text not null,  -- JSON: [duration, worst case, limit] of each sortie
    wall_s real not null
);

create view mission_of_case as select * from missions join cases on cases.id = case_id;
"""

_FIELDS = MissionResult.__struct_fields__
_ADD = (
    f'insert into missions (case_id, seed, {", ".join(_FIELDS)})'
    f' values (:case_id, :seed, {", ".join(f":{field}" for field in _FIELDS)})'
)


class CampaignStore:
    """The results of one campaign; others may read them while they are written."""

    def __init__(self, folder: Path) -> None:
        """
        Open the store in a folder.

        Raises
        ------
        ValueError
            There is none, or it cannot be read.

        """
        self.folder = folder
        self.path = folder / STORE
        if not self.path.is_file():
            raise ValueError(f'{folder}: holds no campaign (there is no {STORE})')
        with self._plain_errors():
            self._database = sqlite3.connect(self.path)
            (layout,) = self._database.execute('pragma user_version').fetchone()
            if layout != _LAYOUT:
                raise ValueError(
                    f'{self.path}: was written by another version of Shearwater'
                    f' (its layout is {layout}; allowed: {_LAYOUT})'
                )
            (definition,) = self._database.execute('select definition from campaign').fetchone()
        self.campaign = msgspec.json.decode(definition, type=Campaign)

    def add(self, results: Iterable[MissionResult]) -> None:
        """Store results; once this returns, they survive the death of this process."""
        rows = [self._row(result) for result in results]
        with self._plain_errors(), self._database:
            self._database.executemany(_ADD, rows)

    def results(self) -> list[MissionResult]:
        """Return all results so far, by number."""
        with self._plain_errors():
            rows = self._database.execute(
                f'select {", ".join(_FIELDS)} from missions order by number'
            ).fetchall()
        return [_result(row) for row in rows]

    def missing(self) -> list[int]:
        """Return the numbers of the missions that are still to be flown."""
        with self._plain_errors():
            flown = {number for (number,) in self._database.execute('select number from missions')}
        return [
            number for number in range(1, self.campaign.missions_total + 1) if number not in flown
        ]

    def close(self) -> None:
        """Close the file."""
        self._database.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *failure: object) -> None:
        self.close()

    def _row(self, result: MissionResult) -> dict[str, object]:
        case, seed = self.campaign.place(result.number)
        return msgspec.structs.asdict(result) | {
            'case_id': case,
            'seed': seed,
            'exit': result.exit.value,
            'sortie_times': msgspec.json.encode(result.sortie_times).decode(),
        }

    @contextmanager
    def _plain_errors(self) -> Iterator[None]:
        with _plain_errors(self.path):
            yield


def make_store(folder: Path, campaign: Campaign) -> None:
    """
    Make the store of a new campaign in an empty folder.

    Raises
    ------
    ValueError
        Something else is in the folder, or nothing can be written there.

    """
    # Under its name only once it is complete: one that was killed meanwhile leaves no store.
    unfinished = folder / f'{STORE}.new'
    for path in folder.iterdir():
        if not path.name.startswith(unfinished.name):
            raise ValueError(f'{folder}: holds something else than a campaign; name another')
    for path in folder.iterdir():
        path.unlink()
    with _plain_errors(unfinished), closing(sqlite3.connect(unfinished)) as database:
        # With a write-ahead log those who read are not in the way of the one who writes.
        database.execute('pragma journal_mode = wal')
        database.executescript(_TABLES)
        with database:
            database.execute(
                'insert into campaign values (?)', [msgspec.json.encode(campaign).decode()]
            )
            database.executemany(
                'insert into cases values (?, ?, ?, ?)',
                [
                    (index, case.scenario, case.variation, case.planner)
                    for index, case in enumerate(campaign.cases)
                ],
            )
        database.execute(f'pragma user_version = {_LAYOUT}')
    unfinished.rename(folder / STORE)


def _result(row: tuple[object, ...]) -> MissionResult:
    fields = dict(zip(_FIELDS, row, strict=True))
    fields['sortie_times'] = msgspec.json.decode(str(fields['sortie_times']))
    return msgspec.convert(fields, MissionResult)


@contextmanager
def sole_writer(folder: Path) -> Iterator[None]:
    """
    Keep a folder to this process while it flies a campaign into it.

    Raises
    ------
    ValueError
        Another process flies there.

    """
    lock = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise ValueError(f'{folder}: another process is flying a campaign there') from None
        yield
    finally:
        os.close(lock)


@contextmanager
def _plain_errors(path: Path) -> Iterator[None]:
    try:
        yield
    except sqlite3.Error as error:
        raise ValueError(f'{path}: {error}') from None
