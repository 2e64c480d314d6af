"""A mission's ``summary.json``, ``report.html`` and figures, all from its bag alone."""

from __future__ import annotations

from base64 import b64encode
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from c3_station.bag import find_bag
from c3_station.figures import draw_figures
from c3_station.mission_record import read_mission
from c3_station.paper import comparisons, is_reference_mission
from c3_station.program import command_line
from c3_station.report_page import page_template
from c3_station.run_folder import SCENARIO
from c3_station.scenario_files import (
    ScenarioError,
    load_scenario,
    scenario_json,
    shipped_scenarios,
    with_choices,
)
from c3_station.summary import check_conditions
from msgs_json.messages import (
    MissionResumed,
    MissionStopped,
    NodeRestarted,
    StorageFailed,
    StorageRestored,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from c3_station.figures import DrawnFigure
    from c3_station.mission_record import MissionRecord
    from c3_station.scenario import Scenario
    from c3_station.summary import LoggedEvent


def write_report(bag: Path, out: Path) -> MissionRecord:
    """
    Write summary, report and figures of a recorded mission into a folder, over older ones.

    Raises
    ------
    BagError
        There is no such bag, or it is broken.
    ValueError
        The folder cannot be written to, or the recorded scenario cannot be read.

    """
    record = read_mission(bag)
    with _writing(out):
        (out / 'figures').mkdir(parents=True, exist_ok=True)
    figures = draw_figures(record)
    page = render_report(record, figures, _rebuild(bag, out), fly_again(record, out))
    with _writing(out):
        for figure in figures:
            (out / 'figures' / f'{figure.name}.png').write_bytes(figure.png)
        (out / 'summary.json').write_bytes(record.summary.to_json())
        if record.scenario:
            (out / SCENARIO).write_bytes(scenario_json(record.scenario))
        (out / 'report.html').write_text(page, encoding='utf-8')
    return record


def render_report(
    record: MissionRecord,
    figures: tuple[DrawnFigure, ...],
    rebuild_command: str,
    fly_again_command: str | None,
) -> str:
    """Return the page; everything it shows is in it."""
    scenario, summary = record.scenario, record.summary
    return page_template('report.html.j2').render(
        scenario=scenario,
        summary=summary,
        facts=record.facts,
        strange=record.strange,
        taken_out=len(record.taken_out(scenario)) if scenario else 0,
        limits_s=sorted({each.limit_s for each in summary.sorties}),
        node_entries=[
            {'time_s': each.stamp_s, 'node': node, 'what': what}
            for each in record.events
            for node, what in _of_a_node(each)
        ],
        checks=check_conditions(summary, scenario) if scenario else None,
        comparisons=comparisons(summary) if scenario and is_reference_mission(scenario) else (),
        figures=[
            {
                'name': figure.name,
                'title': figure.title,
                'caption': figure.caption,
                'data': b64encode(figure.png).decode(),
            }
            for figure in figures
        ],
        longest_sortie_s=max(
            (each.duration_s for each in summary.sorties if each.duration_s is not None),
            default=None,
        ),
        rebuild_command=rebuild_command,
        fly_again_command=fly_again_command,
        scenario_text=(
            msgspec.json.format(scenario_json(scenario), indent=2).decode() if scenario else None
        ),
    )


def _of_a_node(logged: LoggedEvent) -> Iterator[tuple[str, str]]:
    """Yield the node that an entry of the log is about and what became of it, if it is that."""
    match logged.event:
        case NodeRestarted(node=node, restarts=restarts):
            yield node, f'died and was started again (restart {restarts})'
        case StorageFailed(problem=problem):
            yield logged.source, f'could not store, and kept silent: {problem}'
        case StorageRestored():
            yield logged.source, 'stored again'
        case MissionResumed():
            yield 'all', 'were started again: the mission was resumed'
        case MissionStopped(reason=reason, node=str(node)):
            yield node, f'ended the mission: {reason}'


@contextmanager
def _writing(out: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise ValueError(f'{out}: the report cannot be written: {error.strerror}') from None


def _rebuild(bag: Path, out: Path) -> str:
    """Return how to make the page again."""
    beside_the_bag = find_bag(bag).resolve().parent == out.resolve()
    options = [] if beside_the_bag else ['--out', str(out)]
    return command_line('report', str(bag), *options)


def fly_again(record: MissionRecord, out: Path) -> str | None:
    """Return how to fly the mission again; None where the record does not hold its beginning."""
    scenario = record.scenario
    if scenario is None:
        return None
    if not _is_shipped(scenario):
        return command_line('run', str(out / SCENARIO))
    choices = ('--planner', scenario.planner.name, '--seed', str(scenario.seed))
    return command_line('run', scenario.name, *choices)


def _is_shipped(scenario: Scenario) -> bool:
    """Return whether it is a shipped scenario with its own planner or another, and any seed."""
    if scenario.name not in shipped_scenarios():
        return False
    planner, seed = scenario.planner.name, scenario.seed
    try:
        again = with_choices(load_scenario(scenario.name), planner=planner, seed=seed)
    except ScenarioError:
        return False  # its planner is gone
    return again == scenario
