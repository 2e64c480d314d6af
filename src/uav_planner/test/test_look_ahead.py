"""Which visiting orders are looked at before take-off."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import pytest

from msgs_json.geometry import GridSpec, Point
from uav_planner.guarantee import guaranteed_sortie, least_limit_s
from uav_planner.look_ahead import ORDERS_MAX, PLACES_MAX, in_other_orders
from uav_planner.planning import MissionSpec, SortieRequest, SurveyLeg

MISSION = MissionSpec(
    grid=GridSpec(cols=12, rows=12, cell_m=10.0),
    c3=Point(east_m=0.0, north_m=0.0),
    radio_range_m=15.0,
    uav_speed_mps=10.0,
    tick_s=1.0,
    sortie_limit_s=1000.0,
    path_cells=4,
    min_path_cells=1,
)


def first_sortie(auvs: int, mission: MissionSpec = MISSION) -> SortieRequest:
    """Return the first sortie to AUVs here and there, their searches laid."""
    cells = [(at * 7 % 11, at * 5 % 12) for at in range(auvs)]
    legs = tuple(
        SurveyLeg(auv=f'auv_{at}', path=((col, row), (col + 1, row)), surface_deadline_s=10.0)
        for at, (col, row) in enumerate(cells)
    )
    return with_searches(SortieRequest(mission=mission, legs=legs, now_s=0.0))


def with_searches(request: SortieRequest) -> SortieRequest:
    unlaid = replace(request, legs=tuple(replace(leg, search=()) for leg in request.legs))
    route = guaranteed_sortie(unlaid).route
    legs = tuple(
        replace(leg, search=tuple(each.point for each in route if each.auv == leg.auv))
        for leg in request.legs
    )
    return replace(request, legs=legs)


def moved(auvs: int) -> int:
    """Return in how many ways one of some AUVs is moved by up to `PLACES_MAX` places."""
    orders = set()
    for here, there in itertools.permutations(range(auvs), 2):
        if abs(here - there) <= PLACES_MAX:
            rest = [at for at in range(auvs) if at != here]
            orders.add((*rest[:there], here, *rest[there:]))
    return len(orders)


@pytest.mark.parametrize('auvs', [1, 2, 3, 4, 5, 6, 9])
def test_the_given_order_comes_first_and_others_once_each(auvs: int) -> None:
    request = first_sortie(auvs)
    requests = in_other_orders(request)
    orders = [tuple(leg.auv for leg in each.legs) for each in requests]
    assert requests[0] is request
    assert len(set(orders)) == len(orders)
    assert {tuple(sorted(order)) for order in orders} == {tuple(sorted(orders[0]))}
    others = math.factorial(auvs) - 1 if auvs <= 5 else moved(auvs)
    assert len(orders) == 1 + min(others, ORDERS_MAX)


def test_they_are_those_with_the_shortest_rounds_and_their_searches_are_laid_anew() -> None:
    request = first_sortie(5)
    others = in_other_orders(request)[1:]
    rounds_s = [least_limit_s(MISSION, each.legs) for each in others]
    assert rounds_s == sorted(rounds_s)
    least_s = min(
        least_limit_s(MISSION, legs)
        for legs in itertools.permutations(request.legs)
        if legs != request.legs
    )
    assert rounds_s[0] == least_s
    assert all(each == with_searches(each) for each in others)


def test_orders_whose_round_is_longer_than_the_limit_are_left_out() -> None:
    request = first_sortie(4)
    rounds_s = sorted(
        least_limit_s(MISSION, legs)
        for legs in itertools.permutations(request.legs)
        if legs != request.legs
    )
    middle_s = rounds_s[len(rounds_s) // 2]
    tight = replace(request, mission=replace(MISSION, sortie_limit_s=middle_s))
    kept = [each for each in rounds_s if each <= middle_s]
    assert 0 < len(kept) < len(rounds_s)
    assert len(in_other_orders(tight)) == 1 + len(kept)
