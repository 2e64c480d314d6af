"""No mission of any planner explores its region before the lower bound."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from c3_station.in_process import fly
from c3_station.lower_bound import lower_bound_s
from c3_station.scenario_files import load_scenario
from c3_station.scenario_generator import MODELS, USUAL_MODELS, Span, generate_scenario
from c3_station.summary import Summarizer, Summary
from uav_planner.planners import PLANNERS, make_planner

if TYPE_CHECKING:
    from collections.abc import Sequence

    from c3_station.scenario import Scenario

SMALL = {'cols': Span(least=2, most=6), 'rows': Span(least=2, most=6)}
"""Regions in which the ends of a mission matter: first meetings, last legs, dead ends."""


OPTIONS = {'adaptive': {'effort': 'minimal'}}
"""Of planners that would take longer than need be here."""
SECONDS_PER_MISSION = {'adaptive': 0.5}
"""Of planners that plan whole missions ahead; the others take about 0.25 s."""


def seeds(first: int, seconds: float, planner: str) -> range:
    """Return seeds of missions that can be flown in about so many seconds, at least one."""
    return range(first, first + max(1, round(seconds / SECONDS_PER_MISSION.get(planner, 0.25))))


def flown(scenario: Scenario, planner: str) -> Summary:
    summarizer = Summarizer()
    fly(scenario, summarizer.frame, make_planner(planner, **OPTIONS.get(planner, {})))
    return summarizer.summary()


def share_explored(
    missions: range, planner: str, asked: dict[str, Span], models: Sequence[str]
) -> float:
    """Return how many random missions explored their region; none does before the bound."""
    explored = 0
    for seed in missions:
        scenario = generate_scenario(seed, asked, models)
        summary = flown(scenario, planner)
        # What the bound assumes of every planner.
        paths = [meeting.path for sortie in summary.sorties for meeting in sortie.meetings]
        assert all(len(path) <= scenario.planner.path_cells + 1 for path in paths)
        if summary.explored_s is not None:
            explored += 1
            assert lower_bound_s(scenario) <= summary.explored_s + 1e-6, f'seed {seed}'
    return explored / len(missions)


@pytest.mark.parametrize('planner', PLANNERS)
def test_no_mission_is_faster(planner: str) -> None:
    # Seed 3 is one in which planners come close.
    assert share_explored(seeds(3, 1.0, planner), planner, SMALL, USUAL_MODELS) > 0.5


@pytest.mark.slow
@pytest.mark.parametrize('planner', PLANNERS)
def test_no_small_mission_is_faster_whatever_happens(planner: str) -> None:
    assert share_explored(seeds(1000, 6.0, planner), planner, SMALL, tuple(MODELS)) > 0.4


@pytest.mark.slow
@pytest.mark.parametrize('planner', PLANNERS)
def test_no_mission_on_time_is_faster(planner: str) -> None:
    # At random, larger regions take thousands of sorties.
    asked = SMALL if planner == 'random' else {}
    assert share_explored(seeds(2000, 3.0, planner), planner, asked, ('on_time',)) > 0.5


def test_the_bound_can_be_reached() -> None:
    scenario = load_scenario('minimal')
    assert flown(scenario, 'robust').explored_s == lower_bound_s(scenario) == 110.0
