"""The conformance suite passes drivers that conform, and names the rule that another breaks."""

from __future__ import annotations

import contextlib
import math
from bisect import bisect_right
from itertools import accumulate, count, pairwise
from typing import TYPE_CHECKING

import msgspec
import pytest
from msgspec.structs import replace

from msgs_json.driver_checks import BrokenRuleError, check_auv_driver, check_uav_driver
from msgs_json.driver_checks.auv_rules import AUV_RULES
from msgs_json.driver_checks.memory_rules import MEMORY_RULES
from msgs_json.driver_checks.shared_rules import SHARED_RULES
from msgs_json.driver_checks.uav_rules import UAV_RULES
from msgs_json.drivers import (
    AuvState,
    CommandRefusedError,
    VehicleState,
    VehicleUnavailableError,
)
from msgs_json.geometry import Point
from msgs_json.topics import VEHICLE_ODOM

if TYPE_CHECKING:
    from collections.abc import Sequence

    from msgs_json.drivers import AuvDriverSetup, DriverPorts, UavDriverSetup
    from msgs_json.ros_messages import Odometry


class GoodUav:
    """Keeps every rule; the broken ones below each do one thing differently."""

    altitude_m: float | None = None
    """Where it flies; None for that of its setup."""
    tolerance_m = 1e-6
    """Where a target is this close after a step, it is reached."""
    short_of_target_m = 0.0

    def __init__(self, setup: UavDriverSetup, ports: DriverPorts) -> None:
        self.setup, self.ports = setup, ports
        self.here = self.origin = self.target = setup.home
        self.now_s: float | None = None
        self.origin_s: float | None = None
        self.kept = b''

    def go_to(self, target: Point) -> None:
        if not math.isfinite(target.east_m + target.north_m):
            raise CommandRefusedError(f'{target}')
        if target != self.target:
            self.origin, self.origin_s, self.target = self.here, self.now_s, target

    def elapsed_s(self, now_s: float) -> float:
        self.now_s = now_s
        if self.origin_s is None:
            self.origin_s = now_s
        return now_s - self.origin_s

    def step(self, now_s: float) -> VehicleState:
        way_m = self.setup.speed_mps * self.elapsed_s(now_s)
        length_m = self.origin.distance_m(self.target)
        arrived = way_m >= length_m - self.tolerance_m
        self.here = self.target if arrived else between(self.origin, self.target, way_m / length_m)
        return self.state()

    def state(self) -> VehicleState:
        return VehicleState(
            position=Point(
                east_m=self.here.east_m - self.short_of_target_m, north_m=self.here.north_m
            ),
            z_m=self.setup.altitude_m if self.altitude_m is None else self.altitude_m,
            heading_rad=0.0,
            speed_mps=self.setup.speed_mps,
        )

    def memory(self) -> bytes:
        known = msgspec.msgpack.encode((self.origin, self.target, self.origin_s))
        if known != self.kept:
            self.kept = known
        return self.kept

    def recall(self, memory: bytes) -> None:
        known = msgspec.msgpack.decode(memory, type=tuple[Point, Point, float | None])
        self.origin, self.target, self.origin_s = known


def between(start: Point, end: Point, share: float) -> Point:
    return Point(
        east_m=start.east_m + share * (end.east_m - start.east_m),
        north_m=start.north_m + share * (end.north_m - start.north_m),
    )


class AddsUpRounding(GoodUav):
    """Moves on from where it was a step before, and forgives no rounding."""

    def step(self, now_s: float) -> VehicleState:
        way_m = self.setup.speed_mps * (0.0 if self.now_s is None else now_s - self.now_s)
        self.now_s = now_s
        left_m = self.here.distance_m(self.target)
        self.here = (
            self.target if way_m >= left_m else between(self.here, self.target, way_m / left_m)
        )
        return self.state()


