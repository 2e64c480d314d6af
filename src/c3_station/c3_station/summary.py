"""
The figures of a mission, from its events alone.

Nothing here depends on the order in which events arrive: within one tick a bag may hold them in
any order. What belongs together is found by leg, sortie and sample numbers. Times are seconds
since the mission was started.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from hashlib import blake2b
from typing import TYPE_CHECKING

import msgspec

from auv_sim.world import WORLD
from c3_station.bag import BagFacts
from c3_station.lower_bound import lower_bound_s
from c3_station.node_params import C3
from c3_station.scenario_files import scenario_from_json
from c3_station.sortie_reach import beyond_reach
from msgs_json import codec
from msgs_json.codec import MessageError
from msgs_json.geometry import Cell, GridSpec, is_before, unreachable_cells
from msgs_json.messages import (
    CellEntered,
    ContactState,
    Directive,
    DirectiveTaken,
    Event,
    GivenUp,
    HeardAgain,
    LegOutcome,
    MessageRefused,
    Met,
    Missed,
    MissionCompleted,
    MissionResumed,
    MissionStarted,
    MissionStatus,
    MissionStopped,
    NodeRestarted,
    RadioStatus,
    RecoveryReason,
    SamplesDelivered,
    SearchBrokenOff,
    SortieDeparted,
    SortieReturned,
    StayedUp,
    Surfaced,
)
from msgs_json.ros_messages import ClockTime, RosMessage, Text
from msgs_json.topics import CLOCK, MISSION_EVENTS, MISSION_STATUS, RADIO_STATUS

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from c3_station.scenario import Limits, Scenario
    from msgs_json.agent_shell import Frame

_FIGURES_IN = (
    MISSION_STATUS.resolve(f'/{C3}'),
    RADIO_STATUS.resolve(f'/{WORLD}'),
)

_NAMES = frozenset({each.name for each in (CLOCK, MISSION_EVENTS, MISSION_STATUS, RADIO_STATUS)})

Record = tuple[str, float, RosMessage]
"""A message with its absolute topic and its time, seconds."""

SCHEMA_VERSION = 1
"""Of ``summary.json``; a change that a reader would misread raises it."""


class MeetingSummary(msgspec.Struct, frozen=True, kw_only=True):
    """The UAV met an AUV."""

    auv: str
    time_s: float
    cell: Cell
    slack_s: float | None
    """lambda, before the choice; None where no path was planned."""
    path: tuple[Cell, ...]
    """The path handed over, P_0 first; empty where the AUV stays up for recovery."""
    plan_status: str | None


class SortieSummary(msgspec.Struct, frozen=True, kw_only=True):
    """A sortie, from leaving C3 to being back."""

    index: int
    """Counted from 1."""
    departed_s: float
    returned_s: float | None
    """None where the record ends before."""
    duration_s: float | None
    worst_case_s: float
    """Of the whole route at departure, waits included."""
    predicted_s: float
    """The planner's own figure."""
    limit_s: float
    bound_ratio: float | None
    """`duration_s` over `worst_case_s`; None without a return, or where there was no way to go."""
    meetings: tuple[MeetingSummary, ...]
    missed: tuple[str, ...]
    """AUVs that were searched to the end and not heard."""
    given_up: tuple[str, ...]
    """Those of them that were taken for lost."""
    not_reached: tuple[str, ...]
    """AUVs left out when the UAV broke its search off, to be home within the limit."""


class RadioSummary(msgspec.Struct, frozen=True, kw_only=True):
    """What became of the radio messages."""

    delivered: int
    blocked: dict[str, int]
    """By reason."""


class RefusalSummary(msgspec.Struct, frozen=True, kw_only=True):
    """A node refused messages of a sender for a reason."""

    node: str
    sender: str
    reason: str
    detail: str
    """What was wrong with the first."""
    count: int
    """At least so many were refused; a node logs the first, the tenth, the hundredth and so on."""


