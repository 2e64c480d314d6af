"""``orchestrate.py run`` and ``report``: fly, record, tell how it went."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import monotonic

import msgspec
from rich.console import Console
from rich.live import Live

from c3_station.bag import BagError, BagReader, find_bag, recover_bag, salvage_bag
from c3_station.exit_codes import ExitCode
from c3_station.flight import Flight
from c3_station.interrupts import interruptible
from c3_station.live_view import LiveView
from c3_station.mission_monitor import MissionMonitor
from c3_station.node_params import UAV
from c3_station.process_flight import fly_in_process
from c3_station.report import write_report
from c3_station.resumption import bags_aside, resumption, set_bag_aside
from c3_station.ros_flight import fly_on_ros
from c3_station.run_folder import RunFolder, Way, new_run_folder
from c3_station.scenario import Scenario
from c3_station.scenario_files import scenario_json
from c3_station.summary import Summary, failed_conditions
from msgs_json.ros_messages import Text, text_from_cdr
from msgs_json.topics import MISSION_EVENTS

_FRAMES_PER_S = 8
_TOLD_EVERY_S = 5.0
"""So often a log file is told how far planning ahead has come, wall seconds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunOptions:
    """How to fly."""

    out: Path | None
    force: bool
    rate: float
    """Times real time; 0 as fast as possible."""
    ros: bool
    bag: bool
    key_file: Path | None
    """With the mission's key; None for a new one."""


def run_mission(scenario: Scenario, options: RunOptions, console: Console) -> ExitCode:
    """
    Fly a mission into a folder of its own, show it, report on it.

    Raises
    ------
    ValueError
        The folder cannot be used.

    """
    folder = new_run_folder(options.out, scenario, force=options.force, key_file=options.key_file)
    way = Way(rate=options.rate, ros=options.ros, bag=options.bag)
    folder.scenario.write_bytes(scenario_json(scenario))
    folder.way.write_bytes(msgspec.json.encode(way))
    fly = fly_on_ros if way.ros else fly_in_process
    with folder.held():
        return _fly_and_tell(fly, folder, scenario, way, MissionMonitor(scenario, UAV), console)


def resume_mission(out: Path, console: Console) -> ExitCode:
    """
    Go on with a run whose processes have all ended before its mission was over.

    Raises
    ------
    ValueError
        There is no such run, or it cannot be resumed.

    """
    left = resumption(out)
    with left.folder.held():
        before = set_bag_aside(left.folder) if left.way.bag else None
        monitor = MissionMonitor(left.scenario, UAV)
        if before is not None:
            for topic, _, cdr in salvage_bag(before).messages:
                if topic == MISSION_EVENTS.name:
                    monitor.message(topic, Text(text_from_cdr(cdr)))
        fly = partial(fly_on_ros, before=before)
        code = _fly_and_tell(fly, left.folder, left.scenario, left.way, monitor, console)
        if left.way.bag and _is_readable(left.folder, console):
            for bag in bags_aside(left.folder):
                shutil.rmtree(bag)  # the new one begins with what is in it
        return code


def _fly_and_tell(
    fly: Callable[..., Flight],
    folder: RunFolder,
    scenario: Scenario,
    way: Way,
    monitor: MissionMonitor,
    console: Console,
) -> ExitCode:
    words = 'ROS 2 nodes' if way.ros else 'one process'
    title = f'{scenario.name}, planner {scenario.planner.name}, seed {scenario.seed}, {words}'
    interrupted = False
    problem = None
    try:
        with (
            interruptible() as look_for_interrupt,
            _live(console, monitor, title, look_for_interrupt) as refresh,
        ):
            flight = fly(scenario, folder, monitor, rate=way.rate, bag=way.bag, refresh=refresh)
            problem = flight.problem
    except KeyboardInterrupt:
        interrupted = True
    if problem:
        console.print(problem, style='bold red', markup=False, highlight=False)
    if way.bag and _is_readable(folder, console):
        summary, result = write_report(folder.bag, folder.path).summary, folder.report
    else:
        summary, result = monitor.summarizer.summary(), folder.summary
        result.write_bytes(summary.to_json())
    passed = _tell(summary, scenario, console) and problem is None
    console.print(f'report: {result}', highlight=False)
    if interrupted:
        console.print('broken off by Ctrl-C: the figures are those up to then', style='bold red')
        return ExitCode.INTERRUPTED
    return ExitCode.OK if passed else ExitCode.FAILED


