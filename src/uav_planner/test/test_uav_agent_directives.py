"""Directives, as the UAV takes them: all that can be flown on the ground, an abort in the air."""

from __future__ import annotations

from random import Random
from typing import TYPE_CHECKING

import hypothesis.strategies as st
import pytest
from hypothesis import given, settings
from msgspec.structs import replace
from uav_bench import (
    BOTH_KINDS,
    PATHS,
    REGION,
    Bench,
    OneStep,
    brought,
    events,
    of,
    report,
    said,
    taken,
)
from uav_sea import Sea, missions

from msgs_json.messages import (
    Acknowledged,
    Acknowledgement,
    Directive,
    DirectiveRefused,
    DirectiveTaken,
    GivenUp,
    Met,
    Missed,
    PathAssignment,
    RecoveryOrder,
    RecoveryReason,
    Sample,
    SampleBatch,
    SearchBrokenOff,
    SortieDeparted,
    SortieReturned,
)
from uav_planner.directives import problem_with_region
from uav_planner.oracle_boards import legs_of
from uav_planner.planners.robust import RobustPlanner

if TYPE_CHECKING:
    from msgs_json.agent import Output
    from msgs_json.messages import MissionOrder
    from uav_planner.planning import SortiePlan, SortieRequest

ORDERED = Directive(
    revision=0, paused=False, aborted=False, recalled=(), sortie_limit_s=100.0, masked=()
)


def wanted(revision: int, **changes: object) -> Directive:
    return replace(ORDERED, revision=revision, **changes)


def acknowledged(revision: int) -> Acknowledgement:
    return taken(Acknowledged.DIRECTIVE, revision)


def flying() -> Bench:
    bench = Bench().ordered()
    bench.until(SortieDeparted)
    return bench


# --- on the ground -------------------------------------------------------------------------------


def test_it_takes_a_directive_once_and_says_so_as_often_as_it_hears_it() -> None:
    bench = Bench().ordered()
    output = bench.hear('c3', wanted(1, paused=True))
    assert said(output, 'c3') == [acknowledged(1)]
    assert events(output) == [DirectiveTaken(directive=wanted(1, paused=True))]
    bench.restart()
    output = bench.hear('c3', wanted(1, paused=True))
    assert said(output, 'c3') == [acknowledged(1)]
    assert events(output) == []


@pytest.mark.parametrize('what', ['paused', 'aborted'])
@BOTH_KINDS
def test_no_sortie_departs_until_the_operator_lets_it(what: str, guarantees_limit: bool) -> None:
    bench = Bench(OneStep(guarantees_limit=guarantees_limit)).ordered()
    bench.hear('c3', wanted(1, **{what: True}))
    output = bench.tick(30)
    bench.restart()
    for _ in range(30):
        # One that lies at C3 is heard, and not met.
        output += bench.hear('auv_1', report('auv_1', position=bench.here))
        output += bench.tick()
    assert events(output) == []
    bench.hear('c3', wanted(2))
    (departed,) = of(SortieDeparted, events(bench.tick(2)))
    assert isinstance(departed, SortieDeparted)
    assert departed.sortie == 1


def test_an_older_directive_is_a_late_copy() -> None:
    bench = Bench().ordered()
    bench.hear('c3', wanted(2))
    assert bench.hear('c3', wanted(1, aborted=True)) == []
    assert of(SortieDeparted, events(bench.tick(30))) != []


def test_a_recalled_auv_is_told_to_stay_up_and_the_other_one_goes_on() -> None:
    bench = Bench().ordered()
    bench.hear('c3', wanted(1, recalled=('auv_1',)))
    output, delivered = bench.home(auv_1=0, auv_2=0)
    reasons = [each.reason for each in said(output, 'auv_1') if isinstance(each, RecoveryOrder)]
    assert reasons[0] is RecoveryReason.RECALLED
    first, second = delivered.meetings
    assert first.next_leg is None
    assert second.next_leg is not None


def test_one_that_did_not_hear_its_path_is_recalled_instead_of_told_it_again() -> None:
    bench = flying()
    bench.meet('auv_1', acknowledges=False)
    bench.home()
    bench.hear('c3', wanted(1, recalled=('auv_1',)))
    bench.until(SortieDeparted)
    orders = [
        each for each in said(bench.meet('auv_1'), 'auv_1') if isinstance(each, RecoveryOrder)
    ]
    assert [each.reason for each in orders] == [RecoveryReason.RECALLED]


# --- what cannot be flown ------------------------------------------------------------------------


