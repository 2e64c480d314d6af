from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace

import hypothesis.strategies as st
import msgspec
import pytest
from hypothesis import given, settings
from uav_bench import (
    C3,
    PATHS,
    REGION,
    SETUP,
    Bench,
    OneStep,
    auv_order,
    events,
    of,
    order,
    path_handed_over,
    receipt,
    refused,
    report,
    said,
    taken,
)

from msgs_json.agent import Log, Output, Publish, Refuse, Transmit
from msgs_json.codec import Refusal
from msgs_json.geometry import GridSpec, Point, within_range
from msgs_json.messages import (
    Acknowledged,
    Acknowledgement,
    Leg,
    LegOutcome,
    Message,
    Met,
    Missed,
    PathAssignment,
    RecoveryOrder,
    RecoveryReason,
    Sample,
    SampleBatch,
    SampleReceipt,
    SampleSpan,
    SortieDeparted,
    SortieReport,
    SortieReturned,
)
from msgs_json.ros_messages import TrackPath
from msgs_json.topics import ODOM, ROUTE
from uav_planner.candidate_paths import LISTED_MOVES_MAX, SEARCHED_MOVES_MAX
from uav_planner.hand_over import HAND_OVER_TICKS
from uav_planner.planners import PLANNERS, make_planner
from uav_planner.planners.ecc2009 import Ecc2009Planner
from uav_planner.planners.robust import RobustPlanner
from uav_planner.planning import MissionSpec, Planner, Prospect, SurveyLeg
from uav_planner.sortie import flight_time_s, lay_route, punctual_departure_s, worst_case_s

ORDER_TAKEN = Transmit('c3', taken(Acknowledged.MISSION_ORDER, 0))

# --- the order -----------------------------------------------------------------------------------


def test_without_an_order_it_stays_at_c3_and_shows_where_it_is() -> None:
    bench = Bench()
    for _ in range(3):
        (shown,) = bench.tick()
        assert isinstance(shown, Publish)
        assert shown.topic is ODOM
    assert bench.position() == C3
    assert bench.agent.peers == {'c3'}


def test_an_order_is_acknowledged_and_makes_its_auvs_known() -> None:
    bench = Bench()
    bench.tick()
    assert bench.hear('c3', order()) == [ORDER_TAKEN]
    assert bench.agent.peers == {'c3', 'auv_1', 'auv_2'}


def test_a_repeated_order_is_acknowledged_and_nothing_else() -> None:
    bench = Bench().ordered()
    bench.until(SortieDeparted)
    other = order(auvs=(auv_order('auv_7', PATHS['auv_1']),))
    assert bench.hear('c3', other) == [ORDER_TAKEN]
    assert bench.agent.peers == {'c3', 'auv_1', 'auv_2'}


@pytest.mark.parametrize(
    'changes',
    [
        {'auvs': (auv_order('auv_1', PATHS['auv_1']), auv_order('auv_1', PATHS['auv_2']))},
        {'auvs': (auv_order('auv_1', ((5, 0), (6, 0))),)},
        {'region': GridSpec(cols=1, rows=1, cell_m=10.0)},
        {'min_path_cells': 2},
        {'sortie_limit_s': 0.5},
        {'region': msgspec.structs.replace(REGION, masked=((99, 99),))},
        {'region': msgspec.structs.replace(REGION, masked=(PATHS['auv_1'][1],))},
        {'region': msgspec.structs.replace(REGION, masked=((0, 0), (1, 1)))},
    ],
    ids=[
        'same_name',
        'path_out_of_the_region',
        'tiny_region',
        'min_over_max',
        'limit_under_a_tick',
        'land_beside_the_grid',
        'path_through_land',
        'corner_cut_off',
    ],
)
def test_an_order_that_is_no_mission_is_refused_and_a_good_one_still_taken(
    changes: dict[str, object],
) -> None:
    bench = Bench()
    bench.tick()
    assert refused(bench.hear('c3', order(**changes))) == ('c3', Refusal.CONTRADICTORY)
    assert bench.agent.peers == {'c3'}
    assert bench.hear('c3', order()) == [ORDER_TAKEN]


