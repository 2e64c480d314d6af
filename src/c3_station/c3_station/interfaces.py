"""
The text of ``docs/interfaces.md``, made from what the code declares.

``python -m c3_station.interfaces > docs/interfaces.md`` writes it; a test holds it current.
"""

from __future__ import annotations

import enum
import inspect
import math
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, get_args

from auv_sim.auv_params import AuvParams
from auv_sim.fleet_params import FleetParams
from auv_sim.world_params import WorldParams
from c3_station.c3_params import C3Params
from c3_station.exit_codes import ExitCode
from c3_station.recorder_params import RecorderParams
from msgs_json import geometry, messages
from msgs_json.codec import MISSION_EVENT, OPERATOR_COMMAND, Envelope, Refusal
from msgs_json.json_schemas import annotated_definitions, field_docs
from msgs_json.messages import (
    LOCKSTEP_MESSAGES,
    RADIO_MESSAGES,
    STATUS_MESSAGES,
    BlockReason,
    MissionEvent,
    OperatorCommand,
)
from msgs_json.node_exit import NodeExit
from msgs_json.params import Params, ParamSpec, specs
from msgs_json.topics import TOPICS, Qos, Topic
from uav_planner.uav_params import UavParams

_NODES: Mapping[str, type[Params]] = {
    'auv_sim auv': AuvParams,
    'auv_sim fleet': FleetParams,
    'uav_planner uav': UavParams,
    'c3_station c3': C3Params,
    'auv_sim world': WorldParams,
    'c3_station recorder': RecorderParams,
}
"""What ``ros2 run`` starts, and its parameters."""

_ROS_TYPES = {bool: 'bool', int: 'int', float: 'double', str: 'string'}

_PARTS = (
    geometry.GridSpec,
    geometry.Point,
    messages.AuvOrder,
    messages.Leg,
    messages.Sample,
    messages.SampleSpan,
    messages.Meeting,
    messages.SortieOutlook,
    messages.ExpectedContact,
    messages.AuvStatus,
)
"""Structs that messages are made of."""

_SCHEMAS = '../msgs_json/msgs_json/schemas'
_EXAMPLES = '../msgs_json/msgs_json/examples'

_CHOICES = (
    messages.Acknowledged,
    messages.LegOutcome,
    messages.RecoveryReason,
    messages.MissionState,
    messages.ContactState,
    messages.NodeKind,
)

_HEAD = """\
# Interfaces

<!-- Made by `python -m c3_station.interfaces`; edit the code it comes from instead. -->

Everything that crosses a process boundary: [topics](#topics), [JSON messages](#json-messages),
[node parameters](#node-parameters) and [exit codes](#exit-codes).

- Positions are in frame `map`: metres east and north of the region's south-west corner, z up.
- Times are seconds of ROS time, 0 ... 1e11; a simulated mission starts at 0.
- A *cell* is `[column, row]`, counted from 0 in the south-west.
- Ids, numbers and counts are whole, 0 ... 2^53, where nothing else is said.
- An *agent name* is a lower case letter, then up to 31 lower case letters, digits or `_`.
"""


def interfaces_markdown() -> str:
    """Return the whole page."""
    sections = [_HEAD, *_topics(), *_json_messages(), *_parameters(), *_exit_codes()]
    return '\n'.join(section.strip() + '\n' for section in sections if section)


# --- topics --------------------------------------------------------------------------------------


def _topics() -> Iterator[str]:
    yield """
## Topics

A relative name is placed by the node's namespace: `odom` of `/auv_1/auv` is `/auv_1/odom`. All
names can be remapped. JSON travels as `std_msgs/msg/String`.
"""
    yield _table(
        ('topic', 'type', 'QoS', 'published by', 'content'),
        (
            (
                f'`{t.name}`',
                f'`{t.ros_type}`',
                f'[{t.qos.name}](#quality-of-service)',
                t.publishers,
                _content(t),
            )
            for t in TOPICS
        ),
    )
    yield '### Quality of service'
    yield _table(
        ('profile', 'reliability', 'durability', 'depth', 'because'),
        (
            (
                qos.name,
                'reliable' if qos.value.reliable else 'best effort',
                'transient local' if qos.value.transient_local else 'volatile',
                str(qos.value.depth),
                qos.value.why,
            )
            for qos in Qos
        ),
    )


