"""
Scenario files: YAML in, a checked `Scenario` out.

Whatever is wrong with a file is collected and reported at once, each problem with its line, key,
value and what is allowed.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import yaml

from c3_station.scenario import PROMISES, Scenario
from c3_station.scenario_changes import change_content
from c3_station.scenario_checks import mission_problems
from c3_station.shape_checks import nearest, shape_problems
from c3_station.yaml_tree import YamlTree, read_yaml

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from c3_station.scenario_changes import Change
    from c3_station.shape_checks import Problem

SUFFIXES = ('.yaml', '.yml')

_COMMAND_LINE = 'command line'
_SHIPPED = Path(__file__).parent / 'scenarios'


class ScenarioError(ValueError):
    """A scenario cannot be used; the text names its source and everything that is wrong."""

    def __init__(self, source: str, problems: Iterable[str]) -> None:
        self.source = source
        self.problems = tuple(problems)
        super().__init__('\n'.join(f'{source}: {problem}' for problem in self.problems))


def shipped_scenarios() -> Mapping[str, Path]:
    """Return the scenarios that come with Shearwater, by name."""
    return {path.stem: path for path in sorted(_SHIPPED.glob('*.yaml'))}


def load_scenario(name_or_path: str | Path) -> Scenario:
    """
    Return the scenario of a file, or a shipped one by name, with all defaults filled in.

    A relative path in the survey field is resolved against the folder of the file.

    Raises
    ------
    ScenarioError
        There is no such scenario, or something in it is wrong.

    """
    path = _path_of(name_or_path)
    tree = _read(path)
    field = tree.value.get('field') if isinstance(tree.value, dict) else None
    if isinstance(field, dict):
        _resolve_paths(field, path.parent)
    return _checked(tree.value, str(path), tree)


def parse_scenario(text: str) -> Scenario:
    """
    Return the scenario that a node parameter stands for: a shipped name, a file or JSON.

    Raises
    ------
    ScenarioError
        There is no such scenario, or something in it is wrong.

    """
    if not text.lstrip().startswith('{'):
        return load_scenario(text)
    try:
        value = msgspec.json.decode(text)
    except (msgspec.DecodeError, RecursionError) as error:
        raise ScenarioError('scenario JSON', [str(error)]) from None
    return _checked(value, 'scenario JSON', None)


def with_choices(
    scenario: Scenario,
    *,
    planner: str | None = None,
    seed: int | None = None,
    changes: Iterable[Change] = (),
) -> Scenario:
    """
    Return a scenario with another planner, another seed or changed keys; None keeps what it has.

    Another planner is flown with its default options: those in the file are the file's planner's.
    So are the times that the file expects; of its pass conditions only the promises are kept.
    Changes are made one after another, after that. A path in them is seen from where we are.

    Raises
    ------
    ScenarioError
        There is no such planner or key, or what comes out is no mission.

    """
    content = msgspec.json.decode(scenario_json(scenario))
    if planner is not None and planner != scenario.planner.name:
        content['planner'] |= {'name': planner, 'options': {}}
        content['pass'] = {name: content['pass'][name] for name in PROMISES}
    if seed is not None:
        content['seed'] = seed
    for change in changes:
        problems = change_content(content, change) or shape_problems(content, Scenario)
        if problems:
            raise ScenarioError(_COMMAND_LINE, map(str, problems))
        _resolve_paths(content['field'], Path())
    return _checked(content, _COMMAND_LINE, None)


def scenario_json(scenario: Scenario) -> bytes:
    """Return a scenario as JSON, every default written out; the same scenario, the same bytes."""
    return msgspec.json.encode(scenario)


def scenario_from_json(data: bytes | msgspec.Raw) -> Scenario:
    """
    Return the scenario of a recorded mission.

    Its shape is checked, but not whether this machine could fly it: planners and drivers may have
    changed since.

    Raises
    ------
    ScenarioError
        It is not the JSON of a scenario.

    """
    try:
        return msgspec.json.decode(data, type=Scenario)
    except msgspec.MsgspecError as error:
        raise ScenarioError('recorded scenario', [str(error)]) from None


def _path_of(name_or_path: str | Path) -> Path:
    shipped = shipped_scenarios()
    name = str(name_or_path)
    path = Path(name_or_path)
    if name in shipped:
        return shipped[name]
    if path.is_file():
        return path
    if path.suffix in SUFFIXES or len(path.parts) > 1:
        kind = 'is a folder, not a file' if path.is_dir() else 'there is no such file'
        raise ScenarioError(name, [kind])
    raise ScenarioError(
        name,
        [
            f'is neither a file nor a shipped scenario{nearest(name, shipped)};'
            f' shipped are: {", ".join(shipped)}'
        ],
    )


def _read(path: Path) -> YamlTree:
    try:
        return read_yaml(path.read_text(encoding='utf-8'))
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = f'line {mark.line + 1}, column {mark.column + 1}: ' if mark else ''
        problem = f'{line}{error.problem or error.context}'
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        problem = f'not a text file in UTF-8: {str(error).splitlines()[0]}'
    except OSError as error:
        problem = f'cannot be read: {error.strerror}'
    except RecursionError:
        problem = 'nested too deeply, or a part contains itself'
    raise ScenarioError(str(path), [problem])


def _resolve_paths(field: dict[Any, Any], folder: Path) -> None:
    """Make the file of the survey field absolute; mutates ``field``."""
    path = field.get('path')
    if isinstance(path, str):
        field['path'] = str((folder / path).resolve())


def _checked(value: Any, source: str, tree: YamlTree | None) -> Scenario:  # noqa: ANN401
    problems = [*(tree.problems if tree else ()), *shape_problems(value, Scenario)]
    if not problems:
        scenario = msgspec.convert(value, Scenario)
        problems = mission_problems(scenario)
        if not problems:
            return scenario
    if tree:
        problems.sort(key=lambda problem: tree.line_of(problem.path) or 0)
    raise ScenarioError(source, [_text(problem, tree) for problem in problems])


def _text(problem: Problem, tree: YamlTree | None) -> str:
    line = tree.line_of(problem.path) if tree else None
    return str(problem) if line is None else f'line {line}: {problem}'
