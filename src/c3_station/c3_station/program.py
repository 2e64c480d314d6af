"""What a person types."""

from __future__ import annotations

import shlex

PROGRAM = 'python3 orchestrate.py'


def command_line(*arguments: str) -> str:
    """Return a line for a shell that starts this program with arguments."""
    return f'{PROGRAM} {shlex.join(arguments)}'
