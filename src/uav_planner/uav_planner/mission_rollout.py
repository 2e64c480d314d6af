"""
The rest of a mission flown in some 50 microseconds: what tours of the AUVs would come to.

A *tour* is the list of cells that an AUV is still to enter, in order; its next legs are cut from
it. Flown are the real rules in whole ticks: searches are laid, paths kept to the guaranteed set,
sorties departed, AUVs met and made to wait as `guarantee`, `sortie` and the UAV's agent do it, as
long as every AUV surfaces where and when its path ends. Complex numbers are points, east + i north
in metres; ticks count from now; cells are numbered row by row.

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


class Sea(NamedTuple):
    """What stays the same while tours are compared."""

    col: Ints
    """Column of every cell; looked up, since to divide takes as long as all the rest."""
    row: Ints
    centre_m: Points
    """Centre of every cell."""
    range_m: float
    step_m: float
    c3_m: complex
    limit: int
    """L, ticks."""
    handover: int
    """Ticks kept free for each meeting."""
    margin: int
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
    """Cells of each present leg in searching order, shape (auvs, moves_max + 2)."""
    sizes: Ints
    """How many cells each track has."""
    deadlines: Ints
    """Tick at which each is at the surface, at the first cell of its track."""
    searches: Points
    """Waypoints of each search, shape (auvs, moves_max + 2)."""
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

    explored: float
    """When the last cell is entered."""
    idle: float
    """How long before that AUVs had entered their last, sum."""
    revisits: int
    neglect: float
    late: int
    """By how much rounds were longer than L, sum."""


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
def hop(sea: Sea, start_m: complex, end_m: complex) -> int:
    """Return `hop_ticks`."""
    return whole(length_of(end_m - start_m) / sea.step_m)


@compiled
def distance(sea: Sea, cell: int, other: int) -> int:
    """Return the moves from one cell to another."""
    if sea.moves_between.shape[0] > 0:
        return int(sea.moves_between[cell, other])
    return int(abs(sea.col[cell] - sea.col[other]) + abs(sea.row[cell] - sea.row[other]))


@compiled
def toward(sea: Sea, cell: int, target: int) -> int:
    """Return the next cell on the way to another one, the longer side first; < 0 if none leads."""
    if sea.next_cell.shape[0] > 0:
        return int(sea.next_cell[cell, target])
    east = sea.col[target] - sea.col[cell]
    north = sea.row[target] - sea.row[cell]
    if abs(east) >= abs(north):
        return cell + (1 if east > 0 else -1)
    cols = int(sea.col[-1]) + 1
    return cell + (cols if north > 0 else -cols)


@compiled
def lay(
    sea: Sea, origin_m: complex, track: Ints, size: int, is_reversed: bool, search: Points
) -> tuple[int, int]:
    """Write `lay_search` of a track to ``search``; return its length and its ticks."""
    edge_m = sea.range_m * (1.0 + TOLERANCE)
    at_m = origin_m
    length = 0
    ticks = 0
    for place in range(size):
        cell = track[size - 1 - place if is_reversed else place]
        way_m = sea.centre_m[cell] - at_m
        far_m = length_of(way_m)
        is_far = far_m > edge_m
        if is_far:
            more = whole((far_m - sea.range_m) / sea.step_m)
            if far_m - more * sea.step_m > edge_m:
                more += 1
            at_m += min(more * sea.step_m / far_m, 1.0) * way_m
        if is_far or length == 0:
            if length > 0:
                ticks += hop(sea, search[length - 1], at_m)
            search[length] = at_m
            length += 1
    return length, ticks


@compiled
def search_ticks(sea: Sea, search: Points, length: int) -> int:
    """Return how long it takes along a search."""
    ticks = 0
    for place in range(length - 1):
        ticks += hop(sea, search[place], search[place + 1])
    return ticks


# --- the guaranteed set --------------------------------------------------------------------------


@compiled
def ticks_to(sea: Sea, reach: Reach, count: int, point_m: complex) -> int:
    """Return how long it takes to a point at worst."""
    ticks = 0
    for place in range(count):
        ticks = max(ticks, int(reach.ticks[place]) + hop(sea, reach.points[place], point_m))
    return ticks


@compiled
def ticks_near(sea: Sea, reach: Reach, count: int, point_m: complex) -> float:
    """Return how long it takes at least, in parts of ticks, until a point is in range at worst."""
    ticks = 0.0
    for place in range(count):
        way_m = max(0.0, length_of(reach.points[place] - point_m) - sea.range_m)
        ticks = max(ticks, reach.ticks[place] + way_m / sea.step_m)
    return ticks


@compiled
def follow(
    sea: Sea, legs: Legs, first: int, end: int, step: int, reach: Reach, scratch: Ints
) -> int:
    """Write how far a round has come after some AUVs to ``reach``; return its number of points."""
    reach.points[0] = sea.c3_m
    reach.ticks[0] = 0
    count = 1
    for auv in range(first, end, step):
        search = legs.searches[auv]
        length = int(legs.lengths[auv])
        if legs.to_meet[auv]:
            for place in range(length):
                scratch[place] = ticks_to(sea, reach, count, search[place])
            count = length
            for place in range(length):
                reach.points[place] = search[place]
                reach.ticks[place] = scratch[place]
        else:
            begin_m = search[0] if step > 0 else search[length - 1]
            ticks = ticks_to(sea, reach, count, begin_m) + search_ticks(sea, search, length)
            reach.points[0] = search[length - 1] if step > 0 else search[0]
            reach.ticks[0] = ticks
            count = 1
    return count


class Desk(NamedTuple):
    """Room to work in, so that nothing is made anew at every meeting."""

    before: Reach
    after: Reach
    ticks: Ints
    path: Ints
    track: Ints
    trial: Points
    search: Points


@compiled
def make_desk(legs: Legs) -> Desk:
    """Return the room for the longest paths and searches."""
    cells = legs.searches.shape[1]
    return Desk(
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
    sea: Sea, desk: Desk, before_count: int, after_count: int, size: int
) -> tuple[int, int]:
    """Lay the search of the desk's track that makes the shortest round; its length, the round."""
    best = -1
    best_length = 0
    for origin in range(2):  # where else the UAV may come from or go on to adds little
        origin_m = desk.before.points[before_count - 1]
        if origin == 1:
            origin_m = desk.after.points[after_count - 1]
        for is_reversed in (False, True):
            length, ticks = lay(sea, origin_m, desk.track, size, is_reversed, desk.trial)
            ticks += ticks_to(sea, desk.before, before_count, desk.trial[0])
            ticks += ticks_to(sea, desk.after, after_count, desk.trial[length - 1])
            if best < 0 or ticks < best:
                best = ticks
                best_length = length
                desk.search[:length] = desk.trial[:length]
    return best_length, best


