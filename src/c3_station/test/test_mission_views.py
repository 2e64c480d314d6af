from __future__ import annotations

import hypothesis.strategies as st
import pytest
from hypothesis import given
from msgspec.structs import replace

from c3_station.mission_views import diagnostics, occupancy, survey_markers
from msgs_json.geometry import Cell, GridSpec, Point
from msgs_json.messages import AuvStatus, ContactState, Directive, MissionState, MissionStatus
from msgs_json.ros_messages import Diagnostic, to_cdr

REGION = GridSpec(cols=3, rows=2, cell_m=10.0)
C3 = Point(east_m=50.0, north_m=0.0)
ORDERED = Directive(
    revision=0, paused=False, aborted=False, recalled=(), sortie_limit_s=60.0, masked=()
)

surveys = st.dictionaries(
    st.tuples(st.integers(0, 2), st.integers(0, 1)), st.floats(-1e9, 1e9), max_size=6
)


def test_delivered_cells_are_free_and_others_unknown_row_by_row_from_the_south() -> None:
    grid = occupancy(REGION, {(2, 0): 12.5, (0, 1): 11.0}, 44.0)
    assert grid.values == ((-1, -1, 0), (0, -1, -1))
    assert (grid.cell_m, grid.stamp_s) == (10.0, 44.0)


def test_land_is_an_obstacle_and_not_waited_for() -> None:
    bay = GridSpec(cols=3, rows=2, cell_m=10.0, masked=((1, 0), (2, 1)))
    assert occupancy(bay, {(2, 0): 12.5}, 44.0).values == ((-1, 100, 0), (-1, -1, 100))
    survey, station, land = survey_markers(bay, C3, {(2, 0): 12.5}, 44.0).cells
    assert (survey.centres, station.centres) == ((bay.centre((2, 0)),), (C3,))
    assert (land.name, land.width_m) == ('masked', 10.0)
    assert land.centres == (bay.centre((1, 0)), bay.centre((2, 1)))
    assert len(set(land.colours)) == 1
    assert len(land.colours) == 2
    assert to_cdr(survey_markers(bay, C3, {}, 0.0))
    assert to_cdr(occupancy(bay, {}, 0.0))


def test_a_sample_of_zero_is_a_sample() -> None:
    assert occupancy(REGION, {(0, 0): 0.0}, 0.0).values[0][0] == 0


def test_cells_are_coloured_from_dark_to_bright() -> None:
    survey, _ = survey_markers(REGION, C3, {(0, 0): 14.0, (1, 0): 10.0, (2, 0): 12.0}, 0.0).cells
    assert survey.centres == tuple(REGION.centre((col, 0)) for col in range(3))
    brightness = [sum(colour) for colour in survey.colours]
    assert brightness[1] < brightness[2] < brightness[0]
    assert survey.colours[1] == (0.0, 0.13, 0.30)  # ends of cividis
    assert survey.colours[0] == (1.0, 0.91, 0.27)
    assert survey.width_m == REGION.cell_m


def test_the_station_is_shown_where_it_is() -> None:
    _, station = survey_markers(REGION, C3, {}, 0.0).cells
    assert (station.name, station.centres) == ('c3', (C3,))


@given(surveys)
def test_every_survey_can_be_drawn(survey: dict[Cell, float]) -> None:
    markers = survey_markers(REGION, C3, survey, 0.0)
    assert len(markers.cells[0].centres) == len(markers.cells[0].colours) == len(survey)
    assert all(0.0 <= part <= 1.0 for colour in markers.cells[0].colours for part in colour)
    assert to_cdr(markers)
    assert to_cdr(occupancy(REGION, survey, 0.0))


def auv_status(
    name: str,
    contact: ContactState | None,
    *,
    last_met_s: float | None = None,
    searches_in_vain: int = 0,
) -> AuvStatus:
    is_up = contact is None
    return AuvStatus(
        name=name,
        leg_id=3,
        predicted_cells=() if is_up else ((0, 0), (1, 0), (1, 1), (2, 1)),
        surface_deadline_s=None if is_up else 90.0,
        contact=contact,
        next_contact_s=None if is_up else 104.5,
        searches_in_vain=searches_in_vain,
        last_met_s=last_met_s,
        samples_delivered=4,
    )


