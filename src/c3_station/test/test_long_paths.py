"""Paths longer than can be listed: flown by the planners that search, walk or draw them."""

from __future__ import annotations

import pytest

from c3_station.in_process import fly
from c3_station.scenario_changes import read_change
from c3_station.scenario_files import load_scenario, with_choices
from c3_station.summary import Summarizer, Summary
from uav_planner.candidate_paths import LISTED_MOVES_MAX, SEARCHED_MOVES_MAX

MANY = LISTED_MOVES_MAX + 3


def flown(planner: str, path_cells: int, *changes: str) -> Summary:
    """Return what comes of the reference mission, with more time for a sortie."""
    keys = ('sortie.limit_s=100', f'planner.path_cells={path_cells}', *changes)
    scenario = with_choices(
        load_scenario('ecc2009'), planner=planner, changes=[read_change(key) for key in keys]
    )
    summarizer = Summarizer()
    fly(scenario, summarizer.frame)
    return summarizer.summary()


def longest_moves(summary: Summary) -> int:
    return max(len(meeting.path) - 1 for sortie in summary.sorties for meeting in sortie.meetings)


@pytest.mark.parametrize(
    ('planner', 'path_cells', 'changes'),
    [
        ('robust', MANY, ()),
        ('adaptive', MANY, ('planner.options.effort=minimal',)),
        ('adaptive', SEARCHED_MOVES_MAX, ('planner.options.effort=minimal',)),
        ('lanes', SEARCHED_MOVES_MAX, ()),
    ],
)
def test_a_region_is_explored_on_long_paths_within_the_limit(
    planner: str, path_cells: int, changes: tuple[str, ...]
) -> None:
    summary = flown(planner, path_cells, *changes)
    assert summary.complete
    assert summary.explored_s is not None
    assert summary.lower_bound_s is not None
    assert summary.explored_s >= summary.lower_bound_s
    assert (summary.sortie_limit_violations, summary.samples_lost) == (0, 0)
    assert longest_moves(summary) == path_cells


@pytest.mark.parametrize('planner', ['robust', 'random'])
def test_the_longest_paths_keep_the_limit(planner: str) -> None:
    summary = flown(planner, SEARCHED_MOVES_MAX, 'max_mission_s=300')
    assert summary.sortie_limit_violations == 0
    assert longest_moves(summary) == SEARCHED_MOVES_MAX
