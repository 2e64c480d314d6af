"""The edge of an agent: bytes in, bytes out, strict and counted."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from msgs_json import codec
from msgs_json.agent import Agent, Log, Output, Publish, Transmit
from msgs_json.codec import MessageError, Refusal
from msgs_json.messages import RADIO_MESSAGES, Event, Message, MessageRefused
from msgs_json.ros_messages import RosMessage, Text
from msgs_json.topics import MISSION_EVENTS, RADIO_TX, Topic

_HEARD_BY_RADIO = frozenset(t.__name__ for t in RADIO_MESSAGES)


@dataclass(frozen=True, slots=True)
class Frame:
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

    A payload that is refused never reaches the agent. It is counted in ``refused`` by
    ``(sender, reason)`` and logged once for each.
    """

    def __init__(self, agent: Agent) -> None:
        self.agent = agent
        self.refused: Counter[tuple[str, Refusal]] = Counter()
        self._speaker = Speaker(agent.name)

    def tick(self, now_s: float) -> list[Frame]:
        """Tick the agent."""
        return [self._frame(output, now_s) for output in self.agent.tick(now_s)]

    def receive(self, data: bytes, now_s: float) -> list[Frame]:
        """Hand the agent what came by radio, if it may be heard."""
        try:
            src, message = self._admit(data)
        except MessageError as error:
            return self._refuse(error, now_s)
        return [self._frame(output, now_s) for output in self.agent.receive(src, message, now_s)]

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

    def _refuse(self, error: MessageError, now_s: float) -> list[Frame]:
        key = (error.sender, error.refusal)
        self.refused[key] += 1
        if self.refused[key] > 1:
            return []
        event = MessageRefused(
            sender=error.sender, reason=error.refusal.value, detail=error.detail
        )
        return [self._frame(Log(event, now_s), now_s)]

    def _frame(self, output: Output, now_s: float) -> Frame:
        match output:
            case Transmit(dst, body):
                return self._speaker.frame(RADIO_TX, body, now_s, dst)
            case Publish(topic, message):
                if isinstance(message, Message):
                    return self._speaker.frame(topic, message, now_s)
                return Frame(topic, message)
            case Log(event, stamp_s):
                return self._speaker.frame(MISSION_EVENTS, event, stamp_s)
