"""The UAV's flight: sorties from departure to return, and the way home in time."""

from __future__ import annotations

from typing import TYPE_CHECKING

from msgs_json.agent import Log, Output, Publish
from msgs_json.geometry import Point, is_before, whole_ticks, within_range
from msgs_json.messages import (
    GivenUp,
    Meeting,
    Missed,
    SearchBrokenOff,
    SortieDeparted,
    SortieReport,
    SortieReturned,
)
from msgs_json.ros_messages import TrackPath
from msgs_json.topics import ROUTE
from uav_planner.entries import Entries, Entry
from uav_planner.headway import Headway
from uav_planner.planning import Prospect
from uav_planner.sortie import worst_case_s
from uav_planner.sortie_underway import (
    Contact,
    PlannedSortie,
    Progress,
    SortieUnderway,
    planned_sortie,
)

if TYPE_CHECKING:
    from msgs_json.drivers import UavDriver, VehicleState
    from msgs_json.store import Store
    from uav_planner.deliveries import Deliveries
    from uav_planner.directives import StandingDirective
    from uav_planner.fleet import Fleet
    from uav_planner.mission_order import UavSetup
    from uav_planner.planning import MissionSpec

_SORTIE, _PROGRESS, _MET, _HEADWAY, _TICK = 'sortie', 'progress', 'met', 'headway', 'tick'
"""Kinds of entries of the store."""


