"""Rows of the fault table flown by ROS 2 nodes, with real signals to real processes."""

from __future__ import annotations

from time import monotonic
from typing import TYPE_CHECKING

import msgspec

from c3_station.campaign_mission import result_of
from c3_station.exit_codes import ExitCode
from c3_station.faults_in_process import FaultTally
from c3_station.in_process import fly
from c3_station.mission_run import RunOptions, run_mission
from c3_station.run_folder import RunFolder
from c3_station.summary import Summarizer, Summary, course

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from rich.console import Console

    from c3_station.campaign_mission import MissionResult
    from c3_station.campaign_plan import Campaign
    from c3_station.scenario import Scenario


def fly_by_nodes(campaign: Campaign, folder: Path, console: Console) -> Iterator[MissionResult]:
    """Fly a campaign's missions one after another, each into a folder of its own."""
    for number in range(1, campaign.missions_total + 1):
        job = campaign.job(number)
        out = folder / f'mission_{number}'
        began_s = monotonic()
        options = RunOptions(out=out, force=True, rate=0.0, ros=True, bag=True, key_file=None)
        if run_mission(job.scenario, options, console) is ExitCode.INTERRUPTED:
            raise KeyboardInterrupt  # one Ctrl-C is for all of them
        summary = msgspec.json.decode(RunFolder(out).summary.read_bytes(), type=Summary)
        tally = tally_of(job.scenario, summary)
        yield result_of(number, job.scenario, summary, tally, None, monotonic() - began_s)


def tally_of(scenario: Scenario, summary: Summary) -> FaultTally:
    """
    Return what became of forged messages, as far as it shows from outside of the processes.

    A mission that takes another course than without them has obeyed some of them: all count. The
    log counts refusals at the 1st, 10th, 100th, and so on.
    """
    forged, is_same = scenario.faults.forged, True
    if forged:
        without = Summarizer()
        calm = msgspec.structs.replace(scenario.faults, forged=0)
        fly(msgspec.structs.replace(scenario, faults=calm), without.frame)
        is_same = course(summary) == course(without.summary())
    return FaultTally(
        forged=forged,
        obeyed=0 if is_same else forged,
        refused=sum(refusal.count for refusal in summary.refusals),
    )
