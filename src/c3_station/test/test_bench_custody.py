"""What custody costs, memory of a long mission, and missions with a stranger: each in small."""

import msgspec
import pytest

from c3_station.bench_custody import custody_costs
from c3_station.bench_flood import fly_beside_stranger, fly_flooded
from c3_station.bench_week import watch_growth, week_scenario
from c3_station.scenario_files import (
    load_scenario,
    scenario_from_json,
    scenario_json,
    with_choices,
)
from c3_station.summary import course

MINIMAL = load_scenario('minimal')


def test_each_way_to_fly_is_compared_in_each_round() -> None:
    costs = custody_costs(MINIMAL, pairs=3)
    assert {way: len(ratios) for way, ratios in costs.items()} == {
        'both': 3,
        'custody': 3,
        'authentication': 3,
    }
    assert min(min(ratios) for ratios in costs.values()) > 0.0


def test_forged_messages_change_nothing_in_one_process() -> None:
    calm, flooded = fly_flooded(MINIMAL, 0), fly_flooded(MINIMAL, 300)
    assert (calm.said, calm.refused) == (0, 0)
    assert (flooded.said, flooded.refused) == (300, 300)
    assert flooded.summary.complete
    assert flooded.summary.refusals
    assert course(flooded.summary) == course(calm.summary)


def test_another_mission_is_told_apart() -> None:
    one = fly_flooded(MINIMAL, 0).summary
    other = fly_flooded(with_choices(MINIMAL, planner='lanes', seed=1), 0).summary
    assert course(one) != course(other)


def test_a_week_is_a_sound_scenario() -> None:
    scenario = week_scenario()
    assert scenario_from_json(scenario_json(scenario)) == scenario  # checked like a file
    assert scenario.max_mission_s / scenario.tick_s > 10_000


@pytest.mark.ros
def test_a_stranger_on_the_graph_is_heard_and_not_obeyed() -> None:
    flown, said = fly_beside_stranger(msgspec.structs.replace(MINIMAL, tick_s=0.1))
    assert said > 100
    assert flown.summary.complete
    assert flown.summary.samples_lost == 0
    assert flown.summary.sortie_limit_violations == 0
    assert {refusal.reason for refusal in flown.summary.refusals} == {'auth'}
    assert flown.summary.radio is not None
    assert {'auth', 'replay'} <= flown.summary.radio.blocked.keys()


@pytest.mark.ros
def test_every_node_is_looked_at_every_day() -> None:
    growth = watch_growth(MINIMAL, day_s=20.0)
    nodes = {'recorder', 'world', 'c3', 'uav', 'auv_1'}
    assert len(growth.memory_bytes) == len(growth.stored_bytes) > 1
    for memory, stored in zip(growth.memory_bytes, growth.stored_bytes, strict=True):
        assert memory.keys() == nodes
        assert min(memory.values()) > 10 * 2**20
        assert {'c3.sqlite', 'uav.sqlite', 'auv_1.sqlite'} <= stored.keys()
