"""What planner adaptive foresees is what is flown, and on tiny regions it is hard to beat."""

from __future__ import annotations

import math
import statistics
from dataclasses import replace
from typing import TYPE_CHECKING

import msgspec
import pytest
from lower_bound_oracle import earliest_ticks
from test_lower_bound import tiny

from c3_station.bench_families import FAMILIES, Family, family_scenario
from c3_station.in_process import fly
from c3_station.scenario_files import load_scenario
from c3_station.scenario_generator import USUAL_MODELS, Span, generate_scenario
from c3_station.summary import Summarizer, Summary
from uav_planner.planners.adaptive import WORK, AdaptivePlanner, Effort, VisitingOrder
from uav_planner.tours import TourProblem, joined

if TYPE_CHECKING:
    from collections.abc import Iterator

    from c3_station.scenario import Scenario
    from uav_planner.mission_rollout import Outcome
    from uav_planner.planning import LookAhead, PlanRequest, PlanResult, SortieRequest


def flown(scenario: Scenario, planner: AdaptivePlanner) -> Summary:
    summarizer = Summarizer()
    fly(scenario, summarizer.frame, planner)
    return summarizer.summary()


class Foreseeing(AdaptivePlanner):
    """Keeps to the tours planned before take-off and notes what they should come to."""

    def __init__(self) -> None:
        super().__init__(effort=Effort.MINIMAL)
        self._work = replace(WORK[Effort.MINIMAL], meetings_in_flight=0)
        self.foreseen: Outcome | None = None

    def look_ahead(self, request: SortieRequest) -> Iterator[LookAhead]:
        assert request.values is not None
        problem = TourProblem(
            mission=request.mission,
            legs=request.legs,
            values=request.values.copy(),
            now_s=request.now_s,
            position=request.mission.c3,
        )
        for ahead in super().look_ahead(request):
            numbers = [[problem.number(cell) for cell in tour] for tour in ahead.tours.values()]
            self.foreseen = problem.foreseen(joined(numbers))
            yield ahead


@pytest.mark.parametrize(
    'name',
    [
        'minimal',
        'ecc2009',
        pytest.param('harbour', marks=pytest.mark.slow),
        # AUVs are met from C3 there.
        pytest.param('cove_tight', marks=pytest.mark.slow),
        pytest.param('fleet_8', marks=pytest.mark.slow),
    ],
)
def test_a_mission_on_time_is_flown_as_foreseen(name: str) -> None:
    planner = Foreseeing()
    families = {family.name: family for family in FAMILIES}
    is_family = name in families
    scenario = family_scenario(families[name], 1, 'adaptive') if is_family else load_scenario(name)
    summary = flown(scenario, planner)
    assert planner.foreseen is not None
    assert summary.explored_s == pytest.approx(planner.foreseen.explored_ticks)  # ticks of 1 s
    assert summary.sortie_limit_violations == 0


def test_the_reference_mission_is_explored_almost_as_fast_as_physics_allows() -> None:
    summary = flown(load_scenario('ecc2009'), AdaptivePlanner(effort=Effort.FAST))
    assert summary.explored_s is not None
    assert summary.explored_s <= 352.0  # as long as it took when this was written, and a little
    assert summary.revisits <= 3
    assert summary.sortie_limit_violations == 0


@pytest.mark.slow
def test_reference_mission_with_normal_effort() -> None:
    scenario = load_scenario('ecc2009')
    summary = flown(scenario, AdaptivePlanner())
    assert summary.explored_s is not None
    assert summary.explored_s <= 350.0
    assert summary.revisits <= 3
    assert summary.sortie_limit_violations == 0
    first_s: dict[str, float] = {}
    for sortie in summary.sorties:
        for meeting in sortie.meetings:
            first_s.setdefault(meeting.auv, meeting.time_s)
    surfaced_s = {auv.name: scenario.region.cell_m / auv.speed_mps for auv in scenario.auvs}
    before_s = sum(first_s[auv] - surfaced_s[auv] for auv in surfaced_s)
    assert sum(summary.neglect_s.values()) - before_s <= 0.02 * summary.explored_s


