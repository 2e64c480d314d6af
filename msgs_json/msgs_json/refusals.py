"""What a node does not take from a topic: counted, reported once, and then forgotten."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any, Literal, TypeVar

import msgspec

from msgs_json import codec
from msgs_json.codec import MessageError, Refusal
from msgs_json.messages import Message
from msgs_json.ros_messages import text_from_cdr

MessageT = TypeVar('MessageT', bound=Message)


class Refusals:
    """Counts by topic, sender and reason; ``report`` gets the first of each as a sentence."""

    def __init__(self, report: Callable[[str], None]) -> None:
        self.counts: Counter[tuple[str, str, str]] = Counter()
        self._report = report

    def add(self, topic: str, error: ValueError) -> None:
        """Count a payload that was refused with this error."""
        sender, reason = '?', Refusal.MALFORMED.value
        if isinstance(error, MessageError):
            sender, reason = error.sender, error.refusal.value
        key = (topic, sender, reason)
        self.counts[key] += 1
        if self.counts[key] == 1:
            self._report(f'refused on {topic}, the next ones only counted: {error}')


def body_decoder(body_type: type[MessageT]) -> Callable[[bytes], tuple[str, MessageT]]:
    """
    Return what decodes a serialized std_msgs/String with an envelope of one schema.

    It returns sender and body, and raises `ValueError` for anything else (mostly `MessageError`,
    which knows the sender).
    """
    # One pass for envelope and body: every node does this at every tick, with cold caches.
    envelope_type = msgspec.defstruct(
        f'{body_type.__name__}Envelope',
        [
            ('schema', Literal[body_type.__name__]),
            ('version', Literal[codec.SCHEMA_VERSION]),
            ('body', body_type),
        ],
        bases=(codec.Envelope,),
        frozen=True,
        kw_only=True,
        forbid_unknown_fields=True,
    )
    decode_whole = msgspec.json.Decoder(envelope_type).decode

    def decode(cdr: bytes) -> tuple[str, MessageT]:
        data = text_from_cdr(cdr)
        try:
            envelope: Any = decode_whole(data)
        except (msgspec.DecodeError, UnicodeDecodeError):
            raise _what_is_wrong(data, body_type) from None
        return envelope.src, envelope.body

    return decode


def _what_is_wrong(data: bytes, body_type: type[Message]) -> MessageError:
    try:
        envelope, _ = codec.decode(data)
    except MessageError as error:
        return error
    return MessageError(
        Refusal.UNKNOWN_SCHEMA,
        envelope.src,
        f'`$.schema` is {envelope.schema!r}; here comes {body_type.__name__}',
    )