def test_a_limit_that_cannot_be_kept_stays_as_it_was_and_the_rest_is_taken() -> None:
    bench = Bench(OneStep(guarantees_limit=True)).ordered()
    too_short = wanted(1, paused=True, sortie_limit_s=9.0)
    output = bench.hear('c3', too_short)
    (refused,) = said(output, 'c3')
    assert isinstance(refused, DirectiveRefused)
    assert (refused.revision, refused.sortie_limit_s) == (1, 100.0)
    assert refused.problem == (
        'sortie_limit_s is 9; allowed: at least 24, which the next sortie takes at worst;'
        ' it stays 100'
    )
    assert events(output) == [DirectiveTaken(directive=wanted(1, paused=True))]
    bench.restart()
    assert bench.hear('c3', too_short) == output[:1]
    assert of(SortieDeparted, events(bench.tick(30))) == []


def test_a_limit_that_is_just_enough_is_flown_by() -> None:
    bench = Bench(OneStep(guarantees_limit=True)).ordered()
    assert said(bench.hear('c3', wanted(1, sortie_limit_s=24.0)), 'c3') == [acknowledged(1)]
    (departed,) = of(SortieDeparted, events(bench.until(SortieDeparted)))
    assert isinstance(departed, SortieDeparted)
    assert departed.limit_s == 24.0


def test_a_limit_leaves_a_lost_auv_within_reach_for_it_may_be_heard_again() -> None:
    bench = Bench(OneStep(guarantees_limit=True)).ordered(lost_after_sorties=1)
    bench.home(auv_1=0)
    (refused,) = said(bench.hear('c3', wanted(1, sortie_limit_s=16.0)), 'c3')
    assert isinstance(refused, DirectiveRefused)
    assert refused.problem == (
        'sortie_limit_s is 16; allowed: at least 22, which a sortie to auv_2 alone takes at worst;'
        ' it stays 100'
    )


def test_without_a_guarantee_any_limit_of_a_tick_is_flown_by() -> None:
    bench = Bench().ordered()
    assert said(bench.hear('c3', wanted(1, sortie_limit_s=1.0)), 'c3') == [acknowledged(1)]
    (refused,) = said(bench.hear('c3', wanted(2, sortie_limit_s=0.5)), 'c3')
    assert isinstance(refused, DirectiveRefused)
    assert refused.problem == 'sortie_limit_s is 0.5; allowed: at least 1, a tick; it stays 1'


def test_the_region_stays_as_it_was_where_an_auv_is_on_its_way() -> None:
    bench = Bench().ordered()
    output = bench.hear('c3', wanted(1, masked=((1, 0),), recalled=('auv_2',)))
    (refused,) = said(output, 'c3')
    assert isinstance(refused, DirectiveRefused)
    assert refused.problem == (
        'masked holds [1, 0], which is on the path of auv_1; the region stays as it is'
    )
    assert refused.masked == ()
    assert events(output) == [DirectiveTaken(directive=wanted(1, recalled=('auv_2',)))]


def test_the_path_of_a_lost_auv_stays_in_the_region_for_it_may_be_heard_again() -> None:
    bench = Bench().ordered(lost_after_sorties=1)
    bench.home(auv_2=0)
    (refused,) = said(bench.hear('c3', wanted(1, masked=((1, 0),))), 'c3')
    assert isinstance(refused, DirectiveRefused)
    bench.hear('c3', wanted(2, masked=((0, 1),)))
    bench.until(SortieDeparted)
    assert said(bench.meet('auv_1'), 'auv_1') != []


@pytest.mark.parametrize(
    ('masked', 'surveyors', 'problem'),
    [
        (((6, 0),), {'auv_1'}, 'masked[0] is [6, 0], outside the grid'),
        (((0, 1), (0, 1)), {'auv_1'}, 'masked[1] is [0, 1], which is masked already'),
        (((0, 1),), {'auv_1'}, 'masked leaves out cells that are masked in the order'),
        (((3, 1), (3, 0)), {'auv_1'}, 'masked leaves 4 cells to which no AUV could get, [4, 0]'),
        (((3, 1), (3, 0)), set(), None),
        (((3, 1), (0, 1)), {'auv_1'}, None),
    ],
    ids=['outside', 'twice', 'of_the_order', 'out_of_reach', 'nobody_to_reach_it', 'possible'],
)
def test_a_region_must_be_one_that_can_be_surveyed(
    masked: tuple[tuple[int, int], ...], surveyors: set[str], problem: str | None
) -> None:
    (leg,) = legs_of([((1, 0), (2, 0))])
    ordered = replace(REGION, masked=((3, 1),))
    said_of_it = problem_with_region(masked, ordered, [leg], surveyors)
    assert (said_of_it or '').startswith(problem or '')
    assert (said_of_it is None) == (problem is None)


class NoWayAround(OneStep):
    """Cannot plan where anything is masked."""

    def plan_sortie(self, request: SortieRequest) -> SortiePlan:
        if request.mission.grid.masked:
            raise ValueError('there is no way around what is masked')
        return super().plan_sortie(request)


