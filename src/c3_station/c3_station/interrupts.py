"""Ctrl-C, SIGTERM and a closed terminal, heard for sure and at a time that suits."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def interruptible() -> Iterator[Callable[[], None]]:
    """
    Let Ctrl-C, SIGTERM and a closed terminal end something at the next look, which is yielded.

    A handler that raised at once would at times do so inside a callback, of the ROS executor or of
    a pool of processes, where the exception is lost and all goes on.
    """
    asked = False

    def note(signum: int, frame: FrameType | None) -> None:
        nonlocal asked
        asked = True

    def look() -> None:
        if asked:
            raise KeyboardInterrupt

    signals = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = [signal.signal(signum, note) for signum in signals]
    try:
        yield look
    finally:
        for signum, handler in zip(signals, before, strict=True):
            signal.signal(signum, handler)
