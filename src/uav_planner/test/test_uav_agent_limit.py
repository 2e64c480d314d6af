"""How the UAV keeps L in flight, and what it says of the next sortie."""

from __future__ import annotations

import contextlib
from random import Random
from typing import TYPE_CHECKING

import hypothesis.strategies as st
import pytest
from hypothesis import given, settings
from uav_bench import (
    BOTH_KINDS,
    C3,
    PATHS,
    REGION,
    Bench,
    NotHeard,
    OneStep,
    auv_order,
    duration_s,
    events,
    of,
    order,
    stamps_of,
    vehicle,
)
from uav_sea import Sea, missions

from msgs_json.drivers import UavDriver, VehicleUnavailableError
from msgs_json.geometry import Point
from msgs_json.messages import (
    Met,
    Missed,
    SearchBrokenOff,
    SortieDeparted,
    SortieReturned,
)
from msgs_json.straight_motion import Flow
from msgs_json.topics import ROUTE
from uav_planner.hand_over import HAND_OVER_TICKS
from uav_planner.planners.ecc2009 import Ecc2009Planner
from uav_planner.planners.robust import RobustPlanner
from uav_planner.planning import Planner, Prospect

if TYPE_CHECKING:
    from msgs_json.agent import Output
    from msgs_json.messages import MissionOrder


def guarded(driver: UavDriver | None = None, **changes: object) -> Bench:
    """Return a bench whose sorties keep L: 20 s, if nobody is heard."""
    return Bench(RobustPlanner(), driver).ordered(**{'radio_range_m': 10.0, **changes})


# --- out of turn ---------------------------------------------------------------------------------


def test_with_a_guarantee_one_heard_out_of_turn_is_met_at_once() -> None:
    bench = Bench(OneStep(guarantees_limit=True)).ordered()
    bench.until(SortieDeparted)
    bench.tick(3)
    assert len(of(Met, events(bench.meet('auv_2')))) == 1
    here = bench.here
    bench.tick()
    onward = here.toward(REGION.centre((2, 0)), 5.0)
    assert bench.here.distance_m(onward) < 1e-6  # to the other one
    assert len(of(Met, events(bench.meet('auv_1')))) == 1
    assert duration_s(bench.home()[0]) == 5.0 + 5.0  # straight home: nobody is left


@pytest.mark.parametrize(('handover_s', 'departs_s'), [(0.0, 70.0), (4.0, 74.0)])
def test_with_a_guarantee_one_heard_from_c3_waits_for_the_departure(
    handover_s: float, departs_s: float
) -> None:
    """To meet it starts the sortie, and auv_2 may come up as late as 100 s, 10 s from C3."""
    auvs = (auv_order('auv_1', PATHS['auv_1']), auv_order('auv_2', PATHS['auv_2'], 100.0))
    changes = {'auvs': auvs, 'sortie_limit_s': 40.0, 'handover_s': handover_s}
    assert stamps_of(SortieDeparted, guarded(**changes).tick(80)) == [departs_s]
    bench = guarded(**changes)
    output = bench.meet('auv_1')
    while not of(Met, events(output)):
        output = bench.tick()
        assert bench.here == C3
        output += bench.meet('auv_1')
    assert bench.now_s == departs_s
    (departed,) = of(SortieDeparted, events(output))
    assert departed.worst_case_s == 40.0  # type: ignore[attr-defined]
    output, delivered = bench.home()
    assert delivered.departed_s == departs_s
    assert duration_s(output) == 110.0 - departs_s <= 40.0


def test_with_a_guarantee_one_heard_from_c3_is_met_as_soon_as_the_rest_keeps_the_limit() -> None:
    """That is earlier than the UAV would leave for both; it promises only what is left to fly."""
    auvs = tuple(auv_order(name, path, 100.0) for name, path in PATHS.items())
    changes = {'auvs': auvs, 'sortie_limit_s': 20.0}
    assert stamps_of(SortieDeparted, guarded(**changes).tick(99)) == [96.0]
    bench = guarded(**changes)
    output = bench.meet('auv_1')
    while not of(Met, events(output)):
        output = [*bench.tick(), *bench.meet('auv_1')]
    assert bench.now_s == 90.0
    (departed,) = of(SortieDeparted, events(output))
    assert departed.worst_case_s == 20.0  # type: ignore[attr-defined]
    assert duration_s(bench.home()[0]) == 20.0


