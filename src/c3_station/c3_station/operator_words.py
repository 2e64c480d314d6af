"""The operator's commands as words of a command line, and what they come to as people read it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

from c3_station.scheduled_commands import operator_command
from msgs_json.messages import (
    Abort,
    ChangeLimit,
    ChangeRegion,
    EndMission,
    OperatorCommand,
    Pause,
    Recall,
    Reset,
    Resume,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from c3_station.run_folder import RunFolder
    from c3_station.scenario import Scenario
    from msgs_json.messages import Directive

_WORDS: dict[str, OperatorCommand] = {
    'pause': Pause(),
    'resume': Resume(),
    'end': EndMission(),
    'abort': Abort(),
    'reset': Reset(),
}
"""Commands that are one word."""

USAGE = (
    'recall [AUV ...] | pause | resume | limit SECONDS | region [[COL,ROW],...] | end | abort'
    ' | reset'
)


AS_ORDERED = 'as ordered'
"""There is nothing that the operator wants beside the scenario."""


def parse_command(words: Sequence[str]) -> OperatorCommand:
    """
    Return the command that words say.

    Raises
    ------
    ValueError
        They say none; the text says what is wrong with them.

    """
    match [*words]:
        case ['recall', *auvs]:
            return operator_command({'command': 'recall', 'auvs': auvs})
        case ['limit', seconds]:
            return operator_command(
                {'command': 'change_limit', 'sortie_limit_s': _number(seconds)}
            )
        case ['region', cells]:
            return operator_command({'command': 'change_region', 'masked': _cells(cells)})
        case [word] if word in _WORDS:
            return _WORDS[word]
        case _:
            raise ValueError(f'{" ".join(words)!r} is no command; allowed: {USAGE}')


def words_of(command: OperatorCommand) -> str:
    """Return what to write for a command."""
    match command:
        case Recall(auvs=auvs):
            return ' '.join(['recall', *auvs])
        case ChangeLimit(sortie_limit_s=limit_s):
            return f'limit {limit_s:g}'
        case ChangeRegion(masked=masked):
            return f'region {msgspec.json.encode(masked).decode()}'
        case _:
            return next(word for word, each in _WORDS.items() if each == command)


def silence(folder: RunFolder, patience_s: float) -> str:
    """Return what a person is told whose command was not answered, and what he can check."""
    return (
        f'{folder.path}: its C3 does not answer within {patience_s:g} s. Check that the mission is'
        f' still being flown, that {folder.key} is its key, and that the clock here is not behind'
        ' the one by which the last command was given: C3 takes an older command for a replay. The'
        " mission's log says what C3 refuses. The command may have been taken all the same; given"
        ' again it does no harm'
    )


def wishes(directive: Directive, scenario: Scenario) -> str:
    """Return what a directive says that the scenario does not; all of that is in effect."""
    taken_out = len({*directive.masked} - {*scenario.region.masked})
    said = (
        'aborted' if directive.aborted else '',
        'paused' if directive.paused else '',
        f'{", ".join(directive.recalled)} recalled' if directive.recalled else '',
        f'limit {directive.sortie_limit_s:g} s'
        if directive.sortie_limit_s != scenario.sortie.limit_s
        else '',
        f'{taken_out} cell{"s" if taken_out > 1 else ""} taken out' if taken_out else '',
    )
    return ', '.join(filter(None, said)) or AS_ORDERED


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
