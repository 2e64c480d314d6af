"""What the guaranteed set refuses without need: the rule against the game, on small grids."""

from __future__ import annotations

from dataclasses import dataclass, replace

from rich.console import Console
from rich.table import Table

from msgs_json.geometry import Cell, GridSpec, Point
from uav_planner.guarantee_oracle import count_refusals
from uav_planner.planning import MissionSpec, SurveyLeg


@dataclass(frozen=True, slots=True, kw_only=True)
class _Board:
    """A mission small enough to go through everything that can happen."""

    cols: int
    rows: int
    moves: int
    c3: Point
    speed_mps: float
    limits_s: tuple[float, ...]
    """From the tightest that can be kept."""
    paths: tuple[tuple[Cell, ...], ...]

    def mission(self, limit_s: float) -> MissionSpec:
        return MissionSpec(
            grid=GridSpec(cols=self.cols, rows=self.rows, cell_m=10.0),
            c3=self.c3,
            radio_range_m=10.0,
            uav_speed_mps=self.speed_mps,
            tick_s=1.0,
            sortie_limit_s=limit_s,
            path_cells=self.moves,
            min_path_cells=1,
        )

    def legs(self) -> tuple[SurveyLeg, ...]:
        return tuple(
            SurveyLeg(auv=f'auv_{number}', path=path, surface_deadline_s=0.0)
            for number, path in enumerate(self.paths, start=1)
        )


_STRIP = _Board(
    cols=5,
    rows=1,
    moves=1,
    c3=Point(east_m=0.0, north_m=5.0),
    speed_mps=5.0,
    limits_s=(10.0, 11.0),
    paths=(((1, 0), (0, 0)), ((2, 0), (3, 0))),
)
_BLOCK = _Board(
    cols=3,
    rows=2,
    moves=1,
    c3=Point(east_m=-5.0, north_m=10.0),
    speed_mps=4.0,
    limits_s=(8.0, 9.0, 10.0),
    paths=(((0, 1), (0, 0)), ((1, 0), (1, 1))),
)
_BOARDS = (_STRIP, replace(_STRIP, moves=2), _BLOCK)


def print_refusals(console: Console) -> None:
    """Play every board to the end and print how many winning paths the rule refuses."""
    table = Table(
        title='two AUVs, cells 10 m wide, R 10 m: all meetings that can follow',
        title_justify='left',
        box=None,
        padding=(0, 3, 0, 0),
    )
    for column in ('cells', 'moves', 'UAV, m/s', 'L, s', 'paths', 'keep L for ever', 'refused'):
        table.add_column(column, justify='right')
    for board in _BOARDS:
        for limit_s in board.limits_s:
            count = count_refusals(board.mission(limit_s), board.legs())
            table.add_row(
                f'{board.cols} x {board.rows}',
                f'1 ... {board.moves}' if board.moves > 1 else '1',
                f'{board.speed_mps:g}',
                f'{limit_s:g}',
                f'{count.paths:,}',
                f'{count.winning:,}',
                f'{count.refused:,} ({count.refused / count.winning:.2%})',
            )
    console.print(table)
