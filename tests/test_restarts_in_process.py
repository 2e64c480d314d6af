"""
Whole missions in which agents die at any input, and go on from their stores.

As in lockstep no time passes until a new process is there. It is told the open tick, and then what
the dead one had in hand. On an ideal radio the mission is the same, event for event; where a
process dies after it has stored something and before it has said it, that is made up for later.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from itertools import cycle, islice
from random import Random

import pytest
from two_auvs import IDEAL, LIMIT_S, Diary, poor_radio, two_auvs

from c3_station import faults_in_process
from c3_station.fault_schedule import Kill, Moment, NodeFaults
from c3_station.in_process import fly
from c3_station.scenario import Faults, Radio
from msgs_json.agent_shell import AgentSetting
from msgs_json.authentication import Authenticator
from msgs_json.key_file import new_key
from msgs_json.messages import (
    MessageRefused,
    NodeRestarted,
    PlanningAhead,
)
from msgs_json.store import MemoryStore
from msgs_json.topics import CLOCK, RADIO_RX

NAMES = ('auv_1', 'auv_2', 'uav', 'c3')
POOR = poor_radio(loss=0.2)


class Mission(Diary):
    """What comes of a mission in which agents die."""

    def deaths(self) -> int:
        return len(self.events(NodeRestarted))

    def told(self) -> dict[str, list[tuple[float, bytes]]]:
        """Return the log without what a new process may have to do again, or is told again."""
        again = (PlanningAhead, MessageRefused)
        return {
            name: [
                (entry.stamp_s, entry.body)
                for entry in self.log
                if entry.agent == name and not isinstance(entry.event, again)
            ]
            for name in NAMES
        }

    def check_promises(self) -> None:
        assert self.check_completed().cells_delivered == 16


def flown(
    planner: str,
    schedule: Mapping[str, NodeFaults],
    radio: Radio = IDEAL,
    *,
    is_signed: bool = True,
) -> Mission:
    """Return what came of a mission in which agents die by a schedule."""
    # That there are faults is all that counts here.
    scenario = two_auvs(planner, radio=radio, faults=Faults(kills=1))
    mission = Mission(scenario)
    authenticator = Authenticator(new_key()) if is_signed else None

    def setting(_: str) -> AgentSetting:
        return AgentSetting(store=MemoryStore(), authenticator=authenticator)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(faults_in_process, 'fault_schedule', lambda _: schedule)
        fly(scenario, mission, make_setting=setting)
    return mission


@functools.cache
def undisturbed(planner: str) -> Mission:
    mission = flown(planner, {})
    assert mission.deaths() == 0
    mission.check_promises()
    return mission


def some_deaths(planner: str, seed: int, moments: Sequence[Moment]) -> dict[str, NodeFaults]:
    """Return deaths at random times of a mission, of everybody in turn."""
    random = Random(seed)
    end_s = undisturbed(planner).log[-1].stamp_s
    schedule = {name: NodeFaults() for name in NAMES}
    for name in islice(cycle(NAMES), random.choice([5, 20, 80])):
        kill = Kill(
            at_s=random.uniform(0.0, end_s),
            moment=random.choice(moments),
            when_it_hears=random.choice([True, False]),
            hangs=False,
        )
        schedule[name].kills.append(kill)
    for faults in schedule.values():
        faults.kills.sort(key=lambda kill: kill.at_s)
    return schedule


SEEDS = [*range(2), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(2, 30))]


@pytest.mark.parametrize('seed', SEEDS)
@pytest.mark.parametrize('planner', LIMIT_S)
def test_who_dies_with_nothing_stored_and_unsaid_leaves_no_trace(planner: str, seed: int) -> None:
    deaths = some_deaths(planner, seed, (Moment.BEFORE_INPUT, Moment.BEFORE_COMMIT))
    mission = flown(planner, deaths)
    assert mission.deaths() > 0
    assert mission.told() == undisturbed(planner).told()
    mission.check_promises()


def test_all_may_die_at_every_input() -> None:
    planner = 'robust'
    always = Kill(at_s=0.0, moment=Moment.BEFORE_INPUT, when_it_hears=False, hangs=False)
    mission = flown(planner, {name: NodeFaults(kills=[always] * 10_000) for name in NAMES})
    inputs = mission.frames[CLOCK.name] * len(NAMES) + mission.frames[RADIO_RX.name]
    assert mission.deaths() >= inputs
    assert mission.told() == undisturbed(planner).told()


@pytest.mark.parametrize('seed', SEEDS)
@pytest.mark.parametrize('planner', LIMIT_S)
def test_what_was_stored_and_not_said_is_made_up_for(planner: str, seed: int) -> None:
    """Without a key a new process also hears again what the dead one had heard and stored."""
    deaths = some_deaths(planner, seed, [*Moment])
    mission = flown(planner, deaths, is_signed=seed % 3 > 0)
    assert mission.deaths() > 0
    mission.check_promises()


@pytest.mark.parametrize('seed', SEEDS)
@pytest.mark.parametrize('planner', LIMIT_S)
def test_on_a_poor_radio_the_promises_hold_as_well(planner: str, seed: int) -> None:
    flown(planner, some_deaths(planner, seed, [*Moment]), POOR).check_promises()
