"""
The guaranteed set by brute force on small grids, written to be obvious.

Two questions that `guarantee` answers with a rule are answered here by going through everything:

- Is the rule sound? `reachable_meetings` follows every path that the rule allows, from every place
  where an AUV can surface, until nothing new comes; at each meeting some path must keep L.
- What does it refuse without need? `Game` plays the mission as a game against the sea: a path must
  be refused only where the sea can then break L, whatever is handed over later.

It is in the package because the tests and the benchmark both need it. Nothing flies with it.
"""

from __future__ import annotations

import functools
import itertools
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from msgs_json.geometry import Cell
from uav_planner.candidate_paths import Direction
from uav_planner.guarantee import GuaranteedPaths, guaranteed_sortie
from uav_planner.planning import (
    PlanRequest,
    Prospect,
    SortieRequest,
    SurveyLeg,
    track_of,
)
from uav_planner.sortie import hop_ticks, lay_search

if TYPE_CHECKING:
    from collections.abc import Iterator

    from msgs_json.geometry import Point
    from uav_planner.guarantee import Offer
    from uav_planner.planning import MissionSpec

Path = tuple[Cell, ...]
Place = tuple[Cell, Cell | None]
"""Where an AUV surfaces: the last cell it entered, and the one toward which it lies beyond it."""
Way = tuple[Path, Cell | None]
"""A path and the neighbour of `P_0` toward which it begins."""


@functools.cache
def paths_from(mission: MissionSpec, cell: Cell) -> tuple[Path, ...]:
    """Return all paths that an AUV can be given at a cell, from Delta to q moves."""
    paths: list[Path] = [(cell,)]
    allowed: list[Path] = []
    for moves in range(1, mission.path_cells + 1):
        paths = [
            (*path, (path[-1][0] + direction.value[0], path[-1][1] + direction.value[1]))
            for path in paths
            for direction in Direction
        ]
        paths = [path for path in paths if mission.grid.contains(path[-1])]
        if moves >= mission.min_path_cells:
            allowed += paths
    return tuple(allowed)


def places_of(way: Way) -> list[Place]:
    """Return everywhere that an AUV can surface: at each cell, and between each two cells."""
    path, behind = way
    places: list[Place] = [(cell, None) for cell in path]
    places += list(itertools.pairwise(path))
    if behind is not None:
        places.append((path[0], behind))
    return list(dict.fromkeys(places))


# --- is the rule sound? --------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class MeetingState:
    """A meeting that can come about, and the set of paths that the rule allows there."""

    request: PlanRequest
    guaranteed: GuaranteedPaths


def reachable_meetings(
    mission: MissionSpec, legs: tuple[SurveyLeg, ...]
) -> Iterator[MeetingState]:
    """
    Yield every meeting that can follow from some initial legs, by whatever the rule allows.

    Raises
    ------
    ValueError
        L cannot be kept from the beginning.

    """
    waiting = [(next_sortie(mission, legs), 0)]
    seen = set(waiting)
    while waiting:
        state, turn = waiting.pop()
        leg = state[turn]
        for place in places_of((leg.path, leg.behind)):
            request = meeting_request(mission, state, leg.auv, place)
            guaranteed = GuaranteedPaths(request)
            yield MeetingState(request, guaranteed)
            for path in paths_from(mission, request.cell):
                if not guaranteed.allows(path):
                    continue
                following = legs_after(request, guaranteed.offer(path))
                after = (following, turn + 1)
                if turn + 1 == len(state):
                    after = (next_sortie(mission, following), 0)
                if after not in seen:
                    seen.add(after)
                    waiting.append(after)


def next_sortie(mission: MissionSpec, legs: tuple[SurveyLeg, ...]) -> tuple[SurveyLeg, ...]:
    """Return the legs as the next sortie searches them."""
    route = guaranteed_sortie(SortieRequest(mission=mission, legs=legs, now_s=0.0)).route
    return tuple(
        replace(
            leg,
            search=tuple(waypoint.point for waypoint in route if waypoint.auv == leg.auv),
            prospect=Prospect.ENDS,
        )
        for leg in legs
    )


def meeting_request(
    mission: MissionSpec, legs: tuple[SurveyLeg, ...], auv: str, place: Place
) -> PlanRequest:
    """Return the request when an AUV is met at a place; nothing is explored yet."""
    cell, behind = place
    return PlanRequest(
        mission=mission,
        values=np.where(mission.grid.mask, 0.0, 1.0),
        auv=auv,
        cell=cell,
        behind=behind,
        legs=legs,
        now_s=0.0,
    )


