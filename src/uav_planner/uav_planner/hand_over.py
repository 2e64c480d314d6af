"""The hand-over at the end of a leg: the AUV's report is checked and answered until that ends."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from msgs_json.geometry import Cell
from msgs_json.messages import Acknowledged, Acknowledgement, RecoveryReason
from uav_planner.planning import PlanResult

if TYPE_CHECKING:
    from msgs_json.messages import Leg, SurfacingReport

HAND_OVER_TICKS = 5
"""
How long the UAV stays for an AUV's answer to its next path before it flies on.

Without loss the answer comes within the tick. Else every tick is one more chance to be heard, but
not for ever: an AUV that took its path is under water, and if its answer was lost none will come.
"""


DATA_SHARE = 0.5
"""
Of the time of a hand-over; after that the AUV gets its path, whatever data it still has.

What did not get across goes on at the next contact, but an AUV without a path is idle till then.
"""

CONTRADICTIONS_MAX = 3
"""
So many reports in a row, each of another tick, that contradict its leg put an AUV off course.

One may be a late copy, or a slip; an AUV that keeps to it is not where it believes to be.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class HandOver:
    """What an AUV is told after a leg, until it has acknowledged that."""

    ended_leg_id: int
    ended_at: Cell
    """The last cell it entered."""
    plan: PlanResult | None
    """Its next path; None where it is to stay up for recovery."""
    reason: RecoveryReason
    """Why, if it is."""
    way_m: float
    """From where it lies through that path."""
    begun_s: float
    samples_taken: int
    """How many samples the AUV has taken in all its legs."""

    def answers(self, report: SurfacingReport) -> bool:
        """Return whether a report is of the leg after which the AUV was told this."""
        return report.leg_id == self.ended_leg_id

    def problem_with(self, report: SurfacingReport) -> str | None:
        """Return what contradicts the report after which the AUV was told this, or None."""
        if report.cell != self.ended_at:
            return (
                f'leg {self.ended_leg_id} ended at cell {list(self.ended_at)},'
                f' cell is now {list(report.cell)}'
            )
        return None

    def is_taken_by(self, report: SurfacingReport) -> bool:
        """Return whether a report shows that the AUV has taken its next path."""
        return self.plan is not None and report.leg_id == self.ended_leg_id + 1

    def called_off(self) -> HandOver:
        """Return it without the path, for an AUV that asks for help instead of taking it."""
        return replace(self, plan=None, reason=RecoveryReason.ABORTED)

    @property
    def acknowledgement(self) -> Acknowledgement:
        """Return the answer that ends it."""
        if self.plan is None:
            return Acknowledgement(
                acknowledges=Acknowledged.RECOVERY_ORDER, reference=self.ended_leg_id
            )
        return Acknowledgement(
            acknowledges=Acknowledged.PATH_ASSIGNMENT, reference=self.ended_leg_id + 1
        )


def problem_with_report(report: SurfacingReport, leg: Leg) -> str | None:
    """Return what contradicts the leg that was handed over, or None."""
    if report.leg_id != leg.leg_id:
        return f'leg_id must be {leg.leg_id}, is {report.leg_id}'
    if report.moves_done >= len(leg.path):
        return f'moves_done must be 0 ... {len(leg.path) - 1}, is {report.moves_done}'
    if report.cell != leg.path[report.moves_done]:
        return (
            f'after {report.moves_done} moves cell must be {list(leg.path[report.moves_done])},'
            f' is {list(report.cell)}'
        )
    return None
