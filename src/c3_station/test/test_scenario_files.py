"""Scenario files: what loads, what is refused, and how a person is told."""

from __future__ import annotations

import copy
import re
from pathlib import Path
from typing import Any

import msgspec
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from c3_station.in_process import fly
from c3_station.node_params import mission_params
from c3_station.scenario import Limits, Scenario
from c3_station.scenario_files import (
    ScenarioError,
    load_scenario,
    parse_scenario,
    scenario_from_json,
    scenario_json,
    shipped_scenarios,
    with_choices,
)
from msgs_json.agent_shell import Frame
from msgs_json.params import validated
from msgs_json.ros_messages import Text
from msgs_json.topics import RADIO_TX
from uav_planner.planners import PLANNERS
from uav_planner.planners.ecc2009 import Ecc2009Planner

ECC2009 = yaml.safe_load(shipped_scenarios()['ecc2009'].read_text())


def write(folder: Path, content: object) -> Path:
    file = folder / 'mission.yaml'
    text = content if isinstance(content, str) else yaml.safe_dump(content)
    file.write_text(text, encoding='utf-8')
    return file


def changed(path: tuple[str | int, ...], value: object) -> dict[str, Any]:
    content = copy.deepcopy(ECC2009)
    part: Any = content
    for key in path[:-1]:
        part = part[key]
    part[path[-1]] = value
    return content


# --- what loads ----------------------------------------------------------------------------------


def test_shipped_scenarios_load_and_are_named_as_their_files() -> None:
    assert set(shipped_scenarios()) == {'ecc2009', 'fleet_8', 'harbour', 'minimal'}
    for name, path in shipped_scenarios().items():
        assert load_scenario(name).name == name
        assert load_scenario(path) == load_scenario(str(path)) == load_scenario(name)


def test_reference_mission_is_that_of_the_paper() -> None:
    scenario = load_scenario('ecc2009')
    assert (scenario.region.cols, scenario.region.rows, scenario.region.cell_m) == (10, 10, 10.0)
    assert [auv.initial_path for auv in scenario.auvs] == [
        ((3, 7), (4, 7)),
        ((2, 9), (3, 9)),
        ((1, 2), (1, 1)),
    ]
    assert {auv.speed_mps for auv in scenario.auvs} == {1.0}
    assert scenario.uav.speed_mps == 4.0
    assert scenario.radio.range_m == 20.0
    assert scenario.sortie.limit_s == 60.0
    assert (scenario.planner.path_cells, scenario.planner.min_path_cells) == (6, 1)
    assert (scenario.c3.east_m, scenario.c3.north_m) == (50.0, 0.0)
    explored_s = scenario.pass_conditions.explored_s
    assert explored_s.min == pytest.approx(456 * 0.97, abs=0.05)
    assert explored_s.max == pytest.approx(456 * 1.03, abs=0.05)
    assert scenario.pass_conditions.samples_lost == Limits(max=0)


def test_commented_defaults_of_the_template_are_the_defaults() -> None:
    # Every line `# key: value` of the template may be uncommented without changing the mission.
    text = shipped_scenarios()['minimal'].read_text()
    keys = ('altitude_m', 'driver', 'speed_mps', 'depth_m', 'surfacing', 'max_message_bytes')
    keys += ('wind_east_mps', 'wind_north_mps', 'handover_s', 'lost_after_sorties')
    keys += ('surface_margin_s', 'min_path_cells', 'options', 'tick_s', 'seed', 'field')
    keys += ('on_death', 'samples_lost', 'masked', 'loss', 'bursts', 'latency_s', 'jitter_s')
    keys += ('bytes_per_s', 'queue_frames', 'duplicates', 'corruption', 'links', 'faults')
    uncommented, found = [], set()
    for line in text.splitlines():
        indent, mark, rest = line.partition('# ')
        key = rest.partition(':')[0]
        if mark and not indent.strip() and key in keys:
            uncommented.append(indent + rest)
            found.add(key)
        else:
            uncommented.append(line)
    assert found == set(keys)
    scenario = parse_json_of_yaml('\n'.join(uncommented))
    assert scenario == load_scenario('minimal')


