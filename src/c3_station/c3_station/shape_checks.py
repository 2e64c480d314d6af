"""
Why plain values do not have the shape of a struct: all reasons, in a person's words.

msgspec checks the same and stops at the first; a file's author wants them all.
"""

from __future__ import annotations

import difflib
import functools
import math
from dataclasses import dataclass
from types import UnionType
from typing import TYPE_CHECKING, Annotated, Any, Union, get_args, get_origin

import msgspec
from msgspec import inspect

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

KeyPath = tuple[str | int, ...]
"""Keys and list indices from the top of a file down to a value."""

SHOWN_CHARACTERS = 60
"""A value longer than this is cut in a message."""


@dataclass(frozen=True, slots=True)
class Problem:
    """Something wrong at one place."""

    path: KeyPath
    text: str

    def __str__(self) -> str:
        return f'{_key(self.path)} {self.text}'


def shown(value: object) -> str:
    """Return a value as it stands in a message."""
    text = repr(value)
    return text if len(text) <= SHOWN_CHARACTERS else text[: SHOWN_CHARACTERS - 3] + '...'


def nearest(name: str, allowed: Iterable[str]) -> str:
    """Return a question that names the allowed name most like this one; empty if none is."""
    found = difflib.get_close_matches(name, list(allowed), n=1)
    return f' (did you mean {found[0]}?)' if found else ''


def shape_problems(value: object, struct: type[msgspec.Struct]) -> list[Problem]:
    """Return why plain values cannot be converted to a struct; empty if they can."""
    return list(_struct_problems(value, struct, ()))


def _struct_problems(
    value: object, struct: type[msgspec.Struct], path: KeyPath
) -> Iterator[Problem]:
    fields = _fields(struct)
    if not isinstance(value, dict):
        is_what = 'is empty' if value is None else f'is {shown(value)}'
        yield Problem(path, f'{is_what}; allowed: keys {", ".join(fields)}')
        return
    for key, item in value.items():
        if key in fields:
            yield from _problems(item, fields[key].type, (*path, key))
        else:
            yield Problem(
                (*path, str(key)),
                f'is {shown(item)}, but there is no such key{nearest(str(key), fields)};'
                f' allowed: {", ".join(fields)}',
            )
    for key, field in fields.items():
        if key not in value and field.required:
            yield Problem((*path, key), f'is missing; it must be {_allowed(field.type)}')


@functools.cache
def _fields(struct: type[msgspec.Struct]) -> dict[str, msgspec.structs.FieldInfo]:
    """Return the fields of a struct by key; kept, since to find their types takes long."""
    return {field.encode_name: field for field in msgspec.structs.fields(struct)}


def _problems(value: object, expected: Any, path: KeyPath) -> Iterator[Problem]:  # noqa: ANN401
    plain = get_args(expected)[0] if get_origin(expected) is Annotated else expected
    struct = _struct_type(plain, value)
    if struct is not None:
        yield from _struct_problems(value, struct, path)
        return
    item_type = _item_type(plain)
    if item_type is not None and isinstance(value, list):
        items_are_fine = True
        for index, item in enumerate(value):
            for problem in _problems(item, item_type, (*path, index)):
                items_are_fine = False
                yield problem
        if not items_are_fine:
            return  # the list as a whole would repeat the same problem
    try:
        msgspec.convert(value, expected)
        is_right = _is_finite(value)
    except (msgspec.ValidationError, TypeError):
        is_right = False
    if not is_right:
        yield Problem(path, f'is {shown(value)}; allowed: {_allowed(expected)}')


def _struct_type(expected: Any, value: object) -> type[msgspec.Struct] | None:  # noqa: ANN401
    """Return the struct that a value must be; of a choice only where the value may be one."""
    if isinstance(expected, type) and issubclass(expected, msgspec.Struct):
        return expected
    is_choice = isinstance(expected, UnionType) or get_origin(expected) is Union
    if is_choice and isinstance(value, dict):
        structs = [_struct_type(choice, value) for choice in get_args(expected)]
        return next(filter(None, structs), None)
    return None


def _item_type(expected: Any) -> Any:  # noqa: ANN401
    """Return the type of the items of a list of any length; None for everything else."""
    arguments = get_args(expected)
    is_list = get_origin(expected) is tuple and arguments[-1] is Ellipsis
    return arguments[0] if is_list else None


def _is_finite(value: object) -> bool:
    match value:
        case float():
            return math.isfinite(value)
        case dict():
            return all(_is_finite(item) for item in value.values())
        case list():
            return all(_is_finite(item) for item in value)
    return True


def _allowed(expected: Any) -> str:  # noqa: ANN401
    return _description(inspect.type_info(expected))


def _description(info: inspect.Type) -> str:
    """Return what a value may be, in words."""
    match info:
        case inspect.Metadata(type=inner, extra_json_schema=schema):
            about = (schema or {}).get('description')
            return f'{_description(inner)} ({about})' if about else _description(inner)
        case inspect.FloatType() | inspect.IntType():
            kind = 'a number' if isinstance(info, inspect.FloatType) else 'a whole number'
            return f'{kind}{_bounds(info)}'
        case inspect.StrType(pattern=pattern, max_length=length):
            limits = [f'of at most {length} characters'] if length else []
            limits += [f'of the form {pattern}'] if pattern else []
            return ' '.join(['text', *limits])
        case inspect.EnumType(cls=cls):
            return ' or '.join(str(member.value) for member in cls)
        case inspect.UnionType(types=types):
            return ' or '.join(_description(each) for each in types)
        case inspect.NoneType():
            return 'null'
        case inspect.TupleType(item_types=items):
            return f'[{", ".join(_description(item) for item in items)}]'
        case inspect.VarTupleType(item_type=item, min_length=least, max_length=most):
            count = f'{least or 0} or more' if most is None else f'{least or 0} to {most}'
            return f'a list of {count}, each {_description(item)}'
        case inspect.StructType(fields=fields):
            return f'keys {", ".join(field.encode_name for field in fields)}'
        case inspect.DictType():
            return 'keys and values'
    return type(info).__name__


def _bounds(info: inspect.FloatType | inspect.IntType) -> str:
    bounds = [
        f'{words} {float(bound):,.10g}'
        for words, bound in (
            ('at least', info.ge),
            ('more than', info.gt),
            ('at most', info.le),
            ('less than', info.lt),
        )
        if bound is not None
    ]
    return f', {" and ".join(bounds)}' if bounds else ''


def _key(path: KeyPath) -> str:
    """Return a path as ``auvs[0].initial_path``."""
    text = ''
    for part in path:
        text += f'[{part}]' if isinstance(part, int) else f'.{part}'
    return text.removeprefix('.') or 'the file'
