"""``orchestrate.py command``: tell the C3 of a running mission what the operator wants."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from c3_station.exit_codes import ExitCode
from c3_station.operator_words import parse_command, silence
from c3_station.ros_environment import graph_environment
from c3_station.run_folder import RunFolder
from msgs_json.messages import CommandTaken

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.console import Console


def command(run: Path, words: Sequence[str], console: Console) -> ExitCode:
    """
    Say a command to the C3 of a mission that is flown on ROS in a folder.

    Raises
    ------
    ValueError
        There is no such mission, or no such command.

    """
    wanted = parse_command(words)
    folder = RunFolder(run)
    try:
        domain_id = int(folder.domain.read_text())
    except (OSError, ValueError):
        raise ValueError(f'{run}: no mission is being flown there on ROS nodes') from None
    os.environ.update(graph_environment(domain_id, folder.logs))
    # Needs ROS, which a wrong command does not.
    from c3_station.operator_node import PATIENCE_S, say_to_c3

    answer = say_to_c3(wanted, domain_id, folder.key)
    if answer is None:
        console.print(silence(folder, PATIENCE_S), style='bold red', markup=False, soft_wrap=True)
        return ExitCode.FAILED
    if not isinstance(answer, CommandTaken):
        problem = f'refused: {answer.problem}'
        console.print(problem, style='bold red', markup=False, soft_wrap=True)
        return ExitCode.FAILED
    console.print('taken; the UAV hears of it when it is in range of C3')
    return ExitCode.OK
