"""Whole missions over real processes: what the orchestrator promises when things go wrong."""

import json
import os
import signal
from pathlib import Path

import pytest
from orchestrated_run import Run
from patience import wait_until

from c3_station.bag import BagReader
from c3_station.exit_codes import ExitCode
from c3_station.mission_monitor import MissionMonitor
from c3_station.node_params import UAV
from c3_station.observer_node import Observer
from c3_station.scenario_files import load_scenario

pytestmark = pytest.mark.ros


def test_an_interrupt_ends_everything_and_leaves_a_readable_bag(
    tmp_path: Path, runs: list[Run]
) -> None:
    run = Run(tmp_path / 'run', '--rate', '60')
    runs.append(run)
    run.wait_for_flight()
    assert len(run.nodes()) == 7
    run.process.send_signal(signal.SIGINT)
    code, output = run.end()
    assert code == ExitCode.INTERRUPTED, output
    assert 'Traceback' not in output
    assert run.nodes() == {}
    summary = json.loads((run.out / 'summary.json').read_text())
    assert summary['explored_s'] is None
    assert summary['stopped'] == 'interrupted'


def test_an_interrupt_at_once_ends_everything_too(tmp_path: Path, runs: list[Run]) -> None:
    run = Run(tmp_path / 'run')
    runs.append(run)
    wait_until(lambda: bool(run.nodes()))
    run.process.send_signal(signal.SIGTERM)
    code, output = run.end()
    assert code == ExitCode.INTERRUPTED, output
    assert 'Traceback' not in output
    assert run.nodes() == {}
    assert (run.out / 'summary.json').exists()


def test_a_node_that_is_killed_is_named_and_the_bag_stays_readable(
    tmp_path: Path, runs: list[Run]
) -> None:
    run = Run(tmp_path / 'run', '--rate', '60', '--set', 'on_death=end')
    runs.append(run)
    run.wait_for_flight()
    os.kill(run.nodes()['uav'], signal.SIGKILL)
    code, output = run.end()
    assert code == ExitCode.FAILED, output
    assert 'uav ended by SIGKILL' in output
    assert 'Traceback' not in output
    assert run.nodes() == {}
    summary = json.loads((run.out / 'summary.json').read_text())
    assert 'uav' in summary['stopped']


def test_a_hanging_node_is_named_too(tmp_path: Path, runs: list[Run]) -> None:
    run = Run(tmp_path / 'run', '--rate', '60', '--set', 'on_death=end')
    runs.append(run)
    run.wait_for_flight()
    os.kill(run.nodes()['auv_3'], signal.SIGSTOP)
    code, output = run.end()
    assert code == ExitCode.FAILED, output
    assert 'auv_3' in output
    assert run.nodes() == {}


def test_a_killed_recorder_costs_the_last_second_at_most(tmp_path: Path, runs: list[Run]) -> None:
    rate = 60.0
    run = Run(tmp_path / 'run', '--rate', f'{rate:g}')
    runs.append(run)
    run.wait_for_flight()
    recorder = run.nodes()['recorder']
    (variable,) = (
        word
        for word in Path(f'/proc/{recorder}/environ').read_text().split('\0')
        if word.startswith('ROS_DOMAIN_ID=')
    )
    scenario = load_scenario('ecc2009')
    monitor = MissionMonitor(scenario, UAV)
    observer = Observer(int(variable.partition('=')[2]), monitor, every_tick=True)
    observer.spin(2.0)
    os.kill(recorder, signal.SIGKILL)
    killed_s = monitor.now_s
    observer.close()
    code, output = run.end()
    assert code == ExitCode.FAILED, output
    assert 'recorder ended by SIGKILL' in output
    assert 'Traceback' not in output
    with BagReader(run.out / 'bag') as reader:
        saved_s = max(message.log_time_ns for message in reader.messages()) * 1e-9
    assert killed_s > 60.0
    assert saved_s >= killed_s - 1.0 * rate
    assert json.loads((run.out / 'summary.json').read_text())['scenario'] == 'ecc2009'
