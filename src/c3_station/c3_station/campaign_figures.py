"""The figures of a campaign's report; how they look is in `figure_style`."""

from __future__ import annotations

import math
import textwrap
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.lines import Line2D

from c3_station.campaign_groups import compare
from c3_station.figure_style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PALE,
    PURPLE,
    SKY,
    VERMILLION,
    legend_below,
    new_figure,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from c3_station.campaign_groups import Group, Metric, Section
    from c3_station.campaign_statistics import Spread

COLOURS = (BLUE, ORANGE, GREEN, PURPLE, SKY, VERMILLION)
MARKERS = ('o', 's', 'D', '^', 'v', 'P')
_LABEL_CHARACTERS = 26
"""A variation's name is broken into lines of this length, to leave room for the figure."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Row:
    """Where a group is drawn, and how."""

    y: float
    group: Group
    colour: str
    marker: str


def draw_violations(section: Section) -> Figure:
    """Draw how many missions had a sortie over its limit, with 95 % intervals."""
    rows = _rows(section)
    figure, axes = _figure_of_rows(rows, section)
    for row in rows:
        share = row.group.violations
        low, high = 100.0 * share.interval.low, 100.0 * share.interval.high
        axes.plot([low, high], [row.y, row.y], color=row.colour, lw=1.4)
        _draw_mark(axes, row, 100.0 * share.fraction, low, high)
        _note_right(axes, row, f'{share.count:,} of {share.total:,}')
    axes.set_xlim(left=0.0)
    axes.set_xlabel('missions with a sortie over L (%)')
    return figure


def draw_spread(section: Section, metric: Metric) -> Figure | None:
    """Draw how a figure is distributed in each group: quartiles, percentiles 10 and 90, median."""
    rows = _rows(section)
    spreads = [(row, row.group.spread(metric)) for row in rows]
    if not any(spread for _, spread in spreads):
        return None
    figure, axes = _figure_of_rows(rows, section)
    for row, spread in spreads:
        if spread is not None:
            _draw_box(axes, row, spread)
        without = row.group.missions - (spread.total if spread else 0)
        if without:
            _note_right(axes, row, f'{without:,} without')
    axes.set_xlim(left=0.0)
    axes.set_xlabel(f'{metric.title} ({metric.unit})')
    return figure


def draw_differences(section: Section, metric: Metric) -> Figure | None:
    """Draw how each planner does beside the first one, mission by mission on the same seeds."""
    first, *others = section.planners
    rows, comparisons = [], []
    for group, base in section.beside_first():
        comparison = compare(group, base, metric)
        if comparison is not None:
            rows.append(_row(group, section, others))
            comparisons.append(comparison)
    if not rows:
        return None
    figure, axes = _figure_of_rows(rows, section)
    axes.axvline(0.0, color=BLACK, lw=1.0)
    for row, comparison in zip(rows, comparisons, strict=True):
        _draw_box(axes, row, comparison.difference)
        _note_right(axes, row, f'less on {100.0 * comparison.better.fraction:.0f} %')
    axes.set_xlabel(f'difference to {first} ({metric.unit})')
    return figure


def draw_worst_cases(section: Section, planner: str) -> Figure | None:
    """Draw every sortie of a planner: its worst case at departure and what it took, over L."""
    worst, flown = _sorties(section, planner)
    if not worst.size:
        return None
    figure, axes = new_figure(4.2)
    # Sorties take whole ticks, so many lie on the same point: they are counted.
    points, counts = np.unique(np.round([worst, flown], 3), axis=1, return_counts=True)
    order = np.argsort(counts, kind='stable')
    most_sorties = max(10, counts.max())
    drawn = axes.scatter(
        points[0, order],
        points[1, order],
        c=counts[order],
        s=7,
        marker='s',
        lw=0,
        cmap='cividis',
        norm=LogNorm(1, most_sorties),
        zorder=2,
    )
    most = 1.05 * max(1.0, worst.max(), flown.max())
    axes.plot([0.0, most], [0.0, most], color=BLACK, lw=1.2, label='worst case')
    axes.axhline(1.0, color=VERMILLION, lw=1.4, ls='--', label='limit L')
    axes.set_xlim(0.0, most)
    axes.set_ylim(0.0, most)
    axes.set_xlabel('worst case at departure (L)')
    axes.set_ylabel('sortie as flown (L)')
    axes.grid(color=PALE, lw=0.6)
    axes.set_axisbelow(True)
    figure.legend(loc='outside lower center', ncols=2)
    decades = 10.0 ** np.arange(math.floor(math.log10(most_sorties)) + 1)
    bar = figure.colorbar(drawn, ax=axes, label='sorties', shrink=0.8, ticks=decades.tolist())
    bar.ax.set_yticklabels([f'{decade:,.0f}' for decade in decades])
    return figure


def draw_tightness(section: Section) -> Figure | None:
    """Draw how close to their worst case sorties come."""
    figure, axes = new_figure(3.4)
    drawn = False
    for number, planner in enumerate(section.planners):
        worst, flown = _sorties(section, planner)
        possible = worst > 0.0
        ratios = flown[possible] / worst[possible]
        if ratios.size:
            drawn = True
            # Edges a hair above, so that a worst case that came true is not counted beyond 1.
            edges = np.arange(0.0, ratios.max() + 0.02, 0.02) + 1e-9
            axes.hist(
                ratios,
                bins=edges.tolist(),
                weights=np.full(ratios.size, 100.0 / ratios.size),
                histtype='step',
                lw=1.6,
                color=COLOURS[number % len(COLOURS)],
                ls='-' if number % 2 == 0 else '--',
                label=f'{planner}: {ratios.size:,} sorties, at most {ratios.max():.4f}',
            )
    if not drawn:
        return None
    axes.axvline(1.0, color=BLACK, lw=1.2)
    axes.set_xlim(left=0.0)
    axes.set_xlabel('sortie as flown / its worst case at departure')
    axes.set_ylabel('sorties (%)')
    axes.grid(axis='y', color=PALE, lw=0.6)
    axes.set_axisbelow(True)
    figure.legend(loc='outside lower center', ncols=1)
    return figure


def _sorties(section: Section, planner: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return worst cases and durations of all sorties that were flown, over their limits."""
    sorties = [
        (each.worst_case_s / each.limit_s, each.duration_s / each.limit_s)
        for group in section.groups
        if group.planner == planner
        for result in group.results.values()
        for each in result.sortie_times
        if each.duration_s is not None
    ]
    worst, flown = np.array(sorties, dtype=np.float64).reshape(-1, 2).T
    return worst, flown


