"""Nothing but what was signed with the key is taken, and nothing of it can be changed."""

from __future__ import annotations

import hashlib
import json

import hypothesis.strategies as st
import pytest
from hypothesis import given

from msgs_json import codec
from msgs_json.authentication import KEY_MIN_BYTES, Authenticator
from msgs_json.messages import Acknowledged, Acknowledgement, MessageRefused

KEY = bytes(range(KEY_MIN_BYTES))
AUTHENTICATOR = Authenticator(KEY)
ACKNOWLEDGEMENT = Acknowledgement(acknowledges=Acknowledged.PATH_ASSIGNMENT, reference=3)
UNSIGNED = codec.encode(ACKNOWLEDGEMENT, src='auv_1', dst='uav', seq=7, stamp_s=14.5)
SIGNED = AUTHENTICATOR.sign(UNSIGNED)

envelopes = st.builds(
    codec.encode,
    st.builds(MessageRefused, sender=st.text(), reason=st.text(), detail=st.text()),
    src=st.text(),
    dst=st.text(),
    seq=st.integers(0, 2**53),
    stamp_s=st.floats(0, 1e11),
)
keys = st.binary(min_size=KEY_MIN_BYTES, max_size=200)


def hmac_sha256(key: bytes, message: bytes) -> bytes:
    """RFC 2104, section 2, word by word."""
    block_bytes = 64
    if len(key) > block_bytes:
        key = hashlib.sha256(key).digest()
    key = key.ljust(block_bytes, b'\0')
    inner = hashlib.sha256(bytes(byte ^ 0x36 for byte in key) + message).digest()
    return hashlib.sha256(bytes(byte ^ 0x5C for byte in key) + inner).digest()


# RFC 4231, test cases 1, 2 and 6.
@pytest.mark.parametrize(
    ('key', 'message', 'tag'),
    [
        (
            b'\x0b' * 20,
            b'Hi There',
            'b0344c61d8db38535ca8afceaf0bf12b881dc200c9833da726e9376c2e32cff7',
        ),
        (
            b'Jefe',
            b'what do ya want for nothing?',
            '5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843',
        ),
        (
            b'\xaa' * 131,
            b'Test Using Larger Than Block-Size Key - Hash Key First',
            '60e431591ee0b67f0d8a26aacbf5b77f8e0bc6213728c5140546040f0ee37f54',
        ),
    ],
)
def test_the_oracle_computes_the_vectors_of_the_rfc(key: bytes, message: bytes, tag: str) -> None:
    assert hmac_sha256(key, message).hex() == tag


@given(key=keys, payload=envelopes)
def test_the_tag_stands_where_null_stood_and_covers_all_that_was_there(
    key: bytes, payload: bytes
) -> None:
    tag = hmac_sha256(key, payload).hex()
    signed = Authenticator(key).sign(payload)
    assert signed == payload.removesuffix(b'null}') + f'"{tag}"}}'.encode()
    assert json.loads(signed) == json.loads(payload) | {'auth': tag}
    assert Authenticator(key).check(signed)
    assert not Authenticator(key).check(payload)


def test_what_is_signed_is_still_an_envelope() -> None:
    envelope, body = codec.decode(SIGNED)
    assert body == ACKNOWLEDGEMENT
    assert envelope.auth == hmac_sha256(KEY, UNSIGNED).hex()


@given(payload=envelopes, keys=st.lists(keys, min_size=2, max_size=2, unique=True))
def test_another_key_does_not_do(payload: bytes, keys: list[bytes]) -> None:
    # HMAC fills keys up with zeros: those that differ by them alone are the same key.
    signing, checking = (Authenticator(key + b'\1') for key in keys)
    assert not checking.check(signing.sign(payload))


def test_no_bit_can_be_flipped() -> None:
    passed = []
    for place in range(len(SIGNED)):
        for bit in range(8):
            flipped = bytearray(SIGNED)
            flipped[place] ^= 1 << bit
            if AUTHENTICATOR.check(bytes(flipped)):
                passed.append((place, bit))
    assert passed == []
    assert AUTHENTICATOR.check(SIGNED)


