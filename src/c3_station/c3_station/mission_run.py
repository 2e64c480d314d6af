"""``orchestrate.py run`` and ``report``: fly, record, tell how it went."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import monotonic
from types import FrameType
from typing import NoReturn

from rich.console import Console
from rich.live import Live

from c3_station.exit_codes import ExitCode
from c3_station.live_view import LiveView
from c3_station.mission_monitor import MissionMonitor
from c3_station.node_params import UAV
from c3_station.process_flight import fly_in_process
from c3_station.report import write_report
from c3_station.ros_flight import fly_on_ros
from c3_station.run_folder import RunFolder, new_run_folder
from c3_station.scenario import Scenario
from c3_station.scenario_files import scenario_json
from c3_station.summary import Summary, failed_conditions

_FRAMES_PER_S = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class RunOptions:
    """How to fly."""

    out: Path | None
    force: bool
    rate: float
    """Times real time; 0 as fast as possible."""
    ros: bool
    bag: bool


def run_mission(scenario: Scenario, options: RunOptions, console: Console) -> ExitCode:
    """
    Fly a mission into a folder of its own, show it, report on it.

    Raises
    ------
    ValueError
        The folder cannot be used.

    """
    folder = new_run_folder(options.out, scenario, force=options.force)
    folder.scenario.write_bytes(scenario_json(scenario))
    monitor = MissionMonitor(scenario, UAV)
    way = 'ROS 2 nodes' if options.ros else 'one process'
    title = f'{scenario.name}, planner {scenario.planner.name}, seed {scenario.seed}, {way}'
    fly = fly_on_ros if options.ros else fly_in_process
    interrupted = False
    problem = None
    try:
        with _terminated_as_interrupted(), _live(console, monitor, title) as refresh:
            flight = fly(
                scenario, folder, monitor, rate=options.rate, bag=options.bag, refresh=refresh
            )
            problem = flight.problem
    except KeyboardInterrupt:
        interrupted = True
    if problem:
        console.print(problem, style='bold red', markup=False, highlight=False)
    if not options.bag:
        passed = problem is None and monitor.ended == COMPLETED
        console.print(f'nothing recorded; the mission {monitor.ended or "did not end"}')
    else:
        passed = _report_run(folder, console) and problem is None
    if interrupted:
        console.print('interrupted; what was recorded is readable')
        return ExitCode.INTERRUPTED
    return ExitCode.OK if passed else ExitCode.FAILED


def report_bag(bag: Path, out: Path, console: Console) -> ExitCode:
    """
    Rebuild summary, figures and report of a bag, and tell whether its mission passed.

    Raises
    ------
    BagError
        The bag is missing or cannot be read; the text says what to do.

    """
    return ExitCode.OK if _report(bag, out, console) else ExitCode.FAILED


@contextmanager
def _live(console: Console, monitor: MissionMonitor, title: str) -> Iterator[Callable[[], None]]:
    """Show the mission while it runs; a terminal sees it move, a log file its end only."""
    view = LiveView(monitor, title)
    began_s = monotonic()
    shown_s = began_s

    with Live(view, console=console, auto_refresh=False, transient=False) as live:

        def refresh() -> None:
            nonlocal shown_s
            now_s = monotonic()
            if now_s - shown_s >= 1.0 / _FRAMES_PER_S:
                shown_s = now_s
                live.refresh()

        yield refresh


@contextmanager
def _terminated_as_interrupted() -> Iterator[None]:
    """Let SIGTERM and a closed terminal end a mission in the same order as Ctrl-C."""

    def interrupt(signum: int, frame: FrameType | None) -> NoReturn:
        raise KeyboardInterrupt

    signals = (signal.SIGTERM, signal.SIGHUP)
    before = [signal.signal(signum, interrupt) for signum in signals]
    try:
        yield
    finally:
        for signum, handler in zip(signals, before, strict=True):
            signal.signal(signum, handler)
