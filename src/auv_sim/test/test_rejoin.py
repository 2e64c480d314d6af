"""Nodes that die and come up again, at any moment and with messages in any order."""

from __future__ import annotations

import random
from collections import deque
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import structs
from three_nodes import (
    KINDS,
    REPLY_NUDGES,
    body_of,
    heard_by_conductor,
    odometry,
    shell,
    told,
    word,
    world,
)

from auv_sim.conductor import NUDGE_S, Addressed, Conductor, Phase
from msgs_json import codec
from msgs_json.agent import Output, Publish, Transmit
from msgs_json.agent_shell import Frame
from msgs_json.codec import MessageError
from msgs_json.guarded_agent import GuardedAgent
from msgs_json.lockstep_client import RECORDER, AgentClient, RecorderClient
from msgs_json.messages import (
    Acknowledgement,
    Done,
    Go,
    Hello,
    Message,
    MissionEvent,
    MissionResumed,
    NodeKind,
    NodeRestarted,
    Ready,
    Tick,
    Waiting,
)
from msgs_json.node_exit import NodeExit
from msgs_json.ros_messages import Text
from msgs_json.store import MemoryStore
from msgs_json.topics import (
    MISSION_EVENTS,
    ODOM,
    RADIO_RX,
    RADIO_TX,
    WORLD_DONE,
    WORLD_GO,
    WORLD_HELLO,
    WORLD_READY,
    WORLD_TICK,
    WORLD_WAITING,
)

if TYPE_CHECKING:
    from collections.abc import Callable

REJOIN_NUDGES = 20
ERRANDS = 5
"""What C3 has to tell the UAV, one after another."""
_LOCKSTEP = {topic.name for topic in (WORLD_DONE, WORLD_HELLO, WORLD_READY)}
_KEPT = {topic.name for topic in (WORLD_HELLO, WORLD_READY)}
"""Kept for whoever comes later (transient local)."""


def conductor(
    *,
    recorder: bool = True,
    restarted: tuple[str, ...] = tuple(KINDS),
    reply_nudges: int = REPLY_NUDGES,
) -> Conductor:
    return Conductor(
        world(),
        recorder=recorder,
        reply_timeout_s=reply_nudges * NUDGE_S,
        restarted=restarted,
        rejoin_timeout_s=(reply_nudges + REJOIN_NUDGES - REPLY_NUDGES) * NUDGE_S,
    )


