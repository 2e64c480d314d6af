"""
What a stranger with a radio can say: hostile payloads for tests and the fault suite.

The stranger hears everything and has no key. It can say what it heard again, change it, make up
messages of the right shape and sign them with a key of its own, and send what is no message.
"""

from __future__ import annotations

import enum
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import cycle, islice
from typing import Any, TypeVar

import msgspec
import numpy as np

from msgs_json import codec
from msgs_json.authentication import KEY_MIN_BYTES, Authenticator
from msgs_json.codec import SCHEMA_VERSION, Envelope

_ChoiceT = TypeVar('_ChoiceT')

_HEARD_MAX = 1000
"""A stranger remembers so many payloads, the latest ones."""

_DEPTH_MAX = 10_000
_NAME_MAX_CHARS = 64
_NAME_EXCESS_CHARS = 20_000
"""More than fits into a parser's stack or into a sensible log."""
_BRACKETS = ((b'[', b']'), (b'{"a":', b'}'))
_NUMBER_KEYS = ('version', 'seq', 'stamp', 'body')
_NAME_KEYS = ('schema', 'src', 'dst')
_STRANGERS = ('stranger', 'auv_9999', 'UAV', 'uav ', '*')
_NOT_UTF_8 = (b'\xff', b'\xc3', b'\xc0\xaf', b'\xed\xa0\x80', b'\xf4\x90\x80\x80')
"""No character, half of one, one written too long, half of a pair, and one beyond Unicode."""
_HUGE_NUMBERS = (b'-1', b'9007199254740993', b'1e308', b'1e999', b'-1e999', b'1' + b'0' * 400)
_NO_NUMBERS = (b'NaN', b'Infinity', b'-Infinity', b'nan', b'0x10')


