"""The AUVs as the UAV knows them: what they were told, and what they have surveyed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import msgspec
from msgspec import structs

from msgs_json.agent import Output, Transmit
from msgs_json.geometry import Cell, Point, is_before, path_length_m, surface_deadline_s
from msgs_json.messages import (
    Acknowledgement,
    Leg,
    LegOutcome,
    PathAssignment,
    RecoveryOrder,
    RecoveryReason,
    SurfacingReport,
)
from uav_planner.entries import Entries, Entry
from uav_planner.exploration_map import ExplorationMap, MapRow
from uav_planner.hand_over import (
    CONTRADICTIONS_MAX,
    DATA_SHARE,
    HAND_OVER_TICKS,
    HandOver,
    problem_with_report,
)
from uav_planner.planning import (
    MissionSpec,
    Planner,
    PlanRequest,
    PlanResult,
    Prospect,
    SortieRequest,
    SurveyLeg,
)
from uav_planner.sortie import searches_of

if TYPE_CHECKING:
    from collections.abc import Container, Iterator

    from msgs_json.messages import Directive, MissionOrder
    from msgs_json.store import Store
    from uav_planner.planning import SortiePlan


_AUV, _HAND_OVER, _TOUR, _MAP_ROW, _VISITING = 'auv', 'hand_over', 'tour', 'map_row', 'visiting'
"""Kinds of entries of the store: by AUV, but for the map's, which are by row."""


