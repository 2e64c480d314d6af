"""
The world's side of lockstep, without I/O: holds each tick until everybody has worked it off.

The order of everything that matters is the kernel's: all agents tick; then the radio in rounds,
each gated in agent order, until nobody says anything more; then the next tick. Messages may arrive
in any order between topics, so nothing is concluded from arrival: `Done` says how many messages an
agent has sent and worked off, and the conductor waits until as many have arrived here, and as many
were delivered. An agent whose `Done` says that it is busy is not silent, however long it takes.
What somebody else puts on an agent's topics does not count: the radio tells whether what is said
is the agent's own, and the agent whether what it hears is sound. Copies that the radio corrupted
may or may not be sound for who hears them, so those are waited for with all else that was heard.

An agent may die at any moment and come up again: its hello begins another life. Time stands still
until everybody knows of it (another go, which it and the recorder answer); then the open tick is
sent again, its counts begin anew, and what it had not worked off is delivered again.
"""

from __future__ import annotations

import enum
from collections.abc import Iterable
from dataclasses import dataclass, field

from auv_sim.radio_channel import Delivery
from auv_sim.world import HARD_STOP, WORLD, World
from msgs_json.agent_shell import Frame, Speaker
from msgs_json.codec import MessageError, Refusal
from msgs_json.geometry import TIME_TOLERANCE_S
from msgs_json.lockstep_client import RECORDER
from msgs_json.messages import Done, Go, Hello, NodeKind, Ready, Tick, Waiting
from msgs_json.node_exit import NodeExit
from msgs_json.ros_messages import Odometry, Text
from msgs_json.topics import RADIO_RX, WORLD_GO, WORLD_TICK, WORLD_WAITING, Qos

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


_NOTHING_DONE = Done(tick=0, received=0, sent=0, published=0, finished=False, life=0)


