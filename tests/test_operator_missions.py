"""
Whole missions in one process in which the operator changes his mind at any time.

Whatever he wants and whatever the radio loses of it: no sortie takes longer than the limit by
which it departed, no sample is lost, a recalled AUV stays up, no new path leads through cells that
are masked by then, and the mission ends as soon as he lets it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from random import Random
from typing import Any

import pytest
from msgspec.structs import replace

from c3_station.in_process import fly
from c3_station.operator_desk import OperatorDesk
from c3_station.scenario import Auv, PlannerChoice, Radio, Scenario, ScheduledCommand, Sortie, Uav
from c3_station.scheduled_commands import operator_command
from msgs_json import codec
from msgs_json.agent_shell import Frame
from msgs_json.geometry import Cell, GridSpec, Point
from msgs_json.messages import (
    CellEntered,
    CommandRefused,
    CommandTaken,
    Directive,
    DirectiveTaken,
    EndMission,
    Event,
    Met,
    MissionCompleted,
    MissionState,
    MissionStatus,
    MissionStopped,
    RecoveryReason,
    SampleBatch,
    SearchBrokenOff,
    SortieDeparted,
    SortieReturned,
    StayedUp,
)
from msgs_json.ros_messages import Text
from msgs_json.topics import MISSION_EVENTS, MISSION_STATUS, RADIO_RX

LIMIT_S = {'ecc2009': 60.0, 'robust': 30.0, 'adaptive': 30.0}
OPTIONS = {'adaptive': {'effort': 'minimal'}}
IDEAL = Radio(range_m=12.0)
LOSSY = Radio(range_m=12.0, loss=0.3, max_message_bytes=720)
"""A frame holds one sample, and longer messages go in fragments."""


def scenario(planner: str, *commands: tuple[float, dict[str, Any]], **changes: object) -> Scenario:
    surfacing = {'model': 'early', 'probability': 0.3}
    return replace(
        Scenario(
            name='changed_mind',
            description='two AUVs that come up where they like, and an operator',
            region=GridSpec(cols=5, rows=4, cell_m=10.0),
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
            operator=tuple(
                ScheduledCommand(at_s=at_s, command=command) for at_s, command in commands
            ),
        ),
        **changes,
    )


@dataclass(slots=True)
class Flight:
    """What came of a mission, checked on the way."""

    keeps_limit: bool
    directive: Directive | None = None
    """By which the UAV flies; None by the order."""
    wanted: Directive | None = None
    state: MissionState | None = None
    log: list[tuple[float, Event]] = field(default_factory=list)
    entered: set[tuple[str, int]] = field(default_factory=set)
    brought: set[tuple[str, int]] = field(default_factory=set)
    sortie: SortieDeparted | None = None

    def __call__(self, name: str, frame: Frame) -> None:
        """Take what an agent puts out."""
        if frame.topic not in (MISSION_EVENTS, MISSION_STATUS, RADIO_RX):
            return
        assert isinstance(frame.message, Text)
        envelope, body = codec.decode(frame.message.data)
        match body:
            case MissionStatus():
                self.state, self.wanted = body.state, body.directive
            case SampleBatch() if name == 'c3':
                self.brought |= {(sample.auv, sample.number) for sample in body.samples}
            case Event():
                self.log.append((envelope.stamp, body))
                self._event(envelope.src, body)

    def _event(self, src: str, event: Event) -> None:
        match event:
            case CellEntered(sample_number=number):
                self.entered.add((src, number))
            case DirectiveTaken(directive=directive):
                assert self.sortie is None
                assert self.directive is None or directive.revision > self.directive.revision
                self.directive = directive
            case SortieDeparted():
                self.sortie = event
                if self.directive is not None:
                    assert event.limit_s == self.directive.sortie_limit_s
                    assert not self.directive.paused
                    assert not self.directive.aborted
            case SortieReturned(duration_s=duration_s):
                assert self.sortie is not None
                assert duration_s <= self.sortie.limit_s or not self.keeps_limit
                self.sortie = None
            case Met(path=path, auv=auv) if self.directive is not None:
                assert not {*path} & {*self.directive.masked}
                assert path == () or auv not in self.directive.recalled

    def all(self, *kinds: type[Event]) -> list[Event]:
        return [event for _, event in self.log if isinstance(event, kinds)]

    def reasons(self) -> list[RecoveryReason]:
        return [event.reason for event in self.all(StayedUp) if isinstance(event, StayedUp)]


def flown(mission: Scenario) -> Flight:
    flight = Flight(keeps_limit=mission.planner.name != 'ecc2009')
    fly(mission, flight)
    return flight


def check_completed(flight: Flight, mission: Scenario) -> MissionCompleted:
    """Return its end; what the operator wanted last was flown, and every sample is at C3."""
    (completed,) = flight.all(MissionCompleted)
    assert isinstance(completed, MissionCompleted)
    assert flight.state is MissionState.COMPLETED
    assert flight.brought == flight.entered
    assert completed.samples_delivered == len(flight.entered)
    assert completed.lost == ()
    assert flight.wanted is not None
    taken_out = {*flight.wanted.masked} - {*mission.region.masked}
    total = mission.region.cells_total - len(taken_out)
    is_all_recalled = len(flight.wanted.recalled) == len(mission.auvs)
    assert completed.cells_delivered == total or is_all_recalled
    assert completed.cells_delivered <= total
    assert len(flight.all(StayedUp)) == len(mission.auvs)
    return completed


RECALL_ONE = {'command': 'recall', 'auvs': ['auv_2']}
RECALL_ALL: dict[str, Any] = {'command': 'recall'}
PAUSE, RESUME = {'command': 'pause'}, {'command': 'resume'}
ABORT, RESET = {'command': 'abort'}, {'command': 'reset'}
END = {'command': 'end_mission'}
MASKED: tuple[Cell, ...] = ((4, 0), (4, 1), (4, 2))
REGION = {'command': 'change_region', 'masked': [list(cell) for cell in MASKED]}
WHOLE_REGION: dict[str, Any] = {'command': 'change_region', 'masked': []}
ALL_KINDS: tuple[dict[str, Any], ...] = (
    RECALL_ONE,
    PAUSE,
    RESUME,
    ABORT,
    RESET,
    REGION,
    WHOLE_REGION,
)


def limit(sortie_limit_s: float) -> dict[str, Any]:
    return {'command': 'change_limit', 'sortie_limit_s': sortie_limit_s}


def directives(flight: Flight) -> list[Directive]:
    return [
        each.directive for each in flight.all(DirectiveTaken) if isinstance(each, DirectiveTaken)
    ]


# --- each command --------------------------------------------------------------------------------

PLANNERS = pytest.mark.parametrize('planner', LIMIT_S)
RADIOS = pytest.mark.parametrize('radio', [IDEAL, LOSSY], ids=['ideal', 'lossy'])


@PLANNERS
@RADIOS
def test_a_recalled_auv_stays_up_and_the_others_survey_its_cells(
    planner: str, radio: Radio
) -> None:
    mission = scenario(planner, (30.0, RECALL_ONE), radio=radio)
    flight = flown(mission)
    assert check_completed(flight, mission).cells_delivered == 20
    assert sorted(each.value for each in flight.reasons()) == ['explored', 'recalled']


@PLANNERS
@RADIOS
@pytest.mark.parametrize('command', [RECALL_ALL, END], ids=['recall', 'end'])
def test_the_mission_ends_when_all_are_recalled(
    planner: str, radio: Radio, command: dict[str, Any]
) -> None:
    mission = scenario(planner, (30.0, command), radio=radio)
    flight = flown(mission)
    assert check_completed(flight, mission).cells_delivered < 20
    assert flight.reasons() == [RecoveryReason.RECALLED] * 2


@PLANNERS
@RADIOS
def test_no_sortie_departs_during_a_pause(planner: str, radio: Radio) -> None:
    mission = scenario(planner, (20.0, PAUSE), (300.0, RESUME), radio=radio)
    flight = flown(mission)
    check_completed(flight, mission)
    paused, resumed = (time_s for time_s, event in flight.log if isinstance(event, DirectiveTaken))
    departures_s = [time_s for time_s, each in flight.log if isinstance(each, SortieDeparted)]
    assert not [time_s for time_s in departures_s if paused <= time_s < resumed]
    assert max(departures_s) >= resumed >= 300.0 > paused


@PLANNERS
@RADIOS
def test_an_abort_brings_the_uav_home_until_the_reset(planner: str, radio: Radio) -> None:
    mission = scenario(planner, (25.0, ABORT), (300.0, RESET), radio=radio)
    flight = flown(mission)
    check_completed(flight, mission)
    departures_s = [time_s for time_s, each in flight.log if isinstance(each, SortieDeparted)]
    returns_s = [time_s for time_s, each in flight.log if isinstance(each, SortieReturned)]
    aborted_s, reset_s = (time_s for time_s, each in flight.log if isinstance(each, CommandTaken))
    home_s = min(time_s for time_s in returns_s if time_s >= aborted_s)
    assert not [time_s for time_s in departures_s if home_s <= time_s < reset_s]


@PLANNERS
def test_an_abort_that_is_not_taken_back_lasts_to_the_hard_stop(planner: str) -> None:
    flight = flown(scenario(planner, (25.0, ABORT), (60.0, RECALL_ALL), max_mission_s=400.0))
    assert flight.state is MissionState.ABORTED
    assert flight.all(MissionCompleted) == []
    assert len(flight.all(MissionStopped)) == 1
    assert flight.sortie is None


@PLANNERS
@RADIOS
def test_cells_that_are_masked_are_not_surveyed_by_those_who_know(
    planner: str, radio: Radio
) -> None:
    mission = scenario(planner, (5.0, REGION), radio=radio)
    flight = flown(mission)
    assert check_completed(flight, mission).cells_delivered == 17
    entered = {each.cell for each in flight.all(CellEntered) if isinstance(each, CellEntered)}
    assert not entered & {*MASKED}
    assert len(entered) == 17


@PLANNERS
def test_cells_that_are_no_longer_masked_are_surveyed_after_all(planner: str) -> None:
    mission = scenario(planner, (5.0, REGION), (100.0, WHOLE_REGION))
    assert check_completed(flown(mission), mission).cells_delivered == 20


def test_cells_on_a_path_and_cells_out_of_reach_are_no_change_to_the_region() -> None:
    on_the_path = {'command': 'change_region', 'masked': [[1, 0]]}
    out_of_reach = {'command': 'change_region', 'masked': [[3, 0], [4, 1]]}
    mission = scenario('robust', (2.0, on_the_path), (3.0, out_of_reach))
    flight = flown(mission)
    assert check_completed(flight, mission).cells_delivered == 20
    assert [
        each.problem for each in flight.all(CommandRefused) if isinstance(each, CommandRefused)
    ] == [
        'masked holds [1, 0], which is on the path of auv_1; the region stays as it is',
        'masked leaves 1 cells to which no AUV could get, [4, 0] first; the region stays as it is',
    ]
    assert [each.masked for each in directives(flight)] == [(), ()]


@pytest.mark.parametrize('planner', ['robust', 'adaptive'])
@RADIOS
def test_a_limit_counts_from_the_next_sortie_on(planner: str, radio: Radio) -> None:
    mission = scenario(planner, (40.0, limit(90.0)), (41.0, limit(1000.0)), radio=radio)
    flight = flown(mission)
    check_completed(flight, mission)
    limits_s = [
        each.limit_s for each in flight.all(SortieDeparted) if isinstance(each, SortieDeparted)
    ]
    assert limits_s[0] == 30.0
    assert limits_s[-1] == 1000.0


def test_a_limit_that_cannot_be_kept_is_refused_and_the_rest_is_taken() -> None:
    mission = scenario('robust', (2.0, limit(24.0)), (2.0, PAUSE), (50.0, RESUME))
    flight = flown(mission)
    check_completed(flight, mission)
    (refused,) = flight.all(CommandRefused)
    assert isinstance(refused, CommandRefused)
    assert refused.problem.startswith('sortie_limit_s is 24; allowed: at least ')
    assert refused.problem.endswith(', which the next sortie takes at worst; it stays 30')
    assert [(each.paused, each.sortie_limit_s) for each in directives(flight)] == [
        (True, 30.0),
        (False, 30.0),
    ]


def test_an_abort_in_the_air_counts_no_auv_as_searched_in_vain() -> None:
    mission = scenario('robust', (6.0, ABORT), (60.0, RESET))
    flight = flown(replace(mission, sortie=replace(mission.sortie, lost_after_sorties=1)))
    assert flight.all(SearchBrokenOff) == [
        SearchBrokenOff(sortie=1, not_reached=('auv_1', 'auv_2'))
    ]
    check_completed(flight, mission)


# --- any of them ---------------------------------------------------------------------------------

SEEDS = [*range(2), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(2, 25))]


@PLANNERS
@RADIOS
@pytest.mark.parametrize('seed', SEEDS)
def test_whatever_he_wants_in_whatever_order_the_promises_hold(
    planner: str, radio: Radio, seed: int
) -> None:
    random = Random(f'{planner} {seed}')
    times_s = sorted(random.uniform(0.0, 200.0) for _ in range(random.choice([1, 3, 8])))
    commands = []
    desk = OperatorDesk(scenario(planner))
    for time_s in times_s:
        # By a shorter one cells may be out of reach of every sortie.
        limits = [limit(LIMIT_S[planner] * factor) for factor in (0.95, 1.5)]
        command = random.choice([*ALL_KINDS, *limits])
        if desk.take(operator_command(command)) is None:
            commands.append((time_s, command))
    if random.random() < 0.3 and desk.take(EndMission()) is None:
        commands.append((200.0, END))
    # In the end he lets the mission go on, else it would never be over.
    mission = scenario(planner, *commands, (400.0, RESET), (400.0, RESUME), radio=radio, seed=seed)
    flight = flown(mission)
    check_completed(flight, mission)
