"""
The compiled part of `leg_search`: a depth-first branch and bound over paths.

Complex numbers are points, east + i north in metres; ticks are without those of the hand-overs.
All of it is in one file for the reason that `compiled` gives.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from msgs_json.geometry import TOLERANCE
from uav_planner.compilation import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Points = NDArray[np.complex128]

ALONG, AGAINST = 0, 1
"""Ways to search a path: along its track, from `P_q` on, and against it."""

ROUNDING = 1e-6
"""How far a number of ticks that is summed up may be off; far less than any two differ by."""


class Window(NamedTuple):
    """The cells that a path can reach, and a border, numbered row by row; `P_0` is the middle."""

    side: int
    """So many cells each way."""
    gains: Floats
    """What it gains to enter each cell next."""
    ends: Floats
    """What it is worth to end in each, shape (1 or 2, cells)."""
    is_open: NDArray[np.bool_]
    """Whether a path may enter it."""
    steps: NDArray[np.int64]
    """What the number of a cell grows by with a move, by direction, in tie order."""
    corner_m: complex
    """Centre of the first cell."""
    cell_m: float


class Reach(NamedTuple):
    """Where the UAV can be after part of a round, and after how many ticks at worst."""

    points_m: Points
    ticks: Floats


class Rounds(NamedTuple):
    """What the round of a path depends on."""

    before: Reach
    after: Reach
    origins_m: Points
    behind_m: Points
    """Of the cell toward which the AUV lies; empty where there is none."""
    c3_m: complex
    range_m: float
    step_m: float
    limit: float
    """Ticks that a round may take."""
    limit_alone: float
    """Ticks that a sortie to this AUV alone may take."""


class Rules(NamedTuple):
    """Which paths are looked at, and how they are compared."""

    turn_cost: float
    tick_cost: float
    """Of each tick of the round."""
    margin: float
    """Scores that differ by less are alike."""
    moves_min: int
    moves_max: int
    is_first_fastest: bool
    """Whether the first move varies fastest from one path to the next in tie order."""


@compiled
def centre_m(window: Window, cell: int) -> complex:
    """Return the centre of a cell."""
    col, row = cell % window.side, cell // window.side
    return window.corner_m + window.cell_m * complex(float(col), float(row))


@compiled
def whole(ticks: float) -> float:
    """Return `whole_ticks`."""
    return float(math.ceil(ticks - TOLERANCE * max(1.0, abs(ticks))))


@compiled
def length_of(way_m: complex) -> float:
    """Return the length of a way; `abs` minds overflows and is slower."""
    return math.sqrt(way_m.real * way_m.real + way_m.imag * way_m.imag)


@compiled
def ticks_to(rounds: Rounds, reach: Reach, point_m: complex) -> float:
    """Return how long it takes to a point at worst."""
    ticks = 0.0
    for place in range(reach.ticks.size):
        hop = whole(length_of(reach.points_m[place] - point_m) / rounds.step_m)
        ticks = max(ticks, reach.ticks[place] + hop)
    return ticks


# --- rounds --------------------------------------------------------------------------------------


@compiled
def round_of(
    window: Window,
    rounds: Rounds,
    path: NDArray[np.int64],
    moves: int,
    least: Floats,
    most: float,
) -> float:
    """
    Return the shortest round with a path, infinite if it takes more than ``most`` ticks.

    It is laid along the track of the path and against it, from each origin, as
    `GuaranteedPaths.round_ticks_each` does it; not where it takes too long at the ``least``.
    """
    edge_m = rounds.range_m * (1.0 + TOLERANCE)
    behind = rounds.behind_m.size
    best = np.inf
    for way in range(2):
        for origin_m in rounds.origins_m:
            if least[way] > most:
                break
            at_m = first_m = origin_m
            before = search = 0.0
            for place in range(moves + 1 + behind):
                index = moves - place if way == ALONG else place - behind
                cell_m = centre_m(window, path[index]) if index >= 0 else rounds.behind_m[0]
                way_m = cell_m - at_m
                far_m = length_of(way_m)
                ticks = 0.0
                if far_m > edge_m:
                    ticks = whole((far_m - rounds.range_m) / rounds.step_m)
                    if far_m - ticks * rounds.step_m > edge_m:
                        ticks += 1.0
                    at_m += min(ticks * rounds.step_m / far_m, 1.0) * way_m
                if place == 0:
                    first_m = at_m
                    before = ticks_to(rounds, rounds.before, first_m)
                else:
                    search += ticks
                if before + search > most:
                    break
            else:
                total = before + search + ticks_to(rounds, rounds.after, at_m)
                alone = search + whole(length_of(first_m - rounds.c3_m) / rounds.step_m)
                alone += whole(length_of(at_m - rounds.c3_m) / rounds.step_m)
                if total <= most and alone <= rounds.limit_alone:
                    best = total
                    most = total - 1.0
    return best


@compiled
def unit(way_m: complex) -> complex:
    """Return a way's direction as a vector of length 1; 0 where it has none."""
    return way_m / length_of(way_m) if way_m != 0.0 else way_m