class Overshoots(GoodUav):
    """Stops at the first step beyond its target."""

    def step(self, now_s: float) -> VehicleState:
        way_m = self.setup.speed_mps * self.elapsed_s(now_s)
        length_m = self.origin.distance_m(self.target)
        if length_m:
            tick_m = self.setup.speed_mps
            steps = min(math.ceil(way_m / tick_m), math.ceil(length_m / tick_m))
            self.here = between(self.origin, self.target, steps * tick_m / length_m)
        return self.state()


class StopsShort(GoodUav):
    short_of_target_m = 1e-9


class WaitsATick(GoodUav):
    """Starts with the step after the next."""

    def elapsed_s(self, now_s: float) -> float:
        elapsed_s = super().elapsed_s(now_s)
        if elapsed_s > 0.0 and self.here == self.origin != self.target and not self.waited:
            self.waited, self.origin_s = True, now_s
            return 0.0
        return elapsed_s

    def go_to(self, target: Point) -> None:
        super().go_to(target)
        self.waited = False

    waited = False


class CountsFromZero(GoodUav):
    """Takes the time of its first step for the time since it started."""

    def __init__(self, setup: UavDriverSetup, ports: DriverPorts) -> None:
        super().__init__(setup, ports)
        self.now_s = self.origin_s = 0.0


class MovesAtEveryStep(GoodUav):
    """Moves a fixed length at every step, whatever the time."""

    def __init__(self, setup: UavDriverSetup, ports: DriverPorts) -> None:
        super().__init__(setup, ports)
        self.steps = count()

    def elapsed_s(self, now_s: float) -> float:
        super().elapsed_s(now_s)
        return 1.0 * next(self.steps)


class KnowsOneTick(GoodUav):
    """Takes every step for as long as the first one was."""

    tick_s: float | None = None
    last_s: float | None = None
    steps = 0

    def go_to(self, target: Point) -> None:
        if target != self.target:
            self.steps = 0
        super().go_to(target)

    def elapsed_s(self, now_s: float) -> float:
        super().elapsed_s(now_s)
        if self.last_s is not None and now_s > self.last_s:
            self.tick_s = self.tick_s or now_s - self.last_s
            self.steps += 1
        self.last_s = now_s
        return self.steps * (self.tick_s or 0.0)


class FinishesFirst(GoodUav):
    """Takes no new target under way."""

    def go_to(self, target: Point) -> None:
        if self.here == self.target:
            super().go_to(target)


class StartsAnew(GoodUav):
    """Loses the way of the tick when it is sent again to the same place."""

    def go_to(self, target: Point) -> None:
        if target == self.target:
            self.origin, self.origin_s = self.here, None
        super().go_to(target)


class Grounded(GoodUav):
    altitude_m = 0.0


class GoesAnywhere(GoodUav):
    def go_to(self, target: Point) -> None:
        self.origin, self.origin_s, self.target = self.here, self.now_s, target


class Wanders(GoodUav):
    """Does not stay at home."""

    def step(self, now_s: float) -> VehicleState:
        state = super().step(now_s)
        if self.target != self.setup.home:
            return state
        return replace(state, position=between(state.position, self.origin, 1.0 + now_s))

    def __init__(self, setup: UavDriverSetup, ports: DriverPorts) -> None:
        super().__init__(setup, ports)
        self.origin = Point(east_m=0.0, north_m=0.0)


class HasNoHeading(GoodUav):
    def state(self) -> VehicleState:
        return replace(super().state(), heading_rad=math.nan)


class HasItsMoods(GoodUav):
    """Flies a little lower than the one made before."""

    made = count()

    def __init__(self, setup: UavDriverSetup, ports: DriverPorts) -> None:
        super().__init__(setup, ports)
        self.altitude_m = setup.altitude_m - 1e-9 * next(self.made)


