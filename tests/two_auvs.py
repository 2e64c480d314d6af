"""Small missions of two AUVs that come up where they like, and what came of them."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

from msgspec.structs import replace

from c3_station.scenario import Auv, PlannerChoice, Radio, Scenario, Sortie, Uav
from msgs_json import codec
from msgs_json.geometry import Cell, GridSpec, Point
from msgs_json.messages import (
    CellEntered,
    Event,
    MissionCompleted,
    MissionState,
    MissionStatus,
    SampleBatch,
    SamplesDelivered,
    SortieDeparted,
    SortieReturned,
)
from msgs_json.ros_messages import Text
from msgs_json.topics import MISSION_EVENTS, MISSION_STATUS, RADIO_RX
from uav_planner.planners import make_planner

if TYPE_CHECKING:
    from msgs_json.agent_shell import Frame

EventT = TypeVar('EventT', bound=Event)

LIMIT_S = {'ecc2009': 60.0, 'robust': 30.0, 'adaptive': 30.0}
"""Of a sortie, by planner."""
OPTIONS = {'adaptive': {'effort': 'minimal'}}

IDEAL = Radio(range_m=12.0)


def poor_radio(loss: float) -> Radio:
    """Return one whose frames hold one sample each; longer messages go in fragments."""
    return Radio(range_m=12.0, loss=loss, max_message_bytes=720)


def two_auvs(planner: str, **changes: object) -> Scenario:
    """Return the mission, with some of its sections changed."""
    surfacing = {'model': 'early', 'probability': 0.3}
    mission = Scenario(
        name='two_auvs',
        description='two AUVs that come up where they like',
        region=GridSpec(cols=4, rows=4, cell_m=10.0),
        c3=Point(east_m=20.0, north_m=-30.0),
        uav=Uav(speed_mps=5.0),
        auvs=(
            Auv(name='auv_1', initial_path=((0, 0), (1, 0)), surfacing=surfacing),
            Auv(name='auv_2', initial_path=((3, 3), (2, 3)), surfacing=surfacing),
        ),
        radio=IDEAL,
        # None is given up: where much is lost it may not be heard for many a sortie.
        sortie=Sortie(limit_s=LIMIT_S[planner], lost_after_sorties=1000),
        planner=PlannerChoice(name=planner, path_cells=3, options=OPTIONS.get(planner, {})),
        max_mission_s=5000.0,
    )
    return replace(mission, **changes)


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """An entry of an agent's log."""

    agent: str
    stamp_s: float
    body: bytes
    """The event as it was said."""
    event: Event


class Diary:
    """
    What comes of a mission, and whether that is what was promised.

    Of what a mission promises it checks on the way that no log entry changes when it is said
    again, that each sample has a number of its own, and that a planner which guarantees the limit
    keeps that by which a sortie departed.
    """

    def __init__(self, mission: Scenario) -> None:
        choice = mission.planner
        self._keeps_limit = make_planner(choice.name, **choice.options).guarantees_limit
        self._said: dict[tuple[str, int], Entry] = {}
        self.log: list[Entry] = []
        self.frames: Counter[str] = Counter()
        """How many there were, by topic."""
        self.entered: dict[tuple[str, int], Cell] = {}
        """Where each sample was taken, by AUV and number."""
        self.brought: dict[tuple[str, int], Cell] = {}
        """What C3 heard of that."""
        self.status: MissionStatus | None = None
        self.sortie: SortieDeparted | None = None
        """The one under way."""

    def __call__(self, name: str, frame: Frame) -> None:
        """Take what somebody puts out, or hears."""
        self.frames[frame.topic.name] += 1
        if frame.topic not in (MISSION_EVENTS, MISSION_STATUS, RADIO_RX):
            return
        assert isinstance(frame.message, Text)
        envelope, body = codec.decode(frame.message.data)
        match body:
            case MissionStatus():
                self.status = body
            case SampleBatch() if name == 'c3':
                self.brought |= {(each.auv, each.number): each.cell for each in body.samples}
            case Event():
                entry = Entry(
                    agent=name, stamp_s=envelope.stamp, body=bytes(envelope.body), event=body
                )
                # A new process says the last entries again: it cannot know whether they were said.
                if self._said.setdefault((name, envelope.seq), entry) is entry:
                    self.log.append(entry)
                    self._event(name, body)
                assert self._said[name, envelope.seq] == entry

    def _event(self, agent: str, event: Event) -> None:
        match event:
            case CellEntered(cell=cell, sample_number=number):
                assert (agent, number) not in self.entered
                self.entered[agent, number] = cell
            case SortieDeparted():
                self.sortie = event
            case SortieReturned(duration_s=duration_s):
                assert self.sortie is not None
                assert duration_s <= self.sortie.limit_s or not self._keeps_limit
                self.sortie = None

    def entries(self, kind: type[Event]) -> list[Entry]:
        """Return the entries of a kind of event."""
        return [entry for entry in self.log if isinstance(entry.event, kind)]

    def events(self, kind: type[EventT]) -> list[EventT]:
        """Return all events of a kind."""
        return [entry.event for entry in self.log if isinstance(entry.event, kind)]

    def check_completed(self) -> MissionCompleted:
        """Return the mission's end; every sample is at C3 and counts once."""
        (completed,) = self.events(MissionCompleted)
        assert self.brought == self.entered
        assert completed.samples_delivered == len(self.entered)
        assert sum(each.samples for each in self.events(SamplesDelivered)) == len(self.entered)
        assert completed.lost == ()
        assert self.status is not None
        assert self.status.state is MissionState.COMPLETED
        per_auv = Counter(auv for auv, _ in self.entered)
        assert {auv.name: auv.samples_delivered for auv in self.status.auvs} == per_auv
        return completed