class Summary(msgspec.Struct, frozen=True, kw_only=True):
    """What a mission came to; None where the record does not show it (any more, or yet)."""

    schema_version: int = SCHEMA_VERSION
    scenario: str | None
    planner: str | None
    seed: int | None
    software_version: str | None
    complete: bool
    """Whether C3 called the mission completed."""
    stopped: str | None
    """Why it ended before, where the world said so."""
    explored_s: float | None
    """When the last cell was entered for the first time; start cells count at t = 0."""
    delivered_s: float | None
    """When C3 had the last sample of an explored region."""
    mission_s: float | None
    """When all AUVs were up for recovery, all data at C3 and the UAV home."""
    cells_total: int | None
    cells_explored: int
    out_of_reach: tuple[Cell, ...]
    """
    Cells not entered that nobody could enter in the end, though there were AUVs left to survey.

    No such AUV had a way there, or no sortie could go there and be back within the limit.
    """
    moves_total: int
    """Cells entered after the start cells, up to `explored_s`."""
    revisits: int
    """How many of these moves led to a cell that had been entered before."""
    sorties: tuple[SortieSummary, ...]
    sortie_limit_violations: int
    """Sorties longer than their limit, one still being flown at the end included."""
    bound_ratio_max: float | None
    """The largest `bound_ratio` of a sortie; more than 1 is a worst case that was none."""
    c3_wait_s: float
    """How long the UAV waited at C3 before its sorties, from the start of the mission."""
    neglect_s: dict[str, float]
    """By AUV: surfaced and not yet met, up to `explored_s` (to the end where that is None)."""
    neglect_fraction: float | None
    """Sum of `neglect_s` over `explored_s`; may exceed 1 with many AUVs."""
    missed_total: int
    """Searches in vain."""
    searches_broken_off: int
    lost: tuple[str, ...]
    """AUVs that the UAV gave up and did not hear again."""
    heard_again: tuple[str, ...]
    """AUVs that it heard after it had given them up."""
    aborted: tuple[str, ...]
    """AUVs that asked for help."""
    samples_collected: int
    samples_delivered: int
    samples_missing: dict[str, int] | None
    """By AUV: collected and not at C3; None where the record does not show what C3 has."""
    samples_doubled: int | None
    """Samples that C3 took for new more than once; None where that is not recorded."""
    data_age_max_s: float | None
    """
    The largest age that the oldest sample not yet at C3 ever had.

    It is reached when that sample is delivered; one that never is grows old until the mission's
    end. None where nothing was sampled, or the record does not show what C3 has.
    """
    lower_bound_s: float | None
    """No planner can explore the region before. None where the operator has changed the region."""
    radio: RadioSummary | None
    refusals: tuple[RefusalSummary, ...]
    unreadable: int
    """Entries of the mission's log that could not be understood, and are in no figure."""
    restarts: dict[str, int]
    """By node: how often it died and came back."""
    wall_s: float | None
    real_time_factor: float | None

    @property
    def samples_lost(self) -> int | None:
        """
        Return how many samples of AUVs that are not lost are not at C3.

        What a lost AUV has on board is lost with it, and no fault of the mission; it is in
        `samples_missing`. None where nothing was sampled, or the record does not show what C3 has.
        """
        if self.samples_collected == 0 or self.samples_missing is None:
            return None
        return sum(
            missing for auv, missing in self.samples_missing.items() if auv not in self.lost
        )

    def to_json(self) -> bytes:
        """Return the content of ``summary.json``, with each cell in one line."""
        text = msgspec.json.format(msgspec.json.encode(self), indent=2)
        return re.sub(rb'\[\s+(\d+),\s+(\d+)\s+\]', rb'[\1, \2]', text) + b'\n'


@dataclass(frozen=True, slots=True)
class LoggedEvent:
    """An event of the mission's log, with who logged it and when it happened."""

    stamp_s: float
    source: str
    event: Event


