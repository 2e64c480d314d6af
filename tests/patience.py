"""How long tests wait for other processes."""

import time
from collections.abc import Callable

PATIENCE_S = 60.0
"""On an idle machine all that is waited for comes within a few seconds."""


def _nap() -> None:
    time.sleep(0.02)


def wait_until(holds: Callable[[], bool], between_looks: Callable[[], None] = _nap) -> None:
    """Wait until something holds; fail if it does not in time."""
    give_up_s = time.monotonic() + PATIENCE_S
    while not holds():
        assert time.monotonic() < give_up_s, 'it did not happen in time'
        between_looks()
