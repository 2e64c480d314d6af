"""Missions in regions with land: no AUV goes there, and everything else is surveyed."""

from __future__ import annotations

from itertools import pairwise

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from c3_station.in_process import fly
from c3_station.scenario import Auv, Scenario
from c3_station.scenario_changes import Change
from c3_station.scenario_checks import mission_problems
from c3_station.scenario_files import load_scenario, with_choices
from c3_station.scenario_generator import USUAL_MODELS, Span, generate_scenario
from c3_station.summary import Summarizer, Summary, failed_conditions
from msgs_json.agent_shell import Frame
from msgs_json.geometry import GridSpec, Point
from msgs_json.messages import Dived
from msgs_json.ros_messages import Odometry
from uav_planner.planners import PLANNERS

SMALL = {name: Span(least=3, most=8) for name in ('cols', 'rows')}
LAND = {'masked': Span(least=0.1, most=0.5)}


def flown_beside_land(scenario: Scenario) -> Summary:
    """Fly a mission; hold every leg and every place of an AUV against the land."""
    region = scenario.region
    auvs = {auv.name for auv in scenario.auvs}
    summarizer = Summarizer()

    def check(name: str, frame: Frame) -> None:
        summarizer.frame(name, frame)
        if name in auvs and isinstance(frame.message, Odometry):
            assert_at_sea(region, frame.message.position)

    fly(scenario, check)
    legs = [logged.event for logged in summarizer.events if isinstance(logged.event, Dived)]
    assert len(legs) >= len(auvs)
    for leg in legs:
        assert all(region.contains(cell) for cell in leg.path)
        assert all(end in region.neighbours(start) for start, end in pairwise(leg.path))
    return summarizer.summary()


def assert_at_sea(region: GridSpec, position: Point) -> None:
    """It is in a cell of the region; on the edge between two cells, in both."""
    nudge_m = 1e-6 * region.cell_m
    for east_m in (position.east_m - nudge_m, position.east_m + nudge_m):
        for north_m in (position.north_m - nudge_m, position.north_m + nudge_m):
            assert region.contains(region.cell_at(Point(east_m=east_m, north_m=north_m)))


def assert_survey_is_as_promised(summary: Summary) -> None:
    assert summary.complete
    assert summary.explored_s is not None
    assert summary.lower_bound_s is not None
    assert summary.lower_bound_s <= summary.explored_s + 1e-6
    assert (summary.cells_explored, summary.refusals) == (summary.cells_total, ())
    assert (summary.sortie_limit_violations, summary.samples_lost) == (0, 0)


@settings(max_examples=15)
@given(seed=st.integers(0, 2**53), models=st.sampled_from([['on_time'], USUAL_MODELS]))
def test_robust_surveys_all_of_a_region_with_land_and_nothing_of_the_land(
    seed: int, models: list[str]
) -> None:
    scenario = generate_scenario(seed, SMALL | LAND, models)
    summary = flown_beside_land(scenario)
    assert summary.cells_total == scenario.region.cells_total
    assert_survey_is_as_promised(summary)


@pytest.mark.parametrize('planner', [name for name in PLANNERS if name != 'robust'])
def test_no_planner_sends_an_auv_to_land(planner: str) -> None:
    for seed in range(3):
        scenario = generate_scenario(seed, SMALL | LAND)
        short = msgspec.structs.replace(scenario, max_mission_s=scenario.max_mission_s / 10)
        flown_beside_land(by(planner, short))


def by(planner: str, scenario: Scenario) -> Scenario:
    """Return a scenario flown by a planner, with as little work as it can do."""
    least = [Change(key='planner.options.effort', value='minimal')]
    return with_choices(scenario, planner=planner, changes=least if planner == 'adaptive' else [])


def sea_in_two_parts(planner: str, limit_s: float) -> Scenario:
    wall = tuple((3, row) for row in range(6))
    ecc2009 = load_scenario('ecc2009')
    return msgspec.structs.replace(
        by(planner, ecc2009),
        region=GridSpec(cols=12, rows=6, cell_m=10.0, masked=wall),
        auvs=(
            Auv(name='auv_1', initial_path=((1, 1), (1, 2))),
            Auv(name='auv_2', initial_path=((6, 1), (6, 2))),
        ),
        sortie=msgspec.structs.replace(ecc2009.sortie, limit_s=limit_s),
    )


@pytest.mark.parametrize('planner', ['robust', 'adaptive'])
@pytest.mark.parametrize('limit_s', [40.0, 80.0])
def test_a_sea_in_two_parts_is_surveyed_with_an_auv_in_each(planner: str, limit_s: float) -> None:
    """The AUV in the small part has nothing to do any more long before the other one."""
    scenario = sea_in_two_parts(planner, limit_s)
    assert mission_problems(scenario) == []
    assert_survey_is_as_promised(flown_beside_land(scenario))


@pytest.mark.parametrize('planner', ['robust', 'adaptive'])
def test_a_part_of_the_sea_is_left_alone_when_its_auv_is_lost(planner: str) -> None:
    scenario = sea_in_two_parts(planner, 80.0)
    first, second = scenario.auvs
    second = msgspec.structs.replace(second, surfacing={'model': 'lost', 'from_s': 100.0})
    scenario = msgspec.structs.replace(scenario, auvs=(first, second), max_mission_s=900.0)
    summary = flown_beside_land(scenario)
    assert summary.sortie_limit_violations == 0
    assert summary.explored_s is None
    assert summary.complete  # it does not fly on until the hard stop
    assert summary.cells_explored >= 18  # all of the first part
    left = scenario.region.cells_total - summary.cells_explored
    assert len(summary.out_of_reach) == left
    assert all(col > 3 for col, _ in summary.out_of_reach)


def test_the_harbour_is_surveyed_as_its_file_says() -> None:
    scenario = load_scenario('harbour')
    summary = flown_beside_land(scenario)
    assert failed_conditions(summary, scenario) == []
    assert_survey_is_as_promised(summary)