def digest(payload: bytes) -> bytes:
    """Return what stands for a payload where many are remembered; no two have the same."""
    return blake2b(payload, digest_size=16).digest()


class Summarizer:
    """
    Gathers a mission's events while it is flown or read, and makes the summary of them.

    Cheap to feed, so that it can listen to a running mission; `summary` may be called any time.
    """

    def __init__(self) -> None:
        self.events: list[LoggedEvent] = []
        """In the order of arrival."""
        self.status: MissionStatus | None = None
        """What C3 showed last."""
        self.contacts: dict[str, list[tuple[float, ContactState | None]]] = {}
        """By AUV: each change of what C3 made of its silence, with its stamp."""
        self.delivered: list[tuple[float, float]] = []
        """Share of the region of which C3 has samples: each change, with its stamp."""
        self._log: set[bytes] = set()
        """Digests of the entries that came: a restarted node may say its last ones again."""
        self._radio: RadioStatus | None = None
        self._unreadable = 0
        self._latest_s = 0.0

    def frame(self, name: str, frame: Frame) -> None:
        """Take what a node publishes, as the in-process kernel passes it on."""
        if frame.topic.name in _NAMES:  # of most there is no need to know more
            self.message(frame.topic.resolve(f'/{name}'), frame.message)

    def message(self, topic: str, message: RosMessage) -> bool:
        """
        Take a message of an absolute topic; those that say nothing here are passed over.

        Return whether it is to be taken notice of: an entry of the log is once only.
        """
        match message:
            case ClockTime(time_s=time_s) if topic == CLOCK.name:
                self._latest_s = max(self._latest_s, time_s)
            case Text(data=data) if topic == MISSION_EVENTS.name:
                entry = digest(data)
                if entry in self._log:
                    return False
                self._log.add(entry)
                self._json(data)
            case Text(data=data) if topic in _FIGURES_IN:
                self._json(data)
        return True

    def event(self, source: str, stamp_s: float, event: Event) -> None:
        """Take an event."""
        self.events.append(LoggedEvent(stamp_s, source, event))
        self._latest_s = max(self._latest_s, stamp_s)

    def summary(self, facts: BagFacts | None = None) -> Summary:
        """Return the figures of all that was taken so far."""
        figures = _Figures(self.events, self.status, self._latest_s)
        return figures.summary(self._radio, self._unreadable, facts or BagFacts())

    def _json(self, data: bytes) -> None:
        try:
            envelope, body = codec.decode(data)
        except MessageError:
            self._unreadable += 1
            return
        match body:
            case Event():
                self.event(envelope.src, envelope.stamp, body)
            case MissionStatus():
                self._take_status(envelope.stamp, body)
            case RadioStatus():
                self._radio = body

    def _take_status(self, stamp_s: float, status: MissionStatus) -> None:
        self.status = status
        share = status.cells_delivered / status.cells_total if status.cells_total else 1.0
        if not self.delivered or self.delivered[-1][1] != share:
            self.delivered.append((stamp_s, share))
        for auv in status.auvs:
            changes = self.contacts.setdefault(auv.name, [])
            if not changes or changes[-1][1] is not auv.contact:
                changes.append((stamp_s, auv.contact))


def course(summary: Summary) -> Summary:
    """Return what a mission was like, without what it cost and what was refused in it."""
    return msgspec.structs.replace(
        summary, radio=None, refusals=(), wall_s=None, real_time_factor=None
    )


def mission_start_s(events: Sequence[LoggedEvent]) -> float:
    """Return when a mission was started; without that entry, when its log begins."""
    for each in events:
        if isinstance(each.event, MissionStarted):
            return each.stamp_s
    return min((each.stamp_s for each in events), default=0.0)


def summarize(records: Iterable[Record], facts: BagFacts | None = None) -> Summary:
    """Return the figures of a mission from its messages, in any order within a tick."""
    summarizer = Summarizer()
    for topic, _, message in records:
        summarizer.message(topic, message)
    return summarizer.summary(facts)


