"""A UAV that goes on from its store, whenever its process died, says and does the same."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from random import Random
from typing import TYPE_CHECKING

import hypothesis.strategies as st
import msgspec
import pytest
from hypothesis import given, settings
from uav_bench import (
    C3,
    Bench,
    NotHeard,
    OneStep,
    auv_order,
    brought,
    events,
    of,
    order,
    report,
    vehicle,
)
from uav_sea import Sea, missions

from msgs_json.agent import Log, Output, Transmit
from msgs_json.drivers import VehicleUnavailableError
from msgs_json.geometry import GridSpec
from msgs_json.messages import PlanningAhead, SampleBatch, SortieDeparted
from msgs_json.store import MemoryStore
from uav_planner.planners import make_planner
from uav_planner.planners.ecc2009 import Ecc2009Planner
from uav_planner.planners.robust import RobustPlanner

if TYPE_CHECKING:
    from msgs_json.messages import MissionOrder
    from uav_planner.planning import Planner

SECONDS = 120


def flown(
    planner: Planner, mission: MissionOrder, seed: int, loss: float, crashes: frozenset[int]
) -> Bench:
    """Fly for a while and return the bench, with all that came of every input."""
    bench = Bench(planner, crashes=crashes)
    Sea(bench, mission, Random(seed), loss=loss).sail(SECONDS)
    return bench


def words(bench: Bench) -> list[Output]:
    """Return all that was said, shown and logged, but for what a new process may say again."""
    outputs = [each for output in bench.outputs for each in output]
    return [each for each in outputs if not is_said_again(each)]


def is_said_again(output: Output) -> bool:
    match output:
        case Transmit(body=SampleBatch()) | Log(event=PlanningAhead()):
            return True
        case _:
            return False


PLANNERS: dict[str, Callable[[], Planner]] = {
    'ecc2009': Ecc2009Planner,
    'robust': RobustPlanner,
    'adaptive': lambda: make_planner('adaptive', effort='minimal'),
}


@pytest.mark.parametrize('name', PLANNERS)
@settings(max_examples=15)
@given(
    mission=missions(),
    seed=st.integers(0, 2**32),
    loss=st.sampled_from([0.0, 0.0, 0.3]),
    data=st.data(),
)
def test_crashes_between_any_two_inputs_change_nothing(
    name: str, mission: MissionOrder, seed: int, loss: float, data: st.DataObject
) -> None:
    if name == 'ecc2009':  # what it takes at worst is its own affair
        mission = msgspec.structs.replace(mission, sortie_limit_s=100.0)
    undisturbed = flown(PLANNERS[name](), mission, seed, loss, frozenset())
    inputs = len(undisturbed.outputs)
    crashes = data.draw(st.just(frozenset(range(inputs))) | st.frozensets(st.integers(0, inputs)))
    crashed = flown(PLANNERS[name](), mission, seed, loss, crashes)
    assert words(crashed) == words(undisturbed)
    assert brought(crashed) == brought(undisturbed)
    assert crashed.agent.finished == undisturbed.agent.finished


def test_what_was_decided_as_the_vehicle_failed_is_told_with_the_next_commit() -> None:
    """Else a process that dies before its vehicle is heard again would have told nobody."""
    undisturbed = Bench().ordered()
    undisturbed.until(SortieDeparted)
    bench = Bench(driver=NotHeard(vehicle(), undisturbed.now_s)).ordered()
    while bench.now_s < undisturbed.now_s:
        with contextlib.suppress(VehicleUnavailableError):
            bench.tick()
    bench.hear('c3', order())  # whatever it hears
    bench.restart()
    for _ in range(3):
        with contextlib.suppress(VehicleUnavailableError):
            bench.tick()
    told = [event for output in bench.outputs for event in events(output)]
    assert len(of(SortieDeparted, told)) == 1
    assert bench.here != C3


class Weighed(MemoryStore):
    """Counts the bytes of its commits."""

    def __init__(self) -> None:
        super().__init__()
        self.commits: list[int] = []

    def _write(self, changes: Mapping[tuple[str, str], bytes | None]) -> None:
        super()._write(changes)
        self.commits.append(
            sum(len(kind) + len(key) + len(data or b'') for (kind, key), data in changes.items())
        )


def commits_of_a_hand_over(**changes: object) -> tuple[int, list[int]]:
    """Return the bytes of the commit of a meeting, and of the ticks after it."""
    store = Weighed()
    bench = Bench(OneStep(guarantees_limit=True), store=store).ordered(**changes)
    bench.until(SortieDeparted)
    store.commits.clear()
    bench.hear('auv_1', report('auv_1'))
    (meeting,) = store.commits
    store.commits.clear()
    for _ in range(3):
        bench.tick()
        bench.hear('auv_1', report('auv_1'))  # it has not heard its path
    return meeting, store.commits


def test_a_commit_costs_what_has_changed_however_large_the_mission_is() -> None:
    meeting, ticks = commits_of_a_hand_over()
    assert meeting < 1500
    assert max(ticks) < 500
    wide = GridSpec(cols=200, rows=100, cell_m=10.0)
    more = [auv_order(f'auv_{number}', ((3, 90), (4, 90))) for number in range(3, 30)]
    others = order().auvs + tuple(more)
    large_meeting, large_ticks = commits_of_a_hand_over(
        region=wide, auvs=others, sortie_limit_s=1000.0
    )
    assert large_meeting - meeting < 2 * 200 + 100  # a row of the map
    assert large_ticks == ticks
