"""
The figures of a report: pure functions from a mission's record to matplotlib figures.

Drawn 5 inches wide in 10 point type, so that they can be read on a telephone. Colours are those
of Okabe and Ito, told apart with any colour vision, and never the only difference.
"""

from __future__ import annotations

from dataclasses import dataclass
from io import BytesIO
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, Rectangle
from matplotlib.ticker import MaxNLocator

from c3_station.node_params import UAV
from c3_station.paper import EXPLORED_S, is_reference_mission
from c3_station.summary import lower_bound_s
from msgs_json.geometry import TOLERANCE, Point, is_before
from msgs_json.messages import CellEntered, Met, SamplesDelivered, Surfaced

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from c3_station.mission_record import MissionRecord, Track
    from c3_station.scenario import Scenario
    from c3_station.summary import SortieSummary
    from msgs_json.geometry import Cell

BLUE, ORANGE, GREEN = '#0072B2', '#E69F00', '#009E73'
PURPLE, SKY, VERMILLION = '#CC79A7', '#56B4E9', '#D55E00'
BLACK, GREY, PALE = '#000000', '#767676', '#E4E4E4'

AUV_COLOURS = (BLUE, ORANGE, GREEN, PURPLE, SKY, VERMILLION)
AUV_LINES = ('-', '--', ':')
"""With more AUVs than colours, the next round of colours is drawn with the next line."""

WIDTH_IN = 5.0
DPI = 200

STYLE: Any = {  # matplotlib lists every key there is as its type
    'font.size': 10,
    'axes.spines.top': False,
    'axes.spines.right': False,
    'axes.edgecolor': GREY,
    'axes.linewidth': 0.8,
    'xtick.color': '#333333',
    'ytick.color': '#333333',
    'legend.frameon': False,
    'legend.fontsize': 9,
    'figure.facecolor': 'white',
}

ARROWS_TOTAL = 150
"""About as many arrow heads as a map of routes bears."""
FINE_CELLS = 400
"""A map with more cells than that is drawn with finer lines."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawnFigure:
    """A figure, ready to be written and shown."""

    name: str
    title: str
    caption: str
    png: bytes


def draw_figures(record: MissionRecord) -> tuple[DrawnFigure, ...]:
    """Return all figures of a mission; those for which the record holds nothing are left out."""
    if record.scenario is None:
        return ()
    drawn = []
    with mpl.rc_context(STYLE):
        for name, title, caption, draw in _FIGURES:
            figure = draw(record, record.scenario)
            if figure is not None:
                file = BytesIO()
                figure.savefig(file, format='png', dpi=DPI)
                drawn.append(
                    DrawnFigure(name=name, title=title, caption=caption, png=file.getvalue())
                )
    return tuple(drawn)


def _figure(height_in: float) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(WIDTH_IN, height_in), layout='constrained')
    return figure, figure.subplots()


def _colour(number: int) -> str:
    return AUV_COLOURS[number % len(AUV_COLOURS)]


def _line(number: int) -> str:
    return AUV_LINES[number // len(AUV_COLOURS) % len(AUV_LINES)]


def auv_label(name: str) -> str:
    """Return an AUV's name as in the paper: A1 for auv_1."""
    return name.replace('auv_', 'A') if name.startswith('auv_') else name


# --- maps ----------------------------------------------------------------------------------------


