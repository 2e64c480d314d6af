"""The lower bound against brute force, figures worked out by hand, and simpler bounds."""

from __future__ import annotations

import itertools
import math
import operator
import random
from dataclasses import replace as with_fields
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lower_bound_oracle import earliest_ticks
from msgspec.structs import replace

from c3_station.first_meetings import FirstMeetings
from c3_station.fleet_limits import AuvLimits, FleetLimits, fleet_limits
from c3_station.lower_bound import lower_bound_s
from c3_station.pockets import least_repeats
from c3_station.scenario import Scenario
from c3_station.scenario_files import load_scenario
from msgs_json.geometry import Cell, GridSpec, Point, whole_ticks

MINIMAL = load_scenario('minimal')
REFERENCE = load_scenario('ecc2009')


def with_auvs(scenario: Scenario, *auvs: dict[str, Any]) -> Scenario:
    """Return a scenario with other AUVs, each described by what it differs in from the first."""
    return replace(
        scenario,
        auvs=tuple(
            replace(scenario.auvs[0], name=f'auv_{number}', **keys)
            for number, keys in enumerate(auvs, 1)
        ),
    )


# --- brute force ---------------------------------------------------------------------------------


def tiny(seed: int, auvs: int) -> Scenario:
    """Return a random tiny mission; several AUVs are all heard from C3 at any time."""
    rng = random.Random(seed)
    while True:
        cols, rows = rng.choice([(2, 2), (3, 2), (3, 3), (4, 2), (5, 1), (6, 1)])
        cells = list(itertools.product(range(cols), range(rows)))
        masked = tuple(rng.sample(cells, rng.choice([0, 0, 0, 1, 2])))
        region = GridSpec(cols=cols, rows=rows, cell_m=10.0, masked=masked)
        starts = rng.sample(region.cells, auvs)
        reached = region.moves_from(starts[:1])
        if len(reached) == region.cells_total > auvs + 1:
            break
    scenario = with_auvs(
        MINIMAL,
        *(
            {
                'initial_path': (start, rng.choice(region.neighbours(start))),
                'speed_mps': rng.choice([0.7, 1.0, 1.0, 1.4, 2.0]),
            }
            for start in starts
        ),
    )
    range_m = rng.choice([10.0, 14.0, 20.0]) if auvs == 1 else 1000.0
    east_m, north_m = rng.choice([-40.0, 0.0, 15.0, 100.0]), rng.choice([-30.0, 0.0, 12.0])
    return replace(
        scenario,
        region=region,
        c3=Point(east_m=east_m, north_m=north_m),
        uav=replace(scenario.uav, speed_mps=rng.choice([1.0, 2.0, 4.0])),
        radio=replace(scenario.radio, range_m=range_m),
        planner=replace(scenario.planner, path_cells=rng.choice([1, 2, 3])),
        tick_s=rng.choice([1.0, 4.0, 5.0]),
    )


def share_reached(seeds: range, auvs: int) -> float:
    """Return how often the bound is the optimum of tiny missions; it is never more."""
    reached = 0
    for seed in seeds:
        scenario = tiny(seed, auvs)
        optimum_s = earliest_ticks(scenario) * scenario.tick_s
        bound_s = lower_bound_s(scenario)
        assert bound_s <= optimum_s + 1e-6, f'seed {seed}'
        reached += bound_s >= optimum_s - 1e-6
    return reached / len(seeds)


@pytest.mark.parametrize(('auvs', 'least_share'), [(1, 0.3), (2, 0.8)])
def test_no_path_of_any_auv_is_faster_and_often_one_is_as_fast(
    auvs: int, least_share: float
) -> None:
    assert share_reached(range(12), auvs) >= least_share


@pytest.mark.slow
@pytest.mark.parametrize(('auvs', 'least_share'), [(1, 0.45), (2, 0.85)])
def test_no_path_of_any_auv_is_faster_in_many_missions(auvs: int, least_share: float) -> None:
    assert share_reached(range(300), auvs) >= least_share


# --- worked out by hand --------------------------------------------------------------------------


def test_reference_mission() -> None:
    # 94 cells are on no initial path. Met at 10, 17 and 21 s, in the order 3, 1, 2, the AUVs have
    # entered 32, 31 and 31 of them at 331 s, and 93 a second before.
    assert lower_bound_s(REFERENCE) == 331.0


def test_minimal_mission() -> None:
    # Met at 10 s, when it surfaces; 10 of the 12 cells are left, 10 s each.
    assert lower_bound_s(MINIMAL) == 110.0