def mission_status(*auvs: AuvStatus) -> MissionStatus:
    return MissionStatus(
        mission_id='pond',
        state=MissionState.SURVEYING,
        sorties=2,
        cells_total=6,
        cells_delivered=5,
        samples_delivered=9,
        directive=ORDERED,
        directive_taken=0,
        auvs=auvs,
    )


def auv_diagnostic(auv: AuvStatus, *, asked_for_help: bool = False) -> Diagnostic:
    helpless = [auv.name] if asked_for_help else []
    _, diagnostic = diagnostics(mission_status(auv), helpless, 44.0).statuses
    return diagnostic


def test_diagnostics_show_the_mission_and_every_auv() -> None:
    status = mission_status(
        auv_status('auv_1', ContactState.EXPECTED_SILENT, last_met_s=0.0),
        auv_status('auv_2', None),
    )
    shown = diagnostics(status, [], 44.0)
    mission, first, second = shown.statuses
    assert (mission.name, mission.level, mission.message) == ('c3: mission', 0, 'surveying')
    assert dict(mission.values)['cells delivered'] == '5 of 6'
    assert (first.name, first.message) == ('c3: auv_1', 'expected silent')
    assert dict(first.values) == {
        'leg': '3',
        'can surface in': '[0, 0] ... [2, 1], 4 cells',
        'surfaced at the latest, s': '90',
        'next contact, s': '104.5',
        'searches in vain': '0',
        'last met, s': '0',
        'asked for help': 'no',
        'samples delivered': '4',
    }
    values = dict(second.values)
    assert (second.name, second.message) == ('c3: auv_2', 'recovered')
    assert {values['can surface in'], values['surfaced at the latest, s']} == {'-'}
    assert {values['next contact, s'], values['last met, s']} == {'-'}
    assert to_cdr(shown)


@pytest.mark.parametrize(
    ('contact', 'level'),
    [
        (ContactState.EXPECTED_SILENT, 0),
        (ContactState.DUE, 0),
        (ContactState.OVERDUE, 1),
        (ContactState.LOST, 2),
        (None, 0),
    ],
)
def test_silence_is_no_failure_until_somebody_searched(
    contact: ContactState | None, level: int
) -> None:
    diagnostic = auv_diagnostic(auv_status('auv_1', contact, searches_in_vain=2))
    assert diagnostic.level == level
    assert dict(diagnostic.values)['searches in vain'] == '2'


def test_who_asked_for_help_is_a_warning_though_it_is_recovered() -> None:
    diagnostic = auv_diagnostic(auv_status('auv_1', None), asked_for_help=True)
    assert (diagnostic.level, diagnostic.message) == (1, 'recovered, asked for help')
    assert dict(diagnostic.values)['asked for help'] == 'yes'


@pytest.mark.parametrize(
    ('state', 'taken', 'level', 'message'),
    [
        (MissionState.SURVEYING, 2, 0, 'surveying'),
        (MissionState.PAUSED, 2, 1, 'paused'),
        (MissionState.ABORTED, 2, 1, 'aborted'),
        (
            MissionState.SURVEYING,
            1,
            1,
            'surveying; the UAV has not yet taken what the operator wants',
        ),
    ],
)
def test_what_waits_for_the_operator_or_for_the_uav_to_hear_of_him_is_a_warning(
    state: MissionState, taken: int, level: int, message: str
) -> None:
    wanted = replace(ORDERED, revision=2, recalled=('auv_1', 'auv_2'), masked=((0, 0),))
    status = replace(mission_status(), state=state, directive=wanted, directive_taken=taken)
    (mission,) = diagnostics(status, [], 44.0).statuses
    assert (mission.level, mission.message) == (level, message)
    values = dict(mission.values)
    assert values['recalled'] == 'auv_1, auv_2'
    assert values['masked cells'] == '1'
    assert values['the UAV flies so'] == ('yes' if taken == 2 else 'not yet')