@dataclass(frozen=True, slots=True, kw_only=True)
class ConditionCheck:
    """A pass condition of the scenario, and whether the mission met it."""

    name: str
    value: float | None
    allowed: str
    failure: str | None
    """A sentence with figure and limit; None where the condition is met."""


def check_conditions(summary: Summary, scenario: Scenario) -> list[ConditionCheck]:
    """Return all pass conditions that limit anything; a figure without value meets none."""
    conditions: dict[str, Limits] = msgspec.structs.asdict(scenario.pass_conditions)
    return [
        _check(name, getattr(summary, name), limits)
        for name, limits in conditions.items()
        if limits.min is not None or limits.max is not None
    ]


def failed_conditions(summary: Summary, scenario: Scenario) -> list[str]:
    """Return a sentence for each pass condition that was not met; empty if all were."""
    return [
        check.failure for check in check_conditions(summary, scenario) if check.failure is not None
    ]


def c3_waits(sorties: Sequence[SortieSummary]) -> list[tuple[float, float]]:
    """
    Return when the UAV began to wait at C3 for each of its sorties, and how long it waited.

    Seconds; it is there from the start of the mission. After a return that the record does not
    hold nobody knows how long it waited.
    """
    returns_s = [0.0, *(sortie.returned_s for sortie in sorties)]
    return [
        (returned_s, sortie.departed_s - returned_s)
        for returned_s, sortie in zip(returns_s, sorties, strict=False)
        if returned_s is not None
    ]


def _check(name: str, value: float | None, limits: Limits) -> ConditionCheck:
    bounds = (('at least', limits.min), ('at most', limits.max))
    allowed = ' and '.join(f'{words} {bound:g}' for words, bound in bounds if bound is not None)
    if value is None:
        failure = f'{name} has no value, it must be {allowed}'
    elif limits.min is not None and value < limits.min:
        failure = f'{name} is {value:.6g}, less than allowed: {allowed}'
    elif limits.max is not None and value > limits.max:
        failure = f'{name} is {value:.6g}, more than allowed: {allowed}'
    else:
        failure = None
    return ConditionCheck(name=name, value=value, allowed=allowed, failure=failure)


