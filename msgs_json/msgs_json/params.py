"""
Node parameters, declared once: as the fields of a `Params` struct.

The same declaration validates scenario values, declares the ROS parameters (type, range,
description) and writes ``docs/interfaces.md``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, TypeVar, get_args, get_origin, get_type_hints

import msgspec


class Params(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Base of every node's parameters; fields are bool, int, float, str or lists of these."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ParamSpec:
    """One declared parameter."""

    name: str
    value_type: type
    """bool, int, float, str or list."""
    item_type: type | None
    """For lists: int, float or str."""
    default: Any
    minimum: float | None
    maximum: float | None
    unit: str
    description: str


def param(
    description: str, *, unit: str = '', ge: float | None = None, le: float | None = None
) -> msgspec.Meta:
    """Describe a parameter, for use in ``Annotated``; the range includes its ends."""
    return msgspec.Meta(description=description, ge=ge, le=le, extra_json_schema={'x-unit': unit})


ParamsT = TypeVar('ParamsT', bound=Params)


def specs(params_type: type[Params]) -> tuple[ParamSpec, ...]:
    """Return the declared parameters of a node, in order."""
    hints = get_type_hints(params_type, include_extras=True)
    found = []
    for field in msgspec.structs.fields(params_type):
        annotation = hints[field.name]
        meta = msgspec.Meta()
        if get_origin(annotation) is Annotated:
            annotation, meta = get_args(annotation)
        is_list = get_origin(annotation) in (list, tuple)
        default = (
            field.default_factory()
            if field.default_factory is not msgspec.NODEFAULT
            else field.default
        )
        found.append(
            ParamSpec(
                name=field.name,
                value_type=list if is_list else annotation,
                item_type=get_args(annotation)[0] if is_list else None,
                default=default,
                minimum=meta.ge,
                maximum=meta.le,
                unit=(meta.extra_json_schema or {}).get('x-unit', ''),
                description=meta.description or '',
            )
        )
    return tuple(found)


def validated(params_type: type[ParamsT], values: dict[str, Any]) -> ParamsT:
    """
    Return the parameters, checked.

    Raises
    ------
    ValueError
        Names the parameter, its value and what is allowed.

    """
    try:
        return msgspec.convert(values, params_type)
    except msgspec.ValidationError as error:
        text = str(error)
        name = text.partition('`$.')[2].rstrip('`').partition('[')[0]
        value = f', is {values[name]!r}' if name in values else ''
        raise ValueError(f'parameter {name or "?"}: {text}{value}') from None
