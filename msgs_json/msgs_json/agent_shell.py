"""The edge of an agent: bytes in, bytes out; strict, signed, stored before they are said."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import msgspec

from msgs_json import codec
from msgs_json.agent import Agent, Log, Output, Publish, Refuse, Transmit, Worker
from msgs_json.authentication import SIGNATURE_BYTES
from msgs_json.codec import MessageError, Refusal
from msgs_json.fragments import Incoming, Outgoing
from msgs_json.log_tail import LogTail
from msgs_json.messages import (
    RADIO_MESSAGES,
    Fragment,
    FragmentReceipt,
    Message,
    MessageRefused,
    StorageFailed,
    StorageRestored,
)
from msgs_json.replay_window import ReplayWindow
from msgs_json.ros_messages import RosMessage, Text
from msgs_json.store import StoreError
from msgs_json.topics import MISSION_EVENTS, RADIO_TX, Topic

if TYPE_CHECKING:
    from msgs_json.authentication import Authenticator
    from msgs_json.drivers import Vehicle
    from msgs_json.store import Store

_HEARD = frozenset({codec.OPERATOR_COMMAND, *(t.__name__ for t in RADIO_MESSAGES)})

_BOOTS, _HIGHEST, _VEHICLE = 'boots', 'heard', 'vehicle'
"""Kinds of entries of the store; an agent has others."""

_LATEST = 'latest'
"""Kind of the entry that says when anything was stored last."""

_BOOT_BITS = 32
"""A process counts what it says below this bit; above is how many processes there were before."""

FRAME_BYTES = 1_048_576
"""The longest message of a radio that is not known to carry less."""

_SENDERS_MAX = 32
"""Refusals are told apart for so many senders: strangers choose their names as they like."""
_OTHERS = '(others)'

_LOGGED_COUNTS = frozenset(10**power for power in range(19))
"""Which of many refusals for one reason are logged."""

_FORGED = Refuse('?', Refusal.AUTH, '`$.auth` is not of the key of this mission')


class Frame(msgspec.Struct, frozen=True):
    """Something to publish: on which topic, and what. JSON is a `Text` that is encoded already."""

    topic: Topic
    message: RosMessage


class Speaker:
    """
    Wraps messages in envelopes, counting them per topic.

    Parameters
    ----------
    name
        Of the agent.
    boot
        How many processes of this agent there were before: its numbers go on from theirs.
    authenticator
        Signs what goes by radio; None leaves it unsigned.

    """

    def __init__(
        self, name: str, boot: int = 0, authenticator: Authenticator | None = None
    ) -> None:
        self._name = name
        self._first_seq = boot << _BOOT_BITS
        self._authenticator = authenticator
        self._seq: Counter[str] = Counter()

    def next_seq(self, topic: Topic) -> int:
        """Return the number of what is said next on a topic."""
        return self._first_seq + self._seq[topic.name]

    def take_back(self, topic: Topic, count: int) -> None:
        """Count so many messages of a topic as never said; what comes next gets their numbers."""
        self._seq[topic.name] -= count

    def frame(self, topic: Topic, body: Message, stamp_s: float, dst: str | None = None) -> Frame:
        """Return a frame with the body in an envelope."""
        return self.enclosed(
            topic, codec.schema_of(body), codec.encode_body(body), stamp_s, dst or codec.EVERYONE
        )

    def enclosed(self, topic: Topic, schema: str, body: bytes, stamp_s: float, dst: str) -> Frame:
        """Return a frame with a body that is JSON already."""
        payload = self._unsigned(topic, schema, body, stamp_s, dst)
        self._seq[topic.name] += 1
        if self._authenticator is not None and topic is RADIO_TX:
            payload = self._authenticator.sign(payload)
        return Frame(topic, Text(payload))

    def radio_bytes(self, schema: str, body: bytes, stamp_s: float, dst: str) -> int:
        """Return how long the next frame by radio would be with a body; nothing is said."""
        envelope = self._unsigned(RADIO_TX, schema, b'', stamp_s, dst)
        signature_bytes = 0 if self._authenticator is None else SIGNATURE_BYTES
        return len(envelope) + len(body) + signature_bytes

    def _unsigned(self, topic: Topic, schema: str, body: bytes, stamp_s: float, dst: str) -> bytes:
        seq = self.next_seq(topic)
        return codec.enclose(schema, body, src=self._name, dst=dst, seq=seq, stamp_s=stamp_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class AgentSetting:
    """What an agent's shell is given by whoever runs it."""

    store: Store
    """What the agent, and its vehicle if that is simulated, know after a crash."""
    authenticator: Authenticator | None
    """Holds the mission's key; None: whoever has a radio may speak, and is believed."""


