"""Data that takes longer to hand over than a moment, and AUVs that are not where they believe."""

from __future__ import annotations

from random import Random
from typing import TYPE_CHECKING

import hypothesis.strategies as st
import msgspec
import pytest
from hypothesis import given, settings
from uav_bench import (
    BOTH_KINDS,
    PATHS,
    REGION,
    Bench,
    OneStep,
    brought,
    events,
    of,
    order,
    report,
    said,
    taken,
)
from uav_sea import Diver, Sea, missions

from msgs_json.agent import Refuse
from msgs_json.codec import Refusal
from msgs_json.messages import (
    Acknowledged,
    LegOutcome,
    Met,
    PathAssignment,
    RecoveryOrder,
    RecoveryReason,
    Sample,
    SampleBatch,
    SampleReceipt,
    SampleSpan,
    SearchBrokenOff,
    SortieDeparted,
    SortieReturned,
    SurfacingReport,
)
from uav_planner.hand_over import CONTRADICTIONS_MAX, HAND_OVER_TICKS
from uav_planner.planners.ecc2009 import Ecc2009Planner
from uav_planner.planners.robust import RobustPlanner

if TYPE_CHECKING:
    from msgs_json.messages import MissionOrder
    from uav_planner.planning import Planner

SAMPLES = tuple(
    Sample(auv='auv_1', number=number, cell=(1, 0), entered_s=0.0, value=1.0)
    for number in range(8)
)


def laden(*numbers: int, **changes: object) -> SurfacingReport:
    """Return a report of an AUV with eight samples that says some of them."""
    samples = tuple(SAMPLES[number] for number in numbers)
    return report('auv_1', **{'samples_taken': len(SAMPLES), 'samples': samples, **changes})


def batch(*numbers: int) -> SampleBatch:
    return SampleBatch(samples=tuple(SAMPLES[number] for number in numbers))


def held(first: int, until: int) -> SampleReceipt:
    return SampleReceipt(held=(SampleSpan(auv='auv_1', first=first, until=until),), at_c3=())


def over_auv_1(bench: Bench) -> Bench:
    """Let the UAV fly to where it hears its first AUV in its first sortie."""
    bench.until(SortieDeparted)
    while bench.now_s < 10.0:
        bench.tick()
    return bench


# --- when it is told what comes next -------------------------------------------------------------


@BOTH_KINDS
def test_an_auv_is_told_its_path_when_all_its_data_is_there(guarantees_limit: bool) -> None:
    bench = over_auv_1(Bench(OneStep(guarantees_limit=guarantees_limit)).ordered())
    assert said(bench.hear('auv_1', laden(0, 1, 2)), 'auv_1') == [held(0, 3)]
    bench.tick()
    assert said(bench.hear('auv_1', batch(3, 4)), 'auv_1') == [held(0, 5)]
    bench.tick()
    some = SampleReceipt(
        held=(
            SampleSpan(auv='auv_1', first=0, until=5),
            SampleSpan(auv='auv_1', first=6, until=8),
        ),
        at_c3=(),
    )
    assert said(bench.hear('auv_1', batch(6, 7)), 'auv_1') == [some]  # one was lost
    receipt, assignment = said(bench.hear('auv_1', batch(5)), 'auv_1')
    assert receipt == held(0, 8)
    assert isinstance(assignment, PathAssignment)
    assert assignment.leg.surface_deadline_s == bench.now_s + 10.0  # it starts only now


@pytest.mark.parametrize('dies', [False, True])
@BOTH_KINDS
def test_an_auv_is_answered_once_a_tick_and_for_the_rest_at_the_next_one(
    guarantees_limit: bool, dies: bool
) -> None:
    bench = over_auv_1(Bench(OneStep(guarantees_limit=guarantees_limit)).ordered())
    assert said(bench.hear('auv_1', laden(0, 1)), 'auv_1') == [held(0, 2)]
    for number in range(2, 6):
        assert bench.hear('auv_1', batch(number)) == []
        if dies:
            bench.restart()
    assert said(bench.tick(), 'auv_1') == [held(0, 6)]
    assert bench.hear('auv_1', laden(6)) == []
    _, assignment = said(bench.hear('auv_1', batch(7)), 'auv_1')  # all is there: what is next
    assert isinstance(assignment, PathAssignment)
    assert bench.hear('auv_1', batch(7)) == []


