"""
Three kinds of agents over a radio that loses, repeats and delays what is said.

Whatever it does, every sample that an AUV takes arrives at C3, and counts there once; and with a
planner that guarantees the sortie limit that is kept.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest
from msgspec.structs import replace
from two_auvs import Diary, two_auvs

from auv_sim.kernel import run_mission
from auv_sim.radio_channel import Delivery
from auv_sim.world_params import make_world
from c3_station.in_process import make_agents
from c3_station.node_params import mission_params
from c3_station.scenario import Scenario
from msgs_json import codec
from msgs_json.agent_shell import AgentSetting
from msgs_json.authentication import Authenticator
from msgs_json.key_file import new_key
from msgs_json.messages import (
    Acknowledged,
    Acknowledgement,
)
from msgs_json.randomness import agent_rng
from msgs_json.store import MemoryStore

DELAY_S = 10.0
"""The longest delay; the surface margin below covers it, so that no leg ends between two cells."""


def said_s(delivery: Delivery) -> float:
    return codec.open_envelope(delivery.payload).stamp


def link_of(delivery: Delivery) -> tuple[str, str]:
    return codec.open_envelope(delivery.payload).src, delivery.receiver


class BadRadio:
    """
    A gate that loses, repeats and delays what the channel lets through.

    A late copy comes up to `DELAY_S` after its original, if sender and receiver are in touch then.
    """

    def __init__(
        self,
        gate: Callable[[], list[Delivery]],
        seed: int,
        *,
        loss: float,
        repeat: float,
        late: float,
    ) -> None:
        self._gate = gate
        self._rng = agent_rng(seed, 'bad radio')
        self._loss, self._repeat, self._late = loss, repeat, late
        self._delayed: list[Delivery] = []

    def __call__(self) -> list[Delivery]:
        heard: list[Delivery] = []
        for delivery in self._gate():
            now_s = said_s(delivery)
            self._delayed = [each for each in self._delayed if now_s - said_s(each) <= DELAY_S]
            in_touch = [each for each in self._delayed if link_of(each) == link_of(delivery)]
            if in_touch and self._happens(0.5):
                self._delayed.remove(in_touch[0])
                heard.append(in_touch[0])
            if self._happens(self._late):
                self._delayed.append(delivery)
            if not self._happens(self._loss):
                heard.append(delivery)
            while self._happens(self._repeat):
                heard.append(delivery)
        return heard

    def _happens(self, probability: float) -> bool:
        return bool(self._rng.random() < probability)


LIMIT_S = {'ecc2009': 60.0, 'robust': 27.0}
"""Of a sortie, by planner; for ``robust`` it binds."""


def storm(seed: int, planner: str) -> Scenario:
    mission = two_auvs(planner, seed=seed, max_mission_s=20_000.0)
    sortie = replace(mission.sortie, limit_s=LIMIT_S[planner], surface_margin_s=DELAY_S)
    return replace(mission, sortie=sortie)


def flown(mission: Scenario, *, is_signed: bool, loss: float, repeat: float, late: float) -> Diary:
    params = mission_params(mission)
    world = make_world(params.world)
    gate = BadRadio(world.gate, mission.seed, loss=loss, repeat=repeat, late=late)
    world.gate = gate  # type: ignore[method-assign]
    authenticator = Authenticator(new_key()) if is_signed else None

    def setting(_: str) -> AgentSetting:
        return AgentSetting(store=MemoryStore(), authenticator=authenticator)

    diary = Diary(mission)
    run_mission(world, make_agents(params, setting), diary)
    return diary


SEEDS = [*range(2), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(2, 10))]


@pytest.mark.parametrize(
    ('loss', 'repeat', 'late'),
    [(0.1, 0.0, 0.0), (0.5, 0.0, 0.0), (0.0, 0.5, 0.0), (0.0, 0.0, 0.3), (0.3, 0.3, 0.1)],
    ids=['some_loss', 'much_loss', 'repeats', 'late_copies', 'everything'],
)
@pytest.mark.parametrize('seed', SEEDS)
@pytest.mark.parametrize('planner', LIMIT_S)
def test_every_sample_arrives_and_counts_once(
    planner: str, seed: int, loss: float, repeat: float, late: float
) -> None:
    # Without a key agents hear every copy; with one, only the first of each.
    mission = storm(seed, planner)
    diary = flown(mission, is_signed=seed % 2 == 1, loss=loss, repeat=repeat, late=late)
    assert diary.check_completed().cells_delivered == 16


def test_the_bad_radio_of_this_test_is_bad() -> None:
    # Else the test above could not fail.
    order = Acknowledgement(acknowledges=Acknowledged.MISSION_ORDER, reference=0)
    said = [
        codec.encode(order, src='c3', dst='uav', seq=number, stamp_s=float(number))
        for number in range(200)
    ]
    sent = [Delivery('uav', payload, is_intact=True) for payload in said]
    radio = BadRadio(lambda: sent, 1, loss=0.3, repeat=0.3, late=0.1)
    heard = [codec.open_envelope(delivery.payload).seq for delivery in radio()]
    times_heard = Counter(heard)
    assert 20 < sum(times_heard[number] == 0 for number in range(200)) < 80
    assert max(times_heard.values()) >= 3
    assert np.any(np.diff(heard) < 0)  # out of order