def test_the_harbour_is_as_it_is_drawn() -> None:
    harbour = load_scenario('harbour')
    text = shipped_scenarios()['harbour'].read_text()
    drawn = {
        (col, int(row)): mark
        for row, marks in re.findall(r'^# +(\d+)((?: \S)+)$', text.replace('  ', ' '), re.M)
        for col, mark in enumerate(marks.split())
    }
    c3_cell = harbour.region.cell_at(harbour.c3)
    assert len(drawn) == harbour.region.cols * harbour.region.rows
    assert {cell for cell, mark in drawn.items() if mark in '#C'} == set(harbour.region.masked)
    assert drawn[c3_cell] == 'C'
    for number, auv in enumerate(harbour.auvs, start=1):
        assert drawn[auv.initial_path[0]] == str(number)


def parse_json_of_yaml(text: str) -> Scenario:
    return parse_scenario(msgspec.json.encode(yaml.safe_load(text)).decode())


@pytest.mark.parametrize('name', sorted(shipped_scenarios()))
def test_json_is_normalised_and_comes_back(name: str) -> None:
    scenario = load_scenario(name)
    data = scenario_json(scenario)
    assert scenario_from_json(data) == parse_scenario(data.decode()) == scenario
    assert scenario_json(scenario_from_json(data)) == data
    assert msgspec.json.decode(data)['on_death'] == 'restart'  # a default, written out
    assert msgspec.json.decode(data)['pass']['samples_lost']['max'] == 0


@pytest.mark.parametrize('name', sorted(shipped_scenarios()))
def test_what_loads_is_within_the_ranges_of_the_node_parameters(name: str) -> None:
    params = mission_params(load_scenario(name))
    for each in (params.world, params.c3, params.uav, *params.auvs):
        assert validated(type(each), msgspec.to_builtins(each)) == each


@pytest.mark.parametrize(
    ('path', 'value'),
    [
        (('uav', 'speed_mps'), 0.01),
        (('uav', 'speed_mps'), 1000),
        (('auvs', 0, 'speed_mps'), 0.01),
        (('auvs', 0, 'speed_mps'), 100),
        (('auvs', 0, 'depth_m'), 11_000),
        (('region', 'cell_m'), 0.1),
        (('region', 'cell_m'), 100_000),
        (('c3', 'east_m'), -1e6),
        (('radio', 'range_m'), 0.001),
        (('radio', 'range_m'), 1e6),
        (('sortie', 'surface_margin_s'), 1e6),
        (('tick_s',), 0.001),
        (('max_mission_s',), 1e7),
    ],
)
def test_ends_of_the_ranges_are_also_those_of_the_node_parameters(
    tmp_path: Path, path: tuple[str | int, ...], value: float
) -> None:
    params = mission_params(load_scenario(write(tmp_path, changed(path, value))))
    for each in (params.world, params.c3, params.uav, *params.auvs):
        validated(type(each), msgspec.to_builtins(each))


def test_every_auv_is_told_of_the_land() -> None:
    harbour = load_scenario('harbour')
    for auv in mission_params(harbour).auvs:
        assert tuple(zip(auv.masked[::2], auv.masked[1::2], strict=True)) == harbour.region.masked


def test_no_frame_is_longer_than_the_radio_takes(tmp_path: Path) -> None:
    scenario = load_scenario(write(tmp_path, changed(('radio', 'max_message_bytes'), 720)))
    sizes: list[int] = []

    def measure(source: str, frame: Frame) -> None:
        if frame.topic is RADIO_TX and isinstance(frame.message, Text):
            sizes.append(len(frame.message.data))

    fly(scenario, measure)
    assert 500 < max(sizes) <= 720


def test_numbers_may_be_written_with_a_bare_exponent(tmp_path: Path) -> None:
    text = yaml.safe_dump(changed(('max_mission_s',), 0)).replace(
        'max_mission_s: 0', 'max_mission_s: 5e3'
    )
    assert load_scenario(write(tmp_path, text)).max_mission_s == 5000.0


def test_field_file_is_found_beside_the_scenario(tmp_path: Path) -> None:
    points = [f'{east},{north},{east + north}' for east in (0, 100) for north in (0, 100)]
    (tmp_path / 'data').mkdir()
    csv = tmp_path / 'data' / 'sst.csv'
    csv.write_text('\n'.join(['east_m,north_m,value', *points]))
    field = {'kind': 'grid_file', 'path': 'data/sst.csv'}
    scenario = load_scenario(write(tmp_path, changed(('field',), field)))
    assert scenario.field['path'] == str(csv)
    csv.unlink()
    with pytest.raises(ScenarioError, match=r'mission.yaml: line \d+: field .*No such file'):
        load_scenario(tmp_path / 'mission.yaml')