# --- a meeting -----------------------------------------------------------------------------------


@compiled
def walk_on(sea: Sea, legs: Legs, auv: int, tour: Ints, path: Ints) -> int:
    """Write the next moves along a tour to ``path``; return how many there are, at most q."""
    cell = path[0] = legs.tracks[auv, 0]
    moves = 0
    for place in range(legs.begun[auv], tour.size):
        target = tour[place]
        if legs.entered[target]:
            continue
        while cell != target:
            if moves == sea.moves_max:
                return moves
            following = toward(sea, cell, target)
            if following < 0:
                break
            cell = following
            moves += 1
            path[moves] = cell
    while 0 < moves < sea.moves_min:  # to and fro at the end: no path may be shorter
        path[moves + 1] = path[moves - 1]
        moves += 1
    return moves


@compiled
def hand_over(
    sea: Sea, legs: Legs, auv: int, tour: Ints, behind: int, now: int, desk: Desk
) -> tuple[int, int, int]:
    """
    Give an AUV its next leg: as much of its tour as is allowed, else it stays in place.

    Returns the cells that it will be the first to enter, the revisits and by how much L is broken.
    """
    auvs = legs.sizes.size
    before_count = follow(sea, legs, 0, auv, 1, desk.before, desk.ticks)
    after_count = follow(sea, legs, auvs - 1, auv, -1, desk.after, desk.ticks)
    spare = sea.limit - auvs * sea.handover
    moves = walk_on(sea, legs, auv, tour, desk.path)
    for place in range(1, moves + 1):
        cell_m = sea.centre_m[desk.path[place]]
        ticks_there = ticks_near(sea, desk.before, before_count, cell_m)
        ticks_there += ticks_near(sea, desk.after, after_count, cell_m)
        if ticks_there > spare * (1.0 + TOLERANCE):
            moves = place - 1  # the UAV cannot come near enough to this one
            break
    late = 0
    length = 0
    size = 0
    while moves >= sea.moves_min:
        for place in range(moves + 1):
            desk.track[place] = desk.path[moves - place]
        size = moves + 1
        if behind >= 0:
            desk.track[size] = behind
            size += 1
        length, ticks = lay_best(sea, desk, before_count, after_count, size)
        if ticks <= spare:
            break
        moves -= 1
    if moves < sea.moves_min:
        moves = sea.moves_min
        length, size, late = stay(sea, legs, auv, before_count, after_count, spare, desk)
    if length > 0:
        legs.searches[auv, :length] = desk.search[:length]
        legs.lengths[auv] = length
    legs.tracks[auv, :size] = desk.track[:size]
    legs.sizes[auv] = size
    legs.to_meet[auv] = False
    legs.deadlines[auv] = now + whole(moves * legs.ticks_per_cell[auv]) + sea.margin
    new = 0
    for place in range(moves - 1, -1, -1):  # the track is in searching order
        new += not legs.entered[desk.track[place]]
        legs.entered[desk.track[place]] = True
    while legs.begun[auv] < tour.size and legs.entered[tour[legs.begun[auv]]]:
        legs.begun[auv] += 1
    return new, moves - new, late


