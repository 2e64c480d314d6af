"""Changes to a scenario as they are typed: what they change, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from c3_station.scenario import Scenario
from c3_station.scenario_changes import SURFACING_PRESETS, Change, read_change, read_variants
from c3_station.scenario_files import ScenarioError, load_scenario, with_choices

ECC2009 = load_scenario('ecc2009')
EARLY = {'model': 'early', 'probability': 0.1}


def changed(*texts: str, scenario: Scenario = ECC2009) -> dict[str, Any]:
    changes = [read_change(text) for text in texts]
    content: dict[str, Any] = msgspec.to_builtins(with_choices(scenario, changes=changes))
    return content


def surfacing(*texts: str) -> list[dict[str, Any]]:
    return [auv['surfacing'] for auv in changed(*texts)['auvs']]


# --- what is typed -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('text', 'values'),
    [
        ('sortie.limit_s=50', [50]),
        ('sortie.limit_s=50,60.5, 1e2', [50, 60.5, 100.0]),
        (
            'auvs.surfacing={model: early, probability: 0.1},{model: on_time}',
            [EARLY, {'model': 'on_time'}],
        ),
        (
            'auvs.0.initial_path=[[3, 7], [4, 7]],[[3, 7], [3, 8]]',
            [[[3, 7], [4, 7]], [[3, 7], [3, 8]]],
        ),
        ('region.masked=[[1, 2]],[[1, 2], [3, 4]],[]', [[[1, 2]], [[1, 2], [3, 4]], []]),
        ('name="a, b",c', ['a, b', 'c']),
        ('description=what # it is', ['what']),
    ],
)
def test_values_are_yaml_with_commas_between(text: str, values: list[object]) -> None:
    assert [change.value for change in read_variants(text)] == values


@pytest.mark.parametrize(
    ('text', 'told'),
    [
        ('sortie.limit_s', 'allowed: KEY=VALUE'),
        ('=3', 'allowed: KEY=VALUE'),
        ('sortie..limit_s=3', 'allowed: KEY=VALUE'),
        ('sortie.limit_s=', 'no value'),
        ('sortie.limit_s=[3', 'not YAML'),
        ('sortie.limit_s=3]', 'not YAML'),
        ('sortie.limit_s=3,4,3', 'the value 3 twice'),
        ('auvs.surfacing={model: early, model: slow}', 'is given twice'),
    ],
)
def test_what_cannot_be_read_is_named(text: str, told: str) -> None:
    with pytest.raises(ValueError, match=told) as refused:
        read_variants(text)
    assert text in str(refused.value)


def test_one_value_is_asked_for_where_there_can_be_only_one() -> None:
    with pytest.raises(ValueError, match='has 2 values'):
        read_change('sortie.limit_s=50,60')


plain = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text('abcxyz_', min_size=1), inner),
    max_leaves=6,
)


@given(value=plain)
def test_what_is_printed_reads_back(value: object) -> None:
    change = Change(key='uav.speed_mps', value=value)
    assert '\n' not in str(change)
    assert read_change(str(change)) == change


# --- what they change ----------------------------------------------------------------------------


def test_a_dotted_key_changes_that_key_alone() -> None:
    expected = msgspec.to_builtins(ECC2009)
    expected['sortie']['limit_s'] = 50.0
    expected['pass']['explored_s']['max'] = 500.0
    assert changed('sortie.limit_s=50', 'pass.explored_s.max=500') == expected


def test_below_auvs_a_key_is_for_all_an_index_or_a_name_for_one() -> None:
    on_time = {'model': 'on_time'}
    assert surfacing('auvs.surfacing={model: early, probability: 0.1}') == [EARLY] * 3
    assert surfacing('auvs.1.surfacing={model: early, probability: 0.1}') == [
        on_time,
        EARLY,
        on_time,
    ]
    assert surfacing('auvs.auv_3.surfacing={model: early, probability: 0.1}') == [
        on_time,
        on_time,
        EARLY,
    ]
    assert surfacing(
        'auvs.surfacing={model: early, probability: 0.5}', 'auvs.0.surfacing.probability=0.1'
    )[:2] == [
        EARLY,
        {'model': 'early', 'probability': 0.5},
    ]


@pytest.mark.parametrize('name', SURFACING_PRESETS)
@pytest.mark.parametrize('scenario', ['minimal', 'ecc2009', 'fleet_8'])
def test_every_preset_makes_a_mission(name: str, scenario: str) -> None:
    content = changed(f'surfacing={name}', scenario=load_scenario(scenario))
    models = SURFACING_PRESETS[name]
    for index, auv in enumerate(content['auvs']):
        assert auv['surfacing'] == models[index % len(models)]


def test_a_mixed_fleet_has_each_model() -> None:
    assert [model['model'] for model in surfacing('surfacing=mixed')] == [
        'early',
        'slow',
        'on_time',
    ]


def test_a_relative_path_is_seen_from_where_we_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = [f'{col * 10 + 5},{row * 10 + 5},1.0' for row in range(10) for col in range(10)]
    (tmp_path / 'sst.csv').write_text('\n'.join(['east_m,north_m,value', *rows]))
    monkeypatch.chdir(tmp_path)
    content = changed('field={kind: grid_file, path: sst.csv}')
    assert content['field']['path'] == str(tmp_path / 'sst.csv')


def test_changes_are_made_after_the_planner_is_chosen() -> None:
    tie_order = read_change('planner.options.tie_order=wsen-last')
    other = with_choices(ECC2009, planner='robust')
    chosen = with_choices(other, planner='ecc2009', changes=[tie_order])
    assert chosen.planner == with_choices(ECC2009, changes=[tie_order]).planner
    assert chosen.planner.options == {'tie_order': 'wsen-last'}


def test_land_is_set_as_a_whole() -> None:
    content = changed('region.masked=[[9, 9], [0, 0]]')
    assert content['region']['masked'] == ((9, 9), (0, 0))


# --- what is refused -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('text', 'told'),
    [
        ('sortie.limit_s=-3', 'sortie.limit_s is -3; allowed: a number, more than 0'),
        (
            'sortie.limt_s=3',
            'sortie.limt_s is 3, but there is no such key (did you mean limit_s?)',
        ),
        ('sorti.limit_s=3', '(did you mean sortie?)'),
        ('tick_s.x=3', 'tick_s.x is part of a value, 1.0'),
        ('auvs.speed_mps.x=3', 'auvs[2].speed_mps.x is part of a value, 1.0'),
        ('auvs.0.initial_path.0=[1, 1]', 'auvs[0].initial_path.0 is part of a value'),
        ('region.masked=[1, 2]', 'region.masked[0] is 1; allowed: [a whole number'),
        ('region.masked=[[9, 10]]', 'region.masked[0] is [9, 10], outside the grid'),
        ('region.masked.0=[1, 2]', 'region.masked.0 is part of a value, []; allowed: to set that'),
        ('region.masked=[[8, 9], [9, 8]]', 'or to mask them as well: [9, 9]'),
        ('auvs=3', 'auvs is 3; allowed: a list of 1 to 200'),
        ('auvs.3.speed_mps=1', 'auvs.3 cannot be set; allowed: auvs.KEY for all of them'),
        ('auvs.auv_4.speed_mps=1', 'AUV 0 to 2 or auv_1, auv_2, auv_3'),
        ('auvs.speed=1', 'KEY name, initial_path, speed_mps'),
        ('auvs.0=1', 'auvs.0 cannot be set'),
        ('auvs.0.speed=1', 'auvs[0].speed is 1, but there is no such key'),
        (
            'surfacing=mixd',
            "surfacing is 'mixd' (did you mean mixed?); allowed: on_time, early_10",
        ),
        ('surfacing={model: slow}', 'for a model, set auvs.surfacing'),
        ('auvs.surfacing={model: fast}', 'auvs[0].surfacing cannot be used'),
        ('planner.name=best', "unknown planner 'best'"),
        ('planner.min_path_cells=7', 'allowed: at most path_cells, 6'),
        ('seed=-1', 'seed is -1'),
    ],
)
def test_a_change_that_makes_no_mission_is_refused(text: str, told: str) -> None:
    with pytest.raises(ScenarioError) as refused:
        changed(text)
    assert told in str(refused.value)
    assert str(refused.value).startswith('command line: ')


def test_keys_may_be_right_only_together() -> None:
    content = changed('planner.min_path_cells=7', 'planner.path_cells=8')
    assert content['planner']['min_path_cells'] == 7