class _Figures:
    """The events of a mission, sorted by what they are about."""

    def __init__(
        self, events: Iterable[LoggedEvent], status: MissionStatus | None, latest_s: float
    ) -> None:
        self.started: MissionStarted | None = None
        self.completed_s: float | None = None
        self.stopped: str | None = None
        self.restarts: dict[str, int] = {}
        """By node."""
        self.refusals: dict[tuple[str, str, str], RefusalSummary] = {}
        """By node, sender and reason."""
        self.entries: list[tuple[float, CellEntered]] = []
        self.numbered: set[tuple[str, int]] = set()
        """AUV and number of each sample: one that it forgot in a crash it takes again."""
        self.sampled_s: dict[str, list[float]] = {}
        """By AUV: when it took each of its samples."""
        self.surfaced_s: dict[tuple[str, int], float] = {}
        """By AUV and the leg that ended."""
        self.met: dict[tuple[str, int], tuple[float, Met]] = {}
        """The same key."""
        self.departed: dict[int, tuple[float, SortieDeparted]] = {}
        self.returned: dict[int, tuple[float, SortieReturned]] = {}
        self.missed: list[Missed] = []
        self.broken_off: dict[int, SearchBrokenOff] = {}
        self.given_up: list[tuple[float, GivenUp]] = []
        self.heard_again_s: dict[str, float] = {}
        """The last time."""
        self.aborted: set[str] = set()
        self.directive: Directive | None = None
        """The one by which the UAV flew last; None where the operator wanted nothing."""
        self.last_cell: dict[str, Cell] = {}
        """By AUV: the one that it entered last."""
        self.deliveries: list[tuple[float, SamplesDelivered]] = []
        self.at_c3 = (
            None if status is None else {auv.name: auv.samples_delivered for auv in status.auvs}
        )
        """Samples by AUV, as C3 counts them."""
        ordered = sorted(events, key=lambda logged: logged.stamp_s)
        start_s = mission_start_s(ordered)
        for each in ordered:
            self._sort(each.source, _seconds(each.stamp_s - start_s), each.event)
        self.latest_s = _seconds(latest_s - start_s)

    def _sort(self, source: str, time_s: float, event: Event) -> None:
        match event:
            case MissionStarted():
                self.started = self.started or event
            case MissionCompleted():
                self.completed_s = time_s
            case MissionResumed():
                self.stopped = None
            case NodeRestarted(node=node, restarts=restarts):
                self.restarts[node] = max(self.restarts.get(node, 0), restarts)
            case MissionStopped(reason=reason, node=node):
                self.stopped = f'{reason} ({node})' if node else reason
            case MessageRefused():
                refusal = RefusalSummary(
                    node=source,
                    sender=event.sender,
                    reason=event.reason,
                    detail=event.detail,
                    count=event.count,
                )
                first = self.refusals.setdefault((source, event.sender, event.reason), refusal)
                self.refusals[source, event.sender, event.reason] = msgspec.structs.replace(
                    first, count=max(first.count, event.count)
                )
            case CellEntered(sample_number=number) if (source, number) not in self.numbered:
                self.numbered.add((source, number))
                self.entries.append((time_s, event))
                self.sampled_s.setdefault(source, []).append(time_s)
                self.last_cell[source] = event.cell
            case Surfaced():
                self.surfaced_s[source, event.leg_id] = time_s
                if event.outcome is LegOutcome.ABORTED:
                    self.aborted.add(source)
            case StayedUp(reason=RecoveryReason.ABORTED):
                self.aborted.add(source)  # one that was up already when it asked for help
            case Met():
                self.met[event.auv, event.leg_id] = (time_s, event)
            case SortieDeparted():
                self.departed[event.sortie] = (time_s, event)
            case SortieReturned():
                self.returned[event.sortie] = (time_s, event)
            case Missed():
                self.missed.append(event)
            case SearchBrokenOff():
                self.broken_off[event.sortie] = event
            case GivenUp():
                self.given_up.append((time_s, event))
            case HeardAgain(auv=auv):
                self.heard_again_s[auv] = time_s
            case DirectiveTaken(directive=directive):
                self.directive = directive
            case SamplesDelivered():
                self.deliveries.append((time_s, event))

    def summary(self, radio: RadioStatus | None, unreadable: int, facts: BagFacts) -> Summary:
        """Return the summary."""
        scenario = scenario_from_json(self.started.scenario) if self.started else None
        first_entered_s = self._first_entered_s()
        cells = self._cells(scenario)
        explored_s = None
        if cells and cells <= first_entered_s.keys():
            explored_s = max(first_entered_s[cell] for cell in cells)
        moves = self._moves(explored_s)
        neglect_s = self._neglect_s(scenario, explored_s)
        sorties = self._sorties()
        return Summary(
            scenario=scenario.name if scenario else None,
            planner=self.started.planner if self.started else None,
            seed=self.started.seed if self.started else None,
            software_version=self.started.software_version if self.started else None,
            complete=self.completed_s is not None,
            stopped=self.stopped,
            explored_s=explored_s,
            delivered_s=self._delivered_s(scenario),
            mission_s=self.completed_s,
            cells_total=len(cells) if scenario else None,
            out_of_reach=(
                self._out_of_reach(scenario, cells - first_entered_s.keys()) if scenario else ()
            ),
            cells_explored=len(cells & first_entered_s.keys() if scenario else first_entered_s),
            moves_total=len(moves),
            revisits=len(moves) - len({move.cell for move in moves} - self._start_cells()),
            sorties=sorties,
            sortie_limit_violations=sum(self._is_over_limit(sortie) for sortie in sorties),
            bound_ratio_max=max(
                (each.bound_ratio for each in sorties if each.bound_ratio is not None),
                default=None,
            ),
            c3_wait_s=_seconds(sum(wait_s for _, wait_s in c3_waits(sorties))),
            neglect_s=neglect_s,
            neglect_fraction=sum(neglect_s.values()) / explored_s if explored_s else None,
            missed_total=len(self.missed),
            searches_broken_off=len(self.broken_off),
            lost=self._lost(),
            heard_again=tuple(sorted(self.heard_again_s)),
            aborted=tuple(sorted(self.aborted)),
            samples_collected=len(self.entries),
            samples_delivered=sum(event.samples for _, event in self.deliveries),
            samples_missing=self._samples_missing(),
            samples_doubled=self._samples_doubled(),
            data_age_max_s=self._data_age_max_s(),
            lower_bound_s=self._lower_bound_s(scenario),
            radio=(
                RadioSummary(delivered=radio.delivered, blocked=radio.blocked) if radio else None
            ),
            refusals=tuple(self.refusals.values()),
            unreadable=unreadable,
            restarts=self.restarts,
            wall_s=facts.wall_s,
            real_time_factor=facts.real_time_factor,
        )

    def _cells(self, scenario: Scenario | None) -> frozenset[Cell]:
        """Return the cells to be surveyed, without those that the operator took out."""
        return frozenset(self._region(scenario).cells if scenario else ())

    def _region(self, scenario: Scenario) -> GridSpec:
        region = scenario.region
        if self.directive is None:
            return region
        return msgspec.structs.replace(region, masked=self.directive.masked)

    def _out_of_reach(self, scenario: Scenario, left: frozenset[Cell]) -> tuple[Cell, ...]:
        """Return which of the cells that were not entered nobody could enter."""
        recalled = self.directive.recalled if self.directive else ()
        surveyors = self.last_cell.keys() - {*self._lost(), *self.aborted, *recalled}
        if not surveyors or not left:
            return ()
        limit_s = self.directive.sortie_limit_s if self.directive else scenario.sortie.limit_s
        places = [self.last_cell[auv] for auv in surveyors]
        cut_off = left.intersection(unreachable_cells(self._region(scenario), places))
        return tuple(sorted(cut_off.union(beyond_reach(scenario, limit_s, left))))

    def _lower_bound_s(self, scenario: Scenario | None) -> float | None:
        if scenario is None or len(self._cells(scenario)) != scenario.region.cells_total:
            return None
        return _seconds(lower_bound_s(scenario))

    def _first_entered_s(self) -> Mapping[Cell, float]:
        first_entered_s: dict[Cell, float] = {}
        for time_s, event in self.entries:
            first_entered_s.setdefault(event.cell, time_s)
        return first_entered_s

    def _start_cells(self) -> set[Cell]:
        return {event.cell for _, event in self.entries if event.sample_number == 0}

    def _moves(self, explored_s: float | None) -> list[CellEntered]:
        return [
            event
            for time_s, event in self.entries
            if event.sample_number > 0 and (explored_s is None or time_s <= explored_s)
        ]

    def _neglect_s(self, scenario: Scenario | None, explored_s: float | None) -> dict[str, float]:
        end_s = self.latest_s if explored_s is None else explored_s
        neglect_s = {auv.name: 0.0 for auv in scenario.auvs} if scenario else {}
        for (auv, leg_id), surfaced_s in self.surfaced_s.items():
            met_s = self.met[auv, leg_id][0] if (auv, leg_id) in self.met else math.inf
            waited_s = max(0.0, min(met_s, end_s) - surfaced_s)
            neglect_s[auv] = _seconds(neglect_s.get(auv, 0.0) + waited_s)
        return neglect_s

    def _sorties(self) -> tuple[SortieSummary, ...]:
        sorties = []
        for number, (departed_s, departed) in sorted(self.departed.items()):
            returned_s, returned = self.returned.get(number, (None, None))
            duration_s = _seconds(returned.duration_s) if returned else None
            worst_case_s = _seconds(departed.worst_case_s)
            meetings = [each for each in self.met.values() if each[1].sortie == number]
            broken_off = self.broken_off.get(number)
            sorties.append(
                SortieSummary(
                    index=number,
                    departed_s=departed_s,
                    returned_s=returned_s,
                    duration_s=duration_s,
                    worst_case_s=worst_case_s,
                    predicted_s=_seconds(departed.predicted_s),
                    limit_s=departed.limit_s,
                    bound_ratio=(
                        duration_s / worst_case_s
                        if duration_s is not None and worst_case_s > 0.0
                        else None
                    ),
                    meetings=tuple(
                        MeetingSummary(
                            auv=met.auv,
                            time_s=time_s,
                            cell=met.cell,
                            slack_s=met.slack_s,
                            path=met.path,
                            plan_status=met.plan_status,
                        )
                        for time_s, met in sorted(meetings, key=lambda each: each[0])
                    ),
                    missed=_names(each for each in self.missed if each.sortie == number),
                    given_up=_names(each for _, each in self.given_up if each.sortie == number),
                    not_reached=broken_off.not_reached if broken_off else (),
                )
            )
        return tuple(sorties)

    def _delivered_s(self, scenario: Scenario | None) -> float | None:
        # The last count: before the operator took cells out of the region it may have been higher.
        cells_delivered = self.deliveries[-1][1].cells_delivered if self.deliveries else 0
        if scenario is None or cells_delivered < len(self._cells(scenario)):
            return None
        missing = self._samples_missing()
        if missing is None or any(missing[auv] for auv in missing if auv not in self._lost()):
            return None
        return max((time_s for time_s, event in self.deliveries if event.samples), default=None)

    def _lost(self) -> tuple[str, ...]:
        # Within a tick the UAV first gives up and then listens.
        return tuple(
            sorted(
                {
                    event.auv
                    for time_s, event in self.given_up
                    if self.heard_again_s.get(event.auv, -math.inf) < time_s
                }
            )
        )

    def _undelivered_s(self, auv: str) -> list[float]:
        """Return when an AUV took the samples that C3 does not have; it has the oldest ones."""
        return self.sampled_s[auv][(self.at_c3 or {}).get(auv, 0) :]

    def _samples_missing(self) -> dict[str, int] | None:
        if self.at_c3 is None:
            return None
        return {auv: len(self._undelivered_s(auv)) for auv in sorted(self.sampled_s)}

    def _samples_doubled(self) -> int | None:
        if self.at_c3 is None:
            return None
        taken = sum(event.samples for _, event in self.deliveries)
        excess = sum(
            max(0, at_c3 - len(self.sampled_s.get(auv, ()))) for auv, at_c3 in self.at_c3.items()
        )
        return max(excess, taken - sum(self.at_c3.values()), 0)

    def _data_age_max_s(self) -> float | None:
        if self.at_c3 is None:
            return None
        end_s = self.latest_s if self.completed_s is None else self.completed_s
        ages_s = [
            event.oldest_age_s for _, event in self.deliveries if event.oldest_age_s is not None
        ]
        ages_s += [
            end_s - undelivered_s[0]
            for auv in self.sampled_s
            if (undelivered_s := self._undelivered_s(auv))
        ]
        return _seconds(max(ages_s)) if ages_s else None

    def _is_over_limit(self, sortie: SortieSummary) -> bool:
        lasted_s = sortie.duration_s
        if lasted_s is None:
            lasted_s = self.latest_s - sortie.departed_s
        return is_before(sortie.limit_s, lasted_s)


def _names(events: Iterable[Missed | GivenUp]) -> tuple[str, ...]:
    return tuple(sorted(event.auv for event in events))


def _seconds(time_s: float) -> float:
    """Return a time to the microsecond, without the noise of its arithmetic."""
    return round(time_s, 6)
