"""What the exit codes of a node mean, for whoever started it."""

from __future__ import annotations

import enum


class NodeExit(enum.IntEnum):
    """Exit codes of every node; 1 is a defect, with a traceback."""

    OK = 0
    """It was told to end (SIGINT, SIGTERM), or the world's mission is over."""
    BAD_PARAMETERS = 2
    """Arguments or parameters are not usable; the last line of its output says which and why."""
    NODE_MISSING = 3
    """The world: a node did not come or fell silent; MissionStopped and the output name it."""
    NOT_RECORDING = 4
    """The recorder: the bag cannot be written; the last line of its output says why."""