@compiled
def stay(
    sea: Sea, legs: Legs, auv: int, before_count: int, after_count: int, spare: int, desk: Desk
) -> tuple[int, int, int]:
    """Lay out to move to and fro in place; the search's length, the track's, what is over L."""
    start, partner = legs.tracks[auv, 0], legs.tracks[auv, 1]
    edge_m = sea.range_m * (1.0 + TOLERANCE)
    best = -1
    for place in range(legs.lengths[auv]):
        point_m = legs.searches[auv, place]
        if length_of(point_m - sea.centre_m[start]) > edge_m:
            continue
        if length_of(point_m - sea.centre_m[partner]) > edge_m:
            continue
        ticks = ticks_to(sea, desk.before, before_count, point_m)
        ticks += ticks_to(sea, desk.after, after_count, point_m)
        if best < 0 or ticks < best:
            best = ticks
            desk.search[0] = point_m
    for place in range(sea.moves_min + 1):
        is_at_start = (sea.moves_min - place) % 2 == 0
        desk.track[place] = start if is_at_start else partner
    if best < 0:
        return 0, sea.moves_min + 1, sea.limit
    return 1, sea.moves_min + 1, max(0, best - spare)


# --- sorties -------------------------------------------------------------------------------------


@compiled
def depart(sea: Sea, legs: Legs, now: int, desk: Desk) -> tuple[int, int]:
    """Lay the searches of the next sortie; return when it leaves, by how much it breaks L."""
    auvs = legs.sizes.size
    at_m = sea.c3_m
    kept = 0
    for auv in range(auvs):
        kept += hop(sea, at_m, legs.searches[auv, 0])
        kept += search_ticks(sea, legs.searches[auv], legs.lengths[auv])
        at_m = legs.searches[auv, legs.lengths[auv] - 1]
    kept += hop(sea, at_m, sea.c3_m)
    at_m = sea.c3_m
    anew = 0
    for auv in range(auvs):
        length, ticks = lay(sea, at_m, legs.tracks[auv], legs.sizes[auv], False, desk.trial)
        anew += hop(sea, at_m, desk.trial[0]) + ticks
        at_m = desk.trial[length - 1]
    anew += hop(sea, at_m, sea.c3_m)
    if anew < kept:
        at_m = sea.c3_m
        for auv in range(auvs):
            search = legs.searches[auv]
            length, _ = lay(sea, at_m, legs.tracks[auv], legs.sizes[auv], False, search)
            legs.lengths[auv] = length
            at_m = search[length - 1]
    late = max(0, min(kept, anew) + auvs * sea.handover - sea.limit)
    leaves = max(now, legs.deadlines[0] - hop(sea, sea.c3_m, legs.searches[0, 0]))
    rest = 0
    next_m = sea.c3_m
    for auv in range(auvs - 1, -1, -1):
        rest += hop(sea, legs.searches[auv, legs.lengths[auv] - 1], next_m) + sea.handover
        rest += search_ticks(sea, legs.searches[auv], legs.lengths[auv])
        next_m = legs.searches[auv, 0]
        leaves = max(leaves, legs.deadlines[auv] + rest - sea.limit)
    legs.to_meet[:] = True
    return leaves, late


