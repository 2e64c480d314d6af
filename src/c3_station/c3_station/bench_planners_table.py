"""The benchmark of planners in the terminal: a table for each family that fits 80 columns."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rich.text import Text

from c3_station.bench_families import family_figures

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.console import Console

    from c3_station.bench_statistics import Block, Line, Verdict

_DASH = '\N{EN DASH}'
_AT_LEAST = '\N{GREATER-THAN OR EQUAL TO}'
_BEST = '*'

COLUMNS = (
    ('planner', 'the best one of the family is marked'),
    ('done', 'missions in which the whole region was explored by the hard stop'),
    ('/bound', 'time to explore it over the lower bound: mean of the missions'),
    ('worst', 'the same, the worst mission'),
    ('at C3', 'when all data was at C3, seconds: mean'),
    ('negl', 'neglect, % of the time to explore, summed over the AUVs: mean'),
    ('revis', 'moves into cells entered before, until all was explored: mean'),
    ('sort', 'sorties: mean'),
    ('>L', 'sorties that took longer than L, of all missions together'),
    ('p50', 'planning a path in flight, processor time, ms: median'),
    ('p99', 'the same; one in a hundred takes longer'),
    ('start', 'planning before take-off, processor time, s: the longest'),
    ('MiB', 'largest memory of a process that flew a mission'),
)
"""Title and meaning of each column."""


def print_blocks(blocks: Sequence[Block], console: Console) -> None:
    """Print a table for each family."""
    titles = tuple(title for title, _ in COLUMNS)
    rows = {line: cells_of(line, block) for block in blocks for line in block.lines}
    widths = [max(map(len, column)) for column in zip(titles, *rows.values(), strict=True)]
    for block in blocks:
        family = block.family
        console.print(Text.assemble((family.name, 'bold'), f': {family.what}'), soft_wrap=True)
        console.print(Text(family_figures(family)))
        console.print(Text(_line(titles, widths), style='dim'), soft_wrap=True)
        for line in block.lines:
            style = 'bold' if line.planner == block.best else ''
            style = 'red' if line.violations else style
            console.print(Text(_line(rows[line], widths), style=style), soft_wrap=True)
        for problem in block.problems:
            console.print(Text(f'  {problem}', style='dim'), soft_wrap=True)
        console.print()
    for title, meaning in COLUMNS:
        console.print(Text(f'{title:8}{meaning}', style='dim'), soft_wrap=True)
    console.print()


def print_verdicts(verdicts: Sequence[Verdict], console: Console) -> None:
    """Print a line for each planner: how soon it explores, over all families on time."""
    families = max(each.families for each in verdicts)
    titles = ('planner', '/bound', 'done', 'best in', '>L')
    rows = [
        (
            each.planner,
            _at_least(_ratio(each.ratio_mean), each.explored == each.missions),
            f'{each.explored}/{each.missions}',
            f'{each.best_of}/{each.families_total}',
            f'{each.violations}',
        )
        for each in verdicts
    ]
    widths = [max(map(len, column)) for column in zip(titles, *rows, strict=True)]
    on_time = 'one family' if families == 1 else f'{families} families'
    console.print(Text(f'Mean over the {on_time} on time; best in, >L: of all families'))
    console.print(Text(_line(titles, widths), style='dim'))
    for row in rows:
        console.print(Text(_line(row, widths), style='bold'))
    console.print()


def cells_of(line: Line, block: Block) -> tuple[str, ...]:
    """Return a line of the table, as text."""
    return (
        f'{line.planner}{_BEST if line.planner == block.best else ""}',
        f'{line.explored}/{len(line.attempts)}',
        _at_least(_ratio(line.ratio_mean), line.is_explored),
        _at_least(_ratio(line.ratio_worst), line.is_explored),
        _number(line.delivered_s),
        _number(line.neglect, 100.0),
        _number(line.revisits),
        _number(line.sorties),
        f'{line.violations}',
        _milliseconds(line.plan_p50_s),
        _milliseconds(line.plan_p99_s),
        _number(line.take_off_plan_s, digits=1),
        _number(line.peak_memory_bytes, 2.0**-20),
    )


def _line(cells: Sequence[str], widths: Sequence[int]) -> str:
    first, *others = zip(cells, widths, strict=True)
    return ' '.join([first[0].ljust(first[1]), *(cell.rjust(width) for cell, width in others)])


def _at_least(text: str, is_explored: bool) -> str:
    """Return a figure that is more than that where not all missions were explored."""
    return text if is_explored else f'{_AT_LEAST}{text}'


def _ratio(ratio: float) -> str:
    return f'{ratio:.3f}' if math.isfinite(ratio) else _DASH


def _milliseconds(time_s: float | None) -> str:
    """Return a time with two digits at least."""
    if time_s is None:
        return _DASH
    return _number(time_s, 1000.0, digits=0 if time_s >= 0.01 else 1)


def _number(value: float | None, factor: float = 1.0, *, digits: int = 0) -> str:
    return _DASH if value is None else f'{factor * value:.{digits}f}'
