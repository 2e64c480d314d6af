"""
The rest of a mission flown in some 50 microseconds: what tours of the AUVs would come to.

A *tour* is the list of cells that an AUV is still to enter, in order; its next legs are cut from
it. Flown are the real rules in whole ticks: searches are laid, paths kept to the guaranteed set,
sorties departed, AUVs met and made to wait as `guarantee`, `sortie` and the UAV's agent do it, as
long as every AUV surfaces where and when its path ends. Complex numbers are points, east + i north
in metres; ticks count from now; cells are numbered row by row.

Simplifications:

- AUVs surface at the last cell of their path and no sooner than they must, margin included; the
  margin is rounded up to ticks by itself. None surfaces early, strays or breaks down.
- One that is met between two cells goes on as if from the last one that it entered.
- A meeting takes no time, be time kept free for it or not: nothing said is lost, no answer is
  waited for. Those heard at the same tick are met in visiting order.
- Every sortie goes to all AUVs in visiting order and searches to the end. Where that breaks L, or
  somebody is not heard, that is counted as late; the UAV would leave AUVs out, turn home, give up.
- Of the sortie under way, a search that has begun begins anew.
- Where nothing of its tour is allowed, an AUV stays in place. The planner asks `robust` instead
  where the mission would not be explored with that.
- It ends when the last path is handed out: neglect after that is not counted.

It is one file because its functions call each other, see `compilation`.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from msgs_json.geometry import TOLERANCE
from uav_planner.compilation import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Ints = NDArray[np.int64]
    Points = NDArray[np.complex128]


class MissionConstants(NamedTuple):
    """What stays the same while tours are compared."""

    col: Ints
    """Column of every cell; looked up, since to divide takes as long as all the rest."""
    row: Ints
    centre_m: Points
    """Centre of every cell."""
    range_m: float
    step_m: float
    c3_m: complex
    home: int
    """The cell nearest to C3."""
    limit_ticks: int
    """L, ticks."""
    handover_ticks: int
    """Ticks kept free for each meeting."""
    margin_ticks: int
    """Ticks by which an AUV may surface later than at its speed."""
    moves_max: int
    moves_min: int
    next_cell: NDArray[np.int16]
    """
    Next cell on the way from one to another, shape (cells, cells); (0, 0) without a mask.

    Negative where no way leads there.
    """
    moves_between: NDArray[np.int16]
    """Moves on that way, in the same shape."""


class Legs(NamedTuple):
    """The AUVs in visiting order; everything that flying changes."""

    tracks: Ints
    """Cells of each present leg in searching order, shape (auvs, most cells)."""
    sizes: Ints
    """How many cells each track has."""
    deadline_ticks: Ints
    """Tick at which each is at the surface, at the first cell of its track."""
    searches: Points
    """Waypoints of each search, shape (auvs, most waypoints)."""
    lengths: Ints
    """How many waypoints each search has."""
    to_meet: NDArray[np.bool_]
    """Whom the sortie under way is still to meet."""
    begun: Ints
    """How much of its tour each has been given."""
    ticks_per_cell: NDArray[np.float64]
    """How long each takes from one cell to the next."""
    entered: NDArray[np.bool_]
    """Cells entered or on a path that was handed over; masked ones, too."""


class Position(NamedTuple):
    """Where the UAV is, and whom it is meeting."""

    at_m: complex
    met: int
    """The AUV that is to get a path now; -1 at C3."""
    behind: int
    """The cell toward which that AUV lies off the first one of its track; -1 if toward none."""
    moves_least: int
    """Moves that it is to make at least, even if its tour ends sooner."""


class CellTours(NamedTuple):
    """The tours one after the other, by AUV."""

    cells: Ints
    ends: Ints
    """Where each tour ends."""


class Reach(NamedTuple):
    """Where the UAV can be after part of a round, and after how many ticks at worst."""

    points: Points
    ticks: Ints


class Outcome(NamedTuple):
    """What flying some tours came to; times in ticks."""

    explored_ticks: float
    """When the last cell is entered."""
    idle_ticks: float
    """How long before that AUVs had entered their last, sum."""
    revisits: int
    """Moves into cells entered before, on the way to others that were not."""
    neglect_ticks: float
    """How long AUVs waited at the surface before all was handed out, sum."""
    late_ticks: int
    """By how much rounds were longer than L, sum."""
    left: int
    """Cells that were not entered when the mission was given up."""


# --- cells, hops and searches --------------------------------------------------------------------


@compiled
def whole(ticks: float) -> int:
    """Return `whole_ticks`."""
    return math.ceil(ticks - TOLERANCE * max(1.0, abs(ticks)))


@compiled
def length_of(way_m: complex) -> float:
    """Return the length of a way; `abs` minds overflows and is slower."""
    return math.sqrt(way_m.real * way_m.real + way_m.imag * way_m.imag)


@compiled
def hop(mission: MissionConstants, start_m: complex, end_m: complex) -> int:
    """Return `hop_ticks`."""
    return whole(length_of(end_m - start_m) / mission.step_m)


@compiled
def distance(mission: MissionConstants, cell: int, other: int) -> int:
    """Return the moves from one cell to another."""
    if mission.moves_between.shape[0] > 0:
        return int(mission.moves_between[cell, other])
    return int(
        abs(mission.col[cell] - mission.col[other]) + abs(mission.row[cell] - mission.row[other])
    )


@compiled
def toward(mission: MissionConstants, cell: int, target: int) -> int:
    """Return the next cell on the way to another one, the longer side first; < 0 if none leads."""
    if mission.next_cell.shape[0] > 0:
        return int(mission.next_cell[cell, target])
    east = mission.col[target] - mission.col[cell]
    north = mission.row[target] - mission.row[cell]
    if abs(east) >= abs(north):
        return cell + (1 if east > 0 else -1)
    cols = int(mission.col[-1]) + 1
    return cell + (cols if north > 0 else -cols)


@compiled
def lay(
    mission: MissionConstants,
    origin_m: complex,
    track: Ints,
    size: int,
    is_reversed: bool,
    search: Points,
) -> tuple[int, int]:
    """Write `lay_search` of a track to ``search``; return its length and its ticks."""
    edge_m = mission.range_m * (1.0 + TOLERANCE)
    at_m = origin_m
    length = 0
    ticks = 0
    for place in range(size):
        cell = track[size - 1 - place if is_reversed else place]
        way_m = mission.centre_m[cell] - at_m
        far_m = length_of(way_m)
        is_far = far_m > edge_m
        if is_far:
            more = whole((far_m - mission.range_m) / mission.step_m)
            if far_m - more * mission.step_m > edge_m:
                more += 1
            at_m += min(more * mission.step_m / far_m, 1.0) * way_m
        if is_far or length == 0:
            if length > 0:
                ticks += hop(mission, search[length - 1], at_m)
            search[length] = at_m
            length += 1
    return length, ticks


@compiled
def search_ticks(mission: MissionConstants, search: Points, length: int) -> int:
    """Return how long it takes along a search."""
    ticks = 0
    for place in range(length - 1):
        ticks += hop(mission, search[place], search[place + 1])
    return ticks


# --- the guaranteed set --------------------------------------------------------------------------


@compiled
def ticks_to(mission: MissionConstants, reach: Reach, count: int, point_m: complex) -> int:
    """Return how long it takes to a point at worst."""
    ticks = 0
    for place in range(count):
        ticks = max(ticks, int(reach.ticks[place]) + hop(mission, reach.points[place], point_m))
    return ticks


@compiled
def ticks_near(mission: MissionConstants, reach: Reach, count: int, point_m: complex) -> float:
    """Return how long it takes at least, in parts of ticks, until a point is in range at worst."""
    ticks = 0.0
    for place in range(count):
        way_m = max(0.0, length_of(reach.points[place] - point_m) - mission.range_m)
        ticks = max(ticks, reach.ticks[place] + way_m / mission.step_m)
    return ticks


@compiled
def follow(
    mission: MissionConstants,
    legs: Legs,
    first: int,
    end: int,
    step: int,
    reach: Reach,
    scratch: Ints,
) -> int:
    """Write how far a round has come after some AUVs to ``reach``; return its number of points."""
    reach.points[0] = mission.c3_m
    reach.ticks[0] = 0
    count = 1
    for auv in range(first, end, step):
        search = legs.searches[auv]
        length = int(legs.lengths[auv])
        if legs.to_meet[auv]:
            for place in range(length):
                scratch[place] = ticks_to(mission, reach, count, search[place])
            count = length
            for place in range(length):
                reach.points[place] = search[place]
                reach.ticks[place] = scratch[place]
        else:
            begin_m = search[0] if step > 0 else search[length - 1]
            ticks = ticks_to(mission, reach, count, begin_m) + search_ticks(
                mission, search, length
            )
            reach.points[0] = search[length - 1] if step > 0 else search[0]
            reach.ticks[0] = ticks
            count = 1
    return count


class Workspace(NamedTuple):
    """Room to work in, so that nothing is made anew at every meeting."""

    before: Reach
    after: Reach
    ticks: Ints
    path: Ints
    track: Ints
    trial: Points
    search: Points


@compiled
def make_workspace(legs: Legs) -> Workspace:
    """Return the room for the longest paths and searches."""
    cells = legs.searches.shape[1]
    return Workspace(
        Reach(np.empty(cells, np.complex128), np.empty(cells, np.int64)),
        Reach(np.empty(cells, np.complex128), np.empty(cells, np.int64)),
        np.empty(cells, np.int64),
        np.empty(cells, np.int64),
        np.empty(cells, np.int64),
        np.empty(cells, np.complex128),
        np.empty(cells, np.complex128),
    )


@compiled
def lay_best(
    mission: MissionConstants, room: Workspace, before_count: int, after_count: int, size: int
) -> tuple[int, int]:
    """Lay the search of the room's track that makes the shortest round; its length, the round."""
    best = -1
    best_length = 0
    for is_reversed in (False, True):
        for origin in range(before_count + after_count):
            if origin < before_count:
                origin_m = room.before.points[origin]
            else:
                origin_m = room.after.points[after_count - 1 - (origin - before_count)]
            length, ticks = lay(mission, origin_m, room.track, size, is_reversed, room.trial)
            ticks += ticks_to(mission, room.before, before_count, room.trial[0])
            ticks += ticks_to(mission, room.after, after_count, room.trial[length - 1])
            if best < 0 or ticks < best:
                best = ticks
                best_length = length
                room.search[:length] = room.trial[:length]
    return best_length, best


