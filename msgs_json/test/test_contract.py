"""
Types, JSON Schemas and examples say the same; whatever arrives, decoding refuses or succeeds.
"""

from __future__ import annotations

import copy
import enum
import functools
import json
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import hypothesis.strategies as st
import jsonschema
import msgspec
import pytest
from hypothesis import given, settings
from msgspec import inspect

from msgs_json import codec, json_schemas, messages
from msgs_json.codec import DETAIL_MAX_CHARS, SCHEMA_TYPES, MessageError, Refusal
from msgs_json.geometry import path_problem
from msgs_json.messages import (
    Command,
    Event,
    Leg,
    Message,
    MissionEvent,
    OperatorCommand,
    SampleSpan,
)

SCHEMAS = Path(json_schemas.__file__).parent / 'schemas'
EXAMPLES = Path(json_schemas.__file__).parent / 'examples'
VALID = sorted((EXAMPLES / 'valid').glob('*.json'))
INVALID = sorted((EXAMPLES / 'invalid').glob('*.json'))

# What JSON Schema cannot say, and the examples that show it. Everything else must agree.
BEYOND_JSON_SCHEMA = {
    'the cells of a path are neighbours': {
        'MissionOrder--diagonal_move',
        'PathAssignment--diagonal_move',
        'PathAssignment--jump',
        'SortieReport--diagonal_move',
    },
    'a span ends after it has begun': {
        'SampleReceipt--span_backwards',
        'SampleReceipt--span_empty',
        'SortieReport--cargo_empty',
    },
    # For JSON Schema 14.0 is an integer.
    'a whole number is written without a decimal point': {
        'MissionEvent-mission_completed--cells_delivered_with_decimal_point',
        'PathAssignment--column_with_decimal_point',
        'Tick--tick_with_decimal_point',
    },
}
ACCEPTED_BY_SCHEMA_ALONE = frozenset().union(*BEYOND_JSON_SCHEMA.values())


def example_id(path: Path) -> str:
    return path.stem


def schema_name(path: Path) -> str:
    return path.stem.partition('-')[0]


@functools.cache
def validator(name: str, *, strict_integers: bool = False) -> jsonschema.protocols.Validator:
    base = jsonschema.Draft202012Validator
    if strict_integers:
        checker = base.TYPE_CHECKER.redefine('integer', lambda _, value: type(value) is int)
        base = jsonschema.validators.extend(base, type_checker=checker)
    return base(json.loads((SCHEMAS / f'{name}.json').read_text()))


def refuse_constant(text: str) -> None:
    raise ValueError(f'{text} is not JSON')


def schema_accepts(name: str, data: bytes) -> bool:
    try:
        payload = json.loads(data, parse_constant=refuse_constant)
    except ValueError:  # not JSON, or not UTF-8
        return False
    return bool(validator(name).is_valid(payload))


# --- schemas -------------------------------------------------------------------------------------


def test_every_message_type_has_a_schema() -> None:
    bodies = {
        thing
        for thing in vars(messages).values()
        if isinstance(thing, type) and issubclass(thing, Message)
    }
    parts = {Message, Event, *get_args(MissionEvent), Command, *get_args(OperatorCommand)}
    parts |= {Leg, messages.AuvOrder, messages.Sample, messages.SampleSpan}
    parts |= {messages.Meeting, messages.AuvStatus}
    parts |= {messages.SortieOutlook, messages.ExpectedContact}
    unions = {codec.MISSION_EVENT, codec.OPERATOR_COMMAND}
    assert {t.__name__ for t in bodies - parts} | unions == set(SCHEMA_TYPES)


def test_checked_in_schemas_are_those_that_the_command_writes(tmp_path: Path) -> None:
    json_schemas.write_schemas(tmp_path)
    assert {path.stem for path in SCHEMAS.iterdir()} == set(SCHEMA_TYPES)
    for path in SCHEMAS.iterdir():
        assert path.read_text() == (tmp_path / path.name).read_text(), (
            f'{path.stem}: run python -m msgs_json.json_schemas'
        )


@pytest.mark.parametrize('name', SCHEMA_TYPES)
def test_schema_is_one_and_needs_no_network(name: str) -> None:
    schema = json_schemas.json_schema(name)
    jsonschema.Draft202012Validator.check_schema(schema)
    assert schema['$id'] == f'urn:shearwater:{name}:1'
    references = re.findall(r'"\$ref": "([^"]*)"', json.dumps(schema))
    assert all(reference.startswith('#/$defs/') for reference in references)