@pytest.mark.parametrize(('due_s', 'worst_case_s'), [(100.0, 33.0), (81.0, 26.0)])
def test_an_auv_met_at_c3_is_not_in_the_worst_case_of_the_sortie_that_begins_with_it(
    due_s: float, worst_case_s: float
) -> None:
    """
    It would be waited for until 150 s, but is met at 80 s.

    Then it is handed its path for 3 s; auv_2 is 10 s away, waited for, and handed its path, too.
    """
    auvs = (
        auv_order('auv_1', PATHS['auv_1'], 150.0),
        auv_order('auv_2', PATHS['auv_2'], due_s),
    )
    bench = guarded(auvs=auvs, sortie_limit_s=40.0, handover_s=2.5)
    bench.tick(80)
    (departed,) = of(SortieDeparted, events(bench.meet('auv_1')))
    assert departed.worst_case_s == worst_case_s  # type: ignore[attr-defined]


# --- the way home in time ------------------------------------------------------------------------


@pytest.mark.parametrize('limit_s', [21.0, 22.0, 23.0, 24.0])
@pytest.mark.parametrize('wind_mps', [0.5, 1.0])
def test_it_does_not_wait_for_an_answer_until_the_wind_makes_it_late(
    wind_mps: float, limit_s: float
) -> None:
    """It has met the last AUV, and the way home is against the wind."""
    far = (auv_order('auv_2', PATHS['auv_2']),)
    bench = guarded(vehicle(wind=Flow(east_mps=wind_mps)), auvs=far, sortie_limit_s=limit_s)
    while bench.now_s < 8.0:
        bench.tick()
    assert of(Met, events(bench.meet('auv_2', acknowledges=False)))
    assert duration_s(bench.home()[0]) <= limit_s


LATE = {
    'slow_vehicle': {'speed_mps': 4.0},
    'head_wind_out': {'wind': Flow(east_mps=-1.0)},
    'head_wind_home': {'wind': Flow(east_mps=1.0)},
    'cross_wind': {'wind': Flow(north_mps=2.5)},
}


@pytest.mark.parametrize('limit_s', [20.0, 21.0])
@pytest.mark.parametrize('late', LATE.values(), ids=LATE)
def test_a_uav_that_is_late_breaks_the_search_off_and_is_home_in_time(
    late: dict[str, object], limit_s: float
) -> None:
    bench = guarded(vehicle(**late), sortie_limit_s=limit_s)
    output, delivered = bench.home()
    assert of(SearchBrokenOff, events(output)) == [
        SearchBrokenOff(sortie=1, not_reached=('auv_2',))
    ]
    assert of(Missed, events(output)) == [Missed(sortie=1, auv='auv_1')]
    assert duration_s(output) <= limit_s
    assert (delivered.missed, delivered.not_reached) == (('auv_1',), ('auv_2',))
    output, delivered = bench.home()
    (departed,) = of(SortieDeparted, events(output))
    assert departed.order == ('auv_2', 'auv_1')  # type: ignore[attr-defined]
    assert of(SearchBrokenOff, events(output)) == [
        SearchBrokenOff(sortie=2, not_reached=('auv_2', 'auv_1'))
    ]
    assert delivered.not_reached == ('auv_1', 'auv_2')
    assert duration_s(output) <= limit_s


def test_it_turns_home_no_earlier_than_it_must() -> None:
    """At 4 m/s for 5 it has seen a difference of 1 m a tick, and reckons with 3.5 m on the way."""
    bench = guarded(vehicle(speed_mps=4.0), sortie_limit_s=21.0)
    output = bench.until(SearchBrokenOff)
    (departed_s,) = stamps_of(SortieDeparted, output)
    (turned_s,) = stamps_of(SearchBrokenOff, output)
    turned_at = bench.here.toward(Point(east_m=100.0, north_m=5.0), 4.0)
    home_s = turned_at.distance_m(C3) / 3.5
    assert departed_s + 21.0 - 1.0 < turned_s + home_s + 1.0 + 5.0 / 3.5