# --- a meeting -----------------------------------------------------------------------------------


@compiled
def walk_on(
    mission: MissionConstants, legs: Legs, auv: int, tour: Ints, moves_least: int, path: Ints
) -> int:
    """
    Write the next moves along a tour to ``path``; return how many there are, at most q.

    An AUV that is at the end of its tour before so many moves comes nearer to C3: the UAV's round
    becomes shorter with that.
    """
    cell = path[0] = legs.tracks[auv, 0]
    moves = 0
    for place in range(legs.begun[auv], tour.size):
        target = tour[place]
        if legs.entered[target]:
            continue
        while cell != target:
            if moves == mission.moves_max:
                return moves
            following = toward(mission, cell, target)
            if following < 0:
                break
            cell = following
            moves += 1
            path[moves] = cell
    while moves < moves_least:
        following = toward(mission, cell, mission.home) if cell != mission.home else -1
        if following < 0:
            following = path[moves - 1] if moves > 0 else legs.tracks[auv, 1]
        cell = following
        moves += 1
        path[moves] = cell
    return moves


@compiled
def hand_over(
    mission: MissionConstants,
    legs: Legs,
    auv: int,
    tour: Ints,
    behind: int,
    moves_least: int,
    now: int,
    room: Workspace,
) -> tuple[int, int, int]:
    """
    Give an AUV its next leg: as much of its tour as is allowed, else it stays in place.

    Returns the cells that it will be the first to enter, the moves to the last of them, and by how
    much L is broken.
    """
    auvs = legs.sizes.size
    before_count = follow(mission, legs, 0, auv, 1, room.before, room.ticks)
    after_count = follow(mission, legs, auvs - 1, auv, -1, room.after, room.ticks)
    spare = mission.limit_ticks - auvs * mission.handover_ticks
    moves = walk_on(mission, legs, auv, tour, moves_least, room.path)
    for place in range(1, moves + 1):
        cell_m = mission.centre_m[room.path[place]]
        ticks_there = ticks_near(mission, room.before, before_count, cell_m)
        ticks_there += ticks_near(mission, room.after, after_count, cell_m)
        if whole(ticks_there) > spare:
            moves = place - 1  # the UAV cannot come near enough to this one
            break
    late = 0
    length = 0
    size = 0
    while moves >= mission.moves_min:
        size = turn_round(room, moves, behind)
        length, ticks = lay_best(mission, room, before_count, after_count, size)
        if ticks <= spare:
            break
        moves -= 1
    if moves < mission.moves_min:
        moves = mission.moves_min
        length, late = stay(mission, legs, auv, before_count, after_count, spare, room)
        size = turn_round(room, moves, behind)
    if length > 0:
        legs.searches[auv, :length] = room.search[:length]
        legs.lengths[auv] = length
    legs.tracks[auv, :size] = room.track[:size]
    legs.sizes[auv] = size
    legs.to_meet[auv] = False
    legs.deadline_ticks[auv] = now + whole(moves * legs.ticks_per_cell[auv]) + mission.margin_ticks
    new = 0
    new_until = 0
    for place in range(moves - 1, -1, -1):  # the track is in searching order
        if not legs.entered[room.track[place]]:
            legs.entered[room.track[place]] = True
            new += 1
            new_until = moves - place
    while legs.begun[auv] < tour.size and legs.entered[tour[legs.begun[auv]]]:
        legs.begun[auv] += 1
    return new, new_until, late