class ForgeryKind(enum.Enum):
    """What is wrong with a forged payload."""

    RANDOM_BYTES = 'random_bytes'
    CUT_OFF = 'cut_off'
    NOT_UTF_8 = 'not_utf_8'
    DEEP_NESTING = 'deep_nesting'
    HUGE_NUMBER = 'huge_number'
    NO_NUMBER = 'no_number'
    LONG_NAME = 'long_name'
    REPEATED_KEY = 'repeated_key'
    """Two values for one key: parsers differ in which of them they take."""
    UNKNOWN_SCHEMA = 'unknown_schema'
    OTHER_VERSION = 'other_version'
    UNKNOWN_SENDER = 'unknown_sender'
    OTHER_RECEIVER = 'other_receiver'
    OTHER_BODY = 'other_body'
    """One value in the body, such as a cell of a path, is another one."""
    UNSIGNED = 'unsigned'
    OTHER_KEY = 'other_key'
    RENUMBERED = 'renumbered'
    """Said again with a number that has not been used."""
    REPLAY = 'replay'
    """Said again as it was: signed with the right key, so only its number gives it away."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Forgery:
    """A hostile payload."""

    kind: ForgeryKind
    payload: bytes


class Stranger:
    """
    Hears signed messages and forges others after them.

    Parameters
    ----------
    rng
        Draws which message is spoilt, and how.

    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._own = Authenticator(rng.bytes(KEY_MIN_BYTES))
        self._heard: deque[tuple[bytes, Envelope]] = deque(maxlen=_HEARD_MAX)
        self._names = {codec.EVERYONE}
        self._kinds = cycle(ForgeryKind)

    def hear(self, payload: bytes) -> None:
        """
        Remember a signed message, to forge others after it.

        Raises
        ------
        MessageError
            It is no message, or was damaged.

        """
        envelope, _ = codec.decode(payload)
        self._heard.append((payload, envelope))
        self._names |= {envelope.src, envelope.dst}

    def forgeries(self, count: int) -> Iterator[Forgery]:
        """
        Yield so many payloads, of each kind in turn, going on where the last ones ended.

        Raises
        ------
        ValueError
            Nothing was heard so far.

        """
        if not self._heard:
            raise ValueError('the stranger has heard nothing that it could forge')
        for kind in islice(self._kinds, count):
            yield Forgery(kind=kind, payload=self._forge(kind))

    def _forge(self, kind: ForgeryKind) -> bytes:
        payload, genuine = self._one_of(self._heard)
        match kind:
            case ForgeryKind.RANDOM_BYTES:
                return self._rng.bytes(self._below(2000))
            case ForgeryKind.CUT_OFF:
                return payload[: self._below(len(payload))]
            case ForgeryKind.NOT_UTF_8:
                return self._changed(genuine, src=msgspec.Raw(b'"%b"' % self._one_of(_NOT_UTF_8)))
            case ForgeryKind.DEEP_NESTING:
                first, last = self._one_of(_BRACKETS)
                depth = self._below(_DEPTH_MAX)
                return self._changed(genuine, body=msgspec.Raw(first * depth + last * depth))
            case ForgeryKind.HUGE_NUMBER:
                number = msgspec.Raw(self._one_of(_HUGE_NUMBERS))
                return self._changed(genuine, **{self._one_of(_NUMBER_KEYS): number})
            case ForgeryKind.NO_NUMBER:
                number = msgspec.Raw(self._one_of(_NO_NUMBERS))
                return self._changed(genuine, **{self._one_of(_NUMBER_KEYS): number})
            case ForgeryKind.LONG_NAME:
                name = 'a' * (_NAME_MAX_CHARS + 1 + self._below(_NAME_EXCESS_CHARS))
                return self._changed(genuine, **{self._one_of(_NAME_KEYS): name})
            case ForgeryKind.REPEATED_KEY:
                return b'{"src":"stranger",' + payload[1:]
            case ForgeryKind.UNKNOWN_SCHEMA:
                return self._changed(genuine, schema=f'{genuine.schema}{self._below(10)}')
            case ForgeryKind.OTHER_VERSION:
                return self._changed(genuine, version=SCHEMA_VERSION + 1 + self._below(10))
            case ForgeryKind.UNKNOWN_SENDER:
                return self._changed(genuine, src=self._one_of(_STRANGERS))
            case ForgeryKind.OTHER_RECEIVER:
                return self._changed(
                    genuine, dst=self._one_of(sorted(self._names - {genuine.dst}))
                )
            case ForgeryKind.OTHER_BODY:
                body = self._altered(msgspec.json.decode(genuine.body))
                return self._changed(genuine, body=body)
            case ForgeryKind.RENUMBERED:
                return self._changed(genuine, seq=genuine.seq + 1 + self._below(1000))
            case ForgeryKind.UNSIGNED:
                return _written(genuine, auth=None)
            case ForgeryKind.OTHER_KEY:
                return self._own.sign(_written(genuine, auth=None))
            case ForgeryKind.REPLAY:
                return payload

    def _changed(self, genuine: Envelope, **changes: object) -> bytes:
        """Return a message with other values, and with no tag, the one it had, or one of ours."""
        unsigned = _written(genuine, **changes, auth=None)
        return self._one_of((unsigned, _written(genuine, **changes), self._own.sign(unsigned)))

    def _altered(self, value: Any) -> Any:  # noqa: ANN401  JSON
        """Return a JSON value with something else in one place of it."""
        match value:
            case dict() if value:
                key = self._one_of(list(value))
                return value | {key: self._altered(value[key])}
            case list() if value:
                place = self._below(len(value))
                return [*value[:place], self._altered(value[place]), *value[place + 1 :]]
            case bool():
                return not value
            case int() | float():
                return value + 1
            case str():
                return f'{value}_1'
            case _:
                return 0

    def _one_of(self, choices: Sequence[_ChoiceT]) -> _ChoiceT:
        return choices[self._below(len(choices))]

    def _below(self, end: int) -> int:
        return int(self._rng.integers(end))


def _written(genuine: Envelope, **changes: object) -> bytes:
    """Return an envelope as JSON, its keys in the order in which `Authenticator` signs them."""
    return msgspec.json.encode(msgspec.structs.asdict(genuine) | changes)