def test_the_visiting_order_can_be_planned() -> None:
    base = load_scenario('ecc2009')
    first, second, third = base.auvs
    # To the farthest one first: that keeps the others waiting.
    scenario = msgspec.structs.replace(base, auvs=(second, first, third))
    fixed, planned = (
        flown(scenario, AdaptivePlanner(effort=Effort.MINIMAL, visiting_order=order))
        for order in (VisitingOrder.FIXED, VisitingOrder.PLANNED)
    )
    assert met_first(planned) != met_first(fixed)
    assert planned.explored_s is not None
    assert fixed.explored_s is not None
    assert planned.explored_s < fixed.explored_s


class NotingOrders(AdaptivePlanner):
    """Chooses the visiting order, and notes which one it is at each meeting."""

    def __init__(self) -> None:
        super().__init__(effort=Effort.MINIMAL, visiting_order=VisitingOrder.PLANNED)
        self.orders: list[tuple[str, ...]] = []

    def plan_path(self, request: PlanRequest) -> PlanResult:
        self.orders.append(tuple(leg.auv for leg in request.legs))
        return super().plan_path(request)


@pytest.mark.slow
@pytest.mark.parametrize('auvs', [2, 3, 7])
def test_missions_in_a_planned_visiting_order_keep_to_it_and_to_the_limit(auvs: int) -> None:
    asked = {'auvs': Span(least=auvs, most=auvs), 'cols': Span(least=4, most=8)}
    changed = 0
    for seed in range(4):
        planner = NotingOrders()
        scenario = generate_scenario(seed, asked, USUAL_MODELS)
        summary = flown(scenario, planner)
        assert summary.complete
        assert summary.sortie_limit_violations == 0
        assert summary.missed_total == 0
        order = planner.orders[0]
        assert all(
            later == tuple(auv for auv in order if auv in later) for later in planner.orders
        )
        changed += order != tuple(auv.name for auv in scenario.auvs)
    assert changed > 0


def met_first(summary: Summary) -> list[str]:
    """Return the AUVs in the order in which they were first met."""
    met = (meeting.auv for sortie in summary.sorties for meeting in sortie.meetings)
    return list(dict.fromkeys(met))


def test_same_request_same_answer() -> None:
    scenario = family_scenario(family('paper_early_30'), 1, 'adaptive')
    summaries = [flown(scenario, AdaptivePlanner(effort=Effort.MINIMAL)) for _ in range(2)]
    assert summaries[0].sorties == summaries[1].sorties


def family(name: str) -> Family:
    return next(each for each in FAMILIES if each.name == name)


def over_optimum(seeds: range, auvs: int) -> list[float]:
    """Return by how much tiny missions take longer than the best that any paths can do."""
    ratios = []
    for seed in seeds:
        scenario = tiny(seed, auvs)
        wide = msgspec.structs.replace(scenario.sortie, limit_s=1000.0)
        scenario = msgspec.structs.replace(scenario, sortie=wide)
        summary = flown(scenario, AdaptivePlanner(effort=Effort.MINIMAL))
        assert summary.explored_s is not None
        ratios.append(summary.explored_s / (earliest_ticks(scenario) * scenario.tick_s))
    assert min(ratios) >= 1.0 - 1e-9  # else the optimum is none
    return ratios


@pytest.mark.parametrize(('auvs', 'at_most'), [(1, 1.05), (2, 1.15)])
def test_few_tiny_missions_are_longer_than_the_optimum(auvs: int, at_most: float) -> None:
    assert statistics.mean(over_optimum(range(12), auvs)) <= at_most


@pytest.mark.slow
@pytest.mark.parametrize(('auvs', 'share', 'at_most'), [(1, 0.8, 1.02), (2, 0.75, 1.08)])
def test_most_tiny_missions_take_no_longer_than_the_optimum(
    auvs: int, share: float, at_most: float
) -> None:
    ratios = over_optimum(range(150), auvs)
    assert statistics.mean(math.isclose(ratio, 1.0) for ratio in ratios) >= share
    assert statistics.mean(ratios) <= at_most
