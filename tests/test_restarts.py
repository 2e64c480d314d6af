"""Nodes that are killed while a mission is flown over real processes: it goes on."""

import json
import os
import signal
from pathlib import Path

import pytest
from orchestrated_run import Run
from patience import wait_until

from c3_station.exit_codes import ExitCode

pytestmark = pytest.mark.ros


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
    assert summary['stopped'] == 'interrupted, waiting for auv_1 (no answer) (auv_1)'
