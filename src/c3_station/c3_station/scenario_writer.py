"""Scenarios as text: what `scenario_files` reads back to the same scenario."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import msgspec
import yaml

if TYPE_CHECKING:
    from collections.abc import Mapping

    from c3_station.scenario import Scenario

_COMMENTS: Mapping[str, str] = MappingProxyType(
    {
        'name': 'Units are in the key names.',
        'region': 'Cells are [col, row] from the south-west corner; masked ones: land, no-go.',
        'c3': 'Where sorties begin and end, metres from that corner.',
        'uav': 'Planners do not know of the wind.',
        'auvs': 'In visiting order.',
        'radio': 'Heard at the surface, within this horizontal distance.',
        'sortie': 'limit_s is L, from leaving C3 to being back.',
        'planner': 'Moves of a full path, q, and of the shortest one, Delta.',
        'tick_s': 'Everything moves in steps of a tick.',
        'max_mission_s': 'Hard stop, generous.',
        'pass': 'What must come out for exit code 0.',
    }
)
"""Above the keys of a scenario file that do not speak for themselves."""


class _Dumper(yaml.SafeDumper):
    """Paths of cells in one line; what has parts of its own in blocks."""


def _represent_list(dumper: yaml.SafeDumper, items: list[Any]) -> yaml.SequenceNode:
    in_line = not any(isinstance(item, dict) for item in items)
    return dumper.represent_sequence('tag:yaml.org,2002:seq', items, flow_style=in_line)


_Dumper.add_representer(list, _represent_list)


def scenario_yaml(scenario: Scenario, heading: str) -> str:
    """
    Return a scenario as a commented YAML file.

    Parameters
    ----------
    scenario
        What the file says; defaults are written out, so that they cannot change later.
    heading
        The comment at its top.

    """
    lines = [f'# {line}' for line in heading.splitlines()]
    content = _without_nulls(msgspec.to_builtins(scenario))
    text = yaml.dump(content, Dumper=_Dumper, default_flow_style=None, sort_keys=False, width=99)
    for line in text.splitlines():
        key = line.partition(':')[0]
        if key in _COMMENTS:
            lines += ['', f'# {_COMMENTS[key]}']
        lines.append(line)
    return '\n'.join([*lines, ''])


def _without_nulls(value: Any) -> Any:  # noqa: ANN401  plain YAML values
    """Return plain values without the keys that have none: to leave them out says the same."""
    if isinstance(value, dict):
        return {key: _without_nulls(each) for key, each in value.items() if each is not None}
    if isinstance(value, list | tuple):
        return [_without_nulls(each) for each in value]
    return value
