"""Figures over the region: routes of the AUVs, the first sortie, the survey."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import ListedColormap
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, Rectangle

from c3_station.figure_style import (
    BLACK,
    GREY,
    LAND,
    PALE,
    WIDTH_IN,
    auv_colour,
    auv_label,
    auv_line,
    legend_below,
    new_figure,
)
from c3_station.node_params import UAV
from msgs_json.geometry import Point, is_before
from msgs_json.messages import CellEntered

if TYPE_CHECKING:
    from collections.abc import Iterable

    from matplotlib.axes import Axes
    from matplotlib.collections import QuadMesh
    from matplotlib.colors import Colormap
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from c3_station.mission_record import MissionRecord, Track
    from c3_station.scenario import Scenario
    from c3_station.summary import SortieSummary

ARROWS_TOTAL = 150
"""About as many arrow heads as a map of routes bears."""
GRID_CELLS = 60
"""With more columns or rows than that the lines between cells would fill the map."""
_TAKEN_OUT: Any = {  # matplotlib lists every key there is as its type
    'facecolor': 'none',
    'edgecolor': GREY,
    'hatch': 'xxxx',
    'lw': 0.0,
}
FINE_CELLS = 400
"""A map with more cells than that is drawn with finer lines."""


def _map(record: MissionRecord, scenario: Scenario, *, legend_rows: int) -> tuple[Figure, Axes]:
    """Return axes over the region and C3, with the grid of cells and those not to be surveyed."""
    region = scenario.region
    width_m, height_m = region.cols * region.cell_m, region.rows * region.cell_m
    margin_m = 0.04 * max(width_m, height_m)
    west_m, east_m = min(0.0, scenario.c3.east_m), max(width_m, scenario.c3.east_m)
    south_m, north_m = min(0.0, scenario.c3.north_m), max(height_m, scenario.c3.north_m)
    shape = (north_m - south_m + 2 * margin_m) / (east_m - west_m + 2 * margin_m)
    height_in = min(max(WIDTH_IN * 0.86 * shape, 2.5), 8.0) + 0.5 + 0.22 * legend_rows
    figure, axes = new_figure(height_in)
    if max(region.cols, region.rows) <= GRID_CELLS:
        easts_m = np.arange(region.cols + 1) * region.cell_m
        norths_m = np.arange(region.rows + 1) * region.cell_m
        axes.vlines(easts_m, 0.0, height_m, color=PALE, lw=0.6, zorder=0.8)
        axes.hlines(norths_m, 0.0, width_m, color=PALE, lw=0.6, zorder=0.8)
    if region.masked:
        land = np.where(region.mask, 1.0, np.nan)
        _mesh(axes, land, scenario, ListedColormap([LAND])).set_zorder(0.9)  # over the grid
    _draw_taken_out(axes, record, scenario)
    axes.set_xlim(west_m - margin_m, east_m + margin_m)
    axes.set_ylim(south_m - margin_m, north_m + margin_m)
    axes.set_aspect('equal')
    axes.set_xlabel('east (m)')
    axes.set_ylabel('north (m)')
    return figure, axes


def _draw_taken_out(axes: Axes, record: MissionRecord, scenario: Scenario) -> None:
    """Cross out the cells that the operator did not want surveyed; samples show through."""
    region, taken_out = scenario.region, record.taken_out(scenario)
    if not taken_out:
        return
    blank = np.full((region.rows, region.cols), np.nan)
    for cell in taken_out:
        blank[region.index(cell)] = 1.0
    # Over the hatch of cells that nobody entered, under samples.
    _mesh(axes, blank, scenario, ListedColormap(['white'])).set_zorder(0.3)
    for col, row in taken_out:
        corner_m = (col * region.cell_m, row * region.cell_m)
        axes.add_patch(
            Rectangle(corner_m, region.cell_m, region.cell_m, zorder=0.95, **_TAKEN_OUT)
        )


def _unsurveyed_in_legend(record: MissionRecord, scenario: Scenario) -> list[Line2D | Patch]:
    """Return what a legend says of cells that are not to be surveyed."""
    handles: list[Line2D | Patch] = []
    if scenario.region.masked:
        handles.append(Patch(color=LAND, label='masked (land, no-go)'))
    if record.taken_out(scenario):
        handles.append(Patch(label='taken out by the operator', **_TAKEN_OUT))
    return handles


def _draw_c3(axes: Axes, scenario: Scenario) -> None:
    axes.plot(
        scenario.c3.east_m,
        scenario.c3.north_m,
        marker='s',
        ms=9,
        color=BLACK,
        ls='none',
        zorder=8,
        clip_on=False,
    )


def _east_north(points: Iterable[Point]) -> tuple[list[float], list[float]]:
    listed = list(points)
    return [point.east_m for point in listed], [point.north_m for point in listed]


def draw_routes(record: MissionRecord, scenario: Scenario) -> Figure | None:
    """Draw the routes of all AUVs until the region is explored, as Fig. 7(b) of ECC 2009."""
    auvs = [
        (number, auv.name, record.tracks[auv.name])
        for number, auv in enumerate(scenario.auvs)
        if auv.name in record.tracks
    ]
    if not auvs:
        return None
    handles: list[Line2D | Patch] = [
        Line2D(
            [], [], color=auv_colour(number), ls=auv_line(number), lw=1.6, label=auv_label(name)
        )
        for number, name, _ in auvs
    ]
    handles += [
        Line2D([], [], color=GREY, marker='o', mfc='white', ls='none', ms=8, label='start'),
        Line2D([], [], color=GREY, marker='X', ls='none', ms=7, label='end'),
        Line2D([], [], color=BLACK, marker='s', ls='none', ms=8, label='C3'),
        *_unsurveyed_in_legend(record, scenario),
    ]
    columns = 6 if len(handles) % 6 < 2 else 4
    if record.taken_out(scenario):
        columns = 3  # its label is long
    figure, axes = _map(record, scenario, legend_rows=-(-len(handles) // columns))
    _hatch_not_entered(axes, record, scenario)
    cell_m = scenario.region.cell_m
    width = 1.5 if scenario.region.cells_total <= FINE_CELLS else 1.0
    for number, _, track in auvs:
        # Side by side where several AUVs pass through the same cells.
        shift_m = (number - (len(scenario.auvs) - 1) / 2) * 0.6 * cell_m / len(scenario.auvs)
        line = _keeping_right(_cell_centres(track, record.summary.explored_s), 0.06 * cell_m)
        line += complex(shift_m, shift_m)
        colour = auv_colour(number)
        axes.plot(line.real, line.imag, color=colour, ls=auv_line(number), lw=width, zorder=3)
        _draw_arrows(axes, line, colour, ARROWS_TOTAL // len(auvs))
        axes.plot(*_xy(line[0]), 'o', ms=11, mfc='white', mec=colour, mew=1.8, zorder=6)
        axes.annotate(
            str(number + 1),
            _xy(line[0]),
            ha='center',
            va='center_baseline',
            fontsize=8,
            fontweight='bold',
            zorder=7,
        )
        axes.plot(*_xy(line[-1]), 'X', ms=9, mfc=colour, mec='white', mew=0.8, zorder=6)
    _draw_c3(axes, scenario)
    legend_below(figure, handles, columns)
    return figure


def _xy(point: complex) -> tuple[float, float]:
    return point.real, point.imag


def _cell_centres(track: Track, until_s: float | None) -> list[complex]:
    """Return the places (east + i north) where a track begins, turns, stands, and ends."""
    places = [
        complex(point.east_m, point.north_m)
        for time_s, point in zip(track.times_s, track.positions, strict=True)
        if until_s is None or not is_before(until_s, time_s)
    ]
    moved = [places[0], *(b for a, b in pairwise(places) if a != b)]
    return [
        place
        for before, place, after in zip(
            [None, *moved[:-1]], moved, [*moved[1:], None], strict=True
        )
        if before is None or after is None or not _is_straight(before, place, after)
    ]


def _is_straight(before: complex, place: complex, after: complex) -> bool:
    way_in, way_out = place - before, after - place
    return abs(way_in / abs(way_in) - way_out / abs(way_out)) < 1e-6


def _keeping_right(corners: list[complex], margin_m: float) -> NDArray[np.complex128]:
    """Return a line that keeps to the right of a route, so that ways there and back show."""
    if len(corners) < 2:
        return np.array(corners)
    ways = [(b - a) / abs(b - a) for a, b in pairwise(corners)]
    rights = [-1j * margin_m * way for way in ways]
    line = [corners[0] + rights[0]]
    for corner, (before, after) in zip(corners[1:-1], pairwise(rights), strict=True):
        if abs(before + after) < 1e-6 * margin_m:
            line += [corner + before, corner + after]
        else:
            # Where the two shifted lines cross; for a right angle the sum of both shifts.
            line.append(corner + (before + after) / (1 + (before / after).real))
    return np.array([*line, corners[-1] + rights[-1]])


def _draw_arrows(axes: Axes, line: NDArray[np.complex128], colour: str, count: int) -> None:
    """Put arrow heads along a line, evenly by length."""
    steps = np.diff(line)
    ends_m = np.cumsum(np.abs(steps))
    if ends_m.size == 0 or ends_m[-1] == 0.0:
        return
    for at_m in (np.arange(count) + 0.5) * ends_m[-1] / count:
        step = int(np.searchsorted(ends_m, at_m))
        way = steps[step] / abs(steps[step])
        tip = line[step + 1] - way * (ends_m[step] - at_m)
        axes.annotate(
            '',
            _xy(tip),
            _xy(tip - 1e-3 * ends_m[-1] / count * way),
            arrowprops={
                'arrowstyle': '-|>',
                'color': colour,
                'lw': 0.0,
                'mutation_scale': 9,
                'shrinkA': 0,
                'shrinkB': 0,
            },
            zorder=4,
        )


def _hatch_not_entered(axes: Axes, record: MissionRecord, scenario: Scenario) -> None:
    entered = np.full((scenario.region.rows, scenario.region.cols), np.nan)
    for each in record.events:
        if isinstance(each.event, CellEntered):
            entered[scenario.region.index(each.event.cell)] = 1.0
    if np.isnan(entered).any():
        _hatch_region(axes, scenario)
        _mesh(axes, entered, scenario, ListedColormap(['white']))


def _hatch_region(axes: Axes, scenario: Scenario) -> None:
    """Hatch the whole region; what there is of cells is drawn over it."""
    region = scenario.region
    axes.add_patch(
        Rectangle(
            (0.0, 0.0),
            region.cols * region.cell_m,
            region.rows * region.cell_m,
            facecolor='#F4F4F4',
            edgecolor='#BBBBBB',
            hatch='////',
            lw=0,
            zorder=0.2,
        )
    )


def _mesh(
    axes: Axes, values: NDArray[np.float64], scenario: Scenario, colours: Colormap
) -> QuadMesh:
    """Colour the cells by their values, ``[row, col]``; those without a value stay as they are."""
    region = scenario.region
    return axes.pcolormesh(
        np.arange(region.cols + 1) * region.cell_m,
        np.arange(region.rows + 1) * region.cell_m,
        values,
        cmap=colours,
        edgecolors='face',
        lw=0.2,
        zorder=0.5,
    )


def draw_first_sortie(record: MissionRecord, scenario: Scenario) -> Figure | None:
    """Draw the first sortie: route, flight, contacts and new paths, as Figs. 4 to 6."""
    track = record.tracks.get(UAV)
    if not record.summary.sorties or not record.routes or track is None:
        return None
    sortie = record.summary.sorties[0]
    unsurveyed = _unsurveyed_in_legend(record, scenario)
    figure, axes = _map(record, scenario, legend_rows=3 + len(unsurveyed))
    numbers = {auv.name: number for number, auv in enumerate(scenario.auvs)}
    for number, auv in enumerate(scenario.auvs):
        cells = [scenario.region.centre(cell) for cell in auv.initial_path]
        axes.plot(*_east_north(cells), color=auv_colour(number), lw=1.5, ls=':', zorder=3)
    route = record.routes[0][1]
    axes.plot(*_east_north(route), color=GREY, lw=1.2, ls=(0, (5, 3)), zorder=2)
    axes.plot(
        *_east_north(route[1:-1]), 'o', ms=5, mfc='white', mec=GREY, mew=1.2, ls='none', zorder=4
    )
    flown = [
        (time_s, point)
        for time_s, point in zip(track.times_s, track.positions, strict=True)
        if not is_before(time_s, sortie.departed_s)
        and (sortie.returned_s is None or not is_before(sortie.returned_s, time_s))
    ]
    axes.plot(
        *_east_north(point for _, point in flown),
        color=BLACK,
        lw=1.8,
        zorder=5,
        marker='.',
        ms=2.5,
    )
    _draw_meetings(axes, sortie, dict(flown), numbers, scenario)
    _draw_c3(axes, scenario)
    if sortie.returned_s is not None:
        axes.annotate(
            f'back at {sortie.returned_s:g} s',
            (scenario.c3.east_m, scenario.c3.north_m),
            (8, 4),
            textcoords='offset points',
            bbox={'boxstyle': 'round,pad=0.15', 'fc': 'white', 'ec': 'none', 'alpha': 0.85},
            fontsize=9,
            zorder=9,
        )
    handles: list[Line2D | Patch] = [
        Line2D([], [], color=BLACK, lw=1.8, label='UAV, flown'),
        Line2D(
            [], [], color=GREY, ls=(0, (5, 3)), marker='o', mfc='white', label='worst-case route'
        ),
        Line2D([], [], color=BLACK, marker='*', ls='none', ms=10, label='contact'),
        Line2D([], [], color=GREY, ls=':', lw=1.5, label='path before'),
        Line2D([], [], color=GREY, lw=2.2, label='path handed over'),
        Line2D([], [], marker='o', ms=11, mfc='none', mec=GREY, ls='none', label='radio range'),
        *unsurveyed,
    ]
    legend_below(figure, handles, 2)
    return figure


def _draw_meetings(
    axes: Axes,
    sortie: SortieSummary,
    flown: dict[float, Point],
    numbers: dict[str, int],
    scenario: Scenario,
) -> None:
    for meeting in sortie.meetings:
        colour = auv_colour(numbers[meeting.auv])
        cells = [scenario.region.centre(cell) for cell in meeting.path]
        if len(cells) > 1:
            east_m, north_m = _east_north(cells)
            axes.plot(east_m, north_m, color=colour, lw=2.2, zorder=3)
            axes.annotate(
                '',
                (east_m[-1], north_m[-1]),
                (east_m[-2], north_m[-2]),
                arrowprops={'arrowstyle': '-|>', 'color': colour, 'lw': 2.2, 'shrinkB': 0},
                zorder=3,
            )
        place = scenario.region.centre(meeting.cell)
        axes.plot(place.east_m, place.north_m, 'o', ms=7, color=colour, zorder=6)
        where = flown.get(meeting.time_s)
        if where is not None:
            axes.add_patch(
                Circle(
                    (where.east_m, where.north_m),
                    scenario.radio.range_m,
                    fill=False,
                    ec=colour,
                    lw=0.9,
                    zorder=2,
                )
            )
            axes.plot(where.east_m, where.north_m, '*', ms=11, color=BLACK, mec='white', zorder=7)
        # On the side away from the UAV, so that it hides neither the contact nor the flight there.
        is_below = where is not None and where.north_m > place.north_m
        axes.annotate(
            f'{auv_label(meeting.auv)}, {meeting.time_s:g} s',
            (place.east_m, place.north_m),
            (6, -6) if is_below else (6, 6),
            textcoords='offset points',
            va='top' if is_below else 'bottom',
            bbox={'boxstyle': 'round,pad=0.15', 'fc': 'white', 'ec': colour, 'lw': 0.8},
            fontsize=9,
            zorder=9,
        )


def draw_survey(record: MissionRecord, scenario: Scenario) -> Figure | None:
    """Draw the survey as delivered to C3: the latest value of every cell."""
    if not record.survey:
        return None
    region = scenario.region
    values = np.full((region.rows, region.cols), np.nan)
    for sample in sorted(record.survey.values(), key=lambda sample: sample.entered_s):
        values[region.index(sample.cell)] = sample.value
    unsurveyed = _unsurveyed_in_legend(record, scenario)
    figure, axes = _map(record, scenario, legend_rows=3 + len(unsurveyed))
    _hatch_region(axes, scenario)
    mesh = _mesh(axes, values, scenario, colormaps['cividis'])
    _draw_c3(axes, scenario)
    bar = figure.colorbar(mesh, ax=axes, location='bottom', shrink=0.7, aspect=30, pad=0.02)
    bar.set_label(_field_label(scenario))
    if unsurveyed:
        legend_below(figure, unsurveyed, 1)
    return figure


def _field_label(scenario: Scenario) -> str:
    if scenario.field.get('kind') == 'synthetic':
        return 'sea temperature (\N{DEGREE SIGN}C)'
    file = str(scenario.field.get('path', '')).rpartition('/')[2]
    return f'value (unit of {file})' if file else 'value'