def legs_after(request: PlanRequest, offer: Offer) -> tuple[SurveyLeg, ...]:
    """Return all legs once the AUV that was met has its new path."""
    return tuple(
        replace(
            leg,
            path=offer.path,
            behind=request.behind,
            search=offer.search,
            prospect=Prospect.STAYS,
        )
        if leg.auv == request.auv
        else leg
        for leg in request.legs
    )


# --- what does it refuse without need? -----------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class Refusals:
    """How often a path is refused, over all meetings that can follow."""

    paths: int
    """Paths that could be handed over at some meeting."""
    winning: int
    """How many of them win the game."""
    refused: int
    """How many of these the rule refuses."""


def count_refusals(mission: MissionSpec, legs: tuple[SurveyLeg, ...]) -> Refusals:
    """
    Return what the rule refuses without need.

    Raises
    ------
    ValueError
        L cannot be kept from the beginning.

    """
    game = Game(mission, len(legs))
    paths = winning = refused = 0
    for meeting in reachable_meetings(mission, legs):
        request = meeting.request
        turn = [leg.auv for leg in request.legs].index(request.auv)
        ways = [(leg.path, leg.behind) for leg in request.legs]
        for path in paths_from(mission, request.cell):
            is_allowed = meeting.guaranteed.allows(path)
            # The game does not try every search there is; what is allowed is safe in any case.
            wins = is_allowed or game.wins(
                (*ways[:turn], (path, request.behind)), tuple(ways[turn + 1 :])
            )
            paths += 1
            winning += wins
            refused += wins and not is_allowed
    return Refusals(paths=paths, winning=winning, refused=refused)


@dataclass(frozen=True)
class Game:
    """
    The mission as a game: the sea says where an AUV surfaces, the UAV answers with a path.

    A position is one `Way` per AUV. It is won if all of them can be searched in a round within L,
    and if for every place of the first AUV there is a path so that for every place of the second
    there is one, and so on, with which the position is won again.
    """

    mission: MissionSpec
    auvs: int

    @cached_property
    def won(self) -> frozenset[tuple[Way, ...]]:
        """Return every position that is won: the greatest set that the rule above maps to it."""
        limit = self.mission.limit_ticks
        ways = self._all_ways()
        won = {
            position
            for position in itertools.product(ways, repeat=self.auvs)
            if self.round_ticks(position) <= limit
        }
        while True:
            held = frozenset(won)
            won = {position for position in held if self._holds((), position, held)}
            if len(won) == len(held):
                return held

    def wins(self, met: tuple[Way, ...], to_come: tuple[Way, ...]) -> bool:
        """Return whether the UAV can win when some AUVs are met and the others are to come."""
        return self._holds(met, to_come, self.won)

    def round_ticks(self, position: tuple[Way, ...]) -> int:
        """Return the ticks of the shortest round made of the searches that are tried."""
        mission = self.mission
        ends: dict[Point, int] = {mission.c3: 0}
        for way in position:
            following: dict[Point, int] = {}
            for search in _searches(mission, way):
                ticks = min(at + hop_ticks(mission, end, search[0]) for end, at in ends.items())
                ticks += sum(hop_ticks(mission, *hop) for hop in itertools.pairwise(search))
                following[search[-1]] = min(ticks, following.get(search[-1], ticks))
            ends = following
        ticks = min(at + hop_ticks(mission, end, mission.c3) for end, at in ends.items())
        return ticks + len(position) * mission.handover_ticks

    def _holds(
        self, met: tuple[Way, ...], to_come: tuple[Way, ...], won: frozenset[tuple[Way, ...]]
    ) -> bool:
        if not to_come:
            return met in won
        return all(
            any(
                self._holds((*met, (path, behind)), to_come[1:], won)
                for path in paths_from(self.mission, cell)
            )
            for cell, behind in places_of(to_come[0])
        )

    def _all_ways(self) -> list[Way]:
        grid = self.mission.grid
        ways: list[Way] = []
        for cell in grid.cells:
            for path in paths_from(self.mission, cell):
                ways += [(path, behind) for behind in (None, *grid.neighbours(cell))]
        return ways


@functools.cache
def _searches(mission: MissionSpec, way: Way) -> frozenset[tuple[Point, ...]]:
    """Return the searches tried: from C3 and every cell, in both directions."""
    track = track_of(*way)
    return frozenset(
        lay_search(mission, origin, order)
        for origin in _origins(mission)
        for order in (track, track[::-1])
    )


@functools.cache
def _origins(mission: MissionSpec) -> tuple[Point, ...]:
    """Return where searches are laid from: C3, every cell, and where a cell is first heard."""
    cells = mission.grid.cells
    origins = [mission.c3, *(mission.grid.centre(cell) for cell in cells)]
    heard_from = [lay_search(mission, origin, (cell,)) for origin in origins for cell in cells]
    return tuple(dict.fromkeys([*origins, *(search[0] for search in heard_from)]))
