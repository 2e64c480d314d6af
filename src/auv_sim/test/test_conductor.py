"""Lockstep without nodes: a conductor and the clients of agents, one of whom has long work."""

from __future__ import annotations

from collections import deque

import pytest
from three_nodes import KINDS, REPLY_NUDGES, heard_by_conductor, odometry, shell, told, word, world

from auv_sim.conductor import NUDGE_S, Addressed, Conductor, Phase
from auv_sim.kernel import run_mission
from auv_sim.radio_model import IDEAL, LinkModel
from msgs_json.agent import Log, Output, Publish, Transmit
from msgs_json.agent_shell import Frame
from msgs_json.guarded_agent import GuardedAgent
from msgs_json.lockstep_client import AgentClient
from msgs_json.messages import (
    Acknowledgement,
    Message,
    PlanningAhead,
)
from msgs_json.node_exit import NodeExit
from msgs_json.ros_messages import Text
from msgs_json.topics import ODOM, RADIO_RX, WORLD_GO, WORLD_TICK

SLICES = 5
"""More than the nudges after which a node that is silent is given up."""


class Speaker:
    """Says what it is told to in the second tick, and is finished when it is answered a 9."""

    def __init__(self, name: str, diary: list[str], *says: tuple[str, int]) -> None:
        self.name = name
        self.peers = frozenset(KINDS)
        self.finished = False
        self.diary = diary
        self._says = says

    def tick(self, now_s: float) -> list[Output]:
        said = [Transmit(dst, word(number)) for dst, number in self._says if now_s == 1.0]
        return [Publish(ODOM, odometry(self.name, now_s)), *said] if self.name != 'c3' else [*said]

    def receive(self, src: str, message: Message, now_s: float) -> list[Output]:
        assert isinstance(message, Acknowledgement)
        self.diary.append(f'{now_s:g} {self.name} hears {message.reference} from {src}')
        self.finished = message.reference == 9
        return []


class HardWorker(Speaker):
    """What C3 says makes it work; when that is done it answers a 9."""

    is_busy = False
    slices = SLICES

    def receive(self, src: str, message: Message, now_s: float) -> list[Output]:
        self.is_busy = src == 'c3'
        return super().receive(src, message, now_s)

    def work(self, now_s: float) -> list[Output]:
        self.diary.append(f'{now_s:g} {self.name} works')
        self.slices -= 1
        self.is_busy = self.slices > 0
        ahead = Log(PlanningAhead(share=1 - self.slices / SLICES), now_s)
        return [ahead] if self.is_busy else [ahead, Transmit('c3', word(9))]


def crew(diary: list[str], *auv_says: tuple[str, int]) -> list[Speaker]:
    c3, auv = Speaker('c3', diary, ('uav', 1)), Speaker('auv_1', diary, *auv_says)
    return [c3, HardWorker('uav', diary), auv]


class Graph:
    """Nodes and world as they are on a graph, with all that is under way in one queue."""

    def __init__(
        self, agents: list[Speaker], *, nudges_per_slice: int = 0, link: LinkModel = IDEAL
    ) -> None:
        self.conductor = Conductor(
            world(link, max_mission_s=5.0), recorder=False, reply_timeout_s=REPLY_NUDGES * NUDGE_S
        )
        self.shown: list[Addressed] = []
        """Everything but lockstep's own messages."""
        self.clients = {
            agent.name: AgentClient(GuardedAgent(shell(agent), lambda _: None), life=1)
            for agent in agents
        }
        self._nudges_per_slice = nudges_per_slice
        self._under_way: deque[Addressed] = deque()
        for name, client in self.clients.items():
            self._from_agent(name, [client.hello()])

    def nudge(self) -> None:
        """Let the world ask again, and everybody answer."""
        self._under_way += self.conductor.nudge()
        self.run()

    def run(self) -> None:
        """Fly the mission to its end, or until everybody waits for ever."""
        while self._under_way or self.conductor.phase is Phase.RESTING:
            if not self._under_way:
                self._under_way += self.conductor.begin_tick()
                continue
            name, frame = self._under_way.popleft()
            assert isinstance(frame.message, Text) or frame.topic.name == '/clock'
            match frame.message:
                case Text(data) if frame.topic is RADIO_RX:
                    self.shown.append((name, frame))
                    self._carry_on(name, self.clients[name].hear(data))
                case Text() if frame.topic in (WORLD_TICK, WORLD_GO):
                    for each, client in self.clients.items():
                        self._carry_on(each, told(client, frame))
                case _:
                    self.shown.append((name, frame))

    def _carry_on(self, name: str, frames: list[Frame]) -> None:
        """Do what a node does after a tick and after a message."""
        client = self.clients[name]
        self._from_agent(name, frames)
        while client.is_busy:
            for _ in range(self._nudges_per_slice):
                self._under_way += self.conductor.nudge()
            self._from_agent(name, client.work())

    def _from_agent(self, name: str, frames: list[Frame]) -> None:
        for frame in frames:
            if not frame.topic.name.startswith('/world/'):
                self.shown.append((name, frame))
            self._under_way += heard_by_conductor(self.conductor, name, frame)


