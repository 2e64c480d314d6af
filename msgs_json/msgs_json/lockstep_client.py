"""
A node's side of lockstep, without I/O: what it answers to the world.

Start-up proves that every message will arrive before the first one is sent. DDS announces the
endpoints of a process in the order of their creation, and a node says hello on the publisher it
makes last, so who hears the hello already knows every publisher of that node; the same holds for
the subscription on which it is heard, if that is made last. So a hello proves the way from the
agent to its hearer, and the world's go the way back.

A node may die and come up again while the mission is under way. Its hello begins another life, of
which nothing counts that came before; the world answers with another go, which the recorder
answers too, and holds the open tick until then.
"""

from __future__ import annotations

from collections import Counter

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

    def __init__(self, agent: GuardedAgent, *, life: int) -> None:
        """
        Begin before the first tick.

        Parameters
        ----------
        agent
            It must be as it was left by its former life, where it had one.
        life
            Microseconds on the steady clock.

        """
        self._agent = agent
        self._life = life
        self._speaker = Speaker(agent.name)
        self._nodes: frozenset[str] = frozenset()
        """Everybody in this world."""
        self._go: int | None = None
        """Number of the go that was the first for this life."""
        self._tick: Tick | None = None
        self._asked_for = 0
        """What the agent had logged before the tick, if the recorder is waited for in it."""
        self._received = 0
        self._noise = 0
        self._sent = 0
        self._published = 0

    def hello(self) -> Frame:
        """Return the hello; all publishers and subscriptions must exist."""
        hello = Hello(
            kind=NodeKind.AGENT,
            life=self._life,
            next_seq=self._agent.next_seq,
            latest_s=self._agent.latest_s,
        )
        return self._speaker.frame(WORLD_HELLO, hello, 0.0)

    @property
    def is_busy(self) -> bool:
        """Return whether the agent has work left to do."""
        return self._agent.is_busy

    def go(self, go: Go) -> list[Frame]:
        """
        Answer that the world was heard; a go for a former life, or for others, is not answered.

        Raises
        ------
        MessageError
            The world does not know this agent.

        """
        if self._agent.name not in go.lives:
            raise _not_meant(self._agent.name, go)
        if go.lives[self._agent.name] != self._life or self._go is not None:
            return []
        self._nodes, self._go = frozenset(go.lives), go.number
        return [self._speaker.frame(WORLD_READY, Ready(go=go.number), 0.0)]

    def tick(self, tick: Tick) -> list[Frame]:
        """
        Tick the agent once per tick number; a repeated tick is answered from the counts.

        A tick in which its vehicle fails is not answered but tried again when it is repeated.
        """
        if self._go is None or tick.go < self._go:
            return []  # not everybody can hear this agent yet
        if tick.last:
            return []  # it concerns the recorder alone
        if self._tick is not None and tick.tick < self._tick.tick:
            return []
        frames: list[Frame] = []
        if self._tick is None or tick.tick > self._tick.tick:
            # The world goes on only when the recorder has what it was asked for in the last one.
            self._agent.recorded(self._asked_for)
            if tick.published is not None:
                self._asked_for = self._agent.logged
            self._tick = tick
            frames = self._counted(self._agent.tick(tick.time_s))
        elif self._agent.is_behind:
            self._tick = tick
            frames = self._counted(self._agent.tick(tick.time_s))
        return [*frames, *self._done(tick)]

    def hear(self, data: bytes) -> list[Frame]:
        """
        Hand the agent what came by radio.

        Raises
        ------
        MessageError
            It came before the first tick: it is not from the world, or was meant for the former
            life and will be delivered again.

        """
        if self._tick is None:
            raise MessageError(
                Refusal.NOT_ADDRESSED, '?', 'nothing is heard before the first tick'
            )
        frames = self._counted(self._agent.receive(data, self._tick.time_s))
        # What somebody else put on the topic must not count in the barrier.
        is_genuine = self._agent.genuine_from in self._nodes
        self._received += is_genuine
        self._noise += not is_genuine
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
            noise=self._noise,
            sent=self._sent,
            published=self._published,
            finished=self._agent.finished,
            life=self._life,
            busy=self._agent.is_busy,
        )
        return [self._speaker.frame(WORLD_DONE, done, tick.time_s)]


class RecorderClient:
    """
    Answers the world once everything is stored that has been published.

    It says that it is ready when it has heard all agents: then nothing that they publish can pass
    it by. In its `Done`, ``received`` is the number of messages stored.
    """

    def __init__(self, *, life: int, latest_s: float = 0.0) -> None:
        """Begin; ``latest_s`` is the time of the last message that was recorded before."""
        self.has_all = False
        """Whether the mission is over and everything that was published in it is stored."""
        self._life = life
        self._latest_s = latest_s
        self._speaker = Speaker(RECORDER)
        self._heard = {RECORDER: life}
        """The latest life of everybody."""
        self._go: Go | None = None
        """One that is not answered yet."""
        self._stored: Counter[str] = Counter()
        """Messages by node."""
        self._tick: Tick | None = None
        self._is_asked = False
        """Whether the world waits for an answer to this tick."""

    def hello(self) -> Frame:
        """Return the hello; all publishers and subscriptions must exist."""
        hello = Hello(kind=NodeKind.RECORDER, life=self._life, latest_s=self._latest_s)
        return self._speaker.frame(WORLD_HELLO, hello, 0.0)

    def hear_hello(self, src: str, hello: Hello) -> list[Frame]:
        """Note that everything an agent publishes in this life arrives here."""
        self._heard[src] = max(self._heard.get(src, 0), hello.life)
        return self._say_ready()

    def go(self, go: Go) -> list[Frame]:
        """Note whom the world expects; raises `MessageError` where this is not the recorder's."""
        if RECORDER not in go.lives:
            raise _not_meant(RECORDER, go)
        self._go = go
        return self._say_ready()

    def tick(self, tick: Tick) -> list[Frame]:
        """Answer at once, or later from `store`; ticks that ask nothing are not answered."""
        self._tick, self._is_asked = tick, tick.published is not None
        return self._say_done()

    def store(self, src: str) -> list[Frame]:
        """Note one more message of a node; it must be stored before an answer is sent."""
        self._stored[src] += 1
        return self._say_done() if self._is_asked else []

    def _say_ready(self) -> list[Frame]:
        go = self._go
        # Of a life that is over already no hello comes any more; the next one's will do.
        if go is None or any(self._heard.get(name, -1) < life for name, life in go.lives.items()):
            return []
        self._go = None
        ready = Ready(go=go.number, stored=dict(self._stored))
        return [self._speaker.frame(WORLD_READY, ready, 0.0)]

    def _say_done(self) -> list[Frame]:
        tick, stored = self._tick, self._stored.total()
        if tick is None or tick.published is None or stored < tick.published:
            return []
        self._is_asked, self.has_all = False, tick.last
        done = Done(
            tick=tick.tick,
            received=stored,
            sent=0,
            published=0,
            finished=False,
            life=self._life,
        )
        return [self._speaker.frame(WORLD_DONE, done, tick.time_s)]


def _not_meant(name: str, go: Go) -> MessageError:
    return MessageError(
        Refusal.NOT_ADDRESSED, 'world', f'the world runs {", ".join(go.lives)}, this is {name}'
    )