@pytest.mark.parametrize(
    ('planner', 'path_cells', 'allowed'),
    [
        (Ecc2009Planner, LISTED_MOVES_MAX + 1, 'with planner ecc2009: 1 to 9'),
        (Ecc2009Planner, 10_000, 'with planner ecc2009: 1 to 9'),
        (RobustPlanner, SEARCHED_MOVES_MAX + 1, 'where the best path is searched: 1 to 24'),
    ],
)
def test_an_order_that_its_planner_cannot_plan_is_refused_before_it_flies(
    planner: Callable[[], Planner], path_cells: int, allowed: str
) -> None:
    bench = Bench(planner())
    bench.tick()
    output = bench.hear('c3', order(path_cells=path_cells, radio_range_m=10.0))
    assert refused(output) == ('c3', Refusal.NOT_POSSIBLE)
    (refusal,) = output
    assert isinstance(refusal, Refuse)
    assert f'path_cells is {path_cells}; allowed {allowed}' in refusal.detail
    assert bench.agent.peers == {'c3'}
    assert len(bench.tick(100)) == 100  # it stays at home: odometry only
    assert bench.hear('c3', order(radio_range_m=10.0)) == [ORDER_TAKEN]


@pytest.mark.parametrize('name', sorted(PLANNERS.keys() - {'ecc2009'}))
def test_an_order_with_the_longest_paths_of_a_scenario_is_taken(name: str) -> None:
    options = {'effort': 'minimal'} if name == 'adaptive' else {}
    bench = Bench(make_planner(name, **options))
    bench.tick()
    longest = order(path_cells=SEARCHED_MOVES_MAX, radio_range_m=10.0)
    assert bench.hear('c3', longest) == [ORDER_TAKEN]


def test_a_uav_that_stops_short_of_its_waypoints_plans_with_a_shorter_range() -> None:
    planner = OneStep()
    bench = Bench(planner, setup=replace(SETUP, arrival_radius_m=2.0))
    bench.tick()
    assert refused(bench.hear('c3', order(radio_range_m=2.0))) == ('c3', Refusal.CONTRADICTORY)
    assert bench.hear('c3', order(radio_range_m=5.0)) == [ORDER_TAKEN]
    bench.meet('auv_1')
    assert planner.requests[0].mission.radio_range_m == 3.0


def test_only_c3_gives_orders() -> None:
    bench = Bench()
    bench.tick()
    assert refused(bench.hear('auv_1', order())) == ('auv_1', Refusal.UNEXPECTED)


# --- departure -----------------------------------------------------------------------------------


def test_it_leaves_so_as_to_be_there_when_the_first_auv_must_be_up() -> None:
    bench = Bench().ordered()
    route = lay_route(mission_spec(), survey_legs())
    depart_s = punctual_departure_s(mission_spec(), route, 0.0)
    assert depart_s > 0.0
    positions = [bench.position() for _ in range(10)]  # from 1 s to 10 s
    at_c3 = [position == C3 for position in positions]
    assert at_c3 == [number <= depart_s for number in range(1, 11)]
    assert positions[-1] == route[0].point


def mission_spec() -> MissionSpec:
    return MissionSpec(
        grid=REGION,
        c3=C3,
        radio_range_m=5.0,
        uav_speed_mps=5.0,
        tick_s=1.0,
        sortie_limit_s=100.0,
        path_cells=1,
        min_path_cells=1,
    )


def survey_legs() -> tuple[SurveyLeg, ...]:
    return tuple(
        SurveyLeg(auv=name, path=path, surface_deadline_s=10.0) for name, path in PATHS.items()
    )


def test_a_departure_is_logged_with_what_is_promised_and_the_route_is_shown() -> None:
    bench = Bench().ordered()
    output = bench.until(SortieDeparted)
    (departed,) = (each for each in output if isinstance(each, Log))
    route = lay_route(mission_spec(), survey_legs())
    assert departed.event == SortieDeparted(
        sortie=1,
        limit_s=100.0,
        predicted_s=flight_time_s(mission_spec(), route),
        worst_case_s=worst_case_s(mission_spec(), route, departed.stamp_s),
        order=('auv_1', 'auv_2'),
    )
    (track,) = (
        each.message for each in output if isinstance(each, Publish) and each.topic is ROUTE
    )
    assert isinstance(track, TrackPath)
    assert track.points == (C3, *(waypoint.point for waypoint in route), C3)


