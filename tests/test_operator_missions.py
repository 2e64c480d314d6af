"""
Whole missions in one process in which the operator changes his mind at any time.

Whatever he wants and whatever the radio loses of it: no sortie takes longer than the limit by
which it departed, no sample is lost, a recalled AUV stays up, no new path leads through cells that
are masked by then, and the mission ends as soon as he lets it.
"""

from __future__ import annotations

from random import Random
from typing import Any

import pytest
from msgspec.structs import replace
from two_auvs import IDEAL, LIMIT_S, Diary, poor_radio, two_auvs

from c3_station.in_process import fly
from c3_station.operator_desk import OperatorDesk
from c3_station.scenario import Radio, Scenario, ScheduledCommand
from c3_station.scheduled_commands import operator_command
from msgs_json.geometry import Cell, GridSpec
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
    MissionStopped,
    RecoveryReason,
    SearchBrokenOff,
    SortieDeparted,
    SortieReturned,
    StayedUp,
)

LOSSY = poor_radio(loss=0.3)


def scenario(planner: str, *commands: tuple[float, dict[str, Any]], **changes: object) -> Scenario:
    return two_auvs(
        planner,
        region=GridSpec(cols=5, rows=4, cell_m=10.0),
        operator=tuple(ScheduledCommand(at_s=at_s, command=command) for at_s, command in commands),
        **changes,
    )


def flown(mission: Scenario) -> Diary:
    """Return what came of a mission; the UAV flew by what the operator wanted."""
    diary = Diary(mission)
    fly(mission, diary)
    directive: Directive | None = None
    in_the_air = False
    for entry in diary.log:
        match entry.event:
            case DirectiveTaken(directive=taken):
                assert not in_the_air
                assert directive is None or taken.revision > directive.revision
                directive = taken
            case SortieDeparted(limit_s=limit_s):
                in_the_air = True
                if directive is not None:
                    assert limit_s == directive.sortie_limit_s
                    assert not directive.paused
                    assert not directive.aborted
            case SortieReturned():
                in_the_air = False
            case Met(path=path, auv=auv) if directive is not None:
                assert not {*path} & {*directive.masked}
                assert path == () or auv not in directive.recalled
    return diary


def check_completed(diary: Diary, mission: Scenario) -> MissionCompleted:
    """Return its end; what the operator wanted last was flown, and every sample is at C3."""
    completed = diary.check_completed()
    assert diary.status is not None
    wanted = diary.status.directive
    taken_out = {*wanted.masked} - {*mission.region.masked}
    total = mission.region.cells_total - len(taken_out)
    is_all_recalled = len(wanted.recalled) == len(mission.auvs)
    assert completed.cells_delivered == total or is_all_recalled
    assert completed.cells_delivered <= total
    assert len(diary.events(StayedUp)) == len(mission.auvs)
    return completed


def reasons(diary: Diary) -> list[RecoveryReason]:
    return [event.reason for event in diary.events(StayedUp)]


def times_s(diary: Diary, kind: type[Event]) -> list[float]:
    return [entry.stamp_s for entry in diary.entries(kind)]


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


def directives(flight: Diary) -> list[Directive]:
    return [each.directive for each in flight.events(DirectiveTaken)]


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
    assert sorted(each.value for each in reasons(flight)) == ['explored', 'recalled']


@PLANNERS
@RADIOS
@pytest.mark.parametrize('command', [RECALL_ALL, END], ids=['recall', 'end'])
def test_the_mission_ends_when_all_are_recalled(
    planner: str, radio: Radio, command: dict[str, Any]
) -> None:
    mission = scenario(planner, (30.0, command), radio=radio)
    flight = flown(mission)
    assert check_completed(flight, mission).cells_delivered < 20
    assert reasons(flight) == [RecoveryReason.RECALLED] * 2


@PLANNERS
@RADIOS
def test_no_sortie_departs_during_a_pause(planner: str, radio: Radio) -> None:
    mission = scenario(planner, (20.0, PAUSE), (300.0, RESUME), radio=radio)
    flight = flown(mission)
    check_completed(flight, mission)
    paused, resumed = times_s(flight, DirectiveTaken)
    departures_s = times_s(flight, SortieDeparted)
    assert not [time_s for time_s in departures_s if paused <= time_s < resumed]
    assert max(departures_s) >= resumed >= 300.0 > paused


@PLANNERS
@RADIOS
def test_an_abort_brings_the_uav_home_until_the_reset(planner: str, radio: Radio) -> None:
    mission = scenario(planner, (25.0, ABORT), (300.0, RESET), radio=radio)
    flight = flown(mission)
    check_completed(flight, mission)
    departures_s = times_s(flight, SortieDeparted)
    returns_s = times_s(flight, SortieReturned)
    aborted_s, reset_s = times_s(flight, CommandTaken)
    home_s = min(time_s for time_s in returns_s if time_s >= aborted_s)
    assert not [time_s for time_s in departures_s if home_s <= time_s < reset_s]


@PLANNERS
def test_an_abort_that_is_not_taken_back_lasts_to_the_hard_stop(planner: str) -> None:
    flight = flown(scenario(planner, (25.0, ABORT), (60.0, RECALL_ALL), max_mission_s=400.0))
    assert flight.status is not None
    assert flight.status.state is MissionState.ABORTED
    assert flight.events(MissionCompleted) == []
    assert len(flight.events(MissionStopped)) == 1
    assert flight.sortie is None


@PLANNERS
@RADIOS
def test_cells_that_are_masked_are_not_surveyed_by_those_who_know(
    planner: str, radio: Radio
) -> None:
    mission = scenario(planner, (5.0, REGION), radio=radio)
    flight = flown(mission)
    assert check_completed(flight, mission).cells_delivered == 17
    entered = {each.cell for each in flight.events(CellEntered)}
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
    assert [each.problem for each in flight.events(CommandRefused)] == [
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
    limits_s = [each.limit_s for each in flight.events(SortieDeparted)]
    assert limits_s[0] == 30.0
    assert limits_s[-1] == 1000.0


def test_a_limit_that_cannot_be_kept_is_refused_and_the_rest_is_taken() -> None:
    mission = scenario('robust', (2.0, limit(24.0)), (2.0, PAUSE), (50.0, RESUME))
    flight = flown(mission)
    check_completed(flight, mission)
    (refused,) = flight.events(CommandRefused)
    assert refused.problem.startswith('sortie_limit_s is 24; allowed: at least ')
    assert refused.problem.endswith(', which the next sortie takes at worst; it stays 30')
    assert [(each.paused, each.sortie_limit_s) for each in directives(flight)] == [
        (True, 30.0),
        (False, 30.0),
    ]


def test_an_abort_in_the_air_counts_no_auv_as_searched_in_vain() -> None:
    mission = scenario('robust', (6.0, ABORT), (60.0, RESET))
    flight = flown(replace(mission, sortie=replace(mission.sortie, lost_after_sorties=1)))
    assert flight.events(SearchBrokenOff) == [
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