@compiled
def turn_round(room: Workspace, moves: int, behind: int) -> int:
    """Write the track of the room's path and of what is behind its start; return its size."""
    for place in range(moves + 1):
        room.track[place] = room.path[moves - place]
    if behind < 0:
        return moves + 1
    room.track[moves + 1] = behind
    return moves + 2


@compiled
def stay(
    mission: MissionConstants,
    legs: Legs,
    auv: int,
    before_count: int,
    after_count: int,
    spare: int,
    room: Workspace,
) -> tuple[int, int]:
    """Lay out to move to and fro in place; return the search's length and what is over L."""
    start, partner = legs.tracks[auv, 0], legs.tracks[auv, 1]
    edge_m = mission.range_m * (1.0 + TOLERANCE)
    best = -1
    for edge in range(legs.sizes[auv] - 1):
        here, there = legs.tracks[auv, edge], legs.tracks[auv, edge + 1]
        if start not in (here, there):
            continue
        for place in range(legs.lengths[auv]):
            point_m = legs.searches[auv, place]
            if length_of(point_m - mission.centre_m[here]) > edge_m:
                continue
            if length_of(point_m - mission.centre_m[there]) > edge_m:
                continue
            ticks = ticks_to(mission, room.before, before_count, point_m)
            ticks += ticks_to(mission, room.after, after_count, point_m)
            if best < 0 or ticks < best:
                best = ticks
                partner = there if here == start else here
                room.search[0] = point_m
    for place in range(mission.moves_min + 1):
        room.path[place] = start if place % 2 == 0 else partner
    if best < 0:
        return 0, mission.limit_ticks
    return 1, max(0, best - spare)


