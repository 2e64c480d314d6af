"""AUVs for a UAV on the bench: they keep to their legs and come up anywhere on them, in time."""

from __future__ import annotations

from itertools import islice
from random import Random

import hypothesis.strategies as st
import msgspec
from uav_bench import SETUP, Bench, auv_order, order, said, taken

from msgs_json.agent import Output
from msgs_json.geometry import GridSpec, within_range
from msgs_json.messages import (
    Acknowledged,
    AuvOrder,
    Leg,
    LegOutcome,
    Message,
    MissionOrder,
    PathAssignment,
    RecoveryOrder,
    RecoveryReason,
    Sample,
    SampleReceipt,
    SortieReport,
    SurfacingReport,
)
from uav_planner.guarantee import least_limit_s
from uav_planner.mission_order import mission_spec
from uav_planner.oracle_boards import legs_of


class Diver:
    """One AUV; without ``random`` it swims its whole legs and comes up when that is due."""

    def __init__(
        self, order: AuvOrder, region: GridSpec, random: Random | None, samples_at_a_time: int
    ) -> None:
        self.name = order.name
        self.samples: list[Sample] = []
        """All that it has taken."""
        self.held: set[int] = set()
        """Numbers of those that need not be said again."""
        self._samples_at_a_time = samples_at_a_time
        self.recovered: RecoveryReason | None = None
        self._region = region
        self._random = random
        self.position = region.centre(order.leg.path[0])
        self._sample(order.leg.path[0])
        self._dive(order.leg, 0.0)

    def report(self, now_s: float) -> SurfacingReport | None:
        """Return what it says; None under water."""
        if now_s < self._surfaces_s:
            return None
        return SurfacingReport(
            auv=self.name,
            leg_id=self._leg.leg_id,
            outcome=LegOutcome.COMPLETED,
            moves_done=self._moves_done,
            cell=self._leg.path[self._moves_done],
            position=self.position,
            surfaced_s=self._surfaces_s,
            samples_taken=len(self.samples),
            samples=self._batch(),
        )

    def _batch(self) -> tuple[Sample, ...]:
        waiting = (sample for sample in self.samples if sample.number not in self.held)
        return tuple(islice(waiting, self._samples_at_a_time))

    def told(self, message: Message, now_s: float) -> list[Message]:
        """Take what the UAV says; return its answer."""
        match message:
            case SampleReceipt(held=held, at_c3=at_c3):
                self.held = {n for span in (*held, *at_c3) for n in range(span.first, span.until)}
            case PathAssignment(leg=leg):
                if leg.leg_id > self._leg.leg_id:
                    self._dive(leg, now_s)
                return [taken(Acknowledged.PATH_ASSIGNMENT, leg.leg_id)]
            case RecoveryOrder():
                self.recovered = message.reason
                return [taken(Acknowledged.RECOVERY_ORDER, message.leg_id)]
        return []

    def _dive(self, leg: Leg, now_s: float) -> None:
        self._leg = leg
        self._moves_done, self._surfaces_s = len(leg.path) - 1, leg.surface_deadline_s
        share = 0.0
        if self._random is not None:
            self._moves_done = self._random.randint(0, len(leg.path) - 1)
            self._surfaces_s = float(self._random.randint(int(now_s) + 1, int(self._surfaces_s)))
            share = self._random.choice([0.0, self._random.random()])
        for cell in leg.path[1 : self._moves_done + 1]:
            self._sample(cell)
        if self._moves_done == 0 and share > 0.5:
            return  # not even back at the centre of its first cell
        centre = self._region.centre(leg.path[self._moves_done])
        following = self._region.centre(leg.path[min(self._moves_done + 1, len(leg.path) - 1)])
        self.position = centre.toward(following, share * self._region.cell_m)

    def _sample(self, cell: tuple[int, int]) -> None:
        number = len(self.samples)
        self.samples.append(
            Sample(auv=self.name, number=number, cell=cell, entered_s=0.0, value=1.0)
        )


