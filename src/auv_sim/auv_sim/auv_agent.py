"""The AUV: swims its leg, surfaces, hands its data over, takes the next leg."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from msgspec import Struct, structs

from msgs_json.agent import Log, Output, Publish, Refuse, Transmit
from msgs_json.codec import Refusal
from msgs_json.drivers import AuvDriver, AuvState, CommandRefusedError
from msgs_json.geometry import (
    Cell,
    GridSpec,
    is_before,
    path_length_m,
    path_problem,
    surface_deadline_s,
)
from msgs_json.messages import (
    Acknowledged,
    Acknowledgement,
    CellEntered,
    Dived,
    Leg,
    LegOutcome,
    Message,
    PathAssignment,
    RecoveryOrder,
    Sample,
    SampleReceipt,
    StayedUp,
    Surfaced,
    SurfacingReport,
)
from msgs_json.ros_messages import TrackPath
from msgs_json.topics import ODOM, PATH

if TYPE_CHECKING:
    from auv_sim.survey_field import SurveyField
    from msgs_json.custody import SampleCustody
    from msgs_json.store import Store

_MEMORY = 'leg'
"""Kind of the one entry of the store that is not a sample."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AuvMission:
    """What an AUV is told before it is put into the water."""

    region: GridSpec
    uav: str
    """Name of the UAV that relays for it."""
    speed_mps: float
    depth_m: float
    initial_path: tuple[Cell, ...]
    surface_margin_s: float
    tick_s: float


class _Memory(Struct, frozen=True, kw_only=True):
    """What an AUV must still know after its process died, but for its samples."""

    leg: Leg
    """The one under way or just ended."""
    cells_ahead: tuple[Cell | None, ...]
    reached: int
    cell: Cell
    outcome: LegOutcome | None
    report: SurfacingReport | None
    samples_taken: int
    finished: bool


