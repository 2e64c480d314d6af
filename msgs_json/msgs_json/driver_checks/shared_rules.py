"""Rules for every driver."""

from __future__ import annotations

import contextlib
import math
from typing import TYPE_CHECKING

from msgs_json.driver_checks.bench import ROUNDING_M, START, place
from msgs_json.drivers import VehicleUnavailableError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from msgs_json.driver_checks.bench import Bench, DriverT, StateT

WAY_TICKS = 70
"""Longer than the way of `Bench.depart`."""


def first_step_does_not_move(bench: Bench[DriverT, StateT]) -> Iterator[str]:
    """Be at the start at the first step, whatever its time, even if already sent off."""
    trial = bench.trial()
    bench.depart(trial.driver)
    state = trial.tick()
    if state.position.distance_m(START) > bench.radius_m:
        yield f'the first step is at {place(state.position)}, the start is {place(START)}'


def same_time_same_place(bench: Bench[DriverT, StateT]) -> Iterator[str]:
    """Stay in place at a step at the time of the step before."""
    trial = bench.trial()
    trial.tick()
    bench.depart(trial.driver)
    for _ in range(5):
        state, again = trial.tick(), trial.again()
        if state.position != again.position:
            yield f'at {place(state.position)}, then {place(again.position)} at the same time'


def states_are_finite(bench: Bench[DriverT, StateT]) -> Iterator[str]:
    """Report finite numbers only, and a speed from 0 to that of the setup."""
    trial = bench.trial()
    bench.depart(trial.driver)
    for _ in range(WAY_TICKS):
        state = trial.tick()
        numbers = (state.position.east_m, state.position.north_m, state.z_m, state.heading_rad)
        if not all(math.isfinite(number) for number in numbers):
            yield f'{state} holds a number that is not finite'
        if not 0.0 <= state.speed_mps <= bench.pace.speed_mps + ROUNDING_M:
            yield f'speed is {state.speed_mps} m/s'


def same_commands_same_states(bench: Bench[DriverT, StateT]) -> Iterator[str]:
    """Do the same as another vehicle that has the same setup and is told the same."""
    one, other = bench.trial(), bench.trial()
    bench.depart(one.driver)
    bench.depart(other.driver)
    for _ in range(WAY_TICKS):
        state, other_state = one.tick(), other.tick()
        if state != other_state:
            yield f'{state} and {other_state}'


def heard_again_is_there_again(bench: Bench[DriverT, StateT]) -> Iterator[str]:
    """
    Return a state again as soon as the vehicle is heard again.

    While it is not heard (before its first pose, or for a minute) a driver may raise
    `VehicleUnavailableError`; any other error goes through to the caller.
    """
    trial = bench.trial()
    for is_silent in (True, False, True, False):
        trial.autopilot.is_silent = is_silent
        if is_silent:
            with contextlib.suppress(VehicleUnavailableError):
                trial.tick(60.0 / bench.pace.tick_s)
            continue
        try:
            trial.tick()
        except VehicleUnavailableError as error:
            yield f'the vehicle is heard again, but: {error}'


SHARED_RULES = (
    first_step_does_not_move,
    same_time_same_place,
    states_are_finite,
    same_commands_same_states,
    heard_again_is_there_again,
)