# --- sorties -------------------------------------------------------------------------------------


@compiled
def depart(mission: MissionConstants, legs: Legs, now: int, room: Workspace) -> tuple[int, int]:
    """Lay the searches of the next sortie; return when it leaves, by how much it breaks L."""
    auvs = legs.sizes.size
    at_m = mission.c3_m
    kept = 0
    for auv in range(auvs):
        kept += hop(mission, at_m, legs.searches[auv, 0])
        kept += search_ticks(mission, legs.searches[auv], legs.lengths[auv])
        at_m = legs.searches[auv, legs.lengths[auv] - 1]
    kept += hop(mission, at_m, mission.c3_m)
    at_m = mission.c3_m
    anew = 0
    for auv in range(auvs):
        length, ticks = lay(mission, at_m, legs.tracks[auv], legs.sizes[auv], False, room.trial)
        anew += hop(mission, at_m, room.trial[0]) + ticks
        at_m = room.trial[length - 1]
    anew += hop(mission, at_m, mission.c3_m)
    if anew < kept:
        at_m = mission.c3_m
        for auv in range(auvs):
            search = legs.searches[auv]
            length, _ = lay(mission, at_m, legs.tracks[auv], legs.sizes[auv], False, search)
            legs.lengths[auv] = length
            at_m = search[length - 1]
    late = max(0, min(kept, anew) + auvs * mission.handover_ticks - mission.limit_ticks)
    punctual = legs.deadline_ticks[0] - hop(mission, mission.c3_m, legs.searches[0, 0])
    leaves = max(punctual, safe_departure(mission, legs, now, -1))
    edge_m = mission.range_m * (1.0 + TOLERANCE)
    for auv in range(auvs):  # one that is heard at C3 is met there, and the sortie begins
        if length_of(mission.centre_m[legs.tracks[auv, 0]] - mission.c3_m) <= edge_m:
            heard = max(legs.deadline_ticks[auv], now)
            leaves = min(leaves, max(heard, safe_departure(mission, legs, now, auv)))
    legs.to_meet[:] = True
    return leaves, late


