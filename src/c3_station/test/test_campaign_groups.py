"""Results sorted for comparison: sections, groups, planners on the same seeds."""

from __future__ import annotations

import pytest
from campaign_samples import sample_campaign, sample_result, sample_results

from c3_station.campaign_groups import (
    C3_WAIT,
    DATA_AGE,
    EXPLORED,
    EXPLORED_RATIO,
    NEGLECT,
    compare,
    sections_of,
    totals_of,
)
from c3_station.campaign_mission import MissionExit, MissionResult
from c3_station.campaign_plan import Campaign

CAMPAIGN = sample_campaign('surfacing=slow,mixed', scenarios=('minimal', 'ecc2009'), seeds=4)


def flown(campaign: Campaign) -> list[MissionResult]:
    return [sample_result(number) for number in range(1, campaign.missions_total + 1)]


def test_every_scenario_has_a_section_with_a_group_for_each_variation_and_planner() -> None:
    first, second = sections_of(CAMPAIGN, flown(CAMPAIGN))
    assert (first.title, second.title) == ('minimal', 'ecc2009')
    assert [(group.variation, group.planner) for group in first.groups] == [
        ('surfacing=slow', 'ecc2009'),
        ('surfacing=slow', 'robust'),
        ('surfacing=mixed', 'ecc2009'),
        ('surfacing=mixed', 'robust'),
    ]
    assert (first.planners, first.variations) == (
        ('ecc2009', 'robust'),
        ('surfacing=slow', 'surfacing=mixed'),
    )
    assert {group.missions for group in (*first.groups, *second.groups)} == {4}
    numbers = [
        result.number
        for section in (first, second)
        for group in section.groups
        for result in group.results.values()
    ]
    assert sorted(numbers) == list(range(1, 33))


def test_what_is_not_flown_yet_is_left_out_and_the_order_stays() -> None:
    (section,) = sections_of(CAMPAIGN, [sample_result(12), sample_result(2)])
    assert section.title == 'minimal'
    assert [(group.variation, group.planner) for group in section.groups] == [
        ('surfacing=slow', 'robust'),
        ('surfacing=mixed', 'robust'),
    ]
    assert sections_of(CAMPAIGN, []) == ()


def test_many_scenarios_are_taken_together_and_measured_against_their_bounds(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr('c3_station.campaign_groups._SECTIONS_MAX', 1)
    (section,) = sections_of(CAMPAIGN, flown(CAMPAIGN))
    assert section.title == '2 scenarios'
    assert {group.missions for group in section.groups} == {8}
    assert section.metrics == (EXPLORED_RATIO, NEGLECT, C3_WAIT, DATA_AGE)
    ratio = section.groups[0].spread(EXPLORED_RATIO)
    assert ratio is not None
    assert ratio.least == 451.0 / 330.0


def test_a_group_counts_what_a_person_asks_for() -> None:
    campaign = sample_campaign(planners=('robust',), seeds=4)
    results = [
        sample_result(1, violations=2, bound_ratio_max=1.25, missed=1),
        sample_result(2, violations=1, samples_lost=3, bound_ratio_max=None),
        sample_result(3, exit=MissionExit.ERROR, samples_lost=None, explored_s=None, auvs_lost=1),
        sample_result(4, exit=MissionExit.STOPPED),
    ]
    ((group,),) = [section.groups for section in sections_of(campaign, results)]
    assert (group.violations.count, group.violations.total) == (2, 4)
    assert (group.sorties.count, group.sorties.total) == (3, 8)
    assert (group.missed, group.samples_lost, group.auvs_lost) == (1, 3, 1)
    assert (group.errors, group.stopped, group.bound_ratio_max) == (1, 1, 1.25)
    spread = group.spread(EXPLORED)
    assert spread is not None
    assert spread.total == 3
    assert [result.stands_out for result in results] == [True] * 4
    assert not sample_result(5, auvs_lost=1).stands_out


def test_totals_hold_all_missions_of_a_planner() -> None:
    totals = totals_of(CAMPAIGN, flown(CAMPAIGN))
    assert [(group.planner, group.missions) for group in totals] == [
        ('ecc2009', 16),
        ('robust', 16),
    ]


def test_planners_stand_beside_the_first_one_in_the_same_variation() -> None:
    campaign = sample_campaign('surfacing=slow,mixed,early_10', seeds=1)
    # Not flown yet: robust with slow, ecc2009 with mixed.
    (section,) = sections_of(campaign, [sample_result(number) for number in (1, 4, 5, 6)])
    assert [
        (group.variation, group.planner, base.variation, base.planner)
        for group, base in section.beside_first()
    ] == [('surfacing=early_10', 'robust', 'surfacing=early_10', 'ecc2009')]


def test_planners_are_compared_on_the_same_seeds() -> None:
    campaign = sample_campaign(seeds=4)  # number 2 k - 1 is ecc2009 on seed k - 1, 2 k robust
    explored_s = {1: 500.0, 2: 480.0, 3: 500.0, 4: 510.0, 5: None, 6: 400.0, 7: 450.0, 8: 420.0}
    results = [sample_result(number, explored_s=each) for number, each in explored_s.items()]
    base, robust = sections_of(campaign, results[:-1])[0].groups  # robust has not flown seed 3
    comparison = compare(robust, base, EXPLORED)
    assert comparison is not None
    assert (comparison.difference.least, comparison.difference.most) == (-20.0, 10.0)
    assert (comparison.better.count, comparison.worse.count, comparison.better.total) == (1, 1, 2)
    assert compare(robust, base, C3_WAIT).difference.total == 3  # type: ignore[union-attr]


def test_without_common_figures_there_is_no_comparison() -> None:
    campaign = sample_campaign(seeds=2)
    base, robust = sections_of(campaign, [sample_result(1), sample_result(4)])[0].groups
    assert compare(robust, base, EXPLORED) is None


def test_sections_do_not_depend_on_the_order_of_results() -> None:
    results = sample_results(CAMPAIGN)
    assert sections_of(CAMPAIGN, results) == sections_of(CAMPAIGN, results[::-1])
