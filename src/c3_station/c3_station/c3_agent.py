"""The station: gives the order, takes custody of the data, shows where the mission stands."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import msgspec

from c3_station.mission_views import diagnostics, occupancy, survey_markers
from c3_station.operator_desk import OPERATOR, DeskMemory, OperatorDesk
from c3_station.scenario import Scenario
from c3_station.scheduled_commands import operator_command
from c3_station.software import software_version
from msgs_json.agent import Log, Output, Publish, Refuse, Transmit
from msgs_json.codec import Refusal
from msgs_json.custody import SAMPLE, sample_key, sample_spans
from msgs_json.geometry import Cell, is_before, path_length_m, surface_deadline_s
from msgs_json.messages import (
    Acknowledged,
    Acknowledgement,
    AuvOrder,
    AuvStatus,
    CommandRefused,
    CommandTaken,
    ContactState,
    DirectiveRefused,
    Leg,
    LegOutcome,
    Message,
    MissionCompleted,
    MissionOrder,
    MissionStarted,
    MissionState,
    MissionStatus,
    OperatorCommand,
    Sample,
    SampleBatch,
    SampleReceipt,
    SamplesDelivered,
    SampleSpan,
    SortieReport,
)
from msgs_json.number_set import NumberSet
from msgs_json.topics import DIAGNOSTICS, EXPLORATION_MAP, MARKERS, MISSION_STATUS

if TYPE_CHECKING:
    from collections.abc import Iterable

    from msgs_json.store import Store

_ORDER, _PROGRESS, _AUV, _DESK = 'order', 'progress', 'auv', 'desk'
"""Kinds of entries of the store, beside the samples; each is put when it changes."""


@dataclass(slots=True)
class _Auv:
    """What C3 knows of an AUV."""

    leg: Leg | None
    """None once it stays up for recovery."""
    last_leg_id: int = 0
    last_met_s: float | None = None
    next_contact_s: float | None = None
    """As the UAV said when it was last here."""
    searches_in_vain: int = 0
    """Since it was last met."""
    lost: bool = False
    asked_for_help: bool = False

    @property
    def is_out(self) -> bool:
        """Return whether the UAV must still meet it before the mission can end."""
        return self.leg is not None and not self.lost

    def contact(self, now_s: float) -> ContactState | None:
        """
        Return what its silence means at a time; None once it stays up for recovery.

        C3 knows what the UAV told it when it was last here. Until it is back only time goes on:
        an AUV may be met long before C3 hears that it is no longer due.
        """
        if self.leg is None:
            return None
        if self.lost:
            return ContactState.LOST
        if self.searches_in_vain:
            return ContactState.OVERDUE
        if is_before(now_s, self.leg.surface_deadline_s):
            return ContactState.EXPECTED_SILENT
        return ContactState.DUE


class _Progress(msgspec.Struct, frozen=True, kw_only=True):
    """How far the mission is."""

    order_acknowledged: bool = False
    sorties: int = 0
    awaited: tuple[SampleSpan, ...] = ()
    no_next_sortie: bool = False
    scheduled_done: int = 0
    finished: bool = False


class C3Agent:
    """
    Sans-I/O behaviour of the station; it stays where it is.

    What it finds in ``store`` is of a process that died: it goes on from there. The survey itself
    is only there: here is what must be known to tell which samples are new, and for the map.
    """

    def __init__(
        self, name: str, scenario: Scenario, uav: str, status_period_s: float, store: Store
    ) -> None:
        self.name = name
        self.peers = frozenset({uav, OPERATOR})
        self._scenario = scenario
        self._uav = uav
        self._status_period_s = status_period_s
        self._store = store
        progress = store.load(_PROGRESS, _Progress).get('', _Progress())
        self.finished = progress.finished
        self._order = store.load(_ORDER, MissionOrder).get('')
        self._order_acknowledged = progress.order_acknowledged
        auvs = store.load(_AUV, _Auv)
        self._auvs = {auv.name: auvs[auv.name] for auv in self._order.auvs} if self._order else {}
        self._sorties = progress.sorties
        self._awaited = progress.awaited
        """The samples that the UAV said it brings."""
        self._no_next_sortie = progress.no_next_sortie
        """Whether the UAV said that it will fly no more."""
        self._numbers: dict[str, NumberSet] = {}
        """By AUV, the samples that are here: each once, whatever is repeated."""
        self._cells: dict[Cell, Sample] = {}
        """The newest sample of each cell."""
        for sample in store.load(SAMPLE, Sample).values():
            self._note(sample)
        self._desk = OperatorDesk(scenario, store.load(_DESK, DeskMemory).get(''))
        self._scheduled_done = progress.scheduled_done
        """How many of the scenario's commands were given."""
        self._survey_shown = False
        """Not by this process: what was latched went with the one before."""
        self._shown_s = -math.inf
        self._shown_contacts: tuple[ContactState | None, ...] = ()

    def tick(self, now_s: float) -> list[Output]:
        """Repeat the order until the UAV has it; show the status when it changes, or is old."""
        output: list[Output] = []
        if self._order is None:
            self._order = mission_order(self._scenario, now_s)
            self._auvs = {auv.name: _Auv(leg=auv.leg) for auv in self._order.auvs}
            self._store.put(_ORDER, '', self._order)
            self._remember_auvs()
            output.append(Log(self._started(), now_s))
        if not self._survey_shown:
            output += self._show_survey(now_s)
        output += self._scheduled(now_s)
        if not self._order_acknowledged:
            output.append(Transmit(self._uav, self._order))
        elif not self._desk.is_settled:
            output.append(Transmit(self._uav, self._desk.wanted))
        is_old = now_s - self._shown_s >= self._status_period_s
        if is_old or self._contacts(now_s) != self._shown_contacts:
            output += self._show_status(now_s)
        return output

    def receive(self, src: str, message: Message, now_s: float) -> list[Output]:
        """Take what the UAV says and brings, and commands of the operator."""
        if self._order is None:
            return [Refuse(src, Refusal.UNEXPECTED, 'C3 has not begun its mission')]
        if src == OPERATOR or isinstance(message, OperatorCommand):
            if src != OPERATOR or not isinstance(message, OperatorCommand):
                return [Refuse(src, Refusal.UNEXPECTED, 'commands come from the operator only')]
            return self._commanded(message, now_s)
        match message:
            case Acknowledgement(acknowledges=Acknowledged.MISSION_ORDER):
                if self._order_acknowledged:
                    return []
                self._order_acknowledged = True
                self._remember_progress()
                return self._show_status(now_s)
            case Acknowledgement(acknowledges=Acknowledged.DIRECTIVE, reference=revision):
                self._desk.acknowledged(revision)
                self._remember_desk()
                return self._show_status(now_s)
            case DirectiveRefused():
                return self._directive_refused(message, now_s)
            case SortieReport():
                return self._take_report(message, now_s)
            case SampleBatch():
                return self._take_over(message, now_s)
            case _:
                detail = f'C3 takes no {type(message).__name__}'
                return [Refuse(src, Refusal.UNEXPECTED, detail)]

    def _started(self) -> MissionStarted:
        return MissionStarted(
            scenario=msgspec.Raw(msgspec.json.encode(self._scenario)),
            planner=self._scenario.planner.name,
            seed=self._scenario.seed,
            software_version=software_version(),
        )

    def _remember_progress(self) -> None:
        progress = _Progress(
            order_acknowledged=self._order_acknowledged,
            sorties=self._sorties,
            awaited=self._awaited,
            no_next_sortie=self._no_next_sortie,
            scheduled_done=self._scheduled_done,
            finished=self.finished,
        )
        self._store.put(_PROGRESS, '', progress)

    def _remember_auvs(self) -> None:
        for name, auv in self._auvs.items():
            self._store.put(_AUV, name, auv)

    def _remember_desk(self) -> None:
        self._store.put(_DESK, '', self._desk.memory())

    # --- what the operator wants -----------------------------------------------------------------

    def _commanded(self, command: OperatorCommand, now_s: float) -> list[Output]:
        problem = self._desk.take(command, self._cells.keys())
        if problem:
            return [Log(CommandRefused(command=command, problem=problem), now_s)]
        self._remember_desk()
        taken = CommandTaken(command=command, revision=self._desk.wanted.revision)
        return [Log(taken, now_s), *self._show_status(now_s)]

    def _directive_refused(self, refusal: DirectiveRefused, now_s: float) -> list[Output]:
        if not self._desk.refused(refusal):
            return []  # a late copy
        self._remember_desk()
        refused = CommandRefused(command=None, problem=refusal.problem)
        return [Log(refused, now_s), *self._show_status(now_s)]

    def _scheduled(self, now_s: float) -> list[Output]:
        """Give the commands of the scenario whose time has come."""
        output: list[Output] = []
        for scheduled in self._scenario.operator[self._scheduled_done :]:
            if is_before(now_s, scheduled.at_s):
                break
            self._scheduled_done += 1
            output += self._commanded(operator_command(scheduled.command), now_s)
            self._remember_progress()
        return output

    # --- what the UAV brings ---------------------------------------------------------------------

    def _take_report(self, report: SortieReport, now_s: float) -> list[Output]:
        acknowledgement = Transmit(
            self._uav,
            Acknowledgement(acknowledges=Acknowledged.SORTIE_REPORT, reference=report.sortie),
        )
        if report.sortie <= self._sorties:
            return [acknowledgement]  # repeated by the UAV: it missed our answer
        problem = self._problem_with(report)
        if problem:
            return [Refuse(self._uav, Refusal.CONTRADICTORY, problem)]
        self._sorties = report.sortie
        self._awaited = report.cargo
        self._no_next_sortie = report.next_sortie is None
        self._note_contacts(report)
        self._remember_progress()
        self._remember_auvs()
        output = [acknowledgement, *self._look_for_end(now_s)]
        return output + self._show_status(now_s)

    def _take_over(self, batch: SampleBatch, now_s: float) -> list[Output]:
        for sample in batch.samples:
            problem = self._problem_with_sample(sample)
            if problem:
                return [Refuse(self._uav, Refusal.CONTRADICTORY, problem)]
        new = []
        for sample in batch.samples:
            if not self._has(sample):
                new.append(sample)
                self._note(sample)
                self._store.put(SAMPLE, sample_key(sample.auv, sample.number), sample)
        auvs = dict.fromkeys(sample.auv for sample in batch.samples)
        output: list[Output] = [Transmit(self._uav, self._receipt(auvs))]
        if not new:
            return output  # repeated by the UAV: it missed our answer
        delivered = SamplesDelivered(
            samples=len(new),
            cells_delivered=self._cells_delivered,
            oldest_age_s=_oldest_age_s(new, now_s),
        )
        output += [Log(delivered, now_s), *self._look_for_end(now_s)]
        return output + self._show_survey(now_s) + self._show_status(now_s)

    def _look_for_end(self, now_s: float) -> list[Output]:
        """End the mission if nobody is out any more, and all that the UAV brings is here."""
        # A UAV that plans no further sortie while an AUV is out contradicts itself. Its data is
        # taken all the same, but the mission is not over: people see who is out, and a later
        # report may still bring it.
        is_out = any(auv.is_out for auv in self._auvs.values())
        if self.finished or is_out or not self._no_next_sortie or not self._has_all_awaited:
            return []
        self.finished = True
        self._remember_progress()
        completed = MissionCompleted(
            cells_delivered=self._cells_delivered,
            samples_delivered=self._samples_delivered,
            lost=tuple(
                name for name, auv in self._auvs.items() if auv.contact(now_s) is ContactState.LOST
            ),
        )
        return [Log(completed, now_s)]

    @property
    def _has_all_awaited(self) -> bool:
        return all(
            number in self._numbers.get(span.auv, ())
            for span in self._awaited
            for number in range(span.first, span.until)
        )

    @property
    def _samples_delivered(self) -> int:
        return sum(map(len, self._numbers.values()))

    def _has(self, sample: Sample) -> bool:
        return sample.number in self._numbers.get(sample.auv, ())

    def _note(self, sample: Sample) -> None:
        self._numbers.setdefault(sample.auv, NumberSet()).add(sample.number, sample.number + 1)
        before = self._cells.get(sample.cell)
        if before is None or _age_order(before) < _age_order(sample):
            self._cells[sample.cell] = sample

    def _receipt(self, auvs: Iterable[str]) -> SampleReceipt:
        return SampleReceipt(
            held=(),
            at_c3=tuple(span for auv in auvs for span in sample_spans(auv, self._numbers[auv])),
        )

    def _note_contacts(self, report: SortieReport) -> None:
        """Note who was met, who was searched in vain, who is lost, and who is next."""
        for meeting in report.meetings:
            auv = self._auvs[meeting.auv]
            auv.leg, auv.last_met_s = meeting.next_leg, meeting.time_s
            auv.searches_in_vain = 0
            auv.asked_for_help = meeting.outcome is LegOutcome.ABORTED
            if meeting.next_leg is not None:
                auv.last_leg_id = meeting.next_leg.leg_id
        for name in report.missed:
            self._auvs[name].searches_in_vain += 1
        contacts = report.next_sortie.contacts if report.next_sortie else ()
        next_contact_s = {contact.auv: contact.time_s for contact in contacts}
        for name, auv in self._auvs.items():
            auv.lost = name in report.lost
            auv.next_contact_s = next_contact_s.get(name)

    def _problem_with(self, report: SortieReport) -> str | None:
        """Return what contradicts the mission, or None."""
        if report.sortie != self._sorties + 1:  # a gap would lose meetings and samples
            return f'sortie must be {self._sorties + 1}, is {report.sortie}'
        contacts = report.next_sortie.contacts if report.next_sortie else ()
        named = {*report.missed, *report.not_reached, *report.lost}
        named |= {meeting.auv for meeting in report.meetings}
        named |= {span.auv for span in report.cargo} | {each.auv for each in contacts}
        unknown = named - self._auvs.keys()
        if unknown:
            return f'it names {", ".join(sorted(unknown))}, not in this mission'
        return None

    def _problem_with_sample(self, sample: Sample) -> str | None:
        if sample.auv not in self._auvs:
            return f'a sample is of {sample.auv}, not in this mission'
        problem = self._scenario.region.problem_with(sample.cell)
        return f'sample {sample.number} of {sample.auv}: {problem}' if problem else None

    # --- what people see -------------------------------------------------------------------------

    def _show_survey(self, now_s: float) -> list[Output]:
        self._survey_shown = True
        region = self._scenario.region
        cells = {cell: sample.value for cell, sample in self._cells.items()}
        return [
            Publish(EXPLORATION_MAP, occupancy(region, cells, now_s)),
            Publish(MARKERS, survey_markers(region, self._scenario.c3, cells, now_s)),
        ]

    def _show_status(self, now_s: float) -> list[Output]:
        self._shown_s, self._shown_contacts = now_s, self._contacts(now_s)
        status = self._status(now_s)
        asked_for_help = [name for name, auv in self._auvs.items() if auv.asked_for_help]
        return [
            Publish(MISSION_STATUS, status),
            Publish(DIAGNOSTICS, diagnostics(status, asked_for_help, now_s)),
        ]

    def _contacts(self, now_s: float) -> tuple[ContactState | None, ...]:
        return tuple(auv.contact(now_s) for auv in self._auvs.values())

    def _status(self, now_s: float) -> MissionStatus:
        return MissionStatus(
            mission_id=self._scenario.name,
            state=self._state(),
            sorties=self._sorties,
            cells_total=self._cells_total,
            cells_delivered=self._cells_delivered,
            samples_delivered=self._samples_delivered,
            directive=self._desk.wanted,
            directive_taken=self._desk.taken.revision,
            auvs=tuple(
                AuvStatus(
                    name=name,
                    leg_id=auv.last_leg_id,
                    predicted_cells=auv.leg.path if auv.leg else (),
                    surface_deadline_s=auv.leg.surface_deadline_s if auv.leg else None,
                    contact=auv.contact(now_s),
                    next_contact_s=auv.next_contact_s,
                    searches_in_vain=auv.searches_in_vain,
                    last_met_s=auv.last_met_s,
                    samples_delivered=len(self._numbers.get(name, ())),
                )
                for name, auv in self._auvs.items()
            ),
        )

    @property
    def _cells_total(self) -> int:
        return self._scenario.region.cells_total - len(self._desk.taken_out)

    @property
    def _cells_delivered(self) -> int:
        return len(self._cells.keys() - self._desk.taken_out)

    def _state(self) -> MissionState:
        if self.finished:
            return MissionState.COMPLETED
        if self._desk.wanted.aborted:
            return MissionState.ABORTED
        if self._desk.wanted.paused:
            return MissionState.PAUSED
        if not self._order_acknowledged:
            return MissionState.STARTING
        is_delivered = self._cells_total == self._cells_delivered
        if is_delivered or self._desk.is_all_recalled:
            return MissionState.RECOVERING
        return MissionState.SURVEYING


