"""
Flies missions on a pool of workers and passes on their results as they come.

Which worker flies a mission, and what it flew before, changes nothing in the result.
"""

from __future__ import annotations

import math
from collections import deque
from concurrent.futures import FIRST_COMPLETED, Future, wait
from itertools import islice
from typing import TYPE_CHECKING, Protocol

from c3_station.campaign_mission import MissionResult, crashed

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from c3_station.campaign_plan import MissionJob

_BATCH_S = 0.5
"""
About how long a worker flies before it hands over results, seconds.

Long beside the millisecond of sending them, short enough for a bar that moves, and little to lose
when the campaign is killed.
"""

_LOOK_EVERY_S = 0.2
"""How long to wait for a result before looking whether to go on: short to a person, seconds."""


class PoolLostError(Exception):
    """The workers cannot be reached any more; the text says which."""


class Pool(Protocol):
    """Workers that fly missions."""

    died: tuple[type[Exception], ...]
    """What a future, or `submit`, raises when a worker has died."""

    @property
    def places(self) -> int:
        """Return how many batches are to be under way, so that no worker waits."""
        ...

    def submit(self, jobs: Sequence[MissionJob]) -> Future[list[MissionResult]]:
        """Have missions flown, one after another, by one worker."""
        ...

    def renew(self) -> None:
        """Make the pool fit to fly again after a worker has died."""
        ...


def fly_all(
    jobs: Iterable[MissionJob],
    pool: Pool,
    take: Callable[[list[MissionResult]], None],
    look: Callable[[], None],
) -> None:
    """
    Fly missions and pass on their results, in the order in which they come.

    However long a mission takes, ``look`` is called several times a second, to break off by what
    it raises.

    When a worker dies, the missions under way are flown again, one at a time: a mission that kills
    its worker is so found out, becomes a result, and takes no other with it.
    """
    _Flying(jobs, pool, take, look).to_the_end()


class _Flying:
    def __init__(
        self,
        jobs: Iterable[MissionJob],
        pool: Pool,
        take: Callable[[list[MissionResult]], None],
        look: Callable[[], None],
    ) -> None:
        self._waiting = deque(jobs)
        self._under_way: dict[Future[list[MissionResult]], list[MissionJob]] = {}
        self._pool = pool
        self._take = take
        self._look = look
        self._flown = 0
        self._flown_s = 0.0

    def to_the_end(self) -> None:
        while self._waiting or self._under_way:
            try:
                self._hand_out()
                self._collect()
            except self._pool.died:
                self._fly_again()

    def _hand_out(self) -> None:
        places = self._pool.places
        while self._waiting and len(self._under_way) < places:
            batch = list(islice(self._waiting, self._batch_size(places)))
            self._submit(batch)
            for _ in batch:
                self._waiting.popleft()

    def _batch_size(self, places: int) -> int:
        """Return how many missions fill `_BATCH_S`, and still leave some for every place."""
        if not self._flown:
            return 1
        fitting = math.floor(_BATCH_S * self._flown / max(self._flown_s, 1e-9))
        return max(1, min(fitting, len(self._waiting) // places))

    def _submit(self, batch: list[MissionJob]) -> None:
        self._under_way[self._pool.submit(batch)] = batch

    def _collect(self) -> None:
        for future in self._wait():
            results = future.result()
            del self._under_way[future]
            self._note(results)

    def _wait(self) -> set[Future[list[MissionResult]]]:
        """Return what is done of all that is under way, as soon as there is something."""
        while True:
            self._look()
            done, _ = wait(self._under_way, _LOOK_EVERY_S, FIRST_COMPLETED)
            if done:
                return done

    def _note(self, results: list[MissionResult]) -> None:
        self._flown += len(results)
        self._flown_s += sum(result.wall_s for result in results)
        self._take(results)

    def _fly_again(self) -> None:
        suspects = []
        while self._under_way:
            for future in self._wait():
                batch = self._under_way.pop(future)
                if isinstance(future.exception(), self._pool.died):
                    suspects += batch
                else:
                    self._note(future.result())
        self._pool.renew()
        for job in suspects:
            self._fly_alone(job)

    def _fly_alone(self, job: MissionJob) -> None:
        try:
            self._submit([job])
            self._collect()
        except self._pool.died:
            self._under_way.clear()
            self._pool.renew()
            self._note([crashed(job, 'its process was killed, twice (out of memory?)')])