@compiled
def least_ticks(rounds: Rounds, first_m: complex, then_m: complex) -> float:
    """
    Return how many ticks a round takes at least that comes within R of two points, in this order.

    The way from a to b by a point within R of c and one within R of d is no shorter than

        u (c - a) + v (d - c) + w (b - d) - R |u - v| - R |v - w|

    whatever vectors u, v and w no longer than 1 are chosen, since no way is shorter than its
    shadow. Good ones are the directions of the way by c and d themselves.
    """
    edge_m = rounds.range_m * (1.0 + TOLERANCE)
    ticks = 0.0
    across_m = then_m - first_m
    for begin in range(rounds.before.ticks.size):
        there_m = first_m - rounds.before.points_m[begin]
        u = unit(there_m)
        v = unit(across_m) if across_m != 0.0 else u
        for end in range(rounds.after.ticks.size):
            back_m = rounds.after.points_m[end] - then_m
            way_m = length_of(there_m) + length_of(across_m) + length_of(back_m)
            way_m -= edge_m * (length_of(u - v) + length_of(v - unit(back_m)))
            both = rounds.before.ticks[begin] + rounds.after.ticks[end]
            ticks = max(ticks, both + way_m / rounds.step_m)
    return float(math.ceil(ticks - ROUNDING * max(1.0, ticks)))


@compiled
def least_rounds(window: Window, rounds: Rounds, moves: int, least: Floats) -> None:
    """
    Write how many ticks a round takes at least with a path through each cell: shape (2, cells).

    Searched along its track the path ends at `P_0` and the cell behind, against it it begins
    there. Infinite stay cells where that is more than allowed and those that no path may come to.
    """
    middle = window.side // 2
    start = window.gains.size // 2
    start_m = centre_m(window, start)
    behind_m = rounds.behind_m[0] if rounds.behind_m.size > 0 else start_m
    base = max(least_ticks(rounds, start_m, start_m), least_ticks(rounds, behind_m, behind_m))
    for col in range(window.side):
        for row in range(window.side):
            cell = row * window.side + col
            away = abs(col - middle) + abs(row - middle)
            if cell != start and (away > moves or not window.is_open[cell]):
                continue
            cell_m = centre_m(window, cell)
            ticks = max(base, least_ticks(rounds, cell_m, cell_m))
            along = against = ticks
            for at_m in (start_m, behind_m):
                along = max(along, least_ticks(rounds, cell_m, at_m))
                against = max(against, least_ticks(rounds, at_m, cell_m))
            if along <= rounds.limit:
                least[ALONG, cell] = along
            if against <= rounds.limit:
                least[AGAINST, cell] = against


# --- the outlook ---------------------------------------------------------------------------------


class Bounds(NamedTuple):
    """What paths can come to at best."""

    rounds: Floats
    """`least_rounds`."""
    either: Floats
    """The less of them, of every cell."""
    base: float
    """Ticks of the shortest round, level 0."""
    width: float
    """Ticks from one level to the next."""
    outlook: NDArray[np.float64]
    """
    The most that more moves can add to a score, the round and the end included.

    By the moves left, the cell where the AUV is, the level of its round so far, whether it has
    entered something new, and the direction of its last move. Elements that no path comes to are
    undefined.
    """


