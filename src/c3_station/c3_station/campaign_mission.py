"""One mission of a campaign: flown in this process, without a bag, and boiled down to a row."""

from __future__ import annotations

import enum
import math
import os
import traceback
from functools import cache
from socket import gethostname
from time import perf_counter
from typing import TYPE_CHECKING

import msgspec

from auv_sim.surfacing import Lost, Silent, surfacing_model
from c3_station.faults_in_process import FaultTally
from c3_station.in_process import fly
from c3_station.software import this_software
from c3_station.summary import Summarizer

if TYPE_CHECKING:
    from collections.abc import Sequence

    from c3_station.campaign_plan import MissionJob
    from c3_station.scenario import Scenario
    from c3_station.summary import Summary
    from uav_planner.planning import Planner


class MissionExit(enum.Enum):
    """How a mission ended."""

    COMPLETE = 'complete'
    """C3 called it complete."""
    STOPPED = 'stopped'
    """It came to its hard stop."""
    ERROR = 'error'
    """The software failed; the figures are those up to then."""


class SortieTimes(msgspec.Struct, frozen=True, array_like=True):
    """What a sortie took, seconds."""

    duration_s: float | None
    """None where the mission ended before the UAV was back."""
    worst_case_s: float
    limit_s: float


class MissionResult(msgspec.Struct, frozen=True, kw_only=True):
    """What a mission came to; None where it has no such figure. See `c3_station.summary`."""

    number: int
    """Its number in the campaign."""
    exit: MissionExit
    reason: str | None
    """Why it did not end complete."""
    explored_s: float | None
    delivered_s: float | None
    mission_s: float | None
    lower_bound_s: float | None
    neglect_fraction: float | None
    c3_wait_s: float | None
    data_age_max_s: float | None
    sorties_total: int
    violations: int
    """Sorties over their limit."""
    longest_sortie_s: float | None
    bound_ratio_max: float | None
    """The largest realised sortie time over its worst case."""
    missed: int
    """Searches to the end of AUVs that were on their path, and did answer, yet were not heard."""
    searches_broken_off: int
    auvs_lost: int
    samples_collected: int
    samples_delivered: int
    samples_lost: int | None
    """Those of AUVs that are not lost."""
    samples_doubled: int | None
    """Those that C3 counts more than once."""
    restarts: int
    """Nodes that died and came back."""
    forged: int
    """Hostile messages."""
    obeyed: int
    """Those of them that were not refused."""
    refused: int
    """All messages that agents refused; counted in missions with faults."""
    moves_total: int
    revisits: int
    sortie_times: tuple[SortieTimes, ...]
    wall_s: float
    """How long it took to fly, seconds of wall time."""

    @property
    def stands_out(self) -> bool:
        """Return whether a person should have a look: it did not keep what was promised."""
        return bool(
            self.exit is not MissionExit.COMPLETE
            or self.violations
            or self.missed
            or self.samples_lost
        )


class OtherCodeError(Exception):
    """A worker was to fly missions for other code than its own; the text says who."""


def fly_missions(jobs: Sequence[MissionJob]) -> list[MissionResult]:
    """
    Fly missions one after another; this is what a worker does.

    Raises
    ------
    OtherCodeError
        They are to be flown by other code than this.

    """
    for job in jobs:
        if job.software != _own_software():
            raise OtherCodeError(
                f'a worker on {gethostname()} (process {os.getpid()}) has other code,'
                f' {_own_software()}; allowed: {job.software}'
            )
    return [fly_mission(job) for job in jobs]


@cache
def _own_software() -> str:
    """Return which code this process runs, also after the files have changed."""
    return this_software()


def fly_mission(job: MissionJob, planner: Planner | None = None) -> MissionResult:
    """
    Fly one mission; whatever goes wrong in it is a result.

    A planner that is given flies instead of the one that the scenario names.
    """
    scenario = job.scenario
    summarizer = Summarizer()
    failure, tally = None, FaultTally()
    began_s = perf_counter()
    try:
        tally = fly(scenario, summarizer.frame, planner)
    except Exception as error:
        # A campaign looks for failures, those of our own code too.
        failure = _text(error)
    wall_s = perf_counter() - began_s
    return result_of(job.number, scenario, summarizer.summary(), tally, failure, wall_s)


def crashed(job: MissionJob, reason: str) -> MissionResult:
    """Return the result of a mission that took its whole process down."""
    summary = Summarizer().summary()
    return result_of(job.number, job.scenario, summary, FaultTally(), reason, wall_s=0.0)


def result_of(
    number: int,
    scenario: Scenario,
    summary: Summary,
    tally: FaultTally,
    failure: str | None,
    wall_s: float,
) -> MissionResult:
    """Return what a mission came to; ``failure`` says what the software failed of, if it did."""
    if failure is not None:
        ended = MissionExit.ERROR
    else:
        ended = MissionExit.COMPLETE if summary.complete else MissionExit.STOPPED
    return MissionResult(
        number=number,
        exit=ended,
        reason=failure or summary.stopped,
        explored_s=summary.explored_s,
        delivered_s=summary.delivered_s,
        mission_s=summary.mission_s,
        lower_bound_s=summary.lower_bound_s,
        neglect_fraction=summary.neglect_fraction,
        c3_wait_s=summary.c3_wait_s,
        data_age_max_s=summary.data_age_max_s,
        sorties_total=len(summary.sorties),
        violations=summary.sortie_limit_violations,
        longest_sortie_s=max(
            (each.duration_s for each in summary.sorties if each.duration_s is not None),
            default=None,
        ),
        bound_ratio_max=summary.bound_ratio_max,
        missed=_missed(summary, scenario),
        searches_broken_off=summary.searches_broken_off,
        auvs_lost=len(summary.lost),
        samples_collected=summary.samples_collected,
        samples_delivered=summary.samples_delivered,
        samples_lost=summary.samples_lost,
        samples_doubled=summary.samples_doubled,
        restarts=sum(summary.restarts.values()),
        forged=tally.forged,
        obeyed=tally.obeyed,
        refused=tally.refused,
        moves_total=summary.moves_total,
        revisits=summary.revisits,
        sortie_times=tuple(
            SortieTimes(each.duration_s, each.worst_case_s, each.limit_s)
            for each in summary.sorties
        ),
        wall_s=wall_s,
    )


def _missed(summary: Summary, scenario: Scenario) -> int:
    """Return how often an AUV was searched in vain that should have been heard."""
    silences_s = _silences_s(scenario)
    missed = 0
    for sortie in summary.sorties:
        back_s = math.inf if sortie.returned_s is None else sortie.returned_s
        for auv in sortie.missed:
            from_s, until_s = silences_s.get(auv, (math.inf, math.inf))
            missed += not (from_s <= back_s and sortie.departed_s <= until_s)
    return missed


def _silences_s(scenario: Scenario) -> dict[str, tuple[float, float]]:
    """Return from when to when nobody can be expected to hear an AUV."""
    silences_s = {}
    for auv in scenario.auvs:
        match surfacing_model(msgspec.json.encode(auv.surfacing).decode()):
            case Lost(from_s=from_s):
                silences_s[auv.name] = (from_s, math.inf)
            case Silent(from_s=from_s, sorties=sorties):
                silences_s[auv.name] = (from_s, from_s + sorties * scenario.sortie.limit_s)
    return silences_s


def _text(error: Exception) -> str:
    """Return what failed and where, in one line."""
    where = traceback.extract_tb(error.__traceback__)[-1]
    text = ' '.join(str(error).split())
    return f'{type(error).__name__}: {text} ({where.name}, line {where.lineno})'