# --- what is refused -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('path', 'value', 'said'),
    [
        (('name',), 'Bad Name', ["name is 'Bad Name'", 'allowed: text', '[a-z]']),
        (('region', 'rows'), 0, ['region.rows is 0', 'at least 1 and at most 1,000']),
        (('region', 'masked'), 5, ['region.masked is 5', 'a list of 0 or more']),
        (('region', 'masked'), [1, 2], ['region.masked[0] is 1', '[a whole number', 'row']),
        (('region', 'masked'), [[1]], ['region.masked[0] is [1]', 'column, 0 = west']),
        (
            ('region', 'masked'),
            [[0, 0], [10, 0]],
            ['region.masked[1] is [10, 0], outside the grid', 'columns 0 to 9, rows 0 to 9'],
        ),
        (('region', 'masked'), [[0, 0], [0, 0]], ['region.masked[1] is [0, 0]', 'already']),
        (
            ('region', 'masked'),
            [[4, 7]],
            ['auvs[0].initial_path is [3, 7], [4, 7]: cell [4, 7] is masked (land, no-go)'],
        ),
        (
            ('region', 'masked'),
            [[col, row] for col in range(10) for row in range(10)],
            ['region.masked has every cell; allowed: to leave some', 'auvs[0].initial_path'],
        ),
        (
            ('region', 'masked'),
            [[8, 0], [8, 1], [9, 2]],
            [
                'region.masked leaves 2 cells that no AUV can reach from where it starts; allowed:'
                ' to start an AUV there, or to mask them as well: [9, 0], [9, 1]',
            ],
        ),
        (('region', 'cell_m'), float('nan'), ['region.cell_m is nan', 'more than 0']),
        (('region', 'cell_m'), 0.05, ['region.cell_m is 0.05', 'at least 0.1']),
        (('c3', 'north_m'), float('-inf'), ['c3.north_m is -inf']),
        (('c3', 'north_m'), 2e6, ['c3.north_m is 2e+06', '-1,000,000 to 1,000,000']),
        (('c3',), 5, ['c3 is 5', 'allowed: keys east_m, north_m']),
        (('uav', 'speed_mps'), '4', ["uav.speed_mps is '4'", 'a number']),
        (('uav', 'speed_mps'), True, ['uav.speed_mps is True', 'a number']),
        (('uav', 'sped_mps'), 4, ['uav.sped_mps', 'did you mean speed_mps?', 'altitude_m']),
        (('uav', 'driver'), 'kinematik', ['uav.driver', "'kinematik'", 'did you mean kinematic?']),
        (('auvs',), [], ['auvs is []', 'a list of 1 to 200']),
        (('auvs', 1, 'name'), 'auv_1', ['auvs[0].name', 'auvs[1].name', "'auv_1'"]),
        (('auvs', 1, 'name'), 'uav', ["auvs[1].name is 'uav'", 'any but c3']),
        (('auvs', 2, 'initial_path'), [[1, 2]], ['auvs[2].initial_path', 'a list of 2 to']),
        (('auvs', 2, 'initial_path'), [[1, 2], [1, 4]], ['auvs[2].initial_path', 'neighbour']),
        (('auvs', 2, 'initial_path'), [[9, 9], [9, 10]], ['[9, 10] lies outside', '10 x 10']),
        (('auvs', 2, 'initial_path', 1), [1], ['auvs[2].initial_path[1] is [1]', 'column']),
        (('auvs', 0, 'depth_m'), 0, ['auvs[0].depth_m is 0', 'at least 1']),
        (('auvs', 0, 'driver'), 'topic', ['auvs[0].driver', 'did you mean topics?']),
        (('auvs', 0, 'surfacing'), {'model': 'eary'}, ['auvs[0].surfacing', 'eary', 'early']),
        (('auvs', 0, 'surfacing'), {'model': 'early', 'probability': 2}, ['probability', '1.0']),
        (('radio', 'range_m'), -5, ['radio.range_m is -5', 'at least 0.001']),
        (
            ('radio', 'max_message_bytes'),
            719,
            ['radio.max_message_bytes is 719', 'allowed: a whole number, at least 720'],
        ),
        (('radio', 'loss'), 1.5, ['radio.loss is 1.5', 'at most 1', 'keys at_zero, at_range']),
        (('radio', 'loss'), {'at_zero': 0.5}, ['radio.loss.at_range is missing', 'at most 1']),
        (('radio', 'bursts'), {'good_s': 0, 'bad_s': 1}, ['radio.bursts.good_s is 0', '0.001']),
        (('radio', 'bursts'), {'good': 1, 'bad_s': 1}, ['bursts.good is 1', 'mean good_s?']),
        (('radio', 'bytes_per_s'), 0, ['radio.bytes_per_s is 0', 'at least 1', 'or null']),
        (('radio', 'queue_frames'), 0, ['radio.queue_frames is 0', 'at least 1']),
        (('radio', 'links'), [{'from': 'auv_1'}], ['radio.links[0].to is missing']),
        (('radio', 'links'), [{'from': 'c3', 'to': 'uav', 'los': 1}], ['links[0].los', 'loss?']),
        (
            ('radio', 'links'),
            [{'from': 'c3', 'to': 'uav'}, {'from': 'auv_1', 'to': 'auv_2', 'loss': 1}],
            ["radio.links[1].to is 'auv_2', which never hears auv_1", 'an AUV and the UAV'],
        ),
        (
            ('radio', 'links'),
            [{'from': 'auv_9', 'to': 'uav'}],
            ["radio.links[0].from is 'auv_9'; allowed: c3, uav, auv_1, auv_2, auv_3"],
        ),
        (
            ('radio', 'links'),
            [{'from': 'c3', 'to': 'uav'}, {'from': 'c3', 'to': 'uav', 'loss': 1}],
            ["radio.links[1].to is 'uav'", 'a link before'],
        ),
        (('radio', 'latency_s'), 0.1, ['sortie.handover_s is 0; allowed: at least 4, in which']),
        (('sortie', 'limit_s'), 0.5, ['sortie.limit_s is 0.5', 'tick_s 1']),
        (('planner', 'name'), 'ecc209', ['planner.name', "'ecc209'", 'did you mean ecc2009?']),
        (('planner', 'path_cells'), 25, ['planner.path_cells is 25', 'at most 24']),
        (
            ('planner', 'path_cells'),
            10,
            ["planner.name is 'ecc2009'; it cannot plan", 'path_cells is 10', 'ecc2009: 1 to 9'],
        ),
        (('planner', 'min_path_cells'), 7, ['planner.min_path_cells is 7', 'path_cells, 6']),
        (('planner', 'options'), {'tie': 1}, ['planner.options', "no option 'tie'"]),
        (('planner', 'options'), {'tie_order': 1}, ['planner.options', 'enws-first']),
        (('planner', 'options'), {'name': 'x'}, ['planner.options', 'name']),
        (('planner', 'options'), {'x': float('inf')}, ['planner.options', 'inf']),
        (('seed',), -1, ['seed is -1', 'at least 0']),
        (('field',), {'kind': 'synthetik'}, ['field', 'synthetik', '"synthetic"']),
        (('max_mission_s',), 'soon', ["max_mission_s is 'soon'"]),
        (('on_death',), 'explode', ["on_death is 'explode'", 'allowed: restart or end or keys']),
        (('on_death',), {'uav': 'explode'}, ["on_death.uav is 'explode'", 'allowed: restart or']),
        (
            ('operator',),
            [{'at_s': 1, 'command': {'command': 'stop'}}],
            ['operator[0].command cannot be taken', "'stop'"],
        ),
        (
            ('operator',),
            [{'at_s': 1, 'command': {'command': 'recall', 'auvs': ['auv_9']}}],
            ['operator[0].command cannot be taken: auv_9: no such AUV', 'auv_1, auv_2, auv_3'],
        ),
        (
            ('operator',),
            [{'at_s': 1, 'command': {'command': each}} for each in ('abort', 'resume')],
            ['operator[1].command cannot be taken: the mission is aborted'],
        ),
        (
            ('operator',),
            [{'at_s': at_s, 'command': {'command': 'pause'}} for at_s in (2, 1)],
            ['operator[1].at_s is 1; allowed: at least that of the one before, 2'],
        ),
        (('pass', 'explored_s'), {'min': 3, 'max': 2}, ['pass.explored_s.min is 3', 'max, 2']),
        (('pass', 'explored_s', 'max'), float('inf'), ['pass.explored_s.max is inf']),
        (('pass', 'explored'), {}, ['pass.explored is {}', 'did you mean explored_s?']),
    ],
)
def test_problem_names_file_line_key_value_and_what_is_allowed(
    tmp_path: Path, path: tuple[str | int, ...], value: object, said: list[str]
) -> None:
    file = write(tmp_path, changed(path, value))
    with pytest.raises(ScenarioError) as caught:
        load_scenario(file)
    assert str(caught.value).startswith(f'{file}: line ')
    for part in said:
        assert part in str(caught.value)