class GivesUp(GoodUav):
    """Never comes back from silence."""

    heard = True
    lost = False

    def __init__(self, setup: UavDriverSetup, ports: DriverPorts) -> None:
        super().__init__(setup, ports)
        ports.subscribe_odometry(VEHICLE_ODOM, self.hear)

    def hear(self, odometry: Odometry) -> None:
        self.heard = True

    def step(self, now_s: float) -> VehicleState:
        self.lost = self.lost or not self.heard
        self.heard = False
        if self.lost:
            raise VehicleUnavailableError('lost')
        return super().step(now_s)


class Forgets(GoodUav):
    """Flies on from its memory, but as if it had just been sent off."""

    def recall(self, memory: bytes) -> None:
        super().recall(memory)
        self.origin_s = None


class CopiesItsMemory(GoodUav):
    def memory(self) -> bytes:
        self.kept = b''
        return super().memory()


class BelievesAnything(GoodUav):
    def recall(self, memory: bytes) -> None:
        with contextlib.suppress(ValueError):
            super().recall(memory)


@pytest.mark.parametrize(
    ('broken_driver', 'rule'),
    [
        (AddsUpRounding, 'arrives_in_whole_ticks'),
        (Overshoots, 'arrives_in_whole_ticks'),
        (WaitsATick, 'arrives_in_whole_ticks'),
        (StopsShort, 'first_step_does_not_move'),
        (CountsFromZero, 'first_step_does_not_move'),
        (MovesAtEveryStep, 'same_time_same_place'),
        (KnowsOneTick, 'uneven_steps_keep_speed'),
        (FinishesFirst, 'turns_to_a_new_target'),
        (StartsAnew, 'repeated_target_changes_nothing'),
        (Grounded, 'flies_at_altitude'),
        (GoesAnywhere, 'refuses_a_target_that_is_nowhere'),
        (Wanders, 'holds_over_home'),
        (HasNoHeading, 'states_are_finite'),
        (HasItsMoods, 'same_commands_same_states'),
        (GivesUp, 'heard_again_is_there_again'),
        (Forgets, 'goes_on_from_its_memory'),
        (CopiesItsMemory, 'has_the_same_memory_until_that_changes'),
        (BelievesAnything, 'refuses_what_is_no_memory'),
    ],
)
def test_broken_uav_is_caught(broken_driver: type[GoodUav], rule: str) -> None:
    with pytest.raises(BrokenRuleError) as caught:
        check_uav_driver(broken_driver)
    assert caught.value.rule == rule


def test_good_uav_passes() -> None:
    check_uav_driver(GoodUav)


def test_uav_may_stop_within_its_radius() -> None:
    check_uav_driver(StopsShort, arrival_radius_m=1e-3)


class GoodAuv:
    """Keeps every rule; the broken ones below each do one thing differently."""

    tolerance_s = 1e-6
    z_down_m: float | None = None
    """Where it swims; None for the depth of its setup."""
    z_up_m = 0.0

    def __init__(self, setup: AuvDriverSetup, ports: DriverPorts) -> None:
        self.setup, self.ports = setup, ports
        self.line: tuple[Point, ...] = (setup.start,)
        self.here, self.reached = setup.start, 0
        self.up = True
        self.now_s: float | None = None
        self.origin_s: float | None = None
        self.kept = b''

    def follow(self, waypoints: Sequence[Point]) -> None:
        if not waypoints or not all(math.isfinite(p.east_m + p.north_m) for p in waypoints):
            raise CommandRefusedError(f'{waypoints}')
        self.line, self.origin_s = (self.here, *waypoints), self.now_s
        self.reached, self.up = 0, False

    def surface(self) -> None:
        self.up = True

    def elapsed_s(self, now_s: float) -> float:
        self.now_s = now_s
        if self.origin_s is None:
            self.origin_s = now_s
        return now_s - self.origin_s

    def step(self, now_s: float) -> AuvState:
        elapsed_s = self.elapsed_s(now_s)
        if not self.up:
            self.swim(elapsed_s)
        return self.state()

    def swim(self, elapsed_s: float) -> None:
        speed_mps = self.setup.speed_mps
        lengths_m = [a.distance_m(b) for a, b in pairwise(self.line)]
        times_s = [arc_m / speed_mps for arc_m in accumulate(lengths_m, initial=0.0)]
        self.reached = bisect_right(times_s, elapsed_s + self.tolerance_s) - 1
        self.here = self.line[self.reached]
        if self.reached < len(lengths_m):
            past_m = speed_mps * (elapsed_s - times_s[self.reached])
            share = past_m / lengths_m[self.reached]
            self.here = between(self.here, self.line[self.reached + 1], share)

    def state(self) -> AuvState:
        z_down_m = -self.setup.depth_m if self.z_down_m is None else self.z_down_m
        return AuvState(
            position=self.here,
            z_m=self.z_up_m if self.up else z_down_m,
            heading_rad=0.0,
            speed_mps=0.0,
            surfaced=self.up,
            waypoints_reached=self.reached,
        )

    def memory(self) -> bytes:
        place = (self.here, self.reached) if self.up else None
        known = msgspec.msgpack.encode((self.line, self.origin_s, place))
        if known != self.kept:
            self.kept = known
        return self.kept

    def recall(self, memory: bytes) -> None:
        self.line, self.origin_s, place = msgspec.msgpack.decode(
            memory, type=tuple[tuple[Point, ...], float | None, tuple[Point, int] | None]
        )
        self.up = place is not None
        if place is not None:
            self.here, self.reached = place