@pytest.mark.parametrize(('handover_s', 'data_s'), [(0.0, HAND_OVER_TICKS / 2), (14.0, 7.0)])
@BOTH_KINDS
def test_whatever_data_it_has_it_is_told_its_path_when_half_of_the_time_is_over(
    guarantees_limit: bool, handover_s: float, data_s: float
) -> None:
    planner = OneStep(guarantees_limit=guarantees_limit)
    bench = over_auv_1(Bench(planner).ordered(handover_s=handover_s))
    here, met_s = bench.here, bench.now_s
    while len(heard := said(bench.hear('auv_1', laden(0)), 'auv_1')) == 1:
        assert heard == [held(0, 1)]
        assert bench.now_s < met_s + data_s
        assert bench.position() == here
    assert data_s <= bench.now_s - met_s < data_s + 1.0
    assert len(planner.requests) == 1


@pytest.mark.parametrize('limit_s', range(23, 27))
def test_with_a_guarantee_an_auv_is_told_its_path_when_the_uav_has_to_leave(limit_s: int) -> None:
    """It leaves at 5 s, is over auv_1 at 10 s, and would be over auv_2 and home in 18 s."""
    bench = over_auv_1(Bench(OneStep(guarantees_limit=True)).ordered(sortie_limit_s=limit_s))
    here, stayed_s = bench.here, 0
    while len(said(bench.hear('auv_1', laden(0)), 'auv_1')) == 1:
        assert bench.position() == here
        stayed_s += 1
    assert stayed_s == min(limit_s - 23, 3)
    bench.hear('auv_1', taken(Acknowledged.PATH_ASSIGNMENT, 1))
    output, _ = bench.home()
    (returned,) = of(SortieReturned, events(output))
    assert returned.duration_s == 23.0 + stayed_s  # type: ignore[attr-defined]
    assert of(SearchBrokenOff, events(output)) == []


@BOTH_KINDS
def test_what_did_not_get_across_comes_at_the_next_meeting(guarantees_limit: bool) -> None:
    bench = over_auv_1(Bench(OneStep(guarantees_limit=guarantees_limit)).ordered())
    bench.hear('auv_1', laden(0, 1, 2))
    bench.tick(3)
    bench.meet('auv_1', samples_taken=len(SAMPLES), samples=SAMPLES[:3])
    bench.meet('auv_2')
    _, first = bench.home()
    assert first.cargo[0] == SampleSpan(auv='auv_1', first=0, until=3)
    bench.until(SortieDeparted)
    at_c3 = (SampleSpan(auv='auv_1', first=0, until=3),)
    next_report = report('auv_1', 1, samples_taken=len(SAMPLES), samples=SAMPLES[3:6])
    rest = (SampleSpan(auv='auv_1', first=3, until=6),)
    assert said(bench.hear('auv_1', next_report), 'auv_1') == [
        SampleReceipt(held=rest, at_c3=at_c3)
    ]
    assert len(said(bench.hear('auv_1', batch(6, 7)), 'auv_1')) == 2
    bench.hear('auv_1', taken(Acknowledged.PATH_ASSIGNMENT, 2))
    bench.meet('auv_2', 1)
    _, second = bench.home()
    assert second.cargo[0] == SampleSpan(auv='auv_1', first=3, until=8)
    assert brought(bench) >= {('auv_1', sample.number) for sample in SAMPLES}


