"""A sortie from its planning at C3 to the return: what was planned, and how far it has come."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import msgspec

from msgs_json.geometry import Cell
from msgs_json.messages import ExpectedContact, LegOutcome, SortieOutlook
from uav_planner.planning import SortiePlan
from uav_planner.sortie import Route, Waypoint, search_times_s, worst_case_s

if TYPE_CHECKING:
    from collections.abc import Mapping

    from msgs_json.messages import SurfacingReport
    from uav_planner.entries import Entries, Entry
    from uav_planner.fleet import Fleet
    from uav_planner.planning import MissionSpec


class PlannedSortie(msgspec.Struct, frozen=True, kw_only=True):
    """What a sortie is planned as, at C3; it stays so once it has departed."""

    number: int
    """Counted from 1."""
    plan: SortiePlan
    order: tuple[str, ...]
    """The AUVs that it goes to."""
    overlooked: frozenset[str]
    """AUVs that the one before did not reach."""
    ready_s: float
    """When it may leave as far as the one before is concerned."""


def planned_sortie(
    fleet: Fleet, number: int, overlooked: frozenset[str], ready_s: float, now_s: float
) -> PlannedSortie:
    """
    Plan a sortie.

    Raises
    ------
    ValueError
        The planner cannot plan this mission.

    """
    plan = fleet.plan_sortie(overlooked, max(ready_s, now_s))
    return PlannedSortie(
        number=number,
        plan=replace(plan, tours={}),  # they are the fleet's
        order=tuple(dict.fromkeys(waypoint.auv for waypoint in plan.route)),
        overlooked=overlooked,
        ready_s=ready_s,
    )


class Progress(msgspec.Struct, frozen=True, kw_only=True):
    """How far a sortie has come."""

    departed_s: float | None = None
    cursor: int = 0
    """Index of the waypoint flown to; past the last one it is C3."""
    listens_from_s: float | None = None
    """Since when it listens at the last waypoint of an AUV; None elsewhere."""
    missed: tuple[str, ...] = ()
    """AUVs searched to the end and not heard."""
    not_reached: tuple[str, ...] = ()
    """AUVs that it gave up reaching, to be home in time."""


class Contact(msgspec.Struct, frozen=True, kw_only=True):
    """A meeting with an AUV: when, and what it reported."""

    place: int
    """Among those of the sortie, from 0 on."""
    time_s: float
    cell: Cell
    leg_id: int
    outcome: LegOutcome


class SortieUnderway:
    """
    A sortie that is being flown, or waits at C3 for its departure.

    Parameters
    ----------
    fleet
        Whom it goes to.
    planned
        What it was planned as.
    progress, met
        How far it has come, and the AUVs that it has met; it notes here what becomes of it.

    """

    def __init__(
        self,
        fleet: Fleet,
        planned: PlannedSortie,
        progress: Entry[Progress],
        met: Entries[Contact],
    ) -> None:
        self.fleet = fleet
        self.planned = planned
        self.number = planned.number
        """Counted from 1."""
        self.order = planned.order
        """The AUVs that it goes to."""
        self.route: Route = planned.plan.route
        """All waypoints."""
        self._progress = progress
        self._met = met
        # How far it has come; told once, for they are asked for at every tick.
        self.departed_s: float | None
        """When it departed; None at C3 before that."""
        self.goes_home: bool
        """Whether nothing of the route is left but the way home."""
        self.next_waypoint: Waypoint | None
        """The waypoint that is flown to; None where that is C3."""
        self.missed: tuple[str, ...]
        """The AUVs that were searched to the end and not heard."""
        self.not_reached: tuple[str, ...]
        """The AUVs that it gave up reaching, to be home in time."""
        self._tell()

    # --- what it was planned as ------------------------------------------------------------------

    @property
    def mission(self) -> MissionSpec:
        """Return what stays the same for all sorties."""
        return self.fleet.mission

    @property
    def outlook(self) -> SortieOutlook:
        """Return what C3 may expect of it while it waits for its departure."""
        plan = self.planned.plan
        times_s = search_times_s(self.mission, plan.route, plan.depart_s)
        return SortieOutlook(
            departs_s=plan.depart_s,
            returns_by_s=plan.depart_s + plan.worst_case_s,
            contacts=tuple(
                ExpectedContact(auv=auv, time_s=time_s) for auv, time_s in times_s.items()
            ),
        )

    def worst_case_s(self, now_s: float, met: tuple[str, ...] = ()) -> float:
        """Return how long it takes at worst if it begins now, with some AUVs met at C3."""
        mission = self.mission
        rest = tuple(waypoint for waypoint in self.route if waypoint.auv not in met)
        handovers_s = len(met) * mission.handover_ticks * mission.tick_s
        return handovers_s + worst_case_s(mission, rest, now_s + handovers_s)

    # --- how far it has come ---------------------------------------------------------------------

    @property
    def back_by_s(self) -> float:
        """Return when it has to be back at C3 to keep L; infinite before it has departed."""
        return (
            math.inf if self.departed_s is None else self.departed_s + self.mission.sortie_limit_s
        )

    @property
    def is_last_of_its_auv(self) -> bool:
        """Return whether the AUV of the next waypoint is searched from no other one after it."""
        here, *after = self.route[self._progress.value.cursor :][:2]
        return not after or after[0].auv != here.auv

    @property
    def rest(self) -> Route:
        """Return what is left of the route, without the AUVs that were met."""
        cursor = self._progress.value.cursor
        return tuple(each for each in self.route[cursor:] if each.auv not in self._met)

    @property
    def met(self) -> Mapping[str, Contact]:
        """Return the meetings by AUV, in any order."""
        return self._met

    @property
    def meetings(self) -> list[tuple[str, Contact]]:
        """Return the AUVs that it has met with their meetings, one after another."""
        return sorted(self._met.items(), key=lambda meeting: meeting[1].place)

    @property
    def turn(self) -> str | None:
        """Return the AUV to be met next; None when only the way home is left."""
        for auv in self.order:
            if auv not in self._met and auv not in self.missed:
                return auv
        return None

    @property
    def to_meet(self) -> frozenset[str]:
        """Return the AUVs that may still be met, as far as the sortie is concerned."""
        return frozenset(self.order) - self._met.keys() - frozenset(self.not_reached)

    # --- what becomes of it ----------------------------------------------------------------------

    def depart(self, now_s: float) -> None:
        """Note the departure."""
        self._note(departed_s=now_s)

    def go_on(self) -> None:
        """Note that a waypoint is done with."""
        self._note(cursor=self._progress.value.cursor + 1, listens_from_s=None)

    def listened_from_s(self, now_s: float) -> float:
        """Return since when the UAV has listened at the waypoint: since now, the first time."""
        from_s = self._progress.value.listens_from_s
        if from_s is None:
            self._note(listens_from_s=now_s)
        return now_s if from_s is None else from_s

    def meet(self, report: SurfacingReport, now_s: float) -> None:
        """Note that an AUV was met."""
        self._met[report.auv] = Contact(
            place=len(self._met),
            time_s=now_s,
            cell=report.cell,
            leg_id=report.leg_id,
            outcome=report.outcome,
        )
        self._note(missed=tuple(auv for auv in self.missed if auv != report.auv))

    def miss(self, auv: str) -> None:
        """Note that an AUV was searched to the end and not heard."""
        self._note(missed=(*self.missed, auv))

    def turn_home(self) -> None:
        """Give up reaching whoever is left."""
        not_reached = tuple(dict.fromkeys(waypoint.auv for waypoint in self.rest))
        self._note(not_reached=not_reached, cursor=len(self.route))

    def _note(self, **changes: object) -> None:
        self._progress.value = msgspec.structs.replace(self._progress.value, **changes)
        self._tell()

    def _tell(self) -> None:
        progress, route = self._progress.value, self.route
        self.departed_s = progress.departed_s
        self.missed, self.not_reached = progress.missed, progress.not_reached
        self.goes_home = progress.cursor == len(route)
        self.next_waypoint = None if self.goes_home else route[progress.cursor]
