"""Faults are drawn before the mission, from its seed: so many, of these nodes, in that time."""

from __future__ import annotations

import msgspec
import pytest

from c3_station.fault_schedule import FullDisk, Moment, fault_schedule
from c3_station.lower_bound import lower_bound_s
from c3_station.scenario import Faults, Scenario
from c3_station.scenario_changes import read_change
from c3_station.scenario_files import ScenarioError, load_scenario, with_choices

AGENTS = ('auv_1', 'auv_2', 'auv_3', 'uav', 'c3')
ALL = Faults(
    kills=20, hangs=5, forged=1000, disk_full_s=40.0, clock_jump_s=99.0, off_by_one='auv_2'
)


def scenario(faults: Faults, seed: int = 4) -> Scenario:
    return msgspec.structs.replace(load_scenario('ecc2009'), faults=faults, seed=seed)


def test_without_faults_nobody_is_struck() -> None:
    assert fault_schedule(scenario(Faults())) == {}


def test_the_same_seed_draws_the_same_faults_and_another_one_others() -> None:
    assert fault_schedule(scenario(ALL)) == fault_schedule(scenario(ALL))
    assert fault_schedule(scenario(ALL)) != fault_schedule(scenario(ALL, seed=5))


def test_more_of_one_kind_does_not_change_the_others() -> None:
    few = fault_schedule(scenario(Faults(kills=5, clock_jump_s=9.0)))
    many = fault_schedule(scenario(Faults(kills=50, clock_jump_s=9.0, forged=10)))
    for name in AGENTS:
        assert many[name].clock_jump == few[name].clock_jump
        assert few[name].kills[0] in many[name].kills


def test_kills_and_hangs_go_round_and_forgeries_go_to_everybody() -> None:
    schedule = fault_schedule(scenario(ALL))
    assert set(schedule) == set(AGENTS)
    for faults in schedule.values():
        assert len(faults.kills) == 5
        assert sum(kill.hangs for kill in faults.kills) == 1
        assert len(faults.forged_s) > 100
        assert list(faults.forged_s) == sorted(faults.forged_s)
    assert sum(len(faults.forged_s) for faults in schedule.values()) == 1000


def test_only_those_named_are_struck() -> None:
    schedule = fault_schedule(
        scenario(Faults(kills=3, forged=9, disk_full_s=1.0, clock_jump_s=1.0, nodes=('uav', 'c3')))
    )
    assert [len(schedule[name].kills) for name in ('uav', 'c3')] == [2, 1]
    assert set(schedule) == {'uav', 'c3'}


def test_only_one_auv_misreports() -> None:
    schedule = fault_schedule(scenario(ALL))
    assert {n for n, faults in schedule.items() if faults.off_by_one_s is not None} == {'auv_2'}


@pytest.mark.parametrize('until_s', [None, 30.0])
def test_faults_begin_in_the_time_given_or_while_no_mission_can_be_over(
    until_s: float | None,
) -> None:
    flown = scenario(msgspec.structs.replace(ALL, until_s=until_s, disk_full_s=0.0))
    latest_s = lower_bound_s(flown) if until_s is None else until_s
    times_s = [
        time_s
        for faults in fault_schedule(flown).values()
        for time_s in (*(kill.at_s for kill in faults.kills), *faults.forged_s)
    ]
    assert 0.0 <= min(times_s) < 0.2 * latest_s
    assert 0.8 * latest_s < max(times_s) <= latest_s


def test_every_moment_of_death_is_drawn_with_and_without_a_message() -> None:
    schedule = fault_schedule(scenario(Faults(kills=200)))
    drawn = {(k.moment, k.when_it_hears) for f in schedule.values() for k in f.kills}
    assert drawn == {(moment, hears) for moment in Moment for hears in (True, False)}


def test_nobody_is_killed_while_its_disk_is_full() -> None:
    schedule = fault_schedule(scenario(Faults(kills=300, disk_full_s=100.0)))
    moved = 0
    for faults in schedule.values():
        disk = faults.full_disk
        assert disk is not None
        assert not any(disk.holds_at(kill.at_s) for kill in faults.kills)
        moved += sum(kill.at_s == disk.until_s + 1.0 for kill in faults.kills)
    assert moved > 0


def test_a_full_disk_is_free_again_at_its_end() -> None:
    disk = FullDisk(from_s=3.0, until_s=5.0)
    assert [disk.holds_at(time_s) for time_s in (2.0, 3.0, 4.0, 5.0)] == [False, True, True, False]


@pytest.mark.parametrize(
    ('change', 'problem'),
    [
        ('faults.nodes=[auv_1, auv_7]', "faults.nodes[1] is 'auv_7'; allowed: c3, uav, auv_1"),
        ('faults.off_by_one=uav', "faults.off_by_one is 'uav'; allowed: auv_1"),
        ('faults.kills=-1', 'faults.kills is -1'),
    ],
)
def test_faults_that_cannot_be_are_refused_by_name(change: str, problem: str) -> None:
    with pytest.raises(ScenarioError) as refused:
        with_choices(load_scenario('ecc2009'), changes=[read_change(change)])
    assert problem in str(refused.value)
