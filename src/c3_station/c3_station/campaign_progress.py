"""A bar that moves while a campaign is flown."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TextColumn,
    TimeRemainingColumn,
)
from rich.text import Text

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rich.console import Console

    from c3_station.campaign_mission import MissionResult

_SPEED_OVER_S = 60.0
"""Long enough that the time left does not jump with every batch, seconds."""


@contextmanager
def progress_bar(
    console: Console, total: int, flown: list[MissionResult]
) -> Iterator[Callable[[list[MissionResult]], None]]:
    """Show a bar, with ``flown`` missions behind it; yields what to tell of results to come."""
    over_limit = 0
    with Progress(
        TextColumn('missions'),
        BarColumn(),
        MofNCompleteColumn(),
        _SpeedColumn(),
        TextColumn('{task.fields[over_limit]} with a sortie over L'),
        TextColumn('ready in'),
        TimeRemainingColumn(),
        console=console,
        speed_estimate_period=_SPEED_OVER_S,
    ) as progress:
        task = progress.add_task('', total=total, completed=len(flown), over_limit=0)

        def note(results: list[MissionResult]) -> None:
            nonlocal over_limit
            over_limit += sum(result.violations > 0 for result in results)
            progress.update(task, advance=len(results), over_limit=over_limit)

        over_limit = sum(result.violations > 0 for result in flown)
        progress.update(task, over_limit=over_limit)
        yield note


class _SpeedColumn(ProgressColumn):
    """Missions per second."""

    def render(self, task: Task) -> Text:
        """Return the speed, once there is one."""
        return Text(f'{task.speed:.1f}/s' if task.speed else '')
