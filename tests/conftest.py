"""What several of these tests begin with."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from orchestrated_run import Run

from msgs_json.key_file import new_key, write_key

TINY = """
name: tiny
description: one AUV, nine cells
region: {cols: 3, rows: 3, cell_m: 10.0}
c3: {east_m: 15.0, north_m: 0.0}
uav: {speed_mps: 4.0}
auvs:
  - {name: auv_1, initial_path: [[0, 0], [0, 1]], surfacing: {model: early, probability: 0.3}}
radio: {range_m: 20.0}
sortie: {limit_s: 60.0}
planner: {name: ecc2009, path_cells: 4}
max_mission_s: 2000
"""


@pytest.fixture
def tiny(tmp_path: Path) -> Path:
    """Return the file of a scenario that is flown in no time; it draws random numbers."""
    path = tmp_path / 'tiny.yaml'
    path.write_text(TINY)
    return path


@pytest.fixture
def runs() -> Iterator[list[Run]]:
    """Collect the runs of a test, so that none outlives it."""
    begun: list[Run] = []
    yield begun
    for run in begun:
        if run.process.poll() is None:
            run.process.kill()
            run.process.communicate()


@pytest.fixture
def key_file(tmp_path: Path) -> Path:
    """Return a file with a key: missions are the same to the byte where they have the same one."""
    path = tmp_path / 'mission_key'
    write_key(path, new_key())
    return path
