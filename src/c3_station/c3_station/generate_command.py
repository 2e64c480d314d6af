"""``orchestrate.py generate``: draw scenarios and write them as files."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from c3_station.exit_codes import ExitCode
from c3_station.program import command_line
from c3_station.scenario_files import SUFFIXES
from c3_station.scenario_generator import USUAL_MODELS, generate_scenario
from c3_station.scenario_writer import scenario_yaml

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from rich.console import Console

    from c3_station.scenario import Scenario
    from c3_station.scenario_generator import Span


@dataclass(frozen=True, slots=True, kw_only=True)
class GenerateOptions:
    """What to draw and where to write it."""

    seed: int
    """Of the first scenario; each further one has the next."""
    count: int
    asked: Mapping[str, Span]
    """Where quantities must lie, by name."""
    models: Sequence[str]
    """Surfacing models."""
    out: Path
    """A file for one scenario, or a folder."""
    force: bool
    """Whether to replace files."""


def generate(options: GenerateOptions, console: Console) -> ExitCode:
    """
    Write scenarios and say where.

    Raises
    ------
    ValueError
        What is asked for cannot be drawn, or a file would be replaced or cannot be written.

    """
    is_file = options.out.suffix in SUFFIXES
    if is_file and options.count > 1:
        raise ValueError(f'{options.out} is one file; allowed for {options.count}: a folder')
    seeds = range(options.seed, options.seed + options.count)
    paths = {
        seed: options.out if is_file else options.out / f'generated_{seed}.yaml' for seed in seeds
    }
    for path in paths.values():
        with _told_by_path(path):
            exists = path.exists()
        if exists and not options.force:
            raise ValueError(f'--out {path}: exists already; name another, or add --force')
    for seed, path in paths.items():
        scenario = generate_scenario(seed, options.asked, options.models)
        text = scenario_yaml(scenario, _heading(seed, options))
        with _told_by_path(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding='utf-8')
        console.print(f'{path}: {_content(scenario)}', highlight=False, soft_wrap=True)
    return ExitCode.OK


@contextmanager
def _told_by_path(path: Path) -> Iterator[None]:
    """Make of what the file system refuses an error of input."""
    try:
        yield
    except OSError as error:
        raise ValueError(f'--out {path}: cannot be written, {error.strerror}') from None


def _heading(seed: int, options: GenerateOptions) -> str:
    words = ['generate', '--seed', str(seed)]
    for name, span in options.asked.items():
        words += [f'--{name}', str(span)]
    if tuple(options.models) != USUAL_MODELS:
        words += ['--models', ','.join(options.models)]
    return f'Drawn by {command_line(*words)}'


def _content(scenario: Scenario) -> str:
    return f'{scenario.region}, {len(scenario.auvs)} AUVs, L {scenario.sortie.limit_s:g} s'
