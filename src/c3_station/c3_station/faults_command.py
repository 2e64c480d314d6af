"""``orchestrate.py faults``: fly missions under a table of faults, and tell what each came to."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from rich.text import Text

from c3_station.campaign_command import FlyingOptions, new_campaign
from c3_station.campaign_mission import MissionExit
from c3_station.exit_codes import ExitCode
from c3_station.fault_table import outcomes, plan_table, rows_for_nodes, rows_of
from c3_station.faults_by_nodes import fly_by_nodes
from c3_station.scenario_files import load_scenario

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    from rich.console import Console

    from c3_station.campaign_store import CampaignStore
    from c3_station.fault_table import Outcome, Row

_DASH = '\N{EN DASH}'
_HEADER = (
    'fault',
    'missions',
    'complete',
    'lost',
    'doubled',
    'over L',
    'errors',
    'obeyed',
    'refused',
    'restarts',
    'AUVs lost',
    'explored',
    'ratio',
)
_LEGEND = """\
lost       samples that C3 does not have, but for those of AUVs that are given up
doubled    samples that C3 counts more than once
over L     sorties over their limit
errors     missions in which the software failed
obeyed     forged messages that were not refused
refused    all messages that were, such as those heard again after a restart
AUVs lost  given up after searches in vain
explored   median, seconds
ratio      to the mission of the same seed without fault, median"""


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultsOptions:
    """Which missions are flown, and by whom."""

    scenario: str
    planner: str
    missions: int
    """For each row."""
    by_nodes: int
    """Of the rows whose faults strike processes, so many more, flown by ROS 2 nodes."""
    jobs: int | None
    """Processes that fly the others; None for one per core."""
    out: Path | None


def fly_faults(options: FaultsOptions, console: Console) -> ExitCode:
    """
    Fly the table, or what is left of it in a folder where it was broken off.

    Raises
    ------
    ValueError
        The scenario cannot be flown so, or the folder holds something else.

    """
    rows = rows_of(load_scenario(options.scenario))
    campaign = plan_table(options.scenario, options.planner, rows, options.missions)
    flying = FlyingOptions(jobs=options.jobs, dask=None, fail_on_violation=True)
    return new_campaign(campaign, options.out, flying, console, partial(_tell, rows, options))


def _tell(
    rows: Sequence[Row],
    options: FaultsOptions,
    store: CampaignStore,
    flying: FlyingOptions,
    console: Console,
) -> ExitCode:
    del flying  # a broken promise fails the suite, always
    is_kept = _print(outcomes(store.campaign, rows, store.results()), console)
    if options.by_nodes:
        by_nodes = rows_for_nodes(load_scenario(options.scenario))
        planned = plan_table(options.scenario, options.planner, by_nodes, options.by_nodes)
        results = tuple(fly_by_nodes(planned, store.folder / 'by_nodes', console))
        console.print('\nflown by ROS 2 nodes:', style='bold')
        is_kept &= _print(outcomes(planned, by_nodes, results, '--rate', 'max'), console)
    return ExitCode.OK if is_kept and not store.missing() else ExitCode.FAILED


def _print(told: Sequence[Outcome], console: Console) -> bool:
    """Print the table, and return whether every promise was kept."""
    for line in table_lines(told):
        console.print(Text(line), soft_wrap=True)
    console.print(Text(_LEGEND, style='dim'))
    console.print('\nthe mission of each row that went furthest wrong, to be flown by itself:')
    for outcome in told:
        style = 'bold red' if outcome.broken else ''
        console.print(Text(outcome.worst, style=style), soft_wrap=True)
    broken = sum(len(outcome.broken) for outcome in told)
    if broken:
        console.print(f'{broken} missions broke a promise', style='bold red', highlight=False)
    return not broken


def table_lines(told: Sequence[Outcome]) -> list[str]:
    """Return the table, in columns; below it how missions ended that are not complete."""
    rows = [_HEADER, *(_cells(outcome) for outcome in told)]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = [
        '  '.join(
            [row[0].ljust(widths[0])]
            + [cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True)]
        )
        for row in rows
    ]
    ends = Counter(
        f'{outcome.row.name}: {result.reason}'
        for outcome in told
        for result in outcome.results
        if result.exit is not MissionExit.COMPLETE
    )
    return [*lines, *(f'{count} x {reason}' for reason, count in ends.items())]


def _cells(outcome: Outcome) -> tuple[str, ...]:
    results = outcome.results
    complete = sum(result.exit is MissionExit.COMPLETE for result in results)
    errors = sum(result.exit is MissionExit.ERROR for result in results)
    ratio = outcome.explored_ratio
    return (
        outcome.row.name,
        f'{len(results)}',
        f'{complete}',
        _total(result.samples_lost for result in results),
        _total(result.samples_doubled for result in results),
        _total(result.violations for result in results),
        f'{errors}',
        _total(result.obeyed for result in results),
        _total(result.refused for result in results),
        _total(result.restarts for result in results),
        _total(result.auvs_lost for result in results),
        _DASH if outcome.explored_s is None else f'{outcome.explored_s:.0f}',
        _DASH if ratio is None else f'{ratio:.2f}',
    )


def _total(counts: Iterable[int | None]) -> str:
    return f'{sum(count or 0 for count in counts):,}'