@compiled
def level_of(base: float, width: float, ticks: float) -> int:
    """Return the level of a round."""
    return int((ticks - base) / width)


@compiled
def fill_outlook(window: Window, rules: Rules, bounds: Bounds) -> None:
    """Work out the outlook from the end of paths to their beginning."""
    middle = window.side // 2
    for left in range(rules.moves_max):
        made = rules.moves_max - left
        for col in range(middle - made, middle + made + 1):
            away = abs(col - middle)
            for row in range(middle - made + away, middle + made - away + 1, 2):
                cell = row * window.side + col
                if bounds.either[cell] < np.inf:
                    look_ahead(window, rules, bounds, left, cell)


@compiled
def look_ahead(window: Window, rules: Rules, bounds: Bounds, left: int, cell: int) -> None:
    """Work out the outlook from a cell with so many moves left, from the one with a move less."""
    outlook = bounds.outlook
    levels, kinds = outlook.shape[2:4]
    for level in range(level_of(bounds.base, bounds.width, bounds.either[cell]), levels):
        round_cost = rules.tick_cost * (bounds.base + level * bounds.width)
        for kind in range(kinds):
            for last in range(4):
                best = -np.inf
                if rules.moves_max - left >= rules.moves_min:
                    best = window.ends[kind, cell] - round_cost
                for move in range(4 if left > 0 else 0):
                    target = cell + window.steps[move]
                    if bounds.either[target] == np.inf:
                        continue
                    gain = window.gains[target]
                    new_kind = kinds - 1 if gain == 1.0 else kind
                    is_back = window.steps[move] == -window.steps[last]
                    if is_back and target != window.gains.size // 2:
                        gain *= 0.5  # it comes from there; that it began in the middle is known
                    if move != last:
                        gain -= rules.turn_cost
                    new_level = level_of(bounds.base, bounds.width, bounds.either[target])
                    gain += outlook[left - 1, target, max(level, new_level), new_kind, move]
                    best = max(best, gain)
                outlook[left, cell, level, kind, last] = best


# --- the search ----------------------------------------------------------------------------------


class Trail(NamedTuple):
    """A path as it grows; arrays by the moves made."""

    cells: NDArray[np.int64]
    moves: NDArray[np.int64]
    """Direction of the move to each cell."""
    kinds: NDArray[np.int64]
    """0; the last kind of ends once something new was entered."""
    ranks: NDArray[np.int64]
    """Place in the tie order."""
    counts: NDArray[np.int64]
    """How many moves there are to go on with."""
    tried: NDArray[np.int64]
    """How many of them have been tried."""
    ticks: Floats
    """The round at least, along the track of the path and against it."""
    scores: Floats
    """Of the path so far, without end and round."""
    gains: Floats
    """What it gained to enter each cell."""
    ahead: NDArray[np.int64]
    """The moves to go on with, the most promising first."""
    hopes: Floats
    """What each of them can come to at best."""


@compiled
def go_on(
    window: Window, rules: Rules, bounds: Bounds, gains: Floats, trail: Trail, made: int
) -> None:
    """Prolong a path by the next of the moves ahead."""
    move = trail.ahead[made, trail.tried[made]]
    trail.tried[made] += 1
    target = trail.cells[made] + window.steps[move]
    gain = gains[target]
    gains[target] *= 0.5
    after = made + 1
    trail.cells[after] = target
    trail.moves[after] = move
    trail.scores[after] = trail.scores[made] + gain
    if made > 0 and move != trail.moves[made]:
        trail.scores[after] -= rules.turn_cost
    for way in range(2):
        trail.ticks[after, way] = max(trail.ticks[made, way], bounds.rounds[way, target])
    trail.kinds[after] = window.ends.shape[0] - 1 if gain == 1.0 else trail.kinds[made]
    place = made if rules.is_first_fastest else rules.moves_max - after
    trail.ranks[after] = trail.ranks[made] + move * 4**place
    trail.gains[after] = gain
    trail.tried[after] = 0
    trail.counts[after] = 0