@pytest.mark.parametrize('name', SCHEMA_TYPES)
def test_every_physical_field_has_its_unit(name: str) -> None:
    units = {'s': 's', 'm': 'm', 'mps': 'm/s'}
    for field, content in fields_of(json_schemas.json_schema(name)):
        if field != 'stamp':  # ROS's own name; its unit is that of all times
            assert content.get('x-unit') == units.get(field.rpartition('_')[2])


def fields_of(node: object) -> Iterator[tuple[str, dict[str, Any]]]:
    if isinstance(node, dict):
        yield from node.get('properties', {}).items()
        for value in node.values():
            yield from fields_of(value)


def test_docstrings_of_fields_reach_the_schema() -> None:
    body = json_schemas.json_schema('SurfacingReport')['$defs']['SurfacingReport']
    assert body['properties']['samples']['description'].startswith('The oldest ones that nobody')


# --- examples ------------------------------------------------------------------------------------


def kinds(union: object) -> set[str]:
    return {kind.__struct_config__.tag for kind in get_args(union)}


def test_every_message_and_every_kind_of_event_and_command_has_examples() -> None:
    valid = Counter(path.stem for path in VALID)
    invalid = Counter(path.stem.partition('--')[0] for path in INVALID)
    messages_and_events = set(SCHEMA_TYPES) - {codec.MISSION_EVENT, codec.OPERATOR_COMMAND}
    messages_and_events |= {f'MissionEvent-{kind}' for kind in kinds(MissionEvent)}
    # Most commands are a word and nothing else: there is not much to do wrong.
    commands = {f'OperatorCommand-{kind}' for kind in kinds(OperatorCommand)}
    assert {name for name in messages_and_events | commands if valid[name] < 1} == set()
    assert {name for name in messages_and_events if invalid[name] < 3} == set()
    assert {name for name in commands if invalid[name] < 1} == set()


@pytest.mark.parametrize('path', VALID, ids=example_id)
def test_valid_example(path: Path) -> None:
    data = path.read_bytes()
    envelope, body = codec.decode(data)
    assert envelope.schema == schema_name(path)
    assert schema_accepts(envelope.schema, data)
    again = codec.encode(
        body,
        src=envelope.src,
        dst=envelope.dst,
        seq=envelope.seq,
        stamp_s=envelope.stamp,
    )
    assert json.loads(again) == json.loads(data)


@pytest.mark.parametrize('path', INVALID, ids=example_id)
def test_invalid_example(path: Path) -> None:
    data = path.read_bytes()
    with pytest.raises(MessageError) as refused:
        codec.decode(data)
    assert '`$' in refused.value.detail
    assert schema_accepts(schema_name(path), data) == (path.stem in ACCEPTED_BY_SCHEMA_ALONE)


def test_what_schemas_cannot_say_is_shown_by_examples() -> None:
    assert {path.stem for path in INVALID} >= ACCEPTED_BY_SCHEMA_ALONE


# --- types and schemas agree on anything ---------------------------------------------------------

Place = tuple[int | str, ...]

json_values = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**60), 2**60)
    | st.integers(-1, 3)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(max_size=40),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner),
    max_leaves=5,
)


def places(node: object, here: Place = ()) -> Iterator[Place]:
    yield here
    if isinstance(node, dict | list):
        for key, value in node.items() if isinstance(node, dict) else enumerate(node):
            yield from places(value, (*here, key))


@st.composite
def altered_payloads(draw: st.DrawFn) -> dict[str, Any]:
    """A valid example in which one thing was replaced, removed, added or copied."""
    payload: dict[str, Any] = json.loads(draw(st.sampled_from(VALID)).read_text())
    spots = [spot for spot in places(payload) if spot and spot[0] != 'schema']
    *parents, key = draw(st.sampled_from(spots))
    node = functools.reduce(lambda inner, step: inner[step], parents, payload)
    what = draw(st.sampled_from(['replace', 'remove', 'add', 'copy']))
    if what == 'remove':
        del node[key]
    elif what == 'add' and isinstance(node, dict):
        node.setdefault(draw(st.text(max_size=8)), draw(json_values))
    elif what == 'copy' and isinstance(node, list):
        node.insert(key, copy.deepcopy(node[key]))
    else:
        node[key] = draw(json_values)
    return payload


