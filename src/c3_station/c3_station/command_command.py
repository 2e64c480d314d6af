"""``orchestrate.py command``: tell the C3 of a running mission what the operator wants."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from c3_station.exit_codes import ExitCode
from c3_station.run_folder import RunFolder
from c3_station.scheduled_commands import operator_command
from msgs_json.messages import CommandTaken

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.console import Console

_WORDS = {
    'pause': 'pause',
    'resume': 'resume',
    'end': 'end_mission',
    'abort': 'abort',
    'reset': 'reset',
}
"""Commands that are one word, as they are written and as they are called."""

USAGE = (
    'recall [AUV ...] | pause | resume | limit SECONDS | region [[COL,ROW],...] | end | abort'
    ' | reset'
)


def command(run: Path, words: Sequence[str], console: Console) -> ExitCode:
    """
    Say a command to the C3 of a mission that is flown on ROS in a folder.

    Raises
    ------
    ValueError
        There is no such mission, or no such command.

    """
    wanted = operator_command(_written(words))
    folder = RunFolder(run)
    try:
        domain_id = int(folder.domain.read_text())
    except (OSError, ValueError):
        raise ValueError(f'{run}: no mission is being flown there on ROS nodes') from None
    # Needs ROS, which a wrong command does not.
    from c3_station.operator_node import say_to_c3

    answer = say_to_c3(wanted, domain_id, folder.key)
    if answer is None:
        console.print(f'{run}: its C3 does not answer', style='bold red', markup=False)
        return ExitCode.FAILED
    if not isinstance(answer, CommandTaken):
        console.print(f'refused: {answer.problem}', style='bold red', markup=False)
        return ExitCode.FAILED
    console.print('taken; the UAV hears of it when it is in range of C3')
    return ExitCode.OK


def _written(words: Sequence[str]) -> dict[str, Any]:
    """Return a command as a scenario file writes it."""
    match [*words]:
        case ['recall', *auvs]:
            return {'command': 'recall', 'auvs': auvs}
        case ['limit', seconds]:
            return {'command': 'change_limit', 'sortie_limit_s': _number(seconds)}
        case ['region', cells]:
            return {'command': 'change_region', 'masked': _cells(cells)}
        case [word] if word in _WORDS:
            return {'command': _WORDS[word]}
        case _:
            raise ValueError(f'{" ".join(words)!r} is no command; allowed: {USAGE}')


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ValueError(f'limit is {text!r}; allowed: a number of seconds') from None


def _cells(text: str) -> object:
    try:
        return msgspec.json.decode(text)
    except msgspec.DecodeError:
        raise ValueError(f'region is {text!r}; allowed: [[COL,ROW],...]') from None
