"""What the guaranteed set refuses without need: the rule against the game, on small grids."""

from __future__ import annotations

from dataclasses import replace

from rich.console import Console
from rich.table import Table

from uav_planner.guarantee_oracle import count_refusals
from uav_planner.oracle_boards import BLOCK, STRIP

BOARDS = (
    STRIP,
    replace(STRIP, limit_s=11.0),
    replace(STRIP, moves=2),
    replace(STRIP, moves=2, limit_s=11.0),
    BLOCK,
    replace(BLOCK, limit_s=9.0),
    replace(BLOCK, limit_s=10.0),
)


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
    for board in BOARDS:
        count = count_refusals(board.mission, board.legs)
        table.add_row(
            f'{board.cols} x {board.rows}',
            f'1 ... {board.moves}' if board.moves > 1 else '1',
            f'{board.speed_mps:g}',
            f'{board.limit_s:g}',
            f'{count.paths:,}',
            f'{count.winning:,}',
            f'{count.refused:,} ({count.refused / count.winning:.2%})',
        )
    console.print(table)
