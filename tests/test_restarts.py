"""Nodes that are killed or hang while a mission is flown over real processes: it goes on."""

import json
import os
import resource
import signal
import time
from pathlib import Path

import pytest
from orchestrated_run import Run
from patience import wait_until

from c3_station.bag import BagReader
from c3_station.exit_codes import ExitCode
from c3_station.in_process import fly
from c3_station.mission_record import read_mission
from c3_station.scenario_files import scenario_json
from c3_station.scenario_generator import Span, generate_scenario
from c3_station.summary import Summarizer
from msgs_json.messages import MissionResumed, NodeRestarted

pytestmark = pytest.mark.ros


def restarts_in(bag: Path) -> list[NodeRestarted]:
    return [
        each.event for each in read_mission(bag).events if isinstance(each.event, NodeRestarted)
    ]


def test_nodes_that_are_killed_are_started_again_and_the_mission_goes_on(
    tmp_path: Path, runs: list[Run]
) -> None:
    run = Run(tmp_path / 'run', '--rate', '100')
    runs.append(run)
    victims = ['auv_2', 'uav', 'c3']
    for recorded_bytes, victim in zip((100_000, 200_000, 300_000), victims, strict=True):
        run.wait_for_flight(recorded_bytes)
        os.kill(run.nodes()[victim], signal.SIGKILL)
    code, output = run.end()
    assert code == ExitCode.OK, output
    assert 'Traceback' not in output
    assert run.nodes() == {}
    for victim in victims:
        assert f'{victim} ended by SIGKILL, restarted (1)' in output
    # not in the order they died: two that die within a moment come up as they may
    restarts = sorted(restarts_in(run.out / 'bag'), key=lambda each: each.node)
    assert restarts == [NodeRestarted(node=victim, restarts=1) for victim in sorted(victims)]
    with BagReader(run.out / 'bag') as reader:
        assert reader.facts.complete
    summary = json.loads((run.out / 'summary.json').read_text())
    assert summary['explored_s'] == 457.0  # as if nothing had happened
    assert summary['samples_delivered'] == summary['samples_collected']


def test_all_auvs_of_a_process_that_is_killed_go_on(tmp_path: Path, runs: list[Run]) -> None:
    path = tmp_path / 'dozen.yaml'
    fleet = {name: Span(least=n, most=n) for name, n in {'auvs': 12, 'cols': 8, 'rows': 8}.items()}
    scenario = generate_scenario(2, fleet, ('early',))
    path.write_bytes(scenario_json(scenario))
    run = Run(tmp_path / 'run', '--rate', f'{40 * scenario.tick_s:g}', scenario=str(path))
    runs.append(run)
    run.wait_for_flight()
    os.kill(run.nodes()['fleet_1'], signal.SIGKILL)
    code, output = run.end()
    assert code == ExitCode.OK, output
    assert 'fleet_1 ended by SIGKILL, restarted (1)' in output
    restarts = restarts_in(run.out / 'bag')
    assert sorted(each.node for each in restarts) == sorted(a.name for a in scenario.auvs[:10])
    summarizer = Summarizer()
    fly(scenario, summarizer.frame)
    without = summarizer.summary()
    summary = read_mission(run.out / 'bag').summary
    assert summary.explored_s == without.explored_s
    assert summary.sorties == without.sorties
    assert summary.samples_delivered == without.samples_delivered


def test_a_node_that_hangs_is_killed_and_started_again(tmp_path: Path, runs: list[Run]) -> None:
    run = Run(tmp_path / 'run', '--rate', '150')
    runs.append(run)
    run.wait_for_flight()
    os.kill(run.nodes()['auv_3'], signal.SIGSTOP)
    code, output = run.end()
    assert code == ExitCode.OK, output
    assert 'auv_3 hangs: auv_3 (' in output  # and what it owes, which hangs on when it was
    assert 'auv_3 ended by SIGKILL, restarted (1)' in output
    assert restarts_in(run.out / 'bag') == [NodeRestarted(node='auv_3', restarts=1)]


def test_a_node_that_dies_again_and_again_ends_the_mission(
    tmp_path: Path, runs: list[Run]
) -> None:
    run = Run(tmp_path / 'run', '--rate', '60')
    runs.append(run)
    run.wait_for_flight()
    killed: set[int] = set()

    def kill() -> bool:
        pid = run.nodes().get('auv_1')
        if pid is not None and pid not in killed:
            os.kill(pid, signal.SIGKILL)
            killed.add(pid)
        return run.process.poll() is not None

    wait_until(kill)
    code, output = run.end()
    assert code == ExitCode.FAILED, output
    assert len(killed) == 6
    assert 'auv_1 ended by SIGKILL for the 6th time within 60 s; the end of' in output
    assert run.nodes() == {}
    summary = json.loads((run.out / 'summary.json').read_text())
    assert summary['stopped'].startswith('interrupted, waiting for auv_1 (')


def test_a_mission_ends_whose_record_has_no_room_and_is_resumed_when_there_is(
    tmp_path: Path, runs: list[Run]
) -> None:
    run = Run(tmp_path / 'run', '--rate', '100')
    runs.append(run)
    run.wait_for_flight(200_000)
    full = (200_000, resource.RLIM_INFINITY)
    resource.prlimit(run.nodes()['recorder'], resource.RLIMIT_FSIZE, full)
    code, output = run.end()
    assert code == ExitCode.FAILED, output
    assert 'cannot be written: File too large' in ' '.join(output.split())
    assert 'Traceback' not in output
    assert run.nodes() == {}
    assert not read_mission(run.out / 'bag').summary.complete
    run.resume()
    _, output = run.end()
    assert 'Traceback' not in output
    summary = read_mission(run.out / 'bag').summary
    assert summary.complete
    assert summary.explored_s == 457.0  # nothing is missing in its log
    assert summary.samples_delivered == summary.samples_collected == 144
    assert summary.samples_doubled == 0


def test_a_mission_is_resumed_whose_machine_went_down(tmp_path: Path, runs: list[Run]) -> None:
    run = Run(tmp_path / 'run', '--rate', '150')
    runs.append(run)
    run.wait_for_flight(200_000)
    time.sleep(0.3)  # when nodes have said and stored what is not in the bag
    for pid in (run.process.pid, *run.nodes().values()):
        os.kill(pid, signal.SIGKILL)
    run.end()
    run.resume()
    code, output = run.end()
    assert code == ExitCode.OK, output
    record = read_mission(run.out / 'bag')
    assert record.facts.complete
    assert [each for each in record.events if isinstance(each.event, MissionResumed)] != []
    assert record.summary.explored_s == 457.0
    assert record.summary.samples_delivered == record.summary.samples_collected == 144
    assert {path.name for path in run.out.glob('bag*')} == {'bag'}
    run.resume()
    code, output = run.end()
    assert code == ExitCode.BAD_INPUT
    assert 'its mission is over' in output
