"""What a scenario says about uncertain AUVs and the wind arrives where it works."""

from __future__ import annotations

import copy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import pytest
import yaml

from auv_sim.radio_model import RadioOutage
from auv_sim.surfacing import surfacing_model
from c3_station.in_process import fly
from c3_station.node_params import mission_params
from c3_station.scenario_files import ScenarioError, load_scenario, shipped_scenarios
from msgs_json import codec
from msgs_json.agent_shell import Frame
from msgs_json.messages import RadioStatus
from msgs_json.params import validated
from msgs_json.ros_messages import Odometry, Text
from msgs_json.topics import ODOM, RADIO_RX, RADIO_STATUS, RADIO_TX

ECC2009 = yaml.safe_load(shipped_scenarios()['ecc2009'].read_text())

MODELS: list[dict[str, Any]] = [
    {'model': 'on_time'},
    {'model': 'early', 'probability': 0.1},
    {'model': 'slow', 'least_factor': 0.5},
    {'model': 'slow', 'current_east_mps': 0.2, 'current_north_mps': -0.1},
    {'model': 'abort', 'at_s': 200},
    {'model': 'lost', 'from_s': 200},
    {'model': 'silent', 'from_s': 100, 'sorties': 2},
]


def changed(change: Callable[[dict[str, Any]], object]) -> dict[str, Any]:
    content = copy.deepcopy(ECC2009)
    change(content)
    return content


def write(folder: Path, content: dict[str, Any]) -> Path:
    file = folder / 'mission.yaml'
    file.write_text(yaml.safe_dump(content))
    return file


def fleet(*models: dict[str, Any]) -> dict[str, Any]:
    """Return the reference mission with an AUV for each model."""
    return changed(
        lambda content: content.update(
            auvs=[
                {'name': f'auv_{number}', 'initial_path': [[number, 7], [number, 8]]}
                | {'surfacing': model}
                for number, model in enumerate(models)
            ]
        )
    )


def test_any_mix_of_models_goes_to_the_auvs(tmp_path: Path) -> None:
    params = mission_params(load_scenario(write(tmp_path, fleet(*MODELS))))
    for auv, model in zip(params.auvs, MODELS, strict=True):
        assert surfacing_model(auv.surfacing) == surfacing_model(
            msgspec.json.encode(model).decode()
        )


def test_the_radio_of_silent_auvs_is_dead_for_as_many_sortie_limits(tmp_path: Path) -> None:
    also = {'model': 'silent', 'from_s': 0, 'sorties': 1000}
    params = mission_params(load_scenario(write(tmp_path, fleet(*MODELS, also))))
    outages = msgspec.json.decode(params.world.radio_outages, type=list[RadioOutage])
    assert outages == [
        RadioOutage(station='auv_6', from_s=100.0, until_s=220.0),
        RadioOutage(station='auv_7', from_s=0.0, until_s=60_000.0),
    ]
    validated(type(params.world), msgspec.to_builtins(params.world))
    assert mission_params(load_scenario('ecc2009')).world.radio_outages == '[]'


def test_the_wind_goes_to_the_uav_alone(tmp_path: Path) -> None:
    wind = {'wind_east_mps': 1.5, 'wind_north_mps': -2.0}
    content = changed(lambda content: content['uav'].update(wind))
    params = mission_params(load_scenario(write(tmp_path, content)))
    assert (params.uav.wind_east_mps, params.uav.wind_north_mps) == (1.5, -2.0)


@pytest.mark.parametrize(
    ('model', 'said'),
    [
        ({'model': 'sunk'}, ["'sunk'", '"lost", from_s']),
        ({'model': 'slow', 'least_factor': 0}, ['$.least_factor', '> 0']),
        ({'model': 'abort'}, ['missing required field `at_s`', '{"model": "abort", at_s}']),
        ({'model': 'silent', 'from_s': 5, 'sorties': 0}, ['$.sorties', '>= 1']),
        ([], ['auvs[2].surfacing is []', 'keys and values']),
    ],
)
def test_a_model_that_cannot_be_is_refused_with_its_place(
    tmp_path: Path, model: object, said: list[str]
) -> None:
    content = changed(lambda content: content['auvs'][2].update(surfacing=model))
    with pytest.raises(ScenarioError, match=r'line \d+: auvs\[2\].surfacing') as refused:
        load_scenario(write(tmp_path, content))
    assert [part for part in said if part not in str(refused.value)] == []


@pytest.mark.parametrize(
    ('wind', 'said'),
    [
        (
            {'wind_east_mps': 4},
            'uav.wind_east_mps and wind_north_mps make a wind of 4 m/s; allowed: .* speed_mps, 4 ',
        ),
        ({'wind_east_mps': -3, 'wind_north_mps': 4}, 'make a wind of 5 m/s'),
        ({'wind_north_mps': 101}, r'uav.wind_north_mps is 101; allowed: a number'),
    ],
)
def test_a_wind_that_nothing_can_fly_in_is_refused(
    tmp_path: Path, wind: dict[str, float], said: str
) -> None:
    content = changed(lambda content: content['uav'].update(wind))
    with pytest.raises(ScenarioError, match=said):
        load_scenario(write(tmp_path, content))


def test_a_silent_auv_surfaces_and_calls_and_nobody_hears(tmp_path: Path) -> None:
    content = changed(lambda content: content['auvs'][1].update(surfacing=MODELS[-1]))
    content['max_mission_s'] = 400.0
    calls_s: list[float] = []
    heard_s: list[float] = []
    up_s: list[float] = []
    blocked: list[dict[str, int]] = []

    def watch(name: str, frame: Frame) -> None:
        match frame.message:
            case Odometry(stamp_s=now_s, z_m=z_m) if frame.topic is ODOM and name == 'auv_2':
                if z_m == 0.0:
                    up_s.append(now_s)
            case Text(data) if frame.topic in (RADIO_TX, RADIO_RX):
                envelope = codec.open_envelope(data)
                if frame.topic is RADIO_TX and name == 'auv_2':
                    calls_s.append(envelope.stamp)
                elif frame.topic is RADIO_RX and 'auv_2' in (envelope.src, envelope.dst):
                    heard_s.append(envelope.stamp)
            case Text(data) if frame.topic is RADIO_STATUS:
                body = codec.decode(data)[1]
                assert isinstance(body, RadioStatus)
                blocked.append(body.blocked)

    fly(load_scenario(write(tmp_path, content)), watch)
    assert any(100.0 <= now_s < 220.0 for now_s in up_s)
    assert {now_s for now_s in up_s if 100.0 <= now_s < 220.0} <= set(calls_s)
    assert any(now_s < 100.0 for now_s in heard_s)
    assert any(now_s >= 220.0 for now_s in heard_s)
    assert not any(100.0 <= now_s < 220.0 for now_s in heard_s)
    assert blocked[-1]['loss'] > 0
