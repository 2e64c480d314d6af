"""Boards for the oracle: missions small enough to go through everything that can happen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from msgs_json.geometry import GridSpec, Point
from uav_planner.planning import MissionSpec, SurveyLeg

if TYPE_CHECKING:
    from collections.abc import Iterable

    from msgs_json.geometry import Cell


@dataclass(frozen=True, slots=True, kw_only=True)
class Board:
    """A grid of few cells, 10 m wide, with a radio range of one cell, and its AUVs."""

    cols: int
    rows: int
    c3: Point
    speed_mps: float
    limit_s: float
    moves: int
    """Of a full path, q."""
    min_moves: int = 1
    """Of the shortest path that may be handed over, Delta."""
    handover_s: float = 0.0
    paths: tuple[tuple[Cell, ...], ...]
    """On which the AUVs begin."""

    @property
    def mission(self) -> MissionSpec:
        """Return the mission as a planner takes it."""
        return MissionSpec(
            grid=GridSpec(cols=self.cols, rows=self.rows, cell_m=10.0),
            c3=self.c3,
            radio_range_m=10.0,
            uav_speed_mps=self.speed_mps,
            tick_s=1.0,
            sortie_limit_s=self.limit_s,
            path_cells=self.moves,
            min_path_cells=self.min_moves,
            handover_s=self.handover_s,
        )

    @property
    def legs(self) -> tuple[SurveyLeg, ...]:
        """Return the initial legs."""
        return legs_of(self.paths)


def legs_of(paths: Iterable[tuple[Cell, ...]]) -> tuple[SurveyLeg, ...]:
    """Return one leg per path, of AUVs that are up at once: auv_1, auv_2, ..."""
    return tuple(
        SurveyLeg(auv=f'auv_{number}', path=path, surface_deadline_s=0.0)
        for number, path in enumerate(paths, start=1)
    )


# Each with the tightest limit that can be kept.
STRIP = Board(
    cols=5,
    rows=1,
    c3=Point(east_m=0.0, north_m=5.0),
    speed_mps=5.0,
    limit_s=10.0,
    moves=1,
    paths=(((1, 0), (0, 0)), ((2, 0), (3, 0))),
)
BLOCK = Board(
    cols=3,
    rows=2,
    c3=Point(east_m=-5.0, north_m=10.0),
    speed_mps=4.0,
    limit_s=8.0,
    moves=1,
    paths=(((0, 1), (0, 0)), ((1, 0), (1, 1))),
)
