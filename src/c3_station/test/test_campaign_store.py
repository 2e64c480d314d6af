"""The store of a campaign: what comes back, what survives, what is refused."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

import msgspec
import pytest
from campaign_samples import sample_campaign, sample_result, sample_results

from c3_station.campaign_mission import MissionExit, MissionResult, SortieTimes
from c3_station.campaign_store import (
    STORE,
    CampaignStore,
    make_store,
    sole_writer,
)

UNFINISHED = f'{STORE}.new'
CAMPAIGN = sample_campaign('surfacing=slow,mixed', seeds=3)


def made(folder: Path) -> CampaignStore:
    make_store(folder, CAMPAIGN)
    return CampaignStore(folder)


def test_results_come_back_as_they_were_by_number(tmp_path: Path) -> None:
    results = sample_results(CAMPAIGN)
    results[3] = sample_result(
        4,
        exit=MissionExit.ERROR,
        reason="ValueError: it's \N{SNOWMAN} (plan, line 3)",
        explored_s=None,
        samples_lost=None,
        sortie_times=(SortieTimes(None, 50.0, 60.0),),
    )
    with made(tmp_path) as store:
        store.add(results[6:])
        store.add(results[:6])
        assert store.results() == results
    with CampaignStore(tmp_path) as again:
        assert again.campaign == CAMPAIGN
        assert again.results() == results
        assert again.missing() == []


def test_what_is_missing_is_known(tmp_path: Path) -> None:
    with made(tmp_path) as store:
        assert store.missing() == list(range(1, 13))
        store.add([sample_result(2), sample_result(11)])
        assert store.missing() == [1, 3, 4, 5, 6, 7, 8, 9, 10, 12]


def test_results_are_added_together_or_not_at_all(tmp_path: Path) -> None:
    with made(tmp_path) as store:
        store.add([sample_result(2)])
        with pytest.raises(ValueError, match='UNIQUE constraint failed'):
            store.add([sample_result(1), sample_result(2)])
        assert [result.number for result in store.results()] == [2]


def test_others_can_ask_the_file_while_it_is_written(tmp_path: Path) -> None:
    with made(tmp_path) as store:
        store.add([sample_result(2, violations=3), sample_result(5)])
        with closing(sqlite3.connect(tmp_path / STORE)) as database:
            rows = database.execute(
                'select seed, scenario, variation, planner, violations from mission_of_case'
            ).fetchall()
    assert rows == [
        (0, 'minimal', 'surfacing=slow', 'robust', 3),
        (1, 'minimal', 'surfacing=slow', 'ecc2009', 0),
    ]


def test_every_figure_has_its_column(tmp_path: Path) -> None:
    with made(tmp_path), closing(sqlite3.connect(tmp_path / STORE)) as database:
        columns = [name for _, name, *_ in database.execute('pragma table_info(missions)')]
    assert set(columns) == {*MissionResult.__struct_fields__, 'case_id', 'seed'}


def test_a_store_is_there_only_once_it_is_whole(tmp_path: Path) -> None:
    (tmp_path / UNFINISHED).write_text('half of a file, of one that was killed')
    (tmp_path / f'{UNFINISHED}-wal').write_text('its log')
    with made(tmp_path) as store:
        assert store.campaign == CAMPAIGN
    assert [path.name for path in tmp_path.iterdir()] == [STORE]


def test_a_folder_with_something_else_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / 'report.html').write_text('of a thesis')
    (tmp_path / UNFINISHED).touch()
    with pytest.raises(ValueError, match='holds something else than a campaign'):
        make_store(tmp_path, CAMPAIGN)
    assert len(list(tmp_path.iterdir())) == 2


def test_what_is_no_store_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match='holds no campaign'):
        CampaignStore(tmp_path / 'nowhere')
    (tmp_path / STORE).write_text('x' * 5000)
    with pytest.raises(ValueError, match='not a database'):
        CampaignStore(tmp_path)
    (tmp_path / STORE).unlink()
    made(tmp_path).close()
    with closing(sqlite3.connect(tmp_path / STORE)) as database:
        database.execute('pragma user_version = 99')
    with pytest.raises(ValueError, match='its layout is 99; allowed: 2'):
        CampaignStore(tmp_path)


def test_one_process_at_a_time_flies_into_a_folder(tmp_path: Path) -> None:
    with (
        sole_writer(tmp_path),
        pytest.raises(ValueError, match='another process is flying a campaign there'),
        sole_writer(tmp_path),
    ):
        pass
    with sole_writer(tmp_path):
        pass


def test_a_result_is_what_json_can_hold() -> None:
    result = sample_result(1)
    assert msgspec.json.decode(msgspec.json.encode(result), type=MissionResult) == result