VehicleT = TypeVar('VehicleT', bound='Vehicle')


def recalled(vehicle: VehicleT, store: Store) -> VehicleT:
    """
    Return a new driver that goes on where that of a process before this one left off.

    Raises
    ------
    StoreError
        It cannot: what the store has of it cannot be read, or is not of such a vehicle.

    """
    memory = store.load(_VEHICLE, bytes).get('')
    if memory is not None:
        try:
            vehicle.recall(memory)
        except ValueError as error:
            raise StoreError(f'{store}: the vehicle cannot be recalled: {error}') from None
    return vehicle


class AgentShell:
    """
    Feeds an agent with decoded messages and encodes what it wants to say.

    A payload that is refused here never reaches the agent. Like what the agent itself refuses it
    is counted in ``refused`` by ``(sender, reason)``; the first of each is logged, the tenth, the
    hundredth and so on.

    What has changed by a message or a tick is stored before anything that came of it is said.
    While that fails nothing is said by radio, so that nobody relies on what a crash would undo;
    the vehicle goes on, and agents repeat what was not heard.

    Parameters
    ----------
    agent
        The agent; it has found what it needs in the store of the setting.
    setting
        Store and key.
    vehicle
        The driver of the agent's vehicle, if it has one.
    frame_bytes
        The longest message that the radio carries; longer ones go in fragments.
    copies
        How often each message is said at a time: one that is lost costs a tick.

    Raises
    ------
    StoreError
        The store cannot be written to, before anything else happens.
    ValueError
        The radio's frames are too short even for fragments.

    """

    def __init__(
        self,
        agent: Agent,
        setting: AgentSetting,
        vehicle: Vehicle | None = None,
        frame_bytes: int = FRAME_BYTES,
        copies: int = 1,
    ) -> None:
        self.agent = agent
        self.refused: Counter[tuple[str, Refusal]] = Counter()
        self.genuine_from: str | None = None
        """Who sent the payload that was heard last; None where it was malformed, or a forgery."""
        self._worker = agent if isinstance(agent, Worker) else None
        self._store = setting.store
        self._authenticator = setting.authenticator
        self._vehicle = vehicle
        self._vehicle_memory: bytes | None = None
        """As it is stored."""
        self._cannot_store = False
        self._frame_bytes = frame_bytes
        self._copies = copies
        self._heard: set[tuple[str, bytes]] = set()
        """Who said what since the tick began; a copy of it is not handed to the agent again."""
        self._outgoing = Outgoing(frame_bytes)
        self._incoming = Incoming()
        self._latest_s = self._store.load(_LATEST, float).get('', 0.0)
        boot = self._store.load(_BOOTS, int).get('', -1) + 1
        self._speaker = Speaker(agent.name, boot, setting.authenticator)
        self._windows = {
            src: ReplayWindow(highest) for src, highest in self._store.load(_HIGHEST, int).items()
        }
        self._log_tail = LogTail(self._store)
        self._store.put(_BOOTS, '', boot)
        self._store.commit()

    @property
    def is_busy(self) -> bool:
        """Return whether the agent has work left to do before anything else is asked of it."""
        return self._worker is not None and self._worker.is_busy

    @property
    def latest_s(self) -> float:
        """Return the time of the last change that a process before this one has stored."""
        return self._latest_s

    @property
    def next_seq(self) -> int:
        """Return the number of what the agent says next by radio."""
        return self._speaker.next_seq(RADIO_TX)

    @property
    def logged(self) -> int:
        """Return the number below which all that the agent has stored in its log is said."""
        return self._log_tail.said

    def recorded(self, logged: int) -> None:
        """
        Note that what it has logged below a number is recorded; a next life says the rest again.

        Never called, it takes what is said for recorded.
        """
        self._log_tail.recorded(logged)

    def tick(self, now_s: float) -> list[Frame]:
        """Tick the agent."""
        if self._heard:
            self._heard.clear()
        frames = self._stored(self.agent.tick(now_s), now_s)
        # Not before: the vehicle may fail in this tick, and this process may die, too.
        if not self._log_tail.unsaid:
            return frames
        unsaid = [Frame(MISSION_EVENTS, Text(entry)) for entry in self._log_tail.say_again()]
        return [*unsaid, *frames]

    def receive(self, data: bytes, now_s: float) -> list[Frame]:
        """Hand the agent what came by radio, if it may be heard."""
        self.genuine_from = None
        if self._authenticator is not None and not self._authenticator.check(data):
            # Nothing in it is worth reading: whoever made it wrote what he liked.
            return self._refuse(_FORGED, now_s)
        try:
            src, message, is_copy = self._admit(data)
        except MessageError as error:
            return self._refuse(Refuse(error.sender, error.refusal, error.detail), now_s)
        if is_copy:
            return self._stored([], now_s)
        match message:
            case Fragment():
                outputs = self._take_fragment(src, message, now_s)
            case FragmentReceipt():
                self._outgoing.receipt(src, message)
                outputs = []
            case _:
                outputs = self.agent.receive(src, message, now_s)
        return self._stored(outputs, now_s)

    def work(self, now_s: float) -> list[Frame]:
        """Let the agent do a slice of its work, if it has any."""
        return self._stored(self._worker.work(now_s), now_s) if self._worker is not None else []

    # --- what comes in ---------------------------------------------------------------------------

    def _admit(self, data: bytes) -> tuple[str, Message, bool]:
        """Return who said what, and whether it was heard in this tick already."""
        envelope = codec.open_envelope(data)
        if envelope.dst != self.agent.name:
            raise MessageError(
                Refusal.NOT_ADDRESSED,
                envelope.src,
                f'`$.dst` is {envelope.dst}, this is {self.agent.name}',
            )
        body = codec.open_body(envelope)
        self.genuine_from = envelope.src
        if envelope.src not in self.agent.peers:
            known = ', '.join(sorted(self.agent.peers))
            raise MessageError(
                Refusal.UNKNOWN_SENDER, envelope.src, f'`$.src` must be one of {known}'
            )
        if envelope.schema not in _HEARD:
            raise MessageError(
                Refusal.UNKNOWN_SCHEMA,
                envelope.src,
                f'`$.schema` is {envelope.schema!r}; allowed: {", ".join(sorted(_HEARD))}',
            )
        if self._authenticator is not None:
            self._note_heard(envelope.src, envelope.seq)
        said = (envelope.src, bytes(envelope.body))
        is_copy = said in self._heard
        self._heard.add(said)
        return envelope.src, body, is_copy

    def _take_fragment(self, src: str, fragment: Fragment, now_s: float) -> list[Output]:
        """Hand the agent a message that has come in fragments, once it is complete."""
        try:
            receipt, whole = self._incoming.take(src, fragment)
            message = codec.read_body(*whole, src) if whole is not None else None
        except MessageError as error:
            return [Refuse(error.sender, error.refusal, error.detail)]
        output: list[Output] = [Transmit(src, receipt)]
        if message is not None:
            output += self.agent.receive(src, message, now_s)
        return output

    def _note_heard(self, src: str, seq: int) -> None:
        """Refuse what was heard before, by this process or one before it."""
        window = self._windows.get(src)
        if window is None:
            window = self._windows[src] = ReplayWindow()
        if not window.is_fresh(seq):
            raise MessageError(
                Refusal.REPLAY, src, f'`$.seq` is {seq}: heard before, or too old to tell'
            )
        window.accept(seq)
        self._store.put(_HIGHEST, src, window.highest)

    # --- what goes out ---------------------------------------------------------------------------

    def _stored(self, outputs: list[Output], now_s: float) -> list[Frame]:
        """Return what may be said after an input, once all that it has changed is stored."""
        frames = self._frames(outputs, now_s)
        if self._vehicle is not None:
            memory = self._vehicle.memory()
            if memory is not self._vehicle_memory:
                self._vehicle_memory = memory
                self._store.put(_VEHICLE, '', memory)
        if not self._store.is_changed:
            return frames
        self._log_tail.keep(
            frame.message.data
            for frame in frames
            if frame.topic is MISSION_EVENTS and isinstance(frame.message, Text)
        )
        self._store.put(_LATEST, '', now_s)
        try:
            self._store.commit()
        except StoreError as error:
            said = len(frames)
            frames = [frame for frame in frames if frame.topic is not RADIO_TX]
            # The radio takes a gap for a stranger's.
            self._speaker.take_back(RADIO_TX, said - len(frames))
            if not self._cannot_store:
                self._cannot_store = True
                failed = StorageFailed(problem=str(error))
                frames.append(self._speaker.frame(MISSION_EVENTS, failed, now_s))
            return frames
        if self._cannot_store:
            self._cannot_store = False
            frames.append(self._speaker.frame(MISSION_EVENTS, StorageRestored(), now_s))
        return frames

    def _frames(self, outputs: list[Output], now_s: float) -> list[Frame]:
        frames = []
        for output in outputs:
            match output:
                case Publish(topic, message):
                    if isinstance(message, Message):
                        frames.append(self._speaker.frame(topic, message, now_s))
                    else:
                        frames.append(Frame(topic, message))
                case Transmit(dst, body):
                    for _ in range(self._copies):
                        frames += self._by_radio(dst, body, now_s)
                case Log(event, stamp_s):
                    frames.append(self._speaker.frame(MISSION_EVENTS, event, stamp_s))
                case Refuse():
                    frames += self._refuse(output, now_s)
        return frames

    def _by_radio(self, dst: str, body: Message, now_s: float) -> list[Frame]:
        """Return a message as the radio carries it: in one piece, or what is due of its pieces."""
        schema, encoded = codec.schema_of(body), codec.encode_body(body)
        if self._speaker.radio_bytes(schema, encoded, now_s, dst) <= self._frame_bytes:
            return [self._speaker.enclosed(RADIO_TX, schema, encoded, now_s, dst)]
        return [
            self._speaker.frame(RADIO_TX, fragment, now_s, dst)
            for fragment in self._outgoing.fragments(dst, schema, encoded)
        ]

    def _refuse(self, refused: Refuse, now_s: float) -> list[Frame]:
        key = (refused.sender, refused.refusal)
        count = self.refused.get(key, 0) + 1
        if count == 1:
            key = (self._known(refused.sender), refused.refusal)
            count = self.refused[key] + 1
        self.refused[key] = count
        if count not in _LOGGED_COUNTS:
            return []
        event = MessageRefused(
            sender=refused.sender,
            reason=refused.refusal.value,
            detail=refused.detail,
            count=count,
        )
        return [self._speaker.frame(MISSION_EVENTS, event, now_s)]

    def _known(self, sender: str) -> str:
        """Return the name under which a sender's refusals are counted."""
        senders = {name for name, _ in self.refused}
        return sender if sender in senders or len(senders) < _SENDERS_MAX else _OTHERS
