from __future__ import annotations

import hypothesis.strategies as st
import msgspec
import numpy as np
import pytest
from hypothesis import given

from auv_sim.surfacing import Early, LegFate, OnTime, surfacing_model


def test_models_are_named_in_json() -> None:
    assert surfacing_model('{"model": "on_time"}') == OnTime()
    assert surfacing_model('{"model": "early", "probability": 0.1}') == Early(probability=0.1)


@pytest.mark.parametrize(
    ('spec', 'parts'),
    [
        ('{"model": "eary"}', ['eary', '$.model', '"on_time"', '"early"']),
        ('{"model": "early"}', ['probability', 'missing']),
        ('{"model": "early", "probability": 1.5}', ['$.probability', '1.5', '<= 1']),
        ('{"model": "early", "probability": -0.1}', ['$.probability', '-0.1', '>= 0']),
        ('{"model": "early", "probability": "often"}', ['$.probability', 'often', 'float']),
        ('{"model": "early", "probability": NaN}', ['NaN', 'probability']),
        ('{"model": "on_time", "probability": 0.1}', ['unknown field `probability`']),
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


def test_every_leg_takes_the_same_number_of_draws() -> None:
    states = set()
    for probability in (0.0, 0.5, 1.0):
        for waypoints in (1, 6):
            rng = np.random.default_rng(2)
            Early(probability=probability).draw(waypoints, rng)
            states.add(str(rng.bit_generator.state))
    assert len(states) == 1


def test_on_time_draws_nothing() -> None:
    rng = np.random.default_rng(2)
    before = rng.bit_generator.state
    assert OnTime().draw(6, rng) == LegFate(surfaces_at=None)
    assert rng.bit_generator.state == before


def test_models_go_back_to_the_same_json() -> None:
    model = Early(probability=0.25)
    assert surfacing_model(msgspec.json.encode(model).decode()) == model