@BOTH_KINDS
def test_data_that_comes_late_is_taken_but_the_path_is_for_the_next_meeting(
    guarantees_limit: bool,
) -> None:
    bench = over_auv_1(Bench(OneStep(guarantees_limit=guarantees_limit)).ordered())
    bench.hear('auv_1', laden(0, 1, 2))
    bench.tick(3)
    _, told = said(bench.hear('auv_1', laden(0, 1, 2)), 'auv_1')  # and does not hear it
    bench.meet('auv_2')
    bench.home()
    (receipt,) = said(bench.hear('auv_1', batch(3, 4)), 'auv_1')
    assert isinstance(receipt, SampleReceipt)
    assert receipt.held == (SampleSpan(auv='auv_1', first=3, until=5),)
    bench.until(SortieDeparted)
    _, told_again = said(bench.hear('auv_1', laden(*range(5, 8))), 'auv_1')
    assert isinstance(told, PathAssignment)
    assert isinstance(told_again, PathAssignment)
    assert told_again.leg.path == told.leg.path


ABORTED = {'outcome': LegOutcome.ABORTED, 'moves_done': 0, 'cell': (1, 0)}


@BOTH_KINDS
def test_an_auv_to_be_recovered_is_told_so_only_when_its_data_is_across(
    guarantees_limit: bool,
) -> None:
    """However long that takes: it gets no path for which it had to hurry."""
    bench = over_auv_1(Bench(OneStep(guarantees_limit=guarantees_limit)).ordered())
    for _ in range(20):
        assert said(bench.hear('auv_1', laden(0, **ABORTED)), 'auv_1') == [held(0, 1)]
        bench.tick()
    _, first = bench.home()
    assert first.next_sortie is not None
    assert 'auv_1' in [contact.auv for contact in first.next_sortie.contacts]
    bench.until(SortieDeparted)
    assert len(said(bench.hear('auv_1', laden(1, 2, 3, **ABORTED)), 'auv_1')) == 1
    _, order = said(bench.hear('auv_1', batch(4, 5, 6, 7)), 'auv_1')
    assert order == RecoveryOrder(auv='auv_1', leg_id=0, reason=RecoveryReason.ABORTED)
    bench.hear('auv_1', taken(Acknowledged.RECOVERY_ORDER, 0))
    _, second = bench.home()
    assert [meeting.next_leg for meeting in second.meetings] == [None]
    assert second.next_sortie is not None
    assert [contact.auv for contact in second.next_sortie.contacts] == ['auv_2']


# --- samples that cannot be ----------------------------------------------------------------------

DAMAGED = {
    'off_the_region': (
        msgspec.structs.replace(SAMPLES[5], cell=(6, 0)),
        'sample 5 of auv_1: cell [6, 0] lies outside the region of 6 x 2 cells',
    ),
    'of_another': (
        msgspec.structs.replace(SAMPLES[5], auv='auv_2'),
        'sample 5 that auv_1 hands over is of auv_2',
    ),
}
SOUND = (SampleSpan(auv='auv_1', first=0, until=5), SampleSpan(auv='auv_1', first=6, until=8))


@pytest.mark.parametrize(('damaged', 'problem'), DAMAGED.values(), ids=DAMAGED)
@pytest.mark.parametrize('is_reported', [True, False])
@BOTH_KINDS
def test_a_sample_that_cannot_be_is_refused_and_not_waited_for(
    guarantees_limit: bool, is_reported: bool, damaged: Sample, problem: str
) -> None:
    """By its AUV, its number and what is wrong; all that comes with it is taken."""
    bench = over_auv_1(Bench(OneStep(guarantees_limit=guarantees_limit)).ordered())
    with_damage = (*SAMPLES[:5], damaged, *SAMPLES[6:])
    if is_reported:
        output = bench.hear('auv_1', laden(samples=with_damage))
    else:
        bench.hear('auv_1', laden(0))
        output = bench.hear('auv_1', SampleBatch(samples=with_damage[1:]))
    assert output[0] == Refuse('auv_1', Refusal.CONTRADICTORY, problem)
    receipt, assignment = said(output, 'auv_1')
    assert receipt == SampleReceipt(held=SOUND, at_c3=())
    assert isinstance(assignment, PathAssignment)
    bench.meet('auv_2', samples=())
    bench.home()
    assert brought(bench) == {('auv_1', number) for number in (0, 1, 2, 3, 4, 6, 7)}