def _age_order(sample: Sample) -> tuple[float, str, int]:
    """Return what puts samples in order of age, the same one in whatever order they came."""
    return sample.entered_s, sample.auv, sample.number


def _oldest_age_s(samples: list[Sample], now_s: float) -> float | None:
    """Return how long ago the oldest sample was taken; None where there is none."""
    if not samples:
        return None
    # At sea an AUV's clock may be a little ahead of C3's.
    return max(0.0, now_s - min(sample.entered_s for sample in samples))


def mission_order(scenario: Scenario, now_s: float) -> MissionOrder:
    """Return the order with which C3 begins a mission."""

    def initial_leg(path: tuple[Cell, ...], speed_mps: float) -> Leg:
        deadline_s = surface_deadline_s(
            now_s,
            path_length_m([scenario.region.centre(cell) for cell in path]),
            speed_mps,
            scenario.sortie.surface_margin_s,
            scenario.tick_s,
        )
        return Leg(leg_id=0, path=path, surface_deadline_s=deadline_s)

    return MissionOrder(
        mission_id=scenario.name,
        region=scenario.region,
        c3=scenario.c3,
        radio_range_m=scenario.radio.range_m,
        sortie_limit_s=scenario.sortie.limit_s,
        path_cells=scenario.planner.path_cells,
        min_path_cells=scenario.planner.min_path_cells,
        surface_margin_s=scenario.sortie.surface_margin_s,
        handover_s=scenario.sortie.handover_s,
        lost_after_sorties=scenario.sortie.lost_after_sorties,
        auvs=tuple(
            AuvOrder(
                name=auv.name,
                speed_mps=auv.speed_mps,
                leg=initial_leg(auv.initial_path, auv.speed_mps),
            )
            for auv in scenario.auvs
        ),
    )
