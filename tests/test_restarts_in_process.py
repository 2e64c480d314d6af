"""
Whole missions in which agents die at any input, and go on from their stores.

As in lockstep no time passes until a new process is there. It is told the open tick, and then what
the dead one had in hand. On an ideal radio the mission is the same, event for event; where a
process dies after it has stored something and before it has said it, that is made up for later.
"""

from __future__ import annotations

import functools
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from random import Random

import pytest

from auv_sim.auv_params import make_auv
from auv_sim.kernel import run_mission
from auv_sim.world import World
from auv_sim.world_params import make_world
from c3_station.c3_params import make_c3
from c3_station.fault_schedule import Moment
from c3_station.faulty_store import FaultyStore, ProcessDied
from c3_station.node_params import mission_params
from c3_station.scenario import Auv, PlannerChoice, Radio, Scenario, Sortie, Uav
from msgs_json import codec
from msgs_json.agent import Agent
from msgs_json.agent_shell import AgentSetting, AgentShell, Frame
from msgs_json.authentication import Authenticator
from msgs_json.drivers import NoPorts
from msgs_json.geometry import GridSpec, Point
from msgs_json.key_file import new_key
from msgs_json.messages import (
    CellEntered,
    Event,
    MessageRefused,
    MissionCompleted,
    PlanningAhead,
    SampleBatch,
    SortieReturned,
)
from msgs_json.ros_messages import Text
from msgs_json.store import MemoryStore
from msgs_json.topics import MISSION_EVENTS, RADIO_RX
from uav_planner.uav_params import make_uav

LIMIT_S = {'ecc2009': 60.0, 'robust': 30.0, 'adaptive': 30.0}
OPTIONS = {'adaptive': {'effort': 'minimal'}}


IDEAL = Radio(range_m=12.0)
POOR = Radio(range_m=12.0, max_message_bytes=720, loss=0.2)
"""A frame holds one sample, and longer messages go in fragments."""


def scenario(planner: str, radio: Radio) -> Scenario:
    surfacing = {'model': 'early', 'probability': 0.3}
    return Scenario(
        name='mortals',
        description='two AUVs that come up where they like',
        region=GridSpec(cols=4, rows=4, cell_m=10.0),
        c3=Point(east_m=20.0, north_m=-30.0),
        uav=Uav(speed_mps=5.0),
        auvs=(
            Auv(name='auv_1', initial_path=((0, 0), (1, 0)), surfacing=surfacing),
            Auv(name='auv_2', initial_path=((3, 3), (2, 3)), surfacing=surfacing),
        ),
        radio=radio,
        # None is given up: where much is lost it may not be heard for many a sortie.
        sortie=Sortie(limit_s=LIMIT_S[planner], lost_after_sorties=1000),
        planner=PlannerChoice(name=planner, path_cells=3, options=OPTIONS.get(planner, {})),
        max_mission_s=5000.0,
    )


class Mortal:
    """
    An agent's shell that dies at some of its inputs, and is made anew from its store.

    Parameters
    ----------
    make
        Makes the shell.
    authenticator
        Of the mission.
    deaths
        By the number of the input, counted from 0.
    world
        Hears how a new process numbers what it says.

    """

    def __init__(
        self,
        make: Callable[[AgentSetting], AgentShell],
        authenticator: Authenticator | None,
        deaths: Mapping[int, Moment],
        world: World,
    ) -> None:
        self.inputs = self.deaths = 0
        self._make = make
        self._deaths = deaths
        self._world = world
        self._store = FaultyStore(MemoryStore())
        self._setting = AgentSetting(store=self._store, authenticator=authenticator)
        self._shell = make(self._setting)

    @property
    def agent(self) -> Agent:
        return self._shell.agent

    @property
    def is_busy(self) -> bool:
        return self._shell.is_busy

    def tick(self, now_s: float) -> list[Frame]:
        return self._survive(lambda: self._shell.tick(now_s), list)

    def receive(self, data: bytes, now_s: float) -> list[Frame]:
        return self._survive(
            lambda: self._shell.receive(data, now_s), lambda: self._shell.tick(now_s)
        )

    def work(self, now_s: float) -> list[Frame]:
        return self._survive(lambda: self._shell.work(now_s), list)

    def _survive(
        self, act: Callable[[], list[Frame]], catch_up: Callable[[], list[Frame]]
    ) -> list[Frame]:
        moment = self._deaths.get(self.inputs)
        self.inputs += 1
        if moment is None:
            return act()
        if moment is not Moment.BEFORE_INPUT:
            self._store.dies = moment
            try:
                return act()  # it lives on where there is nothing to commit
            except ProcessDied:
                pass
            finally:
                self._store.dies = None
        self.deaths += 1
        self._store.reopen()
        self._shell = self._make(self._setting)
        self._world.expect(self.agent.name, self._shell.next_seq)
        return [*catch_up(), *act()]


Deaths = Mapping[str, Mapping[int, Moment]]
"""By agent and number of its input."""