@dataclass(slots=True)
class _Agent:
    """What the conductor knows of an agent; counts are those of its present life."""

    is_vehicle: bool
    done: Done = _NOTHING_DONE
    next_seq: int = 0
    """Number of what it says next."""
    said: int = 0
    """Messages of its own that have arrived from ``radio/tx``."""
    delivered: int = 0
    """Payloads that it was sent, as they were said."""
    corrupted: int = 0
    """Payloads that it was sent, not as they were said."""
    in_hand: list[bytes] = field(default_factory=list)
    """Of what was delivered, what it has not said to have worked off."""
    seen: bool = False
    """Its odometry of the open tick is here."""
    located: bool = False
    """Likewise, be it of a former life."""
    answered: bool = False
    """Its `Done` of the open tick is here."""
    restarts: int = 0
    is_new: bool = False
    """It came up anew and has not answered since: it knows nothing of what is in hand."""
    go: int = 0
    """The first go of its present life."""
    published_before: int = 0
    """Messages published in former lives that the recorder holds."""

    def begin_life(self, next_seq: int) -> None:
        """Count anew; what it said before and what is on its way to it stays."""
        self.published_before += self.done.published
        self.done, self.next_seq = _NOTHING_DONE, next_seq
        self.said = self.delivered = self.corrupted = 0
        self.seen = self.answered = False
        self.is_new = True

    def take(self, done: Done) -> list[bytes]:
        """Take its word; return what must be delivered again."""
        del self.in_hand[: done.received - self.done.received]
        self.done, self.answered = done, True
        if not self.is_new:
            return []
        self.is_new, self.delivered, self.corrupted = False, done.received, done.noise
        again, self.in_hand = self.in_hand, []
        return again

    def is_settled(self) -> bool:
        """Return whether everything it did in the open tick is known here."""
        return (
            self.answered
            and (self.seen or not self.is_vehicle)
            and self.said >= self.done.sent
            and self.done.received >= self.delivered
            and self.done.received + self.done.noise >= self.delivered + self.corrupted
        )

    def lacks(self) -> str:
        """Return what is not known here yet, in words."""
        if not self.answered:
            return 'no answer'
        if self.is_vehicle and not self.seen:
            return 'no odometry'
        if self.said < self.done.sent:
            return f'{self.said} of {self.done.sent} radio messages have arrived'
        worked_off = self.done.received + self.done.noise
        return f'{worked_off} of {self.delivered + self.corrupted} deliveries are worked off'


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
        restarted: Iterable[str] = (),
        rejoin_timeout_s: float = 60.0,
    ) -> None:
        """
        Wait for every node to come up.

        Parameters
        ----------
        world
            Where it takes place.
        recorder
            Whether there is one.
        start_timeout_s
            How long to wait for that; 0: for ever. All of wall time.
        reply_timeout_s
            After this time a silent node is named, and given up unless somebody restarts it.
        restarted
            Agents that are started again when they die.
        rejoin_timeout_s
            After this time they are given up, too.

        """
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
        self._greeting: set[str] = set()
        """Nodes that are to answer a go; nothing else goes on until then."""
        self._lives: dict[str, int] = {}
        self._gos = 0
        """How many there were."""
        self._recorder_go = -1
        """The last one that the recorder has answered."""
        self._tick = Tick(tick=0, time_s=0.0, published=None)
        self._next_tick = 0
        self._has_begun = False
        self._published = 0
        """Messages that the world itself has published on recorded topics."""
        self._asked_for = 0
        """Messages that the recorder was last asked to hold."""
        self._start_nudges = start_timeout_s / NUDGE_S
        self._reply_nudges = round(reply_timeout_s / NUDGE_S)
        self._restarted = frozenset(restarted)
        self._rejoin_nudges = rejoin_timeout_s / NUDGE_S
        self._silent_nudges = 0

    def missing(self) -> list[str]:
        """Return whom the conductor waits for, in agent order, each with what is missing."""
        return [f'{name}{self._lacks(name)}' for name in self._silent()]

    def _silent(self) -> list[str]:
        awaited = self._missing | self._greeting
        return [name for name in self._nodes if name in awaited]

    def _lacks(self, name: str) -> str:
        agent = self._agents.get(name)
        if not self._has_begun or agent is None:
            return ''
        if name in self._greeting:
            return ' (is up again and has not heard the world)'
        return f' ({agent.lacks()})'

    # --- start-up --------------------------------------------------------------------------------

    def hello(self, src: str, hello: Hello) -> list[Addressed]:
        """Take a hello; the last one is answered with go, and so is one of another life."""
        kind = NodeKind.RECORDER if src == RECORDER else NodeKind.AGENT
        if src not in self._nodes or hello.kind is not kind:
            raise _not_expected(src, f'a {hello.kind.value}', self._nodes)
        if hello.life <= self._lives.get(src, -1) or self.phase is Phase.ENDED:
            return []
        if self.phase is not Phase.GATHERING and src == RECORDER:
            return []  # what the former one had not stored is gone
        self._lives[src] = hello.life
        if src != RECORDER:
            self._agents[src].begin_life(hello.next_seq)
            self._world.expect(src, hello.next_seq)
        if not self._has_begun:
            # A mission whose machine went down goes on: for nobody does time go back.
            self._next_tick = max(self._next_tick, self._world.ticks_until(hello.latest_s))
        if self.phase is not Phase.GATHERING:
            return self._welcome_back(src)
        self._found(src)
        if self._missing:
            return []
        self.phase = Phase.GREETING
        return [self._go(self._nodes)]

    def ready(self, src: str, ready: Ready) -> list[Addressed]:
        """Take a ready; after the last one the tick can begin, or goes on."""
        if src not in self._nodes:
            raise _not_expected(src, 'a node', self._nodes)
        expected = self._agents[src].go if src in self._agents else self._gos - 1
        if src not in self._greeting or ready.go < expected:
            return []
        self._greeting.discard(src)
        self._silent_nudges = 0
        if src == RECORDER:
            self._note_stored(ready)
        if self._greeting:
            return []
        if self.phase is Phase.GREETING:
            self.phase = Phase.RESTING
            return []
        self._ask(RECORDER in self._missing)
        return [(WORLD, self._tick_frame())]

    def _note_stored(self, ready: Ready) -> None:
        """Note how much of their former lives is recorded: what else they published is lost."""
        for name, agent in self._agents.items():
            if agent.go > self._recorder_go:
                agent.published_before = ready.stored.get(name, 0)
        self._recorder_go = ready.go

    def _welcome_back(self, name: str) -> list[Addressed]:
        """Hold what is under way until a node that came up anew, and the recorder, are ready."""
        if self.phase is Phase.WORKING:
            self._missing.add(name)
        elif self.phase is not Phase.SAVING:
            self.phase = Phase.GREETING
        go = self._go((name, RECORDER) if self._has_recorder else (name,))
        if not self._has_begun:
            return [go]
        agent = self._agents[name]
        agent.restarts += 1
        return [*self._shown([self._world.restarted(name, agent.restarts)]), go]

    def _go(self, nodes: tuple[str, ...]) -> Addressed:
        """Return a go that nodes have to answer; for the others it is none."""
        for name in nodes:
            if name in self._agents:
                self._agents[name].go = self._gos
        self._greeting |= set(nodes)
        self._silent_nudges = 0
        go = Go(number=self._gos, lives={name: self._lives[name] for name in self._nodes})
        self._gos += 1
        return WORLD, self._speaker.frame(WORLD_GO, go, 0.0)

    # --- a tick ----------------------------------------------------------------------------------

    def begin_tick(self) -> list[Addressed]:
        """Open the next tick; only in phase RESTING."""
        is_resumed = not self._has_begun and self._next_tick > 0
        self._has_begun = True
        self._world.tick, self._next_tick = self._next_tick, self._next_tick + 1
        for agent in self._agents.values():
            agent.seen = agent.located = agent.answered = False
        total = self._total_published()
        behind = self._has_recorder and total - self._asked_for >= RECORDER_BACKLOG
        self._wait_for(Phase.WORKING, self._nodes if behind else self._world.order)
        self._ask(behind)
        shown = [self._world.clock()]
        if is_resumed:
            shown.append(self._world.resumed())
        return [*self._shown(shown), (WORLD, self._tick_frame())]

    def saw(self, name: str, odometry: Odometry) -> list[Addressed]:
        """Take a vehicle's true pose."""
        agent = self._agents[name]
        if self.phase is not Phase.WORKING or (agent.seen and not agent.restarts):
            raise MessageError(Refusal.MALFORMED, name, 'one odometry is due for each tick')
        if abs(odometry.stamp_s - self._tick.time_s) > TIME_TOLERANCE_S:
            raise MessageError(
                Refusal.MALFORMED,
                name,
                f'odometry is of {odometry.stamp_s} s, the tick of {self._tick.time_s} s',
            )
        agent.seen = True
        if not agent.located:
            # A new process shows its vehicle as what it has ordered since has made it: an AUV
            # that has just taken its path would be under water, and its answer with it.
            agent.located = True
            self._world.see(name, odometry)
        return self._settle(name)

    def said(self, name: str, payload: bytes) -> list[Addressed]:
        """Take what an agent says by radio."""
        agent, seq = self._agents[name], self._world.say(name, payload)
        if seq is not None and seq >= agent.next_seq:  # else it is of a former life
            agent.next_seq = seq + 1
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
        if done.life != self._lives[src]:
            return []  # the last word of a process that is no more
        if done.busy:
            self._silent_nudges = 0
            return []
        before = agent.done
        if done.received < before.received or done.sent < before.sent:
            raise MessageError(Refusal.MALFORMED, src, 'its counts went back')
        again = agent.take(done)
        if again:
            return self._deliver([Delivery(src, payload, is_intact=True) for payload in again])
        return self._settle(src)

    def nudge(self) -> list[Addressed]:
        """
        Send an open tick again, name nodes that are silent for too long, or give up on them.

        To be called every `NUDGE_S` of wall time.
        """
        if self.phase in (Phase.RESTING, Phase.ENDED):
            return []
        self._silent_nudges += 1
        if not self._has_begun:
            if 0 < self._start_nudges <= self._silent_nudges:
                return self._give_up('did not come up')
            return []
        # One that comes back is heard by the recorder, too: that is not to blame meanwhile.
        to_blame = set(self._silent()) - ({RECORDER} if self._greeting - {RECORDER} else set())
        is_awaited = to_blame <= self._restarted
        if self._silent_nudges >= (self._rejoin_nudges if is_awaited else self._reply_nudges):
            return self._give_up(f'silent since tick {self._tick.tick} began')
        output = [] if self._greeting else [(WORLD, self._tick_frame())]
        if self._silent_nudges % self._reply_nudges == 0:
            output.append((WORLD, self._waiting_frame()))
        return output

    def interrupt(self) -> list[Addressed]:
        """End a mission that is under way."""
        is_under_way = self._has_begun and self.phase not in (Phase.SAVING, Phase.ENDED)
        waits_for = self.missing() if self._silent_nudges >= self._reply_nudges else []
        self.phase = Phase.ENDED
        if not is_under_way:
            return []
        if waits_for:
            reason = f'interrupted, waiting for {", ".join(waits_for)}'
            return self._cut_short(reason, self._silent()[0])
        return self._cut_short('interrupted')

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
        heard = self._world.gate()
        if not heard:
            return self._end_tick()
        return self._deliver(heard)

    def _deliver(self, heard: list[Delivery]) -> list[Addressed]:
        for name, payload, is_intact in heard:
            agent = self._agents[name]
            if is_intact:
                agent.delivered += 1
                agent.in_hand.append(payload)
            else:
                agent.corrupted += 1
            self._missing.add(name)
        self._published += len(heard)
        return [(name, Frame(RADIO_RX, Text(payload))) for name, payload, _ in heard]

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
        self._wait_for(Phase.SAVING, (RECORDER,))
        self._ask(True)
        return [*output, (WORLD, self._tick_frame())]

    def _give_up(self, problem: str) -> list[Addressed]:
        reason = f'{problem}: {", ".join(self.missing())}'
        node = self._silent()[0]
        self.phase, self.exit_code = Phase.ENDED, NodeExit.NODE_MISSING
        return self._cut_short(reason, node)

    def _cut_short(self, reason: str, node: str | None = None) -> list[Addressed]:
        self.is_cut_short = True
        return self._shown([self._stopped(reason, node)])

    def _stopped(self, reason: str, node: str | None = None) -> Frame:
        self.verdict = reason
        return self._world.stopped(reason, node)

    # --- what is under way -----------------------------------------------------------------------

    def _ask(self, recorder_too: bool) -> None:
        """Set what nodes are told of the open tick."""
        if recorder_too:
            self._asked_for = self._total_published()
        self._tick = Tick(
            tick=self._world.tick,
            time_s=self._world.now_s,
            published=self._asked_for if recorder_too else None,
            go=self._gos - 1,
            last=self.phase is Phase.SAVING,
        )

    def _wait_for(self, phase: Phase, nodes: tuple[str, ...]) -> None:
        self.phase, self._missing, self._silent_nudges = phase, set(nodes), 0

    def _found(self, name: str) -> None:
        self._missing.discard(name)
        self._silent_nudges = 0

    def _tick_frame(self) -> Frame:
        return self._speaker.frame(WORLD_TICK, self._tick, self._tick.time_s)

    def _waiting_frame(self) -> Frame:
        waiting = Waiting(
            lives={name: self._lives[name] for name in self._silent()},
            problem=', '.join(self.missing()),
        )
        return self._speaker.frame(WORLD_WAITING, waiting, self._tick.time_s)

    def _shown(self, frames: list[Frame]) -> list[Addressed]:
        self._published += len(frames)
        return [(WORLD, frame) for frame in frames]

    def _total_published(self) -> int:
        return self._published + sum(
            agent.published_before + agent.done.published for agent in self._agents.values()
        )


def _not_expected(src: str, what: str, nodes: tuple[str, ...]) -> MessageError:
    return MessageError(
        Refusal.UNKNOWN_SENDER, src, f'{what} of this mission must be one of {", ".join(nodes)}'
    )
