"""
Whole missions in which agents die at any input, and go on from their stores.

As in lockstep no time passes until a new process is there. It is told the open tick, and then what
the dead one had in hand. On an ideal radio the mission is the same, event for event; where a
process dies after it has stored something and before it has said it, that is made up for later.
"""

from __future__ import annotations

import functools
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import cycle, islice
from random import Random

import pytest
from msgspec.structs import replace

from auv_sim.world import WORLD
from c3_station import faults_in_process
from c3_station.fault_schedule import Kill, Moment, NodeFaults
from c3_station.in_process import fly
from c3_station.scenario import Auv, Faults, PlannerChoice, Radio, Scenario, Sortie, Uav
from msgs_json import codec
from msgs_json.agent_shell import AgentSetting, Frame
from msgs_json.authentication import Authenticator
from msgs_json.geometry import GridSpec, Point
from msgs_json.key_file import new_key
from msgs_json.messages import (
    CellEntered,
    Event,
    MessageRefused,
    MissionCompleted,
    NodeRestarted,
    PlanningAhead,
    SampleBatch,
    SortieReturned,
)
from msgs_json.ros_messages import Text
from msgs_json.store import MemoryStore
from msgs_json.topics import CLOCK, MISSION_EVENTS, RADIO_RX

LIMIT_S = {'ecc2009': 60.0, 'robust': 30.0, 'adaptive': 30.0}
NAMES = ('auv_1', 'auv_2', 'uav', 'c3')
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


@dataclass(slots=True)
class Mission:
    """What came of a mission."""

    ticks: int = 0
    heard: int = 0
    """How many messages came to somebody by radio."""
    log: dict[str, dict[int, tuple[float, bytes, Event]]] = field(default_factory=dict)
    """By agent and number of the entry: when what happened; as bytes, too."""
    brought: Counter[tuple[str, int]] = field(default_factory=Counter)
    """How often C3 heard each sample."""

    def note(self, name: str, frame: Frame) -> None:
        self.ticks += frame.topic is CLOCK
        self.heard += frame.topic is RADIO_RX
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
            if name != WORLD  # which tells who was restarted
        }

    def deaths(self) -> int:
        return sum(isinstance(event, NodeRestarted) for event in self.events())

    def events(self) -> list[Event]:
        return [event for log in self.log.values() for _, _, event in log.values()]


def flown(
    planner: str,
    schedule: Mapping[str, NodeFaults],
    radio: Radio = IDEAL,
    *,
    is_signed: bool = True,
) -> Mission:
    """Return what came of a mission in which agents die by a schedule."""
    mission = Mission()
    authenticator = Authenticator(new_key()) if is_signed else None

    def setting(_: str) -> AgentSetting:
        return AgentSetting(store=MemoryStore(), authenticator=authenticator)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(faults_in_process, 'fault_schedule', lambda _: schedule)
        # That there are faults is all that counts here.
        faulty = replace(scenario(planner, radio), faults=Faults(kills=1))
        fly(faulty, mission.note, make_setting=setting)
    return mission


@functools.cache
def undisturbed(planner: str) -> Mission:
    mission = flown(planner, {})
    assert mission.deaths() == 0
    check_promises(mission, planner)
    return mission


def some_deaths(planner: str, seed: int, moments: Sequence[Moment]) -> dict[str, NodeFaults]:
    """Return deaths at random times of a mission, of everybody in turn."""
    random = Random(seed)
    mission = undisturbed(planner)
    end_s = max(stamp_s for log in mission.log.values() for stamp_s, _, _ in log.values())
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
    mission = flown(planner, deaths)
    assert mission.deaths() > 0
    assert mission.told() == undisturbed(planner).told()
    check_promises(mission, planner)


def test_all_may_die_at_every_input() -> None:
    planner = 'robust'
    always = Kill(at_s=0.0, moment=Moment.BEFORE_INPUT, when_it_hears=False, hangs=False)
    mission = flown(planner, {name: NodeFaults(kills=[always] * 10_000) for name in NAMES})
    assert mission.deaths() >= mission.ticks * len(NAMES) + mission.heard
    assert mission.told() == undisturbed(planner).told()


@pytest.mark.parametrize('seed', SEEDS)
@pytest.mark.parametrize('planner', LIMIT_S)
def test_what_was_stored_and_not_said_is_made_up_for(planner: str, seed: int) -> None:
    """Without a key a new process also hears again what the dead one had heard and stored."""
    deaths = some_deaths(planner, seed, [*Moment])
    mission = flown(planner, deaths, is_signed=seed % 3 > 0)
    assert mission.deaths() > 0
    check_promises(mission, planner)


@pytest.mark.parametrize('seed', SEEDS)
@pytest.mark.parametrize('planner', LIMIT_S)
def test_on_a_poor_radio_the_promises_hold_as_well(planner: str, seed: int) -> None:
    check_promises(flown(planner, some_deaths(planner, seed, [*Moment]), POOR), planner)
