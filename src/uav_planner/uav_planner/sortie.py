"""
A sortie as ECC 2009 lays it: the fixed list of waypoints, how long it takes, when to leave.

A *track* is a list of cells in the order in which they are cleared; a leg's track is its path
from `P_q` back to `P_0` (Theorem 1). A cell is cleared from a point within radio range of it: the
UAV flies in whole ticks straight toward the next uncleared cell until it is that near. Where it
then is, is a waypoint. A *sortie* clears the tracks of all legs in visiting order and returns to
C3. Flight times are counted in ticks, so that they compare exactly.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from msgs_json.geometry import TOLERANCE, Cell, Point, whole_ticks

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from uav_planner.planning import MissionSpec, SurveyLeg


@dataclass(frozen=True, slots=True, kw_only=True)
class Waypoint:
    """A point of the route from which cells of one AUV's leg are cleared."""

    point: Point
    auv: str
    surface_deadline_s: float
    """At the first waypoint of its leg the UAV waits until this time [S_i]."""


Route = tuple[Waypoint, ...]
"""
The waypoints of a sortie in flying order; it starts and ends at C3, which is not among them.

Every leg has at least one waypoint, and its waypoints stand together. A contact skips the rest
of its leg.
"""


def lay_route(mission: MissionSpec, legs: Iterable[SurveyLeg]) -> Route:
    """Return the route that clears every leg from `P_q` back to `P_0` (Section III.A)."""
    route: list[Waypoint] = []
    here = mission.c3
    for leg in legs:
        search = lay_search(mission, here, leg.path[::-1])
        route += leg_waypoints(leg, search)
        here = search[-1]
    return tuple(route)


def leg_waypoints(leg: SurveyLeg, search: Iterable[Point]) -> list[Waypoint]:
    """Return the part of a route that searches one leg from some points."""
    return [
        Waypoint(point=point, auv=leg.auv, surface_deadline_s=leg.surface_deadline_s)
        for point in search
    ]


def searches_of(route: Route) -> dict[str, tuple[Point, ...]]:
    """Return from where a route searches each AUV that it goes to."""
    return {
        auv: tuple(waypoint.point for waypoint in waypoints)
        for auv, waypoints in itertools.groupby(route, key=lambda waypoint: waypoint.auv)
    }


def lay_search(mission: MissionSpec, origin: Point, track: Iterable[Cell]) -> tuple[Point, ...]:
    """
    Return the waypoints from which a track is cleared by a UAV that comes from ``origin``.

    The first is where the first cell is cleared: ``origin`` itself if that is in range of it.
    Where `cell_m` is at most `radio_range_m`, each two cells next to each other on the track, and
    all between them, are in range of the waypoint from which the later one is cleared.
    """
    search: list[Point] = []
    here = origin
    for at_m, ticks in _clear(mission, _east_north_m(origin), track):
        if ticks > 0:
            here = Point(east_m=at_m.real, north_m=at_m.imag)
        if ticks > 0 or not search:
            search.append(here)
    return tuple(search)


def flight_ticks(mission: MissionSpec, route: Route) -> int:
    """Return how many ticks the whole list takes to fly, from C3 and back, without any wait."""
    points = [mission.c3, *(waypoint.point for waypoint in route), mission.c3]
    return search_ticks(mission, points)


def round_ticks(mission: MissionSpec, route: Route, start: Point | None = None) -> int:
    """Return the ticks from C3, or another point, along a route and home, hand-overs included."""
    points = [start or mission.c3, *(waypoint.point for waypoint in route), mission.c3]
    auvs = {waypoint.auv for waypoint in route}
    return search_ticks(mission, points) + len(auvs) * mission.handover_ticks


def search_ticks(mission: MissionSpec, points: Iterable[Point]) -> int:
    """Return how many ticks it takes to fly from the first of some points to the last."""
    return sum(hop_ticks(mission, start, end) for start, end in itertools.pairwise(points))


def flight_time_s(mission: MissionSpec, route: Route) -> float:
    """Return how long the whole list takes to fly, without any wait, seconds [T_j]."""
    return flight_ticks(mission, route) * mission.tick_s