def is_beyond_json_schema(node: object) -> bool:
    """Whether a leg (a path with a deadline, but no event) is no path, or a span is none."""
    if isinstance(node, dict):
        if node.keys() >= {'leg_id', 'path', 'surface_deadline_s'} and 'event' not in node:
            return path_problem(node['path']) is not None
        if node.keys() == {'auv', 'first', 'until'}:
            return bool(node['first'] >= node['until'])
        return any(is_beyond_json_schema(value) for value in node.values())
    return isinstance(node, list) and any(is_beyond_json_schema(value) for value in node)


@given(altered_payloads())
@settings(max_examples=150)
def test_types_and_schemas_agree(payload: dict[str, Any]) -> None:
    is_accepted = refusal_of(json.dumps(payload).encode()) is None
    by_schema = validator(payload['schema'], strict_integers=True).is_valid(payload)
    assert is_accepted == (by_schema and not is_beyond_json_schema(payload))


# --- every value of every type survives the way through JSON -------------------------------------


@st.composite
def paths(draw: st.DrawFn) -> tuple[tuple[int, int], ...]:
    cells = [draw(st.tuples(st.integers(1, 9998), st.integers(1, 9998)))]
    for col, row in draw(
        st.lists(st.sampled_from([(1, 0), (0, 1), (-1, 0), (0, -1)]), min_size=1)
    ):
        before = cells[-1]
        after = (before[0] + col, before[1] + row)
        cells.append(after if all(0 <= index <= 9999 for index in after) else cells[-2])
    return tuple(cells)


@st.composite
def spans(draw: st.DrawFn, parts: dict[str, st.SearchStrategy[Any]]) -> SampleSpan:
    first, until = sorted(draw(st.sets(parts['first'], min_size=2, max_size=2)))
    return SampleSpan(auv=draw(parts['auv']), first=first, until=until)


def values(kind: inspect.Type) -> st.SearchStrategy[Any]:
    """Return a strategy for a type as msgspec sees it."""
    match kind:
        case inspect.Metadata(type=inner):
            return values(inner)
        case inspect.StructType(cls=cls, fields=fields):
            parts = {field.name: values(field.type) for field in fields}
            if cls is Leg:
                parts['path'] = paths()
            if cls is SampleSpan:
                return spans(parts)
            return st.builds(cls, **parts)
        case inspect.EnumType(cls=cls):
            return st.sampled_from(list(cls))
        case inspect.UnionType(types=types):
            return st.one_of([values(each) for each in types])
        case inspect.VarTupleType(item_type=item, min_length=shortest):
            return st.lists(values(item), min_size=shortest or 0, max_size=4).map(tuple)
        case inspect.TupleType(item_types=items):
            return st.tuples(*[values(item) for item in items])
        case inspect.DictType(key_type=key, value_type=value):
            return st.dictionaries(values(key), values(value), max_size=4)
        case inspect.IntType(ge=low, le=high):
            return st.integers(low, high)
        case inspect.FloatType(gt=above, ge=low, le=high):
            return st.floats(
                low if above is None else above,
                high,
                exclude_min=above is not None,
                allow_nan=False,
                allow_infinity=False,
            )
        case inspect.StrType(min_length=shortest, max_length=longest, pattern=pattern):
            if pattern is None:
                return st.text(min_size=shortest or 0, max_size=longest)
            return st.from_regex(pattern).filter(lambda text: len(text) <= (longest or len(text)))
        case inspect.BytesType(min_length=shortest):
            return st.binary(min_size=shortest or 0, max_size=100)
        case inspect.BoolType():
            return st.booleans()
        case inspect.NoneType():
            return st.none()
        case inspect.RawType():
            return json_values.map(lambda value: msgspec.Raw(msgspec.json.encode(value)))
    raise TypeError(f'no strategy for {kind}')


def plain(value: object) -> object:
    """Return something comparable: `Raw` compares by identity."""
    if isinstance(value, msgspec.Raw):
        return bytes(value)
    if isinstance(value, msgspec.Struct):
        return type(value), plain(msgspec.structs.asdict(value))
    if isinstance(value, dict):
        return {key: plain(each) for key, each in value.items()}
    return tuple(plain(each) for each in value) if isinstance(value, tuple) else value


@pytest.mark.parametrize('name', SCHEMA_TYPES)
def test_round_trip(name: str) -> None:
    envelopes = st.fixed_dictionaries(
        {
            'src': st.text(min_size=1, max_size=64),
            'dst': st.text(min_size=1, max_size=64),
            'seq': st.integers(0, 2**53),
            'stamp_s': st.floats(0, 1e11),
        }
    )

    @given(values(inspect.type_info(SCHEMA_TYPES[name])), envelopes)
    @settings(max_examples=20)
    def check(body: Message, sent: dict[str, Any]) -> None:
        data = codec.encode(body, **sent)
        envelope, received = codec.decode(data)
        assert plain(received) == plain(body)
        assert (envelope.src, envelope.dst) == (sent['src'], sent['dst'])
        assert (envelope.seq, envelope.stamp) == (sent['seq'], sent['stamp_s'])
        assert schema_accepts(name, data)

    check()