def corridor(cells: int, *paths: tuple[int, int], **keys: Any) -> Scenario:  # noqa: ANN401  fields
    """Return a mission in a single row of cells, in which each AUV begins with one move."""
    scenario = with_auvs(
        MINIMAL, *({'initial_path': ((start, 0), (end, 0))} for start, end in paths)
    )
    return replace(scenario, region=GridSpec(cols=cells, rows=1, cell_m=10.0), **keys)


EVERYWHERE = replace(MINIMAL.radio, range_m=1000.0)


@pytest.mark.parametrize(
    ('scenario', 'bound_s'),
    [
        # From one end to the other.
        (corridor(6, (0, 1), radio=EVERYWHERE), 50.0),
        # From cell 4 to 8, and back over 7 ... 2 (of which 3 was entered first) to 0.
        (corridor(9, (3, 4), radio=EVERYWHERE), 10.0 + 40.0 + 80.0),
        # One for either side.
        (corridor(9, (3, 4), (4, 3), radio=EVERYWHERE), 50.0),
        # All is entered on the initial paths.
        (corridor(2, (0, 1)), 10.0),
        (corridor(4, (0, 1), (3, 2)), 10.0),
        # The other AUV is no help: it begins beyond land.
        (
            replace(
                corridor(9, (0, 1), (8, 7), radio=EVERYWHERE),
                region=GridSpec(cols=9, rows=1, cell_m=10.0, masked=((6, 0),)),
            ),
            50.0,
        ),
    ],
)
def test_corridors(scenario: Scenario, bound_s: float) -> None:
    assert lower_bound_s(scenario) == bound_s


def test_colours_of_the_chequerboard_count() -> None:
    # Around one cell of the one colour lie four of the other. An AUV in the middle enters them
    # with its moves 1, 3, 5 and 7 at best, one of which is its initial path.
    arms = ((0, 0), (2, 0), (0, 2), (2, 2))
    scenario = replace(
        with_auvs(MINIMAL, {'initial_path': ((1, 1), (1, 0))}),
        region=GridSpec(cols=3, rows=3, cell_m=10.0, masked=arms),
        radio=EVERYWHERE,
    )
    assert lower_bound_s(scenario) == 70.0


def test_the_uav_has_to_fly_home_between_two_legs() -> None:
    # 1000 m from C3, and 980 m from the nearest cell's disc: 245 s there, 490 s for each round.
    far = replace(
        corridor(7, (0, 1), c3=Point(east_m=15.0, north_m=1005.0)),
        uav=replace(MINIMAL.uav, speed_mps=4.0),
        planner=replace(MINIMAL.planner, path_cells=1),
    )
    # The legs to cells 2 ... 5 are followed by another one. Ways home from cells 1 to 5: 245, 246
    # (for 980.05 m), 246, 246 and 246 ticks; each leg is charged the least of its two ends twice
    # or one end each, whatever costs less.
    assert lower_bound_s(far) == 245.0 + (245 + 246) + 3 * (246 + 246) + 10.0


def test_seed_planner_and_what_is_measured_do_not_matter() -> None:
    other = replace(REFERENCE, seed=7, planner=replace(REFERENCE.planner, name='robust'))
    assert lower_bound_s(other) == lower_bound_s(REFERENCE)


@pytest.mark.parametrize(
    ('surfacing', 'first_tick', 'cells', 'cell_ticks', 'astray_m'),
    [
        ({'model': 'on_time'}, 20, [(2, 0)], 10.0, 0.0),
        ({'model': 'silent', 'from_s': 0, 'sorties': 1}, 20, [(2, 0)], 10.0, 0.0),
        ({'model': 'early', 'probability': 0.0}, 20, [(2, 0)], 10.0, 0.0),
        ({'model': 'early', 'probability': 0.1}, 1, [(0, 0), (1, 0), (2, 0)], 10.0, 0.0),
        ({'model': 'slow', 'least_factor': 0.5}, 20, [(0, 0), (1, 0), (2, 0)], 10.0, 10.0),
        # To the west it makes 1.25 m/s.
        (
            {'model': 'slow', 'current_east_mps': -0.25},
            16,
            [(0, 0), (1, 0), (2, 0)],
            8.0,
            10.0,
        ),
    ],
)
def test_what_the_sea_may_do_to_an_auv(
    surfacing: dict[str, Any],
    first_tick: int,
    cells: list[Cell],
    cell_ticks: float,
    astray_m: float,
) -> None:
    path = ((0, 0), (1, 0), (2, 0))
    limits = fleet_limits(with_auvs(MINIMAL, {'initial_path': path, 'surfacing': surfacing}))
    (auv,) = limits.auvs
    assert (auv.first_tick, list(auv.first_cells)) == (first_tick, cells)
    assert auv.cell_ticks == pytest.approx(cell_ticks)
    assert limits.astray_m == astray_m