# --- groups in rows ------------------------------------------------------------------------------


def _rows(section: Section) -> list[_Row]:
    """Return a row for each group: variations from top to bottom, in each all planners."""
    return [_row(group, section, section.planners) for group in section.groups]


def _row(group: Group, section: Section, planners: Sequence[str]) -> _Row:
    """Return where a group is drawn among those of some planners in its variation."""
    step = 0.8 / len(planners)
    place = planners.index(group.planner) - (len(planners) - 1) / 2
    number = section.planners.index(group.planner)
    return _Row(
        y=section.variations.index(group.variation) + place * step,
        group=group,
        colour=COLOURS[number % len(COLOURS)],
        marker=MARKERS[number % len(MARKERS)],
    )


def _figure_of_rows(rows: Sequence[_Row], section: Section) -> tuple[Figure, Axes]:
    """Return a figure with a labelled place for every variation, and a legend of the planners."""
    variations = section.variations
    labels = [_label(variation) for variation in variations]
    lines = sum(label.count('\n') + 1 for label in labels)
    figure, axes = new_figure(1.3 + max(0.26 * len(rows), 0.2 * lines))
    axes.set_yticks(range(len(variations)), labels)
    axes.set_ylim(len(variations) - 0.5, -0.5)
    axes.tick_params(axis='y', length=0)
    axes.grid(axis='x', color=PALE, lw=0.6)
    axes.set_axisbelow(True)
    for edge in range(1, len(variations)):
        axes.axhline(edge - 0.5, color=PALE, lw=0.6)
    styles = {row.group.planner: row for row in rows}
    handles: list[Line2D] = [
        Line2D([], [], color=row.colour, marker=row.marker, ls='-', lw=1.2, label=planner)
        for planner, row in styles.items()
    ]
    legend_below(figure, list(handles), min(4, len(handles)))
    return figure, axes


def _label(variation: str) -> str:
    return textwrap.fill(variation, _LABEL_CHARACTERS)


def _draw_box(axes: Axes, row: _Row, spread: Spread) -> None:
    axes.plot([spread.low, spread.high], [row.y, row.y], color=row.colour, lw=1.4)
    axes.plot(
        [spread.quarter, spread.three_quarters],
        [row.y, row.y],
        color=row.colour,
        lw=6.0,
        alpha=0.35,
        solid_capstyle='butt',
    )
    interval = spread.median_interval
    _draw_mark(axes, row, spread.median, interval.low, interval.high)


def _draw_mark(axes: Axes, row: _Row, value: float, low: float, high: float) -> None:
    """Draw an estimate, and ticks at the ends of where the true value is."""
    # Not clipped: many a share is 0.
    axes.plot(value, row.y, row.marker, color=row.colour, ms=5, zorder=3, clip_on=False)
    axes.plot([low, high], [row.y] * 2, '|', color=BLACK, ms=8, mew=1.2, zorder=4, clip_on=False)


def _note_right(axes: Axes, row: _Row, text: str) -> None:
    axes.annotate(
        text,
        (1.0, row.y),
        (5, 0),
        xycoords=('axes fraction', 'data'),
        textcoords='offset points',
        va='center',
        fontsize=8,
        color=GREY,
        annotation_clip=False,
    )
