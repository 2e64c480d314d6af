"""Rules for UAV drivers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

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
from msgs_json.driver_checks.shared_rules import WAY_TICKS
from msgs_json.drivers import (
    CommandRefusedError,
    DriverPorts,
    UavDriver,
    UavDriverSetup,
    VehicleState,
)
from msgs_json.geometry import Point, whole_ticks
from msgs_json.simulated_autopilot import SimulatedAutopilot

MakeUavDriver = Callable[[UavDriverSetup, DriverPorts], UavDriver]
UavBench = Bench[UavDriver, VehicleState]

UAV_PACES = (
    Pace(4.0, 1.0, 0.0),  # the reference mission
    Pace(3.1, 0.1, 7.0),  # no binary fractions
    Pace(12.5, 1 / 3, 86_400.0),  # a day into a mission
)
ALTITUDE_M = 50.0


def uav_bench(make_driver: MakeUavDriver, pace: Pace, radius_m: float) -> UavBench:
    """Return the bench of a UAV driver at a pace."""

    def trial() -> Trial[UavDriver, VehicleState]:
        setup = UavDriverSetup(
            name='uav', home=START, speed_mps=pace.speed_mps, altitude_m=ALTITUDE_M
        )
        autopilot = SimulatedAutopilot(START, ALTITUDE_M, pace.speed_mps, math.inf)
        return Trial(
            lambda: make_driver(setup, autopilot),
            lambda driver, now_s: driver.step(now_s),
            autopilot,
            pace,
        )

    far = Point(east_m=START.east_m + 50.4 * pace.step_m, north_m=START.north_m)
    return Bench(
        pace=pace,
        radius_m=radius_m,
        settle_ticks=0,
        trial=trial,
        depart=lambda driver: driver.go_to(far),
    )


def _hops(step_m: float) -> Iterator[tuple[Point, Point]]:
    """Yield a chain of hops in all directions: whole ticks, where rounding bites, and others."""
    start = START
    for number in range(24):
        ticks = (1.0, 2.0, 3.0, 10.0, 33.0, 60.0, 0.3, 7.5)[number % 8]
        angle_rad = 0.7 * number
        end = Point(
            east_m=start.east_m + ticks * step_m * math.cos(angle_rad),
            north_m=start.north_m + ticks * step_m * math.sin(angle_rad),
        )
        yield start, end
        start = end


def holds_over_home(bench: UavBench) -> Iterator[str]:
    """Stay over the home until sent elsewhere."""
    trial = bench.trial()
    for _ in range(5):
        state = trial.tick()
        if state.position.distance_m(START) > bench.radius_m:
            yield f'is at {place(state.position)}, home is {place(START)}'


def flies_at_altitude(bench: UavBench) -> Iterator[str]:
    """Keep the height of the setup."""
    trial = bench.trial()
    bench.depart(trial.driver)
    for _ in range(10):
        state = trial.tick()
        if abs(state.z_m - ALTITUDE_M) > bench.radius_m + ROUNDING_M:
            yield f'z is {state.z_m} m, altitude is {ALTITUDE_M} m'


def arrives_in_whole_ticks(bench: UavBench) -> Iterator[str]:
    """
    Fly straight to the target at constant speed and hold there.

    A hop takes ``whole_ticks(length / (speed * tick))`` ticks, not one more, and by the arrival
    radius less at most.
    """
    trial = bench.trial()
    trial.tick()
    for start, end in _hops(bench.pace.step_m):
        trial.driver.go_to(end)
        length_m = start.distance_m(end)
        latest = whole_ticks(length_m / bench.pace.step_m)
        earliest = whole_ticks((length_m - bench.radius_m) / bench.pace.step_m)
        for tick in range(1, latest + 4):
            position = trial.tick().position
            expected = along((start, end), tick * bench.pace.step_m)
            if position.distance_m(expected) > bench.radius_m + ROUNDING_M:
                yield (
                    f'{tick} ticks on the way from {place(start)} to {place(end)} it is at'
                    f' {place(position)}, should be at {place(expected)}'
                )
            is_there = position.distance_m(end) <= bench.radius_m
            if tick < earliest and is_there:
                yield f'a hop of {latest} ticks took {tick}'
            if tick >= latest and not is_there:
                yield (
                    f'a hop of {latest} ticks to {place(end)} has not ended after {tick}:'
                    f' {position.distance_m(end):.3g} m are left'
                )


def turns_to_a_new_target(bench: UavBench) -> Iterator[str]:
    """Turn to a new target at once, in mid-flight too."""
    trial = bench.trial()
    bench.depart(trial.driver)
    for _ in range(8):
        turn = trial.tick().position
    trial.driver.go_to(START)
    for tick in range(1, 12):
        position = trial.tick().position
        expected = along((turn, START), tick * bench.pace.step_m)
        if position.distance_m(expected) > bench.radius_m + ROUNDING_M:
            yield f'is at {place(position)}, should be at {place(expected)}'


def repeated_target_changes_nothing(bench: UavBench) -> Iterator[str]:
    """Fly on undisturbed when sent again to where it is flying already."""
    once, often = bench.trial(), bench.trial()
    bench.depart(once.driver)
    for _ in range(WAY_TICKS):
        bench.depart(often.driver)
        position, repeated = once.tick().position, often.tick().position
        if position != repeated:
            yield f'is at {place(repeated)}, should be at {place(position)}'


def uneven_steps_keep_speed(bench: UavBench) -> Iterator[str]:
    """Cover the speed times the time between two steps, however long that is."""
    trial = bench.trial()
    trial.tick()
    end = along((START, Point(east_m=0.0, north_m=0.0)), 12.0 * bench.pace.step_m)
    trial.driver.go_to(end)
    ticks = 0.0
    for share in (0.25, 1.0, 0.5, 3.0, 0.01, 0.24, 2.5, 4.5, 1.0):
        ticks += share
        position = trial.tick(share).position
        expected = along((START, end), ticks * bench.pace.step_m)
        if position.distance_m(expected) > bench.radius_m + ROUNDING_M:
            yield f'is at {place(position)}, should be at {place(expected)}'


def refuses_a_target_that_is_nowhere(bench: UavBench) -> Iterator[str]:
    """Raise `CommandRefusedError` for a target that is not finite, and fly on as before."""
    trial, other = bench.trial(), bench.trial()
    for each in (trial, other):
        bench.depart(each.driver)
        each.tick()
        each.tick()
    try:
        trial.driver.go_to(NOWHERE)
    except CommandRefusedError:
        pass
    else:
        yield f'took {NOWHERE} as a target'
    for _ in range(5):
        position, undisturbed = trial.tick().position, other.tick().position
        if position != undisturbed:
            yield f'is at {place(position)}, should be at {place(undisturbed)}'


UAV_RULES: tuple[Rule[UavDriver, VehicleState], ...] = (
    holds_over_home,
    flies_at_altitude,
    arrives_in_whole_ticks,
    turns_to_a_new_target,
    repeated_target_changes_nothing,
    uneven_steps_keep_speed,
    refuses_a_target_that_is_nowhere,
)
