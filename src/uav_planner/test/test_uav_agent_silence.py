"""The UAV and AUVs that are not heard, lost, heard again, or in distress."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from uav_bench import (
    BOTH_KINDS,
    C3,
    PATHS,
    REGION,
    Bench,
    OneStep,
    auv_order,
    events,
    of,
    order,
    path_handed_over,
    said,
    stamps_of,
    vehicle,
)
from uav_sea import Sea

from msgs_json.geometry import GridSpec, Point
from msgs_json.messages import (
    GivenUp,
    HeardAgain,
    LegOutcome,
    Met,
    Missed,
    RecoveryOrder,
    RecoveryReason,
    SampleReceipt,
    SampleSpan,
    SearchBrokenOff,
    SortieDeparted,
)
from msgs_json.topics import ROUTE
from uav_planner.planners.ecc2009 import Ecc2009Planner
from uav_planner.planners.robust import RobustPlanner
from uav_planner.planning import Planner, Prospect, SortiePlan, SortieRequest

if TYPE_CHECKING:
    from msgs_json.messages import MissionOrder

# --- given up ------------------------------------------------------------------------------------


@BOTH_KINDS
def test_an_auv_searched_in_vain_so_often_is_given_up(guarantees_limit: bool) -> None:
    bench = Bench(OneStep(guarantees_limit=guarantees_limit)).ordered(lost_after_sorties=2)
    output, first = bench.home(auv_2=0)
    assert of(Missed, events(output)) == [Missed(sortie=1, auv='auv_1')]
    assert of(GivenUp, events(output)) == []
    assert (first.missed, first.not_reached, first.lost) == (('auv_1',), (), ())
    output, second = bench.home(auv_2=1)
    assert of(GivenUp, events(output)) == [GivenUp(sortie=2, auv='auv_1')]
    assert (second.missed, second.not_reached, second.lost) == (('auv_1',), (), ('auv_1',))
    output, third = bench.home(auv_2=2)
    assert of(SortieDeparted, events(output))[0].order == ('auv_2',)  # type: ignore[attr-defined]
    assert (third.missed, third.not_reached, third.lost) == ((), (), ('auv_1',))
    assert [meeting.auv for meeting in third.meetings] == ['auv_2']


@BOTH_KINDS
def test_the_cells_of_one_given_up_are_worth_going_to_again(guarantees_limit: bool) -> None:
    planner = OneStep(guarantees_limit=guarantees_limit)
    bench = Bench(planner).ordered(lost_after_sorties=1)
    bench.home(auv_2=0)
    bench.home(auv_2=1)
    assert planner.requests[0].values[0, 2] == (0.5 if guarantees_limit else 1.0)
    assert planner.requests[1].values[0, 2] == 1.0
    assert planner.requests[1].values[0, 1] == 0.5  # where it began: it was there
    assert [leg.auv for leg in planner.requests[1].legs] == ['auv_2']


def test_one_that_the_wind_never_lets_be_reached_is_given_up() -> None:
    """Else the mission would go on for ever: it is neither heard nor searched to the end."""
    far = (auv_order('auv_2', PATHS['auv_2']),)
    bench = Bench(RobustPlanner(), vehicle(speed_mps=2.0)).ordered(
        auvs=far, radio_range_m=10.0, sortie_limit_s=20.0, lost_after_sorties=2
    )
    output, first = bench.home()
    assert of(SearchBrokenOff, events(output)) == [
        SearchBrokenOff(sortie=1, not_reached=('auv_2',))
    ]
    assert (first.missed, first.not_reached, first.lost) == ((), ('auv_2',), ())
    output, second = bench.home()
    assert of(GivenUp, events(output)) == [GivenUp(sortie=2, auv='auv_2')]
    assert (second.missed, second.lost, second.next_sortie) == ((), ('auv_2',), None)
    assert bench.agent.finished


@BOTH_KINDS
def test_those_searched_in_vain_are_not_searched_again_at_once(guarantees_limit: bool) -> None:
    """They are within range of C3, where a sortie takes no time."""
    near = (auv_order('auv_1', ((0, 0), (1, 0))),)
    planner = RobustPlanner() if guarantees_limit else Ecc2009Planner()
    bench = Bench(planner).ordered(auvs=near, radio_range_m=30.0, sortie_limit_s=40.0)
    output = bench.until(GivenUp)
    first_s, *later_s = stamps_of(SortieDeparted, output)
    assert later_s == [first_s + 40.0, first_s + 80.0]


@BOTH_KINDS
def test_only_searches_in_vain_in_a_row_count(guarantees_limit: bool) -> None:
    bench = Bench(OneStep(guarantees_limit=guarantees_limit)).ordered(lost_after_sorties=2)
    bench.home(auv_2=0)
    bench.home(auv_1=0, auv_2=1)
    output, _ = bench.home(auv_2=2)
    assert of(GivenUp, events(output)) == []
    output, _ = bench.home(auv_2=3)
    assert of(GivenUp, events(output)) == [GivenUp(sortie=4, auv='auv_1')]


def test_one_that_only_missed_its_path_counts_as_met() -> None:
    bench = Bench().ordered(lost_after_sorties=2)
    bench.until(SortieDeparted)
    bench.meet('auv_1', acknowledges=False)
    bench.meet('auv_2')
    bench.home()
    bench.home(auv_2=1)  # auv_1 is searched in vain
    bench.until(SortieDeparted)
    bench.meet('auv_1', 0, acknowledges=False)  # it still has no path
    bench.meet('auv_2', 2)
    bench.home()
    output, _ = bench.home(auv_2=3)
    assert of(Missed, events(output)) == [Missed(sortie=4, auv='auv_1')]
    assert of(GivenUp, events(output)) == []


def test_when_all_are_lost_the_mission_ends() -> None:
    bench = Bench().ordered(lost_after_sorties=1)
    output, delivered = bench.home()
    assert of(GivenUp, events(output)) == [GivenUp(sortie=1, auv=auv) for auv in PATHS]
    assert (delivered.lost, delivered.next_sortie) == (('auv_1', 'auv_2'), None)
    assert bench.agent.finished
    assert len(bench.tick(50)) == 50  # at home, odometry only


@pytest.mark.parametrize('planner', [Ecc2009Planner(), RobustPlanner()])
def test_a_mission_ends_without_the_lost_when_the_others_have_done_all(planner: Planner) -> None:
    bench = Bench(planner)
    mission = order(radio_range_m=10.0, path_cells=3, lost_after_sorties=2)
    sea = Sea(bench, mission, silent={'auv_1'})
    output = sea.sail(2000)
    assert bench.agent.finished
    assert of(GivenUp, events(output)) == [GivenUp(sortie=2, auv='auv_1')]
    assert sea.reports[-1].lost == ('auv_1',)
    assert sea.divers['auv_2'].recovered is RecoveryReason.EXPLORED
    entered = {PATHS['auv_1'][0], *(sample.cell for sample in sea.divers['auv_2'].samples)}
    assert len(entered) == REGION.cells_total


# --- heard again ---------------------------------------------------------------------------------


@BOTH_KINDS
def test_a_lost_auv_that_is_heard_again_is_welcomed_back(guarantees_limit: bool) -> None:
    planner = OneStep(guarantees_limit=guarantees_limit)
    bench = Bench(planner).ordered(lost_after_sorties=1)
    bench.home(auv_2=0)
    bench.until(SortieDeparted)
    output = bench.meet('auv_1')  # whose turn it is not, not in this sortie
    assert path_handed_over(output, 'auv_1').path == ((2, 0), (3, 0))
    assert [type(event) for event in events(output)] == [HeardAgain, Met]
    assert events(output)[0] == HeardAgain(auv='auv_1')
    assert planner.requests[-1].values[0, 2] == 0.5
    assert planner.requests[-1].values[0, 3] == 1.0
    bench.meet('auv_2', 1)
    _, delivered = bench.home()
    assert [meeting.auv for meeting in delivered.meetings] == ['auv_1', 'auv_2']
    assert (delivered.missed, delivered.not_reached, delivered.lost) == ((), (), ())
    assert delivered.cargo[0] == SampleSpan(auv='auv_1', first=0, until=2)
    output, third = bench.home(auv_1=1, auv_2=2)
    assert of(HeardAgain, events(output)) == []
    assert [meeting.auv for meeting in third.meetings] == ['auv_1', 'auv_2']


@BOTH_KINDS
def test_one_given_up_in_this_very_sortie_is_welcomed_back_in_it(guarantees_limit: bool) -> None:
    bench = Bench(OneStep(guarantees_limit=guarantees_limit)).ordered(lost_after_sorties=1)
    bench.until(GivenUp)
    output = bench.meet('auv_1')
    assert of(HeardAgain, events(output)) == [HeardAgain(auv='auv_1')]
    bench.meet('auv_2')
    _, delivered = bench.home()
    assert (delivered.missed, delivered.lost) == ((), ())
    assert [meeting.auv for meeting in delivered.meetings] == ['auv_1', 'auv_2']


def one_row() -> MissionOrder:
    """Return a mission of four cells that is over when two AUVs have done their first legs."""
    return order(
        region=GridSpec(cols=4, rows=1, cell_m=10.0),
        lost_after_sorties=1,
        auvs=(auv_order('auv_1', ((0, 0), (1, 0))), auv_order('auv_2', ((3, 0), (2, 0)))),
    )


def test_a_lost_auv_heard_again_completes_the_map() -> None:
    bench = Bench()
    bench.tick()
    bench.hear('c3', one_row())
    bench.until(GivenUp)
    output = bench.meet('auv_2', cell=(2, 0), samples=())
    assert path_handed_over(output, 'auv_2').path == ((2, 0), (3, 0))
    bench.home()
    bench.until(SortieDeparted)
    output = bench.meet('auv_1', cell=(1, 0), samples=())
    assert said(output, 'auv_1')[1:] == [recovery(RecoveryReason.EXPLORED)]
    output = bench.meet('auv_2', 1, cell=(3, 0), samples=())
    assert said(output, 'auv_2')[1:] == [recovery(RecoveryReason.EXPLORED, 'auv_2', 1)]
    _, delivered = bench.home()
    assert (delivered.lost, delivered.next_sortie) == ((), None)
    assert bench.agent.finished


def recovery(reason: RecoveryReason, auv: str = 'auv_1', leg_id: int = 0) -> RecoveryOrder:
    return RecoveryOrder(auv=auv, leg_id=leg_id, reason=reason)


def lost_without_an_answer(planner: OneStep) -> Bench:
    """Return a bench in its third sortie; auv_1 got a path in the first, and was lost since."""
    bench = Bench(planner).ordered(lost_after_sorties=1)
    bench.until(SortieDeparted)
    bench.meet('auv_1', acknowledges=False)
    bench.meet('auv_2')
    bench.home()
    output, _ = bench.home(auv_2=1)
    assert of(GivenUp, events(output)) == [GivenUp(sortie=2, auv='auv_1')]
    bench.until(SortieDeparted)
    return bench


@BOTH_KINDS
def test_a_lost_auv_that_had_never_got_its_path_gets_another_one(guarantees_limit: bool) -> None:
    planner = OneStep(guarantees_limit=guarantees_limit)
    bench = lost_without_an_answer(planner)
    output = bench.meet('auv_1', 0)
    assert of(HeardAgain, events(output)) == [HeardAgain(auv='auv_1')]
    leg = path_handed_over(output, 'auv_1')
    assert (leg.leg_id, leg.path) == (1, ((2, 0), (3, 0)))
    assert planner.requests[-1].auv == 'auv_1'  # others were there since: planned anew
    assert planner.requests[-1].values[0, 3] == 1.0
    bench.meet('auv_2', 2)
    _, delivered = bench.home()
    assert [span.auv for span in delivered.cargo] == ['auv_2']  # its own are at C3 already
    _, fourth = bench.home(auv_1=1, auv_2=3)
    assert [meeting.ended_leg_id for meeting in fourth.meetings] == [1, 3]


@BOTH_KINDS
def test_a_lost_auv_whose_answer_was_lost_is_met_on_its_next_leg(guarantees_limit: bool) -> None:
    planner = OneStep(guarantees_limit=guarantees_limit)
    bench = lost_without_an_answer(planner)
    output = bench.meet('auv_1', 1)
    assert of(HeardAgain, events(output)) == [HeardAgain(auv='auv_1')]
    assert path_handed_over(output, 'auv_1').leg_id == 2
    assert planner.requests[-1].values[0, 3] == 0.5
    bench.meet('auv_2', 2)
    _, delivered = bench.home()
    assert delivered.cargo[0] == SampleSpan(auv='auv_1', first=2, until=3)


# --- in distress ---------------------------------------------------------------------------------

ABORTED = {'outcome': LegOutcome.ABORTED, 'moves_done': 0, 'cell': (1, 0), 'samples': ()}


@BOTH_KINDS
def test_one_that_asks_for_help_stays_up_and_its_cells_go_to_the_others(
    guarantees_limit: bool,
) -> None:
    planner = OneStep(guarantees_limit=guarantees_limit)
    bench = Bench(planner).ordered()
    bench.until(SortieDeparted)
    output = bench.meet('auv_1', **ABORTED)
    assert said(output, 'auv_1') == [
        SampleReceipt(held=(), at_c3=()),
        recovery(RecoveryReason.ABORTED),
    ]
    bench.meet('auv_2')
    (request,) = planner.requests
    assert request.values[0, 2] == 1.0
    assert [leg.auv for leg in request.legs] == ['auv_2']
    _, delivered = bench.home()
    met = delivered.meetings[0]
    assert (met.auv, met.outcome, met.next_leg) == ('auv_1', LegOutcome.ABORTED, None)
    output, delivered = bench.home(auv_2=1)
    assert (delivered.missed, delivered.not_reached, delivered.lost) == ((), (), ())


def test_one_in_distress_that_missed_its_order_is_told_again() -> None:
    bench = Bench().ordered()
    bench.until(SortieDeparted)
    bench.meet('auv_1', acknowledges=False, **ABORTED)
    for _ in range(20):
        bench.tick()
        output = bench.meet('auv_1', acknowledges=False, **ABORTED)
        assert said(output, 'auv_1')[1:] == [recovery(RecoveryReason.ABORTED)]
    bench.meet('auv_1', **ABORTED)
    assert bench.meet('auv_1', **ABORTED) == []


@pytest.mark.parametrize('sorties_later', [0, 1])
def test_one_that_asks_for_help_instead_of_taking_its_path_is_recovered(
    sorties_later: int,
) -> None:
    planner = OneStep()
    bench = Bench(planner).ordered()
    bench.until(SortieDeparted)
    path = path_handed_over(bench.meet('auv_1', acknowledges=False), 'auv_1').path
    assert path == ((2, 0), (3, 0))
    for _ in range(sorties_later):
        bench.home()
    bench.tick()
    output = bench.meet('auv_1', outcome=LegOutcome.ABORTED)
    assert said(output, 'auv_1')[1:] == [recovery(RecoveryReason.ABORTED)]
    bench.meet('auv_2')
    assert planner.requests[-1].values[0, 3] == 1.0
    _, delivered = bench.home()
    assert delivered.meetings[0].next_leg is None
    assert delivered.next_sortie is not None
    assert [each.auv for each in delivered.next_sortie.contacts] == ['auv_2']


def test_one_that_asks_for_help_out_of_turn_and_is_then_not_found_is_given_up() -> None:
    bench = Bench().ordered(lost_after_sorties=1)
    bench.until(SortieDeparted)
    bench.meet('auv_1')
    bench.meet('auv_2', acknowledges=False)
    bench.home()
    bench.until(SortieDeparted)
    assert bench.meet('auv_2', 0, outcome=LegOutcome.ABORTED) == []  # auv_1 comes first
    output, delivered = bench.home()
    assert of(GivenUp, events(output)) == [GivenUp(sortie=2, auv=auv) for auv in PATHS]
    assert delivered.lost == ('auv_1', 'auv_2')
    assert bench.agent.finished


def test_a_lost_auv_that_comes_up_in_distress_is_recovered() -> None:
    bench = lost_without_an_answer(OneStep())
    output = bench.meet('auv_1', 0, outcome=LegOutcome.ABORTED)
    assert of(HeardAgain, events(output)) == [HeardAgain(auv='auv_1')]
    assert said(output, 'auv_1')[1:] == [recovery(RecoveryReason.ABORTED)]
    bench.meet('auv_2', 2)
    _, delivered = bench.home()
    assert delivered.lost == ()


# --- what the planner is told of the others ------------------------------------------------------


class FirstOnly(OneStep):
    """Goes to the first AUV only, whether it surveys or has been overlooked."""

    def __init__(self, *, guarantees_limit: bool) -> None:
        super().__init__(guarantees_limit=guarantees_limit)
        self.sortie_requests: list[SortieRequest] = []

    def plan_sortie(self, request: SortieRequest) -> SortiePlan:
        self.sortie_requests.append(request)
        return super().plan_sortie(replace(request, legs=request.legs[:1]))


@BOTH_KINDS
def test_one_that_a_sortie_does_not_go_to_stays_and_is_overlooked(guarantees_limit: bool) -> None:
    planner = FirstOnly(guarantees_limit=guarantees_limit)
    bench = Bench(planner).ordered()
    output, delivered = bench.home(auv_1=0)
    assert of(Missed, events(output)) == []
    assert delivered.not_reached == ('auv_2',)
    (request,) = planner.requests
    assert [leg.prospect for leg in request.legs] == [Prospect.ENDS, Prospect.STAYS]
    first, second = planner.sortie_requests
    assert (first.overlooked, second.overlooked) == (frozenset(), {'auv_2'})
    assert [leg.prospect for leg in second.legs] == [Prospect.STAYS, Prospect.STAYS]
    _, delivered = bench.home()
    assert (delivered.missed, delivered.not_reached) == (('auv_1',), ('auv_2',))


def test_with_a_guarantee_one_that_a_sortie_does_not_go_to_is_met_if_it_is_heard() -> None:
    bench = Bench(FirstOnly(guarantees_limit=True)).ordered()
    _, delivered = bench.home(auv_1=0, auv_2=0)
    assert [meeting.auv for meeting in delivered.meetings] == ['auv_1', 'auv_2']
    assert delivered.not_reached == ()


def test_one_searched_in_vain_is_astray_until_it_is_met() -> None:
    planner = OneStep()
    bench = Bench(planner).ordered()
    bench.home(auv_2=0)
    bench.home(auv_1=0, auv_2=1)
    prospects = [tuple(leg.prospect for leg in request.legs) for request in planner.requests]
    assert prospects == [
        (Prospect.ASTRAY, Prospect.ENDS),
        (Prospect.ENDS, Prospect.ENDS),
        (Prospect.STAYS, Prospect.ENDS),
    ]


def test_one_that_did_not_confirm_its_path_stays_until_it_does() -> None:
    planner = OneStep(guarantees_limit=True)
    bench = Bench(planner).ordered()
    bench.until(SortieDeparted)
    bench.meet('auv_1', acknowledges=False)
    bench.meet('auv_2')
    bench.home()
    bench.until(SortieDeparted)
    bench.meet('auv_2', 1)
    assert [leg.prospect for leg in planner.requests[-1].legs] == [Prospect.STAYS, Prospect.ENDS]
    bench.meet('auv_1', 1)
    assert [leg.prospect for leg in planner.requests[-1].legs] == [Prospect.ENDS, Prospect.STAYS]


def test_the_planner_is_told_where_between_two_cells_a_leg_begins() -> None:
    planner = OneStep(guarantees_limit=True)
    bench = Bench(planner).ordered()
    bench.until(SortieDeparted)
    bench.meet('auv_1', position=Point(east_m=22.0, north_m=5.0))
    assert planner.requests[-1].behind == (1, 0)
    bench.meet('auv_2')
    assert planner.requests[-1].behind is None
    assert [leg.behind for leg in planner.requests[-1].legs] == [(1, 0), None]
    assert planner.requests[-1].legs[0].track == ((3, 0), (2, 0), (1, 0))


def test_the_planner_is_told_from_where_each_leg_is_searched() -> None:
    planner = OneStep(guarantees_limit=True)
    bench = Bench(planner).ordered()
    output = bench.until(SortieDeparted)
    (route,) = (each.message for each in output if getattr(each, 'topic', None) is ROUTE)
    bench.meet('auv_2')
    laid = [leg.search for leg in planner.requests[-1].legs]
    assert (C3, *laid[0], *laid[1], C3) == route.points
