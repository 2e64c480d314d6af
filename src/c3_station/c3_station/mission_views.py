"""What C3 shows people and tools: the delivered map, the survey as coloured cells, diagnostics."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from msgs_json.geometry import Cell, GridSpec, Point
from msgs_json.messages import AuvStatus, ContactState, MissionState, MissionStatus
from msgs_json.ros_messages import (
    ColouredCells,
    Diagnostic,
    Diagnostics,
    Markers,
    Occupancy,
)

UNKNOWN = -1
SURVEYED = 0
MASKED = 100
"""Occupied: tools draw it as an obstacle, and only what is still to come stays unknown."""

OK, WARN, ERROR = 0, 1, 2
"""Levels of diagnostic_msgs/DiagnosticStatus."""

# Ends and middle of the cividis colour map, which reads the same with any colour vision.
_LOW, _MIDDLE, _HIGH = (0.0, 0.13, 0.30), (0.49, 0.48, 0.47), (1.0, 0.91, 0.27)
_STATION_COLOUR = (0.84, 0.37, 0.0)
_LAND_COLOUR = (0.66, 0.61, 0.54)


def occupancy(region: GridSpec, delivered: Mapping[Cell, float], now_s: float) -> Occupancy:
    """Return the map: 0 where a sample is delivered, 100 where masked, -1 (unknown) elsewhere."""
    values = np.where(region.mask, MASKED, UNKNOWN)
    for cell in delivered:
        values[region.index(cell)] = SURVEYED
    return Occupancy(
        stamp_s=now_s, cell_m=region.cell_m, values=tuple(map(tuple, values.tolist()))
    )


def survey_markers(
    region: GridSpec, c3: Point, delivered: Mapping[Cell, float], now_s: float
) -> Markers:
    """Return the delivered values as coloured cells, from dark (lowest) to bright, C3, land."""
    low = min(delivered.values(), default=0.0)
    span = max(delivered.values(), default=0.0) - low or 1.0
    survey = ColouredCells(
        name='survey',
        centres=tuple(region.centre(cell) for cell in delivered),
        colours=tuple(_colour((value - low) / span) for value in delivered.values()),
        width_m=region.cell_m,
    )
    station = ColouredCells(
        name='c3', centres=(c3,), colours=(_STATION_COLOUR,), width_m=region.cell_m / 2
    )
    if not region.masked:
        return Markers(stamp_s=now_s, cells=(survey, station))
    land = ColouredCells(
        name='masked',
        centres=tuple(region.centre(cell) for cell in region.masked),
        colours=(_LAND_COLOUR,) * len(region.masked),
        width_m=region.cell_m,
    )
    return Markers(stamp_s=now_s, cells=(survey, station, land))


def diagnostics(
    status: MissionStatus, asked_for_help: Collection[str], now_s: float
) -> Diagnostics:
    """
    Return the mission's state and each AUV's as diagnostics (REP-107).

    Silence is no failure: an AUV under water, or one that nobody has searched yet, is OK. What
    waits for the operator is a warning, and so is what he wants and the UAV has not heard.
    """
    wanted = status.directive
    is_taken = status.directive_taken == wanted.revision
    waits = status.state in (MissionState.PAUSED, MissionState.ABORTED)
    unheard = '' if is_taken else '; the UAV has not yet taken what the operator wants'
    mission = Diagnostic(
        name='c3: mission',
        level=WARN if waits or not is_taken else OK,
        message=f'{status.state.value}{unheard}',
        values=(
            ('sorties', str(status.sorties)),
            ('cells delivered', f'{status.cells_delivered} of {status.cells_total}'),
            ('samples delivered', str(status.samples_delivered)),
            ('sortie limit, s', f'{wanted.sortie_limit_s:g}'),
            ('masked cells', str(len(wanted.masked))),
            ('recalled', ', '.join(wanted.recalled) or '-'),
            ('the UAV flies so', 'yes' if is_taken else 'not yet'),
        ),
    )
    vehicles = tuple(_auv_diagnostic(auv, auv.name in asked_for_help) for auv in status.auvs)
    return Diagnostics(stamp_s=now_s, statuses=(mission, *vehicles))


def _auv_diagnostic(auv: AuvStatus, asked_for_help: bool) -> Diagnostic:
    level = OK
    if auv.contact is ContactState.LOST:
        level = ERROR
    elif auv.contact is ContactState.OVERDUE or asked_for_help:
        level = WARN
    state = 'recovered' if auv.contact is None else auv.contact.value.replace('_', ' ')
    return Diagnostic(
        name=f'c3: {auv.name}',
        level=level,
        message=f'{state}, asked for help' if asked_for_help else state,
        values=(
            ('leg', str(auv.leg_id)),
            ('can surface in', _cells_text(auv.predicted_cells)),
            ('surfaced at the latest, s', _text(auv.surface_deadline_s)),
            ('next contact, s', _text(auv.next_contact_s)),
            ('searches in vain', str(auv.searches_in_vain)),
            ('last met, s', _text(auv.last_met_s)),
            ('asked for help', 'yes' if asked_for_help else 'no'),
            ('samples delivered', str(auv.samples_delivered)),
        ),
    )


def _colour(share: float) -> tuple[float, float, float]:
    """Return the colour of a share between 0 and 1."""
    start, end, part = (
        (_LOW, _MIDDLE, 2 * share) if share < 0.5 else (_MIDDLE, _HIGH, 2 * share - 1)
    )
    red, green, blue = (a + part * (b - a) for a, b in zip(start, end, strict=True))
    return red, green, blue


def _text(time_s: float | None) -> str:
    return '-' if time_s is None else f'{time_s:g}'


def _cells_text(path: Sequence[Cell]) -> str:
    """Return the cells of a path by its ends, however long it is."""
    if not path:
        return '-'
    first, last = path[0], path[-1]
    return f'[{first[0]}, {first[1]}] ... [{last[0]}, {last[1]}], {len(path)} cells'