@compiled
def safe_departure(mission: MissionConstants, legs: Legs, now: int, met: int) -> int:
    """Return from when on no wait makes a sortie longer than L, with one AUV met; -1 if none."""
    leaves = now
    rest = 0
    next_m = mission.c3_m
    for auv in range(legs.sizes.size - 1, -1, -1):
        if auv != met:
            search = legs.searches[auv]
            length = legs.lengths[auv]
            rest += hop(mission, search[length - 1], next_m) + mission.handover_ticks
            rest += search_ticks(mission, search, length)
            next_m = search[0]
            leaves = max(leaves, legs.deadline_ticks[auv] + rest - mission.limit_ticks)
    return leaves


@compiled
def fly(
    mission: MissionConstants,
    given: Legs,
    position: Position,
    tours: CellTours,
    stop: float,
    room: Workspace,
) -> Outcome:
    """
    Return the outcome of the mission that begins now with some tours.

    Parameters
    ----------
    mission, given, position
        The mission and its state, which is not changed.
    tours
        Of all AUVs.
    stop
        Tick at which a mission is given up that is longer than any of interest; how long what is
        left then takes is estimated.
    room
        Room to work in.

    """
    auvs = given.sizes.size
    legs = Legs(
        given.tracks.copy(),
        given.sizes.copy(),
        given.deadline_ticks.copy(),
        given.searches.copy(),
        given.lengths.copy(),
        given.to_meet.copy(),
        given.begun.copy(),
        given.ticks_per_cell,
        given.entered.copy(),
    )
    left = 0
    for place in range(tours.cells.size):
        left += not legs.entered[tours.cells[place]]
    last_new = np.zeros(auvs)
    found = np.zeros(auvs)
    for auv in range(auvs):
        last_new[auv] = max(0, legs.deadline_ticks[auv])
    is_met = position.met >= 0
    at_m = position.at_m
    edge_m = mission.range_m * (1.0 + TOLERANCE)
    in_flight = is_met
    now = 0
    explored = 0.0
    revisits = 0
    late = 0
    neglect = 0.0
    turn = 0
    waypoint = 0
    while left > 0 and now < stop:
        if not in_flight:
            now, more = depart(mission, legs, now, room)
            late += more
            at_m = mission.c3_m
            in_flight = True
            turn = 0
            waypoint = 0
        for auv in range(auvs):  # meetings at this tick
            behind = -1
            moves_least = mission.moves_min
            if is_met and auv == position.met:
                is_met = False
                behind = position.behind
                moves_least = position.moves_least
            else:
                if not legs.to_meet[auv] or legs.deadline_ticks[auv] > now:
                    continue
                if length_of(mission.centre_m[legs.tracks[auv, 0]] - at_m) > edge_m:
                    continue
                neglect += now - max(0, legs.deadline_ticks[auv])
            begin = 0 if auv == 0 else tours.ends[auv - 1]
            tour = tours.cells[begin : tours.ends[auv]]
            new, new_until, more = hand_over(
                mission, legs, auv, tour, behind, moves_least, now, room
            )
            late += more
            if new > 0:
                left -= new
                found[auv] += new
                revisits += new_until - new
                last_new[auv] = now + whole(new_until * legs.ticks_per_cell[auv])
        while turn < auvs:  # to the next waypoint that is of use
            if not legs.to_meet[turn]:
                turn += 1
                waypoint = 0
            elif at_m != legs.searches[turn, waypoint] or legs.deadline_ticks[turn] > now:
                break
            else:
                waypoint += 1
                if waypoint == legs.lengths[turn]:
                    legs.to_meet[turn] = False  # not on its track: it is not as was assumed
                    late += mission.limit_ticks
                    now += 1  # or a sortie that need not leave C3 would be flown for ever
        target_m = legs.searches[turn, waypoint] if turn < auvs else mission.c3_m
        if turn == auvs and at_m == target_m:
            in_flight = False
            continue
        now += 1
        way_m = target_m - at_m
        far_m = length_of(way_m)
        if far_m <= mission.step_m * (1.0 + TOLERANCE):
            at_m = target_m
        else:
            at_m += mission.step_m / far_m * way_m
    total = 0.0
    for auv in range(auvs):
        if left > 0:  # a mission that is not flown to its end goes on at the pace it had
            moves = 0
            cell = legs.tracks[auv, 0]
            begin = 0 if auv == 0 else tours.ends[auv - 1]
            for place in range(begin + legs.begun[auv], tours.ends[auv]):
                target = tours.cells[place]
                if not legs.entered[target]:
                    moves += distance(mission, cell, target)
                    cell = target
            if moves > 0:
                pace = legs.ticks_per_cell[auv]
                if found[auv] > 0:
                    took = legs.deadline_ticks[auv] - max(0, given.deadline_ticks[auv])
                    pace = max(pace, took / found[auv])
                last_new[auv] = max(now, legs.deadline_ticks[auv] + moves * pace)
        explored = max(explored, last_new[auv])
        total += last_new[auv]
    return Outcome(explored, auvs * explored - total, revisits, neglect, late, left)