@pytest.mark.parametrize(('damaged', 'problem'), DAMAGED.values(), ids=DAMAGED)
@pytest.mark.parametrize('dies', [False, True])
@BOTH_KINDS
def test_an_auv_to_be_recovered_is_told_so_though_a_sample_of_it_is_damaged(
    guarantees_limit: bool, dies: bool, damaged: Sample, problem: str
) -> None:
    bench = over_auv_1(Bench(OneStep(guarantees_limit=guarantees_limit)).ordered())
    bench.hear('auv_1', laden(0, **ABORTED))
    bench.tick()
    refused, _ = bench.hear('auv_1', SampleBatch(samples=(SAMPLES[1], damaged)))
    assert refused == Refuse('auv_1', Refusal.CONTRADICTORY, problem)
    if dies:
        bench.restart()
    _, order = said(bench.hear('auv_1', batch(2, 3, 4, 6, 7)), 'auv_1')
    assert order == RecoveryOrder(auv='auv_1', leg_id=0, reason=RecoveryReason.ABORTED)
    # One that says the damaged one again hears the same again.
    bench.tick()
    again = bench.hear('auv_1', laden(samples=(damaged,), **ABORTED))
    assert again[0] == refused
    assert said(again, 'auv_1')[-1] == order


def test_a_damaged_sample_that_comes_sound_after_all_is_taken() -> None:
    bench = over_auv_1(Bench().ordered())
    damaged, _ = DAMAGED['off_the_region']
    bench.hear('auv_1', laden(samples=(*SAMPLES[:5], damaged)))
    bench.tick()
    assert said(bench.hear('auv_1', batch(5)), 'auv_1')[0] == held(0, 6)


class Damaging(Diver):
    """Has a sample in its store that cannot be."""

    def report(self, now_s: float) -> SurfacingReport | None:
        report = super().report(now_s)
        if report is None:
            return None
        samples = tuple(
            msgspec.structs.replace(sample, cell=(99, 99)) if sample.number == 3 else sample
            for sample in report.samples
        )
        return msgspec.structs.replace(report, samples=samples)


@pytest.mark.parametrize('planner', [Ecc2009Planner(), RobustPlanner()])
def test_a_mission_ends_with_all_that_is_sound_though_a_sample_is_damaged(
    planner: Planner,
) -> None:
    mission = order(radio_range_m=10.0, path_cells=3)
    bench = Bench(planner)
    sea = Sea(bench, mission)
    sea.divers['auv_1'] = Damaging(mission.auvs[0], mission.region, None, 1000)
    sea.sail(2000)
    assert bench.agent.finished
    taken_by = {
        (diver.name, each.number) for diver in sea.divers.values() for each in diver.samples
    }
    assert brought(bench) == taken_by - {('auv_1', 3)}
    for diver in sea.divers.values():
        assert diver.recovered is RecoveryReason.EXPLORED
    assert 3 not in sea.divers['auv_1'].held  # it keeps it


# --- over a sea ----------------------------------------------------------------------------------


@given(missions(), st.integers(0, 2**32), st.sampled_from([0.0, 0.3]), st.integers(1, 3))
@settings(max_examples=15)
def test_all_data_reaches_c3_and_none_of_it_costs_the_limit(
    mission: MissionOrder, seed: int, loss: float, samples_at_a_time: int
) -> None:
    """AUVs say but a few samples at a time, and much of what is said is lost."""
    bench = Bench(RobustPlanner())
    sea = Sea(bench, mission, Random(seed), loss=loss, samples_at_a_time=samples_at_a_time)
    output = sea.sail(250)
    for returned in of(SortieReturned, events(output)):
        assert returned.duration_s <= mission.sortie_limit_s + 1e-6  # type: ignore[attr-defined]
    assert of(SearchBrokenOff, events(output)) == []
    if bench.agent.finished:
        at_c3 = brought(bench)
        for diver in sea.divers.values():
            samples = {(diver.name, sample.number) for sample in diver.samples}
            assert samples <= at_c3 or not diver.recovered
            assert {(diver.name, number) for number in diver.held} <= at_c3


# --- off course ----------------------------------------------------------------------------------

BESIDE = {'cell': (2, 1)}
"""Its leg ends at (2, 0)."""


