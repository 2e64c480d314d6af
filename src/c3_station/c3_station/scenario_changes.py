"""
Changes to a scenario, as a person types them: ``sortie.limit_s=50``, ``auvs.0.speed_mps=1.5``.

A key is a dotted path from the top of the scenario file. Below ``auvs`` it goes on with the index
or the name of one AUV, or at once with the key of all of them. Values are YAML, several of them
with commas between; what they may be is checked with the scenario they go into.
"""

from __future__ import annotations

import copy
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import msgspec
import yaml

from c3_station.scenario import Auv
from c3_station.shape_checks import KeyPath, Problem, nearest, shown
from c3_station.yaml_tree import read_yaml

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

SURFACING = 'surfacing'
"""Short for ``auvs.surfacing``, with a name of `SURFACING_PRESETS` for its value."""

_EARLY_30 = {'model': 'early', 'probability': 0.3}
_ON_TIME = {'model': 'on_time'}
_SLOW = {'model': 'slow', 'least_factor': 0.5}

SURFACING_PRESETS: Mapping[str, tuple[Mapping[str, object], ...]] = MappingProxyType(
    {
        'on_time': (_ON_TIME,),
        'early_10': ({'model': 'early', 'probability': 0.1},),
        'early_30': (_EARLY_30,),
        'early_50': ({'model': 'early', 'probability': 0.5},),
        'slow': (_SLOW,),
        'mixed': (_EARLY_30, _SLOW, _ON_TIME),
    }
)
"""Surfacing models by the name of a whole fleet's; the AUVs get them in turn."""


class Change(msgspec.Struct, frozen=True, kw_only=True):
    """One key of a scenario and its new value."""

    key: str
    value: Any
    """Plain YAML values."""

    def __str__(self) -> str:
        """Return the change as it is typed."""
        listed = yaml.dump(
            [self.value],
            Dumper=_OneLineDumper,
            default_flow_style=True,
            sort_keys=False,
            width=float('inf'),
        )
        return f'{self.key}={listed.strip()[1:-1]}'


class _OneLineDumper(yaml.SafeDumper):
    """Writes text with line breaks in it on one line, too."""


_OneLineDumper.add_representer(
    str,
    lambda dumper, text: dumper.represent_scalar(
        'tag:yaml.org,2002:str', text, style=None if text.isprintable() else '"'
    ),
)


def read_change(text: str) -> Change:
    """
    Return the change that ``KEY=VALUE`` stands for.

    Raises
    ------
    ValueError
        It does not have that form, or it has several values.

    """
    changes = read_variants(text)
    if len(changes) > 1:
        raise ValueError(f'{text}: has {len(changes)} values; allowed: KEY=VALUE')
    return changes[0]


def read_variants(text: str) -> tuple[Change, ...]:
    """
    Return the changes that ``KEY=V1,V2,...`` stands for, one for each value.

    Raises
    ------
    ValueError
        It does not have that form, or a value is given twice.

    """
    key, equals, values_text = text.partition('=')
    key = key.strip()
    if not equals or not all(key.split('.')):
        raise ValueError(f'{text}: allowed: KEY=VALUE, such as sortie.limit_s=50')
    try:
        # Commas inside of [] and {} do not count: that is a list in YAML.
        tree = read_yaml(f'[{values_text}\n]')
    except (yaml.YAMLError, RecursionError) as error:
        problem = error.problem if isinstance(error, yaml.MarkedYAMLError) else error
        raise ValueError(
            f'{text}: what follows {key}= is not YAML: {problem};'
            ' allowed: values with commas between'
        ) from None
    if tree.problems:
        raise ValueError('\n'.join(f'{text}: {problem}' for problem in tree.problems))
    changes = tuple(Change(key=key, value=value) for value in tree.value)
    if not changes:
        raise ValueError(f'{text}: has no value; allowed: KEY=VALUE, such as sortie.limit_s=50')
    for index, change in enumerate(changes):
        if change in changes[:index]:
            raise ValueError(f'{text}: has the value {shown(change.value)} twice')
    return changes


def change_content(content: dict[str, Any], change: Change) -> list[Problem]:
    """
    Make a change in the plain values of a well-formed scenario; return why it cannot be made.

    Mutates ``content``. A key that does not exist is made: the shape check tells of it.
    """
    parts = change.key.split('.')
    if parts == [SURFACING]:
        return list(_deal_surfacing(content['auvs'], change.value))
    return list(_put(content, parts, change.value, ()))


def _deal_surfacing(auvs: list[dict[str, Any]], name: object) -> Iterator[Problem]:
    if not isinstance(name, str) or name not in SURFACING_PRESETS:
        yield Problem(
            (SURFACING,),
            f'is {shown(name)}{nearest(str(name), SURFACING_PRESETS)};'
            f' allowed: {", ".join(SURFACING_PRESETS)}; for a model, set auvs.{SURFACING}',
        )
        return
    models = SURFACING_PRESETS[name]
    for index, auv in enumerate(auvs):
        auv[SURFACING] = dict(models[index % len(models)])


def _put(at: object, parts: list[str], value: object, path: KeyPath) -> Iterator[Problem]:
    part, *below = parts
    if path == ('auvs',) and isinstance(at, list):
        yield from _put_into_auvs(at, parts, value)
    elif not isinstance(at, dict):
        yield Problem(
            (*path, part), f'is part of a value, {shown(at)}; allowed: to set that as a whole'
        )
    elif below:
        yield from _put(at.setdefault(part, {}), below, value, (*path, part))
    else:
        at[part] = value


def _put_into_auvs(
    auvs: list[dict[str, Any]], parts: list[str], value: object
) -> Iterator[Problem]:
    part, *below = parts
    keys = Auv.__struct_fields__
    if part in keys:
        for index, auv in enumerate(auvs):
            yield from _put(auv, parts, copy.deepcopy(value), ('auvs', index))
        return
    for index, auv in enumerate(auvs):
        if below and part in (str(index), auv['name']):
            yield from _put(auv, below, value, ('auvs', index))
            return
    yield Problem(
        ('auvs', part),
        f'cannot be set; allowed: auvs.KEY for all of them, or auvs.AUV.KEY for one; AUV 0 to'
        f' {len(auvs) - 1} or {", ".join(auv["name"] for auv in auvs)}; KEY {", ".join(keys)}',
    )