def worst_case_s(
    mission: MissionSpec, route: Route, depart_s: float, start: Point | None = None
) -> float:
    """
    Return how long the sortie takes if it flies the whole list, waits included, seconds.

    It begins at C3, or at another point for what is left of it.

    The UAV waits at the first waypoint of every leg until that AUV must be surfaced; at the
    leg's others that time has passed. Every hand-over takes `handover_s`. A contact only skips
    waypoints, which never makes a sortie longer (Theorem 2).
    """
    ticks, here = 0, start or mission.c3
    for begun_ticks, waypoint in _schedule(mission, route, depart_s, here):
        ticks, here = begun_ticks, waypoint.point
    if route:
        ticks += mission.handover_ticks  # with the last AUV
    return (ticks + hop_ticks(mission, here, mission.c3)) * mission.tick_s


def search_times_s(mission: MissionSpec, route: Route, depart_s: float) -> dict[str, float]:
    """Return when at the latest the UAV begins to search each AUV of a route, by name."""
    times_s: dict[str, float] = {}
    for ticks, waypoint in _schedule(mission, route, depart_s, mission.c3):
        times_s.setdefault(waypoint.auv, depart_s + ticks * mission.tick_s)
    return times_s


def _schedule(
    mission: MissionSpec, route: Route, depart_s: float, start: Point
) -> Iterator[tuple[int, Waypoint]]:
    """Yield after how many ticks, waits included, each waypoint has been of use at worst."""
    ticks, here, auv = 0, start, None
    for waypoint in route:
        if auv not in (None, waypoint.auv):
            ticks += mission.handover_ticks
        deadline_ticks = whole_ticks((waypoint.surface_deadline_s - depart_s) / mission.tick_s)
        ticks = max(ticks + hop_ticks(mission, here, waypoint.point), deadline_ticks)
        here, auv = waypoint.point, waypoint.auv
        yield ticks, waypoint


def punctual_departure_s(mission: MissionSpec, route: Route, now_s: float) -> float:
    """
    Return when to leave C3 to reach the first waypoint when its AUV must be surfaced, seconds.

    Now, if it is too late for that; always a whole number of ticks after ``now_s``.
    """
    if not route:
        return now_s
    first = route[0]
    deadline_ticks = whole_ticks((first.surface_deadline_s - now_s) / mission.tick_s)
    wait_ticks = max(0, deadline_ticks - hop_ticks(mission, mission.c3, first.point))
    return now_s + wait_ticks * mission.tick_s


def hop_ticks(mission: MissionSpec, start: Point, end: Point) -> int:
    """Return how many ticks the UAV takes to fly straight from one point to another."""
    return whole_ticks(start.distance_m(end) / mission.step_m)


@dataclass(frozen=True, slots=True, kw_only=True)
class Flown:
    """Where the UAV is in a sortie and how long it has flown to get there."""

    point: Point
    ticks: int

    def home_ticks(self, mission: MissionSpec) -> int:
        """Return the ticks of the whole flight if the UAV now returns to C3."""
        return self.ticks + hop_ticks(mission, self.point, mission.c3)


def clear_track(mission: MissionSpec, flown: Flown, track: Iterable[Cell]) -> Flown:
    """Return where and when the UAV has cleared one more track; the route's arithmetic."""
    at_m = _east_north_m(flown.point)
    total_ticks = flown.ticks
    for cleared_m, ticks in _clear(mission, at_m, track):
        at_m = cleared_m
        total_ticks += ticks
    return Flown(point=Point(east_m=at_m.real, north_m=at_m.imag), ticks=total_ticks)


def home_ticks_of_tracks(
    mission: MissionSpec, flown: Flown, tracks: NDArray[np.intp], last: Iterable[Cell]
) -> NDArray[np.int64]:
    """
    Return, for many tracks at once, the ticks of the flight that clears one and returns to C3.

    The same figures as `clear_track` and `Flown.home_ticks` give for one track after the other.

    Parameters
    ----------
    mission
        Grid, C3, radio range and speed.
    flown
        The flight before the tracks part.
    tracks
        Shape (2, cells, tracks): columns and rows of the cells to clear one after another.
    last
        The track that all of them clear after that, before they return.

    Returns
    -------
    NDArray[np.int64]
        Shape (tracks,).

    """
    at_m = np.full(tracks.shape[2], _east_north_m(flown.point))
    ticks = np.full(tracks.shape[2], float(flown.ticks))
    last_m = [_east_north_m(mission.grid.centre(cell)) for cell in last]
    for centre_m in [*_centres_m(mission, tracks), *last_m]:
        _clear_each(mission, at_m, ticks, centre_m)
    ticks += ticks_between_each(mission, at_m, _east_north_m(mission.c3))
    return ticks.astype(np.int64)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Searches:
    """Many searches as `lay_search` lays them; arrays of shape (origins, tracks)."""

    first_m: NDArray[np.complex128]
    """The first waypoint of each, east + i north."""
    ticks: NDArray[np.float64]
    """From there to its last waypoint."""
    last_m: NDArray[np.complex128]