def _map(scenario: Scenario, *, legend_rows: int) -> tuple[Figure, Axes]:
    """Return axes over the region and C3, with the grid of cells."""
    region = scenario.region
    width_m, height_m = region.cols * region.cell_m, region.rows * region.cell_m
    margin_m = 0.04 * max(width_m, height_m)
    west_m, east_m = min(0.0, scenario.c3.east_m), max(width_m, scenario.c3.east_m)
    south_m, north_m = min(0.0, scenario.c3.north_m), max(height_m, scenario.c3.north_m)
    shape = (north_m - south_m + 2 * margin_m) / (east_m - west_m + 2 * margin_m)
    height_in = min(max(WIDTH_IN * 0.86 * shape, 2.5), 8.0) + 0.5 + 0.22 * legend_rows
    figure, axes = _figure(height_in)
    for col in range(region.cols + 1):
        axes.plot([col * region.cell_m] * 2, [0.0, height_m], color=PALE, lw=0.6, zorder=0)
    for row in range(region.rows + 1):
        axes.plot([0.0, width_m], [row * region.cell_m] * 2, color=PALE, lw=0.6, zorder=0)
    axes.set_xlim(west_m - margin_m, east_m + margin_m)
    axes.set_ylim(south_m - margin_m, north_m + margin_m)
    axes.set_aspect('equal')
    axes.set_xlabel('east (m)')
    axes.set_ylabel('north (m)')
    return figure, axes


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


