"""
Envelopes to and from JSON, strict on the way in.

What cannot be understood is refused with a `MessageError` that names the JSON path; nothing is
guessed, filled in or rounded.
"""

from __future__ import annotations

import enum
from functools import cache
from typing import Annotated

import msgspec

from msgs_json.messages import (
    LOCKSTEP_MESSAGES,
    RADIO_MESSAGES,
    STATUS_MESSAGES,
    Command,
    Event,
    Message,
    MissionEvent,
    OperatorCommand,
    Seconds,
)

SCHEMA_VERSION = 1
"""Version of every schema; a change that an older reader would misread raises it."""

EVERYONE = '*'
"""Destination of what is not sent to one agent (events, status)."""

MISSION_EVENT = 'MissionEvent'
OPERATOR_COMMAND = 'OperatorCommand'


class Envelope(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What every JSON payload looks like; the body is decoded by its schema's name."""

    schema: Annotated[str, msgspec.Meta(min_length=1, max_length=64)]
    """Name of the message in ``body``."""
    version: Annotated[int, msgspec.Meta(ge=1, le=2**31)]
    """Version of the schema, 1."""
    src: Annotated[str, msgspec.Meta(min_length=1, max_length=64, description='agent name')]
    dst: Annotated[str, msgspec.Meta(min_length=1, max_length=64, description='agent name or *')]
    seq: Annotated[int, msgspec.Meta(ge=0, le=2**53, description='counted per sender and topic')]
    stamp: Seconds
    """Time of sending, seconds of ROS time."""
    body: msgspec.Raw
    """The message."""
    auth: Annotated[str, msgspec.Meta(max_length=256)] | None
    """Signature of what goes by radio, see `authentication`; null elsewhere."""


class Refusal(enum.Enum):
    """Why a payload was refused."""

    MALFORMED = 'malformed'
    """Not JSON, or not of its schema's shape or ranges."""
    UNKNOWN_SCHEMA = 'unknown_schema'
    """A schema or version that the receiver does not take."""
    UNKNOWN_SENDER = 'unknown_sender'
    """Somebody to whom the receiver does not listen."""
    AUTH = 'auth'
    """Not signed with the key of the mission, or changed on the way."""
    REPLAY = 'replay'
    """Heard before, or so old that nobody can tell."""
    NOT_ADDRESSED = 'not_addressed'
    """Meant for somebody else."""
    UNEXPECTED = 'unexpected'
    """Understood, but this agent takes no such message, or not now."""
    CONTRADICTORY = 'contradictory'
    """Understood, but it does not fit what the receiver knows."""
    NOT_POSSIBLE = 'not_possible'
    """Understood, but the vehicle or its planner cannot do it."""


class MessageError(ValueError):
    """A payload was refused; the text says where and why."""

    def __init__(self, refusal: Refusal, sender: str, detail: str) -> None:
        super().__init__(f'{refusal.value} message from {sender}: {detail}')
        self.refusal = refusal
        self.sender = sender
        self.detail = detail


SCHEMA_TYPES: dict[str, object] = {
    t.__name__: t for t in (*RADIO_MESSAGES, *LOCKSTEP_MESSAGES, *STATUS_MESSAGES)
} | {MISSION_EVENT: MissionEvent, OPERATOR_COMMAND: OperatorCommand}
"""Body type of every schema, by its name."""

DETAIL_MAX_CHARS = 300
"""A refusal quotes what was wrong; this is enough to see it, whatever was sent."""

_UNREADABLE = (msgspec.DecodeError, UnicodeDecodeError, RecursionError)
"""What msgspec raises on bytes that are not what they should be."""

_envelope_decoder = msgspec.json.Decoder(Envelope)
_encoder = msgspec.json.Encoder()


@cache
def _body_decoder(schema: str) -> msgspec.json.Decoder[Message]:
    return msgspec.json.Decoder(SCHEMA_TYPES[schema])


def schema_of(body: Message) -> str:
    """Return the name of a message's schema: its own, or that of the union it belongs to."""
    match body:
        case Event():
            return MISSION_EVENT
        case Command():
            return OPERATOR_COMMAND
        case _:
            return type(body).__name__


def encode_body(body: Message) -> bytes:
    """Return the JSON of a message as it stands in an envelope."""
    return _encoder.encode(body)


def encode(body: Message, *, src: str, dst: str, seq: int, stamp_s: float) -> bytes:
    """Return the JSON of an envelope."""
    return enclose(schema_of(body), encode_body(body), src=src, dst=dst, seq=seq, stamp_s=stamp_s)


def enclose(schema: str, body: bytes, *, src: str, dst: str, seq: int, stamp_s: float) -> bytes:
    """Return the JSON of an envelope with a body that is JSON already."""
    return _encoder.encode(
        Envelope(
            schema=schema,
            version=SCHEMA_VERSION,
            src=src,
            dst=dst,
            seq=seq,
            stamp=stamp_s,
            body=msgspec.Raw(body),
            auth=None,
        )
    )


def open_envelope(data: bytes) -> Envelope:
    """
    Return the envelope of a payload, its body still closed.

    Raises
    ------
    MessageError
        Where the payload is not an envelope of this version.

    """
    try:
        envelope = _envelope_decoder.decode(data)
    except _UNREADABLE as error:
        raise MessageError(Refusal.MALFORMED, '?', _located(error, '$')) from None
    if envelope.version != SCHEMA_VERSION:
        raise MessageError(
            Refusal.UNKNOWN_SCHEMA,
            envelope.src,
            f'`$.version` is {envelope.version}, this node reads {SCHEMA_VERSION}',
        )
    return envelope


def open_body(envelope: Envelope) -> Message:
    """
    Return the typed body of an envelope.

    Raises
    ------
    MessageError
        Where the schema is unknown or the body is not of its shape or ranges.

    """
    return read_body(envelope.schema, envelope.body, envelope.src)


def read_body(schema: str, body: bytes | msgspec.Raw, src: str) -> Message:
    """
    Return the typed body that somebody said, by the name of its schema.

    Raises
    ------
    MessageError
        Where the schema is unknown or the body is not of its shape or ranges.

    """
    if schema not in SCHEMA_TYPES:
        known = ', '.join(sorted(SCHEMA_TYPES))
        raise MessageError(
            Refusal.UNKNOWN_SCHEMA, src, f'`$.schema` is {schema!r}; known are {known}'
        )
    try:
        return _body_decoder(schema).decode(body)
    except _UNREADABLE as error:
        raise MessageError(Refusal.MALFORMED, src, _located(error, '$.body')) from None


def decode(data: bytes) -> tuple[Envelope, Message]:
    """Return envelope and typed body of a payload; raises `MessageError`."""
    envelope = open_envelope(data)
    return envelope, open_body(envelope)


def _located(error: Exception, root: str) -> str:
    """Return what is wrong and the JSON path where; msgspec leaves out the path of the root."""
    problem, at, path = str(error).rpartition(' - at `$')
    if not at:
        problem, path = str(error), '`'
    if len(problem) > DETAIL_MAX_CHARS:
        problem = f'{problem[:DETAIL_MAX_CHARS]} ...'
    return f'{problem} - at `{root}{path}'