def test_a_region_for_which_the_planner_has_no_plan_stays_as_it_was() -> None:
    bench = Bench(NoWayAround()).ordered()
    (refused,) = said(bench.hear('c3', wanted(1, masked=((3, 1),), paused=True)), 'c3')
    assert isinstance(refused, DirectiveRefused)
    assert refused.masked == ()
    assert refused.problem.startswith('there is no way around')
    bench.hear('c3', wanted(2))
    bench.until(SortieDeparted)


# --- in the air ----------------------------------------------------------------------------------


def test_in_the_air_it_takes_nothing_and_on_the_ground_all() -> None:
    bench = flying()
    assert bench.hear('c3', wanted(1, paused=True, recalled=('auv_1',))) == []
    bench.home()
    bench.hear('c3', wanted(1, paused=True, recalled=('auv_1',)))
    assert of(SortieDeparted, events(bench.tick(60))) == []


def test_an_abort_turns_it_home_at_once_and_is_no_search_in_vain() -> None:
    bench = Bench().ordered(lost_after_sorties=1)
    bench.until(SortieDeparted)
    output = bench.hear('c3', wanted(1, aborted=True))
    assert events(output) == [SearchBrokenOff(sortie=1, not_reached=('auv_1', 'auv_2'))]
    assert bench.hear('c3', wanted(1, aborted=True)) == []
    output, delivered = bench.home()
    assert of(GivenUp, events(output)) == of(Missed, events(output)) == []
    assert delivered.not_reached == ('auv_1', 'auv_2')
    assert delivered.lost == ()


@BOTH_KINDS
def test_after_an_abort_nobody_is_given_a_path(guarantees_limit: bool) -> None:
    """Neither those who are met on the way home nor those who were not told theirs by then."""
    bench = Bench(OneStep(guarantees_limit=guarantees_limit)).ordered()
    bench.until(SortieDeparted)
    bench.tick(5)
    full = report('auv_1').samples
    (receipt,) = said(bench.hear('auv_1', report('auv_1', samples=full[:1])), 'auv_1')
    bench.hear('c3', wanted(1, aborted=True))
    output = bench.hear('auv_1', SampleBatch(samples=full[1:]))
    for _ in range(30):
        output += [*bench.meet('auv_1'), *bench.meet('auv_2'), *(ticked := bench.tick())]
        bench.deliver(ticked)
    assert len(of(SortieReturned, events(output))) == 1
    assert {type(each) for auv in PATHS for each in said(output, auv)} == {type(receipt)}
    assert of(Met, events(output)) == []
    assert {('auv_1', 0), ('auv_1', 1)} <= brought(bench)  # its data is taken all the same
    bench.hear('c3', wanted(2))
    bench.until(SortieDeparted)
    legs = [said(bench.meet(auv), auv)[-1] for auv in PATHS]
    assert [each.leg.leg_id for each in legs if isinstance(each, PathAssignment)] == [1, 1]


@BOTH_KINDS
def test_after_an_abort_one_that_was_told_to_stay_up_is_told_again(guarantees_limit: bool) -> None:
    bench = Bench(OneStep(guarantees_limit=guarantees_limit)).ordered()
    bench.hear('c3', wanted(1, recalled=('auv_1',)))
    bench.until(SortieDeparted)
    bench.meet('auv_1', acknowledges=False)
    bench.hear('c3', wanted(2, aborted=True, recalled=('auv_1',)))
    bench.tick()
    assert isinstance(said(bench.meet('auv_1'), 'auv_1')[-1], RecoveryOrder)


@pytest.mark.parametrize('dies', [False, True])
def test_an_abort_that_was_heard_in_the_air_lasts_though_c3_is_not_heard_any_more(
    dies: bool,
) -> None:
    bench = flying()
    bench.hear('c3', wanted(1, aborted=True))
    bench.home()
    if dies:
        bench.restart()
    assert of(SortieDeparted, events(bench.tick(60))) == []
    assert said(bench.hear('c3', wanted(2)), 'c3') == [acknowledged(2)]
    assert of(SortieDeparted, events(bench.tick(60))) != []


def test_a_late_copy_of_an_abort_calls_nobody_home() -> None:
    bench = Bench().ordered()
    bench.hear('c3', wanted(2))
    bench.until(SortieDeparted)
    assert bench.hear('c3', wanted(1, aborted=True)) == []
    assert of(SearchBrokenOff, events(bench.tick(5))) == []


def test_an_abort_ends_the_wait_for_an_answer() -> None:
    bench = flying()
    for auv in ('auv_1', 'auv_2'):
        bench.meet(auv, acknowledges=False)
    there = bench.position()
    bench.hear('c3', wanted(1, aborted=True))
    assert bench.position() != there


