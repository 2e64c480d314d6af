"""Planner `random`: every allowed path is as likely as any other, and the draw can be repeated."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import pytest

from msgs_json.geometry import GridSpec, Point
from uav_planner.guarantee import GuaranteedPaths
from uav_planner.guarantee_oracle import meeting_request, next_sortie, paths_from
from uav_planner.oracle_boards import legs_of
from uav_planner.planners import make_planner
from uav_planner.planners.random_paths import RandomPlanner
from uav_planner.planning import MissionSpec, PlanRequest, PlanStatus

MISSION = MissionSpec(
    grid=GridSpec(cols=6, rows=5, cell_m=10.0, masked=((2, 1), (3, 3))),
    c3=Point(east_m=0.0, north_m=0.0),
    radio_range_m=15.0,
    uav_speed_mps=5.0,
    tick_s=1.0,
    sortie_limit_s=19.0,
    path_cells=3,
    min_path_cells=1,
)
DRAWS = 800


def met(mission: MissionSpec = MISSION, now_s: float = 0.0) -> PlanRequest:
    """Return a meeting with the first of two AUVs."""
    legs = next_sortie(mission, legs_of([((1, 1), (1, 2)), ((4, 1), (4, 0))]))
    return replace(meeting_request(mission, legs, 'auv_1', ((1, 2), None)), now_s=now_s)


def test_each_allowed_path_of_all_moves_is_drawn_equally_often() -> None:
    guaranteed = GuaranteedPaths(met())
    paths = [path for path in paths_from(MISSION, (1, 2)) if len(path) == 4]
    allowed = [path for path in paths if guaranteed.allows(path)]
    assert 10 < len(allowed) < len(paths)
    planner = RandomPlanner(seed=3)
    drawn = Counter(planner.plan_path(met(now_s=float(draw))).path for draw in range(DRAWS))
    assert drawn.keys() == set(allowed)
    expected = DRAWS / len(allowed)
    # Chi-squared exceeds its mean by four standard deviations once in many thousand seeds.
    chi_squared = sum((count - expected) ** 2 / expected for count in drawn.values())
    assert chi_squared < len(allowed) + 4 * (2 * len(allowed)) ** 0.5


def test_the_same_request_gets_the_same_path_and_another_one_another() -> None:
    paths = {RandomPlanner(seed=1).plan_path(met()).path for _ in range(3)}
    assert len(paths) == 1
    others = {RandomPlanner(seed=1).plan_path(met(now_s=float(now))).path for now in range(1, 9)}
    assert len(others) > 1
    seeds = {RandomPlanner(seed=seed).plan_path(met()).path for seed in range(8)}
    assert len(seeds) > 1


def test_where_hardly_any_path_is_allowed_the_auv_stays() -> None:
    tight = replace(MISSION, sortie_limit_s=15.0, path_cells=14)
    plan = RandomPlanner().plan_path(met(tight))
    assert plan.path == GuaranteedPaths(met(tight)).stay.path
    assert plan.status is PlanStatus.SHORTENED


def test_paths_may_be_longer_than_any_table_of_walks() -> None:
    long = replace(MISSION, path_cells=14, sortie_limit_s=100.0)
    plan = RandomPlanner().plan_path(met(long))
    assert plan.status is PlanStatus.OK
    assert len(plan.path) == 15


@pytest.mark.parametrize('seed', [-1, 0.5, True, 'seven'])
def test_a_seed_that_is_none_is_refused(seed: object) -> None:
    with pytest.raises(ValueError, match='seed must be a whole number, 0 or more, not '):
        make_planner('random', seed=seed)
