"""
A node's side of lockstep, without I/O: what it answers to the world.

Start-up proves that every message will arrive before the first one is sent. DDS announces the
endpoints of a process in the order of their creation, and a node says hello on the publisher it
makes last, so who hears the hello already knows every publisher of that node; the same holds for
the subscription on which it is heard, if that is made last. So a hello proves the way from the
agent to its hearer, and the world's go the way back.
"""

from __future__ import annotations

from msgs_json.agent_shell import Frame, Speaker
from msgs_json.codec import MessageError, Refusal
from msgs_json.guarded_agent import GuardedAgent
from msgs_json.messages import Done, Go, Hello, NodeKind, Ready, Tick
from msgs_json.topics import RADIO_TX, WORLD_DONE, WORLD_HELLO, WORLD_READY

RECORDER = 'recorder'
"""The recorder's name in lockstep; no agent may have it."""


class AgentClient:
    """
    Ticks an agent as the world says, and counts what it has worked off and sent.

    Each method returns what is to be published, in order. While the agent is busy after one of
    them, `work` is to be called before any other.
    """

    def __init__(self, agent: GuardedAgent) -> None:
        self._agent = agent
        self._speaker = Speaker(agent.name)
        self._nodes: frozenset[str] = frozenset()
        """Everybody in this world."""
        self._tick: Tick | None = None
        self._received = 0
        self._sent = 0
        self._published = 0

    def hello(self) -> Frame:
        """Return the hello; all publishers and subscriptions must exist."""
        return self._speaker.frame(WORLD_HELLO, Hello(kind=NodeKind.AGENT), 0.0)

    @property
    def is_busy(self) -> bool:
        """Return whether the agent has work left to do."""
        return self._agent.is_busy

    def go(self, go: Go) -> list[Frame]:
        """
        Answer that the world was heard.

        Raises
        ------
        MessageError
            The world does not know this agent.

        """
        self._nodes = frozenset(go.nodes)
        return [_ready(self._speaker, self._agent.name, go)]

    def tick(self, tick: Tick) -> list[Frame]:
        """
        Tick the agent once per tick number; a repeated tick is answered from the counts.

        A tick in which its vehicle fails is not answered but tried again when it is repeated.
        """
        if self._tick is not None and tick.tick < self._tick.tick:
            return []
        frames: list[Frame] = []
        if self._tick is None or tick.tick > self._tick.tick or self._agent.is_behind:
            self._tick = tick
            frames = self._counted(self._agent.tick(tick.time_s))
        return [*frames, *self._done(tick)]

    def hear(self, data: bytes) -> list[Frame]:
        """
        Hand the agent what came by radio.

        Raises
        ------
        MessageError
            It came before the first tick, so not from the world.

        """
        if self._tick is None:
            raise MessageError(
                Refusal.NOT_ADDRESSED, '?', 'nothing is heard before the first tick'
            )
        frames = self._counted(self._agent.receive(data, self._tick.time_s))
        # What somebody else put on the topic must not count in the barrier.
        self._received += self._agent.genuine_from in self._nodes
        return [*frames, *self._done(self._tick)]

    def work(self) -> list[Frame]:
        """Let the agent do a slice of its work; the world hears that it goes on, or is over."""
        if self._tick is None:
            return []
        return [*self._counted(self._agent.work(self._tick.time_s)), *self._done(self._tick)]

    def _counted(self, frames: list[Frame]) -> list[Frame]:
        for frame in frames:
            self._published += 1
            if frame.topic is RADIO_TX:
                self._sent += 1
        return frames

    def _done(self, tick: Tick) -> list[Frame]:
        if self._agent.is_behind:
            return []  # else the world could go on with these counts while the next try is made
        done = Done(
            tick=tick.tick,
            received=self._received,
            sent=self._sent,
            published=self._published,
            finished=self._agent.finished,
            busy=self._agent.is_busy,
        )
        return [self._speaker.frame(WORLD_DONE, done, tick.time_s)]


class RecorderClient:
    """
    Answers the world once everything is stored that has been published.

    It says that it is ready when it has heard all agents: then nothing that they publish can pass
    it by. In its `Done`, ``received`` is the number of messages stored.
    """

    def __init__(self) -> None:
        self.has_all = False
        """Whether the mission is over and everything that was published in it is stored."""
        self._speaker = Speaker(RECORDER)
        self._heard = {RECORDER}
        self._go: Go | None = None
        self._stored = 0
        self._tick: Tick | None = None
        self._is_asked = False
        """Whether the world waits for an answer to this tick."""
        self._is_last = False

    def hello(self) -> Frame:
        """Return the hello; all publishers and subscriptions must exist."""
        return self._speaker.frame(WORLD_HELLO, Hello(kind=NodeKind.RECORDER), 0.0)

    def hear_hello(self, src: str) -> list[Frame]:
        """Note that everything an agent publishes arrives here."""
        self._heard.add(src)
        return self._say_ready()

    def go(self, go: Go) -> list[Frame]:
        """Note whom the world expects; raises `MessageError` where this is not the recorder's."""
        self._go = go
        return self._say_ready()

    def tick(self, tick: Tick) -> list[Frame]:
        """
        Answer at once, or later from `store`; ticks that ask nothing are not answered.

        Where the world asks anew within a tick, that tick was its last.
        """
        before, self._tick = self._tick, tick
        self._is_asked = tick.published is not None
        self._is_last = self._is_last or (
            before is not None and before.tick == tick.tick and before.published != tick.published
        )
        return self._say_done()

    def store(self) -> list[Frame]:
        """Note that one more message has come; it must be stored before an answer is sent."""
        self._stored += 1
        return self._say_done() if self._is_asked else []

    def _say_ready(self) -> list[Frame]:
        if self._go is None or not self._heard.issuperset(self._go.nodes):
            return []
        return [_ready(self._speaker, RECORDER, self._go)]

    def _say_done(self) -> list[Frame]:
        tick = self._tick
        if tick is None or tick.published is None or self._stored < tick.published:
            return []
        self._is_asked, self.has_all = False, self._is_last
        done = Done(tick=tick.tick, received=self._stored, sent=0, published=0, finished=False)
        return [self._speaker.frame(WORLD_DONE, done, tick.time_s)]


def _ready(speaker: Speaker, name: str, go: Go) -> Frame:
    if name not in go.nodes:
        raise MessageError(
            Refusal.NOT_ADDRESSED,
            'world',
            f'the world runs {", ".join(go.nodes)}, this is {name}',
        )
    return speaker.frame(WORLD_READY, Ready(), 0.0)
