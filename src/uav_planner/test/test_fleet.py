"""What the UAV knows of its AUVs: their hand-overs, and what the map counts for them."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import hypothesis.strategies as st
import msgspec
import numpy as np
import pytest
from hypothesis import settings
from hypothesis.stateful import RuleBasedStateMachine, precondition, rule
from uav_bench import PATHS, SETUP, OneStep, auv_order, order, report, said, taken

from msgs_json.geometry import Cell, GridSpec, Point
from msgs_json.messages import (
    Acknowledged,
    Leg,
    LegOutcome,
    PathAssignment,
    SurfacingReport,
)
from uav_planner.fleet import Fleet
from uav_planner.hand_over import HAND_OVER_TICKS
from uav_planner.mission_order import mission_spec
from uav_planner.planning import PlanRequest, PlanResult, PlanStatus, Prospect


def fleet_of(planner: OneStep, **changes: object) -> Fleet:
    mission = order(**changes)
    return Fleet(mission, mission_spec(mission, SETUP), planner)


def met(fleet: Fleet, heard: SurfacingReport, now_s: float = 0.0) -> Leg | None:
    """Let an AUV be met and told what comes next; return the leg that it is given."""
    fleet.heard(heard)
    assert fleet.problem_with(heard) is None
    fleet.meet(heard, (), heard.position, now_s)
    fleet.answer(heard.auv, now_s)
    return fleet.next_leg(heard.auv)


def test_those_who_survey_are_neither_lost_nor_recovered() -> None:
    fleet = fleet_of(OneStep(), lost_after_sorties=2)
    assert [leg.auv for leg in fleet.survey_legs()] == ['auv_1', 'auv_2']
    assert not fleet.searched_in_vain('auv_1')
    assert ([leg.auv for leg in fleet.survey_legs()], fleet.lost) == (['auv_1', 'auv_2'], ())
    assert fleet.searched_in_vain('auv_1')
    assert ([leg.auv for leg in fleet.survey_legs()], fleet.lost) == (['auv_2'], ('auv_1',))
    assert met(fleet, report('auv_2', outcome=LegOutcome.ABORTED)) is None
    assert (fleet.survey_legs(), fleet.lost) == ((), ('auv_1',))


def test_only_legs_of_those_still_to_be_met_end() -> None:
    fleet = fleet_of(OneStep())
    assert prospects(fleet, ('auv_2',)) == [Prospect.STAYS, Prospect.ENDS]
    fleet.searched_in_vain('auv_2')
    assert prospects(fleet, ('auv_2',)) == [Prospect.STAYS, Prospect.ASTRAY]
    met(fleet, report('auv_1'))  # and does not answer
    assert prospects(fleet, ('auv_1', 'auv_2')) == [Prospect.STAYS, Prospect.ASTRAY]
    fleet.acknowledged('auv_1', taken(Acknowledged.PATH_ASSIGNMENT, 1))
    assert prospects(fleet, ('auv_1', 'auv_2')) == [Prospect.ENDS, Prospect.ASTRAY]


def prospects(fleet: Fleet, to_meet: tuple[str, ...]) -> list[Prospect]:
    return [leg.prospect for leg in fleet.survey_legs(to_meet)]


def test_legs_are_told_with_the_waypoints_from_which_they_are_searched() -> None:
    fleet = fleet_of(OneStep())
    assert [leg.search for leg in fleet.survey_legs()] == [(), ()]
    plan = fleet.plan_sortie(frozenset(), 0.0)
    assert [point for leg in fleet.survey_legs() for point in leg.search] == [
        waypoint.point for waypoint in plan.route
    ]


def test_one_that_is_to_be_recovered_surveys_until_it_is_told() -> None:
    fleet = fleet_of(OneStep())
    heard = report('auv_1', outcome=LegOutcome.ABORTED)
    assert fleet.meet(heard, (), heard.position, 0.0).plan is None
    assert fleet.next_leg('auv_1') is not None
    assert [leg.auv for leg in fleet.survey_legs()] == ['auv_1', 'auv_2']
    assert len(fleet.answer('auv_1', 1.0)) == 1
    assert fleet.next_leg('auv_1') is None
    assert [leg.auv for leg in fleet.survey_legs()] == ['auv_2']


@pytest.mark.parametrize(
    ('handover_s', 'data_s'), [(0.0, HAND_OVER_TICKS * SETUP.tick_s / 2), (20.0, 10.0)]
)
def test_half_of_the_time_of_a_hand_over_is_for_data(handover_s: float, data_s: float) -> None:
    fleet = fleet_of(OneStep(), handover_s=handover_s)
    assert not fleet.is_time_for_data('auv_1', 3.0)  # before it is met
    met(fleet, report('auv_1'), now_s=3.0)
    assert not fleet.is_time_for_data('auv_2', 3.0)
    assert fleet.is_time_for_data('auv_1', 2.9 + data_s)
    assert not fleet.is_time_for_data('auv_1', 3.0 + data_s)
    fleet.acknowledged('auv_1', taken(Acknowledged.PATH_ASSIGNMENT, 1))
    assert not fleet.is_time_for_data('auv_1', 3.0)


@pytest.mark.parametrize(
    ('handover_s', 'patience_s'), [(0.0, HAND_OVER_TICKS * SETUP.tick_s), (20.0, 20.0)]
)
def test_an_answer_is_awaited_for_a_while(handover_s: float, patience_s: float) -> None:
    fleet = fleet_of(OneStep(), handover_s=handover_s)
    assert not fleet.is_awaiting(('auv_1',), 3.0)
    met(fleet, report('auv_1'), now_s=3.0)
    assert not fleet.is_awaiting(('auv_2',), 3.0)
    assert fleet.is_awaiting(('auv_1',), 2.5 + patience_s)
    assert not fleet.is_awaiting(('auv_1',), 3.0 + patience_s)
    fleet.acknowledged('auv_1', taken(Acknowledged.PATH_ASSIGNMENT, 1))
    assert not fleet.is_awaiting(('auv_1',), 3.0)


def test_nothing_is_said_again_to_one_that_has_answered() -> None:
    fleet = fleet_of(OneStep())
    heard = report('auv_1')
    assert fleet.answer('auv_1', 0.0) == []  # nor before it was met
    met(fleet, heard)
    (assignment,) = said(fleet.answer('auv_1', 7.0), 'auv_1')
    assert assignment == PathAssignment(auv='auv_1', leg=fleet.next_leg('auv_1'))  # type: ignore[arg-type]
    fleet.acknowledged('auv_1', taken(Acknowledged.PATH_ASSIGNMENT, 1))
    assert fleet.answer('auv_1', 8.0) == []


@pytest.mark.parametrize('cell', [(1, 0), (50, 50)])
def test_one_that_has_not_answered_cannot_be_elsewhere(cell: Cell) -> None:
    fleet = fleet_of(OneStep())
    met(fleet, report('auv_1'))
    elsewhere = report('auv_1', cell=cell)
    problem = f'leg 0 ended at cell [2, 0], cell is now {list(cell)}'
    assert fleet.problem_with(elsewhere) == problem


# A leg from (1, 0) to (3, 0) of which two of three cells were entered: it lies off (2, 0).
@pytest.mark.parametrize(
    ('east_m', 'north_m', 'behind'),
    [
        (25.0, 5.0, None),
        (28.0, 5.0, (3, 0)),
        (22.0, 5.0, (1, 0)),
        (25.0, 5.001, None),  # beside its track: no other cell was promised to be searched
        (27.0, 8.0, (3, 0)),
    ],
)
def test_an_auv_lies_toward_a_cell_of_its_leg(
    east_m: float, north_m: float, behind: Cell | None
) -> None:
    planner = OneStep()
    fleet = fleet_of(planner, path_cells=2, auvs=(auv_order('auv_1', ((1, 0), (2, 0), (3, 0))),))
    position = Point(east_m=east_m, north_m=north_m)
    early = report('auv_1', outcome=LegOutcome.EARLY, position=position)
    met(fleet, early)
    assert planner.requests[0].behind == behind
    assert [leg.behind for leg in fleet.survey_legs()] == [behind]
    # Not heard of since, it gets another path from there, wherever its position says.
    fleet.searched_in_vain('auv_1')
    met(fleet, msgspec.structs.replace(early, position=Point(east_m=25.0, north_m=9.0)))
    assert planner.requests[1].behind == behind


def test_before_its_first_cell_it_lies_toward_where_it_came_from() -> None:
    planner = OneStep()
    fleet = fleet_of(planner)
    met(fleet, report('auv_1', position=Point(east_m=22.0, north_m=5.0)))  # short of (2, 0)
    fleet.acknowledged('auv_1', taken(Acknowledged.PATH_ASSIGNMENT, 1))
    back = Point(east_m=24.0, north_m=5.0)
    met(fleet, report('auv_1', 1, moves_done=0, cell=(2, 0), position=back, samples=()))
    assert [request.behind for request in planner.requests] == [(1, 0), (1, 0)]


# --- what the map counts -------------------------------------------------------------------------

RING: tuple[Cell, ...] = ((0, 0), (1, 0), (2, 0), (2, 1), (1, 1), (0, 1))
"""All paths run round it, so they cross; the region is larger, and never explored."""


def round_the_ring(cell: Cell, moves: int) -> tuple[Cell, ...]:
    first = RING.index(cell)
    return tuple(RING[(first + index) % len(RING)] for index in range(moves + 1))


class RoundTheRing(OneStep):
    """Gives out paths of one to eight moves: a long one enters cells twice."""

    def plan_path(self, request: PlanRequest) -> PlanResult:
        self.requests.append(replace(request, values=request.values.copy()))
        path = round_the_ring(request.cell, 1 + 3 * len(self.requests) % 8)
        return PlanResult(status=PlanStatus.OK, path=path, slack_s=0.0, sortie_time_s=0.0)


class Survey(RuleBasedStateMachine):
    """
    AUVs that come up anywhere, or not, and of whose answers many are lost.

    Whenever a path is chosen, the map must count the starts, every cell reported visited, and of
    each AUV that is neither given up nor in distress all of the path that it was told last.
    """

    def __init__(self) -> None:
        super().__init__()
        self.planner = RoundTheRing()
        paths = {'auv_1': RING[:3], 'auv_2': RING[2:6]}
        self.fleet = fleet_of(
            self.planner,
            region=GridSpec(cols=4, rows=2, cell_m=10.0),
            path_cells=8,
            lost_after_sorties=2,
            auvs=tuple(auv_order(name, path) for name, path in paths.items()),
        )
        self.visited = Counter(path[0] for path in paths.values())
        self.counted = {name: path[1:] for name, path in paths.items()}
        """What the map counts for each AUV, not yet reported."""
        self.unanswered: dict[str, SurfacingReport] = {}
        self.in_vain = dict.fromkeys(paths, 0)

    def expected(self) -> np.ndarray:
        """Return the values of the map."""
        values = np.ones((2, 4))
        for col, row in [*self.visited.elements(), *sum(self.counted.values(), ())]:
            values[row, col] /= 2
        return values

    @rule(auv=st.sampled_from(sorted(PATHS)), moves=st.integers(0, 8), is_aborted=st.booleans())
    def comes_up_after_its_last_leg(self, auv: str, moves: int, *, is_aborted: bool) -> None:
        leg = self.fleet.next_leg(auv)
        if leg is None:
            return
        moves = min(moves, len(leg.path) - 1)
        heard = msgspec.structs.replace(
            report(auv),
            leg_id=leg.leg_id,
            moves_done=moves,
            cell=leg.path[moves],
            outcome=LegOutcome.ABORTED if is_aborted and moves == 1 else LegOutcome.EARLY,
            samples=(),
        )
        self.visited.update(leg.path[1 : moves + 1])
        self.counted[auv] = ()
        self.meet(heard)

    @precondition(lambda self: self.unanswered)
    @rule(data=st.data(), is_aborted=st.booleans(), is_met=st.booleans())
    def is_heard_again(self, data: st.DataObject, *, is_aborted: bool, is_met: bool) -> None:
        auv = data.draw(st.sampled_from(sorted(self.unanswered)))
        heard = self.unanswered[auv]
        if is_aborted:
            heard = msgspec.structs.replace(heard, outcome=LegOutcome.ABORTED)
            self.counted[auv] = ()
        self.fleet.heard(heard)
        if is_met and self.fleet.next_leg(auv) is not None:
            self.meet(heard)

    @precondition(lambda self: self.unanswered)
    @rule(data=st.data())
    def answers(self, data: st.DataObject) -> None:
        auv = data.draw(st.sampled_from(sorted(self.unanswered)))
        leg_id = self.unanswered.pop(auv).leg_id
        self.fleet.acknowledged(auv, taken(Acknowledged.PATH_ASSIGNMENT, leg_id + 1))
        self.fleet.acknowledged(auv, taken(Acknowledged.RECOVERY_ORDER, leg_id))

    @rule(data=st.data())
    def is_searched_in_vain(self, data: st.DataObject) -> None:
        searched = [leg.auv for leg in self.fleet.survey_legs()]
        if not searched:
            return
        auv = data.draw(st.sampled_from(searched))
        self.in_vain[auv] += 1
        assert self.fleet.searched_in_vain(auv) == (self.in_vain[auv] == 2)
        if self.in_vain[auv] == 2:
            self.counted[auv] = ()

    def meet(self, heard: SurfacingReport) -> None:
        auv, requests = heard.auv, len(self.planner.requests)
        is_astray = self.in_vain[auv] > 0
        if is_astray:
            self.counted[auv] = ()  # whatever it was told is thought over
        self.in_vain[auv] = 0
        expected = self.expected()
        leg = met(self.fleet, heard)
        self.unanswered[auv] = heard
        assert auv not in self.fleet.lost
        is_planned = len(self.planner.requests) > requests
        assert is_planned or not is_astray or heard.outcome is LegOutcome.ABORTED
        if is_planned:
            np.testing.assert_array_equal(self.planner.requests[-1].values, expected)
        self.counted[auv] = leg.path[1:] if leg is not None else ()


Survey.TestCase.settings = settings(max_examples=100, stateful_step_count=30)
TestSurvey = Survey.TestCase