def _below(figure: Figure, handles: list[Line2D | Patch], columns: int) -> None:
    """Put a legend under the axes, to be read row by row (matplotlib fills column by column)."""
    rows = -(-len(handles) // columns)
    padded = [*handles, *(Line2D([], [], ls='none', label=' ') for _ in range(columns - 1))]
    figure.legend(
        handles=[padded[row * columns + col] for col in range(columns) for row in range(rows)],
        loc='outside lower center',
        ncols=columns,
        handlelength=1.8,
        columnspacing=1.2,
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
        Line2D([], [], color=_colour(number), ls=_line(number), lw=1.6, label=auv_label(name))
        for number, name, _ in auvs
    ]
    handles += [
        Line2D([], [], color=GREY, marker='o', mfc='white', ls='none', ms=8, label='start'),
        Line2D([], [], color=GREY, marker='X', ls='none', ms=7, label='end'),
        Line2D([], [], color=BLACK, marker='s', ls='none', ms=8, label='C3'),
    ]
    columns = 6 if len(handles) % 6 < 2 else 4
    figure, axes = _map(scenario, legend_rows=-(-len(handles) // columns))
    _shade_not_entered(axes, record, scenario)
    cell_m = scenario.region.cell_m
    width = 1.5 if scenario.region.cells_total <= FINE_CELLS else 1.0
    for number, _, track in auvs:
        # Side by side where several AUVs pass through the same cells.
        shift_m = (number - (len(scenario.auvs) - 1) / 2) * 0.6 * cell_m / len(scenario.auvs)
        line = _keeping_right(_cell_centres(track, record.summary.explored_s), 0.06 * cell_m)
        line += complex(shift_m, shift_m)
        colour = _colour(number)
        axes.plot(line.real, line.imag, color=colour, ls=_line(number), lw=width, zorder=3)
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
    _below(figure, handles, columns)
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


def _shade_not_entered(axes: Axes, record: MissionRecord, scenario: Scenario) -> None:
    entered = {each.event.cell for each in record.events if isinstance(each.event, CellEntered)}
    cells = [
        (col, row)
        for col in range(scenario.region.cols)
        for row in range(scenario.region.rows)
        if (col, row) not in entered
    ]
    _hatch(axes, cells, scenario)


def _hatch(axes: Axes, cells: list[Cell], scenario: Scenario) -> None:
    """Mark cells for which there is nothing."""
    cell_m = scenario.region.cell_m
    squares = [Rectangle((col * cell_m, row * cell_m), cell_m, cell_m) for col, row in cells]
    axes.add_collection(
        PatchCollection(
            squares, facecolor='#F4F4F4', edgecolor='#BBBBBB', hatch='////', lw=0, zorder=0.5
        )
    )


def draw_first_sortie(record: MissionRecord, scenario: Scenario) -> Figure | None:
    """Draw the first sortie: route, flight, contacts and new paths, as Figs. 4 to 6."""
    track = record.tracks.get(UAV)
    if not record.summary.sorties or not record.routes or track is None:
        return None
    sortie = record.summary.sorties[0]
    figure, axes = _map(scenario, legend_rows=3)
    numbers = {auv.name: number for number, auv in enumerate(scenario.auvs)}
    for number, auv in enumerate(scenario.auvs):
        cells = [scenario.region.centre(cell) for cell in auv.initial_path]
        axes.plot(*_east_north(cells), color=_colour(number), lw=1.5, ls=':', zorder=3)
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
    ]
    _below(figure, handles, 2)
    return figure


def _draw_meetings(
    axes: Axes,
    sortie: SortieSummary,
    flown: dict[float, Point],
    numbers: dict[str, int],
    scenario: Scenario,
) -> None:
    for meeting in sortie.meetings:
        colour = _colour(numbers[meeting.auv])
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
    figure, axes = _map(scenario, legend_rows=3)
    mesh = axes.pcolormesh(
        np.arange(region.cols + 1) * region.cell_m,
        np.arange(region.rows + 1) * region.cell_m,
        values,
        cmap='cividis',
        zorder=1,
    )
    missing = [(int(col), int(row)) for row, col in np.argwhere(np.isnan(values))]
    _hatch(axes, missing, scenario)
    _draw_c3(axes, scenario)
    bar = figure.colorbar(mesh, ax=axes, location='bottom', shrink=0.7, aspect=30, pad=0.02)
    bar.set_label(_field_label(scenario))
    return figure


def _field_label(scenario: Scenario) -> str:
    if scenario.field.get('kind') == 'synthetic':
        return 'sea temperature (\N{DEGREE SIGN}C)'
    file = str(scenario.field.get('path', '')).rpartition('/')[2]
    return f'value (unit of {file})' if file else 'value'


# --- time series ---------------------------------------------------------------------------------


def draw_coverage(record: MissionRecord, scenario: Scenario) -> Figure | None:
    """Draw the share of cells entered and delivered over time, with what bounds them."""
    cells_total = scenario.region.cells_total
    first_entered_s: dict[Cell, float] = {}
    for each in record.events:
        if isinstance(each.event, CellEntered):
            first_entered_s.setdefault(each.event.cell, each.stamp_s)
    if not first_entered_s:
        return None
    deliveries = [
        (each.stamp_s, each.event.cells_delivered)
        for each in record.events
        if isinstance(each.event, SamplesDelivered)
    ]
    end_s = _end_s(record, scenario)
    figure, axes = _figure(3.7)
    bound_s, bound = _best_coverage(scenario)
    axes.step(
        [*bound_s, end_s],
        [*bound, bound[-1]],
        where='post',
        color=GREY,
        lw=1.0,
        ls=(0, (4, 2)),
        label=f'no planner is faster ({bound_s[-1]:g} s)',
    )
    entered_s = sorted(first_entered_s.values())
    entered = [100.0 * (count + 1) / cells_total for count in range(len(entered_s))]
    axes.step(
        [*entered_s, end_s],
        [*entered, entered[-1]],
        where='post',
        color=BLUE,
        lw=2.0,
        label='entered by an AUV' + _all_at(record.summary.explored_s),
    )
    delivered_s = [0.0, *(time_s for time_s, _ in deliveries), end_s]
    delivered = [0.0, *(100.0 * cells / cells_total for _, cells in deliveries)]
    axes.step(
        delivered_s,
        [*delivered, delivered[-1]],
        where='post',
        color=GREEN,
        lw=2.0,
        ls=(0, (5, 1.5)),
        label='delivered to C3' + _all_at(record.summary.delivered_s),
    )
    if is_reference_mission(scenario):
        axes.axvline(EXPLORED_S, color=VERMILLION, lw=1.4, ls=':')
        axes.plot([], [], color=VERMILLION, lw=1.4, ls=':', label=f'ECC 2009 ({EXPLORED_S:g} s)')
    axes.set_xlim(0.0, end_s)
    axes.set_ylim(0.0, 103.0)
    axes.set_xlabel('time (s)')
    axes.set_ylabel('cells (%)')
    axes.grid(color=PALE, lw=0.6)
    axes.set_axisbelow(True)
    figure.legend(loc='outside lower center', ncols=2, columnspacing=1.2)
    return figure


def _end_s(record: MissionRecord, scenario: Scenario) -> float:
    """Return when the record ends, one tick after its beginning at the earliest."""
    return max([scenario.tick_s, *(track.times_s[-1] for track in record.tracks.values())])


def _all_at(time_s: float | None) -> str:
    return '' if time_s is None else f' (all at {time_s:g} s)'


def _best_coverage(scenario: Scenario) -> tuple[list[float], list[float]]:
    """Return the share of cells that can have been entered at most, up to the lower bound."""
    cells_total = scenario.region.cells_total
    starts = len({auv.initial_path[0] for auv in scenario.auvs})
    bound_s = lower_bound_s(scenario)
    entries_s = sorted(
        count * scenario.region.cell_m / auv.speed_mps
        for auv in scenario.auvs
        for count in range(
            1, int(bound_s * auv.speed_mps / scenario.region.cell_m * (1 + TOLERANCE)) + 1
        )
    )
    times_s = [0.0, *entries_s]
    return times_s, [
        100.0 * min(1.0, (starts + count) / cells_total) for count in range(len(times_s))
    ]


def draw_neglect(record: MissionRecord, scenario: Scenario) -> Figure | None:
    """Draw when each AUV was under water and when it waited at the surface for the UAV."""
    names = [auv.name for auv in scenario.auvs if auv.name in record.tracks]
    if not names:
        return None
    end_s = _end_s(record, scenario)
    explored_s = record.summary.explored_s
    figure, axes = _figure(1.5 + 0.42 * len(names))
    for place, name in enumerate(names):
        axes.broken_barh([(0.0, end_s)], (place - 0.3, 0.6), facecolor='#CFE6F5')
        recovered_s = _recovered_s(record, name)
        if recovered_s is not None:
            axes.broken_barh(
                [(recovered_s, end_s - recovered_s)],
                (place - 0.3, 0.6),
                facecolor='#DDDDDD',
                hatch='////',
                edgecolor='white',
            )
        waits = _waits(record, name, end_s)
        axes.broken_barh(waits, (place - 0.3, 0.6), facecolor=VERMILLION)
        neglect_s = record.summary.neglect_s.get(name, 0.0)
        share = f' ({100.0 * neglect_s / explored_s:.1f} %)' if explored_s else ''
        axes.annotate(
            f'{neglect_s:g} s{share}',
            (1.0, place),
            (5, 0),
            xycoords=('axes fraction', 'data'),
            textcoords='offset points',
            va='center',
            fontsize=9,
            annotation_clip=False,
        )
    if explored_s is not None:
        axes.axvline(explored_s, color=BLACK, lw=1.2, ls='--')
    axes.set_yticks(range(len(names)), [auv_label(name) for name in names])
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.set_xlim(0.0, end_s)
    axes.set_xlabel('time (s)')
    handles: list[Line2D | Patch] = [
        Patch(facecolor='#CFE6F5', label='under water'),
        Patch(facecolor=VERMILLION, label='waiting, surfaced'),
        Patch(facecolor='#DDDDDD', hatch='////', edgecolor='white', label='up for recovery'),
    ]
    if explored_s is not None:
        handles.append(
            Line2D([], [], color=BLACK, lw=1.2, ls='--', label=f'explored ({explored_s:g} s)')
        )
    _below(figure, handles, 2)
    return figure


def _waits(record: MissionRecord, auv: str, end_s: float) -> list[tuple[float, float]]:
    """Return when an AUV surfaced to wait for the UAV, and how long it waited, seconds."""
    met_s = {
        each.event.leg_id: each.stamp_s
        for each in record.events
        if isinstance(each.event, Met) and each.event.auv == auv
    }
    return [
        (each.stamp_s, met_s.get(each.event.leg_id, end_s) - each.stamp_s)
        for each in record.events
        if isinstance(each.event, Surfaced) and each.source == auv
    ]


def _recovered_s(record: MissionRecord, auv: str) -> float | None:
    """Return when an AUV was met for the last time and stayed up."""
    return next(
        (
            each.stamp_s
            for each in record.events
            if isinstance(each.event, Met) and each.event.auv == auv and not each.event.path
        ),
        None,
    )


def draw_sorties(record: MissionRecord, scenario: Scenario) -> Figure | None:
    """Draw how long each sortie took, what was foreseen, and the limit."""
    sorties = record.summary.sorties
    if not sorties:
        return None
    figure, axes = _figure(3.9)
    numbers = [sortie.index for sortie in sorties]
    for sortie in sorties:
        if sortie.duration_s is not None:
            late = is_before(sortie.limit_s, sortie.duration_s)
            axes.bar(
                sortie.index,
                sortie.duration_s,
                width=0.62,
                color=VERMILLION if late else SKY,
                hatch='////' if late else None,
                edgecolor='white',
                lw=0.0,
            )
    size = 6.0 if len(sorties) <= 25 else 3.5
    axes.plot(
        numbers,
        [sortie.worst_case_s for sortie in sorties],
        'D',
        ms=size,
        mfc='white',
        mec=BLACK,
        mew=1.1,
        ls='none',
    )
    axes.plot(
        numbers,
        [sortie.predicted_s for sortie in sorties],
        '_',
        ms=2.2 * size,
        mew=2.2,
        color=BLUE,
        ls='none',
    )
    limit_s = scenario.sortie.limit_s
    axes.axhline(limit_s, color=VERMILLION, lw=1.4, ls='--')
    highest_s = max(
        limit_s,
        *(max(sortie.worst_case_s, sortie.duration_s or 0.0) for sortie in sorties),
    )
    axes.set_ylim(0.0, 1.08 * highest_s)
    axes.set_xlim(0.4, numbers[-1] + 0.6)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True, nbins=12))
    axes.set_xlabel('sortie')
    axes.set_ylabel('duration (s)')
    axes.grid(axis='y', color=PALE, lw=0.6)
    axes.set_axisbelow(True)
    handles: list[Line2D | Patch] = [
        Patch(facecolor=SKY, label='flown'),
        Line2D([], [], color=VERMILLION, lw=1.4, ls='--', label=f'limit L = {limit_s:g} s'),
        Line2D([], [], marker='D', mfc='white', mec=BLACK, ls='none', label='worst case'),
        Line2D([], [], marker='_', color=BLUE, ms=12, mew=2.2, ls='none', label='planned'),
    ]
    if record.summary.sortie_limit_violations:
        late_flight = Patch(facecolor=VERMILLION, hatch='////', edgecolor='white')
        late_flight.set_label('flown, over the limit')
        handles.append(late_flight)
    _below(figure, handles, 2)
    return figure