def lay_each_search(
    mission: MissionSpec, origins: Sequence[Point], tracks: NDArray[np.intp]
) -> Searches:
    """
    Return `lay_search` of many tracks at once, as far as it matters for a round's length.

    Parameters
    ----------
    mission
        Grid, radio range and speed.
    origins
        Where the UAV may come from.
    tracks
        Shape (2, cells, tracks): columns and rows of the cells to clear one after another.

    """
    first_centre_m, *centres_m = _centres_m(mission, tracks)
    shape = (len(origins), tracks.shape[2])
    at_m = np.empty(shape, dtype=np.complex128)
    at_m.T[:] = [_east_north_m(origin) for origin in origins]
    ticks = np.zeros(shape)
    _clear_each(mission, at_m, ticks, first_centre_m)
    first_m = at_m.copy()
    ticks[:] = 0.0
    for centre_m in centres_m:
        _clear_each(mission, at_m, ticks, centre_m)
    return Searches(first_m=first_m, ticks=ticks, last_m=at_m)


def ticks_between_each(
    mission: MissionSpec, start_m: NDArray[np.complex128], end_m: NDArray[np.complex128] | complex
) -> NDArray[np.float64]:
    """Return `hop_ticks` between many points, east + i north, in the shape they broadcast to."""
    return whole_ticks_of_each(np.abs(end_m - start_m) / mission.step_m)


def _centres_m(mission: MissionSpec, tracks: NDArray[np.intp]) -> NDArray[np.complex128]:
    """Return the centres of the cells of tracks, shape (cells, tracks)."""
    cols, rows = tracks
    centres_m: NDArray[np.complex128] = ((cols + 0.5) + 1j * (rows + 0.5)) * mission.grid.cell_m
    return centres_m


def _clear_each(
    mission: MissionSpec,
    at_m: NDArray[np.complex128],
    ticks: NDArray[np.float64],
    centre_m: NDArray[np.complex128] | complex,
) -> None:
    """Clear one more cell from each of many places; changes both arrays, of the same shape."""
    range_m = mission.radio_range_m
    edge_m = range_m * (1.0 + TOLERANCE)  # of `within_range`
    step_m = mission.step_m
    way_m = centre_m - at_m
    distance_m = np.abs(way_m)
    is_far = distance_m > edge_m
    more = whole_ticks_of_each((distance_m - range_m) / step_m)
    more += distance_m - more * step_m > edge_m
    more *= is_far
    # Where it is not far nothing is added, whatever it is divided by.
    at_m += np.minimum(more * step_m / np.maximum(distance_m, range_m), 1.0) * way_m
    ticks += more


def _clear(
    mission: MissionSpec, at_m: complex, track: Iterable[Cell]
) -> Iterator[tuple[complex, int]]:
    """
    Yield for each cell of a track from where it is cleared and how long it takes to get there.

    It is the same place and takes no tick where the cell is in range already. Plain numbers, no
    arrays: this is the inner loop of a planner that looks at a few tracks.
    """
    range_m = mission.radio_range_m
    edge_m = range_m * (1.0 + TOLERANCE)  # of `within_range`
    cell_m = mission.grid.cell_m
    step_m = mission.step_m
    for col, row in track:
        way_m = complex(col + 0.5, row + 0.5) * cell_m - at_m
        distance_m = abs(way_m)
        ticks = 0
        if distance_m > edge_m:
            ticks = whole_ticks((distance_m - range_m) / step_m)
            # What `whole_ticks` forgives can be more than what a short radio range forgives.
            if distance_m - ticks * step_m > edge_m:
                ticks += 1
            at_m += min(ticks * step_m / distance_m, 1.0) * way_m  # never past the cell
        yield at_m, ticks


def whole_ticks_of_each(ticks: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return `whole_ticks` of every element."""
    return np.ceil(ticks - TOLERANCE * np.maximum(1.0, np.abs(ticks)))


def _east_north_m(point: Point) -> complex:
    """Return a point as east + i north: one number, so the plane's arithmetic is one step."""
    return complex(point.east_m, point.north_m)
