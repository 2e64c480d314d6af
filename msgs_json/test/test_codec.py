from __future__ import annotations

import json
from typing import Any

import msgspec
import pytest

from msgs_json import codec
from msgs_json.codec import (
    EVERYONE,
    MISSION_EVENT,
    OPERATOR_COMMAND,
    SCHEMA_VERSION,
    MessageError,
    Refusal,
)
from msgs_json.messages import (
    Acknowledged,
    Acknowledgement,
    Missed,
    MissionEvent,
    OperatorCommand,
    PathAssignment,
    Ready,
    Recall,
)

ACKNOWLEDGEMENT = Acknowledgement(acknowledges=Acknowledged.PATH_ASSIGNMENT, reference=3)


def payload(**changes: Any) -> bytes:  # noqa: ANN401  anything may arrive
    envelope = {
        'schema': 'Acknowledgement',
        'version': SCHEMA_VERSION,
        'src': 'auv_1',
        'dst': 'uav',
        'seq': 7,
        'stamp': 14.5,
        'body': {'acknowledges': 'PathAssignment', 'reference': 3},
        'auth': None,
    }
    return json.dumps(envelope | changes).encode()


def test_encoding_writes_the_envelope_of_the_design() -> None:
    data = codec.encode(ACKNOWLEDGEMENT, src='auv_1', dst='uav', seq=7, stamp_s=14.5)
    assert json.loads(data) == json.loads(payload())
    assert list(json.loads(data)) == [
        *('schema', 'version', 'src', 'dst', 'seq', 'stamp', 'body', 'auth')
    ]


def test_decoding_returns_envelope_and_typed_body() -> None:
    envelope, body = codec.decode(payload())
    assert body == ACKNOWLEDGEMENT
    assert (envelope.src, envelope.dst, envelope.seq, envelope.stamp) == ('auv_1', 'uav', 7, 14.5)


def test_an_event_is_told_by_its_tag() -> None:
    event = Missed(sortie=2, auv='auv_3')
    data = codec.encode(event, src='uav', dst=EVERYONE, seq=0, stamp_s=1.0)
    assert json.loads(data)['schema'] == 'MissionEvent'
    assert json.loads(data)['body'] == {'event': 'missed', 'sortie': 2, 'auv': 'auv_3'}
    assert codec.decode(data)[1] == event


def test_a_command_is_told_by_its_tag() -> None:
    command = Recall(auvs=('auv_3',))
    data = codec.encode(command, src='operator', dst='c3', seq=0, stamp_s=1.0)
    assert json.loads(data)['schema'] == 'OperatorCommand'
    assert json.loads(data)['body'] == {'command': 'recall', 'auvs': ['auv_3']}
    assert codec.decode(data)[1] == command


def test_the_order_of_keys_does_not_matter() -> None:
    envelope = json.loads(payload())
    data = json.dumps(dict(reversed(envelope.items()))).encode()
    assert codec.decode(data) == codec.decode(payload())


def test_an_envelope_is_opened_without_its_body() -> None:
    # What the radio channel reads; the body is its receiver's business.
    envelope = codec.open_envelope(payload(body={'no': 'such body'}, schema='Gossip'))
    assert envelope.src == 'auv_1'
    with pytest.raises(MessageError):
        codec.open_body(envelope)


@pytest.mark.parametrize(
    ('changes', 'refusal', 'sender', 'path'),
    [
        ({'seq': -1}, Refusal.MALFORMED, '?', '`$.seq`'),
        ({'extra': 1}, Refusal.MALFORMED, '?', '`$`'),
        ({'src': ''}, Refusal.MALFORMED, '?', '`$.src`'),
        ({'version': 2}, Refusal.UNKNOWN_SCHEMA, 'auv_1', '`$.version`'),
        ({'version': 0}, Refusal.MALFORMED, '?', '`$.version`'),
        ({'schema': 'Gossip'}, Refusal.UNKNOWN_SCHEMA, 'auv_1', '`$.schema`'),
        ({'schema': 'Missed'}, Refusal.UNKNOWN_SCHEMA, 'auv_1', '`$.schema`'),
        ({'body': []}, Refusal.MALFORMED, 'auv_1', '`$.body`'),
        ({'body': {'`$.seq`': 1}}, Refusal.MALFORMED, 'auv_1', '`$.body`'),
        (
            {'body': {'acknowledges': 'PathAssignment', 'reference': '3'}},
            Refusal.MALFORMED,
            'auv_1',
            '`$.body.reference`',
        ),
        (
            {
                'schema': 'PathAssignment',
                'body': {
                    'auv': 'auv_1',
                    'leg': {'leg_id': 1, 'path': [[0, 0], [0, 2]], 'surface_deadline_s': 9},
                },
            },
            Refusal.MALFORMED,
            'auv_1',
            '`$.body.leg`',
        ),
    ],
)
def test_refusals_name_reason_sender_and_json_path(
    changes: dict[str, Any], refusal: Refusal, sender: str, path: str
) -> None:
    with pytest.raises(MessageError) as refused:
        codec.decode(payload(**changes))
    error = refused.value
    assert (error.refusal, error.sender) == (refusal, sender)
    assert path in error.detail
    assert str(error) == f'{refusal.value} message from {sender}: {error.detail}'


def test_nothing_is_rounded_or_converted() -> None:
    for reference in ('3', 3.0, True, None, [3]):
        body = {'acknowledges': 'PathAssignment', 'reference': reference}
        with pytest.raises(MessageError, match='reference'):
            codec.decode(payload(body=body))


def test_every_message_can_be_sent() -> None:
    # Each class name is its schema's name; events and commands travel under that of their union.
    assert codec.SCHEMA_TYPES[MISSION_EVENT] is MissionEvent
    assert codec.SCHEMA_TYPES[OPERATOR_COMMAND] == OperatorCommand
    for name, body_type in codec.SCHEMA_TYPES.items():
        assert name in (MISSION_EVENT, OPERATOR_COMMAND, getattr(body_type, '__name__', ''))
    assert codec.SCHEMA_TYPES['PathAssignment'] is PathAssignment


def test_messages_cannot_be_changed_or_given_other_fields() -> None:
    with pytest.raises(AttributeError):
        ACKNOWLEDGEMENT.reference = 4  # type: ignore[misc]
    with pytest.raises(TypeError):
        Ready(since_s=1.0)  # type: ignore[call-arg]
    with pytest.raises(msgspec.ValidationError):
        msgspec.convert({'since_s': 1.0}, Ready)
