"""How long a message can get on its way by radio: the longest values, and the envelope's share."""

from __future__ import annotations

from typing import TYPE_CHECKING

from msgs_json import codec
from msgs_json.authentication import SIGNATURE_BYTES

if TYPE_CHECKING:
    from msgs_json.messages import Message

WIDE_NAME = 'n' * 32
WIDE_COUNT = 2**53
WIDE_FLOAT = -1.7976931348623157e-300
"""No value takes more characters: an upper bound need not be a value that can occur."""


def signed_envelope_bytes(body: Message) -> int:
    """Return the length of a signed envelope with this body, whoever says it, to whom and when."""
    unsigned = codec.encode(body, src=WIDE_NAME, dst=WIDE_NAME, seq=WIDE_COUNT, stamp_s=WIDE_FLOAT)
    return len(unsigned) + SIGNATURE_BYTES
