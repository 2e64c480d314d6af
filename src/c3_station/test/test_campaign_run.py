"""Flying many missions: each once, whoever flies it and whatever dies on the way."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from concurrent.futures import BrokenExecutor, Future, ThreadPoolExecutor
from threading import Timer

import pytest
from campaign_samples import sample_campaign, sample_result
from hypothesis import given
from hypothesis import strategies as st

from c3_station.campaign_mission import MissionExit, MissionResult
from c3_station.campaign_plan import MissionJob
from c3_station.campaign_run import fly_all

CAMPAIGN = sample_campaign(seeds=40)


class Workers:
    """
    A pool without processes.

    Missions in ``deadly`` kill their worker, and with it all that is under way, as often as told.
    Those in ``endless`` do not end.
    """

    died: tuple[type[Exception], ...] = (BrokenExecutor,)

    def __init__(
        self,
        places: int,
        wall_s: float,
        deadly: dict[int, int],
        endless: frozenset[int] = frozenset(),
    ) -> None:
        self.places = places
        self.batches: list[list[int]] = []
        self.deaths = 0
        self.renewed = 0
        self.flying_on: list[Future[list[MissionResult]]] = []
        self._wall_s = wall_s
        self._deadly = deadly
        self._endless = endless
        self._waiting: list[tuple[Future[list[MissionResult]], list[int]]] = []
        self._broken = False

    def submit(self, jobs: Sequence[MissionJob]) -> Future[list[MissionResult]]:
        if self._broken:
            raise BrokenExecutor('nothing is flown any more')
        future: Future[list[MissionResult]] = Future()
        numbers = [job.number for job in jobs]
        self.batches.append(numbers)
        self._waiting.append((future, numbers))
        if len(self._waiting) == self.places or len(jobs) == 1:
            self._work_off()
        return future

    def renew(self) -> None:
        assert self._broken
        self._broken = False
        self.renewed += 1

    def _work_off(self) -> None:
        while self._waiting:
            future, numbers = self._waiting.pop()  # the last one first: any order will do
            victims = [number for number in numbers if self._deadly.get(number, 0)]
            if not victims and self._endless.intersection(numbers):
                self.flying_on.append(future)
            elif victims or self._broken:
                self.deaths += len(victims)
                self._broken = True
                for number in victims:
                    self._deadly[number] -= 1
                future.set_exception(BrokenExecutor('a worker died'))
            else:
                future.set_result([sample_result(n, wall_s=self._wall_s) for n in numbers])


def flown_by(
    workers: Workers, jobs: Iterable[MissionJob] | None = None
) -> dict[int, MissionResult]:
    if jobs is None:
        jobs = map(CAMPAIGN.job, range(1, CAMPAIGN.missions_total + 1))
    taken: list[MissionResult] = []
    fly_all(jobs, workers, taken.extend, look=lambda: None)
    by_number = {result.number: result for result in taken}
    assert len(by_number) == len(taken)
    return by_number


@given(
    places=st.integers(1, 5),
    wall_s=st.sampled_from([0.0, 0.01, 0.1, 3.0]),
    deadly=st.dictionaries(st.integers(1, 80), st.integers(1, 3), max_size=4),
)
def test_every_mission_has_one_result_whatever_dies(
    places: int, wall_s: float, deadly: dict[int, int]
) -> None:
    results = flown_by(Workers(places, wall_s, dict(deadly)))
    assert sorted(results) == list(range(1, 81))
    for number, result in results.items():
        # Once is bad luck, and so may a second time be beside others; alone it is the mission.
        if deadly.get(number, 0) <= 1:
            assert result.exit is MissionExit.COMPLETE
        if result.exit is MissionExit.ERROR:
            assert result.reason == 'its process was killed, twice (out of memory?)'


def test_a_mission_that_kills_whoever_flies_it_ends_as_an_error_alone() -> None:
    workers = Workers(3, 0.1, {17: 1000})
    results = flown_by(workers)
    assert [n for n, result in results.items() if result.exit is MissionExit.ERROR] == [17]
    assert workers.renewed == 2


def test_without_missions_nothing_is_flown() -> None:
    workers = Workers(3, 0.1, {})
    assert flown_by(workers, jobs=()) == {}
    assert workers.batches == []


def test_batches_are_as_long_as_missions_are_short() -> None:
    lengths = {}
    for wall_s in (0.01, 0.1, 2.0):
        workers = Workers(2, wall_s, {})
        flown_by(workers)
        lengths[wall_s] = max(map(len, workers.batches))
    assert lengths == {0.01: 39, 0.1: 5, 2.0: 1}


def test_the_last_missions_are_spread_over_all_workers() -> None:
    workers = Workers(4, 0.001, {})
    flown_by(workers)
    assert [len(batch) for batch in workers.batches[-4:]] == [1, 1, 1, 1]


def test_an_error_of_ours_is_not_taken_for_a_dead_worker() -> None:
    class Broken(Workers):
        def submit(self, jobs: Sequence[MissionJob]) -> Future[list[MissionResult]]:
            with ThreadPoolExecutor(1) as threads:
                return threads.submit(lambda: [][0])

    with pytest.raises(IndexError):
        flown_by(Broken(2, 0.1, {}))


@pytest.mark.parametrize(
    'deadly', [{}, {2: 1}, {1: 1}], ids=['first_flight', 'beside_a_death', 'alone']
)
def test_who_does_not_want_to_wait_for_a_mission_need_not(deadly: dict[int, int]) -> None:
    workers = Workers(3, 0.1, dict(deadly), endless=frozenset({1}))
    # Whoever waits for the mission without looking gets this after a while.
    too_late = Timer(5.0, lambda: workers.flying_on[0].set_exception(TimeoutError()))
    looks_in_vain = 0

    def look() -> None:
        nonlocal looks_in_vain
        looks_in_vain += bool(workers.flying_on)
        if looks_in_vain > 3:
            raise KeyboardInterrupt

    too_late.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            fly_all(map(CAMPAIGN.job, range(1, 4)), workers, lambda results: None, look)
    finally:
        too_late.cancel()
    assert sum(deadly.values()) == workers.deaths
