"""
Random scenarios that can be flown: feasible by construction, the same seed the same scenario.

Whatever is drawn, a planner that guarantees the sortie limit takes the mission and can explore all
of it: the radio reaches across a cell, the region is in one piece, and L leaves room to search the
initial paths of all AUVs and to get into every corner.
"""

from __future__ import annotations

import itertools
import math
import re
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import msgspec

from c3_station.coast_generator import draw_coast
from c3_station.scenario import (
    Auv,
    Limits,
    PassConditions,
    PlannerChoice,
    Radio,
    Scenario,
    Sortie,
    Uav,
)
from c3_station.shape_checks import nearest
from msgs_json.geometry import Cell, GridSpec, Point
from msgs_json.randomness import agent_rng
from uav_planner.candidate_paths import SEARCHED_MOVES_MAX
from uav_planner.guarantee import least_limit_s
from uav_planner.planning import MissionSpec, SurveyLeg

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    import numpy as np

_PLANNER = 'robust'
_AT_THE_EDGE = 0.2
"""How often a quantity is as small as it may be: there things fail first."""
_TO_SPARE = 1.2
"""
L over what a sortie to the cell farthest from C3 takes.

With less than 1 nobody ever gets there. With hardly more, all other AUVs would have to lie just on
the way.
"""
_TICKS_TO_SPARE = 2
"""Beyond that: where a sortie takes but a few ticks, each AUV beside the way costs one more."""
_NO_LIMIT_S = 1e12
"""Longer than any sortie: what stands for L until it is drawn."""
_WITH_LAND = 0.3
"""How often part of the region is masked unless that is asked for."""
_GENEROUS = 20
"""The hard stop over the time of a mission in which every move enters a new cell."""
_NUMBER = r'\d+(?:\.\d*)?(?:[eE][-+]?\d+)?'
_DRAWS = 200
"""How often all is drawn anew where an L that was asked for is too short for it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Span:
    """A closed interval in which a quantity lies."""

    least: float
    most: float

    def __str__(self) -> str:
        """Return the span as it is typed."""
        least, most = f'{self.least:.12g}', f'{self.most:.12g}'
        return least if least == most else f'{least}-{most}'


def read_span(text: str) -> Span:
    """
    Return the span of a text such as ``5-20`` or ``12.5``.

    Raises
    ------
    ValueError
        It has no such form.

    """
    found = re.fullmatch(rf'({_NUMBER})(?:-({_NUMBER}))?', text)
    if found is None:
        raise ValueError(f'must be a number or two of them such as 5-20, is {text!r}')
    least, most = found.groups()
    return Span(least=float(least), most=float(most or least))


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """Something that is drawn for a scenario, and that a person may ask for."""

    meaning: str
    allowed: Span
    usual: Span | None = None
    """Where it lies unless asked for; None where that follows from others."""
    is_whole: bool = False


QUANTITIES: Mapping[str, Quantity] = MappingProxyType(
    {
        'cols': Quantity(
            meaning='cells from west to east',
            allowed=Span(least=1, most=200),
            usual=Span(least=5, most=20),
            is_whole=True,
        ),
        'rows': Quantity(
            meaning='cells from south to north',
            allowed=Span(least=1, most=200),
            usual=Span(least=5, most=20),
            is_whole=True,
        ),
        'masked': Quantity(
            meaning='share of cells that are masked (land, no-go); 0 in 7 of 10 unless asked for',
            allowed=Span(least=0, most=0.6),
        ),
        'cell': Quantity(
            meaning='width of a cell, metres',
            allowed=Span(least=0.1, most=1000),
            usual=Span(least=5, most=50),
        ),
        'range': Quantity(
            meaning='radio range R, metres; 1 to 4 cells unless asked for',
            allowed=Span(least=0.1, most=1e5),
        ),
        'auvs': Quantity(
            meaning='number of AUVs',
            allowed=Span(least=1, most=200),
            usual=Span(least=1, most=6),
            is_whole=True,
        ),
        'path-cells': Quantity(
            meaning='moves of a full path, q',
            allowed=Span(least=1, most=SEARCHED_MOVES_MAX),
            usual=Span(least=2, most=7),
            is_whole=True,
        ),
        'min-path-cells': Quantity(
            meaning='moves of the shortest path, Delta, at most q',
            allowed=Span(least=1, most=SEARCHED_MOVES_MAX),
            usual=Span(least=1, most=3),
            is_whole=True,
        ),
        'tick': Quantity(
            meaning='length of a tick, seconds; 2 to 12 of them for a cell unless asked for',
            allowed=Span(least=0.001, most=3600),
        ),
        'limit': Quantity(
            meaning='sortie limit L, seconds; 1 to 2 times the least unless asked for',
            allowed=Span(least=0.001, most=1e6),
        ),
    }
)
"""What may be asked for, by name."""

USUAL_MODELS = ('on_time', 'early', 'slow')
"""Surfacing models with which every AUV is found on its path, and the mission comes to its end."""


def generate_scenario(
    seed: int,
    asked: Mapping[str, Span] = MappingProxyType({}),
    models: Sequence[str] = USUAL_MODELS,
) -> Scenario:
    """
    Return a random scenario; it depends on the arguments alone.

    Parameters
    ----------
    seed
        Of what is drawn, and of the mission itself.
    asked
        Where quantities must lie, by their names in `QUANTITIES`.
    models
        The surfacing models, by their names in `MODELS`, of which each AUV gets one.

    Raises
    ------
    ValueError
        Something that is asked for does not exist, is not allowed, or does not go together.

    """
    _check(seed, asked, models)
    draw = _Draw(agent_rng(seed, 'scenario'), asked)
    # Of its own: what is drawn for a scenario without land is what was drawn before there was any.
    coast = _Draw(agent_rng(seed, 'coast'), asked)
    mission, paths, speeds_mps = _draw_mission(draw, coast)
    margin_s = draw.seldom(Span(least=0, most=mission.grid.cell_m / max(speeds_mps)))
    legs = math.ceil(mission.grid.cells_total / (len(speeds_mps) * mission.path_cells))
    leg_s = mission.path_cells * mission.grid.cell_m / min(speeds_mps) + margin_s
    survey_s = legs * (leg_s + mission.sortie_limit_s)
    return Scenario(
        name=f'generated_{seed}',
        description=f'Drawn with seed {seed}, feasible by construction',
        region=mission.grid,
        c3=mission.c3,
        uav=Uav(speed_mps=mission.uav_speed_mps),
        auvs=tuple(
            Auv(
                name=f'auv_{number}',
                initial_path=path,
                speed_mps=speed_mps,
                surfacing=_draw_surfacing(draw, models, speed_mps, survey_s),
            )
            for number, (path, speed_mps) in enumerate(zip(paths, speeds_mps, strict=True), 1)
        ),
        radio=Radio(range_m=mission.radio_range_m),
        sortie=Sortie(
            limit_s=mission.sortie_limit_s,
            surface_margin_s=margin_s,
            handover_s=mission.handover_s,
        ),
        planner=PlannerChoice(
            name=_PLANNER,
            path_cells=mission.path_cells,
            min_path_cells=mission.min_path_cells,
        ),
        tick_s=mission.tick_s,
        seed=seed,
        field={'kind': 'synthetic', 'seed': seed},
        max_mission_s=min(float(f'{_GENEROUS * survey_s:.2g}'), 1e7),
        pass_conditions=PassConditions(
            sortie_limit_violations=Limits(max=0.0), samples_lost=Limits(max=0.0)
        ),
    )


def _check(seed: int, asked: Mapping[str, Span], models: Sequence[str]) -> None:
    if not 0 <= seed <= 2**53:
        raise ValueError(f'seed is {seed}; allowed: 0 to 2^53')
    for name, span in asked.items():
        if name not in QUANTITIES:
            raise ValueError(
                f'{name} is nothing that is drawn{nearest(name, QUANTITIES)};'
                f' allowed: {", ".join(QUANTITIES)}'
            )
        quantity = QUANTITIES[name]
        allowed = quantity.allowed
        if not allowed.least <= span.least <= span.most <= allowed.most:
            raise ValueError(f'{name} is {span}; allowed: {allowed}, the smaller one first')
        if quantity.is_whole and (span.least % 1 or span.most % 1):
            raise ValueError(f'{name} is {span}; allowed: whole numbers')
    if not models:
        raise ValueError('no surfacing model is named; allowed: one or more')
    for model in models:
        if model not in MODELS:
            raise ValueError(
                f'surfacing model {model!r} is unknown{nearest(model, MODELS)};'
                f' allowed: {", ".join(MODELS)}'
            )


class _Draw:
    """Draws numbers, and keeps to what was asked for."""

    def __init__(self, rng: np.random.Generator, asked: Mapping[str, Span]) -> None:
        self.rng = rng
        self._asked = asked

    def asks_for(self, name: str) -> bool:
        """Return whether a quantity was asked for."""
        return name in self._asked

    def bounds(self, name: str) -> Span:
        """Return where a quantity may lie, whatever becomes of the others."""
        return self._asked.get(name, QUANTITIES[name].allowed)

    def whole(self, name: str, *, least: float = -math.inf, most: float = math.inf) -> int:
        """Return a whole number for a quantity that other ones keep between two bounds."""
        span = self._span(name, None, least, most)
        return int(self.rng.integers(int(span.least), int(span.most), endpoint=True))

    def number(
        self,
        name: str,
        usual: Span | None = None,
        *,
        least: float = -math.inf,
        most: float = math.inf,
    ) -> float:
        """Return a number for a quantity; ``usual`` goes before that of the table."""
        return self.within(self._span(name, usual, least, most))

    def within(self, span: Span) -> float:
        """Return a number in a span, with few digits: only those make exact coincidences."""
        edge, share = self.rng.random(2)
        digits = self.rng.integers(1, 3, endpoint=True)
        if edge < _AT_THE_EDGE:
            return float(span.least)
        number = float(f'{span.least + share * (span.most - span.least):.{digits}g}')
        return float(min(max(number, span.least), span.most))

    def seldom(self, span: Span) -> float:
        """Return a number in a span that begins with 0; mostly 0."""
        return self.within(span) if self.rng.random() < 0.3 else 0.0

    def _span(self, name: str, usual: Span | None, least: float, most: float) -> Span:
        quantity = QUANTITIES[name]
        allowed = Span(
            least=max(least, quantity.allowed.least), most=min(most, quantity.allowed.most)
        )
        wanted = self._asked.get(name)
        if wanted is not None:
            span = Span(
                least=max(wanted.least, allowed.least), most=min(wanted.most, allowed.most)
            )
        else:
            # What is usual gives way to what the others need.
            wanted = usual or quantity.usual or allowed
            span = Span(
                least=max(min(wanted.least, allowed.most), allowed.least),
                most=min(max(wanted.most, allowed.least), allowed.most),
            )
        if span.least > span.most:
            raise ValueError(f'{name} is {wanted}; allowed with the rest of it: {allowed}')
        return span


# --- what is drawn, in this order ----------------------------------------------------------------


def _draw_mission(
    draw: _Draw, coast: _Draw
) -> tuple[MissionSpec, tuple[tuple[Cell, ...], ...], tuple[float, ...]]:
    """Return a mission, and the initial path and the speed (m/s) of each AUV."""
    longest_s = draw.bounds('limit').most
    least_s = math.inf
    for _ in range(_DRAWS):
        speeds_mps = _draw_speeds(draw)
        mission = _draw_mission_without_limit(draw, coast, max(speeds_mps))
        paths = _draw_paths(draw, mission, len(speeds_mps))
        least_s = min(least_s, _needed_s(mission, paths))
        if least_s <= longest_s:
            break
    limit_s = draw.number('limit', Span(least=least_s, most=2 * least_s), least=least_s)
    return replace(mission, sortie_limit_s=limit_s), paths, speeds_mps


def _draw_mission_without_limit(draw: _Draw, coast: _Draw, fastest_mps: float) -> MissionSpec:
    region, range_m = _draw_region(draw, coast)
    crossing_s = region.cell_m / fastest_mps
    tick_s = draw.number('tick', Span(least=crossing_s / 12, most=crossing_s / 2))
    path_cells = draw.whole('path-cells', least=draw.bounds('min-path-cells').least)
    return MissionSpec(
        grid=region,
        c3=_draw_c3(draw, region),
        radio_range_m=range_m,
        uav_speed_mps=draw.within(Span(least=2 * fastest_mps, most=15 * fastest_mps)),
        tick_s=tick_s,
        sortie_limit_s=_NO_LIMIT_S,
        path_cells=path_cells,
        min_path_cells=draw.whole('min-path-cells', most=path_cells),
        handover_s=draw.seldom(Span(least=0, most=5 * tick_s)),
    )


def _draw_region(draw: _Draw, coast: _Draw) -> tuple[GridSpec, float]:
    """Return the region and the radio range, metres."""
    cols = draw.whole('cols')
    rows = draw.whole('rows', least=2 if cols == 1 else 1)  # a path has two cells
    if draw.asks_for('range'):
        range_m = draw.number('range', least=draw.bounds('cell').least)
        cell_m = draw.number('cell', Span(least=range_m / 4, most=range_m), most=range_m)
    else:
        cell_m = draw.number('cell')
        range_m = draw.number('range', Span(least=cell_m, most=4 * cell_m), least=cell_m)
    grid = GridSpec(cols=cols, rows=rows, cell_m=cell_m)
    share = 0.0
    if coast.asks_for('masked') or coast.rng.random() < _WITH_LAND:
        share = coast.number('masked', Span(least=0.05, most=0.3))
    masked = draw_coast(coast.rng, grid, share)
    return msgspec.structs.replace(grid, masked=masked), range_m


def _draw_speeds(draw: _Draw) -> tuple[float, ...]:
    """Return the speed of each AUV, m/s; of half of the fleets all are alike."""
    auvs = draw.whole('auvs')
    span = Span(least=0.5, most=2)
    if draw.rng.random() < 0.5:
        return (draw.within(span),) * auvs
    return tuple(draw.within(span) for _ in range(auvs))


def _draw_c3(draw: _Draw, region: GridSpec) -> Point:
    """Return a place in the region or beside it."""
    east_m, north_m = (
        draw.within(Span(least=-0.25 * length_m, most=1.25 * length_m))
        for length_m in (region.cols * region.cell_m, region.rows * region.cell_m)
    )
    return Point(east_m=east_m, north_m=north_m)


def _draw_paths(draw: _Draw, mission: MissionSpec, auvs: int) -> tuple[tuple[Cell, ...], ...]:
    """Return a walk of 1 ... q moves for each AUV, from a cell of its own if there are enough."""
    grid = mission.grid
    starts = draw.rng.choice(grid.cells_total, auvs, replace=auvs > grid.cells_total)
    paths = []
    for start in starts.tolist():
        path = [grid.cells[start]]
        for _ in range(draw.rng.integers(1, mission.path_cells, endpoint=True)):
            neighbours = grid.neighbours(path[-1])
            path.append(neighbours[draw.rng.integers(len(neighbours))])
        paths.append(tuple(path))
    return tuple(paths)


def _needed_s(mission: MissionSpec, paths: Sequence[tuple[Cell, ...]]) -> float:
    """
    Return how long L must be for the initial paths, and for the region to be explored.

    For the latter it has something to spare over a sortie to the farthest cell, and suffices for
    AUVs in any two corners: else those in the one keep those in the other from its last cells.
    """
    grid = msgspec.structs.replace(mission.grid, masked=())  # land in a corner: then it is enough
    corners = [(col, row) for col in (0, grid.cols - 1) for row in (0, grid.rows - 1)]
    ends = [(grid.neighbours(corner)[0], corner) for corner in corners]
    farthest_s = max(_round_s(mission, [end], len(paths)) for end in ends)
    apart_s = max(
        _round_s(mission, pair[: len(paths)], len(paths))
        for pair in itertools.combinations(ends, 2)
    )
    explored_s = max(_TO_SPARE * farthest_s, apart_s) + _TICKS_TO_SPARE * mission.tick_s
    return max(_round_s(mission, paths, len(paths)), explored_s)


def _round_s(mission: MissionSpec, paths: Sequence[tuple[Cell, ...]], auvs: int) -> float:
    """Return how long a sortie takes that searches some paths, and lies over the other AUVs."""
    legs = [
        SurveyLeg(auv=str(number), path=path, surface_deadline_s=0.0)
        for number, path in enumerate(paths)
    ]
    others_s = (auvs - len(legs)) * mission.handover_ticks * mission.tick_s
    return least_limit_s(mission, legs) + others_s


# --- surfacing models ----------------------------------------------------------------------------


def _draw_surfacing(
    draw: _Draw, models: Sequence[str], speed_mps: float, survey_s: float
) -> dict[str, Any]:
    """Return the surfacing model of an AUV, as in a scenario file."""
    model = models[int(draw.rng.integers(len(models)))]
    return {'model': model, **MODELS[model](draw, speed_mps, survey_s)}


def _on_time(draw: _Draw, speed_mps: float, survey_s: float) -> dict[str, Any]:
    return {}


def _early(draw: _Draw, speed_mps: float, survey_s: float) -> dict[str, Any]:
    return {'probability': draw.within(Span(least=0.05, most=0.5))}


def _slow(draw: _Draw, speed_mps: float, survey_s: float) -> dict[str, Any]:
    """Half of them in a current, against which the slowest one still gets along."""
    least_factor = draw.within(Span(least=0.4, most=1))
    if draw.rng.random() < 0.5:
        return {'least_factor': least_factor}
    current_mps = draw.rng.uniform(0, 0.5 * least_factor * speed_mps)
    heading_rad = draw.rng.uniform(0, 2 * math.pi)
    return {
        'least_factor': least_factor,
        'current_east_mps': round(current_mps * math.cos(heading_rad), 3),
        'current_north_mps': round(current_mps * math.sin(heading_rad), 3),
    }


def _abort(draw: _Draw, speed_mps: float, survey_s: float) -> dict[str, Any]:
    return {'at_s': draw.within(Span(least=0, most=survey_s))}


def _lost(draw: _Draw, speed_mps: float, survey_s: float) -> dict[str, Any]:
    return {'from_s': draw.within(Span(least=0, most=survey_s))}


def _silent(draw: _Draw, speed_mps: float, survey_s: float) -> dict[str, Any]:
    return {
        'from_s': draw.within(Span(least=0, most=survey_s)),
        'sorties': int(draw.rng.integers(1, 5, endpoint=True)),
    }


MODELS: Mapping[str, Callable[[_Draw, float, float], dict[str, Any]]] = MappingProxyType(
    {
        'on_time': _on_time,
        'early': _early,
        'slow': _slow,
        'abort': _abort,
        'lost': _lost,
        'silent': _silent,
    }
)
"""Draws the settings of a surfacing model, given the AUV's speed (m/s) and the survey (s)."""
