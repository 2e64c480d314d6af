"""One mission of the benchmark of planners, in a process of its own: flown, timed and weighed."""

from __future__ import annotations

import gc
import multiprocessing
import resource
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from time import process_time
from typing import TYPE_CHECKING

import msgspec

from c3_station.campaign_mission import MissionResult, crashed, fly_mission
from c3_station.campaign_plan import MissionJob
from c3_station.campaign_processes import start_worker
from uav_planner.planners import make_planner
from uav_planner.planning import Planner

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from uav_planner.planning import (
        LookAhead,
        Planner,
        PlanRequest,
        PlanResult,
        SortiePlan,
        SortieRequest,
    )

_LOOK_EVERY_S = 0.2
"""How long to wait for a result before looking whether to go on: short to a person, seconds."""


class TimedMission(msgspec.Struct, frozen=True, kw_only=True):
    """What a mission came to, and what planning it took."""

    result: MissionResult
    take_off_plan_s: float
    """The first sortie and the whole mission ahead, before take-off: processor time, seconds."""
    sortie_plans_s: tuple[float, ...]
    """The sorties after it, planned at C3."""
    path_plans_s: tuple[float, ...]
    """The path at each meeting, in flight; from the first one on."""
    peak_memory_bytes: int
    """Largest resident set of the process that flew it, all agents included."""


class _Stopwatch(Planner):
    """
    A planner whose plans are timed.

    Processor time of all its threads: what it takes on one core, whatever else the machine does.
    """

    def __init__(self, planner: Planner) -> None:
        self.guarantees_limit = planner.guarantees_limit
        self._planner = planner
        self.path_plans_s: list[float] = []
        self.sortie_plans_s: list[float] = []

    def plan_path(self, request: PlanRequest) -> PlanResult:
        """Plan a path."""
        began_s = process_time()
        plan = self._planner.plan_path(request)
        self.path_plans_s.append(process_time() - began_s)
        return plan

    def plan_sortie(self, request: SortieRequest) -> SortiePlan:
        """Plan a sortie."""
        began_s = process_time()
        plan = self._planner.plan_sortie(request)
        self.sortie_plans_s.append(process_time() - began_s)
        return plan

    def look_ahead(self, request: SortieRequest) -> Iterator[LookAhead]:
        """Plan the whole mission; that counts for the first sortie, planned before it."""
        slices = self._planner.look_ahead(request)
        while True:
            began_s = process_time()
            ahead = next(slices, None)
            self.sortie_plans_s[-1] += process_time() - began_s
            if ahead is None:
                return
            yield ahead


def fly_timed(job: MissionJob) -> TimedMission:
    """Fly a mission in this process; whatever goes wrong in it is a result."""
    choice = job.scenario.planner
    # A collection of garbage does not look through all that was imported, wherever it falls.
    gc.freeze()
    stopwatch = _Stopwatch(make_planner(choice.name, **choice.options))
    result = fly_mission(job, stopwatch)
    first_s, *later_s = stopwatch.sortie_plans_s or [0.0]
    return TimedMission(
        result=result,
        take_off_plan_s=first_s,
        sortie_plans_s=tuple(later_s),
        path_plans_s=tuple(stopwatch.path_plans_s),
        peak_memory_bytes=1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss,
    )


def fly_each(
    jobs: Sequence[MissionJob],
    processes: int,
    take: Callable[[TimedMission], None],
    look: Callable[[], None],
) -> None:
    """
    Fly each mission in a process of its own, so many at a time; pass on results as they come.

    ``look`` is called several times a second, to break off by what it raises.
    """
    others = set(multiprocessing.active_children())
    with ThreadPoolExecutor(processes) as threads:
        under_way = {threads.submit(_fly_apart, job) for job in jobs}
        try:
            while under_way:
                look()
                done, under_way = wait(under_way, _LOOK_EVERY_S, FIRST_COMPLETED)
                for future in done:
                    take(future.result())
        except BaseException:
            threads.shutdown(wait=False, cancel_futures=True)
            for child in set(multiprocessing.active_children()) - others:
                child.kill()
            raise


def _fly_apart(job: MissionJob) -> TimedMission:
    context = multiprocessing.get_context('forkserver')
    context.set_forkserver_preload([__name__])
    try:
        with ProcessPoolExecutor(1, context, initializer=start_worker) as process:
            return process.submit(fly_timed, job).result()
    except BrokenExecutor:
        return TimedMission(
            result=crashed(job, 'its process was killed (out of memory?)'),
            take_off_plan_s=0.0,
            sortie_plans_s=(),
            path_plans_s=(),
            peak_memory_bytes=0,
        )