_FIGURES: tuple[tuple[str, str, str, Callable[[MissionRecord, Scenario], Figure | None]], ...] = (
    (
        'routes',
        'Routes of the AUVs',
        'Until the region is explored; lines are set side by side where routes meet. Hatched cells'
        ' were not entered. Compare Fig. 7(b) of ECC 2009.',
        draw_routes,
    ),
    (
        'first_sortie',
        'The first sortie',
        'The UAV meets each AUV the moment it hears it, hands over the next path, and flies on to'
        ' the first waypoint of the next AUV. Compare Figs. 4 to 6 of ECC 2009.',
        draw_first_sortie,
    ),
    (
        'coverage',
        'Coverage over time',
        'What is entered is known to C3 only once the UAV is back with the data.',
        draw_coverage,
    ),
    (
        'neglect',
        'Neglect time',
        'An AUV that has surfaced waits for the UAV and does not survey; counted until the region'
        ' is explored.',
        draw_neglect,
    ),
    (
        'sorties',
        'Sorties against their limit',
        'The worst case is that of the whole route at departure: every AUV where the search ends,'
        " every wait included. What is planned is the planner's own figure.",
        draw_sorties,
    ),
    (
        'survey',
        'The survey at C3',
        'Latest sample of each cell among those delivered; hatched cells have none.',
        draw_survey,
    ),
)
