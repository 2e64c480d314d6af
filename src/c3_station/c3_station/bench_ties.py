"""The ensemble over all tie orders: how much of a planner's result is luck."""

from __future__ import annotations

import statistics

import msgspec
from rich.console import Console
from rich.table import Table

from c3_station.in_process import fly
from c3_station.scenario import Scenario
from c3_station.summary import Summarizer, Summary
from uav_planner.candidate_paths import every_tie_order


def print_ties(scenario: Scenario, console: Console) -> None:
    """Fly a scenario once per tie order of its planner and print every mission."""
    table = Table(
        title=f'{scenario.name}, planner {scenario.planner.name}, over all tie orders'
        ' (ECC 2009 does not say which it used)',
        title_justify='left',
        box=None,
        padding=(0, 3, 0, 0),
    )
    for column in ('tie order', 'explored', 'neglect', 'sorties over L', 'longest sortie'):
        table.add_column(column, justify='left' if column == 'tie order' else 'right')
    summaries = {}
    for tie_order in every_tie_order():
        summaries[tie_order.name] = summary = _fly(scenario, tie_order.name)
        table.add_row(
            tie_order.name,
            _seconds(summary.explored_s),
            '-' if summary.neglect_fraction is None else f'{summary.neglect_fraction:.1%}',
            str(summary.sortie_limit_violations),
            _seconds(max((sortie.duration_s or 0.0 for sortie in summary.sorties), default=None)),
        )
    console.print(table)
    explored = sorted(
        summary.explored_s for summary in summaries.values() if summary.explored_s is not None
    )
    late = sum(summary.sortie_limit_violations > 0 for summary in summaries.values())
    console.print(
        f'explored: {explored[0]:g} to {explored[-1]:g} s, median'
        f' {statistics.median(explored):g} s, {len(explored)} of {len(summaries)} missions;'
        f' a sortie over L in {late} of {len(summaries)}',
        highlight=False,
    )


def _fly(scenario: Scenario, tie_order: str) -> Summary:
    planner = msgspec.structs.replace(scenario.planner, options={'tie_order': tie_order})
    summarizer = Summarizer()
    fly(msgspec.structs.replace(scenario, planner=planner), summarizer.frame)
    return summarizer.summary()


def _seconds(time_s: float | None) -> str:
    return '-' if time_s is None else f'{time_s:g} s'