class Flight:
    """
    Where the UAV is, and the sortie that it flies or waits for.

    Parameters
    ----------
    setup
        What it knows before it gets its order.
    driver
        Its vehicle.
    directive
        Whether a sortie may depart.
    deliveries
        Take the report of a sortie that is over.
    guarantees_limit
        Whether its planner does.

    """

    def __init__(
        self,
        setup: UavSetup,
        driver: UavDriver,
        directive: StandingDirective,
        deliveries: Deliveries,
        *,
        guarantees_limit: bool,
    ) -> None:
        self.now_s = 0.0
        self.position: Point | None = None
        """None before the first tick, and before the vehicle was asked after a restart."""
        self.sortie: SortieUnderway | None = None
        """The one being flown, or waiting at C3 for its departure."""
        self._setup = setup
        self._driver = driver
        self._directive = directive
        self._deliveries = deliveries
        self._guarantees_limit = guarantees_limit
        self._headway = Headway(setup.speed_mps * setup.tick_s)
        self._planned: Entries[PlannedSortie] = Entries(_SORTIE)
        """One, or none."""
        self._progress = Entry(_PROGRESS, Progress())
        self._met: Entries[Contact] = Entries(_MET)
        self._kept_headway = Entry(_HEADWAY, (0.0, 0.0))
        self.kept = (self._planned, self._progress, self._met, self._kept_headway)
        """What is to be saved, and with it the time."""

    def load(self, store: Store, fleet: Fleet) -> None:
        """Go on where a process before this one left off."""
        self._planned.load(store, PlannedSortie)
        self._progress.load(store, Progress)
        self._met.load(store, Contact)
        self._kept_headway.load(store, tuple[float, float])
        self._headway = Headway(
            self._setup.speed_mps * self._setup.tick_s, *self._kept_headway.value
        )
        for planned in self._planned.values():
            self.sortie = SortieUnderway(fleet, planned, self._progress, self._met)
        self.now_s = store.load(_TICK, float)['']

    def save_time(self, store: Store) -> None:
        """Put the time of the last tick; the shell's is that of any input, between two as well."""
        store.put(_TICK, '', self.now_s)

    # --- where it is -----------------------------------------------------------------------------

    @property
    def is_on_ground(self) -> bool:
        """Return whether it is at C3, and not in a sortie."""
        return self.sortie is None or self.sortie.departed_s is None

    @property
    def has_departed(self) -> bool:
        """Return whether any sortie has."""
        return not self.is_on_ground or self.sortie is None or self.sortie.number > 1

    def look(self, at_s: float) -> None:
        """Learn where the vehicle is that a process before this one has sent somewhere."""
        if self.position is None:
            self.now_s, self.position = at_s, self._driver.step(at_s).position

    def fly(self, now_s: float, target: Point | None) -> VehicleState:
        """Let the vehicle fly; ``target`` is where it was sent in this tick, if it was."""
        state = self._driver.step(now_s)
        is_next_tick = now_s - self.now_s < 1.5 * self._setup.tick_s
        if target is not None and self.position is not None and is_next_tick:
            self._headway.note(self.position, state.position, target)
            self._kept_headway.value = (self._headway.known_m, self._headway.difference_m)
        self.now_s, self.position = now_s, state.position
        return state

    def reaches_c3(self, mission: MissionSpec) -> bool:
        """Return whether C3 is within radio range, as far as the UAV knows."""
        if self.position is None:
            return False
        range_m = mission.radio_range_m + self._setup.short_of_range_m
        return within_range(self.position.distance_m(mission.c3), range_m)

    # --- the next sortie -------------------------------------------------------------------------

    def plan(self, fleet: Fleet) -> None:
        """
        Plan the first sortie.

        Raises
        ------
        ValueError
            The planner cannot plan this mission.

        """
        self._begin(fleet, planned_sortie(fleet, 1, frozenset(), self.now_s, self.now_s))

    def plan_anew(self, sortie: SortieUnderway) -> None:
        """Plan a sortie again that has not departed."""
        before = sortie.planned
        planned = planned_sortie(
            sortie.fleet, before.number, before.overlooked, before.ready_s, self.now_s
        )
        self._begin(sortie.fleet, planned)

    def _begin(self, fleet: Fleet, planned: PlannedSortie | None) -> None:
        """Wait for the departure of a sortie, if there is another one."""
        self._planned.become({str(planned.number): planned} if planned else {})
        self._progress.value = Progress()
        self._met.clear()
        self.sortie = (
            SortieUnderway(fleet, planned, self._progress, self._met) if planned else None
        )

    def _following(
        self, sortie: SortieUnderway, overlooked: tuple[str, ...]
    ) -> PlannedSortie | None:
        """Return the sortie after one that is over; None where nobody is left to be met."""
        fleet, ready_s = sortie.fleet, self.now_s
        legs = fleet.survey_legs()
        if not legs:
            return None
        if all(leg.prospect is Prospect.ASTRAY for leg in legs):
            # To search them again at once would tell nothing new, and soon give them up.
            ready_s = max(ready_s, sortie.back_by_s)
        return planned_sortie(fleet, sortie.number + 1, frozenset(overlooked), ready_s, self.now_s)

    def depart(self, sortie: SortieUnderway, met: tuple[str, ...] = ()) -> list[Output]:
        """Begin a sortie, at the time to leave or with an AUV that is met at C3."""
        mission, plan = sortie.mission, sortie.planned.plan
        sortie.depart(self.now_s)
        self._headway = self._headway.next_sortie()
        self._kept_headway.value = (self._headway.known_m, self._headway.difference_m)
        points = (mission.c3, *(waypoint.point for waypoint in sortie.route), mission.c3)
        departed = SortieDeparted(
            sortie=sortie.number,
            limit_s=mission.sortie_limit_s,
            predicted_s=plan.predicted_s,
            worst_case_s=sortie.worst_case_s(self.now_s, met),
            order=sortie.order,
        )
        track = TrackPath(stamp_s=self.now_s, points=points, z_m=self._setup.altitude_m)
        return [Log(departed, self.now_s), Publish(ROUTE, track)]

    # --- in the air ------------------------------------------------------------------------------

    def decide(self) -> list[Output]:
        """Leave C3 when it is time; turn to the next waypoint when this one is done with."""
        sortie, position = self.sortie, self.position
        if sortie is None or position is None:
            return []
        output: list[Output] = []
        if sortie.departed_s is None:
            is_early = is_before(self.now_s, sortie.planned.plan.depart_s)
            if is_early or not self._directive.may_depart:
                return []
            output += self.depart(sortie)
        output += self._advance(sortie, position)
        if self._must_turn_home(sortie, position):
            output += self._break_off(sortie)
        # It may have searched the last AUV from C3 itself, and is home without another step.
        return output + self.land()

    def steer(self) -> Point | None:
        """Send the vehicle where it is to be next, and return where that is."""
        sortie, position = self.sortie, self.position
        if sortie is None or sortie.departed_s is None or position is None:
            return None
        target = self._target(sortie, position)
        self._driver.go_to(target)
        return target

    def _target(self, sortie: SortieUnderway, position: Point) -> Point:
        if self.awaits_answer(sortie, position):
            return position
        waypoint = sortie.next_waypoint
        return waypoint.point if waypoint is not None else sortie.mission.c3

    def awaits_answer(self, sortie: SortieUnderway, position: Point) -> bool:
        """Return whether the UAV stays where it is, to be heard by an AUV and to hear it."""
        if sortie.not_reached or self._directive.is_called_home:
            return False
        if not sortie.fleet.is_awaiting(sortie.met, self.now_s):
            return False
        if not self._guarantees_limit:
            return True
        mission = sortie.mission
        later_s = self.now_s + mission.tick_s
        back_s = later_s + worst_case_s(mission, sortie.rest, later_s, position)
        back_s = max(back_s, self._home_s(mission, position, later_s))
        return not is_before(sortie.back_by_s, back_s)

    def _advance(self, sortie: SortieUnderway, position: Point) -> list[Output]:
        """Move on to the next waypoint that is still of use (ECC 2009, Theorem 1)."""
        output: list[Output] = []
        while (waypoint := sortie.next_waypoint) is not None:
            if waypoint.auv not in sortie.met:
                if not self._is_at(waypoint.point, position, sortie.mission):
                    break
                if is_before(self.now_s, waypoint.surface_deadline_s):
                    break
                if sortie.is_last_of_its_auv:
                    if self._may_be_on_the_air(sortie):
                        break
                    output += self._miss(sortie, waypoint.auv)
            sortie.go_on()
        return output

    def _may_be_on_the_air(self, sortie: SortieUnderway) -> bool:
        """Return whether what an AUV says may not yet be heard at the last of its waypoints."""
        until_s = sortie.listened_from_s(self.now_s) + self._setup.hearing_s
        return is_before(self.now_s, until_s)

    def _miss(self, sortie: SortieUnderway, auv: str) -> list[Output]:
        sortie.miss(auv)
        missed = Missed(sortie=sortie.number, auv=auv)
        return [Log(missed, self.now_s), *self._searched_in_vain(sortie, auv)]

    def _searched_in_vain(self, sortie: SortieUnderway, auv: str) -> list[Output]:
        if sortie.fleet.searched_in_vain(auv):
            return [Log(GivenUp(sortie=sortie.number, auv=auv), self.now_s)]
        return []

    def _is_at(self, point: Point, position: Point, mission: MissionSpec) -> bool:
        way_m = position.distance_m(point)
        # What the plan counts as no flight at all must not cost a tick.
        return way_m <= self._setup.arrival_radius_m or whole_ticks(way_m / mission.step_m) == 0

    # --- the way home ----------------------------------------------------------------------------

    def _must_turn_home(self, sortie: SortieUnderway, position: Point) -> bool:
        """Return whether one more tick of searching could break L; the plan alone never does."""
        if not self._guarantees_limit or sortie.goes_home:
            return False
        mission = sortie.mission
        ahead = position.toward(self._target(sortie, position), mission.step_m)
        home_s = self._home_s(mission, ahead, self.now_s + mission.tick_s)
        return is_before(sortie.back_by_s, home_s)

    def _home_s(self, mission: MissionSpec, point: Point, now_s: float) -> float:
        """Return when the UAV is home from a point, as slow as it has been seen to be."""
        ticks = whole_ticks(point.distance_m(mission.c3) / self._headway.safe_step_m)
        return now_s + ticks * mission.tick_s

    def _break_off(self, sortie: SortieUnderway) -> list[Output]:
        """Turn home to keep L."""
        output = self.turn_home()
        if not (sortie.met or sortie.missed):
            # All of a sortie was not enough for it: one that is always out of reach is lost, too.
            output += self._searched_in_vain(sortie, sortie.not_reached[0])
        return output

    def turn_home(self) -> list[Output]:
        """Give up reaching whoever is left, unless the UAV is on its way home already."""
        sortie = self.sortie
        if sortie is None or sortie.goes_home:
            return []
        sortie.turn_home()
        broken_off = SearchBrokenOff(sortie=sortie.number, not_reached=sortie.not_reached)
        return [Log(broken_off, self.now_s)]

    def land(self) -> list[Output]:
        """End a sortie if it is over: plan the next one, and put together what C3 is told."""
        sortie, position = self.sortie, self.position
        if sortie is None or position is None or sortie.departed_s is None:
            return []
        mission = sortie.mission
        is_home = sortie.goes_home and self._is_at(mission.c3, position, mission)
        if not is_home or self.awaits_answer(sortie, position):
            return []
        fleet, departed_s = sortie.fleet, sortie.departed_s
        searched = sortie.met.keys() | {*sortie.missed}
        overlooked = tuple(leg.auv for leg in fleet.survey_legs() if leg.auv not in searched)
        following = self._following(sortie, overlooked)
        meetings = tuple(_meeting(fleet, auv, contact) for auv, contact in sortie.meetings)
        missed = tuple(auv for auv in sortie.order if auv in sortie.missed)
        self._begin(fleet, following)
        self._deliveries.add(
            SortieReport(
                sortie=sortie.number,
                departed_s=departed_s,
                returned_s=self.now_s,
                meetings=meetings,
                missed=missed,
                not_reached=overlooked,
                lost=fleet.lost,
                cargo=self._deliveries.cargo,
                next_sortie=self.sortie.outlook if self.sortie is not None else None,
            )
        )
        returned = SortieReturned(sortie=sortie.number, duration_s=self.now_s - departed_s)
        return [Log(returned, self.now_s)]


def _meeting(fleet: Fleet, auv: str, contact: Contact) -> Meeting:
    return Meeting(
        auv=auv,
        time_s=contact.time_s,
        cell=contact.cell,
        ended_leg_id=contact.leg_id,
        outcome=contact.outcome,
        next_leg=fleet.next_leg(auv),
    )