class Sea:
    """The AUVs of a mission, heard when they are in range, and a C3 that hears everything."""

    def __init__(
        self,
        bench: Bench,
        order: MissionOrder,
        random: Random | None = None,
        *,
        loss: float = 0.0,
        silent: frozenset[str] = frozenset(),
        samples_at_a_time: int = 1000,
    ) -> None:
        self.bench = bench
        self.reports: list[SortieReport] = []
        self.divers = {
            auv.name: Diver(auv, order.region, random, samples_at_a_time) for auv in order.auvs
        }
        self._range_m = order.radio_range_m
        self._random = random
        self._loss = loss
        self._silent = silent
        bench.tick()
        bench.hear('c3', order)
        bench.plan_ahead()

    def sail(self, seconds: int) -> list[Output]:
        """Let time pass, to the end of the mission at most; return what came of the UAV."""
        output: list[Output] = []
        while seconds > 0 and not self.bench.agent.finished:
            output += self.tick()
            seconds -= 1
        return output

    def tick(self) -> list[Output]:
        """Let a second pass."""
        bench = self.bench
        output = bench.tick()
        for diver in self.divers.values():
            report = diver.report(bench.now_s)
            if report is not None and self._is_in_range(diver) and self._gets_through():
                output += self._carry(bench.hear(diver.name, report))
        self.reports += [body for body in said(output, 'c3') if isinstance(body, SortieReport)]
        return [*output, *bench.deliver(output)]

    def _carry(self, output: list[Output]) -> list[Output]:
        """Carry what the UAV says to the AUVs, and their answers back."""
        for diver in self.divers.values():
            for body in said(output, diver.name):
                if not (self._is_in_range(diver) and self._gets_through()):
                    continue
                for answer in diver.told(body, self.bench.now_s):
                    if self._gets_through():
                        output += self.bench.hear(diver.name, answer)
        return output

    def _is_in_range(self, diver: Diver) -> bool:
        distance_m = self.bench.here.distance_m(diver.position)
        return diver.name not in self._silent and within_range(distance_m, self._range_m)

    def _gets_through(self) -> bool:
        return self._random is None or self._random.random() >= self._loss


def round_s(order: MissionOrder) -> float:
    """Return the least limit with which a guarantee takes a mission."""
    return least_limit_s(mission_spec(order, SETUP), legs_of(auv.leg.path for auv in order.auvs))


@st.composite
def missions(draw: st.DrawFn) -> MissionOrder:
    """Some AUVs on a small region; the limit is what they need at the start, or little more."""
    region = GridSpec(cols=draw(st.integers(2, 5)), rows=draw(st.integers(1, 4)), cell_m=10.0)
    mission = order(
        region=region,
        radio_range_m=draw(st.sampled_from([10.0, 12.0, 20.0])),
        path_cells=draw(st.integers(1, 3)),
        handover_s=draw(st.sampled_from([0.0, 0.0, 2.5])),
        lost_after_sorties=draw(st.integers(1, 3)),
        auvs=tuple(draw(auv_orders(region, f'auv_{number}')) for number in (1, 2, 3)),
    )
    limit_s = max(1.0, round_s(mission)) * draw(st.sampled_from([1.0, 1.0, 1.2, 2.0]))
    return msgspec.structs.replace(mission, sortie_limit_s=limit_s)


@st.composite
def auv_orders(draw: st.DrawFn, region: GridSpec, name: str) -> AuvOrder:
    cell = (draw(st.integers(0, region.cols - 1)), draw(st.integers(0, region.rows - 1)))
    neighbours = [
        neighbour
        for east, north in ((1, 0), (0, 1), (-1, 0), (0, -1))
        if region.contains(neighbour := (cell[0] + east, cell[1] + north))
    ]
    path = (cell, draw(st.sampled_from(neighbours)))
    return auv_order(name, path, float(draw(st.integers(10, 60))))