def test_of_a_real_vehicle_only_its_speed_is_known() -> None:
    scenario = with_auvs(MINIMAL, {'driver': 'topics'})
    limits = fleet_limits(scenario)
    assert (limits.auvs[0].first_tick, limits.astray_m) == (1, 10.0)
    assert set(limits.auvs[0].first_cells) == {(0, 0), (1, 0)}


def test_wind_may_carry_the_uav() -> None:
    windy = replace(MINIMAL, uav=replace(MINIMAL.uav, wind_east_mps=-3.0, wind_north_mps=1.25))
    assert fleet_limits(windy).step_m == 4.0 + 3.25


# --- simpler bounds ------------------------------------------------------------------------------


@settings(max_examples=25)
@given(
    cols=st.integers(2, 9),
    rows=st.integers(1, 9),
    cell_m=st.sampled_from([0.3, 1.0, 10.0]),
    speeds_mps=st.lists(st.sampled_from([0.1, 0.5, 1.0, 1.5, 2.7]), min_size=1, max_size=4),
)
def test_it_is_at_least_the_first_time_at_which_the_cells_add_up(
    cols: int, rows: int, cell_m: float, speeds_mps: list[float]
) -> None:
    scenario = with_auvs(MINIMAL, *({'speed_mps': speed_mps} for speed_mps in speeds_mps))
    scenario = replace(scenario, region=GridSpec(cols=cols, rows=rows, cell_m=cell_m))
    cells = cols * rows - 1
    times_s = sorted(
        count * cell_m / speed for speed in speeds_mps for count in range(1, cells + 1)
    )
    first_s = next(
        time_s
        for time_s in times_s
        if sum(math.floor(time_s * v / cell_m * (1 + 1e-9)) for v in speeds_mps) >= cells
    )
    assert lower_bound_s(scenario) >= first_s - 1e-6


# --- first meetings ------------------------------------------------------------------------------


def scattered(rng: random.Random, auvs: int) -> FleetLimits:
    """Return vehicles of which the AUVs lie anywhere."""
    cells = [(rng.randrange(30), rng.randrange(30)) for _ in range(auvs)]
    return FleetLimits(
        region=GridSpec(cols=30, rows=30, cell_m=10.0),
        c3=Point(east_m=rng.uniform(-50, 350), north_m=rng.uniform(-50, 350)),
        range_m=rng.choice([5.0, 20.0, 60.0]),
        home_m=0.0,
        astray_m=0.0,
        step_m=rng.choice([4.0, 9.0, 31.0]),
        path_cells=4,
        auvs=tuple(
            AuvLimits(
                initial_path=(cell,),
                cell_ticks=10.0,
                forgiven_ticks=1e-6,
                first_tick=rng.choice([1, 10, 60]),
                first_cells=(cell,),
            )
            for cell in cells
        ),
    )


def flown(limits: FleetLimits, rng: random.Random, order: list[int]) -> list[int]:
    """Return when a UAV meets the AUVs that flies to some point of each disc, in an order."""
    here, ticks, met = limits.c3, 0, []
    for auv in order:
        centre = limits.region.centre(limits.auvs[auv].first_cells[0])
        # Mostly to where the disc begins, seen from where it is.
        inside_m = limits.range_m * rng.choice([1.0, 1.0, rng.random()])
        there = centre.toward(here, min(inside_m, centre.distance_m(here)))
        ticks += whole_ticks(here.distance_m(there) / limits.step_m)
        ticks = max(ticks, limits.auvs[auv].first_tick)
        here = there
        met.append(ticks)
    return met


@pytest.mark.parametrize('auvs', [1, 2, 4, 6, 13, 17])
def test_no_flight_meets_the_auvs_sooner(auvs: int) -> None:
    rng = random.Random(auvs)
    for _ in range(4):
        limits = scattered(rng, auvs)
        least_ticks = FirstMeetings(limits).least_ticks
        for _ in range(30):
            order = rng.sample(range(auvs), auvs)
            rows = range(auvs)
            if auvs <= 12:
                rows = itertools.accumulate((1 << auv for auv in order), operator.or_)
            for row, auv, ticks in zip(rows, order, flown(limits, rng, order), strict=True):
                assert least_ticks[row, auv] <= ticks