# --- a sortie that is planned again --------------------------------------------------------------


def test_it_keeps_its_number() -> None:
    bench = Bench().ordered()
    bench.home(auv_1=0, auv_2=0)
    bench.hear('c3', wanted(1))
    (departed,) = of(SortieDeparted, events(bench.until(SortieDeparted)))
    assert isinstance(departed, SortieDeparted)
    assert departed.sortie == 2


@pytest.mark.parametrize('changes', [0, 3])
def test_it_still_waits_before_it_searches_again_those_who_were_not_heard(changes: int) -> None:
    bench = Bench(RobustPlanner()).ordered(radio_range_m=10.0)
    bench.until(SortieDeparted)
    departed_s = bench.now_s
    bench.home()
    for revision in range(1, changes + 1):
        bench.hear('c3', wanted(revision, paused=revision % 2 == 1))
        bench.tick()
    if changes:
        bench.hear('c3', wanted(changes + 1))
    bench.until(SortieDeparted)
    assert bench.now_s - departed_s == ORDERED.sortie_limit_s


def test_it_still_goes_first_to_those_whom_the_one_before_did_not_reach() -> None:
    bench = Bench(RobustPlanner()).ordered(radio_range_m=10.0)
    bench.until(SortieDeparted)
    bench.meet('auv_1')
    bench.hear('c3', wanted(1, aborted=True))
    bench.home()
    bench.hear('c3', wanted(2))
    (departed,) = of(SortieDeparted, events(bench.until(SortieDeparted)))
    assert isinstance(departed, SortieDeparted)
    assert departed.order == ('auv_2', 'auv_1')


# --- samples -------------------------------------------------------------------------------------


def test_samples_of_cells_that_are_masked_now_are_taken() -> None:
    bench = Bench().ordered()
    bench.home(auv_1=0, auv_2=0)
    bench.hear('c3', wanted(1, masked=((0, 1), (1, 0))))
    bench.until(SortieDeparted)
    old = Sample(auv='auv_1', number=7, cell=(0, 1), entered_s=0.0, value=1.0)
    assert said(bench.hear('auv_1', SampleBatch(samples=(old,))), 'auv_1') != []
    bench.home()
    assert ('auv_1', 7) in brought(bench)


# --- whole flights -------------------------------------------------------------------------------

directives = st.builds(
    lambda paused, aborted, recalled, limit, col: {
        'paused': paused,
        'aborted': aborted,
        'recalled': recalled,
        'sortie_limit_s': limit,
        'masked': () if col is None else ((col, 0),),
    },
    st.booleans(),
    st.sampled_from([False, False, True]),
    st.sampled_from([(), (), ('auv_1',), ('auv_1', 'auv_2', 'auv_3')]),
    st.sampled_from([1.0, 30.0, 60.0, 200.0]),
    st.sampled_from([None, 0, 1, 4]),
)


def flown(
    mission: MissionOrder, seed: int, changes: list[dict[str, object]], crashes: frozenset[int]
) -> tuple[Bench, list[Output]]:
    """Fly for a while as an operator wants who is heard for 20 seconds each time."""
    bench = Bench(RobustPlanner(), crashes=crashes)
    sea = Sea(bench, mission, Random(seed))
    output: list[Output] = []
    for revision, change in enumerate(changes, start=1):
        output += sea.sail(20)
        for _ in range(20):
            output += bench.hear('c3', wanted(revision, **change))
            output += sea.sail(1)
    output += bench.hear('c3', wanted(len(changes) + 1, sortie_limit_s=mission.sortie_limit_s))
    return bench, output + sea.sail(40)


@settings(max_examples=25)
@given(
    mission=missions(),
    seed=st.integers(0, 2**32),
    changes=st.lists(directives, min_size=1, max_size=4),
    data=st.data(),
)
def test_the_limit_in_force_is_kept_and_crashes_change_nothing(
    mission: MissionOrder, seed: int, changes: list[dict[str, object]], data: st.DataObject
) -> None:
    bench, output = flown(mission, seed, changes, frozenset())
    limit_s = mission.sortie_limit_s
    for event in events(output):
        match event:
            case DirectiveTaken(directive=directive):
                limit_s = directive.sortie_limit_s
            case SortieDeparted():
                assert event.limit_s == limit_s
                assert event.worst_case_s <= limit_s
            case SortieReturned():
                assert event.duration_s <= limit_s
    inputs = len(bench.outputs)
    crashes = data.draw(st.just(frozenset(range(inputs))) | st.frozensets(st.integers(0, inputs)))
    crashed, again = flown(mission, seed, changes, crashes)
    assert events(again) == events(output)
    assert brought(crashed) == brought(bench)