def test_an_auv_heard_at_c3_is_met_there_and_the_sortie_begins() -> None:
    bench = Bench().ordered()
    output = bench.meet('auv_1')
    assert [type(event) for event in events(output)] == [SortieDeparted, Met]
    assert events(output)[0].worst_case_s > 0  # type: ignore[attr-defined]


# --- a meeting -----------------------------------------------------------------------------------


def test_an_auv_in_turn_gets_custody_confirmed_and_its_next_path() -> None:
    bench = Bench().ordered()
    bench.until(SortieDeparted)
    bench.tick(3)
    output = bench.meet('auv_1')
    leg = path_handed_over(output, 'auv_1')
    assert (leg.leg_id, leg.path) == (1, ((2, 0), (3, 0)))
    assert leg.surface_deadline_s == bench.now_s + 10.0  # one cell at 1 m/s
    assert events(output) == [
        Met(
            sortie=1,
            auv='auv_1',
            cell=(2, 0),
            leg_id=0,
            path=((2, 0), (3, 0)),
            slack_s=7.0,
            sortie_time_s=9.0,
            plan_status='ok',
        )
    ]


def test_the_deadline_counts_from_where_the_auv_really_lies() -> None:
    bench = Bench().ordered()
    off_the_centre = Point(east_m=25.0, north_m=8.0)
    output = bench.hear('auv_1', report('auv_1', position=off_the_centre))
    # 3 m back to the centre, 10 m on.
    assert path_handed_over(output, 'auv_1').surface_deadline_s == bench.now_s + 13.0


def test_the_planner_is_told_what_becomes_of_whose_leg() -> None:
    planner = OneStep()
    bench = Bench(planner).ordered()
    bench.meet('auv_1')
    bench.meet('auv_2')
    first, second = planner.requests
    assert (first.auv, first.cell) == ('auv_1', (2, 0))
    assert [leg.prospect for leg in first.legs] == [Prospect.ENDS, Prospect.ENDS]
    assert second.auv == 'auv_2'
    assert [leg.prospect for leg in second.legs] == [Prospect.STAYS, Prospect.ENDS]
    assert [leg.path for leg in second.legs] == [((2, 0), (3, 0)), PATHS['auv_2']]
    assert second.values[0, 3] == 0.5  # what auv_1 was given is halved at once


def test_cells_that_were_not_reached_are_worth_going_to_again() -> None:
    planner = OneStep()
    bench = Bench(planner).ordered()
    early = report('auv_1', outcome=LegOutcome.EARLY, moves_done=0, cell=(1, 0), samples=())
    bench.hear('auv_1', early)
    assert planner.requests[0].cell == (1, 0)
    assert planner.requests[0].values[0, 2] == 1.0
    assert planner.requests[0].values[0, 1] == 0.5
    bench.meet('auv_2')
    assert planner.requests[1].values[0, 2] == 0.5  # assigned again


def test_a_met_auv_is_not_met_again_in_the_same_sortie() -> None:
    bench = Bench().ordered()
    bench.meet('auv_1')
    assert bench.hear('auv_1', report('auv_1')) == []  # a late copy
    assert bench.hear('auv_1', report('auv_1', 1)) == []  # it was very quick


def test_while_the_auv_has_not_answered_the_uav_stays_and_says_it_again() -> None:
    bench = Bench().ordered()
    bench.until(SortieDeparted)
    bench.tick(3)
    first = path_handed_over(bench.meet('auv_1', acknowledges=False), 'auv_1')
    here = bench.position()
    output = bench.hear('auv_1', report('auv_1'))
    again = path_handed_over(output, 'auv_1')
    assert events(output) == []
    assert (again.leg_id, again.path) == (first.leg_id, first.path)
    assert again.surface_deadline_s == first.surface_deadline_s + 1.0  # it starts later
    assert bench.position() == here
    bench.hear('auv_1', taken(Acknowledged.PATH_ASSIGNMENT, 1))
    assert bench.position() != here


