"""One mission of a campaign: its row is what its summary says, and failures are results."""

from __future__ import annotations

import math
from typing import Any

import msgspec
import pytest

from c3_station import campaign_mission
from c3_station.campaign_mission import (
    MissionExit,
    MissionResult,
    OtherCodeError,
    crashed,
    fly_mission,
    fly_missions,
)
from c3_station.campaign_plan import MissionJob
from c3_station.in_process import fly
from c3_station.scenario import Scenario
from c3_station.scenario_changes import read_change
from c3_station.scenario_files import load_scenario, scenario_json, with_choices
from c3_station.software import this_software
from c3_station.summary import Summarizer, Summary


def job_of(*changes: str, name: str = 'minimal', seed: int = 3) -> MissionJob:
    scenario = with_choices(load_scenario(name), changes=[read_change(text) for text in changes])
    return MissionJob(
        number=7,
        software=this_software(),
        scenario_json=scenario_json(scenario).decode(),
        seed=seed,
    )


def summary_of(scenario: Scenario) -> Summary:
    summarizer = Summarizer()
    fly(scenario, summarizer.frame)
    return summarizer.summary()


def without_wall_time(result: MissionResult) -> dict[str, Any]:
    figures = msgspec.to_builtins(result)
    assert figures.pop('wall_s') > 0.0
    return dict(figures)


def test_the_row_of_a_mission_is_what_its_summary_says() -> None:
    job = job_of('surfacing=early_50', 'planner.name=ecc2009', name='ecc2009')
    result, summary = fly_mission(job), summary_of(job.scenario)
    assert summary.seed == 3
    assert summary.sortie_limit_violations > 0
    assert (result.number, result.exit, result.reason) == (7, MissionExit.COMPLETE, None)
    same = {*Summary.__struct_fields__, 'samples_lost'} & {*MissionResult.__struct_fields__}
    same -= {'wall_s', 'restarts'}  # that of a recorded mission; one figure for all nodes
    assert len(same) == 15
    assert {n: getattr(result, n) for n in same} == {n: getattr(summary, n) for n in same}
    assert result.violations == summary.sortie_limit_violations
    assert result.sorties_total == len(summary.sorties) == len(result.sortie_times)
    durations_s = [sortie.duration_s or 0.0 for sortie in summary.sorties]
    assert result.longest_sortie_s == max(durations_s)
    assert [each.duration_s for each in result.sortie_times] == durations_s
    assert [each.worst_case_s for each in result.sortie_times] == [
        sortie.worst_case_s for sortie in summary.sorties
    ]
    assert {each.limit_s for each in result.sortie_times} == {60.0}


def test_what_was_flown_before_changes_nothing() -> None:
    jobs = [job_of('surfacing=early_50', seed=seed) for seed in (1, 2, 1)]
    first, other, again = map(without_wall_time, fly_missions(jobs))
    assert first == again
    assert first != other


def test_missions_for_other_code_are_not_flown() -> None:
    own = job_of()
    other = msgspec.structs.replace(own, software='0.1.0, code another')
    for jobs in ([other], [own, other]):
        with pytest.raises(OtherCodeError, match=r'has other code, .*; allowed: 0.1.0, code ano'):
            fly_missions(jobs)


def test_a_mission_that_does_not_end_is_stopped() -> None:
    result = fly_mission(job_of('max_mission_s=60'))
    assert result.exit is MissionExit.STOPPED
    assert result.reason == 'hard stop: max_mission_s is reached'
    assert result.mission_s is None
    assert result.stands_out


def test_an_exception_is_a_result_that_says_where(monkeypatch: pytest.MonkeyPatch) -> None:
    def fly_into_trouble(scenario: Scenario, sink: Any, planner: Any) -> None:  # noqa: ANN401
        fly(with_choices(scenario, changes=[read_change('max_mission_s=60')]), sink, planner)
        raise ZeroDivisionError('no\n  way')

    monkeypatch.setattr(campaign_mission, 'fly', fly_into_trouble)
    result = fly_mission(job_of())
    assert result.exit is MissionExit.ERROR
    assert result.reason is not None
    assert result.reason.startswith('ZeroDivisionError: no way (fly_into_trouble, line ')
    assert result.samples_collected > 0  # up to then
    assert result.stands_out


def test_a_crash_has_no_figures_but_stands_out() -> None:
    result = crashed(job_of(), 'killed')
    assert (result.number, result.exit, result.reason) == (7, MissionExit.ERROR, 'killed')
    assert (result.explored_s, result.sorties_total, result.wall_s) == (None, 0, 0.0)
    assert result.stands_out


@pytest.mark.parametrize(
    ('model', 'missed'),
    [('{model: lost, from_s: 0}', 0), ('{model: silent, from_s: 0, sorties: 2}', 0)],
)
def test_an_auv_that_cannot_be_heard_is_not_missed(model: str, missed: int) -> None:
    job = job_of(f'auvs.0.surfacing={model}', name='ecc2009')
    assert summary_of(job.scenario).missed_total > 0
    assert fly_mission(job).missed == missed


def test_a_silent_auv_is_excused_only_while_it_is_silent() -> None:
    scenario = job_of('auvs.0.surfacing={model: silent, from_s: 100, sorties: 2}').scenario
    window_s = (100.0, 100.0 + 2 * scenario.sortie.limit_s)
    assert campaign_mission._silences_s(scenario) == {scenario.auvs[0].name: window_s}
    lost = job_of('auvs.0.surfacing={model: lost, from_s: 100}').scenario
    assert campaign_mission._silences_s(lost) == {lost.auvs[0].name: (100.0, math.inf)}


def test_an_auv_that_should_have_been_heard_is_missed(monkeypatch: pytest.MonkeyPatch) -> None:
    # Its own radio would have to fail for that; take away the excuse instead.
    job = job_of('auvs.0.surfacing={model: lost, from_s: 0}', name='ecc2009')
    monkeypatch.setattr(campaign_mission, '_silences_s', lambda scenario: {})
    result = fly_mission(job)
    assert result.missed == summary_of(job.scenario).missed_total
    assert result.stands_out
    assert result.auvs_lost == 1
