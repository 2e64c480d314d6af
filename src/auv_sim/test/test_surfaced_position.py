"""
What every promise about the sortie limit rests on, for all surfacing models.

An AUV that comes up is on its path, up at its surface time at the latest, and reports where it is.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import hypothesis.strategies as st
import numpy as np
from hypothesis import event, given, settings

from auv_sim.auv_agent import AuvAgent, AuvMission
from auv_sim.drivers.kinematic import KinematicAuv
from msgs_json.agent import Log, Output, Publish, Refuse, Transmit
from msgs_json.codec import Refusal
from msgs_json.custody import SampleCustody
from msgs_json.drivers import AuvDriverSetup
from msgs_json.geometry import Cell, GridSpec, Point, is_before, path_length_m, surface_deadline_s
from msgs_json.messages import (
    Acknowledgement,
    CellEntered,
    Leg,
    LegOutcome,
    PathAssignment,
    Surfaced,
    SurfacingReport,
)
from msgs_json.ros_messages import Odometry
from msgs_json.store import MemoryStore

ROUNDING = 1e-6
"""Lengths closer than this share of a cell are the same."""


class Warmth:
    def sample(self, point: Point) -> float:
        return 12.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Voyage:
    """An AUV, and what it is asked to do."""

    model: dict[str, Any]
    """Times in it are in ticks."""
    seed: int
    cell_m: float
    speed_mps: float
    ticks_per_cell: float
    margin_ticks: float
    first_tick: int
    legs: tuple[tuple[int, ...], ...]
    """Each move as a number; modulo the neighbours that there are, in a fixed order."""
    waits: tuple[int, ...]
    """Ticks at the surface before each leg but the first."""


times = st.integers(0, 60) | st.floats(0, 60)
current = st.sampled_from([0.0, 0.5, -1.0]) | st.floats(-1.5, 1.5)
"""As a share of the AUV's own speed."""
models = st.one_of(
    st.just({'model': 'on_time'}),
    st.builds(lambda p: {'model': 'early', 'probability': p}, st.floats(0, 1)),
    st.builds(
        lambda factor, east, north: {
            'model': 'slow',
            'least_factor': factor,
            'current_east_mps': east,
            'current_north_mps': north,
        },
        st.floats(0.01, 1) | st.just(1.0),
        current,
        current,
    ),
    st.builds(lambda at: {'model': 'abort', 'at_s': at}, times),
    st.builds(lambda start: {'model': 'lost', 'from_s': start}, times),
    st.builds(lambda start: {'model': 'silent', 'from_s': start, 'sorties': 2}, times),
)
moves = st.lists(st.integers(0, 11), min_size=1, max_size=5).map(tuple)
voyages = st.builds(
    Voyage,
    model=models,
    seed=st.integers(0, 2**32),
    cell_m=st.sampled_from([10.0, 7.3]) | st.floats(0.5, 500.0),
    speed_mps=st.sampled_from([1.0, 0.8]) | st.floats(0.05, 20.0),
    ticks_per_cell=st.sampled_from([10.0, 4.0, 1.0, 0.4]) | st.floats(0.2, 12.0),
    margin_ticks=st.sampled_from([0.0, 0.0, 3.5]),
    first_tick=st.sampled_from([0, 0, 7, 99_999]),
    legs=st.lists(moves, min_size=1, max_size=4).map(tuple),
    waits=st.lists(st.integers(0, 6), min_size=3, max_size=3).map(tuple),
)