@pytest.mark.parametrize(
    ('radio', 'tick_s', 'least_s'),
    [
        ({'jitter_s': 1.0}, 1.0, 4.0),
        ({'jitter_s': 1.001}, 1.0, 8.0),
        ({'latency_s': 0.7, 'jitter_s': 0.7}, 0.5, 6.0),
        # 8,192 bytes take 0.8192 s.
        ({'bytes_per_s': 10_000, 'max_message_bytes': 8192}, 1.0, 4.0),
        ({'bytes_per_s': 10_000, 'max_message_bytes': 8192, 'latency_s': 0.2}, 1.0, 8.0),
        # The worst of all AUVs counts, and both directions.
        ({'links': [{'from': 'auv_2', 'to': 'uav', 'latency_s': 2.5}]}, 1.0, 6.0),
        (
            {'links': [{'from': 'uav', 'to': 'auv_3', 'latency_s': 2.5}], 'latency_s': 1.0},
            1.0,
            8.0,
        ),
        # C3 has no part in a hand-over.
        ({'links': [{'from': 'uav', 'to': 'c3', 'latency_s': 2.5}]}, 1.0, 0.0),
        ({'loss': 0.5, 'duplicates': 0.5, 'corruption': 0.1}, 1.0, 0.0),
    ],
)
def test_a_hand_over_gets_the_time_that_the_radio_takes_for_it(
    radio: dict[str, object], tick_s: float, least_s: float
) -> None:
    content = changed(('planner', 'name'), 'ecc2009')
    content['radio'] |= radio
    content['tick_s'] = tick_s
    content['sortie']['handover_s'] = least_s
    parse_scenario(msgspec.json.encode(content).decode())
    if least_s:
        content['sortie']['handover_s'] = least_s - 0.01
        with pytest.raises(ScenarioError, match=f'handover_s .*at least {least_s:g}, in which'):
            parse_scenario(msgspec.json.encode(content).decode())


