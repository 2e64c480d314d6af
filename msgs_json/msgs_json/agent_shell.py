"""The edge of an agent: bytes in, bytes out, strict and counted."""

from __future__ import annotations

from collections import Counter

import msgspec

from msgs_json import codec
from msgs_json.agent import Agent, Log, Output, Publish, Refuse, Transmit, Worker
from msgs_json.codec import MessageError, Refusal
from msgs_json.messages import RADIO_MESSAGES, Event, Message, MessageRefused
from msgs_json.ros_messages import RosMessage, Text
from msgs_json.topics import MISSION_EVENTS, RADIO_TX, Topic

_HEARD_BY_RADIO = frozenset(t.__name__ for t in RADIO_MESSAGES)


class Frame(msgspec.Struct, frozen=True):
    """Something to publish: on which topic, and what. JSON is a `Text` that is encoded already."""

    topic: Topic
    message: RosMessage


class Speaker:
    """Wraps messages in envelopes, counting them per topic."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._seq: Counter[str] = Counter()

    def frame(self, topic: Topic, body: Message, stamp_s: float, dst: str | None = None) -> Frame:
        """Return a frame with the body in an envelope."""
        seq = self._seq[topic.name]
        self._seq[topic.name] = seq + 1
        return Frame(
            topic,
            Text(
                codec.encode(
                    body,
                    schema=codec.MISSION_EVENT if isinstance(body, Event) else None,
                    src=self._name,
                    dst=dst or codec.EVERYONE,
                    seq=seq,
                    stamp_s=stamp_s,
                )
            ),
        )


class AgentShell:
    """
    Feeds an agent with decoded messages and encodes what it wants to say.

    A payload that is refused here never reaches the agent. Like what the agent itself refuses it
    is counted in ``refused`` by ``(sender, reason)`` and logged once for each.
    """

    def __init__(self, agent: Agent) -> None:
        self.agent = agent
        self.refused: Counter[tuple[str, Refusal]] = Counter()
        self._worker = agent if isinstance(agent, Worker) else None
        self._speaker = Speaker(agent.name)

    @property
    def is_busy(self) -> bool:
        """Return whether the agent has work left to do before anything else is asked of it."""
        return self._worker is not None and self._worker.is_busy

    def tick(self, now_s: float) -> list[Frame]:
        """Tick the agent."""
        return self._frames(self.agent.tick(now_s), now_s)

    def receive(self, data: bytes, now_s: float) -> list[Frame]:
        """Hand the agent what came by radio, if it may be heard."""
        try:
            src, message = self._admit(data)
        except MessageError as error:
            refused = Refuse(error.sender, error.refusal, error.detail)
            return self._frames([refused], now_s)
        return self._frames(self.agent.receive(src, message, now_s), now_s)

    def work(self, now_s: float) -> list[Frame]:
        """Let the agent do a slice of its work, if it has any."""
        return self._frames(self._worker.work(now_s), now_s) if self._worker is not None else []

    def _admit(self, data: bytes) -> tuple[str, Message]:
        envelope = codec.open_envelope(data)
        if envelope.src not in self.agent.peers:
            known = ', '.join(sorted(self.agent.peers))
            raise MessageError(
                Refusal.UNKNOWN_SENDER, envelope.src, f'`$.src` must be one of {known}'
            )
        if envelope.dst != self.agent.name:
            raise MessageError(
                Refusal.NOT_ADDRESSED,
                envelope.src,
                f'`$.dst` is {envelope.dst}, this is {self.agent.name}',
            )
        if envelope.schema not in _HEARD_BY_RADIO:
            raise MessageError(
                Refusal.UNKNOWN_SCHEMA,
                envelope.src,
                f'`$.schema` is {envelope.schema!r}; by radio come'
                f' {", ".join(sorted(_HEARD_BY_RADIO))}',
            )
        return envelope.src, codec.open_body(envelope)

    def _frames(self, outputs: list[Output], now_s: float) -> list[Frame]:
        frames = []
        for output in outputs:
            match output:
                case Transmit(dst, body):
                    frames.append(self._speaker.frame(RADIO_TX, body, now_s, dst))
                case Publish(topic, message):
                    if isinstance(message, Message):
                        frames.append(self._speaker.frame(topic, message, now_s))
                    else:
                        frames.append(Frame(topic, message))
                case Log(event, stamp_s):
                    frames.append(self._speaker.frame(MISSION_EVENTS, event, stamp_s))
                case Refuse():
                    frames += self._refuse(output, now_s)
        return frames

    def _refuse(self, refused: Refuse, now_s: float) -> list[Frame]:
        key = (refused.sender, refused.refusal)
        self.refused[key] += 1
        if self.refused[key] > 1:
            return []
        event = MessageRefused(
            sender=refused.sender, reason=refused.refusal.value, detail=refused.detail
        )
        return [self._speaker.frame(MISSION_EVENTS, event, now_s)]
