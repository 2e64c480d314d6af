from __future__ import annotations

import pytest

from auv_sim.world_params import WorldParams, make_world


@pytest.mark.parametrize(
    ('outages', 'said'),
    [
        ('', ["radio_outages is ''"]),
        ('{}', ["radio_outages is '{}'", 'array']),
        ('[{"station": "auv_1"}]', ['missing required field `from_s`', '$[0]']),
        (
            '[{"station": "auv_1", "from_s": -1, "until_s": 2}]',
            ['-1', '$[0].from_s', '>= 0'],
        ),
        (
            '[{"station": "auv_1", "from_s": 3, "until_s": 2}]',
            ['until_s is 2; allowed: at least 3', '$[0]'],
        ),
        ('[{"station": "auv_1", "from_s": 3, "to_s": 4}]', ['unknown field `to_s`']),
        (
            '[{"station": "auv_9", "from_s": 3, "until_s": 4}]',
            ["station is 'auv_9'", 'c3, uav, auv_1, auv_2, auv_3'],
        ),
    ],
)
def test_outages_that_cannot_be_are_refused(outages: str, said: list[str]) -> None:
    with pytest.raises(ValueError, match='parameter radio_outages') as refused:
        make_world(WorldParams(radio_outages=outages))
    assert [part for part in said if part not in str(refused.value)] == []


@pytest.mark.parametrize(
    ('links', 'said'),
    [
        ('{}', ["radio_links is '{}'", 'array']),
        ('[{"to": "uav"}]', ['missing required field `from`', '$[0]']),
        ('[{"from": "auv_1", "to": "uav", "loss": 2}]', ['<= 1', '$[0].loss']),
        ('[{"from": "auv_1", "to": "uav", "lost": 1}]', ['unknown field `lost`']),
        ('[{"from": "auv_9", "to": "uav"}]', ["[0].from is 'auv_9'", 'c3, uav, auv_1']),
        ('[{"from": "auv_1", "to": "c3"}]', ["[0].to is 'c3'", 'never hears auv_1']),
        ('[{"from": "uav", "to": "uav"}]', ["[0].to is 'uav'", 'never hears uav']),
        ('[{"from": "c3", "to": "uav"}, {"from": "c3", "to": "uav"}]', ['[1].to', 'before']),
    ],
)
def test_links_that_cannot_be_are_refused(links: str, said: list[str]) -> None:
    with pytest.raises(ValueError, match='parameter radio_links') as refused:
        make_world(WorldParams(radio_links=links))
    assert [part for part in said if part not in str(refused.value)] == []


def test_a_link_model_that_cannot_be_is_refused() -> None:
    with pytest.raises(ValueError, match=r'parameter radio_link is .*unknown field `los`'):
        make_world(WorldParams(radio_link='{"los": 0.5}'))


def test_names_must_differ() -> None:
    with pytest.raises(ValueError, match='names must differ, are c3, uav, auv_1, uav'):
        make_world(WorldParams(auvs=('auv_1', 'uav')))
