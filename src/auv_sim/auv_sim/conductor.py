"""
The world's side of lockstep, without I/O: holds each tick until everybody has worked it off.

The order of everything that matters is the kernel's: all agents tick; then the radio in rounds,
each gated in agent order, until nobody says anything more; then the next tick. Messages may arrive
in any order between topics, so nothing is concluded from arrival: `Done` says how many messages an
agent has sent and worked off, and the conductor waits until as many have arrived here, and as many
were delivered. An agent whose `Done` says that it is busy is not silent, however long it takes.
What somebody else puts on an agent's topics is gated like the rest but does not count, since it
does not continue the agent's sequence.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass, field

from auv_sim.world import HARD_STOP, WORLD, World
from msgs_json import codec
from msgs_json.agent_shell import Frame, Speaker
from msgs_json.codec import MessageError, Refusal
from msgs_json.geometry import TIME_TOLERANCE_S
from msgs_json.lockstep_client import RECORDER
from msgs_json.messages import Done, Go, Hello, NodeKind, Ready, Tick
from msgs_json.node_exit import NodeExit
from msgs_json.ros_messages import Odometry, Text
from msgs_json.topics import RADIO_RX, WORLD_GO, WORLD_TICK, Qos

Addressed = tuple[str, Frame]
"""A frame with the name of the agent (or world) in whose namespace it is published."""

NUDGE_S = 0.5
"""Wall time between nudges: an open tick is sent again this often (`ros_wheels`' measure)."""

RECORDER_BACKLOG = Qos.STREAM.value.depth // 4
"""
The recorder is waited for whenever this many messages were published since the last time.

So even if all of them were on one topic its queue is a quarter full, and one tick of 200 AUVs
fills no more than another half. With three AUVs that is every 40 ticks, with fifty every 4.
"""


class Phase(enum.Enum):
    """Where the conductor stands."""

    GATHERING = 'waiting for every node to come up'
    GREETING = 'waiting for every node to hear the world'
    RESTING = 'a tick is over, the next has not begun'
    WORKING = 'a tick is open'
    SAVING = 'the mission is over, the recorder not yet through'
    ENDED = 'over'


@dataclass(slots=True)
class _Agent:
    """What the conductor knows of an agent."""

    is_vehicle: bool
    done: Done = field(
        default_factory=lambda: Done(tick=0, received=0, sent=0, published=0, finished=False)
    )
    said: int = 0
    """Messages of its own that have arrived from ``radio/tx``."""
    waiting: list[bytes] = field(default_factory=list)
    """What arrived from ``radio/tx`` and is not gated yet."""
    delivered: int = 0
    seen: bool = False
    """Its odometry of the open tick is here."""
    answered: bool = False
    """Its `Done` of the open tick is here."""

    def is_settled(self) -> bool:
        """Return whether everything it did in the open tick is known here."""
        return (
            self.answered
            and (self.seen or not self.is_vehicle)
            and self.said >= self.done.sent
            and self.done.received >= self.delivered
        )

    def lacks(self) -> str:
        """Return what is not known here yet, in words."""
        if not self.answered:
            return 'no answer'
        if self.is_vehicle and not self.seen:
            return 'no odometry'
        if self.said < self.done.sent:
            return f'{self.said} of {self.done.sent} radio messages have arrived'
        return f'{self.done.received} of {self.delivered} deliveries are worked off'


class Conductor:
    """
    Takes what nodes say to the world, and returns what the world is to publish.

    Raises
    ------
    ValueError
        An agent has the name of the recorder or of the world.

    """

    def __init__(
        self,
        world: World,
        *,
        recorder: bool,
        start_timeout_s: float = 0.0,
        reply_timeout_s: float = 10.0,
    ) -> None:
        reserved = {RECORDER, WORLD}.intersection(world.order)
        if reserved:
            raise ValueError(f'no agent can be called {" or ".join(sorted(reserved))}')
        self.phase = Phase.GATHERING
        self.exit_code = NodeExit.OK
        self.is_cut_short = False
        """Whether the mission ended without the recorder's word that it holds everything."""
        self.verdict = ''
        """How the mission ended, for people."""
        self._world = world
        self._speaker = Speaker(WORLD)
        self._agents = {name: _Agent(is_vehicle=name != world.c3) for name in world.order}
        self._has_recorder = recorder
        self._nodes = (*world.order, RECORDER) if recorder else world.order
        self._missing = set(self._nodes)
        """Nodes that what is under way waits for."""
        self._tick = Tick(tick=0, time_s=0.0, published=None)
        self._next_tick = 0
        self._published = 0
        """Messages that the world itself has published on recorded topics."""
        self._asked_for = 0
        """Messages that the recorder was last asked to hold."""
        self._start_nudges = start_timeout_s / NUDGE_S
        self._reply_nudges = reply_timeout_s / NUDGE_S
        self._silent_nudges = 0

    def missing(self) -> list[str]:
        """Return whom the conductor waits for, in agent order, each with what is missing."""
        names = [name for name in self._nodes if name in self._missing]
        if self.phase is not Phase.WORKING:
            return names
        return [
            f'{name} ({self._agents[name].lacks()})' if name in self._agents else name
            for name in names
        ]

    # --- start-up --------------------------------------------------------------------------------

    def hello(self, src: str, hello: Hello) -> list[Addressed]:
        """Take a hello; the last one is answered with go."""
        kind = NodeKind.RECORDER if src == RECORDER else NodeKind.AGENT
        if src not in self._nodes or hello.kind is not kind:
            raise _not_expected(src, f'a {hello.kind.value}', self._nodes)
        if self.phase is not Phase.GATHERING:
            return []
        self._found(src)
        if self._missing:
            return []
        self._wait_for(Phase.GREETING, self._nodes)
        return [(WORLD, self._speaker.frame(WORLD_GO, Go(nodes=self._nodes), 0.0))]

    def ready(self, src: str, ready: Ready) -> list[Addressed]:
        """Take a ready; after the last one the first tick can begin."""
        if src not in self._nodes:
            raise _not_expected(src, 'a node', self._nodes)
        if self.phase is Phase.GREETING:
            self._found(src)
            if not self._missing:
                self.phase = Phase.RESTING
        return []

    # --- a tick ----------------------------------------------------------------------------------

    def begin_tick(self) -> list[Addressed]:
        """Open the next tick; only in phase RESTING."""
        self._world.tick, self._next_tick = self._next_tick, self._next_tick + 1
        for agent in self._agents.values():
            agent.seen = agent.answered = False
        total = self._total_published()
        behind = self._has_recorder and total - self._asked_for >= RECORDER_BACKLOG
        self._open(Phase.WORKING, self._nodes if behind else self._world.order, total, behind)
        return [*self._shown([self._world.clock()]), (WORLD, self._tick_frame())]

    def saw(self, name: str, odometry: Odometry) -> list[Addressed]:
        """Take a vehicle's true pose."""
        agent = self._agents[name]
        if self.phase is not Phase.WORKING or agent.seen:
            raise MessageError(Refusal.MALFORMED, name, 'one odometry is due for each tick')
        if abs(odometry.stamp_s - self._tick.time_s) > TIME_TOLERANCE_S:
            raise MessageError(
                Refusal.MALFORMED,
                name,
                f'odometry is of {odometry.stamp_s} s, the tick of {self._tick.time_s} s',
            )
        agent.seen = True
        self._world.see(name, odometry)
        return self._settle(name)

    def said(self, name: str, payload: bytes) -> list[Addressed]:
        """Take what an agent says by radio."""
        agent = self._agents[name]
        agent.waiting.append(payload)
        if _continues(payload, name, agent.said):
            agent.said += 1
        return self._settle(name)

    def done(self, src: str, done: Done) -> list[Addressed]:
        """Take a node's word that it has worked off everything so far."""
        if src == RECORDER and self._has_recorder:
            return self._recorder_done(done)
        agent = self._agents.get(src)
        if agent is None:
            raise _not_expected(src, 'a node', self._nodes)
        if done.tick != self._tick.tick or self.phase is not Phase.WORKING:
            return []  # the answer to a tick that was sent again
        if done.busy:
            self._silent_nudges = 0
            return []
        before = agent.done
        if done.received < before.received or done.sent < before.sent:
            raise MessageError(
                Refusal.MALFORMED, src, 'its counts went back: was the node started anew?'
            )
        agent.done, agent.answered = done, True
        return self._settle(src)

    def nudge(self) -> list[Addressed]:
        """
        Send an open tick again, or give up on nodes that are silent for too long.

        To be called every `NUDGE_S` of wall time.
        """
        if self.phase in (Phase.RESTING, Phase.ENDED):
            return []
        self._silent_nudges += 1
        if self.phase in (Phase.GATHERING, Phase.GREETING):
            if 0 < self._start_nudges <= self._silent_nudges:
                return self._give_up('did not come up')
            return []
        if self._silent_nudges >= self._reply_nudges:
            return self._give_up(f'silent since tick {self._tick.tick} began')
        return [(WORLD, self._tick_frame())]

    def interrupt(self) -> list[Addressed]:
        """End a mission that is under way."""
        is_under_way = self.phase in (Phase.RESTING, Phase.WORKING)
        self.phase = Phase.ENDED
        return self._cut_short('interrupted') if is_under_way else []

    # --- rounds ----------------------------------------------------------------------------------

    def _settle(self, name: str) -> list[Addressed]:
        if name not in self._missing or self.phase is not Phase.WORKING:
            return []
        if not self._agents[name].is_settled():
            return []
        self._found(name)
        return [] if self._missing else self._next_round()

    def _recorder_done(self, done: Done) -> list[Addressed]:
        if RECORDER not in self._missing or done.received < self._asked_for:
            return []
        self._found(RECORDER)
        if self.phase is Phase.SAVING:
            self.phase = Phase.ENDED
            return []
        return [] if self._missing else self._next_round()

    def _next_round(self) -> list[Addressed]:
        """Gate what was said; when nobody hears anything any more the tick is over."""
        said = [
            (name, payload) for name, agent in self._agents.items() for payload in agent.waiting
        ]
        for agent in self._agents.values():
            agent.waiting.clear()
        heard = self._world.gate(said)
        if not heard:
            return self._end_tick()
        for name, _ in heard:
            self._agents[name].delivered += 1
            self._missing.add(name)
        self._published += len(heard)
        return [(name, Frame(RADIO_RX, Text(payload))) for name, payload in heard]

    def _end_tick(self) -> list[Addressed]:
        if self._agents[self._world.c3].done.finished:
            self.verdict = 'complete'
            return self._end([])
        if self._world.time_is_up:
            return self._end([self._stopped(HARD_STOP)])
        self.phase = Phase.RESTING
        return []

    def _end(self, last_words: list[Frame]) -> list[Addressed]:
        """End the mission as the kernel does; the recorder must hold it all before it is over."""
        output = self._shown([*last_words, *self._world.radio_status()])
        if not self._has_recorder:
            self.phase = Phase.ENDED
            return output
        self._open(Phase.SAVING, (RECORDER,), self._total_published(), True)
        return [*output, (WORLD, self._tick_frame())]

    def _give_up(self, problem: str) -> list[Addressed]:
        reason = f'{problem}: {", ".join(self.missing())}'
        node = next(name for name in self._nodes if name in self._missing)
        self.phase, self.exit_code = Phase.ENDED, NodeExit.NODE_MISSING
        return self._cut_short(reason, node)

    def _cut_short(self, reason: str, node: str | None = None) -> list[Addressed]:
        self.is_cut_short = True
        return self._shown([self._stopped(reason, node)])

    def _stopped(self, reason: str, node: str | None = None) -> Frame:
        self.verdict = reason
        return self._world.stopped(reason, node)

    # --- what is under way -----------------------------------------------------------------------

    def _open(self, phase: Phase, nodes: tuple[str, ...], total: int, ask: bool) -> None:
        """Open a tick, or ask the recorder once more within the last one."""
        if ask:
            self._asked_for = total
        self._tick = Tick(
            tick=self._world.tick, time_s=self._world.now_s, published=total if ask else None
        )
        self._wait_for(phase, nodes)

    def _wait_for(self, phase: Phase, nodes: tuple[str, ...]) -> None:
        self.phase, self._missing, self._silent_nudges = phase, set(nodes), 0

    def _found(self, name: str) -> None:
        self._missing.discard(name)
        self._silent_nudges = 0

    def _tick_frame(self) -> Frame:
        return self._speaker.frame(WORLD_TICK, self._tick, self._tick.time_s)

    def _shown(self, frames: list[Frame]) -> list[Addressed]:
        self._published += len(frames)
        return [(WORLD, frame) for frame in frames]

    def _total_published(self) -> int:
        return self._published + sum(agent.done.published for agent in self._agents.values())


def _continues(payload: bytes, name: str, seq: int) -> bool:
    """Return whether a payload is what its agent says next."""
    try:
        envelope = codec.open_envelope(payload)
    except MessageError:
        return False
    return envelope.src == name and envelope.seq == seq


def _not_expected(src: str, what: str, nodes: tuple[str, ...]) -> MessageError:
    return MessageError(
        Refusal.UNKNOWN_SENDER, src, f'{what} of this mission must be one of {", ".join(nodes)}'
    )