def test_one_that_is_heard_on_the_way_home_is_met_all_the_same() -> None:
    planner = OneStep(guarantees_limit=True)
    bench = Bench(planner, vehicle(speed_mps=4.0)).ordered(sortie_limit_s=24.0)
    output = bench.until(SearchBrokenOff)
    assert of(Missed, events(output)) == [Missed(sortie=1, auv='auv_1')]
    here = bench.here
    assert len(of(Met, events(bench.meet('auv_1', acknowledges=False)))) == 1
    bench.tick()
    assert bench.here == here.toward(C3, 4.0)  # it stays for no answer
    (request,) = planner.requests
    assert request.legs[1].prospect is Prospect.STAYS  # nobody goes to auv_2 any more
    output, delivered = bench.home()
    assert duration_s(output) <= 24.0
    assert (delivered.missed, delivered.not_reached) == ((), ('auv_2',))
    assert [meeting.auv for meeting in delivered.meetings] == ['auv_1']


def test_one_that_was_met_is_not_among_those_not_reached() -> None:
    bench = Bench(OneStep(guarantees_limit=True), vehicle(speed_mps=2.5)).ordered(
        sortie_limit_s=20.0
    )
    bench.until(SortieDeparted)
    bench.meet('auv_2')
    output, delivered = bench.home()
    assert of(SearchBrokenOff, events(output)) == [
        SearchBrokenOff(sortie=1, not_reached=('auv_1',))
    ]
    assert delivered.not_reached == ('auv_1',)
    assert duration_s(output) <= 20.0


def test_the_planner_of_the_paper_never_breaks_off() -> None:
    bench = Bench(Ecc2009Planner(), vehicle(speed_mps=4.0)).ordered(sortie_limit_s=24.0)
    output, delivered = bench.home()
    assert of(SearchBrokenOff, events(output)) == []
    assert delivered.missed == ('auv_1', 'auv_2')
    assert duration_s(output) > 24.0


@pytest.mark.parametrize('tick', range(6, 30))
def test_a_vehicle_that_is_not_heard_for_a_tick_is_not_taken_for_blown_away(tick: int) -> None:
    """When it is heard again it has come two ticks' way."""
    bench = guarded(NotHeard(vehicle(), float(tick)), sortie_limit_s=22.0)
    output: list[Output] = []
    while not of(SortieReturned, events(output)):
        with contextlib.suppress(VehicleUnavailableError):
            output += bench.tick()
    assert of(SearchBrokenOff, events(output)) == []


@given(missions(), st.integers(0, 2**32), st.sampled_from([0.0, 0.0, 0.3]))
@settings(max_examples=30)
def test_without_wind_nothing_is_ever_broken_off_or_late(
    mission: MissionOrder, seed: int, loss: float
) -> None:
    """Wherever on their legs the AUVs come up, and even where much of what is said is lost."""
    bench = Bench(RobustPlanner())
    sea = Sea(bench, mission, Random(seed), loss=loss)
    output = sea.sail(300)
    assert of(SearchBrokenOff, events(output)) == []
    for departed, returned in zip(
        of(SortieDeparted, events(output)), of(SortieReturned, events(output)), strict=False
    ):
        assert returned.duration_s <= mission.sortie_limit_s + 1e-6  # type: ignore[attr-defined]
        if loss == 0.0:
            assert returned.duration_s <= departed.worst_case_s  # type: ignore[attr-defined]
    if loss == 0.0:
        assert of(Missed, events(output)) == []
    assert sea.reports


# --- waiting for an answer -----------------------------------------------------------------------


@pytest.mark.parametrize('limit_s', [*range(23, 32), 60])
def test_with_a_guarantee_it_stays_for_an_answer_only_as_long_as_the_limit_allows(
    limit_s: int,
) -> None:
    """It leaves at 5 s, is over auv_1 at 10 s, and would be over auv_2 and home in 18 s."""
    planner = OneStep(guarantees_limit=True)
    bench = Bench(planner).ordered(sortie_limit_s=float(limit_s))
    while bench.now_s < 10.0:
        bench.tick()
    bench.meet('auv_1', acknowledges=False)
    stayed_s = stay_s(bench)
    assert stayed_s == min(limit_s - 23, HAND_OVER_TICKS)
    output, _ = bench.home()
    assert duration_s(output) == 23.0 + stayed_s
    assert of(SearchBrokenOff, events(output)) == []


def stay_s(bench: Bench) -> int:
    """Return how many seconds the UAV holds where it is."""
    here, ticks = bench.here, 0
    while bench.position() == here:
        ticks += 1
    return ticks