@BOTH_KINDS
def test_an_auv_that_keeps_contradicting_its_leg_is_recovered(guarantees_limit: bool) -> None:
    planner = OneStep(guarantees_limit=guarantees_limit)
    bench = Bench(planner).ordered()
    bench.until(SortieDeparted)
    for _ in range(CONTRADICTIONS_MAX - 1):
        (refused,) = bench.hear('auv_1', report('auv_1', **BESIDE))
        assert isinstance(refused, Refuse)
        bench.tick()
    output = bench.meet('auv_1', **BESIDE)
    assert isinstance(output[0], Refuse)
    assert said(output, 'auv_1')[1:] == [
        RecoveryOrder(auv='auv_1', leg_id=0, reason=RecoveryReason.OFF_COURSE)
    ]
    (met,) = of(Met, events(output))
    assert (met.path, met.plan_status) == ((), None)  # type: ignore[attr-defined]
    bench.meet('auv_2')
    assert planner.requests[-1].values[0, 2] == 1.0  # who knows whether it was there
    assert [leg.auv for leg in planner.requests[-1].legs] == ['auv_2']
    _, delivered = bench.home()
    assert [meeting.next_leg is None for meeting in delivered.meetings] == [True, False]
    # What it has measured is not lost, wherever that was.
    assert delivered.cargo == tuple(SampleSpan(auv=auv, first=0, until=2) for auv in PATHS)


def test_contradictions_of_one_tick_count_once() -> None:
    bench = over_auv_1(Bench().ordered())
    for _ in range(5 * CONTRADICTIONS_MAX):
        assert of(Met, events(bench.hear('auv_1', report('auv_1', **BESIDE)))) == []


def test_only_contradictions_in_a_row_count() -> None:
    bench = Bench().ordered(surface_margin_s=100.0)
    for leg_id in range(3):
        for _ in range(CONTRADICTIONS_MAX - 1):
            bench.tick()
            assert of(Met, events(bench.hear('auv_1', report('auv_1', leg_id, cell=(0, 1))))) == []
        output = bench.meet('auv_1', leg_id)
        assert len(of(Met, events(output))) == 1
        assert isinstance(said(output, 'auv_1')[1], PathAssignment)
        bench.meet('auv_2', leg_id)
        bench.home()


def test_late_copies_of_an_old_report_do_not_count() -> None:
    bench = Bench().ordered(lost_after_sorties=9)
    bench.home(auv_1=0, auv_2=0)
    output = bench.until(SortieDeparted)
    for _ in range(CONTRADICTIONS_MAX + 1):
        output += bench.tick()
        output += bench.hear('auv_1', report('auv_1', 0))
    assert of(Met, events(output)) == []
    output = bench.meet('auv_1', 1)
    assert isinstance(said(output, 'auv_1')[1], PathAssignment)


class OffByOne(Diver):
    """Believes to be one cell north of where it is, from its second leg on."""

    def report(self, now_s: float) -> SurfacingReport | None:
        report = super().report(now_s)
        if report is None or report.leg_id == 0:
            return report
        col, row = report.cell
        return msgspec.structs.replace(report, cell=(col, 1 - row))


@pytest.mark.parametrize('planner', [Ecc2009Planner(), RobustPlanner()])
def test_a_mission_ends_without_an_auv_that_is_off_course(planner: Planner) -> None:
    mission = order(radio_range_m=10.0, path_cells=3)
    bench = Bench(planner)
    sea = Sea(bench, mission)
    sea.divers['auv_1'] = OffByOne(mission.auvs[0], mission.region, None, 1000)
    output = sea.sail(2000)
    assert bench.agent.finished
    assert sea.divers['auv_1'].recovered is RecoveryReason.OFF_COURSE
    assert sea.divers['auv_2'].recovered is RecoveryReason.EXPLORED
    entered = {sample.cell for sample in sea.divers['auv_2'].samples}
    assert len({*PATHS['auv_1'], *entered}) == REGION.cells_total
    for returned in of(SortieReturned, events(output)):
        assert returned.duration_s <= mission.sortie_limit_s  # type: ignore[attr-defined]