def _content(topic: Topic) -> str:
    """Return what a topic carries, with links to the messages."""
    names = {t.__name__ for t in (*LOCKSTEP_MESSAGES, *STATUS_MESSAGES)}
    names |= {MISSION_EVENT, OPERATOR_COMMAND}
    text = topic.content.replace('by radio', '[by radio](#by-radio)')
    return re.sub(r'\w+', lambda word: _link(word[0]) if word[0] in names else word[0], text)


# --- messages ------------------------------------------------------------------------------------


def _json_messages() -> Iterator[str]:
    yield f"""
## JSON messages

Every payload is an envelope; its `schema` says what is in its `body`. Decoding is strict: a key
too many or too few, another type, a number out of range or not finite, a whole number written with
a decimal point, a path whose cells are no neighbours: the message is [refused](#refusals).

Programs in other languages check what they send with the [schemas]({_SCHEMAS}) and try what they
read with the [examples]({_EXAMPLES}), right ones and wrong ones.

### Envelope
"""
    yield _fields(Envelope)
    yield '### By radio'
    yield 'What agents say on `radio/tx` and hear on `radio/rx`.'
    yield from _messages(RADIO_MESSAGES)
    yield '### For people and tools'
    yield from _messages(STATUS_MESSAGES)
    yield f"""
#### {MISSION_EVENT}

An entry of the mission's log: `event` says what happened, the envelope's `src` who says so and
its `stamp` when it was. [Schema]({_SCHEMAS}/{MISSION_EVENT}.json). The events:
"""
    yield from _kinds(MISSION_EVENT, MissionEvent)
    yield '### From operators'
    yield f"""
#### {OPERATOR_COMMAND}

What C3 is told by `orchestrate.py command`: `command` says what to do.
[Schema]({_SCHEMAS}/{OPERATOR_COMMAND}.json). The commands:
"""
    yield from _kinds(OPERATOR_COMMAND, OperatorCommand)
    yield '### Lockstep'
    yield 'How the world drives a simulated mission; see [architecture](architecture.md).'
    yield from _messages(LOCKSTEP_MESSAGES)
    yield '### Parts of messages'
    for part in _PARTS:
        yield from _struct(part, '####')
    yield '### Choices'
    for choice in _CHOICES:
        yield f'#### {choice.__name__}'
        yield _text(inspect.getdoc(choice) or '')
        yield _members(choice, 'value')
    yield """
### Refusals

What a receiver refuses it counts by sender and reason. The first of each it logs as
[MessageRefused](#messagerefused), with the JSON path of what is wrong.
"""
    yield _members(Refusal, 'reason')
    reasons = ', '.join(f'`{reason.value}`' for reason in BlockReason)
    yield f"""
The radio channel counts what it blocks in [RadioStatus](#radiostatus), by these reasons:
{reasons}.
"""


def _kinds(name: str, union: object) -> Iterator[str]:
    """Yield the messages of which a body is one, told apart by their tags."""
    for kind in get_args(union):
        example = f'{_EXAMPLES}/valid/{name}-{kind.__struct_config__.tag}.json'
        yield from _struct(kind, '#####', f'[Example]({example}).')


def _messages(types: Iterable[type]) -> Iterator[str]:
    for message in types:
        file = f'{message.__name__}.json'
        links = f'[Schema]({_SCHEMAS}/{file}), [example]({_EXAMPLES}/valid/{file}).'
        yield from _struct(message, '####', links)


def _struct(struct: type, heading: str, links: str = '') -> Iterator[str]:
    yield f'{heading} {struct.__name__}'
    yield f'{_text(inspect.getdoc(struct) or "")} {links}'
    yield _fields(struct)


def _fields(struct: type) -> str:
    """Return the table of a struct's fields, read from its JSON Schema."""
    fields = annotated_definitions([struct])[struct.__name__]['properties']
    if not fields:
        return 'It has no fields.'
    return _table(
        ('field', 'type', 'unit', 'allowed', 'meaning'),
        (
            (
                f'`{name}`',
                _type(schema),
                schema.get('x-unit', ''),
                _allowed(schema),
                '' if _type(schema) == 'agent name' else _text(schema.get('description', '')),
            )
            for name, schema in fields.items()
        ),
    )


def _type(schema: Mapping[str, Any]) -> str:
    match schema:
        case {'$ref': reference}:
            return _link(reference.rpartition('/')[2])
        case {'anyOf': choices}:
            return ' or '.join(map(_type, choices))
        case {'enum': [only]}:
            return f'`{only}`'
        case {'type': 'array', 'prefixItems': _}:
            return 'cell'
        case {'type': 'array', 'items': item}:
            name = _type(item)
            return f'list of {name}' if name.endswith(')') else f'list of {name}s'
        case {'type': 'object', 'additionalProperties': value}:
            return f'{_type(value)} by name'
        case {'type': 'string', 'pattern': _, 'description': str(text)} if 'agent name' in text:
            return 'agent name'
        case {'type': name}:
            return str(name)
    return 'any JSON'


