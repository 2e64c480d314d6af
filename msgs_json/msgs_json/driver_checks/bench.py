"""What the rules share: a vehicle under test with its clock, and where it should be."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

from msgs_json.drivers import Vehicle, VehicleState
from msgs_json.geometry import Point

if TYPE_CHECKING:
    from msgs_json.simulated_autopilot import SimulatedAutopilot

DriverT = TypeVar('DriverT', bound=Vehicle)
StateT = TypeVar('StateT', bound=VehicleState)

ROUNDING_M = 1e-6
"""Positions closer than this are the same; far above rounding, far below any vehicle."""

START = Point(east_m=35.0, north_m=75.0)
"""Where every vehicle under test starts."""

NOWHERE = Point(east_m=math.nan, north_m=math.inf)


class BrokenRuleError(AssertionError):
    """A driver breaks a rule of the contract."""

    def __init__(self, rule: str, detail: str) -> None:
        super().__init__(f'{rule}: {detail}')
        self.rule = rule
        """Name of the rule's function."""


@dataclass(frozen=True, slots=True)
class Pace:
    """The speed of a vehicle and the ticks of its clock."""

    speed_mps: float
    tick_s: float
    start_s: float
    """Time of the first step."""

    @property
    def step_m(self) -> float:
        """The way of one tick."""
        return self.speed_mps * self.tick_s

    def __str__(self) -> str:
        return f'{self.speed_mps:g} m/s, ticks of {self.tick_s:g} s from {self.start_s:g} s'


class Trial(Generic[DriverT, StateT]):
    """One vehicle under test and its clock."""

    def __init__(
        self,
        make_driver: Callable[[], DriverT],
        step: Callable[[DriverT, float], StateT],
        autopilot: SimulatedAutopilot,
        pace: Pace,
    ) -> None:
        self.driver = make_driver()
        self.autopilot = autopilot
        self._make_driver = make_driver
        self._step = step
        self._pace = pace
        self._ticks_done: float | None = None

    def restart(self) -> None:
        """Go on with a driver made anew that recalls what the present one remembers."""
        memory = self.driver.memory()
        self.driver = self._make_driver()
        self.driver.recall(memory)

    def tick(self, share: float = 1.0) -> StateT:
        """Go on by a tick, or a share of one, and step; the first step is at the start time."""
        self._ticks_done = 0.0 if self._ticks_done is None else self._ticks_done + share
        return self.again()

    def again(self) -> StateT:
        """Step at the time of the step before."""
        now_s = self._pace.start_s + (self._ticks_done or 0.0) * self._pace.tick_s
        self.autopilot.step(now_s)
        return self._step(self.driver, now_s)

    def keeps_up_with(self, other: Trial[DriverT, StateT], ticks: int) -> Iterator[str]:
        """Go on by some ticks, and yield where the other one comes into another state."""
        for _ in range(ticks):
            state, expected = self.tick(), other.tick()
            if state != expected:
                yield f'{state}, should be {expected}'


@dataclass(frozen=True, slots=True, kw_only=True)
class Bench(Generic[DriverT, StateT]):
    """Makes trials of a driver at a pace, and knows what may be asked of it."""

    pace: Pace
    radius_m: float
    """How far from a point the vehicle may count as there."""
    settle_ticks: int
    """In how many ticks it dives or comes up."""
    trial: Callable[[], Trial[DriverT, StateT]]
    depart: Callable[[DriverT], None]
    """Send the vehicle on a way of some 50 ticks."""


Rule = Callable[[Bench[DriverT, StateT]], Iterator[str]]


def enforce(rules: Sequence[Rule[DriverT, StateT]], bench: Bench[DriverT, StateT]) -> None:
    """Raise `BrokenRuleError` for the first rule that is broken."""
    for rule in rules:
        for problem in rule(bench):
            raise BrokenRuleError(rule.__name__, f'{problem} (at {bench.pace})')


def along(points: Sequence[Point], length_m: float) -> Point:
    """Return the point of a polyline at a length from its beginning; its end beyond that."""
    arcs_m = np.cumsum([0.0, *(a.distance_m(b) for a, b in pairwise(points))])
    return Point(
        east_m=float(np.interp(length_m, arcs_m, [point.east_m for point in points])),
        north_m=float(np.interp(length_m, arcs_m, [point.north_m for point in points])),
    )


def place(point: Point) -> str:
    """Return a point as people read it."""
    return f'({point.east_m:.9g}, {point.north_m:.9g}) m'