def report_bag(bag: Path, out: Path | None, console: Console) -> ExitCode:
    """
    Rebuild summary, figures and report of a bag, and tell whether its mission passed.

    They go into the folder that the bag is in unless there is another.

    Raises
    ------
    BagError
        The bag is missing or cannot be read; the text says what to do.

    """
    out = out or find_bag(bag).resolve().parent
    record = write_report(bag, out)
    if record.scenario is None:
        problem = f'{bag}: does not hold the beginning of its mission'
        console.print(problem, style='bold red', markup=False, highlight=False, soft_wrap=True)
        return ExitCode.FAILED
    passed = _tell(record.summary, record.scenario, console)
    console.print(f'report: {RunFolder(out).report}', highlight=False)
    return ExitCode.OK if passed else ExitCode.FAILED


def _is_readable(folder: RunFolder, console: Console) -> bool:
    """Return whether there is a bag; that of a recorder that was killed is mended first."""
    try:
        with BagReader(folder.bag):
            return True
    except BagError as error:
        console.print(str(error), style='red', markup=False, highlight=False)
    if not folder.bag.exists():
        return False  # it ended before there was a recorder
    broken = folder.path / 'bag_broken'
    folder.bag.rename(broken)
    try:
        messages = recover_bag(broken, folder.bag)
    except BagError as error:
        console.print(str(error), style='red', markup=False, highlight=False)
        return False
    console.print(f'{messages} messages saved into {folder.bag}', highlight=False)
    return True


def _tell(summary: Summary, scenario: Scenario, console: Console) -> bool:
    """Print what the mission came to and return whether it met its pass conditions."""
    longest_s = max((sortie.duration_s or 0.0 for sortie in summary.sorties), default=0.0)
    neglect = '-' if summary.neglect_fraction is None else f'{summary.neglect_fraction:.1%}'
    console.print(
        f'explored {_seconds(summary.explored_s)}, delivered {_seconds(summary.delivered_s)},'
        f' neglect {neglect}, {len(summary.sorties)} sorties, the longest {longest_s:g} s,'
        f' {summary.sortie_limit_violations} over the limit;'
        f' {summary.samples_delivered} of {summary.samples_collected} samples at C3',
        highlight=False,
        soft_wrap=True,
    )
    failed = failed_conditions(summary, scenario)
    for sentence in failed:
        console.print(
            f'not passed: {sentence}',
            style='bold red',
            markup=False,
            highlight=False,
            soft_wrap=True,
        )
    if not failed:
        console.print('passed: every condition of the scenario is met', style='bold green')
    return not failed


def _seconds(time_s: float | None) -> str:
    return 'not reached' if time_s is None else f'at {time_s:g} s'


@contextmanager
def _live(
    console: Console, monitor: MissionMonitor, title: str, look_for_interrupt: Callable[[], None]
) -> Iterator[Callable[[], None]]:
    """
    Show the mission while it runs.

    A terminal sees it move. A log file gets its end only, but is told of planning ahead: for many
    seconds nothing else may happen.
    """
    view = LiveView(monitor, title)
    shown_s = began_s = monotonic()
    told_s = began_s - _TOLD_EVERY_S
    noted = 0

    with Live(view, console=console, auto_refresh=False) as live:

        def refresh() -> None:
            nonlocal shown_s, began_s, told_s, noted
            look_for_interrupt()
            now_s = monotonic()
            if not monitor.ticking:
                began_s = now_s
            elif now_s > began_s:
                view.real_time_factor = monitor.now_s / (now_s - began_s)
            if now_s - shown_s >= 1.0 / _FRAMES_PER_S:
                shown_s = now_s
                live.refresh()
            for note in monitor.notes[noted:]:
                console.print(note, style='red', markup=False, highlight=False, soft_wrap=True)
            noted = len(monitor.notes)
            share = monitor.planned_share
            if share is not None and not console.is_terminal and now_s - told_s >= _TOLD_EVERY_S:
                told_s = now_s
                console.print(f'planning ahead {share:.0%}', highlight=False)

        yield refresh
    if not console.is_terminal:
        console.print()  # the last frame ends without a new line there
