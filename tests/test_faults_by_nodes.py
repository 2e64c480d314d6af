"""Faults that strike real processes: SIGKILL, full disks and a stranger on the radio's topics."""

from __future__ import annotations

import json
from pathlib import Path

import msgspec
import pytest
from orchestrated_run import Run

from c3_station.exit_codes import ExitCode
from c3_station.faults_by_nodes import tally_of
from c3_station.faults_on_ros import RosFaults
from c3_station.in_process import fly
from c3_station.processes import NodeProcess
from c3_station.scenario import Faults, Scenario
from c3_station.scenario_files import load_scenario, with_choices
from c3_station.summary import Summarizer, Summary


@pytest.mark.parametrize('faults', [Faults(clock_jump_s=3.0), Faults(off_by_one='auv_1')])
def test_faults_that_nodes_cannot_have_are_refused(faults: Faults) -> None:
    def process_of(agent: str) -> NodeProcess:
        raise AssertionError(agent)

    scenario = msgspec.structs.replace(load_scenario('ecc2009'), faults=faults)
    with pytest.raises(ValueError, match=r'faults\.\w+: .*; allowed: with --no-ros'):
        RosFaults(scenario, 0, process_of)


def test_forged_messages_that_change_a_mission_count_as_obeyed() -> None:
    scenario = msgspec.structs.replace(load_scenario('minimal'), faults=Faults(forged=300))
    same, another = (
        flown(with_choices(scenario, planner=name)) for name in (scenario.planner.name, 'lanes')
    )
    assert tally_of(scenario, same).obeyed == 0
    assert tally_of(scenario, another).obeyed == 300


def flown(scenario: Scenario) -> Summary:
    summarizer = Summarizer()
    fly(scenario, summarizer.frame)
    return summarizer.summary()


@pytest.mark.ros
@pytest.mark.parametrize(
    ('changes', 'restarts', 'reasons'),
    [
        (('faults.kills=2',), 2, set()),
        (('faults.forged=300',), 0, {'auth'}),
    ],
    ids=['kills', 'forged'],
)
def test_a_mission_of_nodes_keeps_its_promises(
    tmp_path: Path, runs: list[Run], changes: tuple[str, ...], restarts: int, reasons: set[str]
) -> None:
    words = [word for change in changes for word in ('--set', change)]
    run = Run(tmp_path / 'run', '--rate', '150', *words, scenario='minimal')
    runs.append(run)
    code, output = run.end()
    assert code == ExitCode.OK, output
    assert 'Traceback' not in output
    summary = json.loads((run.out / 'summary.json').read_text())
    assert summary['complete']
    assert summary['samples_delivered'] == summary['samples_collected']
    assert (summary['samples_doubled'], summary['sortie_limit_violations']) == (0, 0)
    assert sum(summary['restarts'].values()) == restarts
    assert {refusal['reason'] for refusal in summary['refusals']} == reasons