def test_it_does_not_wait_for_ever_for_an_answer_that_was_lost() -> None:
    bench = Bench().ordered()
    bench.until(SortieDeparted)
    bench.tick(3)
    bench.meet('auv_1', acknowledges=False)  # it dives at once, and its answer is not heard
    here = [bench.position() for _ in range(HAND_OVER_TICKS + 1)]
    assert len(set(here[:HAND_OVER_TICKS])) == 1
    assert here[-1] != here[0]


def test_an_auv_whose_answer_was_lost_is_met_on_its_next_leg() -> None:
    bench = Bench().ordered()
    bench.meet('auv_1', acknowledges=False)
    bench.until(SortieReturned)
    output = bench.meet('auv_1', 1)
    assert path_handed_over(output, 'auv_1').leg_id == 2


def test_an_auv_that_never_got_its_path_gets_the_same_one_in_the_next_sortie() -> None:
    planner = OneStep()
    bench = Bench(planner).ordered()
    first = path_handed_over(bench.meet('auv_1', acknowledges=False), 'auv_1')
    bench.until(SortieReturned)
    output = bench.meet('auv_1', 0)
    again = path_handed_over(output, 'auv_1')
    assert (again.leg_id, again.path) == (first.leg_id, first.path)
    assert again.surface_deadline_s > first.surface_deadline_s
    (met,) = of(Met, events(output))
    assert (met.sortie, met.leg_id) == (2, 0)  # type: ignore[attr-defined]
    assert len(planner.requests) == 1
    # And its samples, which the UAV has since the first meeting, are not relayed twice.
    (_, second) = reports_after(bench, acknowledges=True)
    assert second.cargo == (SampleSpan(auv='auv_1', first=0, until=2),)
    assert bench.meet('auv_1', 1, acknowledges=False) != []


def reports_after(bench: Bench, *, acknowledges: bool) -> list[SortieReport]:
    """Fly the present sortie to its end; return every report heard by a C3 that acknowledges."""
    found: list[SortieReport] = []
    output = bench.until(SortieReturned)
    for _ in range(3):
        for body in said(output, 'c3'):
            if isinstance(body, SortieReport) and body not in found:
                found.append(body)
        if not found or not acknowledges:
            break
        output = bench.hear('c3', taken(Acknowledged.SORTIE_REPORT, found[-1].sortie))
    return found


def test_an_auv_that_speaks_of_its_next_leg_has_taken_it() -> None:
    bench = Bench().ordered()
    bench.meet('auv_1', acknowledges=False)
    here = bench.position()
    assert bench.hear('auv_1', report('auv_1', 1)) == []  # it came up again early
    assert bench.position() != here


def test_a_report_of_a_leg_that_it_was_never_given_ends_no_hand_over() -> None:
    bench = Bench().ordered()
    bench.meet('auv_1', acknowledges=False)
    bench.hear('auv_1', report('auv_1', 3))
    bench.tick()
    assert said(bench.hear('auv_1', report('auv_1', 0)), 'auv_1') != []


def test_a_late_copy_of_an_older_report_is_not_answered() -> None:
    bench = Bench().ordered()
    bench.meet('auv_1')
    bench.until(SortieReturned)
    bench.meet('auv_1', 1, acknowledges=False)
    bench.tick()
    assert bench.hear('auv_1', report('auv_1', 0)) == []
    assert said(bench.hear('auv_1', report('auv_1', 1)), 'auv_1') != []


@pytest.mark.parametrize(
    ('what', 'reference'),
    [
        (Acknowledged.PATH_ASSIGNMENT, 0),
        (Acknowledged.PATH_ASSIGNMENT, 2),
        (Acknowledged.RECOVERY_ORDER, 0),
        (Acknowledged.RECOVERY_ORDER, 1),
        (Acknowledged.DIRECTIVE, 1),
        (Acknowledged.SORTIE_REPORT, 1),
    ],
)
def test_only_the_right_answer_ends_a_hand_over(what: Acknowledged, reference: int) -> None:
    bench = Bench().ordered()
    bench.meet('auv_1', acknowledges=False)
    bench.tick()
    assert bench.hear('auv_1', taken(what, reference)) == []
    assert said(bench.hear('auv_1', report('auv_1')), 'auv_1') != []  # still repeated
    bench.hear('auv_1', taken(Acknowledged.PATH_ASSIGNMENT, 1))
    assert bench.hear('auv_1', report('auv_1')) == []


