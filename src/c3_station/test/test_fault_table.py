"""The table of faults: its rows can be flown, and a broken promise shows."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest
from campaign_samples import sample_result
from rich.console import Console

from c3_station.campaign_mission import MissionExit, MissionResult
from c3_station.exit_codes import ExitCode
from c3_station.fault_schedule import fault_schedule
from c3_station.fault_table import (
    Row,
    keeps_promises,
    outcomes,
    plan_table,
    rows_for_nodes,
    rows_of,
)
from c3_station.faults_command import FaultsOptions, fly_faults, table_lines
from c3_station.program import PROGRAM
from c3_station.ros_flight import DEATHS_MAX
from c3_station.scenario import Faults
from c3_station.scenario_files import load_scenario

ROWS = rows_of(load_scenario('ecc2009'))
CALM, KILLED = Row(name='no fault'), Row(name='killed', changes=('faults.kills=3',))


def test_every_row_is_a_mission_of_its_own() -> None:
    campaign = plan_table('ecc2009', 'robust', ROWS, missions=2)
    assert campaign.missions_total == 2 * len(ROWS) == 40
    assert len({case.scenario_json for case in campaign.cases}) == len(ROWS)
    assert campaign.job(1).scenario.faults == Faults()


def test_rows_that_nodes_fly_have_no_fault_that_only_agents_here_can_have() -> None:
    by_nodes = rows_for_nodes(load_scenario('ecc2009'))
    campaign = plan_table('ecc2009', 'robust', by_nodes, missions=1)
    for number in range(1, len(by_nodes) + 1):
        faults = campaign.job(number).scenario.faults
        assert (faults.clock_jump_s, faults.off_by_one) == (0.0, None)
        schedule = fault_schedule(campaign.job(number).scenario)
        assert all(len(each.kills) <= DEATHS_MAX for each in schedule.values())


@pytest.mark.parametrize(
    ('result', 'is_kept'),
    [
        (sample_result(1), True),
        (sample_result(1, exit=MissionExit.STOPPED, reason='hard stop'), True),
        (sample_result(1, exit=MissionExit.STOPPED, reason=None), False),
        (sample_result(1, exit=MissionExit.ERROR, reason='ZeroDivisionError'), False),
        (sample_result(1, violations=1), False),
        (sample_result(1, samples_lost=1), False),
        (sample_result(1, samples_doubled=1), False),
        (sample_result(1, forged=10, obeyed=1), False),
    ],
)
def test_what_is_promised(result: MissionResult, is_kept: bool) -> None:
    assert keeps_promises(result) is is_kept


def test_a_row_tells_its_ratio_to_the_same_seeds_and_the_mission_to_look_at() -> None:
    campaign = plan_table('minimal', 'robust', (CALM, KILLED), missions=2)
    results = [
        sample_result(1, explored_s=100.0),
        sample_result(2, explored_s=150.0),
        sample_result(3, explored_s=200.0),
        sample_result(4, explored_s=220.0, samples_lost=3, restarts=2),
    ]
    calm, killed = outcomes(campaign, (CALM, KILLED), results)
    assert (calm.explored_ratio, killed.explored_ratio) == (1.0, pytest.approx(1.3))
    assert (calm.broken, killed.broken) == ([], [results[3]])
    words = 'run minimal --planner robust --seed 1 --set faults.kills=3 --no-ros'
    assert killed.worst == f'{PROGRAM} {words}'
    assert shlex.split(killed.worst)[-1] == '--no-ros'
    line = table_lines((calm, killed))[-1].split()
    assert line == ['killed', '2', '2', '3', '0', '0', '0', '0', '0', '2', '0', '185', '1.30']


def test_how_missions_ended_that_are_not_complete_is_told() -> None:
    campaign = plan_table('minimal', 'robust', (CALM,), missions=1)
    stopped = sample_result(1, exit=MissionExit.STOPPED, reason='hard stop: it is late')
    lines = table_lines(outcomes(campaign, (CALM,), [stopped]))
    assert lines[-1] == '1 x no fault: hard stop: it is late'


@pytest.mark.slow
def test_the_whole_table_is_flown_and_told_again_from_its_folder(tmp_path: Path) -> None:
    options = FaultsOptions(
        scenario='ecc2009',
        planner='robust',
        missions=1,
        by_nodes=0,
        jobs=1,
        out=tmp_path / 'table',
    )
    for _ in range(2):  # the second time nothing is left to be flown
        console = Console(width=200, record=True)
        assert fly_faults(options, console) is ExitCode.OK
        text = console.export_text()
        assert all(row.name in text for row in ROWS)