def test_no_byte_can_be_left_out_and_none_put_in() -> None:
    places = range(len(SIGNED) + 1)
    shorter = [SIGNED[:place] + SIGNED[place + 1 :] for place in places[:-1]]
    longer = [SIGNED[:place] + b' ' + SIGNED[place:] for place in places]
    cut_off = [SIGNED[:place] for place in places[:-1]] + [SIGNED[place:] for place in places[1:]]
    assert [each for each in shorter + longer + cut_off if AUTHENTICATOR.check(each)] == []


@given(payload=envelopes, data=st.data())
def test_nothing_can_be_written_over(payload: bytes, data: st.DataObject) -> None:
    signed = AUTHENTICATOR.sign(payload)
    start = data.draw(st.integers(0, len(signed)))
    end = data.draw(st.integers(start, len(signed)))
    changed = signed[:start] + data.draw(st.binary(max_size=20)) + signed[end:]
    assert AUTHENTICATOR.check(changed) == (changed == signed)


TAG = SIGNED[-66:-2]


@pytest.mark.parametrize(
    'payload',
    [
        pytest.param(b'', id='nothing'),
        pytest.param(b'null}', id='only the end'),
        pytest.param(SIGNED[-67:], id='only a tag'),
        pytest.param(UNSIGNED, id='unsigned'),
        pytest.param(UNSIGNED.replace(b'null', b'""'), id='empty tag'),
        pytest.param(UNSIGNED.replace(b'null', b'"%b"' % (b'0' * 64)), id='tag of zeros'),
        pytest.param(UNSIGNED.replace(b'null', b'"%b"' % (b'\xff' * 64)), id='tag not of ASCII'),
        pytest.param(SIGNED.replace(TAG, TAG.upper()), id='tag in capitals'),
        pytest.param(SIGNED.replace(TAG, TAG[:32]), id='half of the tag'),
        pytest.param(SIGNED.replace(TAG, TAG + b'00'), id='more than the tag'),
        pytest.param(SIGNED.replace(b'"auth":', b'"auth": '), id='white space before the tag'),
        pytest.param(SIGNED + b'\n', id='white space after the envelope'),
        pytest.param(
            b'{"auth":"%b",%b}' % (TAG, UNSIGNED[1 : -len(b',"auth":null}')]), id='tag in front'
        ),
        pytest.param(SIGNED + SIGNED, id='twice'),
    ],
)
def test_anything_else_is_refused(payload: bytes) -> None:
    assert not AUTHENTICATOR.check(payload)


def test_what_the_key_signed_is_still_no_envelope_if_it_does_not_end_in_auth() -> None:
    for signed in (b'null}', b'{"src":"auv_1","note":null}', b'{"a,\\"auth":null}'):
        tag = hmac_sha256(KEY, signed).hex().encode()
        assert not AUTHENTICATOR.check(signed.removesuffix(b'null}') + b'"%b"}' % tag)


@given(payload=st.binary())
def test_no_bytes_raise(payload: bytes) -> None:
    assert not AUTHENTICATOR.check(payload)


@pytest.mark.parametrize(
    'payload',
    [
        pytest.param(b'', id='nothing'),
        pytest.param(SIGNED, id='signed already'),
        pytest.param(UNSIGNED + b'\n', id='white space at the end'),
        pytest.param(b'{"auth":null,"seq":7}', id='auth not at the end'),
        pytest.param(b'{"body":{"seq":7,"auth":null}}', id='auth of something inside'),
        pytest.param(b'{"seq":7,"no\\"auth":null}', id='another key'),
    ],
)
def test_only_an_unsigned_envelope_is_signed(payload: bytes) -> None:
    with pytest.raises(ValueError, match=r'what is to be signed ends in .*"auth":null'):
        AUTHENTICATOR.sign(payload)


def test_a_short_key_is_refused() -> None:
    with pytest.raises(ValueError, match='the key has 31 bytes; allowed: at least 32'):
        Authenticator(KEY[:-1])