class AuvAgent:
    """
    Sans-I/O behaviour of one AUV.

    Its vehicle is behind ``driver``, its sensor is ``field``. What it finds in ``store`` is of a
    process that died: it goes on from there.
    """

    def __init__(
        self,
        name: str,
        mission: AuvMission,
        driver: AuvDriver,
        field: SurveyField,
        store: Store,
        custody: SampleCustody,
    ) -> None:
        self.name = name
        self.peers = frozenset({mission.uav})
        self._mission = mission
        self._driver = driver
        self._field = field
        self._store = store
        self._custody = custody
        memory = store.load(_MEMORY, _Memory).get('')
        self.finished = memory.finished if memory else False
        self._leg = memory.leg if memory else None
        """The one under way or just ended; None before the first."""
        self._cells_ahead = memory.cells_ahead if memory else ()
        """The cell entered at each waypoint of the driver; None where none is."""
        self._reached = memory.reached if memory else 0
        self._cell = memory.cell if memory else mission.initial_path[0]
        """The last cell entered."""
        self._outcome = memory.outcome if memory else None
        """Why the leg ends; None while it goes on."""
        self._report = memory.report if memory else None
        """What is said while at the surface; None under water."""
        self._samples_taken = memory.samples_taken if memory else 0
        self._untold: list[Output] = []
        """What happened and was not said: the vehicle may fail between the two."""

    def tick(self, now_s: float) -> list[Output]:
        """Swim to ``now_s``; surface when the leg is over; report while at the surface."""
        state = self._driver.step(now_s)
        if self._leg is None:
            self._untold += self._begin(state, now_s)
            state = self._driver.step(now_s)
        self._untold += self._enter_cells(state, now_s)
        if self._report is None and self._leg is not None:
            self._decide_to_surface(self._leg, state, now_s)
            if self._outcome is not None and not state.surfaced:
                self._driver.surface()
                state = self._driver.step(now_s)
            if self._outcome is not None and state.surfaced:
                self._untold += self._come_up(self._leg, self._outcome, state, now_s)
        output, self._untold = self._untold, []
        output.append(Publish(ODOM, state.odometry(self.name, now_s)))
        if self._report is not None and not self.finished:
            # A fault may come while it lies at the surface, too.
            outcome = LegOutcome.ABORTED if state.needs_help else self._report.outcome
            report = structs.replace(
                self._report, outcome=outcome, samples=self._custody.first_batch(now_s)
            )
            output.append(Transmit(self._mission.uav, report))
        return output

    def receive(self, src: str, message: Message, now_s: float) -> list[Output]:
        """Take a receipt for samples, a next leg or the order to stay up."""
        match message:
            case SampleReceipt():
                return self._passed_on(message, now_s)
            case PathAssignment():
                return self._assigned(message, now_s)
            case RecoveryOrder():
                return self._recovered(message, now_s)
            case _:
                detail = f'an AUV takes no {type(message).__name__}'
                return [Refuse(src, Refusal.UNEXPECTED, detail)]

    # --- a leg, from first to last cell ----------------------------------------------------------

    def _begin(self, state: AuvState, now_s: float) -> list[Output]:
        mission = self._mission
        way_m = path_length_m([mission.region.centre(cell) for cell in mission.initial_path])
        deadline_s = surface_deadline_s(
            now_s, way_m, mission.speed_mps, mission.surface_margin_s, mission.tick_s
        )
        leg = Leg(leg_id=0, path=mission.initial_path, surface_deadline_s=deadline_s)
        output = self._dive(leg, state, now_s)
        output.append(self._enter(mission.initial_path[0], now_s))
        self._remember(leg)
        return output

    def _dive(self, leg: Leg, state: AuvState, now_s: float) -> list[Output]:
        """
        Send the vehicle on a leg.

        Raises
        ------
        CommandRefusedError
            The vehicle does not take it; nothing has changed.

        """
        start = self._mission.region.centre(leg.path[0])
        points = [self._mission.region.centre(cell) for cell in leg.path[1:]]
        cells: list[Cell | None] = [*leg.path[1:]]
        if state.position != start:
            # It lies between two cells: first back to the centre of P_0, which it entered before.
            points.insert(0, start)
            cells.insert(0, None)
        self._driver.follow(points)
        self._cells_ahead, self._reached = tuple(cells), 0
        self._outcome = self._report = None
        self._remember(leg)
        dived = Dived(leg_id=leg.leg_id, path=leg.path, surface_deadline_s=leg.surface_deadline_s)
        track = TrackPath(
            stamp_s=now_s, points=(state.position, *points), z_m=-self._mission.depth_m
        )
        return [Log(dived, now_s), Publish(PATH, track)]

    def _enter_cells(self, state: AuvState, now_s: float) -> list[Output]:
        if self._leg is None or state.waypoints_reached == self._reached:
            return []  # as at most ticks
        newly_reached = self._cells_ahead[self._reached : state.waypoints_reached]
        self._reached = state.waypoints_reached
        output = [self._enter(cell, now_s) for cell in newly_reached if cell is not None]
        self._remember(self._leg)
        return output

    def _enter(self, cell: Cell, now_s: float) -> Output:
        number = self._samples_taken
        value = self._field.sample(self._mission.region.centre(cell))
        self._cell = cell
        self._samples_taken += 1
        sample = Sample(auv=self.name, number=number, cell=cell, entered_s=now_s, value=value)
        self._custody.take([sample])
        return Log(CellEntered(cell=cell, sample_number=number), now_s)

    def _decide_to_surface(self, leg: Leg, state: AuvState, now_s: float) -> None:
        # Once: at another try the vehicle may be up, which would then look early.
        if self._outcome is None:
            self._outcome = self._reason_to_surface(state, now_s)
            if self._outcome is not None:
                self._remember(leg)

    def _reason_to_surface(self, state: AuvState, now_s: float) -> LegOutcome | None:
        if state.needs_help:
            return LegOutcome.ABORTED
        if self._reached == len(self._cells_ahead):
            return LegOutcome.COMPLETED
        if state.surfaced:
            return LegOutcome.EARLY
        if self._leg is not None and not is_before(now_s, self._leg.surface_deadline_s):
            return LegOutcome.DEADLINE
        return None

    def _remember(self, leg: Leg) -> None:
        """Note a leg, and how far it has come, for the process after this one."""
        self._leg = leg
        memory = _Memory(
            leg=leg,
            cells_ahead=self._cells_ahead,
            reached=self._reached,
            cell=self._cell,
            outcome=self._outcome,
            report=self._report,
            samples_taken=self._samples_taken,
            finished=self.finished,
        )
        self._store.put(_MEMORY, '', memory)

    # --- at the surface --------------------------------------------------------------------------

    def _come_up(
        self, leg: Leg, outcome: LegOutcome, state: AuvState, now_s: float
    ) -> list[Output]:
        self._report = SurfacingReport(
            auv=self.name,
            leg_id=leg.leg_id,
            outcome=outcome,
            moves_done=sum(cell is not None for cell in self._cells_ahead[: self._reached]),
            cell=self._cell,
            position=state.position,
            surfaced_s=now_s,
            samples_taken=self._samples_taken,
            samples=(),
        )
        self._remember(leg)
        return [Log(Surfaced(leg_id=leg.leg_id, outcome=outcome, cell=self._cell), now_s)]

    def _passed_on(self, receipt: SampleReceipt, now_s: float) -> list[Output]:
        """Note what the UAV holds; say what it lacks while it is there."""
        self._custody.passed_on(receipt)
        if self._report is None:
            return []
        return [Transmit(self._mission.uav, batch) for batch in self._custody.batches(now_s)]

    def _assigned(self, assignment: PathAssignment, now_s: float) -> list[Output]:
        leg = assignment.leg
        acknowledgement = Transmit(
            self._mission.uav,
            Acknowledgement(acknowledges=Acknowledged.PATH_ASSIGNMENT, reference=leg.leg_id),
        )
        if self._leg is not None and leg.leg_id <= self._leg.leg_id:
            return [acknowledgement]  # repeated by the UAV: it missed our answer
        if self._report is None or self.finished:
            return [self._unexpected('a path')]
        problem = self._problem_with(leg, now_s)
        if problem:
            return [Refuse(self._mission.uav, Refusal.CONTRADICTORY, problem)]
        state = self._driver.step(now_s)
        if state.needs_help:
            return [self._not_possible('it needs help and stays at the surface')]
        try:
            dive = self._dive(leg, state, now_s)
        except CommandRefusedError as error:
            return [self._not_possible(str(error))]
        return [acknowledgement, *dive]

    def _problem_with(self, leg: Leg, now_s: float) -> str | None:
        if not is_before(now_s, leg.surface_deadline_s):  # a late copy; a new one will come
            return (
                f'surface deadline must be later than {now_s:g} s, is {leg.surface_deadline_s:g} s'
            )
        if leg.path[0] != self._cell:
            return f'path must start at {list(self._cell)}, starts at {list(leg.path[0])}'
        return path_problem(leg.path, self._mission.region)

    def _recovered(self, order: RecoveryOrder, now_s: float) -> list[Output]:
        if self._leg is None or self._report is None or order.leg_id != self._report.leg_id:
            return [self._unexpected(f'the end of the survey after leg {order.leg_id}')]
        acknowledgement = Transmit(
            self._mission.uav,
            Acknowledgement(acknowledges=Acknowledged.RECOVERY_ORDER, reference=order.leg_id),
        )
        if self.finished:
            return [acknowledgement]  # repeated by the UAV: it missed our answer
        self.finished = True
        self._remember(self._leg)
        return [acknowledgement, Log(StayedUp(reason=order.reason), now_s)]

    def _not_possible(self, why: str) -> Refuse:
        return Refuse(self._mission.uav, Refusal.NOT_POSSIBLE, why)

    def _unexpected(self, order: str) -> Refuse:
        state = 'under way' if self._report is None else 'at the surface'
        if self.finished:
            state = 'up for recovery'
        leg = 'before its first leg' if self._leg is None else f'leg {self._leg.leg_id}'
        detail = f'{order} was ordered to an AUV that is {state}, {leg}'
        return Refuse(self._mission.uav, Refusal.UNEXPECTED, detail)
