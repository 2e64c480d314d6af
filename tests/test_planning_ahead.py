"""Missions planned ahead for longer than anything else takes: shown, and never taken for dead."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from bag_contents import recorded
from patience import PATIENCE_S
from slow_planner import SLICES, fly_with_it, let_nodes_fly_with_it

from c3_station import mission_run, ros_flight
from c3_station.cli import main
from c3_station.exit_codes import ExitCode
from c3_station.mission_monitor import MissionMonitor
from c3_station.node_params import UAV
from c3_station.process_flight import fly_in_process
from c3_station.run_folder import new_run_folder
from c3_station.scenario_files import load_scenario
from msgs_json.topics import MISSION_EVENTS

TOLD = [f'planning ahead {number / SLICES:.0%}' for number in range(1, SLICES + 1)]


def told(capsys: pytest.CaptureFixture[str]) -> list[str]:
    lines = capsys.readouterr().out.splitlines()
    return [line for line in lines if line.startswith('planning ahead')]


def test_a_log_file_is_told_of_planning_ahead_but_not_flooded(
    tiny: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    fly_with_it(monkeypatch, 0.0)
    words = ('run', str(tiny), '--no-ros', '--no-bag', '--out')
    assert main([*words, str(tmp_path / 'seldom')]) == ExitCode.OK
    assert told(capsys) == TOLD[:1]
    monkeypatch.setattr(mission_run, '_TOLD_EVERY_S', 0.0)
    assert main([*words, str(tmp_path / 'often')]) == ExitCode.OK
    assert told(capsys) == TOLD


def test_a_paced_mission_does_not_make_up_for_the_time_of_planning_ahead(
    tiny: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rate, slice_s = 400.0, 0.05
    fly_with_it(monkeypatch, slice_s)
    scenario = load_scenario(str(tiny))
    monitor = MissionMonitor(scenario, UAV)
    began_s = time.monotonic()
    folder = new_run_folder(tmp_path / 'run', scenario, force=False)
    fly_in_process(scenario, folder, monitor, rate=rate, bag=False, refresh=lambda: None)
    assert monitor.ended == 'completed'
    took_s = time.monotonic() - began_s
    assert took_s >= SLICES * slice_s + monitor.now_s / rate


# --- over real processes -------------------------------------------------------------------------


@pytest.mark.ros
def test_nodes_wait_for_one_that_plans_ahead_and_fly_the_same_mission_as_one_process(
    tiny: Path, tmp_path: Path, key_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    let_nodes_fly_with_it(monkeypatch, tmp_path, 1.2 * ros_flight._REPLY_TIMEOUT_S / SLICES)
    fly_with_it(monkeypatch, 0.0)
    words = ('run', str(tiny), '--key-file', str(key_file), '--out')
    assert main([*words, str(tmp_path / 'alone'), '--no-ros']) == ExitCode.OK
    assert main([*words, str(tmp_path / 'nodes'), '--rate', 'max']) == ExitCode.OK
    alone, nodes = (recorded(tmp_path / way / 'bag') for way in ('alone', 'nodes'))
    assert alone == nodes
    events = [cdr for _, cdr in alone[MISSION_EVENTS.name]]
    assert sum(b'planning_ahead' in cdr for cdr in events) == SLICES


@pytest.mark.ros
def test_a_node_that_plans_ahead_ends_when_it_is_told_to(
    tiny: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    let_nodes_fly_with_it(monkeypatch, tmp_path, 2.0)
    words = ('run', str(tiny), '--no-bag', '--out', str(tmp_path / 'run'))
    command = [sys.executable, '-m', 'c3_station', *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as run:
        assert run.stdout is not None
        while run.stdout.readline().rstrip() != TOLD[0]:
            assert run.poll() is None
        run.send_signal(signal.SIGINT)
        told_s = time.monotonic()
        run.communicate(timeout=PATIENCE_S)
    assert run.returncode == ExitCode.INTERRUPTED
    # The slice under way is done to its end; all of them would be killed, 7 s after the signal.
    assert time.monotonic() - told_s < 6.0
