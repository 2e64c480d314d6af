"""Commands of the operator as a scenario file, or a command line, writes them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import msgspec

from msgs_json.messages import OperatorCommand

if TYPE_CHECKING:
    from collections.abc import Mapping


def operator_command(written: Mapping[str, Any]) -> OperatorCommand:
    """
    Return a command.

    Raises
    ------
    ValueError
        It is none; the text says what is wrong with it.

    """
    try:
        command: OperatorCommand = msgspec.convert(written, OperatorCommand)
    except msgspec.ValidationError as error:
        raise ValueError(f'{error}') from None
    return command