def by_topic(shown: list[Addressed]) -> dict[tuple[str, str], list[Frame]]:
    topics: dict[tuple[str, str], list[Frame]] = {}
    for name, frame in shown:
        topics.setdefault((name, frame.topic.name), []).append(frame)
    return topics


@pytest.mark.parametrize('auv_says', [(), (('uav', 2),)], ids=['alone', 'with_another'])
def test_what_an_agent_works_at_comes_before_all_else_in_one_process_and_in_lockstep(
    auv_says: tuple[tuple[str, int], ...],
) -> None:
    alone: list[str] = []
    frames: list[Addressed] = []
    shells = {agent.name: shell(agent) for agent in crew(alone, *auv_says)}
    run_mission(world(max_mission_s=5.0), shells, lambda name, frame: frames.append((name, frame)))
    assert alone == [
        '1 uav hears 1 from c3',
        *['1 uav works'] * SLICES,
        *[f'1 uav hears {number} from auv_1' for _, number in auv_says],  # in the same round
        '1 c3 hears 9 from uav',
    ]
    diary: list[str] = []
    graph = Graph(crew(diary, *auv_says))
    graph.run()
    assert diary == alone
    assert graph.conductor.verdict == 'complete'
    assert by_topic(graph.shown) == by_topic(frames)


@pytest.mark.parametrize('nudges_per_slice', [1, REPLY_NUDGES - 1])
def test_a_busy_node_may_take_longer_than_the_world_waits_for_a_silent_one(
    nudges_per_slice: int,
) -> None:
    diary: list[str] = []
    graph = Graph(crew(diary), nudges_per_slice=nudges_per_slice)
    graph.run()
    assert diary.count('1 uav works') == SLICES
    assert (graph.conductor.verdict, graph.conductor.exit_code) == ('complete', NodeExit.OK)


def test_a_busy_node_that_falls_silent_is_given_up() -> None:
    graph = Graph(crew([]), nudges_per_slice=REPLY_NUDGES)
    graph.run()
    conductor = graph.conductor
    assert (conductor.phase, conductor.exit_code) == (Phase.ENDED, NodeExit.NODE_MISSING)
    assert 'silent since tick 1 began: uav' in conductor.verdict


# --- a radio that is not ideal -------------------------------------------------------------------


class Chatterbox(Speaker):
    """Speaks at every tick."""

    def tick(self, now_s: float) -> list[Output]:
        return [*super().tick(now_s), *(Transmit(dst, word(1)) for dst, _ in self._says)]


def chatterboxes(diary: list[str]) -> list[Speaker]:
    c3, auv = Chatterbox('c3', diary, ('uav', 1)), Chatterbox('auv_1', diary, ('uav', 2))
    return [c3, Chatterbox('uav', diary, ('c3', 3), ('auv_1', 4)), auv]


@pytest.mark.parametrize(
    'link',
    [
        LinkModel(latency_s=0.3, jitter_s=3.0),
        LinkModel(bytes_per_s=300.0, loss=0.2),
        LinkModel(duplicates=0.5, corruption=0.5),
    ],
    ids=['late', 'slow', 'copies'],
)
def test_the_same_is_heard_over_any_radio_in_one_process_and_in_lockstep(link: LinkModel) -> None:
    alone: list[str] = []
    frames: list[Addressed] = []
    shells = {agent.name: shell(agent) for agent in chatterboxes(alone)}
    run_mission(
        world(link, max_mission_s=5.0), shells, lambda name, frame: frames.append((name, frame))
    )
    diary: list[str] = []
    graph = Graph(chatterboxes(diary), link=link)
    graph.run()
    assert diary == alone
    assert len(alone) > 8
    assert by_topic(graph.shown) == by_topic(frames)


def test_what_the_radio_has_damaged_is_waited_for_too() -> None:
    # Else what comes of it would be logged in one tick or in the next, as chance has it.
    graph = Graph(crew([]), link=LinkModel(corruption=1.0))
    graph.clients['uav'].hear = lambda _: []  # type: ignore[method-assign]  it has not come yet
    graph.run()
    graph.nudge()
    assert graph.conductor.phase is Phase.WORKING
    assert graph.conductor.missing() == ['uav (0 of 1 deliveries are worked off)']
