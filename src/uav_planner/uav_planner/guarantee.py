"""
Which paths may be handed over so that every sortie to come can keep L: the guaranteed set.

A *round* is the flight from C3 along the searches of all legs, in visiting order, and back to C3.
What is kept at every meeting, and why it can always be kept, is proved in ``docs/guarantee.md``:

    However the AUVs still to be met in this sortie surface, the round with the new legs of those
    met before, and with one place of the present leg of each one still to be met, takes at most L.

The place is where the AUV will be met and can be kept waiting: it can be told to move to and fro
between the two cells where it is, and one waypoint of its present search is in range of both. So
some path may always be handed over, and it never takes more than has been promised already.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from msgs_json.geometry import Cell, Point, whole_ticks, within_range
from uav_planner.planning import PlanResult, PlanStatus, Prospect, SortiePlan, track_of
from uav_planner.sortie import (
    flight_time_s,
    hop_ticks,
    lay_each_search,
    lay_search,
    leg_waypoints,
    punctual_departure_s,
    round_ticks,
    search_ticks,
    ticks_between_each,
    worst_case_s,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from uav_planner.planning import MissionSpec, PlanRequest, SortieRequest, SurveyLeg
    from uav_planner.sortie import Route, Searches

Path = tuple[Cell, ...]
Search = tuple[Point, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Offer:
    """A path with the search that goes with it."""

    path: Path
    search: Search
    round_ticks: int
    """The round of the next sortie with it, at worst."""


class GuaranteedPaths:
    """
    The guaranteed set at one meeting.

    Where the UAV has lost touch with part of the fleet no path may keep L for a round to all.
    Then a path is allowed if it takes no more than staying in place would, and if a sortie to
    this AUV alone keeps L.

    Raises
    ------
    ValueError
        The AUV that was met has no leg among those of the request, or is not on it.

    """

    def __init__(self, request: PlanRequest) -> None:
        self._mission = mission = request.mission
        self._behind = request.behind
        legs = request.round_legs
        turn = next((turn for turn, leg in enumerate(legs) if leg.auv == request.auv), None)
        if turn is None:
            raise ValueError(
                f'{request.auv} has no leg among those of {[leg.auv for leg in request.legs]}'
            )
        self.before = _reach(mission, ((leg, leg.search) for leg in legs[:turn]))
        """The part of the round before this AUV ..."""
        self.after = _reach(mission, ((leg, leg.search[::-1]) for leg in legs[:turn:-1]))
        """... and the part after it, flown backwards from C3."""
        self.handover_ticks = len(legs) * mission.handover_ticks
        """Kept free in the round for all meetings."""
        self.origins = tuple(dict.fromkeys((*self.before.points, *self.after.points)))
        """
        From where the search of a path is laid for a try, along its track and against it.

        Any origin gives a search; those near the round give short ones.
        """
        self.others_ticks = self.before.ticks_to(self.after) + (
            self.handover_ticks - mission.handover_ticks
        )
        """The round without this AUV, at worst."""
        self.stay = self._stay(request, legs[turn])
        """To move to and fro in place: the path that may always be handed over."""
        self.limit_ticks = max(mission.limit_ticks, self.stay.round_ticks)

    def allows(self, path: Path) -> bool:
        """Return whether a path may be handed over."""
        return self._is_within(self.offer(path))

    def plan(self, path: Path | None) -> PlanResult:
        """Return what is handed over with an allowed path; None stands for staying in place."""
        mission = self._mission
        offer = self.stay if path is None else self.offer(path)
        if offer.round_ticks > mission.limit_ticks:
            status = PlanStatus.INFEASIBLE
        elif len(offer.path) - 1 < mission.path_cells:
            status = PlanStatus.SHORTENED
        else:
            status = PlanStatus.OK
        return PlanResult(
            status=status,
            path=offer.path,
            slack_s=(mission.limit_ticks - self.others_ticks) * mission.tick_s,
            sortie_time_s=offer.round_ticks * mission.tick_s,
            search=offer.search,
        )

    def round_ticks_each(self, tracks: NDArray[np.intp]) -> NDArray[np.float64]:
        """
        Return the ticks of the round with each of many paths, infinite where it is not allowed.

        Parameters
        ----------
        tracks
            The cells of the paths in searching order, `P_q` first: shape (2, cells, paths).

        Returns
        -------
        NDArray[np.float64]
            Shape (paths,); as `offer` says for one path after the other.

        """
        if self._behind is not None:
            last = np.empty((2, 1, tracks.shape[2]), dtype=tracks.dtype)
            last[:] = np.array(self._behind).reshape(2, 1, 1)
            tracks = np.concatenate([tracks, last], axis=1)
        both_ways = np.concatenate([tracks, tracks[:, ::-1]], axis=2)
        searches = lay_each_search(self._mission, self.origins, both_ways)
        each_way = self._round_ticks_each(searches).reshape(2 * len(self.origins), -1)
        ticks: NDArray[np.float64] = each_way.min(axis=0)
        return ticks

    def offer(self, path: Path) -> Offer:
        """Return a path with the shortest search found for it; it need not be allowed."""
        track = track_of(path, self._behind)
        searches = (
            lay_search(self._mission, origin, order)
            for order in (track, track[::-1])
            for origin in self.origins
        )
        return min(
            (self._offer(path, search) for search in searches), key=lambda each: each.round_ticks
        )

    def _stay(self, request: PlanRequest, leg: SurveyLeg) -> Offer:
        moves = self._mission.min_path_cells
        paths = [
            tuple(itertools.islice(itertools.cycle((request.cell, partner)), moves + 1))
            for partner in (leg.beside(request.cell) if self._behind is None else [self._behind])
        ]
        if not paths:
            raise ValueError(f'{leg.auv} is at {list(request.cell)}, which is not on its leg')
        # Promised already; there is one unless the AUV strayed from its track.
        offers = [
            self._offer(path, (point,))
            for path in paths
            for point in leg.search
            if all(self._clears(point, cell) for cell in path[:2])
        ]
        offers = offers or [self.offer(path) for path in paths]
        return min(offers, key=lambda each: (not self._fits_alone(each), each.round_ticks))

    def _clears(self, point: Point, cell: Cell) -> bool:
        distance_m = point.distance_m(self._mission.grid.centre(cell))
        return within_range(distance_m, self._mission.radio_range_m)

    def _offer(self, path: Path, search: Search) -> Offer:
        ticks = self.handover_ticks + search_ticks(self._mission, search)
        ticks += self.before.ticks_to_point(search[0]) + self.after.ticks_to_point(search[-1])
        return Offer(path=path, search=search, round_ticks=ticks)

    def _is_within(self, offer: Offer) -> bool:
        return offer.round_ticks <= self.limit_ticks and self._fits_alone(offer)

    def _fits_alone(self, offer: Offer) -> bool:
        """Return whether a sortie to this AUV alone keeps L."""
        search = (self._mission.c3, *offer.search, self._mission.c3)
        ticks = search_ticks(self._mission, search) + self._mission.handover_ticks
        return ticks <= self._mission.limit_ticks

    def _round_ticks_each(self, searches: Searches) -> NDArray[np.float64]:
        mission = self._mission
        ticks = searches.ticks + self.handover_ticks
        ticks += self.before.ticks_to_each(searches.first_m)
        ticks += self.after.ticks_to_each(searches.last_m)
        home_m = complex(mission.c3.east_m, mission.c3.north_m)
        alone_ticks = searches.ticks + mission.handover_ticks
        alone_ticks += ticks_between_each(mission, searches.first_m, home_m)
        alone_ticks += ticks_between_each(mission, searches.last_m, home_m)
        ticks[(ticks > self.limit_ticks) | (alone_ticks > mission.limit_ticks)] = np.inf
        return ticks


def guaranteed_sortie(request: SortieRequest) -> SortiePlan:
    """
    Return the next sortie to as many AUVs as L allows, in visiting order; normally to all.

    Those that the sortie before did not reach come first. It leaves when it can be at the first
    waypoint in time, but not before its worst case, waits included, is at most L.

    Raises
    ------
    ValueError
        L cannot be kept from the beginning, or the cells are too wide for the radio.

    """
    mission = request.mission
    if not any(leg.search for leg in request.legs):
        problem = initial_problem(mission, request.legs)
        if problem:
            raise ValueError(problem)
    route = _shortest_route(mission, _chosen_legs(request))
    depart_s = max(
        punctual_departure_s(mission, route, request.now_s),
        _safe_departure_s(mission, route, request.now_s),
    )
    return SortiePlan(
        route=route,
        depart_s=depart_s,
        predicted_s=flight_time_s(mission, route),
        worst_case_s=worst_case_s(mission, route, depart_s),
    )


def initial_problem(mission: MissionSpec, legs: Sequence[SurveyLeg]) -> str | None:
    """Return why L cannot be guaranteed from the beginning of a mission, or None."""
    if not within_range(mission.grid.cell_m, mission.radio_range_m):
        return (
            f'cells are {mission.grid.cell_m:g} m wide; to hear an AUV between two cells the radio'
            f' range must be at least that, it is {mission.radio_range_m:g} m'
        )
    needed_s = least_limit_s(mission, legs)
    if needed_s > mission.limit_ticks * mission.tick_s:
        return (
            f'to search the initial paths of all AUVs takes up to {needed_s:g} s;'
            ' allowed: a sortie limit of at least that'
        )
    return None


def least_limit_s(mission: MissionSpec, legs: Iterable[SurveyLeg]) -> float:
    """Return the shortest L that can be guaranteed with initial legs, seconds."""
    return round_ticks(mission, _laid_route(mission, legs)) * mission.tick_s


# --- the round at a meeting ----------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reach:
    """Where the UAV can be after part of a round, and how long that takes at worst."""

    points: Search
    ticks: tuple[int, ...]
    """From C3 to each of the points."""
    mission: MissionSpec

    def ticks_to_point(self, point: Point) -> int:
        """Return the ticks from C3 to a point."""
        return max(
            ticks + hop_ticks(self.mission, here, point)
            for here, ticks in zip(self.points, self.ticks, strict=True)
        )

    def ticks_to(self, other: Reach) -> int:
        """Return the ticks of a round made of this part and another one, flown backwards."""
        return max(
            self.ticks_to_point(point) + ticks
            for point, ticks in zip(other.points, other.ticks, strict=True)
        )

    def ticks_to_each(self, points_m: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return `ticks_to_point` of many points, east + i north, in their shape."""
        here_m = np.array([complex(point.east_m, point.north_m) for point in self.points])
        hops = ticks_between_each(self.mission, here_m, points_m[..., np.newaxis])
        ticks: NDArray[np.float64] = (hops + self.ticks).max(axis=-1)
        return ticks