@dataclass(slots=True)
class Mission:
    """What came of a mission."""

    inputs: dict[str, int] = field(default_factory=dict)
    deaths: int = 0
    log: dict[str, dict[int, tuple[float, bytes, Event]]] = field(default_factory=dict)
    """By agent and number of the entry: when what happened; as bytes, too."""
    brought: Counter[tuple[str, int]] = field(default_factory=Counter)
    """How often C3 heard each sample."""

    def note(self, name: str, frame: Frame) -> None:
        if frame.topic not in (MISSION_EVENTS, RADIO_RX):
            return
        assert isinstance(frame.message, Text)
        envelope, body = codec.decode(frame.message.data)
        if isinstance(body, Event):
            # A new process says the last entries again, for it cannot know whether they were said.
            entry = (envelope.stamp, bytes(envelope.body), body)
            log = self.log.setdefault(name, {})
            assert log.setdefault(envelope.seq, entry)[:2] == entry[:2]
        elif isinstance(body, SampleBatch) and name == 'c3':
            self.brought.update((sample.auv, sample.number) for sample in body.samples)

    def told(self) -> dict[str, list[tuple[float, bytes]]]:
        """Return the log without what a new process may have to do again, or is told again."""
        again = (PlanningAhead, MessageRefused)
        return {
            name: [
                (stamp_s, told)
                for stamp_s, told, event in log.values()
                if not isinstance(event, again)
            ]
            for name, log in self.log.items()
        }

    def events(self) -> list[Event]:
        return [event for log in self.log.values() for _, _, event in log.values()]


def fly(planner: str, deaths: Deaths, radio: Radio = IDEAL, *, is_signed: bool = True) -> Mission:
    params = mission_params(scenario(planner, radio))
    authenticator = Authenticator(new_key()) if is_signed else None
    world = make_world(params.world, authenticator)
    makers: dict[str, Callable[[AgentSetting], AgentShell]] = {
        'c3': partial(make_c3, params.c3),
        'uav': partial(make_uav, params.uav, NoPorts()),
    }
    for auv in params.auvs:
        makers[auv.name] = partial(make_auv, auv, NoPorts())
    agents = {
        name: Mortal(make, authenticator, deaths.get(name, {}), world)
        for name, make in makers.items()
    }
    mission = Mission()
    run_mission(world, agents, mission.note)
    mission.inputs = {name: agent.inputs for name, agent in agents.items()}
    mission.deaths = sum(agent.deaths for agent in agents.values())
    return mission


@functools.cache
def undisturbed(planner: str) -> Mission:
    mission = fly(planner, {})
    assert mission.deaths == 0
    check_promises(mission, planner)
    return mission


def some_deaths(planner: str, seed: int, moments: tuple[Moment, ...]) -> Deaths:
    """Return deaths at random inputs of a mission."""
    random = Random(seed)
    inputs = [
        (name, n) for name, count in undisturbed(planner).inputs.items() for n in range(count)
    ]
    deaths: dict[str, dict[int, Moment]] = {}
    for name, number in random.sample(inputs, random.choice([5, 20, 80])):
        deaths.setdefault(name, {})[number] = random.choice(moments)
    return deaths


def check_promises(mission: Mission, planner: str) -> None:
    """Every sample is at C3 and counts once, no log entry is doubled, L is kept."""
    entered = {
        (name, event.sample_number)
        for name, log in mission.log.items()
        for _, _, event in log.values()
        if isinstance(event, CellEntered)
    }
    assert mission.brought.keys() == entered
    (completed,) = (each for each in mission.events() if isinstance(each, MissionCompleted))
    assert completed.samples_delivered == len(entered)
    assert completed.cells_delivered == 16
    assert completed.lost == ()
    if planner != 'ecc2009':
        durations_s = [e.duration_s for e in mission.events() if isinstance(e, SortieReturned)]
        assert max(durations_s) <= LIMIT_S[planner]


SEEDS = [*range(5), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(5, 30))]


@pytest.mark.parametrize('seed', SEEDS)
@pytest.mark.parametrize('planner', LIMIT_S)
def test_who_dies_with_nothing_stored_and_unsaid_leaves_no_trace(planner: str, seed: int) -> None:
    deaths = some_deaths(planner, seed, (Moment.BEFORE_INPUT, Moment.BEFORE_COMMIT))
    mission = fly(planner, deaths)
    assert mission.deaths > 0
    assert mission.told() == undisturbed(planner).told()
    check_promises(mission, planner)


def test_all_may_die_at_every_input() -> None:
    planner = 'robust'
    inputs = undisturbed(planner).inputs
    deaths = {name: dict.fromkeys(range(n), Moment.BEFORE_INPUT) for name, n in inputs.items()}
    mission = fly(planner, deaths)
    assert mission.deaths == sum(inputs.values())
    assert mission.told() == undisturbed(planner).told()


@pytest.mark.parametrize('seed', SEEDS)
@pytest.mark.parametrize('planner', LIMIT_S)
def test_what_was_stored_and_not_said_is_made_up_for(planner: str, seed: int) -> None:
    """Without a key a new process also hears again what the dead one had heard and stored."""
    mission = fly(planner, some_deaths(planner, seed, tuple(Moment)), is_signed=seed % 3 > 0)
    assert mission.deaths > 0
    check_promises(mission, planner)


@pytest.mark.parametrize('seed', SEEDS)
@pytest.mark.parametrize('planner', LIMIT_S)
def test_on_a_poor_radio_the_promises_hold_as_well(planner: str, seed: int) -> None:
    mission = fly(planner, some_deaths(planner, seed, tuple(Moment)), POOR)
    check_promises(mission, planner)
