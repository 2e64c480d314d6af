from __future__ import annotations

import hypothesis.strategies as st
import msgspec
import numpy as np
import pytest
from hypothesis import given

from auv_sim.surfacing import (
    Abort,
    Early,
    LegFate,
    Lost,
    OnTime,
    Silent,
    Slow,
    SurfacingModel,
    surfacing_model,
)
from msgs_json.straight_motion import Flow

MODELS = [
    ('{"model": "on_time"}', OnTime()),
    ('{"model": "early", "probability": 0.1}', Early(probability=0.1)),
    ('{"model": "slow", "least_factor": 0.5}', Slow(least_factor=0.5)),
    (
        '{"model": "slow", "current_east_mps": 0.5, "current_north_mps": -0.25}',
        Slow(least_factor=1.0, current_east_mps=0.5, current_north_mps=-0.25),
    ),
    ('{"model": "abort", "at_s": 200}', Abort(at_s=200.0)),
    ('{"model": "lost", "from_s": 0}', Lost(from_s=0.0)),
    ('{"model": "silent", "from_s": 100, "sorties": 2}', Silent(from_s=100.0, sorties=2)),
]


@pytest.mark.parametrize(('spec', 'model'), MODELS)
def test_models_are_named_in_json_and_go_back_to_it(spec: str, model: SurfacingModel) -> None:
    assert surfacing_model(spec) == model
    assert surfacing_model(msgspec.json.encode(model).decode()) == model


@pytest.mark.parametrize(
    ('spec', 'parts'),
    [
        ('{"model": "eary"}', ['eary', '$.model', '"on_time"', '"early"', '"silent"']),
        ('{"model": "early"}', ['probability', 'missing']),
        ('{"model": "early", "probability": 1.5}', ['$.probability', '1.5', '<= 1']),
        ('{"model": "early", "probability": -0.1}', ['$.probability', '-0.1', '>= 0']),
        ('{"model": "early", "probability": "often"}', ['$.probability', 'often', 'float']),
        ('{"model": "early", "probability": NaN}', ['NaN', 'probability']),
        ('{"model": "on_time", "probability": 0.1}', ['unknown field `probability`']),
        ('{"model": "slow", "least_factor": 0}', ['$.least_factor', '> 0', '"slow"']),
        ('{"model": "slow", "least_factor": 1.5}', ['$.least_factor', '1.5', '<= 1']),
        ('{"model": "slow", "current_east_mps": -101}', ['$.current_east_mps', '>= -100']),
        ('{"model": "slow", "current_north_mps": 1e300}', ['$.current_north_mps', '<= 100']),
        ('{"model": "slow", "current_mps": 1}', ['unknown field `current_mps`']),
        ('{"model": "abort"}', ['missing required field `at_s`', '"abort", at_s']),
        ('{"model": "abort", "at_s": -1}', ['$.at_s', '-1', '>= 0']),
        ('{"model": "abort", "at_s": 1e8}', ['$.at_s', '<= 10000000']),
        ('{"model": "lost"}', ['missing required field `from_s`']),
        ('{"model": "lost", "from_s": null}', ['$.from_s', 'null', 'float']),
        ('{"model": "silent", "from_s": 5}', ['missing required field `sorties`']),
        ('{"model": "silent", "from_s": 5, "sorties": 0}', ['$.sorties', '0', '>= 1']),
        ('{"model": "silent", "from_s": 5, "sorties": 1.5}', ['$.sorties', '1.5', 'int']),
        ('{}', ['missing required field `model`']),
        ('[]', ['`object`']),
        ('', ["''", '"on_time"']),
        ('{"model": ', ['"early"']),
    ],
)
def test_bad_model_is_refused_with_field_value_and_allowed(spec: str, parts: list[str]) -> None:
    with pytest.raises(ValueError, match=r'^surfacing is ') as refused:
        surfacing_model(spec)
    assert type(refused.value) is ValueError
    assert [part for part in parts if part not in str(refused.value)] == []


