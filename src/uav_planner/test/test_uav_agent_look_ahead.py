"""A planner that plans the whole mission before take-off: slice by slice, for all to see."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import pytest
from uav_bench import PATHS, Bench, OneStep, events, of, order

from msgs_json.agent import Log
from msgs_json.messages import PlanningAhead, SortieDeparted, SortieReturned
from uav_planner.planners import PLANNERS, make_planner
from uav_planner.planning import LookAhead, PlanRequest, PlanResult, Tours

if TYPE_CHECKING:
    from collections.abc import Iterator

    from uav_planner.planning import SortiePlan, SortieRequest

TOURS: tuple[Tours, ...] = tuple({'auv_1': ((3, number),)} for number in range(3))
"""What it has in mind after each slice."""


class Visionary(OneStep):
    """Plans a mission in three slices; notes when each began, and what it was asked with."""

    def __init__(self) -> None:
        super().__init__()
        self.began: list[str] = []
        self.look_ahead_requests: list[SortieRequest] = []

    def plan_sortie(self, request: SortieRequest) -> SortiePlan:
        self.began.append('sortie')
        return super().plan_sortie(request)

    def plan_path(self, request: PlanRequest) -> PlanResult:
        self.began.append('path')
        return super().plan_path(request)

    def look_ahead(self, request: SortieRequest) -> Iterator[LookAhead]:
        self.look_ahead_requests.append(request)
        for number, tours in enumerate(TOURS, start=1):
            self.began.append(f'slice {number}')
            yield LookAhead(share=number / len(TOURS), tours=tours)


class Orderly(Visionary):
    """Turns the visiting order round in its second slice."""

    def look_ahead(self, request: SortieRequest) -> Iterator[LookAhead]:
        auvs = tuple(leg.auv for leg in request.legs)
        orders = (auvs, auvs[::-1], auvs[::-1])
        for ahead, turned in zip(super().look_ahead(request), orders, strict=True):
            yield dataclasses.replace(ahead, visiting_order=turned)


def test_its_order_is_acknowledged_before_it_plans_ahead_and_tells_how_far_it_is() -> None:
    planner = Visionary()
    bench = Bench(planner)
    assert not bench.agent.is_busy
    bench.tick(3)
    assert len(bench.hear('c3', order())) == 1
    assert bench.agent.is_busy
    assert planner.began == ['sortie']
    shares = [0.33, 0.67, 1.0]
    assert bench.plan_ahead() == [Log(PlanningAhead(share=share), 2.0) for share in shares]
    assert planner.began == ['sortie', 'slice 1', 'slice 2', 'slice 3']


def test_one_slice_is_done_at_a_time() -> None:
    planner = Visionary()
    bench = Bench(planner).ordered()
    bench.agent.work(bench.now_s)
    assert planner.began == ['sortie', 'slice 1']
    assert bench.agent.is_busy


def test_the_whole_mission_is_planned_from_where_the_first_sortie_finds_the_auvs() -> None:
    planner = Visionary()
    Bench(planner).ordered().plan_ahead()
    (request,) = planner.look_ahead_requests
    assert [(leg.auv, leg.path) for leg in request.legs] == list(PATHS.items())
    assert all(leg.search for leg in request.legs)
    assert request.now_s == 0.0
    assert request.values is not None
    assert (request.values == 1.0).sum() == 12 - 4


@pytest.mark.parametrize('slices', [0, 1, 2, 3])
def test_what_was_planned_so_far_is_in_mind_at_the_first_meeting(slices: int) -> None:
    planner = Visionary()
    bench = Bench(planner).ordered()
    for _ in range(slices):
        bench.agent.work(bench.now_s)
    bench.until(SortieDeparted)
    bench.meet('auv_1')
    assert [request.tours for request in planner.requests] == [TOURS[slices - 1] if slices else {}]


@pytest.mark.parametrize('slices', [1, 4])
def test_a_repeated_order_is_not_planned_again(slices: int) -> None:
    planner = Visionary()
    bench = Bench(planner).ordered()
    for _ in range(slices):
        bench.agent.work(bench.now_s)
    is_busy = bench.agent.is_busy
    assert is_busy == (slices < 4)
    bench.hear('c3', order())
    assert bench.agent.is_busy == is_busy
    bench.plan_ahead()
    assert len(planner.look_ahead_requests) == 1


def test_an_order_that_is_refused_makes_no_work() -> None:
    bench = Bench(Visionary())
    bench.tick()
    bench.hear('c3', order(min_path_cells=2))
    assert not bench.agent.is_busy


@pytest.mark.parametrize('name', sorted(PLANNERS.keys() - {'adaptive'}))
def test_a_planner_that_goes_from_leg_to_leg_has_nothing_to_plan_ahead(name: str) -> None:
    bench = Bench(make_planner(name)).ordered(radio_range_m=10.0)
    assert bench.agent.is_busy
    assert bench.plan_ahead() == []


@pytest.mark.parametrize('slices', [1, 2, 3])
def test_the_first_sortie_goes_out_in_the_visiting_order_planned_so_far(slices: int) -> None:
    planner = Orderly()
    bench = Bench(planner).ordered()
    for _ in range(slices):
        bench.agent.work(bench.now_s)
    (first,) = of(SortieDeparted, events(bench.until(SortieDeparted)))
    auvs = tuple(PATHS)
    assert first.sortie == 1
    assert first.order == (auvs if slices == 1 else auvs[::-1])
    bench.meet(first.order[0])
    assert tuple(leg.auv for leg in planner.requests[0].legs) == first.order


def test_with_the_first_departure_planning_ahead_ends() -> None:
    bench = Bench(Orderly()).ordered()
    bench.agent.work(bench.now_s)
    bench.until(SortieDeparted)
    assert not bench.agent.is_busy
    assert bench.agent.work(bench.now_s) == []
    for auv in PATHS:
        bench.meet(auv)
    bench.until(SortieReturned)
    assert bench.agent.work(bench.now_s) == []  # not for the second sortie, either
    (second,) = of(SortieDeparted, events(bench.until(SortieDeparted)))
    assert second.sortie == 2
    assert second.order == tuple(PATHS)