@compiled
def fly(
    sea: Sea,
    given: Legs,
    position: Position,
    tours: CellTours,
    sorties: int,
    stop: float,
    desk: Desk,
) -> Outcome:
    """
    Return the outcome of the mission that begins now with some tours.

    Parameters
    ----------
    sea, given, position
        The mission and its state, which is not changed.
    tours
        Of all AUVs.
    sorties
        So many are flown, the one under way included; what is left then is estimated.
    stop
        Tick at which a mission is given up that is longer than any of interest.
    desk
        Room to work in.

    """
    auvs = given.sizes.size
    legs = Legs(
        given.tracks.copy(),
        given.sizes.copy(),
        given.deadlines.copy(),
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
        last_new[auv] = max(0, legs.deadlines[auv])
    is_met = position.met >= 0
    at_m = position.at_m
    edge_m = sea.range_m * (1.0 + TOLERANCE)
    in_flight = is_met
    now = 0
    explored = 0.0
    revisits = 0
    late = 0
    neglect = 0.0
    flown = 0
    turn = 0
    waypoint = 0
    while left > 0 and now < stop:
        if not in_flight:
            if flown == sorties:
                break
            now, more = depart(sea, legs, now, desk)
            late += more
            at_m = sea.c3_m
            in_flight = True
            turn = 0
            waypoint = 0
        for auv in range(auvs):  # meetings at this tick
            behind = -1
            if is_met and auv == position.met:
                is_met = False
                behind = position.behind
            else:
                if not legs.to_meet[auv] or legs.deadlines[auv] > now:
                    continue
                if length_of(sea.centre_m[legs.tracks[auv, 0]] - at_m) > edge_m:
                    continue
                neglect += now - max(0, legs.deadlines[auv])
            begin = 0 if auv == 0 else tours.ends[auv - 1]
            tour = tours.cells[begin : tours.ends[auv]]
            new, again, more = hand_over(sea, legs, auv, tour, behind, now, desk)
            revisits += again
            late += more
            if new > 0:
                left -= new
                found[auv] += new
                last_new[auv] = legs.deadlines[auv]
        while turn < auvs:  # to the next waypoint that is of use
            if not legs.to_meet[turn]:
                turn += 1
                waypoint = 0
            elif at_m != legs.searches[turn, waypoint] or legs.deadlines[turn] > now:
                break
            else:
                waypoint += 1
                if waypoint == legs.lengths[turn]:
                    legs.to_meet[turn] = False  # not on its track: it is not as was assumed
                    late += sea.limit
        target_m = legs.searches[turn, waypoint] if turn < auvs else sea.c3_m
        if turn == auvs and at_m == target_m:
            in_flight = False
            flown += 1
            continue
        now += 1
        way_m = target_m - at_m
        far_m = length_of(way_m)
        if far_m <= sea.step_m * (1.0 + TOLERANCE):
            at_m = target_m
        else:
            at_m += sea.step_m / far_m * way_m
    total = 0.0
    for auv in range(auvs):
        if left > 0:  # a mission that is not flown to its end goes on at the pace it had
            moves = 0
            cell = legs.tracks[auv, 0]
            begin = 0 if auv == 0 else tours.ends[auv - 1]
            for place in range(begin + legs.begun[auv], tours.ends[auv]):
                target = tours.cells[place]
                if not legs.entered[target]:
                    moves += distance(sea, cell, target)
                    cell = target
            if moves > 0:
                pace = legs.ticks_per_cell[auv]
                if found[auv] > 0:
                    took = legs.deadlines[auv] - max(0, given.deadlines[auv])
                    pace = max(pace, took / found[auv])
                last_new[auv] = max(now, legs.deadlines[auv] + moves * pace)
        explored = max(explored, last_new[auv])
        total += last_new[auv]
    return Outcome(explored, auvs * explored - total, revisits, neglect, late)


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
        outcome.explored
        + weights.late * outcome.late
        + weights.revisit * outcome.revisits
        + weights.neglect * outcome.neglect
        + weights.idle * outcome.idle
    )


LENGTH_SHARE = 0.2
"""Ticks of the mission that a tick of each tour's length counts; the longest one counts whole."""


