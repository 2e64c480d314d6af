"""The UAV: flies sorties, meets AUVs, relays their data and hands over their next paths."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import msgspec

from msgs_json.agent import Log, Output, Publish, Refuse, Transmit
from msgs_json.codec import Refusal
from msgs_json.messages import (
    Acknowledged,
    Acknowledgement,
    Directive,
    DirectiveTaken,
    Message,
    MissionOrder,
    PlanningAhead,
    SampleBatch,
    SampleReceipt,
    SurfacingReport,
)
from msgs_json.topics import ODOM
from uav_planner.deliveries import Deliveries
from uav_planner.directives import StandingDirective, flyable
from uav_planner.entries import Entries, Entry, save_changed
from uav_planner.fleet import Fleet
from uav_planner.flight import Flight
from uav_planner.meetings import Meetings
from uav_planner.mission_order import UavSetup, mission_spec, problem_with_order

if TYPE_CHECKING:
    from collections.abc import Iterator

    from msgs_json.custody import SampleCustody
    from msgs_json.drivers import UavDriver
    from msgs_json.store import Store
    from uav_planner.planning import Planner

_ORDER, _AGENDA = 'order', 'agenda'
"""Kinds of entries of the store, one of each."""


class _Agenda(msgspec.Struct, frozen=True, kw_only=True):
    """What is still to be done beside flying."""

    plans_ahead_from_s: float | None = None
    finished: bool = False


class UavAgent:
    """
    Sans-I/O behaviour of the UAV; its vehicle is behind ``driver``.

    What it finds in ``store`` is of a process that died: it goes on from there, wherever it is.
    """

    def __init__(
        self,
        name: str,
        setup: UavSetup,
        planner: Planner,
        driver: UavDriver,
        store: Store,
        custody: SampleCustody,
    ) -> None:
        self.name = name
        self.peers = frozenset({setup.c3})
        self.finished = False
        self.is_busy = False
        self._setup = setup
        self._planner = planner
        self._store = store
        self._custody = custody
        self._fleet: Fleet | None = None
        """None before the order, like the meetings."""
        self._meetings: Meetings | None = None
        self._directive = StandingDirective()
        self._deliveries = Deliveries(setup.c3, store, custody)
        self._flight = Flight(
            setup,
            driver,
            self._directive,
            self._deliveries,
            guarantees_limit=planner.guarantees_limit,
        )
        self._agenda = Entry(_AGENDA, _Agenda())
        self._kept: tuple[Entry[Any] | Entries[Any], ...] = ()
        """What is to be saved once it has changed."""
        self._look_ahead: Iterator[float] = iter(())
        """Plans the whole mission before the first sortie."""
        self._plans_ahead_from_s: float | None = None
        """When it got the order for that; None once it is done, or there is no time for it."""
        self._untold: list[Output] = []
        """
        What was decided and not said: the vehicle may fail between the two.

        It need not outlive the process: the next input stores what was decided, and tells it.
        """
        self._recall()

    def tick(self, now_s: float) -> list[Output]:
        """Decide on what was heard until the tick before, fly to ``now_s``, report at C3."""
        output = self._tick(now_s)
        self._remember()
        return output

    def receive(self, src: str, message: Message, now_s: float) -> list[Output]:
        """Take an order, a report or samples of an AUV, an acknowledgement or a receipt."""
        self._look(now_s)
        # What is decided is stored with this input, so this input must tell it.
        output = [*self._tell(), *self._receive(src, message)]
        self._remember()
        return output

    def work(self, now_s: float) -> list[Output]:
        """Plan the whole mission ahead, one slice further; that ends with the first departure."""
        output = self._work(now_s)
        if not self.is_busy:
            self._remember()  # not after each slice: another process would begin anew
        return output

    # --- what outlives the process ---------------------------------------------------------------

    def _remember(self) -> None:
        """Store what has changed."""
        if self._fleet is None:
            return
        self._agenda.value = _Agenda(
            plans_ahead_from_s=self._plans_ahead_from_s, finished=self.finished
        )
        save_changed(self._store, self._kept)
        self._fleet.save_map(self._store)
        if self._store.is_changed:
            self._flight.save_time(self._store)

    def _recall(self) -> None:
        """Go on where a process before this one left off."""
        order = self._store.load(_ORDER, MissionOrder).get('')
        if order is None:
            return
        fleet = Fleet(order, mission_spec(order, self._setup), self._planner)
        self._directive.load(self._store)
        if self._directive.taken is not None:
            fleet.direct(self._directive.taken.directive)
        fleet.load(self._store)
        self._flight.load(self._store, fleet)
        self._agenda.load(self._store, _Agenda)
        self.finished = self._agenda.value.finished
        self._know(fleet)
        if self._agenda.value.plans_ahead_from_s is not None:
            self._plan_ahead(fleet, self._agenda.value.plans_ahead_from_s)

    def _know(self, fleet: Fleet) -> None:
        """Deal with the AUVs of the order."""
        self._fleet = fleet
        self._meetings = Meetings(
            fleet,
            self._flight,
            self._directive,
            self._store,
            self._custody,
            guarantees_limit=self._planner.guarantees_limit,
        )
        self._kept = (
            *fleet.kept,
            *self._meetings.kept,
            *self._directive.kept,
            *self._flight.kept,
            self._agenda,
        )
        self.peers = frozenset({self._setup.c3, *fleet.names})

    def _look(self, at_s: float) -> None:
        """Learn where the vehicle is, if a process before this one has sent it somewhere."""
        if self._fleet is not None:
            self._flight.look(at_s)

    # --- a tick ----------------------------------------------------------------------------------

    def _tick(self, now_s: float) -> list[Output]:
        # The process before this one may have lived to see this tick, and heard of what it is to
        # decide on at the next one only.
        is_seen = self._flight.now_s >= now_s
        self._look(now_s if is_seen else now_s - self._setup.tick_s)
        target = None
        if not is_seen:
            self._untold += self._flight.decide()
            self._stop_planning_ahead()
            target = self._flight.steer()
        state = self._flight.fly(now_s, target)
        output = self._tell()
        if self._meetings is not None and not is_seen:
            output += self._meetings.answer_owed()
        output.append(Publish(ODOM, state.odometry(self.name, now_s)))
        return [*output, *self._flight.land(), *self._report_to_c3()]

    def _tell(self) -> list[Output]:
        untold, self._untold = self._untold, []
        return untold

    def _receive(self, src: str, message: Message) -> list[Output]:
        c3, fleet, meetings = self._setup.c3, self._fleet, self._meetings
        if src == c3:
            match message:
                case MissionOrder():
                    return self._ordered(message)
                case Directive() if fleet is not None:
                    return self._directed(message, fleet)
                case SampleReceipt():
                    self._custody.passed_on(message)
                    return self._relieved()
                case Acknowledgement():
                    return self._acknowledged(message)
        elif fleet is not None and meetings is not None and src in fleet.names:
            match message:
                case SurfacingReport() if src == message.auv:
                    output = meetings.hear(message)
                    self._stop_planning_ahead()
                    return output
                case SampleBatch():
                    return meetings.take_samples(src, message)
                case Acknowledgement():
                    fleet.acknowledged(src, message)
                    return []
        detail = f'the UAV takes no {type(message).__name__} from {src}'
        return [Refuse(src, Refusal.UNEXPECTED, detail)]

    # --- the order -------------------------------------------------------------------------------

    def _ordered(self, order: MissionOrder) -> list[Output]:
        c3 = self._setup.c3
        acknowledgement = Transmit(
            c3, Acknowledgement(acknowledges=Acknowledged.MISSION_ORDER, reference=0)
        )
        if self._fleet is not None:
            return [acknowledgement]  # repeated by C3: it missed our answer
        problem = problem_with_order(order, self._setup)
        if problem:
            return [Refuse(c3, Refusal.CONTRADICTORY, problem)]
        fleet = Fleet(order, mission_spec(order, self._setup), self._planner)
        try:
            self._flight.plan(fleet)
        except ValueError as error:
            return [Refuse(c3, Refusal.NOT_POSSIBLE, str(error))]
        self._know(fleet)
        self._store.put(_ORDER, '', order)
        self._plan_ahead(fleet, self._flight.now_s)
        return [acknowledgement]

    # --- planning ahead --------------------------------------------------------------------------

    def _plan_ahead(self, fleet: Fleet, from_s: float) -> None:
        """Begin to plan the whole mission."""
        self._look_ahead, self.is_busy = fleet.look_ahead(from_s), True
        self._plans_ahead_from_s = from_s

    def _stop_planning_ahead(self) -> None:
        """Forget it after the first departure: the visiting order stays from then on."""
        if self._plans_ahead_from_s is not None and self._flight.has_departed:
            self._look_ahead, self.is_busy = iter(()), False
            self._plans_ahead_from_s = None

    def _work(self, now_s: float) -> list[Output]:
        share = next(self._look_ahead, None)
        self.is_busy = share is not None
        if share is None:
            self._plans_ahead_from_s = None
            return []
        sortie = self._flight.sortie
        if sortie is not None and sortie.order != sortie.fleet.visiting_order:
            self._flight.plan_anew(sortie)
        return [Log(PlanningAhead(share=round(share, 2)), now_s)]

    # --- what the operator wants -----------------------------------------------------------------

    def _directed(self, directive: Directive, fleet: Fleet) -> list[Output]:
        """Fly by a directive from now on; C3 repeats it until it is told what became of it."""
        c3, flight, before = self._setup.c3, self._flight, self._directive.taken
        if before is not None and directive.revision <= before.directive.revision:
            is_late = directive.revision < before.directive.revision
            return [] if is_late else [Transmit(c3, before.answer)]
        if not flight.is_on_ground:
            return self._call_home() if directive.aborted else []
        sortie = flight.sortie
        taken = flyable(
            directive,
            fleet,
            sortie.route if sortie is not None else None,
            flight.now_s,
            guarantees_limit=self._planner.guarantees_limit,
        )
        self._directive.take(taken)
        fleet.direct(taken.directive)
        if sortie is not None:
            flight.plan_anew(sortie)
        if self._plans_ahead_from_s is not None:
            self._plan_ahead(fleet, flight.now_s)
        return [
            Transmit(c3, taken.answer),
            Log(DirectiveTaken(directive=taken.directive), flight.now_s),
        ]

    def _call_home(self) -> list[Output]:
        """Take an abort in the air; all else that a directive says has time until the landing."""
        if self._directive.is_called_home:
            return []
        self._directive.call_home()
        return self._flight.turn_home()

    # --- what C3 is told -------------------------------------------------------------------------

    def _report_to_c3(self) -> list[Output]:
        """Say what C3 lacks while it may hear; samples only on the ground."""
        flight = self._flight
        if self._fleet is None or not flight.reaches_c3(self._fleet.mission):
            return []
        return self._deliveries.say(flight.now_s, with_samples=flight.is_on_ground)

    def _acknowledged(self, message: Acknowledgement) -> list[Output]:
        """Note that C3 has a report; say the next one."""
        if message.acknowledges is not Acknowledged.SORTIE_REPORT:
            return []
        return self._relieved() if self._deliveries.acknowledged(message.reference) else []

    def _relieved(self) -> list[Output]:
        """Note whether nothing is left to do; say what C3 lacks."""
        if self._fleet is not None and self._flight.sortie is None and self._deliveries.is_done:
            self.finished = True
        return self._report_to_c3()
