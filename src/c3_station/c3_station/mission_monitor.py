"""What a person wants to know of a running mission, kept up to date from what is published."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

from c3_station.node_params import C3
from c3_station.operator_words import AS_ORDERED, wishes, words_of
from c3_station.scenario import Scenario
from c3_station.summary import Summarizer
from msgs_json import codec
from msgs_json.codec import MessageError
from msgs_json.geometry import Cell, Point
from msgs_json.messages import (
    AuvStatus,
    CellEntered,
    CommandRefused,
    CommandTaken,
    Directive,
    DirectiveTaken,
    Dived,
    Event,
    GivenUp,
    HeardAgain,
    LegOutcome,
    MessageRefused,
    Met,
    Missed,
    MissionCompleted,
    MissionResumed,
    MissionStopped,
    NodeRestarted,
    PlanningAhead,
    RecoveryReason,
    SamplesDelivered,
    SearchBrokenOff,
    SortieDeparted,
    SortieReturned,
    StayedUp,
    StorageFailed,
    StorageRestored,
    Surfaced,
)
from msgs_json.ros_messages import ClockTime, Odometry, RosMessage, Text
from msgs_json.topics import CLOCK, MISSION_EVENTS, MISSION_STATUS

_LOG_LINES = 200


@dataclass(slots=True)
class AuvView:
    """One AUV as seen from outside."""

    position: Point
    submerged: bool = True
    path: tuple[Cell, ...] = ()
    cells_entered: int = 0
    surfaced_s: float | None = None
    """Since when it waits at the surface; None while it does not."""
    neglect_s: float = 0.0
    """Waits that are over."""
    last_met_s: float | None = None
    recovered: bool = False
    asked_for_help: bool = False
    status: AuvStatus | None = None
    """What C3 showed of it last."""

    def waiting_s(self, now_s: float) -> float:
        """Return how long it has been waiting, 0 if it does not."""
        return 0.0 if self.surfaced_s is None else now_s - self.surfaced_s


@dataclass(slots=True)
class SortieView:
    """The sortie being flown."""

    number: int
    departed_s: float
    worst_case_s: float
    limit_s: float
    order: tuple[str, ...]
    done_with: set[str] = field(default_factory=set)
    """AUVs met, or searched in vain, or not to be reached any more."""

    def target(self) -> str | None:
        """Return the AUV the UAV is after; None on the way home."""
        return next((name for name in self.order if name not in self.done_with), None)


class MissionMonitor:
    """The state of a mission, for the live view; fed in any order of sources, in order of time."""

    def __init__(self, scenario: Scenario, uav: str) -> None:
        self.scenario = scenario
        self.summarizer = Summarizer()
        self.now_s = 0.0
        self.ticking = False
        """Whether the mission has begun."""
        self.domain_id: int | None = None
        """The ROS domain of the mission's graph, for whoever wants to look at it."""
        self.uav_name = uav
        self.uav_position = scenario.c3
        self.auvs = {
            auv.name: AuvView(position=scenario.region.centre(auv.initial_path[0]))
            for auv in scenario.auvs
        }
        self.entered: set[Cell] = set()
        self.cells = frozenset(scenario.region.cells)
        """Those to be surveyed, as the UAV knows."""
        self.directive: Directive | None = None
        """What the operator wants, as C3 shows it."""
        self.directive_taken = 0
        """Revision of the one by which the UAV flies."""
        self.explored_s: float | None = None
        self.cells_delivered = 0
        self.planned_share: float | None = None
        """How much of the whole mission is planned; None while that is not being done."""
        self.sortie: SortieView | None = None
        self.sorties_flown = 0
        self.longest_sortie_s = 0.0
        self._refused: dict[tuple[str, str, str], int] = {}
        """By node, sender and reason."""
        self.ended: str | None = None
        self.log: deque[tuple[float, str, str]] = deque(maxlen=_LOG_LINES)
        """Time, source and text of what happened, newest last."""
        self.notes: list[str] = []
        """What the orchestrator did, for those who do not see the log move."""

    def message(self, topic: str, message: RosMessage) -> None:
        """Take what was published on an absolute topic; what says nothing here is passed over."""
        if not self.summarizer.message(topic, message):
            return
        match message:
            case ClockTime(time_s=time_s) if topic == CLOCK.name:
                self._clock(time_s)
            case Odometry():
                self._odometry(topic.split('/')[1], message)
            case Text() if topic == MISSION_STATUS.resolve(f'/{C3}'):
                self._status()
            case Text(data=data) if topic == MISSION_EVENTS.name:
                self._log_entry(data)

    def _clock(self, now_s: float) -> None:
        """Take the simulated time; it never goes back, and stands still for planning ahead."""
        if now_s > self.now_s:
            self.planned_share = None
        self.now_s, self.ticking = max(self.now_s, now_s), True

    def _odometry(self, name: str, odometry: Odometry) -> None:
        if name == self.uav_name:
            self.uav_position = odometry.position
        elif name in self.auvs:
            auv = self.auvs[name]
            auv.position, auv.submerged = odometry.position, odometry.z_m < 0

    def _status(self) -> None:
        """Take what C3 shows of the AUVs of this mission."""
        status = self.summarizer.status
        if status is None:
            return
        self.directive, self.directive_taken = status.directive, status.directive_taken
        for auv in status.auvs:
            if auv.name in self.auvs:
                self.auvs[auv.name].status = auv

    def _log_entry(self, data: bytes) -> None:
        try:
            envelope, event = codec.decode(data)
        except MessageError:
            return  # the summary counts it
        if not isinstance(event, Event):
            return
        subject = _subject(envelope.src, event)
        if subject is not None and subject not in self.auvs:
            return  # of somebody who is not in this mission
        self._clock(envelope.stamp)
        text = self._apply(envelope.src, envelope.stamp, event)
        if text:
            self.log.append((envelope.stamp, envelope.src, text))

    def note(self, text: str) -> None:
        """Note what the orchestrator did."""
        self.log.append((self.now_s, 'orchestrator', text))
        self.notes.append(text)

    @property
    def operator(self) -> str | None:
        """Return what the operator wants beside the order; None where nothing is to be said."""
        directive = self.directive
        if directive is None:
            return None
        is_taken = self.directive_taken == directive.revision
        wanted = wishes(directive, self.scenario)
        if is_taken:
            return None if wanted == AS_ORDERED else wanted
        return f'{wanted}; not yet taken by the UAV'

    @property
    def recalled(self) -> tuple[str, ...]:
        """Return the AUVs that the operator wants back."""
        return self.directive.recalled if self.directive is not None else ()

    @property
    def limit_s(self) -> float:
        """Return L as the operator wants it."""
        if self.directive is not None:
            return self.directive.sortie_limit_s
        return self.scenario.sortie.limit_s

    @property
    def refused(self) -> int:
        """Return how many messages nodes have refused, as far as they have said so."""
        return sum(self._refused.values())

    def neglect_s(self) -> float:
        """Return the neglect time so far, summed over the AUVs, until the region is explored."""
        return sum(self.auv_neglect_s(auv) for auv in self.auvs.values())

    def auv_neglect_s(self, auv: AuvView) -> float:
        """Return one AUV's neglect time so far, until the region is explored."""
        return auv.neglect_s + (auv.waiting_s(self.now_s) if self.explored_s is None else 0.0)

    def _apply(self, source: str, stamp_s: float, event: Event) -> str | None:
        """Update the state; return the line for the log, None where it is not worth one."""
        match event:
            case CellEntered():
                return self._cell_entered(source, stamp_s, event)
            case Dived(path=path):
                auv = self.auvs[source]
                self._relieve(auv, stamp_s)
                auv.path, auv.cells_entered = path, 0
                return None
            case Surfaced(cell=cell, outcome=outcome):
                auv = self.auvs[source]
                auv.surfaced_s = stamp_s
                auv.asked_for_help |= outcome is LegOutcome.ABORTED
                return f'surfaced at {_cell(cell)}, {outcome.value}'
            case PlanningAhead(share=share):
                self.planned_share = share
                return 'has planned the whole mission ahead' if share == 1.0 else None
            case SortieDeparted():
                self.sortie = SortieView(
                    number=event.sortie,
                    departed_s=stamp_s,
                    worst_case_s=event.worst_case_s,
                    limit_s=event.limit_s,
                    order=event.order,
                )
                return f'sortie {event.sortie} departs, worst case {event.worst_case_s:.0f} s'
            case Met():
                return self._met(stamp_s, event)
            case Missed(auv=name):
                self._done_with(name)
                return f'{name} not heard on its path'
            case SearchBrokenOff(not_reached=names):
                self._done_with(*names)
                is_aborted = self.directive is not None and self.directive.aborted
                why = 'by the abort' if is_aborted else 'to keep its limit'
                return f'turns home {why}, not reached: {", ".join(names) or "-"}'
            case GivenUp(auv=name):
                return f'{name} given up for lost, its cells go to the others'
            case HeardAgain(auv=name):
                return f'{name} heard again'
            case SortieReturned(sortie=number, duration_s=duration_s):
                self.sorties_flown, self.sortie = number, None
                self.longest_sortie_s = max(self.longest_sortie_s, duration_s)
                return f'sortie {number} is back after {duration_s:.0f} s'
            case SamplesDelivered(samples=samples, cells_delivered=cells):
                self.cells_delivered = cells
                return f'{samples} samples taken over, {cells} cells delivered'
            case StayedUp(reason=reason):
                auv = self.auvs[source]
                self._relieve(auv, stamp_s)
                auv.recovered = True
                auv.asked_for_help |= reason is RecoveryReason.ABORTED
                is_recalled = reason is RecoveryReason.RECALLED
                return 'recalled, stays up' if is_recalled else 'stays up for recovery'
            case CommandTaken(command=command):
                return f'takes from the operator: {words_of(command)}'
            case CommandRefused(command=None, problem=problem):
                return f'the UAV cannot fly so: {problem}'
            case CommandRefused(command=command, problem=problem) if command is not None:
                return f'refuses "{words_of(command)}": {problem}'
            case DirectiveTaken(directive=directive):
                self.cells = frozenset(self.scenario.region.cells) - frozenset(directive.masked)
                self._look_whether_explored(stamp_s)
                return f'flies as the operator wants: {wishes(directive, self.scenario)}'
            case StorageFailed(problem=problem):
                return f'cannot store what it learns, and is silent: {problem}'
            case StorageRestored():
                return 'stores again what it learns, and speaks'
            case MissionCompleted(lost=names):
                self.ended = 'completed' + (f' without {", ".join(names)}' if names else '')
                return f'mission {self.ended}'
            case NodeRestarted(node=node, restarts=restarts):
                return f'{node} is back, restart {restarts}'
            case MissionResumed():
                self.ended = None
                return 'mission goes on'
            case MissionStopped(reason=reason):
                self.ended = reason
                return f'mission stopped: {reason}'
            case MessageRefused(sender=sender, reason=reason, detail=detail, count=count):
                self._refused[source, sender, reason] = count
                return f'refused a message from {sender} ({count}): {reason}, {detail}'
        return None

    def _cell_entered(self, source: str, stamp_s: float, event: CellEntered) -> str | None:
        auv = self.auvs[source]
        if event.sample_number > 0:  # its start cell is no move of its path
            auv.cells_entered += 1
        auv.position = self.scenario.region.centre(event.cell)
        self.entered.add(event.cell)
        return self._look_whether_explored(stamp_s)

    def _look_whether_explored(self, stamp_s: float) -> str | None:
        """Note that all cells are entered, or not any more if the operator wants others."""
        if not self.cells <= self.entered:
            self.explored_s = None
            return None
        if self.explored_s is not None:
            return None
        for waiting in self.auvs.values():
            waiting.neglect_s += waiting.waiting_s(stamp_s)
        self.explored_s = stamp_s
        return f'region explored at {stamp_s:.0f} s'

    def _done_with(self, *names: str) -> None:
        if self.sortie is not None:
            self.sortie.done_with.update(names)

    def _relieve(self, auv: AuvView, stamp_s: float) -> None:
        """End an AUV's wait; the AUV and the UAV both tell of it, the second changes nothing."""
        if self.explored_s is None:
            auv.neglect_s += auv.waiting_s(stamp_s)
        auv.surfaced_s = None

    def _met(self, stamp_s: float, event: Met) -> str:
        auv = self.auvs[event.auv]
        self._relieve(auv, stamp_s)
        auv.last_met_s = stamp_s
        self._done_with(event.auv)
        moves = max(0, len(event.path) - 1)
        return f'met {event.auv} at {_cell(event.cell)}, ' + (
            f'path of {moves} cells to {_cell(event.path[-1])}' if moves else 'to stay up'
        )


def _subject(source: str, event: Event) -> str | None:
    """Return the AUV that an event is about; None where it is about none."""
    match event:
        case Met(auv=auv) | Missed(auv=auv) | GivenUp(auv=auv) | HeardAgain(auv=auv):
            return auv
        case CellEntered() | Dived() | Surfaced() | StayedUp():
            return source
    return None


def _cell(cell: Cell) -> str:
    return f'[{cell[0]},{cell[1]}]'