class ForgivesNoRounding(GoodAuv):
    tolerance_s = 0.0


class StaysWet(GoodAuv):
    """Reports to be under water although it was told to come up."""

    def surface(self) -> None:
        pass


class BobsInTheWaves(GoodAuv):
    z_up_m = -0.2


class StartsUnderWater(GoodAuv):
    def __init__(self, setup: AuvDriverSetup, ports: DriverPorts) -> None:
        super().__init__(setup, ports)
        self.up = False


class SurfacesAtTheEnd(GoodAuv):
    """Comes up at the last waypoint without being told."""

    def swim(self, elapsed_s: float) -> None:
        super().swim(elapsed_s)
        self.up = self.reached == len(self.line) - 1


class SwimsShallow(GoodAuv):
    z_down_m = -0.5


class SwimsOnAtTheSurface(GoodAuv):
    def step(self, now_s: float) -> AuvState:
        if len(self.line) > 1:
            self.swim(self.elapsed_s(now_s))
        return super().step(now_s)


class DivesWhenToldTwice(GoodAuv):
    def surface(self) -> None:
        self.up = not self.up


class CriesWolf(GoodAuv):
    """Asks for help when it comes up after a leg."""

    def state(self) -> AuvState:
        return replace(super().state(), needs_help=self.up and len(self.line) > 1)


class CountsItsPlace(GoodAuv):
    """Counts the place where a leg begins as a waypoint."""

    def state(self) -> AuvState:
        state = super().state()
        return replace(state, waypoints_reached=state.waypoints_reached + 1)


class CountsOn(GoodAuv):
    """Goes on counting the waypoints of the leg before."""

    before = 0

    def follow(self, waypoints: Sequence[Point]) -> None:
        reached = self.reached
        super().follow(waypoints)
        self.before += reached

    def state(self) -> AuvState:
        state = super().state()
        return replace(state, waypoints_reached=state.waypoints_reached + self.before)


class CutsCorners(GoodAuv):
    """Swims straight to the last waypoint."""

    def swim(self, elapsed_s: float) -> None:
        super().swim(elapsed_s)
        if self.reached < len(self.line) - 1:
            self.here = between(self.line[0], self.line[-1], self.reached / len(self.line))


class BreathesOnce(GoodAuv):
    """Does not dive again."""

    def follow(self, waypoints: Sequence[Point]) -> None:
        first = len(self.line) == 1
        super().follow(waypoints)
        self.up = not first


