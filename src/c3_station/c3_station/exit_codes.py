"""What the exit codes of the command line mean."""

from __future__ import annotations

import enum


class ExitCode(enum.IntEnum):
    """Exit codes of ``orchestrate.py``."""

    OK = 0
    """The mission met its pass conditions; the command did what was asked."""
    FAILED = 1
    """The mission did not meet its pass conditions, or a node failed."""
    BAD_INPUT = 2
    """A scenario, bag, option or folder is not usable; the message says which and why."""
    INTERRUPTED = 130
    """Ctrl-C or SIGTERM; what was recorded is readable."""