def test_nobody_can_answer_for_another() -> None:
    bench = Bench().ordered()
    bench.meet('auv_1', acknowledges=False)
    for src in ('auv_2', 'c3'):
        bench.hear(src, taken(Acknowledged.PATH_ASSIGNMENT, 1))
    bench.tick()
    assert said(bench.hear('auv_1', report('auv_1')), 'auv_1') != []


@pytest.mark.parametrize(
    'changes',
    [
        {'leg_id': 1},
        {'moves_done': 2},
        {'moves_done': 0},
        {'cell': (3, 0)},
    ],
    ids=['other_leg', 'too_many_moves', 'cell_not_reached', 'cell_off_the_path'],
)
def test_a_report_that_contradicts_the_leg_is_refused_and_nothing_taken(
    changes: dict[str, object],
) -> None:
    planner = OneStep()
    bench = Bench(planner).ordered()
    assert refused(bench.hear('auv_1', report('auv_1', **changes))) == (
        'auv_1',
        Refusal.CONTRADICTORY,
    )
    assert planner.requests == []
    output = bench.meet('auv_1')  # an honest one is still taken
    assert path_handed_over(output, 'auv_1').leg_id == 1


@pytest.mark.parametrize(('src', 'auv'), [('auv_2', 'auv_1'), ('c3', 'c3'), ('c3', 'auv_1')])
def test_nobody_reports_for_another(src: str, auv: str) -> None:
    bench = Bench().ordered()
    lie = msgspec.structs.replace(report('auv_1'), auv=auv)
    assert refused(bench.hear(src, lie)) == (src, Refusal.UNEXPECTED)


def test_messages_that_a_uav_does_not_take_are_refused() -> None:
    bench = Bench().ordered()
    leg = Leg(leg_id=1, path=PATHS['auv_1'], surface_deadline_s=1.0)
    assert refused(bench.hear('auv_1', PathAssignment(auv='auv_1', leg=leg))) == (
        'auv_1',
        Refusal.UNEXPECTED,
    )


# --- turns ---------------------------------------------------------------------------------------


def test_an_auv_heard_before_its_turn_has_to_wait() -> None:
    bench = Bench().ordered()
    assert bench.hear('auv_2', report('auv_2')) == []
    output = bench.meet('auv_1')  # in the same tick: now it is its turn
    assert [event.auv for event in of(Met, events(output))] == [  # type: ignore[attr-defined]
        *('auv_1', 'auv_2')
    ]


def test_what_was_heard_at_an_earlier_tick_is_out_of_date() -> None:
    bench = Bench().ordered()
    bench.hear('auv_2', report('auv_2'))
    bench.tick()
    assert len(of(Met, events(bench.meet('auv_1')))) == 1


def test_an_auv_that_is_nowhere_on_its_path_is_missed_and_the_next_one_met() -> None:
    bench = Bench().ordered()
    output = bench.until(Missed)
    (missed,) = (
        each
        for each in output
        if isinstance(each, Log) and each.event == Missed(sortie=1, auv='auv_1')
    )
    assert missed.stamp_s >= 10.0  # not before it must be surfaced
    assert len(of(Met, events(bench.meet('auv_2')))) == 1
    (found,) = reports_after(bench, acknowledges=False)
    assert found.missed == ('auv_1',)
    assert [meeting.auv for meeting in found.meetings] == ['auv_2']


def test_a_sortie_that_meets_nobody_takes_as_long_as_the_worst_case_says() -> None:
    bench = Bench().ordered()
    (departed,) = of(SortieDeparted, events(bench.until(SortieDeparted)))
    (returned,) = of(SortieReturned, events(bench.until(SortieReturned)))
    assert returned.duration_s == departed.worst_case_s  # type: ignore[attr-defined]