class SwimsAnywhere(GoodAuv):
    def follow(self, waypoints: Sequence[Point]) -> None:
        if waypoints:
            super().follow([p for p in waypoints if math.isfinite(p.east_m)])


class SwimsByCalls(GoodAuv):
    """Takes every step for as long as the first one was."""

    tick_s: float | None = None
    last_s: float | None = None
    steps = 0

    def follow(self, waypoints: Sequence[Point]) -> None:
        super().follow(waypoints)
        self.steps = 0

    def elapsed_s(self, now_s: float) -> float:
        super().elapsed_s(now_s)
        if self.last_s is not None and now_s > self.last_s:
            self.tick_s = self.tick_s or now_s - self.last_s
            self.steps += 1
        self.last_s = now_s
        return self.steps * (self.tick_s or 0.0)


class DivesAgain(GoodAuv):
    """Forgets that it was told to come up."""

    def recall(self, memory: bytes) -> None:
        super().recall(memory)
        self.up = len(self.line) == 1


@pytest.mark.parametrize(
    ('broken_driver', 'rule'),
    [
        (ForgivesNoRounding, 'reaches_waypoints_in_whole_ticks'),
        (CountsItsPlace, 'reaches_waypoints_in_whole_ticks'),
        (CutsCorners, 'reaches_waypoints_in_whole_ticks'),
        (SwimsByCalls, 'uneven_steps_keep_speed'),
        (StartsUnderWater, 'starts_surfaced'),
        (SurfacesAtTheEnd, 'stays_down_until_told'),
        (SwimsShallow, 'stays_down_until_told'),
        (BobsInTheWaves, 'surfaced_means_z_is_0'),
        (StaysWet, 'surfaces_where_it_is'),
        (SwimsOnAtTheSurface, 'surfaces_where_it_is'),
        (DivesWhenToldTwice, 'surfaces_where_it_is'),
        (CriesWolf, 'asks_for_no_help'),
        (CountsOn, 'takes_another_leg'),
        (BreathesOnce, 'takes_another_leg'),
        (SwimsAnywhere, 'refuses_a_leg_that_leads_nowhere'),
        (DivesAgain, 'goes_on_from_its_memory_at_the_surface'),
    ],
)
def test_broken_auv_is_caught(broken_driver: type[GoodAuv], rule: str) -> None:
    with pytest.raises(BrokenRuleError) as caught:
        check_auv_driver(broken_driver)
    assert caught.value.rule == rule


def test_good_auv_passes() -> None:
    check_auv_driver(GoodAuv)


class CountsEarly(GoodAuv):
    """Counts a waypoint as reached from 6 s before it on."""

    def state(self) -> AuvState:
        state = super().state()
        if self.reached == len(self.line) - 1:
            return state
        is_close = self.here.distance_m(self.line[self.reached + 1]) <= 6.0 * self.setup.speed_mps
        return replace(state, waypoints_reached=state.waypoints_reached + is_close)


def test_auv_may_count_waypoints_within_its_radius() -> None:
    # The way may be cut by twice the radius at every waypoint, so 6 m early needs 3 m.
    with pytest.raises(BrokenRuleError, match='counts 1 waypoints as reached, should be 0'):
        check_auv_driver(CountsEarly, capture_radius_m=2.0)
    check_auv_driver(CountsEarly, capture_radius_m=4.0)


ALL_RULES = (*SHARED_RULES, *UAV_RULES, *AUV_RULES, *MEMORY_RULES)


def test_every_rule_has_a_driver_that_breaks_it() -> None:
    broken = {
        rule
        for test in (test_broken_uav_is_caught, test_broken_auv_is_caught)
        for _, rule in test.pytestmark[0].args[1]
    }
    assert broken == {rule.__name__ for rule in ALL_RULES}


def test_broken_rule_says_at_which_pace() -> None:
    with pytest.raises(BrokenRuleError, match=r'z is 0.0 m.*4 m/s, ticks of 1 s from 0 s'):
        check_uav_driver(Grounded)