class Errand:
    """C3 tells the UAV number after number, each until it is answered; all know what they knew."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.peers = frozenset(KINDS)
        self.finished = False
        self.heard: list[int] = []
        self.times: list[float] = []

    def tick(self, now_s: float) -> list[Output]:
        self.times.append(now_s)
        match self.name:
            case 'c3':
                return [] if self.finished else [Transmit('uav', word(len(self.heard)))]
            case 'auv_1':
                return [Publish(ODOM, odometry(self.name, now_s)), Transmit('uav', word(100))]
        return [Publish(ODOM, odometry(self.name, now_s))]

    def receive(self, src: str, message: Message, now_s: float) -> list[Output]:
        assert isinstance(message, Acknowledgement)
        assert now_s == self.times[-1]
        if message.reference == len(self.heard):
            self.heard.append(message.reference)
        self.finished = self.name == 'c3' and len(self.heard) == ERRANDS
        return [Transmit('c3', message)] if src == 'c3' else []


@dataclass
class Process:
    """One life of a node, with what is under way from it and to it."""

    client: AgentClient
    inbox: dict[str, deque[Frame]] = field(default_factory=dict)
    """From the world, by topic."""
    to_world: dict[str, deque[Frame]] = field(default_factory=dict)
    """By topic, between which there is no order."""
    to_recorder: dict[str, deque[Frame]] = field(default_factory=dict)
    is_known: bool = False
    """The world has heard its hello, and so hears and reaches it."""
    is_recorded: bool = False
    """The recorder has."""


class Graph:
    """Nodes, world and recorder, in any order that the middleware allows; nodes may die."""

    def __init__(self, rng: random.Random, deaths: int) -> None:
        self.rng = rng
        self.deaths = deaths
        self.conductor = conductor(reply_nudges=10**6)
        self.agents = {name: Errand(name) for name in KINDS}
        self.stores = {name: MemoryStore() for name in KINDS}
        self.processes: dict[str, Process] = {}
        self.dead: list[tuple[str, Process]] = []
        """What they said last may still be on its way to the world."""
        self.recorder = RecorderClient(life=1)
        self.recorder_inbox: deque[Addressed] = deque()
        self.gos: list[Frame] = []
        self.restarts = 0
        self.lives = 1
        self.to_conductor(RECORDER, self.recorder.hello())
        for name in KINDS:
            self.start(name)

    # --- one step after another ------------------------------------------------------------------

    def run(self) -> None:
        """Fly the mission to its end."""
        idle = 0
        for _ in range(20_000):
            if self.conductor.phase is Phase.ENDED:
                return
            steps = self.possible_steps()
            if self.conductor.phase is Phase.RESTING:
                steps.append(self.begin_tick)
            for name in KINDS:
                if name not in self.processes:
                    steps.append(partial(self.start, name))
            if steps:
                idle = 0
                self.rng.choice(steps)()
                if self.rng.random() < 0.02:
                    self.from_world(self.conductor.nudge())
                if self.deaths and self.rng.random() < 0.03:
                    self.kill(self.rng.choice(list(KINDS)))
            else:
                idle += 1
                assert idle <= 3, f'nothing goes on: {self.conductor.missing()}'
                self.from_world(self.conductor.nudge())
        pytest.fail('it takes for ever')

    def possible_steps(self) -> list[Callable[[], None]]:
        steps: list[Callable[[], None]] = []
        for name, process in [*self.processes.items(), *self.dead]:
            steps += [
                *(
                    partial(self.reach_world, name, process, queue)
                    for queue in filter(None, process.to_world.values())
                ),
                *(
                    partial(self.reach_recorder, name, process, queue)
                    for queue in filter(None, process.to_recorder.values())
                ),
            ]
        steps += [
            partial(self.reach_agent, name, queue)
            for name, process in self.processes.items()
            for queue in filter(None, process.inbox.values())
        ]
        if self.recorder_inbox:
            steps.append(self.reach_recorder_from_world)
        return steps

    # --- lives -----------------------------------------------------------------------------------

    def start(self, name: str) -> None:
        guarded = GuardedAgent(shell(self.agents[name], self.stores[name]), lambda _: None)
        self.lives += 1
        process = Process(client=AgentClient(guarded, life=self.lives))
        process.inbox[WORLD_GO.name] = deque(self.gos)
        self.processes[name] = process
        self.publish(name, [process.client.hello()])

    def kill(self, name: str) -> None:
        """End a process: what it sent arrives late, in part, or never."""
        process = self.processes.pop(name, None)
        if process is None:
            return
        self.deaths -= 1
        for queues in (process.to_world, process.to_recorder):
            for queue in queues.values():
                for _ in range(self.rng.randint(0, len(queue))):
                    queue.pop()
        self.dead.append((name, process))
        # Before it is back all has come to the recorder that ever will: that counts by then.
        for queue in process.to_recorder.values():
            while queue:
                self.reach_recorder(name, process, queue)

    def publish(self, name: str, frames: list[Frame]) -> None:
        """Publish; the process may die half-way through."""
        process = self.processes[name]
        for frame in frames:
            if self.deaths and self.rng.random() < 0.02:
                self.kill(name)
                return
            topic = frame.topic.name
            if process.is_known or topic in _KEPT:
                process.to_world.setdefault(topic, deque()).append(frame)
            if topic == WORLD_HELLO.name or (process.is_recorded and topic not in _LOCKSTEP):
                process.to_recorder.setdefault(topic, deque()).append(frame)

    # --- arrivals --------------------------------------------------------------------------------

    def begin_tick(self) -> None:
        for name, process in self.processes.items():
            if process.is_known:
                assert not process.inbox.get(RADIO_RX.name), name
                assert not process.to_world.get(RADIO_TX.name), name
        self.from_world(self.conductor.begin_tick())

    def reach_world(self, name: str, process: Process, queue: deque[Frame]) -> None:
        frame = queue.popleft()
        process.is_known = process.is_known or frame.topic is WORLD_HELLO
        self.to_conductor(name, frame)

    def to_conductor(self, name: str, frame: Frame) -> None:
        with suppress(MessageError):  # what the dead said last may come too late to be of use
            self.from_world(heard_by_conductor(self.conductor, name, frame))

    def from_world(self, output: list[Addressed]) -> None:
        for name, frame in output:
            if frame.topic is MISSION_EVENTS:
                self.restarts += isinstance(body_of(frame), NodeRestarted)
            if frame.topic is WORLD_GO:
                self.gos.append(frame)
            if frame.topic in (WORLD_TICK, WORLD_GO):
                for process in self.processes.values():
                    # Who is not known to the world may hear it all the same.
                    if frame.topic is WORLD_GO or process.is_known or self.rng.random() < 0.5:
                        process.inbox.setdefault(frame.topic.name, deque()).append(frame)
            elif frame.topic is RADIO_RX and name in self.processes:
                process = self.processes[name]
                if process.is_known:
                    process.inbox.setdefault(frame.topic.name, deque()).append(frame)
            self.recorder_inbox.append((name, frame))

    def reach_agent(self, name: str, queue: deque[Frame]) -> None:
        process = self.processes[name]
        frame = queue.popleft()
        assert isinstance(frame.message, Text)
        if frame.topic is RADIO_RX:
            with suppress(MessageError):  # it was meant for the process before
                self.publish(name, process.client.hear(frame.message.data))
            return
        self.publish(name, told(process.client, frame))

    def reach_recorder(self, name: str, process: Process, queue: deque[Frame]) -> None:
        frame = queue.popleft()
        if frame.topic is WORLD_HELLO:
            process.is_recorded = True
            hello = body_of(frame)
            assert isinstance(hello, Hello)
            self.from_recorder(self.recorder.hear_hello(name, hello))
        else:
            self.from_recorder(self.recorder.store(name))

    def reach_recorder_from_world(self) -> None:
        _, frame = self.recorder_inbox.popleft()
        if frame.topic is WORLD_TICK:
            tick = body_of(frame)
            assert isinstance(tick, Tick)
            self.from_recorder(self.recorder.tick(tick))
        elif frame.topic is WORLD_GO:
            go = body_of(frame)
            assert isinstance(go, Go)
            self.from_recorder(self.recorder.go(go))
        elif frame.topic is not WORLD_WAITING:
            self.from_recorder(self.recorder.store('world'))

    def from_recorder(self, frames: list[Frame]) -> None:
        for frame in frames:
            self.to_conductor(RECORDER, frame)


@settings(max_examples=75)
@given(seed=st.integers(0, 2**32), deaths=st.integers(0, 8))
def test_a_mission_goes_on_whoever_dies_and_when(seed: int, deaths: int) -> None:
    graph = Graph(random.Random(seed), deaths)
    graph.run()
    assert (graph.conductor.verdict, graph.conductor.is_cut_short) == ('complete', False)
    assert graph.agents['uav'].heard == graph.agents['c3'].heard == list(range(ERRANDS))
    for agent in graph.agents.values():
        assert agent.times == sorted(agent.times)  # time never goes back
    ticks = {agent.times[-1] for agent in graph.agents.values()}
    assert len(ticks) == 1
    # What the recorder vouches for is really there, of the living at least.
    assert graph.recorder.has_all
    for process in graph.processes.values():
        queues = process.to_recorder.items()
        assert not any(queue for topic, queue in queues if topic != WORLD_HELLO.name)


# --- one thing at a time -------------------------------------------------------------------------


def phase(each: Conductor) -> Phase:
    return each.phase


def hello(life: int) -> Hello:
    return Hello(kind=NodeKind.AGENT, life=life)


def done(life: int, tick: int = 0, **counts: int) -> Done:
    return Done(
        tick=tick,
        received=counts.get('received', 0),
        sent=counts.get('sent', 0),
        published=counts.get('published', 0),
        finished=False,
        life=life,
    )


def said(src: str, dst: str, seq: int) -> bytes:
    return codec.encode(word(seq), src=src, dst=dst, seq=seq, stamp_s=0.0)


def under_way(**options: object) -> Conductor:
    """Return a conductor in the middle of its first tick."""
    each = conductor(recorder=False, **options)  # type: ignore[arg-type]
    for life, name in enumerate(KINDS, start=1):
        each.hello(name, hello(life))
    for name in KINDS:
        each.ready(name, Ready(go=0))
    assert phase(each) is Phase.RESTING
    each.begin_tick()
    return each


def topics(output: list[Addressed]) -> list[str]:
    return [frame.topic.name for _, frame in output]


def events(output: list[Addressed]) -> list[MissionEvent]:
    return [body_of(frame) for _, frame in output if frame.topic is MISSION_EVENTS]  # type: ignore[misc]


def test_deliveries_that_were_not_worked_off_are_delivered_again_once_it_has_ticked() -> None:
    each = under_way()
    first, second = said('c3', 'uav', 0), said('c3', 'uav', 1)
    for payload in (first, second):
        each.said('c3', payload)
    each.done('c3', done(1, sent=2))
    for life, name in ((2, 'uav'), (3, 'auv_1')):
        each.saw(name, odometry(name, 0.0))
        heard = each.done(name, done(life))
    assert heard == [('uav', Frame(RADIO_RX, Text(payload))) for payload in (first, second)]
    each.done('uav', done(2, received=1))
    output = each.hello('uav', hello(9))
    assert events(output) == [NodeRestarted(node='uav', restarts=1)]
    assert topics(output)[-1] == WORLD_GO.name
    assert each.done('uav', done(2, received=2)) == []  # the last word of the dead
    assert topics(each.ready('uav', Ready(go=1))) == [WORLD_TICK.name]
    each.saw('uav', odometry('uav', 0.0))
    assert each.done('uav', done(9)) == [('uav', Frame(RADIO_RX, Text(second)))]
    assert phase(each) is Phase.WORKING
    each.done('uav', done(9, received=1))
    assert phase(each) is Phase.RESTING


def test_what_an_auv_said_before_it_died_is_heard_though_it_has_dived_meanwhile() -> None:
    each = under_way()
    each.done('c3', done(1))
    each.saw('uav', odometry('uav', 0.0))
    each.done('uav', done(2))
    each.saw('auv_1', odometry('auv_1', 0.0))
    answer = said('auv_1', 'uav', 0)
    each.said('auv_1', answer)
    each.hello('auv_1', hello(9))
    each.ready('auv_1', Ready(go=1))
    each.saw('auv_1', odometry('auv_1', 0.0, z_m=-5.0))
    assert each.done('auv_1', done(9)) == [('uav', Frame(RADIO_RX, Text(answer)))]
    each.done('uav', done(2, received=1))
    each.begin_tick()
    for name in ('uav', 'auv_1'):
        each.saw(name, odometry(name, 1.0, z_m=-5.0 if name == 'auv_1' else 0.0))
    each.said('auv_1', said('auv_1', 'uav', 1))  # it is under water now
    each.done('auv_1', done(9, tick=1, sent=1))
    each.done('uav', done(2, tick=1, received=1))
    assert each.done('c3', done(1, tick=1)) == []


def test_while_a_node_is_greeted_no_tick_is_sent() -> None:
    each = under_way()
    assert WORLD_TICK.name in topics(each.nudge())
    each.hello('uav', hello(9))
    assert topics(each.nudge()) == []
    each.ready('uav', Ready(go=0))  # the answer of the dead to the first go
    assert topics(each.nudge()) == []
    each.ready('uav', Ready(go=1))
    assert topics(each.nudge()) == [WORLD_TICK.name]


def test_between_two_ticks_the_next_one_waits_for_a_node_that_is_greeted() -> None:
    each = under_way()
    each.done('c3', done(1))
    for life, name in ((2, 'uav'), (3, 'auv_1')):
        each.saw(name, odometry(name, 0.0))
        each.done(name, done(life))
    assert phase(each) is Phase.RESTING
    each.hello('auv_1', hello(9))
    assert phase(each) is Phase.GREETING
    each.ready('auv_1', Ready(go=1))
    assert phase(each) is Phase.RESTING


@pytest.mark.parametrize('victim', [*KINDS])
def test_a_node_that_dies_before_the_first_tick_is_no_restart(victim: str) -> None:
    each = conductor(recorder=False)
    for name in (victim, *(name for name in KINDS if name != victim)):
        output = each.hello(name, hello(1))
        each.hello(victim, hello(2))
    assert topics(output) == [WORLD_GO.name]
    output = each.hello(victim, hello(3))
    assert topics(output) == [WORLD_GO.name]
    for name in KINDS:
        each.ready(name, Ready(go=0))
    assert phase(each) is Phase.GREETING
    each.ready(victim, Ready(go=1))
    assert phase(each) is Phase.RESTING


def test_a_hello_that_comes_again_or_late_changes_nothing() -> None:
    each = under_way()
    each.hello('uav', hello(9))
    assert each.hello('uav', hello(9)) == []
    assert each.hello('uav', hello(5)) == []


def waiting(output: list[Addressed]) -> list[Waiting]:
    return [body_of(frame) for _, frame in output if frame.topic is WORLD_WAITING]  # type: ignore[misc]


def test_who_is_silent_is_named_again_and_again_and_given_up_in_the_end() -> None:
    each = under_way()
    each.done('c3', done(1))
    each.saw('auv_1', odometry('auv_1', 0.0))
    each.done('auv_1', done(3))
    named = [waiting(each.nudge()) for _ in range(REJOIN_NUDGES - 1)]
    uav = Waiting(lives={'uav': 2}, problem='uav (no answer)')
    assert [number + 1 for number, each_time in enumerate(named) if each_time] == [4, 8, 12, 16]
    assert named[3] == [uav]
    each.nudge()
    assert (each.phase, each.exit_code) == (Phase.ENDED, NodeExit.NODE_MISSING)
    assert each.verdict == 'silent since tick 0 began: uav (no answer)'


def test_who_is_not_restarted_is_given_up_when_it_is_silent() -> None:
    each = under_way(restarted=('c3', 'auv_1'))
    for _ in range(REPLY_NUDGES - 1):
        each.nudge()
    assert phase(each) is Phase.WORKING
    each.nudge()
    assert each.exit_code is NodeExit.NODE_MISSING


def test_an_interrupt_tells_who_was_waited_for() -> None:
    each = under_way()
    for _ in range(REPLY_NUDGES):
        each.nudge()
    each.interrupt()
    assert each.verdict.startswith('interrupted, waiting for c3 (no answer), uav (no answer)')
    fresh = under_way()
    fresh.interrupt()
    assert fresh.verdict == 'interrupted'


def test_a_mission_goes_on_at_the_latest_time_that_anybody_remembers() -> None:
    each = conductor(recorder=False)
    for name, latest_s in (('c3', 3.0), ('uav', 6.5), ('auv_1', 0.0)):
        each.hello(name, Hello(kind=NodeKind.AGENT, life=1, latest_s=latest_s))
    for name in KINDS:
        each.ready(name, Ready(go=0))
    output = each.begin_tick()
    (tick,) = (body_of(frame) for _, frame in output if frame.topic is WORLD_TICK)
    assert tick == Tick(tick=7, time_s=7.0, published=None, go=0)
    assert events(output) == [MissionResumed()]


def test_a_mission_that_begins_is_not_resumed() -> None:
    each = conductor(recorder=False)
    for name in KINDS:
        each.hello(name, hello(1))
    for name in KINDS:
        each.ready(name, Ready(go=0))
    assert events(each.begin_tick()) == []


def test_a_second_go_disturbs_nobody_else() -> None:
    client = AgentClient(GuardedAgent(shell(Errand('uav'), MemoryStore()), lambda _: None), life=2)
    first = Go(number=0, lives={'uav': 2, 'auv_1': 3})
    assert [frame.topic for frame in client.go(first)] == [WORLD_READY]
    assert client.go(Go(number=1, lives={'uav': 2, 'auv_1': 9})) == []


def test_a_node_does_not_tick_before_it_was_greeted_in_this_life() -> None:
    agent = Errand('uav')
    client = AgentClient(GuardedAgent(shell(agent, MemoryStore()), lambda _: None), life=9)
    client.go(Go(number=0, lives={'uav': 2}))  # kept for late-comers, and meant for the dead
    assert client.tick(Tick(tick=4, time_s=4.0, published=None, go=0)) == []
    client.go(Go(number=1, lives={'uav': 9}))
    assert client.tick(Tick(tick=4, time_s=4.0, published=None, go=0)) == []
    assert agent.times == []
    assert client.tick(Tick(tick=4, time_s=4.0, published=None, go=1)) != []


def test_the_recorder_is_asked_for_what_it_holds_of_the_dead_and_not_for_more() -> None:
    each = conductor()
    each.hello(RECORDER, Hello(kind=NodeKind.RECORDER, life=1))
    for life, name in enumerate(KINDS, start=1):
        each.hello(name, hello(life))
    for name in (*KINDS, RECORDER):
        each.ready(name, Ready(go=0))
    tick_after(each, published=100_000)  # so many that the recorder is asked in the next tick
    output = each.begin_tick()
    assert asked(output) == 100_000 + 1
    each.hello('uav', hello(9))
    each.ready('uav', Ready(go=1))
    assert phase(each) is Phase.WORKING
    # The recorder has 60 fewer than were published; and the world has told of the restart.
    output = each.ready(RECORDER, Ready(go=1, stored={'uav': 99_940, 'c3': 7}))
    assert asked(output) == 99_940 + 1 + 1 + 1


def test_what_died_with_a_node_is_not_asked_for_at_the_end_either() -> None:
    each = conductor()
    each.hello(RECORDER, Hello(kind=NodeKind.RECORDER, life=1))
    for life, name in enumerate(KINDS, start=1):
        each.hello(name, hello(life))
    for name in (*KINDS, RECORDER):
        each.ready(name, Ready(go=0))
    output = tick_after(each, published=10, finished=True)
    assert phase(each) is Phase.SAVING
    of_world = 2  # a clock, and the counters of the radio
    assert asked(output) == 10 + of_world
    each.hello('uav', hello(9))
    each.ready('uav', Ready(go=1))
    output = each.ready(RECORDER, Ready(go=1, stored={'uav': 9}))
    assert asked(output) == 9 + of_world + 1  # and the world has told of the restart
    each.done(RECORDER, done(1, received=12))
    assert (phase(each), each.verdict) == (Phase.ENDED, 'complete')


def tick_after(each: Conductor, published: int, *, finished: bool = False) -> list[Addressed]:
    each.begin_tick()
    each.done('c3', structs.replace(done(1), finished=finished))
    output: list[Addressed] = []
    for life, name, count in ((2, 'uav', published), (3, 'auv_1', 0)):
        each.saw(name, odometry(name, 0.0))
        output = each.done(name, done(life, published=count))
    return output


def asked(output: list[Addressed]) -> int | None:
    (tick,) = (body_of(frame) for _, frame in output if frame.topic is WORLD_TICK)
    assert isinstance(tick, Tick)
    return tick.published
