"""``orchestrate.py campaign``: plan, fly, store, tell, report; go on where it was broken off."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING

from rich.console import Console

from c3_station.campaign_dask import DaskPool
from c3_station.campaign_groups import sections_of
from c3_station.campaign_mission import MissionExit, OtherCodeError
from c3_station.campaign_plan import differences, run_arguments, scenario_of
from c3_station.campaign_processes import ProcessPool
from c3_station.campaign_progress import progress_bar
from c3_station.campaign_report import write_campaign_report
from c3_station.campaign_run import PoolLostError, fly_all
from c3_station.campaign_store import (
    STORE,
    CampaignStore,
    make_store,
    sole_writer,
)
from c3_station.campaign_table import print_sections
from c3_station.exit_codes import ExitCode
from c3_station.interrupts import interruptible
from c3_station.program import command_line
from c3_station.scenario_files import scenario_json
from c3_station.software import this_software

if TYPE_CHECKING:
    from c3_station.campaign_mission import MissionResult
    from c3_station.campaign_plan import Campaign

_RUNS = Path('runs')
_BAD = 'bold red'


@dataclass(frozen=True, slots=True, kw_only=True)
class FlyingOptions:
    """By whom a campaign is flown, and when it counts as passed."""

    jobs: int | None
    """Processes on this machine; None for one per core."""
    dask: str | None
    """Address of a Dask scheduler, whose workers fly instead."""
    fail_on_violation: bool
    """Whether a sortie over its limit, an AUV missed or a sample lost fails the campaign."""


Tell = Callable[[CampaignStore, FlyingOptions, Console], ExitCode]
"""Prints what a campaign came to, and returns whether that is well."""


def new_campaign(
    campaign: Campaign,
    out: Path | None,
    options: FlyingOptions,
    console: Console,
    tell: Tell | None = None,
) -> ExitCode:
    """
    Fly a campaign into a folder, or what is left of it where the same one was broken off.

    In the end ``tell`` says what came of it, by default in the tables of a campaign.

    Raises
    ------
    ValueError
        The folder holds something else, or the workers cannot be used.

    """
    folder = out or _new_folder(campaign)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ValueError(f'--out {folder}: cannot be made, {error.strerror}') from None
    with sole_writer(folder):
        if not (folder / STORE).exists():
            make_store(folder, campaign)
        with CampaignStore(folder) as store:
            different = differences(store.campaign, campaign)
            if different:
                raise ValueError(
                    f'--out {folder}: holds another campaign: {"; ".join(different)};'
                    ' name another folder'
                )
            return _fly(store, options, console, tell or _tell)


def resume_campaign(folder: Path, options: FlyingOptions, console: Console) -> ExitCode:
    """
    Fly what is left of a campaign that was broken off.

    Raises
    ------
    ValueError
        There is no campaign in the folder, or other code than this has flown the rest.

    """
    with CampaignStore(folder) as store, sole_writer(folder):
        return _fly(store, options, console, _tell)


def report_campaign(folder: Path, options: FlyingOptions, console: Console) -> ExitCode:
    """
    Tell what is flown of a campaign so far, and write its report again.

    Raises
    ------
    ValueError
        There is no campaign in the folder.

    """
    with CampaignStore(folder) as store:
        return _tell(store, options, console)


def show_mission(folder: Path, number: str, console: Console) -> ExitCode:
    """
    Print how to fly one mission of a campaign by itself, with ROS and without.

    Raises
    ------
    ValueError
        There is no campaign in the folder, or no such mission in it.

    """
    with CampaignStore(folder) as store:
        campaign = store.campaign
        if not number.isdecimal() or not 1 <= int(number) <= campaign.missions_total:
            raise ValueError(
                f'--mission {folder} {number}: there is no such mission;'
                f' allowed: 1 to {campaign.missions_total}'
            )
        case_index, seed = campaign.place(int(number))
        case = campaign.cases[case_index]
        line = command_line(*run_arguments(case, seed))
        _say(console, f'{line}\n{line} --no-ros')
        if scenario_json(scenario_of(campaign, case)).decode() != case.scenario_json:
            _say(console, f'{case.scenario} has changed since: this is another mission', _BAD)
            return ExitCode.FAILED
        return ExitCode.OK


def _fly(store: CampaignStore, options: FlyingOptions, console: Console, tell: Tell) -> ExitCode:
    campaign = store.campaign
    missing = store.missing()
    if missing and campaign.software != this_software():
        raise ValueError(
            f'{store.path}: {campaign.missions_total - len(missing)} missions were flown by'
            f' {campaign.software}, and this is {this_software()}; results of both are not mixed:'
            ' start anew in another folder'
        )
    began_s = monotonic()
    try:
        if missing:
            with (
                interruptible() as look_for_interrupt,
                _pool(options) as pool,
                progress_bar(console, campaign.missions_total, store.results()) as show,
            ):

                def take(results: list[MissionResult]) -> None:
                    store.add(results)
                    show(results)

                fly_all(map(campaign.job, missing), pool, take, look_for_interrupt)
    except (KeyboardInterrupt, PoolLostError, OtherCodeError) as stop:
        interrupted = isinstance(stop, KeyboardInterrupt)
        if not interrupted:
            _say(console, str(stop), _BAD)
        stored = campaign.missions_total - len(store.missing())
        _say(
            console,
            f'stopped: {stored:,} of {_missions(campaign.missions_total)} are stored;'
            f' the rest is flown by\n{command_line("campaign", "--resume", str(store.folder))}',
        )
        return ExitCode.INTERRUPTED if interrupted else ExitCode.FAILED
    if missing:
        took_s = monotonic() - began_s
        took = timedelta(seconds=round(took_s))
        rate = len(missing) / took_s
        _say(console, f'{_missions(len(missing))} in {took}, {rate:.1f} per second\n')
    return tell(store, options, console)


def _pool(options: FlyingOptions) -> ProcessPool | DaskPool:
    return ProcessPool(options.jobs) if options.dask is None else DaskPool(options.dask)


def _tell(store: CampaignStore, options: FlyingOptions, console: Console) -> ExitCode:
    campaign, results = store.campaign, store.results()
    print_sections(sections_of(campaign, results), console)
    left = campaign.missions_total - len(results)
    if left:
        _say(console, f'{_missions(left)} still to be flown', _BAD)
    errors = [result for result in results if result.exit is MissionExit.ERROR]
    if errors:
        first = errors[0]
        text = f'{_missions(len(errors))} ended in an error, first {first.number}: {first.reason}'
        _say(console, text, _BAD)
    told = [result for result in results if result.stands_out]
    if told:
        case_index, seed = campaign.place(told[0].number)
        line = command_line(*run_arguments(campaign.cases[case_index], seed))
        _say(
            console,
            f'{_missions(len(told))} to look at, each with its line in the report; the first:\n'
            f'{line} --no-ros',
        )
    report = write_campaign_report(store.folder, campaign, results)
    _say(console, f'report: {report}')
    failed = left or errors or (options.fail_on_violation and told)
    return ExitCode.FAILED if failed else ExitCode.OK


def _say(console: Console, text: str, style: str = '') -> None:
    """Print what may be copied: a line is not broken where the terminal ends."""
    console.print(text, style=style, markup=False, highlight=False, soft_wrap=True)


def _missions(count: int) -> str:
    return '1 mission' if count == 1 else f'{count:,} missions'


def _new_folder(campaign: Campaign) -> Path:
    # Local time: a person looks for "the campaign of this morning".
    now = datetime.now(UTC).astimezone()
    return _RUNS / f'campaign-{now:%Y%m%d-%H%M%S-%f}'