@compiled
def weigh_moves(
    window: Window, rules: Rules, bounds: Bounds, gains: Floats, trail: Trail, made: int
) -> None:
    """Note what each move from here can come to at best, the most promising first."""
    kinds = window.ends.shape[0]
    count = 0
    for move in range(4):
        target = trail.cells[made] + window.steps[move]
        ticks = np.inf
        for way in range(2):
            ticks = min(ticks, max(trail.ticks[made, way], bounds.rounds[way, target]))
        if ticks == np.inf:
            continue
        hope = trail.scores[made] + gains[target]
        if made > 0 and move != trail.moves[made]:
            hope -= rules.turn_cost
        kind = kinds - 1 if gains[target] == 1.0 else trail.kinds[made]
        level = level_of(bounds.base, bounds.width, ticks)
        hope += bounds.outlook[rules.moves_max - made - 1, target, level, kind, move]
        if hope == -np.inf:
            continue
        place = count
        while place > 0 and trail.hopes[made, place - 1] < hope:
            trail.hopes[made, place] = trail.hopes[made, place - 1]
            trail.ahead[made, place] = trail.ahead[made, place - 1]
            place -= 1
        trail.hopes[made, place] = hope
        trail.ahead[made, place] = move
        count += 1
    trail.counts[made] = count


@compiled
def search(
    window: Window,
    rounds: Rounds,
    rules: Rules,
    bounds: Bounds,
    trail: Trail,
    node_limit: int,
    best: float,
    is_hasty: bool,
    path: NDArray[np.int64],
) -> tuple[int, float, int, bool]:
    """
    Write the best path to ``path`` if one is better than ``best``.

    In haste no path is prolonged that would not be allowed if it ended where it is. Mostly none
    comes of those, but it may.

    Returns how many cells the path has, 0 if none was found, its score, the nodes, and whether
    all were looked at.
    """
    gains = window.gains.copy()  # each halved once more with every visit
    best_moves = -1
    best_rank = nodes = 0
    made = int(trail.tried[0])  # 0; for a literal all that is called would be compiled once more
    is_new = True  # the path has just come to where it is
    while made >= 0:
        if is_new:
            nodes += 1
            score = trail.scores[made] + window.ends[trail.kinds[made], trail.cells[made]]
            is_later = made > best_moves
            if made == best_moves:
                is_later = trail.ranks[made] > best_rank
            enough = best + rules.margin if is_later else best - rules.margin
            least = trail.ticks[made]
            hope = score - rules.tick_cost * min(least[ALONG], least[AGAINST])
            if made >= rules.moves_min and hope > -np.inf and hope >= enough:
                nodes += 1
                most = rounds.limit
                if rules.tick_cost > 0.0:
                    most = min(most, (score - enough) / rules.tick_cost + ROUNDING)
                ticks = round_of(window, rounds, trail.cells, made, least, most)
                if ticks < np.inf and score - rules.tick_cost * ticks >= enough:
                    best = max(best, score - rules.tick_cost * ticks)
                    best_moves, best_rank = made, int(trail.ranks[made])
                    for place in range(made + 1):
                        path[place] = trail.cells[place]
            is_to_go_on = made < rules.moves_max
            if is_hasty and is_to_go_on:
                nodes += 1
                ticks = round_of(window, rounds, trail.cells, made, least, rounds.limit)
                is_to_go_on = ticks < np.inf
            if is_to_go_on:
                weigh_moves(window, rules, bounds, gains, trail, made)
            if nodes >= node_limit:
                break
        tried = trail.tried[made]
        is_new = tried < trail.counts[made] and trail.hopes[made, tried] >= best - rules.margin
        if is_new:
            go_on(window, rules, bounds, gains, trail, made)
            made += 1
        else:
            gains[trail.cells[made]] = trail.gains[made]
            made -= 1
    return best_moves + 1, best, nodes, made < 0