def test_only_the_model_that_was_meant_is_shown() -> None:
    with pytest.raises(ValueError, match='allowed is') as refused:
        surfacing_model('{"model": "silent", "from_s": 5}')
    allowed = str(refused.value).partition('allowed is ')[2]
    assert allowed == '{"model": "silent", from_s, sorties}'


@given(st.text())
def test_any_text_is_a_model_or_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r'(?s)^surfacing is '):
        surfacing_model(text)


@given(probability=st.floats(0, 1), waypoints=st.integers(1, 1000), seed=st.integers(0, 2**32))
def test_early_chooses_a_cell_before_the_last(
    probability: float, waypoints: int, seed: int
) -> None:
    fate = Early(probability=probability).draw(waypoints, np.random.default_rng(seed))
    assert fate.surfaces_at is None or 0 <= fate.surfaces_at < waypoints


def test_early_keeps_its_probability_and_favours_no_cell() -> None:
    rng = np.random.default_rng(5)
    fates = [Early(probability=0.3).draw(6, rng).surfaces_at for _ in range(6000)]
    came_up = [place for place in fates if place is not None]
    assert 0.27 < len(came_up) / len(fates) < 0.33  # 5 standard deviations
    shares = np.bincount(came_up, minlength=6) / len(came_up)
    assert np.all(np.abs(shares - 1 / 6) < 0.045)  # 5 standard deviations


def test_slow_draws_a_speed_between_its_bounds_and_favours_none() -> None:
    rng = np.random.default_rng(5)
    factors = [Slow(least_factor=0.6).draw(6, rng).speed_factor for _ in range(4000)]
    assert 0.6 <= min(factors) < 0.605
    assert 0.995 < max(factors) <= 1.0
    quarters = np.histogram(factors, bins=4, range=(0.6, 1.0))[0] / len(factors)
    assert np.all(np.abs(quarters - 0.25) < 0.035)  # 5 standard deviations


def test_a_current_alone_leaves_the_speed_through_the_water_as_it_is() -> None:
    model = Slow(current_east_mps=0.5, current_north_mps=-0.25)
    fate = model.draw(6, np.random.default_rng(5))
    assert fate == LegFate(speed_factor=1.0, current=Flow(east_mps=0.5, north_mps=-0.25))


@pytest.mark.parametrize(
    'models',
    [
        [Early(probability=probability) for probability in (0.0, 0.5, 1.0)],
        [Slow(least_factor=0.1), Slow(), Slow(current_east_mps=3.0)],
    ],
    ids=['early', 'slow'],
)
def test_every_leg_takes_the_same_number_of_draws(models: list[SurfacingModel]) -> None:
    states = set()
    for model in models:
        for waypoints in (1, 6):
            rng = np.random.default_rng(2)
            model.draw(waypoints, rng)
            states.add(str(rng.bit_generator.state))
    assert len(states) == 1


@pytest.mark.parametrize(
    ('model', 'fate'),
    [
        (OnTime(), LegFate()),
        (Abort(at_s=20.0), LegFate(needs_help_s=20.0)),
        (Lost(from_s=20.0), LegFate(lost_s=20.0)),
        (Silent(from_s=20.0, sorties=1), LegFate()),
    ],
)
def test_what_is_certain_draws_nothing(model: SurfacingModel, fate: LegFate) -> None:
    rng = np.random.default_rng(2)
    before = rng.bit_generator.state
    assert model.draw(6, rng) == fate
    assert rng.bit_generator.state == before


def test_draws_of_early_are_those_of_the_golden_missions() -> None:
    rng = np.random.default_rng(3)
    places = [Early(probability=0.5).draw(6, rng).surfaces_at for _ in range(12)]
    assert places == [1, None, 2, 0, None, 3, 3, None, 3, None, 5, 1]
