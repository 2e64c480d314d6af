from __future__ import annotations

import hypothesis.strategies as st
from hypothesis import given

from c3_station.mission_views import diagnostics, occupancy, survey_markers
from msgs_json.geometry import Cell, GridSpec, Point
from msgs_json.messages import AuvStatus, MissionState, MissionStatus
from msgs_json.ros_messages import to_cdr

REGION = GridSpec(cols=3, rows=2, cell_m=10.0)
C3 = Point(east_m=50.0, north_m=0.0)

surveys = st.dictionaries(
    st.tuples(st.integers(0, 2), st.integers(0, 1)), st.floats(-1e9, 1e9), max_size=6
)


def test_delivered_cells_are_free_and_others_unknown_row_by_row_from_the_south() -> None:
    grid = occupancy(REGION, {(2, 0): 12.5, (0, 1): 11.0}, 44.0)
    assert grid.values == ((-1, -1, 0), (0, -1, -1))
    assert (grid.cell_m, grid.stamp_s) == (10.0, 44.0)


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


def auv_status(name: str, deadline_s: float | None, last_met_s: float | None) -> AuvStatus:
    return AuvStatus(
        name=name,
        leg_id=3,
        predicted_cells=(),
        surface_deadline_s=deadline_s,
        last_met_s=last_met_s,
        samples_delivered=4,
    )


def test_diagnostics_show_the_mission_and_every_auv() -> None:
    status = MissionStatus(
        mission_id='pond',
        state=MissionState.SURVEYING,
        sorties=2,
        cells_total=6,
        cells_delivered=5,
        samples_delivered=9,
        auvs=(auv_status('auv_1', 90.0, 0.0), auv_status('auv_2', None, None)),
    )
    mission, first, second = diagnostics(status, 44.0).statuses
    assert (mission.name, mission.level, mission.message) == ('c3: mission', 0, 'surveying')
    assert dict(mission.values)['cells delivered'] == '5 of 6'
    assert (first.name, first.message) == ('c3: auv_1', 'survey')
    values = dict(first.values)
    assert (values['surfaced at the latest, s'], values['last met, s']) == ('90', '0')
    assert second.message == 'recovered'
    assert dict(second.values)['surfaced at the latest, s'] == '-'
    assert to_cdr(diagnostics(status, 44.0))