# --- better tours --------------------------------------------------------------------------------


class Weights(NamedTuple):
    """What an outcome costs beside the time at which all is explored, in ticks each."""

    late: float
    revisit: float
    neglect: float
    idle: float


@compiled
def cost_of(outcome: Outcome, weights: Weights) -> float:
    """Return what an outcome costs."""
    return (
        outcome.explored_ticks
        + weights.late * outcome.late_ticks
        + weights.revisit * outcome.revisits
        + weights.neglect * outcome.neglect_ticks
        + weights.idle * outcome.idle_ticks
    )


LENGTH_SHARE = 0.2
"""
Ticks of the mission that a tick of each tour's length counts; the longest one counts whole.

Without it nothing would pull at the shorter tours, from which the longest one is to be relieved.
"""


@compiled
def lengths_of(mission: MissionConstants, legs: Legs, tours: CellTours) -> tuple[float, float]:
    """Return when the last tour is done if nobody ever waits, and what all tours' lengths cost."""
    last = 0.0
    total = 0.0
    place = 0
    for auv in range(tours.ends.size):
        cell = legs.tracks[auv, 0]
        moves = 0
        while place < tours.ends[auv]:
            moves += distance(mission, cell, tours.cells[place])
            cell = tours.cells[place]
            place += 1
        done = max(0, legs.deadline_ticks[auv]) + moves * legs.ticks_per_cell[auv]
        last = max(last, done)
        total += done
    return last, last + LENGTH_SHARE * total