@compiled
def lengths_of(sea: Sea, legs: Legs, tours: CellTours) -> tuple[float, float]:
    """Return when the last tour is done if nobody ever waits, and what all tours' lengths cost."""
    last = 0.0
    total = 0.0
    place = 0
    for auv in range(tours.ends.size):
        cell = legs.tracks[auv, 0]
        moves = 0
        while place < tours.ends[auv]:
            moves += distance(sea, cell, tours.cells[place])
            cell = tours.cells[place]
            place += 1
        done = max(0, legs.deadlines[auv]) + moves * legs.ticks_per_cell[auv]
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
def swap_tails(
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
"""The longest part of a tour that is moved elsewhere, cells."""


@compiled
def propose(
    sea: Sea,
    tours: CellTours,
    owners: Ints,
    places: Ints,
    rng: np.random.Generator,
    new: CellTours,
) -> bool:
    """Write tours in which a cell and a neighbour of it come one after the other; False if not."""
    cell = tours.cells[draw(rng, tours.cells.size)]
    side = draw(rng, 4)
    col = sea.col[cell] + (1 if side == 0 else -1 if side == 2 else 0)
    row = sea.row[cell] + (1 if side == 1 else -1 if side == 3 else 0)
    if not (0 <= col <= sea.col[-1] and 0 <= row <= sea.row[-1]):
        return False
    neighbour = row * (sea.col[-1] + 1) + col
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
            swap_tails(tours, auv, place, other, 0 if other == 0 else tours.ends[other - 1], new)
        return True
    beside = places[neighbour]
    if auv == other and abs(place - beside) == 1 and rng.random() < 0.7:
        return False  # they are already, and are seldom to be parted
    if rng.random() < 0.5:
        if auv != other:
            swap_tails(tours, auv, place + 1, other, beside, new)
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


class Cooling(NamedTuple):
    """How tours are improved by simulated annealing."""

    tries: int
    """So many tours are looked at."""
    warmth: float
    """Tours that are so many ticks worse are taken with probability 1/e at the beginning ..."""
    coolness: float
    """... and those that are so many ticks worse at the end."""


FORLORN = 10.0
"""Tours that are so many temperatures worse are as good as never taken."""

HOPELESS = 2.0
"""A mission that takes so many times as long as its tours without any wait is not flown on."""


@compiled
def anneal(
    sea: Sea,
    legs: Legs,
    position: Position,
    tours: CellTours,
    sorties: int,
    weights: Weights,
    cooling: Cooling,
    rng: np.random.Generator,
) -> tuple[CellTours, CellTours, float]:
    """
    Improve tours by simulated annealing; return the last ones, the best ones and their cost.

    With ``sorties`` 0 nothing is flown: then the tours' lengths are all that counts. Else they are
    looked at first: what makes tours longer makes missions longer, and is known a hundred times as
    fast.
    """
    desk = make_desk(legs)
    owners = np.empty(legs.entered.size, np.int64)
    places = np.empty(legs.entered.size, np.int64)
    new = CellTours(tours.cells.copy(), tours.ends.copy())
    best = tours
    length = cost = best_cost = math.inf
    last, _ = lengths_of(sea, legs, tours)
    stop_at_last = stop = HOPELESS * (last + sea.limit)
    temperature = cooling.warmth
    tries = 0
    for proposal in range(100 * cooling.tries):  # those that come to nothing must come to an end
        if tries == cooling.tries:
            break
        if proposal > 0 and not propose(sea, tours, owners, places, rng, new):
            continue
        _, new_length = lengths_of(sea, legs, new)
        if sorties == 0:
            new_cost = new_length
        elif proposal > 0 and new_length > length - temperature * math.log(rng.random()):
            continue
        else:
            new_cost = cost_of(fly(sea, legs, position, new, sorties, stop, desk), weights)
        tries += 1
        share = tries / cooling.tries
        temperature = cooling.warmth * (cooling.coolness / cooling.warmth) ** share
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
def foresee(sea: Sea, legs: Legs, position: Position, tours: CellTours) -> Outcome:
    """Return the outcome of a mission that is flown to its end, if it has one."""
    last, _ = lengths_of(sea, legs, tours)
    stop = HOPELESS * (last + sea.limit)
    return fly(sea, legs, position, tours, legs.entered.size, stop, make_desk(legs))
