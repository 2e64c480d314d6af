"""A campaign in the terminal: for each section a table that fits into 80 columns."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.text import Text

from c3_station.campaign_groups import NEGLECT

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from rich.console import Console

    from c3_station.campaign_groups import Group, Section
    from c3_station.campaign_statistics import Share, Spread

_DASH = '\N{EN DASH}'
_LEGEND = f"""\
over L   missions with a sortie over its limit; the true share, with 95 %
missed   AUVs searched to the end and not found, though they were on their path
lost     samples that did not come to C3
explored median, and where four of five missions are (p10{_DASH}p90)
bound    the longest sortie over its worst case"""


def print_sections(sections: Iterable[Section], console: Console) -> None:
    """Print what was flown: a line for each group, under its variation."""
    for section in sections:
        explored = section.metrics[0]
        header = (
            '',
            'over L',
            'missed',
            'lost',
            f'explored ({explored.unit})',
            'neglect',
            'bound',
        )
        rows = [_cells(group, section) for group in section.groups]
        widths = [max(map(len, column)) for column in zip(header, *rows, strict=True)]
        console.print(Text(section.title, style='bold'))
        console.print(Text(_line(header, widths), style='dim'), soft_wrap=True)
        for variation in section.variations:
            console.print(Text(variation), soft_wrap=True)
            for group, cells in zip(section.groups, rows, strict=True):
                if group.variation == variation:
                    console.print(Text(_line(cells, widths)), soft_wrap=True)
        console.print()
    console.print(Text(_LEGEND, style='dim'))


def _line(cells: Sequence[str], widths: Sequence[int]) -> str:
    first, *others = zip(cells, widths, strict=True)
    return '  '.join(
        ['', first[0].ljust(first[1]), *(cell.rjust(width) for cell, width in others)]
    )


def _cells(group: Group, section: Section) -> tuple[str, ...]:
    neglect = group.spread(NEGLECT)
    ratio = group.bound_ratio_max
    return (
        group.planner,
        _share_text(group.violations),
        f'{group.missed:,}',
        f'{group.samples_lost:,}',
        _spread_text(group.spread(section.metrics[0])),
        _DASH if neglect is None else f'{neglect.median:.1f} {NEGLECT.unit}',
        _DASH if ratio is None else f'{ratio:.4f}',
    )


def _share_text(share: Share) -> str:
    """Return a count, and where the true share is."""
    low, high = _percent(share.interval.low), _percent(share.interval.high)
    return f'{share.count:,}/{share.total:,} ({low}{_DASH}{high} %)'


def _percent(fraction: float) -> str:
    """Return a share in percent: whole ones, below 10 with two digits."""
    value = 100.0 * fraction
    return f'{value:.0f}' if value >= 9.95 else f'{value:.2g}'


def _spread_text(spread: Spread | None) -> str:
    if spread is None:
        return _DASH
    digits = 0 if spread.median >= 100 else 1
    low, median, high = (f'{e:.{digits}f}' for e in (spread.low, spread.median, spread.high))
    return f'{median} ({low}{_DASH}{high})'
