"""
ROS parameter files: the settings of many nodes in one YAML text (``--params-file``).

Values are written so that rcl's parser reads them as the declared types: strings quoted whatever
they look like, numbers with a point where they are floating-point. An empty list has no type
there, so it is left out, which stands for the default.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import msgspec

from msgs_json.params import Params, specs, validated


def params_yaml(nodes: Mapping[str, Params], *, use_sim_time: bool) -> str:
    """
    Return a parameter file.

    Parameters
    ----------
    nodes
        Parameters by fully qualified node name (``/auv_1/auv``), as it is after remapping.
    use_sim_time
        For every node: True runs agents in lockstep with a world node, False on the ROS clock.

    Raises
    ------
    ValueError
        A parameter is out of its range, or an empty list whose default is not empty.

    """
    sections = [_section('/**', {'use_sim_time': use_sim_time})]
    sections += [_section(node, _values(node, params)) for node, params in nodes.items()]
    return ''.join(sections)


def _values(node: str, params: Params) -> dict[str, Any]:
    try:
        checked = validated(type(params), msgspec.structs.asdict(params))
    except ValueError as error:
        raise ValueError(f'{node}: {error}') from None
    values: dict[str, Any] = msgspec.structs.asdict(checked)
    for spec in specs(type(params)):
        if spec.value_type is list and not values[spec.name]:
            if spec.default:
                raise ValueError(
                    f'{node}: parameter {spec.name} is empty; a parameter file cannot say so'
                )
            del values[spec.name]
    return values


def _section(node: str, values: Mapping[str, Any]) -> str:
    lines = [f'{node}:', '  ros__parameters:']
    lines += [f'    {name}: {_literal(value)}' for name, value in values.items()]
    return '\n'.join(lines) + '\n'


def _literal(value: bool | float | str | tuple[Any, ...]) -> str:
    match value:
        case tuple():
            return f'[{", ".join(map(_literal, value))}]'
        case str():
            # A JSON string is a double-quoted YAML string; libyaml takes no surrogate pairs.
            return json.dumps(value, ensure_ascii=False)
        case bool():
            return 'true' if value else 'false'
        case _:
            return repr(value)
