"""Figures over time: coverage, neglect of the AUVs, sorties against their limit."""

from __future__ import annotations

from typing import TYPE_CHECKING

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
from c3_station.paper import EXPLORED_S, is_reference_mission
from c3_station.summary import lower_bound_s
from msgs_json.geometry import TOLERANCE, is_before
from msgs_json.messages import CellEntered, Met, SamplesDelivered, Surfaced

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from c3_station.mission_record import MissionRecord
    from c3_station.scenario import Scenario
    from msgs_json.geometry import Cell


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
    figure, axes = new_figure(3.7)
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
    figure, axes = new_figure(1.5 + 0.42 * len(names))
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
    legend_below(figure, handles, 2)
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
    legend_below(figure, handles, 2)
    return figure