@pytest.mark.parametrize('is_heard', [True, False])
def test_a_sortie_that_ends_at_c3_with_its_last_search_takes_no_step_more(is_heard: bool) -> None:
    """Both cells of the leg are in range from C3: there is nowhere to fly."""
    bench = Bench()
    bench.tick()
    near = auv_order('auv_1', ((0, 0), (1, 0)))
    bench.hear('c3', order(auvs=(near,), radio_range_m=20.0))
    output = bench.tick(10)
    if is_heard:
        output += bench.meet('auv_1', moves_done=1, cell=(1, 0), samples=())
    output += bench.tick()
    (departed,) = of(SortieDeparted, events(output))
    assert departed.worst_case_s == 0.0  # type: ignore[attr-defined]
    assert of(SortieReturned, events(output)) == [SortieReturned(sortie=1, duration_s=0.0)]
    assert len(of(Missed, events(output))) == (not is_heard)


# --- delivery ------------------------------------------------------------------------------------


def test_back_at_c3_it_reports_everything_until_that_is_acknowledged() -> None:
    bench = Bench().ordered(surface_margin_s=100.0)  # the next sortie has time
    bench.until(SortieDeparted)
    departed_s = bench.now_s - 1.0
    bench.tick(3)
    met_s = bench.now_s
    bench.meet('auv_1')
    bench.meet('auv_2')
    (found,) = reports_after(bench, acknowledges=False)
    assert (found.sortie, found.departed_s, found.returned_s) == (1, departed_s, bench.now_s)
    assert [(m.auv, m.time_s, m.cell, m.ended_leg_id) for m in found.meetings] == [
        ('auv_1', met_s, (2, 0), 0),
        ('auv_2', met_s, (5, 0), 0),
    ]
    assert [meeting.next_leg and meeting.next_leg.leg_id for meeting in found.meetings] == [1, 1]
    samples = tuple(sample for auv in PATHS for sample in report(auv).samples)
    assert found.cargo == tuple(SampleSpan(auv=auv, first=0, until=2) for auv in PATHS)
    assert said(bench.tick(), 'c3') == [found, SampleBatch(samples=samples)]
    bench.hear('c3', taken(Acknowledged.SORTIE_REPORT, 2))
    assert said(bench.tick(), 'c3') == [found, SampleBatch(samples=samples)]
    assert bench.hear('c3', receipt(samples[1:])) == [  # one of them was lost on the way
        Transmit('c3', found)
    ]
    assert said(bench.tick(), 'c3') == [found, SampleBatch(samples=samples[:1])]
    assert bench.hear('c3', taken(Acknowledged.SORTIE_REPORT, 1)) == []
    assert said(bench.tick(), 'c3') == [SampleBatch(samples=samples[:1])]
    assert bench.hear('c3', receipt(samples)) == []
    assert said(bench.tick(), 'c3') == []


def test_reports_that_c3_missed_are_delivered_in_order_later() -> None:
    bench = Bench().ordered(surface_margin_s=100.0)
    bench.meet('auv_1')
    bench.until(SortieReturned)  # c3 hears nothing
    bench.meet('auv_1', 1)
    bench.until(SortieReturned)
    (first, batch) = said(bench.tick(), 'c3')
    assert isinstance(first, SortieReport)
    assert first.sortie == 1
    assert isinstance(batch, SampleBatch)
    assert [sample.number for sample in batch.samples] == [0, 1, 2]
    (second,) = said(bench.hear('c3', taken(Acknowledged.SORTIE_REPORT, 1)), 'c3')
    assert isinstance(second, SortieReport)
    assert second.sortie == 2
    assert [(span.first, span.until) for span in first.cargo] == [(0, 2)]
    assert [(span.first, span.until) for span in second.cargo] == [(0, 3)]
    bench.hear('c3', taken(Acknowledged.SORTIE_REPORT, 1))  # a late copy
    assert said(bench.tick(), 'c3') == [second, batch]


def test_only_c3_acknowledges_reports() -> None:
    bench = Bench().ordered()
    bench.meet('auv_1')
    (found,) = reports_after(bench, acknowledges=False)
    bench.hear('auv_1', taken(Acknowledged.SORTIE_REPORT, 1))
    assert said(bench.tick(), 'c3')[0] == found


