"""
The families of scenarios over which planners are compared.

A family is one kind of survey. Its missions, one for each seed, differ in where the AUVs are put
in and in what is drawn for them under water.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import msgspec

from c3_station.scenario import Auv, PlannerChoice, Radio, Scenario, Sortie, Uav
from c3_station.scenario_changes import SURFACING, Change
from c3_station.scenario_checks import mission_problems
from c3_station.scenario_files import load_scenario, with_choices
from msgs_json.geometry import Cell, GridSpec, Point
from msgs_json.randomness import agent_rng

if TYPE_CHECKING:
    import numpy as np

HARD_STOP = 4.0
"""
Over the time in which the AUVs could enter all cells if they entered none twice.

Who has not explored the region by then is not worth waiting for; random surveys take far longer.
"""

_DRAWS = 1000
"""How often starts are drawn until a sortie to all of them keeps L."""

_START_CELLS = 4
"""AUVs that are put in near C3 are in some of the cells nearest to it: so many for each AUV."""


class Starts(enum.Enum):
    """Where the AUVs are put in."""

    SHIPPED = 'put in where the scenario says'
    NEAR_C3 = 'put in near C3'
    ANYWHERE = 'put in anywhere'


@dataclass(frozen=True, slots=True, kw_only=True)
class Survey:
    """A region, and with what it is surveyed."""

    cols: int
    rows: int
    cell_m: float
    land: tuple[tuple[int, int, int, int], ...] = ()
    """Masked rectangles: first and last column, first and last row of each."""
    c3: tuple[float, float]
    """In cells, east and north of the south-west corner."""
    auvs: int
    auv_mps: float
    uav_mps: float
    range_m: float
    limit_s: float
    path_cells: int
    tick_s: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Family:
    """One kind of survey."""

    name: str
    what: str
    survey: Survey | str
    """Or the name of a shipped scenario."""
    starts: Starts
    surfacing: str = 'on_time'
    """By its name in `SURFACING_PRESETS`."""
    is_long: bool = False
    """Whether a mission takes so long to fly that one has to be enough."""

    @property
    def is_on_time(self) -> bool:
        """Return whether every AUV surfaces where and when its path ends."""
        return self.surfacing == 'on_time'

    def missions(self, seeds: int) -> int:
        """Return how many missions are flown: one where all would be the same, or last long."""
        is_drawn = self.starts is not Starts.SHIPPED or not self.is_on_time
        return seeds if is_drawn and not self.is_long else 1


# Speeds are those of small vehicles: AUVs of 1 to 1.25 m/s and fixed-wing UAVs of 15 to 25 m/s;
# only the paper's UAV is slow. A round to all AUVs takes about as long as a leg, so that neither
# side waits long for the other. Where L is tight, a sortie to the far corners takes nearly all.
_COVE = Survey(
    cols=16,
    rows=16,
    cell_m=25,
    c3=(8, 0),
    auvs=4,
    auv_mps=1,
    uav_mps=15,
    range_m=30,
    limit_s=75,
    path_cells=6,
)
_ISLANDS = Survey(
    cols=24,
    rows=24,
    cell_m=25,
    land=((4, 8, 5, 9), (14, 15, 3, 12), (6, 13, 15, 17), (19, 23, 17, 20)),
    c3=(12, 0),
    auvs=6,
    auv_mps=1.25,
    uav_mps=18,
    range_m=75,
    limit_s=120,
    path_cells=7,
)
_BAY = Survey(
    cols=40,
    rows=40,
    cell_m=25,
    c3=(20, 0),
    auvs=12,
    auv_mps=1.25,
    uav_mps=20,
    range_m=75,
    limit_s=240,
    path_cells=8,
)

FAMILIES = (
    Family(
        name='paper',
        what='the reference mission of ECC 2009',
        survey='ecc2009',
        starts=Starts.SHIPPED,
    ),
    Family(
        name='paper_early_10',
        what='the same; one leg in ten ends early',
        survey='ecc2009',
        starts=Starts.SHIPPED,
        surfacing='early_10',
    ),
    Family(
        name='paper_early_30',
        what='the same; three legs in ten end early',
        survey='ecc2009',
        starts=Starts.SHIPPED,
        surfacing='early_30',
    ),
    Family(
        name='paper_anywhere',
        what='the same region, fleet and limit',
        survey='ecc2009',
        starts=Starts.ANYWHERE,
    ),
    Family(
        name='lone',
        what='one AUV: the UAV waits for nobody else',
        survey=Survey(
            cols=12,
            rows=12,
            cell_m=20,
            c3=(0, 0),
            auvs=1,
            auv_mps=1,
            uav_mps=15,
            range_m=80,
            limit_s=120,
            path_cells=9,
        ),
        starts=Starts.ANYWHERE,
    ),
    Family(
        name='cove_tight',
        what='short radio range, tight limit',
        survey=_COVE,
        starts=Starts.NEAR_C3,
    ),
    Family(
        name='cove_wide',
        what='long radio range, wide limit',
        survey=replace(_COVE, range_m=150, limit_s=240, path_cells=8),
        starts=Starts.ANYWHERE,
    ),
    Family(
        name='channel',
        what='long and narrow, C3 at one end',
        survey=Survey(
            cols=40,
            rows=8,
            cell_m=25,
            c3=(0, 4),
            auvs=4,
            auv_mps=1.25,
            uav_mps=15,
            range_m=75,
            limit_s=200,
            path_cells=7,
        ),
        starts=Starts.NEAR_C3,
    ),
    Family(
        name='harbour',
        what='a coast, a mole and an island',
        survey='harbour',
        starts=Starts.SHIPPED,
    ),
    Family(
        name='islands',
        what='four islands to go around',
        survey=_ISLANDS,
        starts=Starts.ANYWHERE,
    ),
    Family(
        name='islands_early_30',
        what='the same; three legs in ten end early',
        survey=_ISLANDS,
        starts=Starts.ANYWHERE,
        surfacing='early_30',
    ),
    Family(
        name='fleet',
        what='eight AUVs, each in its part of the region',
        survey='fleet_8',
        starts=Starts.SHIPPED,
    ),
    Family(
        name='fleet_early_10',
        what='the same; one leg in ten ends early',
        survey='fleet_8',
        starts=Starts.SHIPPED,
        surfacing='early_10',
    ),
    Family(
        name='bay',
        what='twelve AUVs from one shore',
        survey=_BAY,
        starts=Starts.NEAR_C3,
    ),
    Family(
        name='bay_early_10',
        what='the same fleet; one leg in ten ends early',
        survey=_BAY,
        starts=Starts.ANYWHERE,
        surfacing='early_10',
    ),
    Family(
        name='shelf',
        what='sixteen AUVs on 9 km2, long radio range',
        survey=Survey(
            cols=60,
            rows=60,
            cell_m=50,
            c3=(30, 0),
            auvs=16,
            auv_mps=1,
            uav_mps=25,
            range_m=300,
            limit_s=900,
            path_cells=9,
            tick_s=2,
        ),
        starts=Starts.ANYWHERE,
        is_long=True,
    ),
)
"""From small to large."""


def family_scenario(family: Family, seed: int, planner: str) -> Scenario:
    """
    Return the mission of a family with a seed, flown by a planner.

    The mission is the same for every planner; one that draws does so with the mission's seed.

    Raises
    ------
    ValueError
        It cannot be flown with this planner, or at all.

    """
    base = _base(family)
    if family.starts is not Starts.SHIPPED:
        base = _with_starts(base, family.starts, agent_rng(seed, family.name))
    crossing_s = base.region.cell_m / base.auvs[0].speed_mps
    cells_each = base.region.cells_total / len(base.auvs)
    changes = [
        Change(key=SURFACING, value=family.surfacing),
        Change(key='max_mission_s', value=math.ceil(HARD_STOP * cells_each * crossing_s)),
    ]
    if planner == 'random':
        changes.append(Change(key='planner.options.seed', value=seed))
    return with_choices(base, planner=planner, seed=seed, changes=changes)


def family_figures(family: Family) -> str:
    """Return the figures of a family in a line."""
    base = _base(family)
    region, auv = base.region, base.auvs[0]
    masked = f' ({len(region.masked)} masked)' if region.masked else ''
    auvs = 'AUV' if len(base.auvs) == 1 else 'AUVs'
    return (
        f'{region.cols} x {region.rows} cells of {region.cell_m:g} m{masked},'
        f' {len(base.auvs)} {auvs} at {auv.speed_mps:g} m/s, UAV {base.uav.speed_mps:g} m/s,'
        f' R {base.radio.range_m:g} m, L {base.sortie.limit_s:g} s, q {base.planner.path_cells},'
        f' {family.starts.value}, surfacing {family.surfacing}'
    )


def _base(family: Family) -> Scenario:
    """Return the scenario of a family before anything is drawn."""
    survey = family.survey
    return load_scenario(survey) if isinstance(survey, str) else _unmanned(survey)


def _unmanned(survey: Survey) -> Scenario:
    """Return the scenario of a survey with all its AUVs in one cell, to be put in elsewhere."""
    east, north = survey.c3
    masked = tuple(
        (col, row)
        for west, last_col, south, last_row in survey.land
        for row in range(south, last_row + 1)
        for col in range(west, last_col + 1)
    )
    return Scenario(
        name='bench',
        description='Of the benchmark of planners',
        region=GridSpec(cols=survey.cols, rows=survey.rows, cell_m=survey.cell_m, masked=masked),
        c3=Point(east_m=east * survey.cell_m, north_m=north * survey.cell_m),
        uav=Uav(speed_mps=survey.uav_mps),
        auvs=tuple(
            Auv(name=f'auv_{number}', initial_path=((0, 0), (1, 0)), speed_mps=survey.auv_mps)
            for number in range(1, survey.auvs + 1)
        ),
        radio=Radio(range_m=survey.range_m),
        sortie=Sortie(limit_s=survey.limit_s),
        planner=PlannerChoice(path_cells=survey.path_cells),
        tick_s=survey.tick_s,
        max_mission_s=1e7,
    )


def _with_starts(base: Scenario, starts: Starts, rng: np.random.Generator) -> Scenario:
    """
    Return a scenario with AUVs put in as drawn, where a sortie to all of them keeps L.

    They are visited clockwise as seen from C3, and begin with a path of one move.
    """
    grid, c3 = base.region, base.c3
    cells = sorted(grid.cells, key=lambda cell: grid.centre(cell).distance_m(c3))
    if starts is Starts.NEAR_C3:
        cells = cells[: _START_CELLS * len(base.auvs)]
    for _ in range(_DRAWS):
        drawn = [cells[index] for index in rng.choice(len(cells), len(base.auvs), replace=False)]
        drawn.sort(key=lambda cell: _bearing_rad(c3, grid.centre(cell)))
        paths = [(cell, _neighbour(grid, cell, rng)) for cell in drawn]
        scenario = msgspec.structs.replace(
            base,
            auvs=tuple(
                msgspec.structs.replace(auv, initial_path=path)
                for auv, path in zip(base.auvs, paths, strict=True)
            ),
        )
        if not mission_problems(scenario):
            return scenario
    problems = '; '.join(map(str, mission_problems(scenario)))
    raise ValueError(f'no starts found in {_DRAWS} draws: {problems}')


def _bearing_rad(c3: Point, place: Point) -> float:
    """Return the direction of a place from C3: 0 = south, growing clockwise to 2 pi."""
    east_m, north_m = place.east_m - c3.east_m, place.north_m - c3.north_m
    return math.atan2(-east_m, -north_m) % (2 * math.pi)


def _neighbour(grid: GridSpec, cell: Cell, rng: np.random.Generator) -> Cell:
    neighbours = grid.neighbours(cell)
    return neighbours[int(rng.integers(len(neighbours)))]