def _allowed(schema: Mapping[str, Any]) -> str:
    """Return the range or length that a schema allows, where it is not the usual one."""
    for each in (schema, *schema.get('anyOf', ())):
        match each:
            case {'minimum': 0, 'maximum': 9007199254740992 | 1e11} | {'pattern': _}:
                return ''  # said at the top of the page
            case {'minimum': low, 'maximum': high}:
                return f'{_number(low)} ... {_number(high)}'
            case {'exclusiveMinimum': low, 'maximum': high}:
                return f'above {_number(low)}, up to {_number(high)}'
            case {'maxLength': longest}:
                return f'{each.get("minLength", 0)} ... {longest} characters'
            case {'minItems': fewest, 'maxItems': most, 'items': dict()}:
                return f'{fewest} ... {_number(most)} of them'
    return ''


# --- parameters ----------------------------------------------------------------------------------


def _parameters() -> Iterator[str]:
    yield """
## Node parameters

They are declared with description and range, so `ros2 param describe` shows them too, and cannot
be changed while a node runs. In a mission they are cut from the scenario: `orchestrate.py check
SCENARIO --params FILE` writes them as a parameter file.

Agents also obey `use_sim_time`: with `true` they work in lockstep with a world node, with `false`
on the clock, as at sea.
"""
    for node, params in _NODES.items():
        yield f'### {node}'
        yield _text((inspect.getdoc(params) or '').partition('\n\n')[2])
        yield _table(
            ('parameter', 'type', 'default', 'unit', 'range', 'meaning'),
            (
                (
                    f'`{spec.name}`',
                    _ros_type(spec),
                    f'`{_default(spec)}`',
                    spec.unit,
                    _range(spec),
                    _text(spec.description),
                )
                for spec in specs(params)
            ),
        )


def _ros_type(spec: ParamSpec) -> str:
    if spec.item_type is not None:
        return f'{_ROS_TYPES[spec.item_type]}[]'
    return _ROS_TYPES[spec.value_type]


def _default(spec: ParamSpec) -> str:
    if isinstance(spec.default, tuple | list):
        return f'[{", ".join(map(str, spec.default))}]'
    if isinstance(spec.default, str):
        return spec.default or "''"
    return str(spec.default).lower() if isinstance(spec.default, bool) else str(spec.default)


def _range(spec: ParamSpec) -> str:
    if spec.minimum is None or spec.maximum is None:
        return ''
    return f'{_number(spec.minimum)} ... {_number(spec.maximum)}'


# --- exit codes ----------------------------------------------------------------------------------


def _exit_codes() -> Iterator[str]:
    yield '## Exit codes'
    for codes in (ExitCode, NodeExit):
        yield _text(inspect.getdoc(codes) or '')
        yield _members(codes, 'code')


# --- Markdown ------------------------------------------------------------------------------------


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    """Return a table without the columns that are empty in every row."""
    rows = list(rows)
    used = [column for column in range(len(head)) if any(row[column] for row in rows)]
    lines = [[head[column] for column in used], ['---'] * len(used)]
    lines += [[row[column].replace('|', '\\|') for column in used] for row in rows]
    return '\n'.join(f'| {" | ".join(line)} |' for line in lines)


def _members(choice: type[enum.Enum], head: str) -> str:
    docs = field_docs(choice)
    return _table(
        (head, 'meaning'), ((f'`{m.value}`', _text(docs.get(m.name, ''))) for m in choice)
    )


def _link(name: str) -> str:
    return f'[{name}](#{name.lower()})'


def _text(docstring: str) -> str:
    """Return a docstring as one paragraph of Markdown; Python's None is JSON's null."""
    text = re.sub('``(.*?)``', r'`\1`', ' '.join(docstring.split()))
    return re.sub(r'\bNone\b', '`null`', text)


def _number(value: float) -> str:
    if value > 2**16 and math.log2(value).is_integer():
        return f'2^{math.log2(value):.0f}'
    return f'{value:,.0f}' if value == int(value) and abs(value) < 1e7 else f'{value:g}'


if __name__ == '__main__':
    sys.stdout.write(interfaces_markdown())