def test_what_links_do_not_say_stays_unsaid() -> None:
    links = [{'from': 'uav', 'to': 'c3', 'bytes_per_s': None}]
    content = changed(('radio', 'links'), links)
    scenario = parse_scenario(msgspec.json.encode(content).decode())
    assert msgspec.json.decode(scenario_json(scenario))['radio']['links'] == links
    assert msgspec.json.decode(mission_params(scenario).world.radio_links) == links


def test_a_region_that_its_planner_cannot_plan_is_refused(tmp_path: Path) -> None:
    content = changed(('planner',), {'name': 'adaptive', 'path_cells': 6})
    content['region'] |= {'cols': 1000, 'rows': 20}
    content['sortie']['limit_s'] = 1e5
    assert load_scenario(write(tmp_path, content)).planner.name == 'adaptive'
    content['region']['masked'] = [[999, 19]]
    with pytest.raises(ScenarioError, match=r"planner.name is 'adaptive'; .* it has 20000"):
        load_scenario(write(tmp_path, content))


def test_a_limit_by_which_no_sortie_gets_to_all_cells_is_refused(tmp_path: Path) -> None:
    # From (50, 0) to 20 m short of the centre of [0, 9] at (5, 95) are 85.1 m: at 5 m/s 18 ticks.
    content = changed(('planner',), {'name': 'robust', 'path_cells': 6})
    content['c3'] = {'east_m': 50.0, 'north_m': 0.0}
    content['uav']['speed_mps'] = 5.0
    content['sortie']['limit_s'] = 36.0
    for auv, col in zip(content['auvs'], (4, 5, 6), strict=True):
        auv['initial_path'] = [[col, 0], [col, 1]]
    assert load_scenario(write(tmp_path, content)).sortie.limit_s == 36.0
    content['sortie']['limit_s'] = 35.0
    problem = (
        'limit_s is 35; allowed: at least 36, or no sortie could go to 2 of the cells and be back'
        r' in time: \[0, 9\], \[9, 9\]'
    )
    with pytest.raises(ScenarioError, match=problem):
        load_scenario(write(tmp_path, content))
    content['region']['masked'] = [[0, 9], [9, 9]]
    assert load_scenario(write(tmp_path, content)).sortie.limit_s == 35.0


