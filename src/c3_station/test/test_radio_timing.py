"""How often messages are said at a time: on any link, in good times and in bad ones."""

from __future__ import annotations

import hypothesis.strategies as st
import pytest
from hypothesis import given
from msgspec.structs import replace

from auv_sim.radio_model import Bursts, Link, LinkModel, LossOverDistance
from c3_station.node_params import mission_params
from c3_station.radio_checks import copies_said
from c3_station.radio_timing import COPIES_MAX, LOST_MAX, copies
from c3_station.scenario import Radio, Scenario
from c3_station.scenario_files import load_scenario

ECC = load_scenario('ecc2009')
STATIONS = ('c3', 'uav', 'auv_1', 'auv_2', 'auv_3')


def with_radio(**changes: object) -> Scenario:
    return replace(ECC, radio=Radio(range_m=20.0, **changes))


def test_on_an_ideal_radio_everything_is_said_once() -> None:
    assert [copies(ECC, name) for name in STATIONS] == [1] * 5
    assert copies_said(ECC) is None


@pytest.mark.parametrize(
    ('changes', 'number'),
    [
        ({'loss': 0.01}, 1),
        ({'loss': 0.1}, 2),
        ({'loss': 0.3}, 4),  # 0.3 ** 4 is 0.0081
        ({'corruption': 0.3}, 4),
        ({'loss': 0.9}, COPIES_MAX),
        ({'loss': LossOverDistance(at_zero=0.0, at_range=0.3)}, 4),
        ({'loss': LossOverDistance(at_zero=0.0, at_range=1.0)}, COPIES_MAX),
        ({'loss': 0.3, 'bytes_per_s': 1e4}, 1),
        # A copy said in the same bad time is lost as well.
        ({'bursts': Bursts(good_s=60.0, bad_s=5.0)}, 1),
        ({'loss': 0.3, 'bursts': Bursts(good_s=60.0, bad_s=5.0)}, 4),
        ({'loss': 1.0}, 1),
        # Half of each copy in a tenth of the time: 0.1 * 0.5 ** 4 is 0.00625.
        ({'bursts': Bursts(good_s=9.0, bad_s=1.0, loss=0.5)}, 4),
        # 0.9 * 0.2 ** 3 + 0.1 * 0.6 ** 3 is 0.029, with 4 copies 0.0144, with 5 0.0081.
        ({'loss': 0.2, 'bursts': Bursts(good_s=9.0, bad_s=1.0, loss=0.5)}, 5),
    ],
    ids=repr,
)
def test_everything_is_said_so_often_that_nearly_all_is_heard(
    changes: dict[str, object], number: int
) -> None:
    assert [copies(with_radio(**changes), name) for name in STATIONS] == [number] * 5


def test_each_station_says_it_as_often_as_the_worst_of_its_links_needs() -> None:
    links = (
        Link(speaker='auv_2', receiver='uav', loss=0.5),
        Link(speaker='uav', receiver='auv_3', loss=0.3),
        Link(speaker='c3', receiver='uav', loss=0.0),
    )
    scenario = with_radio(loss=0.1, links=links)
    assert [copies(scenario, name) for name in STATIONS] == [1, 4, 2, 7, 2]
    params = mission_params(scenario)
    agents = (params.c3, params.uav, *params.auvs)
    assert [agent.copies for agent in agents] == [1, 4, 2, 7, 2]
    assert copies_said(scenario) == (
        'the radio loses so much that each message is said several times at once:'
        ' uav 4, auv_1 2, auv_2 7, auv_3 2'
    )


def test_a_slow_link_of_a_station_keeps_it_from_repeating_itself_on_all() -> None:
    # Its radio sends one frame after another, to whomever.
    links = (Link(speaker='uav', receiver='auv_3', bytes_per_s=1e4),)
    scenario = with_radio(loss=0.3, links=links)
    assert [copies(scenario, name) for name in STATIONS] == [4, 1, 4, 4, 4]


shares = st.floats(0.0, 0.99)
bursts = st.builds(Bursts, good_s=st.floats(1.0, 100.0), bad_s=st.floats(1.0, 100.0), loss=shares)


@given(link=st.builds(LinkModel, loss=shares, corruption=shares, bursts=st.none() | bursts))
def test_one_of_all_copies_is_heard_unless_they_would_be_too_many(link: LinkModel) -> None:
    given_values = {name: getattr(link, name) for name in ('loss', 'corruption', 'bursts')}
    number = copies(with_radio(**given_values), 'c3')

    def unheard(said: int) -> float:
        good = (1.0 - link.loss_at(1.0)) * (1.0 - link.corruption)
        if link.bursts is None:
            return (1.0 - good) ** said
        bad, bad_share = good * (1.0 - link.bursts.loss), link.bursts.bad_share
        return (1.0 - bad_share) * (1.0 - good) ** said + bad_share * (1.0 - bad) ** said

    assert 1 <= number <= COPIES_MAX
    assert number == COPIES_MAX or unheard(number) <= LOST_MAX * 1.000001
    assert number == 1 or unheard(number - 1) > LOST_MAX
