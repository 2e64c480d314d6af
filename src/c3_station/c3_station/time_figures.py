"""Figures over time: coverage, contact with the AUVs, their neglect, sorties and their limit."""

from __future__ import annotations

import math
from bisect import bisect_right
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from c3_station.figure_style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    PALE,
    SKY,
    VERMILLION,
    auv_label,
    legend_below,
    new_figure,
)
from c3_station.fleet_limits import fleet_limits
from c3_station.lower_bound import lower_bound_s
from c3_station.paper import EXPLORED_S, is_reference_mission
from c3_station.summary import c3_waits
from msgs_json.geometry import TOLERANCE, is_before
from msgs_json.messages import (
    CellEntered,
    ContactState,
    Met,
    Missed,
    Surfaced,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from c3_station.mission_record import MissionRecord
    from c3_station.scenario import Scenario
    from c3_station.summary import SortieSummary
    from msgs_json.geometry import Cell, GridSpec

Look = dict[str, Any]
"""How matplotlib draws something; it lists every key there is as its type."""

_UNDER_WATER: Look = {'facecolor': '#CFE6F5'}
_WAITING: Look = {'facecolor': VERMILLION}
_AT_C3: Look = {'facecolor': GREY}
_RECOVERED: Look = {
    'facecolor': '#DDDDDD',
    'hatch': '////',
    'edgecolor': 'white',
    'lw': 0.0,
}
_CONTACTS: dict[ContactState | None, tuple[str, Look]] = {
    ContactState.EXPECTED_SILENT: ('silent, as expected', _UNDER_WATER),
    ContactState.DUE: ('due', {'facecolor': SKY}),
    ContactState.OVERDUE: (
        'overdue',
        {'facecolor': VERMILLION, 'hatch': 'xxx', 'edgecolor': 'white', 'lw': 0.0},
    ),
    ContactState.LOST: ('lost', {'facecolor': BLACK}),
    None: ('up for recovery', _RECOVERED),
}
"""How what C3 makes of an AUV's silence is named and drawn."""
_MET: Look = {'marker': 'o', 'mfc': 'white', 'mec': BLACK, 'mew': 1.0, 'ls': 'none'}
_MISSED: Look = {'marker': 'X', 'mfc': BLACK, 'mec': 'white', 'mew': 0.7, 'ls': 'none'}
_BROKEN_OFF: Look = {'marker': '<', 'mfc': 'white', 'mec': BLACK, 'mew': 1.0, 'ls': 'none'}


def draw_coverage(record: MissionRecord, scenario: Scenario) -> Figure | None:
    """Draw the share of cells entered and delivered over time, with what bounds them."""
    regions = record.regions(scenario)
    entered = _entered(record, regions)
    if not entered:
        return None
    end_s = _end_s(record, scenario)
    figure, axes = new_figure(3.7)
    if len(regions) == 1:  # the bound is that of the region as it was ordered
        bound_s, bound = _best_coverage(scenario)
        label = f'no planner is faster ({bound_s[-1]:g} s)'
        look: Look = {'color': GREY, 'lw': 1.0, 'ls': (0, (4, 2)), 'label': label}
        _steps(axes, list(zip(bound_s, bound, strict=True)), end_s, look)
    label = 'entered by an AUV' + _all_at(record.summary.explored_s)
    _steps(axes, entered, end_s, {'color': BLUE, 'lw': 2.0, 'label': label})
    delivered = [(0.0, 0.0), *((time_s, 100.0 * share) for time_s, share in record.delivered)]
    label = 'delivered to C3' + _all_at(record.summary.delivered_s)
    _steps(
        axes, delivered, end_s, {'color': GREEN, 'lw': 2.0, 'ls': (0, (5, 1.5)), 'label': label}
    )
    for number, (changed_s, _) in enumerate(regions[1:]):
        label = '' if number else 'region changed by the operator'
        axes.axvline(changed_s, color=VERMILLION, lw=1.2, ls='-.', label=label)
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


def _steps(axes: Axes, points: list[tuple[float, float]], end_s: float, look: Look) -> None:
    """Draw what stays as it is from each point on, up to the end."""
    times_s, values = zip(*points, strict=True)
    axes.step([*times_s, end_s], [*values, values[-1]], where='post', **look)


def _entered(
    record: MissionRecord, regions: Sequence[tuple[float, GridSpec]]
) -> list[tuple[float, float]]:
    """Return the share of the cells that were entered, of the region as it was at each time, %."""
    first_entered_s: dict[Cell, float] = {}
    for each in record.events:
        if isinstance(each.event, CellEntered):
            first_entered_s.setdefault(each.event.cell, each.stamp_s)
    if not first_entered_s:
        return []
    shares = []
    ends_s = [*(from_s for from_s, _ in regions[1:]), math.inf]
    for (from_s, region), end_s in zip(regions, ends_s, strict=True):
        entered_s = sorted(
            time_s
            for cell, time_s in first_entered_s.items()
            if time_s < end_s and region.contains(cell)
        )
        first = bisect_right(entered_s, from_s)
        later = enumerate(entered_s[first:], first + 1)
        counts = [(from_s, first), *((time_s, count) for count, time_s in later)]
        shares += [(time_s, 100.0 * count / region.cells_total) for time_s, count in counts]
    return shares


def _end_s(record: MissionRecord, scenario: Scenario) -> float:
    """Return when the record ends, one tick after its beginning at the earliest."""
    return max([scenario.tick_s, *(track.times_s[-1] for track in record.tracks.values())])


def _all_at(time_s: float | None) -> str:
    return '' if time_s is None else f' (all at {time_s:g} s)'


def _best_coverage(scenario: Scenario) -> tuple[list[float], list[float]]:
    """
    Return the share of cells that can have been entered at most, up to the lower bound.

    Without a thought of the UAV, but for the last cell: that is what the bound is about.
    """
    cells_total = scenario.region.cells_total
    starts = len({auv.initial_path[0] for auv in scenario.auvs})
    bound_s = lower_bound_s(scenario)
    cells_s = [auv.cell_ticks * scenario.tick_s for auv in fleet_limits(scenario).auvs]
    entries_s = sorted(
        count * cell_s
        for cell_s in cells_s
        for count in range(1, int(bound_s / cell_s * (1 + TOLERANCE)) + 1)
    )
    shares = [
        100.0 * min(1.0 - 1.0 / cells_total, (starts + count) / cells_total)
        for count in range(len(entries_s) + 1)
    ]
    return [0.0, *entries_s, bound_s], [*shares, 100.0]


def _rows(labels: list[str], end_s: float, legend_rows: int) -> tuple[Figure, Axes]:
    """Return axes over time with a row for each label, from above."""
    figure, axes = new_figure(0.85 + 0.2 * legend_rows + 0.42 * len(labels))
    axes.set_yticks(range(len(labels)), labels)
    axes.set_ylim(len(labels) - 0.5, -0.5)
    axes.set_xlim(0.0, end_s)
    axes.set_xlabel('time (s)')
    return figure, axes


def _fill(axes: Axes, row: int, spans: list[tuple[float, float]], look: Look) -> None:
    """Fill spans of a row, each given by its beginning and its length, seconds."""
    axes.broken_barh(spans, (row - 0.3, 0.6), **look)


def draw_contacts(record: MissionRecord, scenario: Scenario) -> Figure | None:
    """Draw what C3 made of each AUV's silence, with the meetings and the searches in vain."""
    names = [auv.name for auv in scenario.auvs if auv.name in record.contacts]
    if not names:
        return None
    end_s = _end_s(record, scenario)
    seen = {contact for name in names for _, contact in record.contacts[name]}
    handles: list[Line2D | Patch] = [
        Patch(label=label, **look)
        for contact, (label, look) in _CONTACTS.items()
        if contact in seen
    ]
    handles.append(Line2D([], [], ms=5, label='met', **_MET))
    if record.summary.missed_total:
        handles.append(Line2D([], [], ms=8, label='searched in vain', **_MISSED))
    figure, axes = _rows([auv_label(name) for name in names], end_s, -(-len(handles) // 3))
    for row, name in enumerate(names):
        changes = (*record.contacts[name], (end_s, None))
        for contact, (_, look) in _CONTACTS.items():
            spans = [
                (begin_s, stop_s - begin_s)
                for (begin_s, state), (stop_s, _) in pairwise(changes)
                if state is contact
            ]
            _fill(axes, row, spans, look)
        for kind, size, look in ((Met, 4.0, _MET), (Missed, 7.0, _MISSED)):
            times_s = [
                each.stamp_s
                for each in record.events
                if isinstance(each.event, kind) and each.event.auv == name
            ]
            axes.plot(times_s, [row] * len(times_s), ms=size, zorder=3, **look)
    legend_below(figure, handles, 3)
    return figure


def draw_neglect(record: MissionRecord, scenario: Scenario) -> Figure | None:
    """Draw when each AUV waited at the surface for the UAV, and when the UAV waited at C3."""
    names = [auv.name for auv in scenario.auvs if auv.name in record.tracks]
    if not names:
        return None
    end_s = _end_s(record, scenario)
    explored_s = record.summary.explored_s
    figure, axes = _rows([*map(auv_label, names), 'UAV'], end_s, 3)
    for row, name in enumerate(names):
        _fill(axes, row, [(0.0, end_s)], _UNDER_WATER)
        recovered_s = _recovered_s(record, name)
        if recovered_s is not None:
            _fill(axes, row, [(recovered_s, end_s - recovered_s)], _RECOVERED)
        _fill(axes, row, _waits(record, name, end_s), _WAITING)
        neglect_s = record.summary.neglect_s.get(name, 0.0)
        share = f' ({100.0 * neglect_s / explored_s:.1f} %)' if explored_s else ''
        _annotate_row(axes, row, f'{neglect_s:g} s{share}')
    _fill(axes, len(names), c3_waits(record.summary.sorties), _AT_C3)
    _annotate_row(axes, len(names), f'{record.summary.c3_wait_s:g} s')
    if explored_s is not None:
        axes.axvline(explored_s, color=BLACK, lw=1.2, ls='--')
    handles: list[Line2D | Patch] = [
        Patch(label='under water', **_UNDER_WATER),
        Patch(label='waiting, surfaced', **_WAITING),
        Patch(label='up for recovery', **_RECOVERED),
        Patch(label='UAV waiting at C3', **_AT_C3),
    ]
    if explored_s is not None:
        handles.append(
            Line2D([], [], color=BLACK, lw=1.2, ls='--', label=f'explored ({explored_s:g} s)')
        )
    legend_below(figure, handles, 2)
    return figure


def _annotate_row(axes: Axes, row: int, text: str) -> None:
    """Put a figure to the right of a row."""
    axes.annotate(
        text,
        (1.0, row),
        (5, 0),
        xycoords=('axes fraction', 'data'),
        textcoords='offset points',
        va='center',
        fontsize=9,
        annotation_clip=False,
    )


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
    figure, axes = new_figure(3.9)
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
    missed = [sortie.index for sortie in sorties if sortie.missed]
    broken_off = [sortie.index for sortie in sorties if sortie.not_reached]
    foot_s = 0.04 * max(sortie.limit_s for sortie in sorties)
    axes.plot(missed, [foot_s] * len(missed), ms=1.2 * size, **_MISSED)
    axes.plot(broken_off, [2.5 * foot_s] * len(broken_off), ms=1.2 * size, **_BROKEN_OFF)
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
    limits_s = sorted({sortie.limit_s for sortie in sorties})
    _draw_limits(axes, sorties)
    highest_s = max(
        limits_s[-1],
        *(max(sortie.worst_case_s, sortie.duration_s or 0.0) for sortie in sorties),
    )
    axes.set_ylim(0.0, 1.08 * highest_s)
    axes.set_xlim(0.4, numbers[-1] + 0.6)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True, nbins=12))
    axes.set_xlabel('sortie')
    axes.set_ylabel('duration (s)')
    axes.grid(axis='y', color=PALE, lw=0.6)
    axes.set_axisbelow(True)
    said = ' to '.join(f'{limit_s:g}' for limit_s in dict.fromkeys((limits_s[0], limits_s[-1])))
    handles: list[Line2D | Patch] = [
        Patch(facecolor=SKY, label='flown'),
        Line2D([], [], color=VERMILLION, lw=1.4, ls='--', label=f'limit L = {said} s'),
        Line2D([], [], marker='D', mfc='white', mec=BLACK, ls='none', label='worst case'),
        Line2D([], [], marker='_', color=BLUE, ms=12, mew=2.2, ls='none', label='planned'),
    ]
    if record.summary.sortie_limit_violations:
        late_flight = Patch(facecolor=VERMILLION, hatch='////', edgecolor='white')
        late_flight.set_label('flown, over the limit')
        handles.append(late_flight)
    if missed:
        handles.append(Line2D([], [], ms=8, label='an AUV searched in vain', **_MISSED))
    if broken_off:
        handles.append(Line2D([], [], ms=7, label='search broken off', **_BROKEN_OFF))
    legend_below(figure, handles, 2)
    return figure


def _draw_limits(axes: Axes, sorties: Sequence[SortieSummary]) -> None:
    """Draw the limit by which each sortie departed; the operator may have changed it."""
    starts = [sortie.index - 0.5 for sortie in sorties]
    limits = [(start, sortie.limit_s) for start, sortie in zip(starts, sorties, strict=True)]
    limits[0] = (starts[0] - 0.1, sorties[0].limit_s)
    _steps(axes, limits, starts[-1] + 1.1, {'color': VERMILLION, 'lw': 1.4, 'ls': '--'})