def _reach(mission: MissionSpec, searches: Iterable[tuple[SurveyLeg, Search]]) -> Reach:
    """Return how far a round has come after some legs, each with its search in flying order."""
    reach = Reach(points=(mission.c3,), ticks=(0,), mission=mission)
    for leg, search in searches:
        if leg.prospect is Prospect.ENDS:
            ticks = tuple(reach.ticks_to_point(point) for point in search)
            reach = Reach(points=search, ticks=ticks, mission=mission)
        else:
            ticks = (reach.ticks_to_point(search[0]) + search_ticks(mission, search),)
            reach = Reach(points=search[-1:], ticks=ticks, mission=mission)
    return reach


# --- the next sortie -----------------------------------------------------------------------------


def _chosen_legs(request: SortieRequest) -> list[SurveyLeg]:
    """Return the legs that a sortie goes to, in flying order."""
    chosen: list[int] = []
    legs = request.legs

    def overlooked_first(index: int) -> tuple[bool, int]:
        return (legs[index].auv not in request.overlooked, index)

    def importance(index: int) -> tuple[bool, bool, int]:
        is_astray = legs[index].prospect is Prospect.ASTRAY
        return (legs[index].auv not in request.overlooked, is_astray, index)

    for index in sorted(range(len(legs)), key=importance):
        trial = sorted([*chosen, index], key=overlooked_first)
        route = _shortest_route(request.mission, [legs[each] for each in trial])
        if round_ticks(request.mission, route) <= request.mission.limit_ticks:
            chosen = trial
    return [legs[index] for index in chosen]