@pytest.mark.parametrize(('handover_s', 'stays_s'), [(3.0, 5), (8.0, 8)])
@BOTH_KINDS
def test_it_stays_for_as_long_as_hand_overs_may_take(
    guarantees_limit: bool, handover_s: float, stays_s: int
) -> None:
    bench = Bench(OneStep(guarantees_limit=guarantees_limit)).ordered(handover_s=handover_s)
    bench.until(SortieDeparted)
    bench.tick(4)
    bench.meet('auv_1', acknowledges=False)
    assert stay_s(bench) == stays_s


def test_for_an_answer_out_of_turn_it_has_the_time_that_this_saves() -> None:
    """The rest of auv_1's search and the way home take 6 s; 13 are left."""
    bench = Bench(OneStep(guarantees_limit=True)).ordered(sortie_limit_s=18.0)
    while bench.now_s < 10.0:
        bench.tick()
    bench.meet('auv_2', acknowledges=False)
    assert stay_s(bench) == HAND_OVER_TICKS


def test_it_stays_for_no_answer_that_it_could_not_wait_for_in_the_sortie_before() -> None:
    """It waits for auv_2 until L binds, hears auv_1 4 s from home, and leaves again at once."""
    auvs = (
        auv_order('auv_3', ((1, 1), (0, 1))),
        auv_order('auv_2', PATHS['auv_2'], 100.0),
        auv_order('auv_1', PATHS['auv_1']),
    )
    bench = guarded(auvs=auvs, sortie_limit_s=40.0)
    bench.tick(107)
    assert len(of(Met, events(bench.meet('auv_1', acknowledges=False)))) == 1
    output, delivered = bench.home()
    assert (duration_s(output), delivered.missed) == (40.0, ('auv_3', 'auv_2'))
    assert bench.position() != C3


def test_the_time_for_a_hand_over_is_there_however_tight_the_limit() -> None:
    bench = guarded(sortie_limit_s=26.0, handover_s=3.0)
    output = bench.until(SortieDeparted)
    assert of(SortieDeparted, events(output))[0].worst_case_s == 26.0  # type: ignore[attr-defined]
    for auv, due_s in (('auv_1', 10.0), ('auv_2', 19.0)):
        while bench.now_s < due_s:
            output += bench.tick()
        bench.meet(auv, acknowledges=False)
        assert stay_s(bench) == 3
    output += bench.home()[0]
    assert duration_s(output) == 26.0


def test_as_in_the_paper_it_stays_for_an_answer_whatever_the_limit() -> None:
    bench = Bench().ordered(sortie_limit_s=22.0)
    bench.until(SortieDeparted)
    bench.tick(4)
    bench.meet('auv_1', acknowledges=False)
    assert stay_s(bench) == HAND_OVER_TICKS


# --- what is said of the next sortie -------------------------------------------------------------


@pytest.mark.parametrize('planner', [OneStep(), RobustPlanner()])
def test_the_outlook_is_what_is_flown_if_nobody_is_heard(planner: Planner) -> None:
    bench = Bench(planner)
    sea = Sea(bench, order(radio_range_m=10.0, sortie_limit_s=60.0))
    while not sea.reports:
        sea.tick()
    outlook = sea.reports[0].next_sortie
    assert outlook is not None
    track: dict[float, Point] = {}
    output: list[Output] = []
    while not of(SortieReturned, events(output)):
        output += bench.tick()
        track[bench.now_s] = bench.here
    assert stamps_of(SortieDeparted, output) == [outlook.departs_s]
    assert stamps_of(SortieReturned, output) == [outlook.returns_by_s]
    (route,) = (each.message for each in output if getattr(each, 'topic', None) is ROUTE)
    legs = {meeting.auv: meeting.next_leg for meeting in sea.reports[0].meetings}
    assert [each.auv for each in outlook.contacts] == ['auv_1', 'auv_2']
    for each in outlook.contacts:
        assert track[each.time_s] in route.points
        if track[each.time_s - 1.0] == track[each.time_s]:  # it has waited there
            assert each.time_s == legs[each.auv].surface_deadline_s
    missed_s = stamps_of(Missed, output)
    assert all(
        each.time_s <= time_s for each, time_s in zip(outlook.contacts, missed_s, strict=True)
    )