def test_in_the_air_it_says_its_report_but_no_samples() -> None:
    bench = Bench().ordered()
    bench.meet('auv_1')
    bench.until(SortieReturned)
    (found,) = said(bench.tick(), 'c3')  # it is on its way again
    assert isinstance(found, SortieReport)
    assert bench.hear('c3', receipt(report('auv_1').samples[:1])) == [Transmit('c3', found)]


def test_it_says_its_report_only_where_c3_is_within_radio_range() -> None:
    bench = Bench().ordered()
    bench.meet('auv_1')
    bench.until(SortieReturned)
    said_from_m = set()
    for _ in range(30):  # of another sortie
        said_here = said(bench.tick(), 'c3')
        assert bool(said_here) == within_range(bench.here.distance_m(C3), 5.0)
        said_from_m.add((bench.here.distance_m(C3), bool(said_here)))
    assert {(0.0, True), (5.0, True), (10.0, False)} <= said_from_m


@pytest.mark.parametrize('src', ['auv_1', 'auv_2'])
def test_only_c3_relieves_it_of_samples(src: str) -> None:
    bench = Bench().ordered(surface_margin_s=100.0)
    bench.meet('auv_1')
    bench.until(SortieReturned)
    output = bench.hear(src, receipt(report('auv_1').samples))
    assert refused(output) == (src, Refusal.UNEXPECTED)
    assert said(bench.tick(), 'c3')[1:] == [SampleBatch(samples=report('auv_1').samples)]


# --- the end -------------------------------------------------------------------------------------


def small_mission() -> Bench:
    """Return a bench whose two cells are explored when its only AUV has done its first leg."""
    bench = Bench()
    bench.tick()
    region = GridSpec(cols=2, rows=1, cell_m=10.0)
    bench.hear('c3', order(region=region, auvs=(auv_order('auv_1', ((0, 0), (1, 0))),)))
    return bench


LAST_REPORT = report('auv_1', cell=(1, 0), samples=())
RECOVERY = RecoveryOrder(auv='auv_1', leg_id=0, reason=RecoveryReason.EXPLORED)


def test_when_all_is_explored_the_auv_is_told_to_stay_up() -> None:
    bench = small_mission()
    output = bench.hear('auv_1', LAST_REPORT)
    assert said(output, 'auv_1') == [SampleReceipt(held=(), at_c3=()), RECOVERY]
    (met,) = of(Met, events(output))
    assert (met.path, met.slack_s, met.plan_status) == ((), None, None)  # type: ignore[attr-defined]


def test_nothing_has_ended_before_the_order() -> None:
    bench = Bench()
    bench.tick()
    assert bench.hear('c3', receipt(())) == []
    assert not bench.agent.finished


@pytest.mark.parametrize('acknowledges', [True, False])
def test_it_has_finished_when_c3_has_everything(acknowledges: bool) -> None:
    bench = small_mission()
    bench.hear('auv_1', LAST_REPORT)
    if acknowledges:
        bench.hear('auv_1', taken(Acknowledged.RECOVERY_ORDER, 0))
    (found,) = reports_after(bench, acknowledges=False)
    assert found.meetings[0].next_leg is None
    assert not bench.agent.finished
    bench.hear('c3', taken(Acknowledged.SORTIE_REPORT, 1))
    assert bench.agent.finished
    assert len(bench.tick(50)) == 50  # at home, odometry only


def test_an_auv_that_missed_its_recovery_order_is_told_again_whenever_it_is_heard() -> None:
    bench = small_mission()
    bench.hear('auv_1', LAST_REPORT)
    for _ in range(20):  # in the hand-over, on the way home, at home
        bench.tick()
        assert said(bench.hear('auv_1', LAST_REPORT), 'auv_1')[1:] == [RECOVERY]
    bench.hear('auv_1', taken(Acknowledged.PATH_ASSIGNMENT, 0))  # of the leg before: a late copy
    bench.tick()
    assert said(bench.hear('auv_1', LAST_REPORT), 'auv_1')[1:] == [RECOVERY]
    bench.hear('auv_1', taken(Acknowledged.RECOVERY_ORDER, 0))
    assert bench.hear('auv_1', LAST_REPORT) == []


# --- every input in every state ------------------------------------------------------------------

