"""What the benchmark of planners writes: table and figures as a page, all missions as JSON."""

from __future__ import annotations

import math
from base64 import b64encode
from dataclasses import dataclass
from typing import TYPE_CHECKING

import matplotlib as mpl
import msgspec

from c3_station.bench_families import family_figures
from c3_station.bench_planners_figures import draw_explored, draw_neglect, draw_planning
from c3_station.bench_planners_table import COLUMNS, cells_of
from c3_station.bench_statistics import verdicts_of
from c3_station.figure_style import STYLE, png_of
from c3_station.report_page import page_template
from c3_station.software import this_software

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from c3_station.bench_statistics import Block

_FIGURES = (
    (
        'explored',
        'Time to explore',
        'Mark: mean of the missions. Line: on to the worst one. Open: not all were explored by the'
        ' hard stop, so it is more than that.',
        draw_explored,
    ),
    ('neglect', 'Neglect', 'Mean of the missions that were explored.', draw_neglect),
    (
        'planning',
        'Planning in flight',
        'Mark: median of all plans. Line: on to the time that one in a hundred is above.',
        draw_planning,
    ),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A figure on the page."""

    title: str
    caption: str
    data: str
    """PNG, base 64."""


def write_planners_report(folder: Path, blocks: Sequence[Block]) -> Path:
    """
    Write ``report.html``, ``figures/`` and ``missions.json``; return where the report is.

    Raises
    ------
    ValueError
        They cannot be written there.

    """
    report = folder / 'report.html'
    pictures = []
    try:
        (folder / 'figures').mkdir(exist_ok=True)
        for name, title, caption, draw in _FIGURES:
            with mpl.rc_context(STYLE):
                png = png_of(draw(blocks))
            (folder / 'figures' / f'{name}.png').write_bytes(png)
            pictures.append(Picture(title=title, caption=caption, data=b64encode(png).decode()))
        report.write_text(render_planners_report(blocks, pictures), encoding='utf-8')
        (folder / 'missions.json').write_bytes(_missions_json(blocks))
    except OSError as error:
        raise ValueError(f'{folder}: cannot be written: {error.strerror}') from None
    return report


def render_planners_report(blocks: Sequence[Block], pictures: Sequence[Picture]) -> str:
    """Return the page; everything it shows is in it."""
    rows = {line: cells_of(line, block) for block in blocks for line in block.lines}
    return page_template('planners.html.j2').render(
        blocks=blocks,
        rows=rows,
        figures={block: family_figures(block.family) for block in blocks},
        columns=COLUMNS,
        verdicts=verdicts_of(blocks),
        pictures=pictures,
        infinity=math.inf,
        software=this_software(),
    )


def _missions_json(blocks: Sequence[Block]) -> bytes:
    """Return all missions, one after the other, as they were flown."""
    missions = [
        {
            'family': attempt.family.name,
            'planner': attempt.planner,
            'seed': attempt.seed,
            'problem': attempt.problem,
            'flown': attempt.flown,
        }
        for block in blocks
        for line in block.lines
        for attempt in line.attempts
    ]
    content = {'software': this_software(), 'missions': missions}
    return msgspec.json.format(msgspec.json.encode(content))
