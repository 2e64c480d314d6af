"""What a campaign flies: cases, numbers, seeds, and what makes two campaigns different."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import msgspec
import pytest

import auv_sim
from c3_station import software
from c3_station.campaign_plan import (
    Campaign,
    differences,
    plan_campaign,
    run_arguments,
    scenario_of,
)
from c3_station.scenario_changes import read_variants
from c3_station.scenario_files import load_scenario, scenario_from_json, shipped_scenarios
from c3_station.software import code_digest


def planned(*vary: str, **asked: Any) -> Campaign:  # noqa: ANN401
    choices: dict[str, Any] = {
        'scenarios': ['minimal'],
        'planners': ['ecc2009', 'robust'],
        'first_seed': 0,
        'seeds': 3,
    }
    return plan_campaign(variations=[read_variants(text) for text in vary], **(choices | asked))


def test_scenarios_variations_and_planners_are_all_combined() -> None:
    campaign = planned(
        'sortie.limit_s=50,60', 'surfacing=slow,mixed', scenarios=['minimal', 'ecc2009']
    )
    cases = [(case.scenario, case.variation, case.planner) for case in campaign.cases]
    assert len(set(cases)) == len(cases) == 2 * 4 * 2
    assert campaign.missions_total == 16 * 3
    assert cases[:5] == [
        ('minimal', 'sortie.limit_s=50 surfacing=slow', 'ecc2009'),
        ('minimal', 'sortie.limit_s=50 surfacing=slow', 'robust'),
        ('minimal', 'sortie.limit_s=50 surfacing=mixed', 'ecc2009'),
        ('minimal', 'sortie.limit_s=50 surfacing=mixed', 'robust'),
        ('minimal', 'sortie.limit_s=60 surfacing=slow', 'ecc2009'),
    ]
    assert [case.variation for case in planned().cases] == ['as it is'] * 2


def test_a_case_holds_the_scenario_it_flies() -> None:
    for case in planned('sortie.limit_s=50,60', first_seed=7).cases:
        scenario = scenario_from_json(case.scenario_json.encode())
        assert case.variation == f'sortie.limit_s={scenario.sortie.limit_s:g}'
        assert scenario.planner.name == case.planner
        assert scenario.seed == 7


def test_without_a_planner_it_is_that_of_the_scenario() -> None:
    (case,) = planned(planners=()).cases
    assert case.planner == load_scenario('minimal').planner.name


def test_every_case_is_flown_on_the_same_seeds_and_all_cases_advance_alike() -> None:
    campaign = planned(seeds=4, first_seed=10)
    places = [campaign.place(number) for number in range(1, campaign.missions_total + 1)]
    assert sorted(places) == [(case, seed) for case in (0, 1) for seed in (10, 11, 12, 13)]
    assert all(seed <= after for (_, seed), (_, after) in pairwise(places))
    job = campaign.job(4)
    assert (job.number, job.seed, job.scenario.seed) == (4, 11, 11)
    assert job.scenario.planner.name == 'robust'


def test_the_arguments_that_fly_a_mission_name_every_choice() -> None:
    campaign = planned('auvs.surfacing={model: early, probability: 0.1}', 'sortie.limit_s=50')
    assert run_arguments(campaign.cases[1], 12) == [
        'run',
        'minimal',
        '--planner',
        'robust',
        '--seed',
        '12',
        '--set',
        'auvs.surfacing={model: early, probability: 0.1}',
        '--set',
        'sortie.limit_s=50',
    ]


@pytest.mark.parametrize(
    ('vary', 'asked', 'told'),
    [
        ((), {'scenarios': []}, 'no scenario is named'),
        ((), {'scenarios': ['minimal', 'minimal']}, 'scenario minimal: is given twice'),
        ((), {'scenarios': ['minimum']}, 'did you mean minimal?'),
        ((), {'planners': ['robust', 'robust']}, '--planner robust: is given twice'),
        ((), {'planners': ['best']}, r"minimal, as it is, best: .*unknown planner 'best'"),
        (('tick_s=1', 'tick_s=2'), {}, '--vary tick_s: is given twice'),
        (('seed=1,2',), {}, '--vary seed: is not varied so; use --seed'),
        (('planner.name=a,b',), {}, 'use --planner'),
        (('sortie.limit_s=60,-1',), {}, 'minimal, sortie.limit_s=-1, ecc2009: .*limit_s is -1'),
        ((), {'first_seed': -1}, 'seed is -1'),
        ((), {'first_seed': 2**53}, 'seed is 9007199254740994'),
    ],
)
def test_what_makes_no_campaign_is_refused(
    vary: tuple[str, ...], asked: dict[str, Any], told: str
) -> None:
    with pytest.raises(ValueError, match=told):
        planned(*vary, **asked)


# --- the same, or another one --------------------------------------------------------------------


def test_a_campaign_is_the_same_when_asked_for_in_the_same_way() -> None:
    first, again = planned('surfacing=slow,mixed'), planned('surfacing=slow,mixed')
    assert first == again
    assert differences(first, again) == []
    assert msgspec.json.decode(msgspec.json.encode(first), type=Campaign) == first


@pytest.mark.parametrize(
    ('other', 'told'),
    [
        (
            lambda: planned('surfacing=slow,mixed', seeds=4),
            'its seeds are 0 to 2; asked for are 0 to 3',
        ),
        (lambda: planned('surfacing=slow,mixed', first_seed=1), 'asked for are 1 to 3'),
        (
            lambda: planned('surfacing=slow,on_time'),
            'it has no minimal, surfacing=on_time, ecc2009',
        ),
        (lambda: planned('surfacing=slow'), 'it has also minimal, surfacing=mixed, robust'),
        (lambda: planned('surfacing=mixed,slow'), 'its cases are in another order'),
    ],
)
def test_what_is_different_is_told(other: Any, told: str) -> None:  # noqa: ANN401
    assert told in '; '.join(differences(planned('surfacing=slow,mixed'), other()))


def test_other_code_and_a_changed_file_make_another_campaign(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / 'bay.yaml'
    text = shipped_scenarios()['minimal'].read_text()
    file.write_text(text)
    before = planned(scenarios=[str(file)], planners=['robust'])
    case = before.cases[0]
    assert scenario_of(before, case) == scenario_from_json(case.scenario_json.encode())

    file.write_text(text.replace('description: ', 'description: changed, '))
    after = planned(scenarios=[str(file)], planners=['robust'])
    assert differences(before, after) == [f'the scenario of {file}, as it is, robust has changed']
    assert scenario_of(before, case) != scenario_from_json(case.scenario_json.encode())

    monkeypatch.setattr(software, 'code_digest', lambda: 'another')
    (difference,) = differences(after, planned(scenarios=[str(file)], planners=['robust']))
    assert 'this is 0.1.0, code another' in difference


def test_the_digest_of_the_code_changes_with_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    digests = [code_digest(), code_digest()]
    monkeypatch.setattr(auv_sim, '__path__', [*auv_sim.__path__, str(tmp_path)])
    (tmp_path / 'new.py').touch()
    digests.append(code_digest())
    (tmp_path / 'new.py').write_text('answer = 42')
    digests.append(code_digest())
    assert digests[0] == digests[1]
    assert len(set(digests)) == 3
    assert {len(digest) for digest in digests} == {12}