class Sailor:
    """Sends an AUV on its voyage and watches it."""

    def __init__(self, voyage: Voyage) -> None:
        self.voyage = voyage
        self.tick_s = voyage.cell_m / voyage.speed_mps / voyage.ticks_per_cell
        self.region = GridSpec(cols=3, rows=4, cell_m=voyage.cell_m)
        self.path = self.walk((1, 1), voyage.legs[0])
        self.began = self.region.centre((1, 1))
        mission = AuvMission(
            region=self.region,
            uav='uav',
            speed_mps=voyage.speed_mps,
            depth_m=5.0,
            initial_path=self.path,
            surface_margin_s=voyage.margin_ticks * self.tick_s,
            tick_s=self.tick_s,
        )
        driver = KinematicAuv(
            AuvDriverSetup(
                name='auv_1',
                start=self.began,
                speed_mps=voyage.speed_mps,
                depth_m=5.0,
                surfacing=json.dumps(self.model_in_seconds()),
                rng=np.random.default_rng(voyage.seed),
            )
        )
        store = MemoryStore()
        custody = SampleCustody(store, 65_536, response_s=0.0)
        self.agent = AuvAgent('auv_1', mission, driver, Warmth(), store, custody)
        self.tick = voyage.first_tick - 1
        self.leg_id = 0
        self.moves_done = -1
        """-1 before the first cell is entered, by deployment."""
        self.arc_m = 0.0
        self.report: SurfacingReport | None = None
        self.deadline_s = self.deadline(voyage.first_tick * self.tick_s)
        self.said: list[object] = []

    def model_in_seconds(self) -> dict[str, Any]:
        def scale(key: str, value: float) -> float:
            if key.endswith('_s'):
                return value * self.tick_s
            return value * self.voyage.speed_mps if key.endswith('_mps') else value

        model = self.voyage.model
        return {key: scale(key, each) if key != 'model' else each for key, each in model.items()}

    def walk(self, start: Cell, numbers: Sequence[int]) -> tuple[Cell, ...]:
        path = [start]
        for number in numbers:
            col, row = path[-1]
            around = [(col + 1, row), (col, row + 1), (col - 1, row), (col, row - 1)]
            neighbours = [cell for cell in around if self.region.contains(cell)]
            path.append(neighbours[number % len(neighbours)])
        return tuple(path)

    @property
    def now_s(self) -> float:
        return self.tick * self.tick_s

    @property
    def line(self) -> list[Point]:
        """Where the leg began, then the centres of P_0 ... P_q."""
        return [self.began, *(self.region.centre(cell) for cell in self.path)]

    def deadline(self, start_s: float) -> float:
        way_m = path_length_m(self.line)
        margin_s = self.voyage.margin_ticks * self.tick_s
        return surface_deadline_s(start_s, way_m, self.voyage.speed_mps, margin_s, self.tick_s)

    def is_past(self, key: str) -> bool:
        """Return whether a time of the model has come."""
        if key not in self.voyage.model:
            return False
        start_s = self.voyage.first_tick * self.tick_s
        return not is_before(self.now_s, start_s + self.voyage.model[key] * self.tick_s)

    def go_on(self) -> None:
        """Let a tick pass, and check all that must hold."""
        self.tick += 1
        was_up = self.report is not None
        output = self.agent.tick(self.now_s)
        self.said += output
        (odometry,) = [
            each.message
            for each in output
            if isinstance(each, Publish) and isinstance(each.message, Odometry)
        ]
        reports = [
            each.body
            for each in output
            if isinstance(each, Transmit) and isinstance(each.body, SurfacingReport)
        ]
        log = [each.event for each in output if isinstance(each, Log)]
        surfaced = [each for each in log if isinstance(each, Surfaced)]
        self.moves_done += sum(isinstance(each, CellEntered) for each in log)

        is_up = odometry.z_m == 0.0
        assert is_up or odometry.z_m == -5.0
        assert len(reports) == is_up
        assert len(surfaced) == (is_up and not was_up)
        self.check_place(odometry.position)
        if self.voyage.model['model'] == 'lost' and self.is_past('from_s'):
            assert is_up == was_up  # it does not come up, nor go down by itself
        else:
            assert is_up or is_before(self.now_s, self.deadline_s)
        if is_up:
            self.check_report(reports[0], odometry.position, surfaced)
            self.report = reports[0]

    def check_place(self, position: Point) -> None:
        """Check that the AUV is on the segment of its present move and never goes back."""
        first = 0 if self.moves_done == 0 else self.moves_done + 1
        slack_m = ROUNDING * self.voyage.cell_m
        arcs_m = [
            path_length_m(self.line[: number + 1]) + a.distance_m(position)
            for number, (a, b) in enumerate(zip(self.line, self.line[1:], strict=False))
            if first <= number <= self.moves_done + 1
            and a.distance_m(position) + position.distance_m(b) <= a.distance_m(b) + slack_m
        ]
        if self.moves_done == len(self.path) - 1:
            assert position == self.line[-1]
            arcs_m.append(path_length_m(self.line))
        # On two segments at once: where it turns round, and going from its beginning to P_0.
        ahead_m = [arc_m for arc_m in arcs_m if arc_m >= self.arc_m - slack_m]
        assert ahead_m
        self.arc_m = min(ahead_m)

    def check_report(
        self, report: SurfacingReport, position: Point, surfaced: list[Surfaced]
    ) -> None:
        assert (report.leg_id, report.moves_done) == (self.leg_id, self.moves_done)
        assert report.cell == self.path[self.moves_done]
        assert report.position == position
        is_over = self.moves_done == len(self.path) - 1
        kind = self.voyage.model['model']
        expected = {
            LegOutcome.ABORTED: self.is_past('at_s'),
            LegOutcome.COMPLETED: is_over and not self.is_past('at_s'),
            LegOutcome.EARLY: kind == 'early' and not is_over,
            LegOutcome.DEADLINE: kind == 'slow' and not is_over,
        }
        assert expected[report.outcome]
        if surfaced:
            assert report.surfaced_s == self.now_s
            assert surfaced == [
                Surfaced(leg_id=self.leg_id, outcome=report.outcome, cell=report.cell)
            ]
            if report.outcome is LegOutcome.DEADLINE:
                assert not is_before(self.now_s, self.deadline_s)
            is_at_centre = position == self.region.centre(report.cell)
            where = 'at a centre' if is_at_centre else 'between two cells'
            event(f'{kind}: {report.outcome.value} {where}')

    def assign(self, numbers: Sequence[int]) -> list[Output]:
        """Hand over the next path, from where the AUV said it is."""
        assert self.report is not None
        path, began = self.walk(self.report.cell, numbers), self.report.position
        before = self.path, self.began
        self.path, self.began = path, began
        deadline_s = self.deadline(self.now_s)
        leg = Leg(leg_id=self.leg_id + 1, path=path, surface_deadline_s=deadline_s)
        output = self.agent.receive('uav', PathAssignment(auv='auv_1', leg=leg), self.now_s)
        self.said += output
        if isinstance(output[0], Refuse):
            self.path, self.began = before
            return output
        assert isinstance(output[0], Transmit)
        assert isinstance(output[0].body, Acknowledgement)
        self.leg_id, self.deadline_s = leg.leg_id, deadline_s
        self.moves_done, self.arc_m, self.report = 0, 0.0, None
        return output

    def sail(self) -> None:
        """Swim all legs, one after another, until the AUV is lost or needs help."""
        for number, numbers in enumerate(self.voyage.legs):
            if number > 0:
                for _ in range(self.voyage.waits[number - 1]):
                    self.go_on()
                output = self.assign(numbers)
                if isinstance(output[0], Refuse):
                    assert output[0].refusal is Refusal.NOT_POSSIBLE
                    assert self.is_past('at_s')
                    return
                assert not self.is_past('at_s')
            self.go_on()
            while is_before(self.now_s, self.deadline_s):
                self.go_on()
            if self.report is None:
                assert self.voyage.model['model'] == 'lost'
                for _ in range(20):
                    self.go_on()
                return


@given(voyages)
@settings(max_examples=150)
def test_an_auv_comes_up_on_its_path_in_time_and_says_where(voyage: Voyage) -> None:
    Sailor(voyage).sail()


@given(voyages)
@settings(max_examples=50)
def test_same_seed_same_fate(voyage: Voyage) -> None:
    one, other = Sailor(voyage), Sailor(voyage)
    one.sail()
    other.sail()
    assert one.said == other.said
