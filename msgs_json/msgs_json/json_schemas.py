"""
JSON Schemas of every payload, made from the message types.

A schema describes the whole payload, envelope and body, so that a program in any language can
check what it sends and receives; ``x-unit`` is the unit of a number. ``python -m
msgs_json.json_schemas`` writes them to ``schemas`` beside this file.

Two rules of the types are beyond JSON Schema and hold all the same: the cells of a path are
neighbours, and a whole number is written without a decimal point.
"""

from __future__ import annotations

import ast
import inspect
import json
import textwrap
from collections.abc import Iterable, Mapping
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import msgspec

from msgs_json import codec, geometry, messages
from msgs_json.codec import SCHEMA_TYPES, SCHEMA_VERSION, Envelope

SCHEMAS = Path(__file__).parent / 'schemas'

_REFERENCE = '#/$defs/{name}'
_UNITS = {'_mps': 'm/s', '_m': 'm', '_s': 's'}
"""Suffixes of field names and the unit each stands for."""

_TYPES = {
    name: thing
    for module in (codec, geometry, messages)
    for name, thing in vars(module).items()
    if isinstance(thing, type)
}


def json_schema(name: str) -> dict[str, Any]:
    """Return the schema of the payloads that name it in their ``schema`` field."""
    definitions = annotated_definitions([Envelope, SCHEMA_TYPES[name]])
    envelope = definitions.pop(Envelope.__name__)
    (body,), _ = msgspec.json.schema_components([SCHEMA_TYPES[name]], ref_template=_REFERENCE)
    envelope['properties'] |= {
        'schema': {'const': name},
        'version': {'type': 'integer', 'const': SCHEMA_VERSION},
        'body': body,
    }
    head = {
        '$schema': 'https://json-schema.org/draft/2020-12/schema',
        '$id': f'urn:shearwater:{name}:{SCHEMA_VERSION}',
    }
    return head | envelope | {'title': name, '$defs': definitions}


def annotated_definitions(types: Iterable[object]) -> dict[str, dict[str, Any]]:
    """Return the schemas of all structs and enums in some types, by name, with units and docs."""
    _, definitions = msgspec.json.schema_components(types, ref_template=_REFERENCE)
    for name, definition in definitions.items():
        _annotate(definition, _TYPES[name])
    return definitions


def json_schema_text(name: str) -> str:
    """Return the content of the schema's file."""
    return json.dumps(json_schema(name), indent=2) + '\n'


@cache  # of a module with many classes, the source of each is searched for anew
def field_docs(owner: type) -> Mapping[str, str]:
    """Return the docstrings below the fields of a class, or the members of an enum, by name."""
    (definition,) = ast.parse(textwrap.dedent(inspect.getsource(owner))).body
    docs = {}
    for field, doc in pairwise(definition.body if isinstance(definition, ast.ClassDef) else ()):
        match field, doc:
            case (
                (ast.AnnAssign(target=ast.Name(name)) | ast.Assign(targets=[ast.Name(name)])),
                ast.Expr(value=ast.Constant(value=str(text))),
            ):
                docs[name] = ' '.join(text.split())
    return docs


def unit_of(field: str) -> str | None:
    """Return the unit that a field's name ends in, None for a field without one."""
    return next((unit for suffix, unit in _UNITS.items() if field.endswith(suffix)), None)


def _annotate(definition: dict[str, Any], owner: type) -> None:
    """Add to a struct's schema what msgspec does not know: docstrings and units of its fields."""
    docs = field_docs(owner)
    for name, field in definition.get('properties', {}).items():
        if name in docs:
            field.setdefault('description', docs[name])
        unit = unit_of(name)
        if unit:
            field.setdefault('x-unit', unit)


def write_schemas(folder: Path) -> None:
    """Write every schema to its file."""
    for name in SCHEMA_TYPES:
        (folder / f'{name}.json').write_text(json_schema_text(name), encoding='utf-8')


if __name__ == '__main__':
    write_schemas(SCHEMAS)
