"""Rules for AUV drivers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from msgs_json.driver_checks.bench import (
    NOWHERE,
    ROUNDING_M,
    START,
    Bench,
    Pace,
    Rule,
    Trial,
    along,
    place,
)
from msgs_json.drivers import (
    SUBMERGED_Z_M,
    AuvDriver,
    AuvDriverSetup,
    AuvState,
    CommandRefusedError,
    DriverPorts,
)
from msgs_json.geometry import Point, path_length_m, whole_ticks
from msgs_json.simulated_autopilot import SimulatedAutopilot

MakeAuvDriver = Callable[[AuvDriverSetup, DriverPorts], AuvDriver]
AuvBench = Bench[AuvDriver, AuvState]

AUV_PACES = (
    Pace(1.0, 1.0, 0.0),  # the reference mission
    Pace(0.8, 0.1, 7.3),  # no binary fractions, yet whole ticks from cell to cell
    Pace(1.25, 1 / 3, 86_400.0),  # a day into a mission
)
DEPTH_M = 5.0
CELL_M = 10.0


def leg(*moves: tuple[int, int]) -> tuple[Point, ...]:
    """Return the waypoints of a leg from the start, given its moves in cells."""
    points = [START]
    for east, north in moves:
        here = points[-1]
        points.append(
            Point(east_m=here.east_m + east * CELL_M, north_m=here.north_m + north * CELL_M)
        )
    return tuple(points[1:])


LEG = leg((1, 0), (1, 0), (0, -1), (-1, 0), (1, 0), (0, -1))
"""Straight on, round corners, and back where it came from."""
LEG_LINE = (START, *LEG)


def auv_bench(
    make_driver: MakeAuvDriver, pace: Pace, radius_m: float, vertical_mps: float
) -> AuvBench:
    """Return the bench of an AUV driver at a pace."""

    def trial() -> Trial[AuvDriver, AuvState]:
        autopilot = SimulatedAutopilot(START, 0.0, pace.speed_mps, vertical_mps)

        def driver() -> AuvDriver:
            setup = AuvDriverSetup(
                name='auv_1',
                start=START,
                speed_mps=pace.speed_mps,
                depth_m=DEPTH_M,
                surfacing='{"model": "on_time"}',
                rng=np.random.default_rng(1),
            )
            return make_driver(setup, autopilot)

        return Trial(driver, lambda driver, now_s: driver.step(now_s), autopilot, pace)

    return Bench(
        pace=pace,
        radius_m=radius_m,
        settle_ticks=whole_ticks(DEPTH_M / vertical_mps / pace.tick_s),
        trial=trial,
        depart=lambda driver: driver.follow(LEG),
    )


def _ticks_of(line: Sequence[Point], pace: Pace) -> int:
    return whole_ticks(path_length_m(line) / pace.step_m)


def _swims_line(
    bench: AuvBench,
    trial: Trial[AuvDriver, AuvState],
    line: Sequence[Point],
    shares: Sequence[float],
) -> Iterator[str]:
    """
    Compare an AUV that has just been sent along a line with a constant-speed point on it.

    One that counts waypoints as reached within a radius may cut the way by twice that at each.
    """
    arcs_m = [path_length_m(line[: number + 1]) for number in range(1, len(line))]
    ticks = 0.0
    for share in shares:
        ticks += share
        state = trial.tick(share)
        done_m = ticks * bench.pace.step_m + ROUNDING_M
        due = sum(arc_m <= done_m for arc_m in arcs_m)
        possible = sum(
            arc_m <= done_m + 2.0 * bench.radius_m * number
            for number, arc_m in enumerate(arcs_m, start=1)
        )
        if not due <= state.waypoints_reached <= possible:
            yield (
                f'after {ticks:g} ticks, {done_m:g} m, it counts {state.waypoints_reached}'
                f' waypoints as reached, should be {due}'
            )
        expected = along(line, done_m)
        slack_m = (1.0 + 2.0 * state.waypoints_reached) * bench.radius_m + 2.0 * ROUNDING_M
        if state.position.distance_m(expected) > slack_m:
            yield (
                f'after {ticks:g} ticks it is at {place(state.position)},'
                f' should be at {place(expected)}'
            )


def starts_surfaced(bench: AuvBench) -> Iterator[str]:
    """Stay at the surface at the start until the first leg."""
    trial = bench.trial()
    for _ in range(3):
        state = trial.tick()
        if not state.surfaced or state.position.distance_m(START) > bench.radius_m:
            yield f'{state}'


def reaches_waypoints_in_whole_ticks(bench: AuvBench) -> Iterator[str]:
    """
    Swim a leg at constant speed along its waypoints, and wait at the last one.

    Waypoint k counts as reached at the tick at which the way done is its distance along the leg,
    not a tick later.
    """
    trial = bench.trial()
    trial.tick()
    trial.driver.follow(LEG)
    yield from _swims_line(bench, trial, LEG_LINE, [1.0] * _ticks_of(LEG_LINE, bench.pace))
    for _ in range(3):
        state = trial.tick()
    if state.position.distance_m(LEG[-1]) > bench.radius_m:
        yield f'waits at {place(state.position)}, should wait at {place(LEG[-1])}'


def uneven_steps_keep_speed(bench: AuvBench) -> Iterator[str]:
    """Cover the speed times the time between two steps, however long that is."""
    trial = bench.trial()
    trial.tick()
    trial.driver.follow(LEG)
    shares = (0.25, 1.0, 0.5, 0.01, 0.24) * (_ticks_of(LEG_LINE, bench.pace) // 2)
    yield from _swims_line(bench, trial, LEG_LINE, shares)


def stays_down_until_told(bench: AuvBench) -> Iterator[str]:
    """Be under water on a leg and while waiting at its end, and never count as surfaced there."""
    trial = bench.trial()
    trial.tick()
    trial.driver.follow(LEG)
    for tick in range(_ticks_of(LEG_LINE, bench.pace) + bench.settle_ticks + 5):
        state = trial.again() if tick == 0 else trial.tick()
        if state.surfaced:
            yield f'is surfaced {tick} ticks after it was sent down'
        if tick >= bench.settle_ticks and state.z_m > SUBMERGED_Z_M:
            yield f'z is {state.z_m} m {tick} ticks after it was sent down'


def surfaced_means_z_is_0(bench: AuvBench) -> Iterator[str]:
    """Report z = 0, exactly, whenever surfaced."""
    trial = bench.trial()
    states = [trial.tick() for _ in range(3)]
    trial.driver.follow(LEG)
    states += [trial.tick() for _ in range(bench.settle_ticks + 3)]
    trial.driver.surface()
    states += [trial.tick() for _ in range(bench.settle_ticks + 3)]
    for state in states:
        if state.surfaced and state.z_m != 0.0:
            yield f'is surfaced at z = {state.z_m} m'


def surfaces_where_it_is(bench: AuvBench) -> Iterator[str]:
    """
    Come up when told, in mid-leg or at its end, and stay up in that place.

    It may be told again and again, for a command may get lost; that makes no difference.
    """
    leg_ticks = _ticks_of(LEG_LINE, bench.pace)
    for ticks in (3, leg_ticks // 4, leg_ticks):
        trial = bench.trial()
        trial.driver.follow(LEG)
        for _ in range(1 + bench.settle_ticks + ticks):
            below = trial.tick()
        for tick in range(bench.settle_ticks + 5):
            trial.driver.surface()
            state = trial.again() if tick == 0 else trial.tick()
            if tick >= bench.settle_ticks and not state.surfaced:
                yield f'is at z = {state.z_m} m {tick} ticks after it was told to surface'
            if state.position.distance_m(below.position) > bench.radius_m:
                yield f'left {place(below.position)} for {place(state.position)} to surface'
            if state.waypoints_reached != below.waypoints_reached:
                yield f'counts another waypoint as reached while it comes up: {state}'


def asks_for_no_help(bench: AuvBench) -> Iterator[str]:
    """Ask for help where something is wrong only: not on a leg, nor before or after it."""
    trial = bench.trial()
    states = [trial.tick()]
    trial.driver.follow(LEG)
    states += [trial.tick() for _ in range(_ticks_of(LEG_LINE, bench.pace) + 3)]
    trial.driver.surface()
    states += [trial.tick() for _ in range(bench.settle_ticks + 3)]
    for state in states:
        if state.needs_help:
            yield f'nothing is wrong, but it needs help: {state}'


def takes_another_leg(bench: AuvBench) -> Iterator[str]:
    """Begin a leg where the AUV is: on its way or at the surface, at a waypoint or between two."""
    back = (START, *leg((-1, 0), (0, 1)))
    for comes_up in (False, True):
        for ticks in (whole_ticks(CELL_M / bench.pace.step_m), 7):
            trial = bench.trial()
            trial.tick()
            trial.driver.follow(LEG)
            for _ in range(ticks):
                state = trial.tick()
            if comes_up:
                trial.driver.surface()
                for _ in range(1 + bench.settle_ticks):
                    state = trial.tick()
            trial.driver.follow(back)
            line = (state.position, *back)
            yield from _swims_line(bench, trial, line, [1.0] * _ticks_of(line, bench.pace))


def refuses_a_leg_that_leads_nowhere(bench: AuvBench) -> Iterator[str]:
    """Raise `CommandRefusedError` for a leg without points or with one that is not finite."""
    trial, other = bench.trial(), bench.trial()
    for each in (trial, other):
        each.driver.follow(LEG)
        each.tick()
        each.tick()
    for points in ((), (START, NOWHERE)):
        try:
            trial.driver.follow(points)
        except CommandRefusedError:
            pass
        else:
            yield f'took {points} as a leg'
        for _ in range(5):
            state, undisturbed = trial.tick(), other.tick()
            if state != undisturbed:
                yield f'{state}, should be {undisturbed}'


def goes_on_from_its_memory_at_the_surface(bench: AuvBench) -> Iterator[str]:
    """
    Go on as one that was never interrupted after a restart on its way up, or up between two legs.

    A vehicle is not sent down again by a driver that has forgotten that it was told to come up.
    """
    trial, other = bench.trial(), bench.trial()
    yield from trial.keeps_up_with(other, 1)
    for points in (LEG, (START, *leg((-1, 0), (0, 1)))):
        trial.driver.follow(points)
        other.driver.follow(points)
        yield from trial.keeps_up_with(other, bench.settle_ticks + 17)
        trial.driver.surface()
        other.driver.surface()
        for _ in range(bench.settle_ticks + 3):
            trial.restart()
            yield from trial.keeps_up_with(other, 1)


AUV_RULES: tuple[Rule[AuvDriver, AuvState], ...] = (
    starts_surfaced,
    reaches_waypoints_in_whole_ticks,
    uneven_steps_keep_speed,
    stays_down_until_told,
    surfaced_means_z_is_0,
    surfaces_where_it_is,
    asks_for_no_help,
    takes_another_leg,
    refuses_a_leg_that_leads_nowhere,
    goes_on_from_its_memory_at_the_surface,
)
