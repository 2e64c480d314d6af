"""The figures of the benchmark of planners."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from c3_station.campaign_figures import COLOURS, MARKERS
from c3_station.figure_style import PALE, legend_below, new_figure

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from c3_station.bench_statistics import Block, Line

_RATIO_TICKS = (1.0, 1.15, 1.5, 2.0, 3.0, 5.0, 10.0)


def draw_explored(blocks: Sequence[Block]) -> Figure:
    """Draw the time to explore over its lower bound: mean, and on to the worst mission."""

    def span(line: Line) -> tuple[float, float] | None:
        if not math.isfinite(line.ratio_worst):
            return None
        return line.ratio_mean, line.ratio_worst

    figure, axes = _figure_of_families(blocks, span)
    axes.set_xscale('log')
    axes.xaxis.set_major_locator(FixedLocator(_RATIO_TICKS))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda ratio, _: f'{ratio:g}'))
    axes.set_xlim(left=1.0)
    axes.set_xlabel('explored / lower bound')
    return figure


def draw_neglect(blocks: Sequence[Block]) -> Figure:
    """Draw the neglect: mean of the missions that were explored."""

    def span(line: Line) -> tuple[float, float] | None:
        return None if line.neglect is None else (100.0 * line.neglect,) * 2

    figure, axes = _figure_of_families(blocks, span)
    axes.set_xlim(left=0.0)
    axes.set_xlabel('neglect (% of the time to explore)')
    return figure


def draw_planning(blocks: Sequence[Block]) -> Figure:
    """Draw how long a path is planned in flight: median, and on to p99."""

    def span(line: Line) -> tuple[float, float] | None:
        if line.plan_p50_s is None or line.plan_p99_s is None:
            return None
        return 1000.0 * line.plan_p50_s, 1000.0 * line.plan_p99_s

    figure, axes = _figure_of_families(blocks, span)
    axes.set_xscale('log')
    axes.xaxis.set_major_formatter(FuncFormatter(lambda time_ms, _: f'{time_ms:g}'))
    axes.set_xlabel('planning a path, on one core (ms)')
    return figure


def _figure_of_families(
    blocks: Sequence[Block], span: Callable[[Line], tuple[float, float] | None]
) -> tuple[Figure, Axes]:
    """
    Return a figure with a place for every family and in it a line for every planner.

    ``span`` says from where to where a line goes, with a mark where it begins; open where not all
    regions were explored.
    """
    planners = tuple(dict.fromkeys(line.planner for block in blocks for line in block.lines))
    figure, axes = new_figure(1.2 + 0.13 * sum(len(block.lines) + 1 for block in blocks))
    for place, block in enumerate(blocks):
        for line in block.lines:
            ends = span(line)
            if ends is None:
                continue
            number = planners.index(line.planner)
            y = place + 0.8 * ((number + 0.5) / len(planners) - 0.5)
            colour = COLOURS[number % len(COLOURS)]
            axes.plot(ends, (y, y), color=colour, lw=1.4)
            axes.plot(
                ends[0],
                y,
                MARKERS[number % len(MARKERS)],
                color=colour,
                mfc=colour if line.is_explored else 'white',
                ms=4.5,
                zorder=3,
                clip_on=False,
            )
    axes.set_yticks(range(len(blocks)), [block.family.name for block in blocks])
    axes.set_ylim(len(blocks) - 0.5, -0.5)
    axes.tick_params(axis='y', length=0)
    axes.grid(axis='x', color=PALE, lw=0.6)
    axes.set_axisbelow(True)
    for edge in range(1, len(blocks)):
        axes.axhline(edge - 0.5, color=PALE, lw=0.6)
    handles = [
        Line2D(
            [],
            [],
            color=COLOURS[number % len(COLOURS)],
            marker=MARKERS[number % len(MARKERS)],
            lw=1.4,
            label=planner,
        )
        for number, planner in enumerate(planners)
    ]
    legend_below(figure, list(handles), 3)
    return figure, axes
