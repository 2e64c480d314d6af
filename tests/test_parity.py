"""Two ways to run a mission, one mission: every message on every topic is the same."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from bag_contents import recorded
from orchestrated_run import Run

from c3_station.bag import BagReader
from c3_station.cli import main
from c3_station.exit_codes import ExitCode

PLANNED = ('planner.options.effort=fast', 'planner.options.visiting_order=planned')

UNCERTAIN = """
name: uncertain
description: two AUVs that come up early on half of their legs, and a tick that is no whole second
region: {cols: 6, rows: 5, cell_m: 8.0}
c3: {east_m: -5.0, north_m: 3.0}
uav: {speed_mps: 7.0}
auvs:
  - name: auv_1
    initial_path: [[0, 0], [0, 1]]
    surfacing: {model: early, probability: 0.5}
  - name: auv_2
    initial_path: [[5, 4], [5, 3]]
    speed_mps: 1.3
    surfacing: {model: early, probability: 0.5}
radio: {range_m: 15.0}
sortie: {limit_s: 45.0, surface_margin_s: 2.0}
planner: {name: ecc2009, path_cells: 5, min_path_cells: 2}
tick_s: 0.5
seed: 11
max_mission_s: 1500
"""

ROUGH = """
name: rough
description: a radio that does everything that a radio can do
region: {cols: 5, rows: 4, cell_m: 10.0}
c3: {east_m: 25.0, north_m: -5.0}
uav: {speed_mps: 4.0}
auvs:
  - name: auv_1
    initial_path: [[0, 0], [1, 0]]
  - name: auv_2
    initial_path: [[4, 3], [3, 3]]
    surfacing: {model: early, probability: 0.3}
radio:
  range_m: 30.0
  max_message_bytes: 2048
  queue_frames: 4
  loss: {at_zero: 0.05, at_range: 0.3}
  bursts: {good_s: 60, bad_s: 3, loss: 0.9}
  latency_s: 0.1
  jitter_s: 1.5
  bytes_per_s: 4000
  duplicates: 0.2
  corruption: 0.1
  links: [{from: auv_2, to: uav, loss: 0.4, bytes_per_s: 2500}, {from: uav, to: c3, jitter_s: 0}]
sortie: {limit_s: 90.0, handover_s: 16.0, lost_after_sorties: 100}
planner: {path_cells: 4}
seed: 5
max_mission_s: 4000
"""

WRITTEN_HERE = {'uncertain': UNCERTAIN, 'rough': ROUGH}


def flown(
    scenario: str, out: Path, key_file: Path, *options: str
) -> dict[str, list[tuple[int, bytes]]]:
    code = main(['run', scenario, '--out', str(out), '--key-file', str(key_file), *options])
    assert code in (ExitCode.OK, ExitCode.FAILED)  # what it came to is not the question here
    return recorded(out / 'bag')


def assert_same(
    alone: dict[str, list[tuple[int, bytes]]], nodes: dict[str, list[tuple[int, bytes]]]
) -> None:
    assert alone.keys() == nodes.keys()
    assert sum(map(len, alone.values())) > 1000
    for topic, messages in alone.items():
        assert messages == nodes[topic], topic


@pytest.mark.ros
@pytest.mark.parametrize(
    ('name', 'options'),
    [
        ('uncertain', []),
        ('rough', []),
        ('uncertain', ['--planner', 'adaptive', '--set', *PLANNED]),
    ],
    ids=['uncertain', 'rough', 'planned_ahead'],
)
def test_nodes_and_one_process_fly_the_same_mission(
    tmp_path: Path, key_file: Path, name: str, options: list[str]
) -> None:
    scenario = tmp_path / f'{name}.yaml'
    scenario.write_text(WRITTEN_HERE[name])
    alone = flown(str(scenario), tmp_path / 'alone', key_file, '--no-ros', *options)
    nodes = flown(str(scenario), tmp_path / 'nodes', key_file, '--rate', 'max', *options)
    assert_same(alone, nodes)


@pytest.mark.ros
def test_the_reference_mission_is_the_same_and_leaves_nothing_but_its_folder(
    tmp_path: Path, key_file: Path, runs: list[Run]
) -> None:
    run = Run(tmp_path / 'nodes', '--key-file', str(key_file), '--rate', 'max')
    runs.append(run)
    alone = flown('ecc2009', tmp_path / 'alone', key_file, '--no-ros')
    code, output = run.end()
    assert code == ExitCode.OK, output
    assert_same(alone, recorded(run.out / 'bag'))
    summary = json.loads((run.out / 'summary.json').read_text())
    assert summary['explored_s'] == 457.0
    assert summary['sortie_limit_violations'] == 0
    assert summary['samples_delivered'] == summary['samples_collected']
    assert (run.out / 'report.html').exists()
    assert 'Traceback' not in ''.join(log.read_text() for log in run.out.glob('logs/*.log'))
    with BagReader(run.out / 'bag') as reader:
        assert reader.facts.complete
    assert run.nodes() == {}


@pytest.mark.slow
def test_the_same_run_twice_is_the_same(tmp_path: Path, key_file: Path) -> None:
    (tmp_path / 'uncertain.yaml').write_text(UNCERTAIN)
    scenario = str(tmp_path / 'uncertain.yaml')
    first = flown(scenario, tmp_path / 'first', key_file, '--no-ros')
    assert first == flown(scenario, tmp_path / 'second', key_file, '--no-ros')


@pytest.mark.slow
def test_another_seed_is_another_mission(tmp_path: Path, key_file: Path) -> None:
    (tmp_path / 'uncertain.yaml').write_text(UNCERTAIN)
    scenario = str(tmp_path / 'uncertain.yaml')
    first = flown(scenario, tmp_path / 'first', key_file, '--no-ros')
    other = flown(scenario, tmp_path / 'other', key_file, '--no-ros', '--seed', '12')
    assert first['/auv_1/odom'] != other['/auv_1/odom']