@compiled
def find_places(tours: CellTours, owners: Ints, places: Ints) -> None:
    """Note for every cell in whose tour it is and where; owner -1 if in none."""
    owners[:] = -1
    place = 0
    for auv in range(tours.ends.size):
        while place < tours.ends[auv]:
            owners[tours.cells[place]] = auv
            places[tours.cells[place]] = place
            place += 1


@compiled
def reverse(cells: Ints, first: int, last: int) -> None:
    """Turn a part of a tour round."""
    while first < last:
        cells[first], cells[last] = cells[last], cells[first]
        first += 1
        last -= 1


@compiled
def copy_part(tours: CellTours, first: int, stop: int, new: CellTours, size: int) -> int:
    """Append a part of some tours to others that hold ``size`` cells; return how many then."""
    for place in range(first, stop):
        new.cells[size] = tours.cells[place]
        size += 1
    return size


@compiled
def exchange_tails(
    tours: CellTours, auv: int, cut: int, other: int, other_cut: int, new: CellTours
) -> None:
    """Let two tours end as the other one did, from a place in each."""
    size = 0
    begin = 0
    for each in range(tours.ends.size):
        end = tours.ends[each]
        if each == auv:
            size = copy_part(tours, begin, cut, new, size)
            size = copy_part(tours, other_cut, tours.ends[other], new, size)
        elif each == other:
            size = copy_part(tours, begin, other_cut, new, size)
            size = copy_part(tours, cut, tours.ends[auv], new, size)
        else:
            size = copy_part(tours, begin, end, new, size)
        begin = end
        new.ends[each] = size


@compiled
def move_part(
    tours: CellTours,
    first: int,
    stop: int,
    is_reversed: bool,
    beside: int,
    is_behind: bool,
    new: CellTours,
) -> None:
    """Put a part of a tour, as it is or turned round, before or behind a cell elsewhere."""
    size = 0
    place = 0
    for auv in range(tours.ends.size):
        while place < tours.ends[auv]:
            if place == beside:
                if is_behind:
                    size = copy_part(tours, place, place + 1, new, size)
                size = copy_part(tours, first, stop, new, size)
                if is_reversed:
                    reverse(new.cells, size - stop + first, size - 1)
                if not is_behind:
                    size = copy_part(tours, place, place + 1, new, size)
            elif not first <= place < stop:
                size = copy_part(tours, place, place + 1, new, size)
            place += 1
        new.ends[auv] = size


@compiled
def draw(rng: np.random.Generator, stop: int) -> int:
    """Return a number from 0 to below ``stop``."""
    return int(rng.random() * stop)


PART_MAX = 8
"""The longest part of a tour that is moved elsewhere, cells: about as much as a leg."""


@compiled
def propose(
    mission: MissionConstants,
    tours: CellTours,
    owners: Ints,
    places: Ints,
    rng: np.random.Generator,
    new: CellTours,
) -> bool:
    """Write tours in which a cell and a neighbour of it come one after the other; False if not."""
    if tours.cells.size == 0:
        return False  # nothing is left to be entered
    cell = tours.cells[draw(rng, tours.cells.size)]
    side = draw(rng, 4)
    col = mission.col[cell] + (1 if side == 0 else -1 if side == 2 else 0)
    row = mission.row[cell] + (1 if side == 1 else -1 if side == 3 else 0)
    if not (0 <= col <= mission.col[-1] and 0 <= row <= mission.row[-1]):
        return False
    neighbour = row * (mission.col[-1] + 1) + col
    auv = owners[cell]
    place = places[cell]
    begin = 0 if auv == 0 else tours.ends[auv - 1]
    end = tours.ends[auv]
    other = owners[neighbour]
    new.cells[:] = tours.cells
    new.ends[:] = tours.ends
    if other < 0:  # an AUV may be there: begin a tour with this cell
        other = draw(rng, tours.ends.size)
        if other == auv:
            reverse(new.cells, begin, place)
        else:
            exchange_tails(
                tours, auv, place, other, 0 if other == 0 else tours.ends[other - 1], new
            )
        return True
    beside = places[neighbour]
    if auv == other and abs(place - beside) == 1 and rng.random() < 0.7:
        return False  # they are already, and are seldom to be parted
    if rng.random() < 0.5:
        if auv != other:
            exchange_tails(tours, auv, place + 1, other, beside, new)
        elif place < beside:
            reverse(new.cells, place + 1, beside)
        elif rng.random() < 0.5:
            reverse(new.cells, beside + 1, place)
        else:
            reverse(new.cells, beside, place - 1)
        return True
    size = 1 + draw(rng, PART_MAX)
    is_head = rng.random() < 0.5  # the part begins with the cell, or ends with it
    first = place if is_head else max(begin, place + 1 - size)
    stop = min(place + size, end) if is_head else place + 1
    if first <= beside < stop:
        return False
    is_behind = rng.random() < 0.5
    move_part(tours, first, stop, is_head != is_behind, beside, is_behind, new)
    return True


