"""Meetings with AUVs: who is met when it is heard, what is taken from it, what it is answered."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

from msgs_json.agent import Log, Output, Refuse, Transmit
from msgs_json.codec import Refusal
from msgs_json.geometry import is_before
from msgs_json.messages import HeardAgain, Met, RecoveryReason, SurfacingReport
from uav_planner.entries import Entries
from uav_planner.sample_intake import SampleIntake

if TYPE_CHECKING:
    from msgs_json.custody import SampleCustody
    from msgs_json.messages import SampleBatch
    from msgs_json.store import Store
    from uav_planner.directives import StandingDirective
    from uav_planner.fleet import Encounter, Fleet
    from uav_planner.flight import Flight
    from uav_planner.hand_over import HandOver
    from uav_planner.sortie_underway import SortieUnderway

_WAITING, _ANSWERED = 'waiting', 'answered'
"""Kinds of entries of the store, by AUV."""


class _Waiting(msgspec.Struct, frozen=True, kw_only=True):
    """What an AUV said whose turn it was not."""

    heard_s: float
    report: SurfacingReport


class _Answered(msgspec.Struct, frozen=True, kw_only=True):
    """That an AUV was answered: within a tick more than that is said only of what is new."""

    at_s: float
    says_next: bool
    """Whether it was told what comes next."""
    is_owed: bool = False
    """Whether more of its data has come since."""


class Meetings:
    """
    What the UAV says to AUVs that it hears.

    Parameters
    ----------
    fleet
        Chooses what comes next.
    flight
        Where the UAV is, and in which sortie.
    directive
        Whether it was called home.
    store
        Keeps what is noted here.
    custody
        Keeps the samples.
    guarantees_limit
        Whether the planner does.

    """

    def __init__(
        self,
        fleet: Fleet,
        flight: Flight,
        directive: StandingDirective,
        store: Store,
        custody: SampleCustody,
        *,
        guarantees_limit: bool,
    ) -> None:
        self._fleet = fleet
        self._flight = flight
        self._directive = directive
        self._custody = custody
        self._intake = SampleIntake(store, custody)
        self._guarantees_limit = guarantees_limit
        self._waiting: Entries[_Waiting] = Entries(_WAITING)
        self._waiting.load(store, _Waiting)
        self._answered: Entries[_Answered] = Entries(_ANSWERED)
        self._answered.load(store, _Answered)
        self.kept = (self._waiting, self._answered)
        """What is to be saved."""

    def hear(self, report: SurfacingReport) -> list[Output]:
        """Meet an AUV that is heard, go on with its hand-over, or let it wait for its turn."""
        sortie, auv = self._flight.sortie, report.auv
        self._fleet.heard(report)
        if self._is_met(auv):
            return self._go_on(report)
        if sortie is None:
            return []
        if self._may_meet(sortie, auv):
            return self._meet(sortie, report)
        self._waiting[auv] = _Waiting(heard_s=self._flight.now_s, report=report)
        return []

    def take_samples(self, auv: str, batch: SampleBatch) -> list[Output]:
        """Take over data that did not fit into a report."""
        refused = self._intake.take(auv, batch.samples, self._fleet.ordered_region)
        answer = self._answer(auv)
        if not answer:
            self._answered[auv] = msgspec.structs.replace(self._answered[auv], is_owed=True)
        return [*refused, *answer]

    def answer_owed(self) -> list[Output]:
        """Answer the data that has come since its AUV was answered."""
        owed = sorted(auv for auv, answered in self._answered.items() if answered.is_owed)
        return [each for auv in owed for each in self._answer(auv)]

    # --- who is met ------------------------------------------------------------------------------

    def _is_met(self, auv: str) -> bool:
        """Return whether this sortie has met an AUV, or one has told it to stay up."""
        sortie = self._flight.sortie
        is_recovered = self._fleet.next_leg(auv) is None
        return is_recovered or (sortie is not None and auv in sortie.met)

    def _may_meet(self, sortie: SortieUnderway, auv: str) -> bool:
        """Return whether an AUV that is heard is met now."""
        if self._directive.is_called_home:
            return False
        is_in_the_air = sortie.departed_s is not None
        if not is_in_the_air and not self._directive.may_depart:
            return False
        if not self._guarantees_limit:
            return auv == sortie.turn or auv in self._fleet.lost
        if is_in_the_air:
            return True
        # To meet it at C3 starts the sortie: only if what remains then still keeps L.
        needed_s = sortie.worst_case_s(self._flight.now_s, (auv,))
        return not is_before(sortie.mission.sortie_limit_s, needed_s)

    def _meet(self, sortie: SortieUnderway, report: SurfacingReport) -> list[Output]:
        fleet, auv, now_s = self._fleet, report.auv, self._flight.now_s
        output: list[Output] = []
        problem = fleet.problem_with(report)
        if problem:
            output.append(Refuse(auv, Refusal.CONTRADICTORY, problem))
            if not fleet.is_off_course(report, now_s):
                return output
            encounter = fleet.take_off_course(report, now_s)
        else:
            position = self._flight.position or fleet.mission.c3
            encounter = fleet.meet(report, sortie.to_meet, position, now_s)
        output += self._intake.take(auv, report.samples, fleet.ordered_region)
        if sortie.departed_s is None:
            output += self._flight.depart(sortie, met=(auv,))
        if encounter.was_lost:
            output.append(Log(HeardAgain(auv=auv), now_s))
        sortie.meet(report, now_s)
        output += [Log(_met(sortie, report, encounter), now_s), *self._answer(auv)]
        waiting = self._waiting.pop(sortie.turn or '', None)
        # What was said at an earlier tick is out of date.
        is_fresh = waiting is not None and waiting.heard_s == now_s
        return output + self.hear(waiting.report) if waiting and is_fresh else output

    def _go_on(self, report: SurfacingReport) -> list[Output]:
        """Go on with the hand-over to an AUV that was met and is still there."""
        if self._fleet.hand_over(report) is None:
            return []
        refused = self._intake.take(report.auv, report.samples, self._fleet.ordered_region)
        return [*refused, *self._answer(report.auv)]

    # --- what it is answered ---------------------------------------------------------------------

    def _answer(self, auv: str) -> list[Output]:
        """
        Say which samples are held; when no more are to come, or time is up, what is next.

        Once a tick, and once more when only then it is time for what is next.
        """
        now_s, says_next = self._flight.now_s, self._says_next(auv)
        before = self._answered.get(auv)
        if before is not None and before.at_s == now_s and before.says_next >= says_next:
            return []
        self._answered[auv] = _Answered(at_s=now_s, says_next=says_next)
        receipt = Transmit(auv, self._custody.receipt(auv))
        return [receipt, *self._fleet.answer(auv, now_s)] if says_next else [receipt]

    def _says_next(self, auv: str) -> bool:
        """Return whether an AUV is to be told now what comes next."""
        hand_over = self._fleet.hand_over_to(auv)
        if hand_over is None or not self._is_met(auv):
            # What comes from others was on the air when that sortie ended: to be told its path
            # now, by a later deadline than the next one is planned with, it must be met again.
            return False
        if self._directive.is_called_home and hand_over.plan is not None:
            return False  # it waits where it lies, like those who are not met any more
        has_all = self._intake.has_all(auv, hand_over.samples_taken)
        return has_all or not self._waits_for_data(hand_over, auv)

    def _waits_for_data(self, hand_over: HandOver, auv: str) -> bool:
        """Return whether an AUV is to hand over more data before it is told what comes next."""
        if hand_over.plan is None:
            # It stays here anyway; but who knows what an AUV that is off course has measured.
            return hand_over.reason is not RecoveryReason.OFF_COURSE
        sortie, position = self._flight.sortie, self._flight.position
        may_stay = (
            sortie is None or position is None or self._flight.awaits_answer(sortie, position)
        )
        return may_stay and self._fleet.is_time_for_data(auv, self._flight.now_s)


def _met(sortie: SortieUnderway, report: SurfacingReport, encounter: Encounter) -> Met:
    plan = encounter.plan
    return Met(
        sortie=sortie.number,
        auv=report.auv,
        cell=report.cell,
        leg_id=report.leg_id,
        path=plan.path if plan else (),
        slack_s=plan.slack_s if plan else None,
        sortie_time_s=plan.sortie_time_s if plan else None,
        plan_status=plan.status.value if plan else None,
    )