def test_first_meetings_in_a_row_are_exact() -> None:
    # Discs on a line with C3: 100, 200 and 300 m away, each entered 20 m before its centre.
    limits = with_fields(
        scattered(random.Random(0), 3), c3=Point(east_m=5.0, north_m=5.0), range_m=20.0, step_m=4.0
    )
    auvs = [
        with_fields(auv, first_tick=1, first_cells=((east, 0),))
        for auv, east in zip(limits.auvs, (10, 20, 29), strict=True)
    ]
    least_ticks = FirstMeetings(with_fields(limits, auvs=tuple(auvs))).least_ticks
    assert [least_ticks[0b001, 0], least_ticks[0b011, 1], least_ticks[0b111, 2]] == [20, 45, 68]


def test_most_is_that_of_the_best_order() -> None:
    rng = np.random.default_rng(0)
    meetings = FirstMeetings(scattered(random.Random(0), 4))
    for _ in range(20):
        worth = rng.integers(10, size=(16, 4)).astype(float)
        best = 0.0
        for order in itertools.permutations(range(4)):
            subsets = itertools.accumulate((1 << auv for auv in order), operator.or_)
            best = max(best, worth[list(subsets), order].sum())
        assert meetings.most(worth) == best


def test_in_a_large_fleet_no_assignment_of_ranks_is_worth_more() -> None:
    rng = np.random.default_rng(0)
    meetings = FirstMeetings(scattered(random.Random(0), 14))
    for _ in range(20):
        worth = np.sort(rng.random((14, 14)), axis=0)[::-1]
        ranks = rng.permutation(14)
        assert worth[ranks, np.arange(14)].sum() <= meetings.most(worth)


# --- pockets -------------------------------------------------------------------------------------


def region_of(*rows: str) -> tuple[GridSpec, list[Cell], frozenset[Cell]]:
    """Return the region of a drawing, where AUVs start (S) and the cells to enter (.)."""
    drawn = {(col, row): mark for row, marks in enumerate(rows) for col, mark in enumerate(marks)}
    region = GridSpec(
        cols=len(rows[0]),
        rows=len(rows),
        cell_m=1.0,
        masked=tuple(cell for cell, mark in drawn.items() if mark == '#'),
    )
    starts = [cell for cell, mark in drawn.items() if mark == 'S']
    return region, starts, frozenset(cell for cell, mark in drawn.items() if mark == '.')


@pytest.mark.parametrize(
    ('rows', 'repeats'),
    [
        (('S....',), 0),
        (('..S....',), 2),  # the shorter end and back
        (('..S.S..',), 0),  # one for each end
        (('oSo..',), 1),  # o was entered before: on the way to the east it is again
        (('S..', '...', '...'), 0),  # no pocket
        (('..S..', '##.##', '##.##'), 2 + 2),  # two of the three arms are left again
        (('S....', '.#.#.', '.#.#.'), 4),  # two of three dead ends, two cells deep
        (('..#..', 'S....', '..#..'), 0),  # a bay behind a strait; an AUV may end there
        (('..#..', '..S..', '..#..'), 2),  # two of them: back through one strait, and on
    ],
)
def test_pockets(rows: tuple[str, ...], repeats: int) -> None:
    region, starts, to_enter = region_of(*rows)
    assert least_repeats(region, starts, to_enter, len(starts)) == repeats


@pytest.mark.parametrize('seed', range(40))
def test_no_walk_has_fewer_repeats(seed: int) -> None:
    rng = random.Random(seed)
    marks = ''.join(rng.choice('...o#') for _ in range(12))
    region, _, to_enter = region_of(marks[:4], marks[4:8], marks[8:])
    start = rng.choice(region.cells)
    to_enter = (to_enter & region.moves_from([start]).keys()) - {start}
    # Breadth first over where it is and what it has entered.
    states, moves = {(start, frozenset[Cell]())}, 0
    while not any(entered == to_enter for _, entered in states):
        states = {
            (to, entered | ({to} & to_enter))
            for cell, entered in states
            for to in region.neighbours(cell)
        }
        moves += 1
    assert len(to_enter) + least_repeats(region, [start], to_enter, 1) <= moves