class CoolingSchedule(NamedTuple):
    """How tours are improved by simulated annealing."""

    tries: int
    """So many tours are looked at."""
    start_temperature: float
    """Tours that are so many ticks worse are taken with probability 1/e at the beginning ..."""
    end_temperature: float
    """... and those that are so many ticks worse at the end."""


FORLORN = 10.0
"""Tours that are so many temperatures worse are taken once in 22,000 times: as good as never."""

HOPELESS = 2.0
"""
A mission that takes so many times as long as its tours without any wait, and L, is not flown on.

One that comes to a standstill would never end.
"""


@compiled
def anneal(
    mission: MissionConstants,
    legs: Legs,
    position: Position,
    tours: CellTours,
    is_flown: bool,
    weights: Weights,
    schedule: CoolingSchedule,
    rng: np.random.Generator,
) -> tuple[CellTours, CellTours, float]:
    """
    Improve tours by simulated annealing; return the last ones, the best ones and their cost.

    Without flying, the tours' lengths are all that counts. Else they are looked at first: what
    makes tours longer makes missions longer, and is known a hundred times as fast.
    """
    room = make_workspace(legs)
    owners = np.empty(legs.entered.size, np.int64)
    places = np.empty(legs.entered.size, np.int64)
    new = CellTours(tours.cells.copy(), tours.ends.copy())
    best = tours
    length = cost = best_cost = math.inf
    last, _ = lengths_of(mission, legs, tours)
    stop_at_last = stop = HOPELESS * (last + mission.limit_ticks)
    temperature = schedule.start_temperature
    tries = 0
    for proposal in range(100 * schedule.tries):  # those that come to nothing must come to an end
        if tries == schedule.tries:
            break
        if proposal > 0 and not propose(mission, tours, owners, places, rng, new):
            continue
        _, new_length = lengths_of(mission, legs, new)
        if not is_flown:
            new_cost = new_length
        elif proposal > 0 and new_length > length - temperature * math.log(rng.random()):
            continue
        else:
            new_cost = cost_of(fly(mission, legs, position, new, stop, room), weights)
        tries += 1
        share = tries / schedule.tries
        temperature = (
            schedule.start_temperature
            * (schedule.end_temperature / schedule.start_temperature) ** share
        )
        if new_cost <= cost or rng.random() < math.exp((cost - new_cost) / temperature):
            cost = new_cost
            length = new_length
            tours = CellTours(new.cells.copy(), new.ends.copy())
            find_places(tours, owners, places)
            if cost < best_cost:
                best_cost = cost
                best = tours
        stop = min(cost + FORLORN * temperature, stop_at_last)
    return tours, best, best_cost


@compiled
def foresee(
    mission: MissionConstants, legs: Legs, position: Position, tours: CellTours
) -> Outcome:
    """Return the outcome of a mission that is flown to its end, if it has one."""
    last, _ = lengths_of(mission, legs, tours)
    stop = HOPELESS * (last + mission.limit_ticks)
    return fly(mission, legs, position, tours, stop, make_workspace(legs))
