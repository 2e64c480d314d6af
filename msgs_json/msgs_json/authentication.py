"""
Who may speak: radio envelopes signed with the key of the mission (HMAC-SHA-256).

How another implementation signs an envelope:

1. Write the envelope as JSON with ``auth`` as its last key, null, and no white space around it:
   the bytes end in ``,"auth":null}``. The other keys may stand in any order.
2. Compute HMAC-SHA-256 (RFC 2104) of exactly these bytes under the key.
3. Put the tag in place of ``null``, as 64 lower-case hexadecimal digits in quotation marks.

A receiver undoes step 3 on the bytes that it got and compares the tags. Nothing is parsed and
written again, so there is no second spelling of a message with the same tag. Every byte is
covered: ``schema``, ``version``, ``src``, ``dst``, ``seq``, ``stamp`` and ``body``. The key signs
nothing but radio envelopes, so nothing else that was signed can be taken for one.
"""

from __future__ import annotations

import hashlib
import hmac

KEY_MIN_BYTES = 32
"""As long as the tag (RFC 2104, section 3); a shorter key would be the weaker part."""

_BLOCK_BYTES = 64
"""Of SHA-256."""

_NULL = b'null}'
_UNSIGNED_END = b',"auth":' + _NULL
_TAG_BYTES = len(b'"') + 64 + len(b'"}')

SIGNATURE_BYTES = _TAG_BYTES - len(_NULL)
"""By which an envelope is longer when it is signed."""


class Authenticator:
    """
    Signs envelopes and checks them, with one key.

    Parameters
    ----------
    key
        Secret, at least ``KEY_MIN_BYTES`` long.

    Raises
    ------
    ValueError
        The key is too short.

    """

    __slots__ = ('_inner', '_outer')

    def __init__(self, key: bytes) -> None:
        if len(key) < KEY_MIN_BYTES:
            raise ValueError(f'the key has {len(key)} bytes; allowed: at least {KEY_MIN_BYTES}')
        # RFC 2104, section 4: hash states with the padded key in, to be copied for each message.
        # The module hmac takes three times as long, which is what a flood of forgeries costs.
        block = hashlib.sha256(key).digest() if len(key) > _BLOCK_BYTES else key
        padded = block.ljust(_BLOCK_BYTES, b'\0')
        self._inner = hashlib.sha256(bytes(byte ^ 0x36 for byte in padded))
        self._outer = hashlib.sha256(bytes(byte ^ 0x5C for byte in padded))

    def sign(self, payload: bytes) -> bytes:
        """
        Return the payload with its tag.

        Raises
        ------
        ValueError
            The payload is not an envelope without a tag, as `codec.encode` writes it.

        """
        if not payload.endswith(_UNSIGNED_END):
            raise ValueError(
                f'the envelope ends in {payload[-len(_UNSIGNED_END) :]!r};'
                f' what is to be signed ends in {_UNSIGNED_END!r}'
            )
        return payload[: -len(_NULL)] + self._tag(payload)

    def check(self, payload: bytes) -> bool:
        """Return whether the payload is an envelope that was signed with this key."""
        unsigned = payload[:-_TAG_BYTES] + _NULL
        # In constant time: how long a comparison takes must not tell how much of a tag is right.
        return unsigned.endswith(_UNSIGNED_END) and hmac.compare_digest(
            payload[-_TAG_BYTES:], self._tag(unsigned)
        )

    def _tag(self, unsigned: bytes) -> bytes:
        """Return what stands in a signed envelope where ``null}`` stands in an unsigned one."""
        inner, outer = self._inner.copy(), self._outer.copy()
        inner.update(unsigned)
        outer.update(inner.digest())
        return b'"%b"}' % outer.hexdigest().encode()