def test_what_no_auv_reaches_may_be_masked_too_or_get_an_auv(tmp_path: Path) -> None:
    wall = [[8, 0], [8, 1], [9, 2]]
    with pytest.raises(ScenarioError) as caught:
        load_scenario(write(tmp_path, changed(('region', 'masked'), wall)))
    listed = str(caught.value).rpartition('as well: ')[2]
    all_of_it = [*wall, *yaml.safe_load(f'[{listed}]')]
    filled = load_scenario(write(tmp_path, changed(('region', 'masked'), all_of_it)))
    assert filled.region.cells_total == 95
    with_another = changed(('region', 'masked'), wall)
    with_another['auvs'].append({'name': 'auv_4', 'initial_path': [[9, 0], [9, 1]]})
    assert load_scenario(write(tmp_path, with_another)).region.cells_total == 97


@pytest.mark.parametrize('key', ['name', 'region', 'auvs', 'planner', 'max_mission_s'])
def test_missing_key_is_named(tmp_path: Path, key: str) -> None:
    content = copy.deepcopy(ECC2009)
    del content[key]
    with pytest.raises(ScenarioError, match=f'{key} is missing; it must be'):
        load_scenario(write(tmp_path, content))


def test_all_problems_are_reported_in_the_order_of_the_file(tmp_path: Path) -> None:
    content = changed(('auvs', 1, 'speed_mps'), 'fast')
    content['radio'] = 20
    del content['tick_s']
    content['ticks'] = 1
    text = yaml.safe_dump(content, sort_keys=False)
    with pytest.raises(ScenarioError) as caught:
        load_scenario(write(tmp_path, text))
    problems = caught.value.problems
    assert [problem.split(' ')[2] for problem in problems] == [
        'auvs[1].speed_mps',
        'radio',
        'ticks',
    ]
    lines = text.splitlines()
    for problem, content_of_line in zip(
        problems, ['speed_mps: fast', 'radio: 20', 'ticks: 1'], strict=True
    ):
        number = int(problem.split(' ')[1].rstrip(':'))
        assert content_of_line in lines[number - 1]


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('name: x\n  bad: [1,\n', r'line 2, column 6: '),
        ('', 'the file is empty; allowed: keys name'),
        ('- 1\n', r'the file is \[1\]; allowed: keys name'),
        ('a: 1\nb: 2\na: 3\n', 'line 3: a is given twice, in lines 1 and 3'),
        ('1: 2\n', 'line 1: 1 is a key that is no text'),
        ('? [1, 2]\n: 3\n', 'line 1, column 3: .*unhashable'),
        ('a: &a [*a]\n', 'contains itself'),
        ('[' * 1200, 'nested too deeply'),
        ('x: !!python/name:os.system y\n', 'line 1, column 4: could not determine a constructor'),
        ('x: "\0"\n', 'not a text file'),
    ],
)
def test_text_that_is_no_scenario_is_refused_with_its_place(
    tmp_path: Path, text: str, said: str
) -> None:
    file = write(tmp_path, text)
    with pytest.raises(ScenarioError, match=said) as caught:
        load_scenario(file)
    assert str(file) in str(caught.value)


def test_file_that_cannot_be_read_is_refused(tmp_path: Path) -> None:
    (tmp_path / 'latin.yaml').write_bytes(b'name: \xff\n')
    with pytest.raises(ScenarioError, match='UTF-8'):
        load_scenario(tmp_path / 'latin.yaml')
    with pytest.raises(ScenarioError, match='no such file'):
        load_scenario(tmp_path / 'none.yaml')
    with pytest.raises(ScenarioError, match='folder'):
        load_scenario(tmp_path)