class _Auv(msgspec.Struct, frozen=True, kw_only=True):
    """What the UAV knows of an AUV."""

    speed_mps: float
    leg: Leg
    """The last one it was given."""
    claimed: tuple[Cell, ...] = ()
    """Cells of that leg's path that count as visited on the map, though not reported yet."""
    behind: Cell | None = None
    """The neighbour of the leg's first cell toward which it began."""
    search: tuple[Point, ...] = ()
    """The waypoints from which the leg is searched."""
    searches_in_vain: int = 0
    """Since it was last met."""
    recovered: bool = False
    lost: bool = False
    contradictions: int = 0
    """Reports in a row that contradict its leg."""
    contradicted_s: float = -1.0
    """When the last of them was heard."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Encounter:
    """What came of meeting an AUV."""

    plan: PlanResult | None
    """Its next path; None where it is to stay up for recovery."""
    was_lost: bool
    """Whether it had been given up."""


class Fleet:
    """
    The AUVs of a mission: the leg and the hand-over of each, and the map of their survey.

    It knows nothing of the UAV's flight, only whom a sortie still goes to where it is told.

    Parameters
    ----------
    order
        The AUVs with their first legs, which count as told and taken.
    mission
        What the order means for planners.
    planner
        Chooses their next paths.

    """

    def __init__(self, order: MissionOrder, mission: MissionSpec, planner: Planner) -> None:
        self.names = frozenset(auv.name for auv in order.auvs)
        self.mission = mission
        self.ordered_region = order.region
        """Samples may be of any of its cells, whatever the operator has masked since."""
        self._planner = planner
        self._lost_after_sorties = order.lost_after_sorties
        self._patience_s = max(HAND_OVER_TICKS * mission.tick_s, mission.handover_s)
        self._map = ExplorationMap(order.region, [auv.leg.path[0] for auv in order.auvs])
        self._auvs: Entries[_Auv] = Entries(_AUV)
        for auv in order.auvs:
            self._auvs[auv.name] = _Auv(speed_mps=auv.speed_mps, leg=auv.leg)
            self._claim(auv.name, auv.leg.path)
        self._visiting = Entry(_VISITING, tuple(auv.name for auv in order.auvs))
        self._hand_overs: Entries[HandOver] = Entries(_HAND_OVER)
        """By AUV, until it acknowledges or reports from its next leg."""
        self._tours: Entries[tuple[Cell, ...]] = Entries(_TOUR)
        self.kept = (self._auvs, self._visiting, self._hand_overs, self._tours)
        """What is to be saved, beside the map."""
        self._recalled: frozenset[str] = frozenset()

    def load(self, store: Store) -> None:
        """Know again what the fleet of the same order had stored."""
        self._auvs.load(store, _Auv)
        self._visiting.load(store, tuple[str, ...])
        self._hand_overs.load(store, HandOver)
        self._tours.load(store, tuple[Cell, ...])
        rows = store.load(_MAP_ROW, MapRow)
        self._map.recall({int(row): known for row, known in rows.items()})

    def save_map(self, store: Store) -> None:
        """Put what has changed on the map since the last time."""
        for row, known in self._map.changed_rows().items():
            store.put(_MAP_ROW, str(row), known)

    # --- what the operator wants -----------------------------------------------------------------

    def direct(self, directive: Directive) -> None:
        """Fly as the operator wants from now on; what can be flown is in `directives`."""
        grid = structs.replace(self.mission.grid, masked=directive.masked)
        if grid != self.mission.grid:
            self._map = self._map.of_region(grid)
            self._tours.clear()  # they may lead through what is masked now
        self.mission = replace(self.mission, grid=grid, sortie_limit_s=directive.sortie_limit_s)
        self._recalled = frozenset(directive.recalled)

    def planner_problem(self, masked: tuple[Cell, ...], now_s: float) -> str | None:
        """Return why the planner cannot plan with these cells masked, or None."""
        grid = structs.replace(self.mission.grid, masked=masked)
        request = replace(
            self._sortie_request(frozenset(), now_s),
            mission=replace(self.mission, grid=grid),
            values=self._map.of_region(grid).values,
            tours={},
        )
        try:
            self._planner.plan_sortie(request)
        except ValueError as error:
            return str(error)
        return None

    # --- who and where ---------------------------------------------------------------------------

    @property
    def visiting_order(self) -> tuple[str, ...]:
        """Return all AUVs in the order in which sorties go to them."""
        return self._visiting.value

    @property
    def lost(self) -> tuple[str, ...]:
        """Return the AUVs that are given up and were not heard since."""
        return tuple(name for name in self.visiting_order if self._auvs[name].lost)

    def next_leg(self, name: str) -> Leg | None:
        """Return the last leg an AUV was given; None when it was told to stay up for recovery."""
        auv = self._auvs[name]
        return None if auv.recovered else auv.leg

    def survey_legs(self, to_meet: Container[str] = ()) -> tuple[SurveyLeg, ...]:
        """Return the legs of all who survey, some of whom a sortie is still to meet."""
        return tuple(leg for leg in self._legs_out(to_meet) if not self._auvs[leg.auv].lost)

    @property
    def legs_out(self) -> tuple[SurveyLeg, ...]:
        """Return the legs of all who were not told to stay up; the lost may be heard again."""
        return tuple(self._legs_out(()))

    def _legs_out(self, to_meet: Container[str]) -> Iterator[SurveyLeg]:
        for name in self.visiting_order:
            if not self._auvs[name].recovered:
                yield self._survey_leg(name, to_meet)

    def _survey_leg(self, name: str, to_meet: Container[str]) -> SurveyLeg:
        auv = self._auvs[name]
        return SurveyLeg(
            auv=name,
            path=auv.leg.path,
            surface_deadline_s=auv.leg.surface_deadline_s,
            behind=auv.behind,
            search=auv.search,
            prospect=self._prospect(name, to_meet),
            speed_mps=auv.speed_mps,
        )

    def _prospect(self, name: str, to_meet: Container[str]) -> Prospect:
        if self._auvs[name].searches_in_vain > 0:
            return Prospect.ASTRAY
        # One that did not confirm its path will be told the same again.
        is_told = name in self._hand_overs
        return Prospect.ENDS if name in to_meet and not is_told else Prospect.STAYS

    # --- searches --------------------------------------------------------------------------------

    def plan_sortie(self, overlooked: frozenset[str], now_s: float) -> SortiePlan:
        """
        Return the next sortie and note from where it searches the legs of those it goes to.

        Raises
        ------
        ValueError
            The planner cannot plan this mission.

        """
        plan = self._planner.plan_sortie(self._sortie_request(overlooked, now_s))
        self._tours.become(plan.tours)
        for name, search in searches_of(plan.route).items():
            self._change(name, search=search)
        return plan

    def look_ahead(self, now_s: float) -> Iterator[float]:
        """Let the planner plan the whole mission; yield the share that is done, slice by slice."""
        for ahead in self._planner.look_ahead(self._sortie_request(frozenset(), now_s)):
            self._tours.become(ahead.tours)
            if ahead.visiting_order not in ((), self.visiting_order):
                self._visiting.value = ahead.visiting_order
                for name in ahead.visiting_order:
                    self._change(name, search=())  # to be laid along the new round
            yield ahead.share

    def _sortie_request(self, overlooked: frozenset[str], now_s: float) -> SortieRequest:
        return SortieRequest(
            mission=self.mission,
            legs=self.survey_legs(),
            overlooked=overlooked,
            now_s=now_s,
            values=self._map.values,
            tours=dict(self._tours),
        )

    def searched_in_vain(self, name: str) -> bool:
        """Count a search of an AUV; return whether it is given up, after so many."""
        searches_in_vain = self._auvs[name].searches_in_vain + 1
        is_lost = searches_in_vain >= self._lost_after_sorties
        self._change(name, searches_in_vain=searches_in_vain, lost=is_lost)
        if is_lost:
            self._release(name)
        return is_lost

    # --- a meeting -------------------------------------------------------------------------------

    def heard(self, report: SurfacingReport) -> None:
        """Note what a report tells of the hand-over under way, in turn or not."""
        hand_over = self._hand_overs.get(report.auv)
        if hand_over is None or hand_over.plan is None:
            return
        if hand_over.is_taken_by(report):
            del self._hand_overs[report.auv]  # it speaks of its next leg
        elif report.outcome is LegOutcome.ABORTED and hand_over.answers(report):
            self._release(report.auv)
            self._hand_overs[report.auv] = hand_over.called_off()

    def problem_with(self, report: SurfacingReport) -> str | None:
        """Return what contradicts the leg that its AUV was given, or None."""
        unanswered = self.hand_over(report)
        if unanswered is not None:
            return unanswered.problem_with(report)
        return problem_with_report(report, self._auvs[report.auv].leg)

    def meet(
        self, report: SurfacingReport, to_meet: Container[str], position: Point, now_s: float
    ) -> Encounter:
        """
        Note what an AUV did and choose its next path, or the same again if it lies there yet.

        ``to_meet`` are the AUVs that the sortie may still meet, this one included; ``position`` is
        where the UAV is.
        """
        before = self._auvs[report.auv]
        was_astray = before.searches_in_vain > 0
        self._change(report.auv, lost=False, searches_in_vain=0, contradictions=0)
        unanswered = self.hand_over(report)
        if unanswered is None:
            self._note_visits(report)
        plan = unanswered.plan if unanswered else None
        # The same path again, unless the others were given theirs without a thought of it, or it
        # is to have none.
        if plan is None or was_astray or report.auv in self._recalled:
            self._release(report.auv)
            plan = self._plan_path(report, to_meet, position, now_s)
        self._begin_hand_over(report, plan, self._reason_to_recover(report), now_s)
        return Encounter(plan=plan, was_lost=before.lost)

    def is_off_course(self, report: SurfacingReport, now_s: float) -> bool:
        """
        Note a report that contradicts its AUV's leg; return whether there were enough of them.

        One of the leg before is a late copy, and says nothing.
        """
        auv = self._auvs[report.auv]
        if report.leg_id == auv.leg.leg_id - 1 or auv.contradicted_s == now_s:
            return False
        contradictions = auv.contradictions + 1
        self._change(report.auv, contradictions=contradictions, contradicted_s=now_s)
        return contradictions >= CONTRADICTIONS_MAX

    def take_off_course(self, report: SurfacingReport, now_s: float) -> Encounter:
        """Have an AUV stay up for recovery: nobody knows where it has been, or where it is."""
        was_lost = self._auvs[report.auv].lost
        self._change(report.auv, lost=False, searches_in_vain=0)
        self._release(report.auv)
        self._begin_hand_over(report, None, RecoveryReason.OFF_COURSE, now_s)
        return Encounter(plan=None, was_lost=was_lost)

    def _note_visits(self, report: SurfacingReport) -> None:
        """Note on the map what an AUV really visited."""
        path = self._auvs[report.auv].leg.path[: report.moves_done + 1]
        self._claim(report.auv, path)
        self._map.confirm(path[1:])
        self._change(report.auv, claimed=())  # they stay visited

    def _begin_hand_over(
        self,
        report: SurfacingReport,
        plan: PlanResult | None,
        reason: RecoveryReason,
        now_s: float,
    ) -> None:
        path = plan.path if plan else ()
        way = [report.position, *(self.mission.grid.centre(cell) for cell in path)]
        self._hand_overs[report.auv] = HandOver(
            ended_leg_id=report.leg_id,
            ended_at=report.cell,
            plan=replace(plan, tours={}) if plan else None,
            reason=reason,
            way_m=path_length_m(way),
            begun_s=now_s,
            samples_taken=report.samples_taken,
        )
        if plan is not None:
            self._set_leg(report.auv, plan, now_s)

    def _set_leg(self, name: str, plan: PlanResult, now_s: float) -> None:
        """Give an AUV its next leg, as if it began now."""
        hand_over = self._hand_overs[name]
        surface_s = surface_deadline_s(
            now_s,
            hand_over.way_m,
            self._auvs[name].speed_mps,
            self.mission.surface_margin_s,
            self.mission.tick_s,
        )
        leg = Leg(leg_id=hand_over.ended_leg_id + 1, path=plan.path, surface_deadline_s=surface_s)
        self._change(name, leg=leg)

    def _plan_path(
        self, report: SurfacingReport, to_meet: Container[str], position: Point, now_s: float
    ) -> PlanResult | None:
        """Return an AUV's next path, already noted on the map; None where none is needed."""
        is_wanted = report.outcome is not LegOutcome.ABORTED and report.auv not in self._recalled
        # What it cannot get to is for others to survey, or for nobody.
        within_reach = self.mission.grid.part_of(report.cell)
        if self._map.is_explored(within_reach) or not is_wanted:
            return None
        behind = self._behind(report)
        plan = self._planner.plan_path(
            PlanRequest(
                mission=self.mission,
                values=self._map.values,
                auv=report.auv,
                cell=report.cell,
                behind=behind,
                legs=self.survey_legs(to_meet),
                now_s=now_s,
                position=position,
                tours=dict(self._tours),
            )
        )
        self._tours.become(plan.tours)
        self._claim(report.auv, plan.path)
        self._change(report.auv, behind=behind, search=plan.search)
        return plan

    def _reason_to_recover(self, report: SurfacingReport) -> RecoveryReason:
        if report.outcome is LegOutcome.ABORTED:
            return RecoveryReason.ABORTED
        if report.auv in self._recalled:
            return RecoveryReason.RECALLED
        return RecoveryReason.EXPLORED

    def _behind(self, report: SurfacingReport) -> Cell | None:
        """
        Return the cell of its leg toward which an AUV lies off the last one that it entered.

        No other one, however its position says: what it was promised was for its leg.
        """
        auv, moves = self._auvs[report.auv], report.moves_done
        if self.hand_over(report):
            return auv.behind  # it lies where it did when that was found out
        before = auv.leg.path[moves - 1] if moves > 0 else auv.behind
        beside = (before, *auv.leg.path[moves + 1 : moves + 2])
        return self.mission.grid.neighbour_toward(
            report.cell, report.position, [cell for cell in beside if cell is not None]
        )

    def hand_over(self, report: SurfacingReport) -> HandOver | None:
        """Return what this leg's end was answered with, if the AUV has not acknowledged it."""
        hand_over = self._hand_overs.get(report.auv)
        return hand_over if hand_over is not None and hand_over.answers(report) else None

    def hand_over_to(self, name: str) -> HandOver | None:
        """Return what an AUV was told and has not acknowledged."""
        return self._hand_overs.get(name)

    def is_time_for_data(self, name: str, now_s: float) -> bool:
        """Return whether an AUV that is met may go on to hand over data before it is told more."""
        hand_over = self._hand_overs.get(name)
        return hand_over is not None and is_before(
            now_s, hand_over.begun_s + DATA_SHARE * self._patience_s
        )

    def answer(self, name: str, now_s: float) -> list[Output]:
        """
        Say what comes next to an AUV that has not acknowledged that.

        Said again, the deadline counts from then.
        """
        hand_over = self._hand_overs.get(name)
        if hand_over is None:
            return []
        if hand_over.plan is None:
            self._change(name, recovered=True)
            order = RecoveryOrder(auv=name, leg_id=hand_over.ended_leg_id, reason=hand_over.reason)
            return [Transmit(name, order)]
        self._set_leg(name, hand_over.plan, now_s)
        return [Transmit(name, PathAssignment(auv=name, leg=self._auvs[name].leg))]

    def acknowledged(self, name: str, message: Acknowledgement) -> None:
        """Take an AUV's answer; one to something else says nothing."""
        hand_over = self._hand_overs.get(name)
        if hand_over is not None and message == hand_over.acknowledgement:
            del self._hand_overs[name]

    def is_awaiting(self, met: Container[str], now_s: float) -> bool:
        """Return whether the answer of an AUV just met may still come."""
        return any(
            name in met and is_before(now_s, hand_over.begun_s + self._patience_s)
            for name, hand_over in self._hand_overs.items()
        )

    # --- the map ---------------------------------------------------------------------------------

    def _claim(self, name: str, path: tuple[Cell, ...]) -> None:
        """Let an AUV's path count as visited on the map, instead of what it claimed before."""
        self._release(name)
        self._map.assign(path)
        self._change(name, claimed=path[1:])

    def _release(self, name: str) -> None:
        """Take back what an AUV claims, if it still does: its cells are for others, too."""
        self._map.restore(self._auvs[name].claimed)
        self._change(name, claimed=())

    def _change(self, name: str, **changes: object) -> None:
        """Know something else of an AUV from now on."""
        self._auvs[name] = structs.replace(self._auvs[name], **changes)
