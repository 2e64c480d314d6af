"""YAML with the line of every key, and without the traps: a key given twice is a problem."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import yaml

from c3_station.shape_checks import KeyPath, Problem, shown

if TYPE_CHECKING:
    from collections.abc import Iterator


@dataclass(frozen=True, slots=True, kw_only=True)
class YamlTree:
    """What a YAML text holds and where."""

    value: Any
    problems: tuple[Problem, ...]
    """Keys that are given twice, or are no text."""
    lines: dict[KeyPath, int]
    """Line of every key and list item, counted from 1."""

    def line_of(self, path: KeyPath) -> int | None:
        """Return the line of a key, or of the nearest part above it that is in the text."""
        while path and path not in self.lines:
            path = path[:-1]
        return self.lines.get(path)


def read_yaml(text: str) -> YamlTree:
    """
    Return the values of a YAML text.

    Raises
    ------
    yaml.YAMLError
        The text is not YAML.
    RecursionError
        It is nested too deeply, or refers to itself.

    """
    loader = _Loader(text)
    try:
        node = loader.get_single_node()
        if node is None:
            return YamlTree(value=None, problems=(), lines={})
        lines: dict[KeyPath, int] = {}
        problems = tuple(_walk(node, (), lines))
        value = loader.construct_document(node)
    finally:
        loader.dispose()
    return YamlTree(value=value, problems=problems, lines=lines)


class _Loader(yaml.SafeLoader):
    """Plain values only, and numbers as people write them."""


# YAML 1.1 takes 1e3 and 1e-3 for text.
_Loader.add_implicit_resolver(
    'tag:yaml.org,2002:float', re.compile(r'^[-+]?[0-9]+[eE][-+]?[0-9]+$'), list('-+0123456789')
)


def _walk(node: yaml.Node, path: KeyPath, lines: dict[KeyPath, int]) -> Iterator[Problem]:
    """Note the line of every key; yield a problem for keys that are given twice or are no text."""
    lines.setdefault(path, node.start_mark.line + 1)
    if isinstance(node, yaml.SequenceNode):
        for index, item in enumerate(node.value):
            yield from _walk(item, (*path, index), lines)
    elif isinstance(node, yaml.MappingNode):
        seen: dict[str, int] = {}
        for key, value in node.value:
            line = key.start_mark.line + 1
            name = str(key.value)
            if key.tag not in ('tag:yaml.org,2002:str', 'tag:yaml.org,2002:merge'):
                yield Problem((*path, name), f'is a key that is no text: {shown(key.value)}')
            if name in seen:
                yield Problem((*path, name), f'is given twice, in lines {seen[name]} and {line}')
            seen[name] = line
            lines[*path, name] = line
            yield from _walk(value, (*path, name), lines)