def test_unknown_name_is_refused_with_the_shipped_ones() -> None:
    with pytest.raises(ScenarioError, match=r'did you mean ecc2009\?.*ecc2009, fleet_8, harbour'):
        load_scenario('eccc2009')


def test_json_is_checked_like_a_file() -> None:
    with pytest.raises(ScenarioError, match=r'scenario JSON: radio.range_m is -1;'):
        parse_scenario(msgspec.json.encode(changed(('radio', 'range_m'), -1)).decode())
    with pytest.raises(ScenarioError, match=r'scenario JSON: .*truncated'):
        parse_scenario('{"name": ')


def test_choices_replace_planner_and_seed_and_are_checked() -> None:
    content = changed(('planner', 'options'), {'tie_order': 'wsen-last'})
    scenario = parse_scenario(msgspec.json.encode(content).decode())
    assert with_choices(scenario, planner=None, seed=None) == scenario
    assert with_choices(scenario, planner='ecc2009', seed=0) == scenario
    assert with_choices(scenario, planner=None, seed=7).seed == 7
    with pytest.raises(ScenarioError, match='command line: seed is -3'):
        with_choices(scenario, planner=None, seed=-3)
    with pytest.raises(ScenarioError, match=r"planner.name .*'best'.*allowed: adaptive, ecc2009"):
        with_choices(scenario, planner='best', seed=None)
    long_paths = changed(('planner',), {'name': 'robust', 'path_cells': 10})
    scenario = parse_scenario(msgspec.json.encode(long_paths).decode())
    with pytest.raises(ScenarioError, match=r"line: planner.name is 'ecc2009'; .* 1 to 9"):
        with_choices(scenario, planner='ecc2009')


def test_another_planner_does_not_get_the_options_of_the_first(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # No two planners may be there yet: a second name for the one that is, without options.
    planners = dict(PLANNERS) | {'other': Ecc2009Planner}
    monkeypatch.setattr('uav_planner.planners.PLANNERS', planners)
    monkeypatch.setattr('c3_station.scenario_checks.PLANNERS', planners)
    content = changed(('planner', 'options'), {'tie_order': 'wsen-last'})
    scenario = parse_scenario(msgspec.json.encode(content).decode())
    chosen = with_choices(scenario, planner='other', seed=None).planner
    assert (chosen.name, chosen.options) == ('other', {})
    assert chosen.path_cells == scenario.planner.path_cells


def test_recorded_scenario_may_name_parts_that_are_gone() -> None:
    data = msgspec.json.encode(changed(('planner', 'name'), 'of_the_past'))
    assert scenario_from_json(data).planner.name == 'of_the_past'
    with pytest.raises(ScenarioError, match=r'recorded scenario: .*planner'):
        scenario_from_json(msgspec.json.encode(changed(('planner',), 1)))


# --- whatever is in the file ---------------------------------------------------------------------

plain_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner),
    max_leaves=6,
)


def places(value: object, path: tuple[str | int, ...] = ()) -> list[tuple[str | int, ...]]:
    items: Any = value.items() if isinstance(value, dict) else ()
    items = enumerate(value) if isinstance(value, list) else items
    found = [path] if path else []
    return found + [place for key, item in items for place in places(item, (*path, key))]


@settings(max_examples=150)
@given(path=st.sampled_from(places(ECC2009)), value=plain_values)
def test_any_value_anywhere_either_loads_or_is_a_scenario_error(
    tmp_path_factory: pytest.TempPathFactory, path: tuple[str | int, ...], value: object
) -> None:
    file = write(tmp_path_factory.mktemp('scenario'), changed(path, value))
    try:
        scenario = load_scenario(file)
    except ScenarioError:
        return
    assert scenario_from_json(scenario_json(scenario)) == scenario


@settings(max_examples=100)
@given(text=st.text(alphabet=st.sampled_from('ab:- []{},&*!?|>#"\'\n\t1.e~'), max_size=60))
def test_any_text_is_a_scenario_error(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    with pytest.raises(ScenarioError):
        load_scenario(write(tmp_path_factory.mktemp('scenario'), text))