peers = st.sampled_from(['c3', 'auv_1', 'auv_2'])
few = st.integers(0, 3)
cells = st.tuples(st.integers(0, 6), st.integers(0, 1))
outcomes = st.sampled_from([LegOutcome.COMPLETED, LegOutcome.COMPLETED, LegOutcome.ABORTED])
honest = st.builds(report, st.sampled_from(sorted(PATHS)), few, outcome=outcomes)
odd = st.tuples(honest, cells, few).map(
    lambda parts: msgspec.structs.replace(parts[0], cell=parts[1], moves_done=parts[2])
)
words = st.one_of(
    honest,
    odd,
    honest.map(lambda each: SampleBatch(samples=each.samples)),
    st.builds(Acknowledgement, acknowledges=st.sampled_from(Acknowledged), reference=few),
    st.just(order()),
    st.builds(RecoveryOrder, auv=peers, leg_id=few, reason=st.just(RecoveryReason.EXPLORED)),
)
heard = st.one_of(honest.map(lambda each: (each.auv, each)), st.tuples(peers, words))
incidents = st.sampled_from(['c3 confirms', 'crash'])

Key = tuple[str, int]
"""The name of an AUV and the number of its sample."""


def keys(spans: Iterable[SampleSpan]) -> set[Key]:
    return {(span.auv, number) for span in spans for number in range(span.first, span.until)}


@dataclass(slots=True)
class Custody:
    """What becomes of samples, from what the UAV says."""

    held: set[Key] = field(default_factory=set)
    """The UAV has said that it has them."""
    brought: dict[Key, Sample] = field(default_factory=dict)
    """It has said them to C3."""
    at_c3: set[Key] = field(default_factory=set)
    """C3 has said that it has them."""
    reports: list[SortieReport] = field(default_factory=list)

    def note(self, output: list[Output]) -> None:
        for each in output:
            match each:
                case Transmit(dst, SampleReceipt() as receipt):
                    named = keys(receipt.held) | keys(receipt.at_c3)
                    assert {auv for auv, _ in named} <= {dst}
                    assert keys(receipt.at_c3) <= self.at_c3
                    assert {key for key in self.held if key[0] == dst} <= named  # for ever
                    self.held |= named
                case Transmit('c3', SampleBatch(samples=samples)):
                    found = {(sample.auv, sample.number): sample for sample in samples}
                    assert not found.keys() & self.at_c3
                    self.brought |= found
                case Transmit('c3', SortieReport() as found):
                    if found.sortie == len(self.reports) + 1:
                        self.reports.append(found)

    def confirmed(self) -> SampleReceipt:
        """Return C3's word that it has all that was brought."""
        self.at_c3 |= self.brought.keys()
        return receipt(self.brought.values())


@given(
    st.lists(st.integers(1, 20) | incidents | heard, max_size=40),
    st.booleans(),
    st.sampled_from([1, 2, 9]),
)
@settings(max_examples=80)
def test_whatever_it_hears_what_it_took_custody_of_reaches_c3(
    inputs: list[int | str | tuple[str, Message]], guarantees_limit: bool, lost_after_sorties: int
) -> None:
    planner = OneStep(guarantees_limit=guarantees_limit)
    bench = Bench(planner).ordered(lost_after_sorties=lost_after_sorties)
    custody = Custody()
    for step in inputs:
        match step:
            case int(seconds):
                custody.note(bench.tick(seconds))
            case 'crash':
                bench.restart()
            case 'c3 confirms':
                custody.note(bench.hear('c3', custody.confirmed()))
            case (src, message):
                custody.note(bench.hear(src, message))
    # Then it gets home, to a C3 that hears and acknowledges everything.
    for _ in range(150):
        custody.note(bench.tick())
        sortie = len(custody.reports)
        custody.note(bench.hear('c3', taken(Acknowledged.SORTIE_REPORT, sortie)))
        custody.note(bench.hear('c3', custody.confirmed()))
    assert custody.held <= custody.at_c3
    assert [found.sortie for found in custody.reports] == list(range(1, sortie + 1))
    assert set().union(*(keys(found.cargo) for found in custody.reports)) <= custody.at_c3
