"""Workers of a campaign on this machine: processes."""

from __future__ import annotations

import gc
import multiprocessing
import os
import signal
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor
from multiprocessing.connection import wait
from threading import Thread
from typing import TYPE_CHECKING, Self

from c3_station.campaign_mission import MissionResult, fly_missions

if TYPE_CHECKING:
    from collections.abc import Sequence

    from c3_station.campaign_plan import MissionJob


_COLLECTED_AFTER = 50_000
"""Objects; a mission of the paper's size makes some thousands that outlive a tick."""


class ProcessPool:
    """
    A number of processes that fly missions.

    They are forked from a server that has imported all that a mission needs: a worker starts in
    some ten milliseconds, and not, as with a fork of this process, in the middle of whatever the
    threads here are doing (those of the progress bar, of numpy).
    """

    died: tuple[type[Exception], ...] = (BrokenExecutor,)

    def __init__(self, workers: int | None) -> None:
        """Make a pool; None for as many workers as there are cores for us."""
        self._workers = workers or len(os.sched_getaffinity(0))
        self._context = multiprocessing.get_context('forkserver')
        self._context.set_forkserver_preload([fly_missions.__module__])
        self._others = set(multiprocessing.active_children())
        self._executor = self._new_executor()

    @property
    def places(self) -> int:
        """Return one more than there are workers: the next batch is there before it is needed."""
        return self._workers + 1

    def submit(self, jobs: Sequence[MissionJob]) -> Future[list[MissionResult]]:
        """Have missions flown by one worker."""
        return self._executor.submit(fly_missions, jobs)

    def renew(self) -> None:
        """Start new workers: when one has died, the executor has ended the others."""
        self._executor.shutdown()
        self._executor = self._new_executor()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *failure: object) -> None:
        """End all workers: at once when something has happened, Ctrl-C for example."""
        if kind is not None:
            for worker in set(multiprocessing.active_children()) - self._others:
                worker.kill()
        self._executor.shutdown(cancel_futures=True)

    def _new_executor(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(self._workers, self._context, initializer=start_worker)


def start_worker() -> None:
    """Prepare a process that flies missions: it ends with the one that started it, not before."""
    # Ctrl-C in a terminal is sent to every process; the one that flies the campaign ends us.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # What was imported stays, and a mission leaves little to collect: not after each few objects.
    gc.freeze()
    gc.set_threshold(_COLLECTED_AFTER)
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """End this process when the one that flies the campaign is killed; else it waits for ever."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