def _shortest_route(mission: MissionSpec, legs: Sequence[SurveyLeg]) -> Route:
    """Return the route of the searches that were promised, or laid anew if that is shorter."""
    routes = [_laid_route(mission, legs)]
    if all(leg.search for leg in legs):
        kept = (waypoint for leg in legs for waypoint in leg_waypoints(leg, leg.search))
        routes.insert(0, tuple(kept))
    return min(routes, key=lambda route: round_ticks(mission, route))


def _laid_route(mission: MissionSpec, legs: Iterable[SurveyLeg]) -> Route:
    """Return the route that clears every leg, whatever is between its cells included."""
    route: Route = ()
    here = mission.c3
    for leg in legs:
        search = lay_search(mission, here, leg.track)
        route = (*route, *leg_waypoints(leg, search))
        here = search[-1]
    return route


def _safe_departure_s(mission: MissionSpec, route: Route, now_s: float) -> float:
    """Return when to leave at the earliest so that no wait makes the sortie longer than L."""
    wait_ticks = 0
    for index, waypoint in enumerate(route):
        if index > 0 and route[index - 1].auv == waypoint.auv:
            continue
        rest_ticks = round_ticks(mission, route[index:], waypoint.point)
        deadline_ticks = whole_ticks((waypoint.surface_deadline_s - now_s) / mission.tick_s)
        wait_ticks = max(wait_ticks, deadline_ticks + rest_ticks - mission.limit_ticks)
    return now_s + wait_ticks * mission.tick_s