# --- whatever arrives ----------------------------------------------------------------------------


def refusal_of(data: bytes) -> MessageError | None:
    """Return why a payload is refused, None if it is not; any other error is a failure."""
    try:
        codec.decode(data)
    except MessageError as refused:
        error = refused
    else:
        return None
    assert '`$' in error.detail
    assert len(error.detail) <= DETAIL_MAX_CHARS + 100
    return error


@given(st.binary(max_size=200))
def test_noise_is_refused(data: bytes) -> None:
    refused = refusal_of(data)
    assert refused is not None
    assert refused.refusal is Refusal.MALFORMED


@st.composite
def damaged_payloads(draw: st.DrawFn) -> bytes:
    data = draw(st.sampled_from(VALID + INVALID)).read_bytes()
    start, end = sorted(draw(st.tuples(*[st.integers(0, len(data))] * 2)))
    middle = draw(st.binary(max_size=8) | st.sampled_from([b'NaN', b'1e999', b'"\\ud800"', b'{']))
    return data[:start] + middle + data[draw(st.sampled_from([start, end])) :]


@given(damaged_payloads())
@settings(max_examples=300)
def test_damage_is_refused_or_harmless(data: bytes) -> None:
    refusal_of(data)  # raises nothing else


VALID_HELLO = (EXAMPLES / 'valid' / 'Hello.json').read_bytes()


@pytest.mark.parametrize(
    'data',
    [
        b'[' * 1_000_000,
        b'{"a":' * 1_000_000,
        VALID_HELLO.replace(b'"agent"', b'[' * 1_000_000),
        VALID_HELLO.replace(b'"agent"', b'[' * 100_000 + b']' * 100_000),
    ],
    ids=['arrays', 'objects', 'in_body_open', 'in_body_closed'],
)
def test_deep_nesting_is_refused(data: bytes) -> None:
    refused = refusal_of(data)
    assert refused is not None
    assert refused.refusal is Refusal.MALFORMED


@pytest.mark.parametrize(
    'data',
    [
        VALID_HELLO.replace(b'agent', b'x' * 10_000_000),
        VALID_HELLO.replace(b'"kind"', b'"' + b'k' * 10_000_000 + b'"'),
        VALID_HELLO.replace(b'"auth"', b'"' + b'k' * 10_000_000 + b'": 1, "auth"'),
        VALID_HELLO.replace(b'auv_1', b'a' * 10_000_000),
    ],
    ids=['value', 'key_of_body', 'key_of_envelope', 'src'],
)
def test_huge_payload_is_refused_in_few_words(data: bytes) -> None:
    assert refusal_of(data) is not None


@pytest.mark.parametrize('text', [b'NaN', b'Infinity', b'-Infinity', b'1e999', b'null', b'true'])
@pytest.mark.parametrize('field', [b'"stamp": 14.0', b'"time_s": 14.0'])
def test_numbers_are_finite(field: bytes, text: bytes) -> None:
    data = (EXAMPLES / 'valid' / 'Tick.json').read_bytes()
    key = field.partition(b' ')[0]
    assert refusal_of(data.replace(field, key + b' ' + text)) is not None


def test_of_a_key_given_twice_the_last_counts() -> None:
    # As in Python's json and in JavaScript. The channel and the receiver read with the same
    # decoder, so nobody can be one agent to the one and another agent to the other.
    data = VALID_HELLO.replace(b'"src"', b'"src": "mallory", "src"')
    assert codec.decode(data)[0].src == json.loads(data)['src'] == 'auv_1'


def test_unknown_schema_names_what_is_known() -> None:
    refused = refusal_of(VALID_HELLO.replace(b'Hello', b'Helo'))
    assert refused is not None
    assert refused.refusal is Refusal.UNKNOWN_SCHEMA
    assert refused.sender == 'auv_1'
    assert 'Hello' in refused.detail


def test_every_value_of_an_enum_is_one_word_of_json() -> None:
    for thing in vars(messages).values():
        if isinstance(thing, type) and issubclass(thing, enum.Enum):
            assert all(re.fullmatch('[A-Za-z_]+', member.value) for member in thing)
