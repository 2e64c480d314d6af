"""A run of the orchestrator in a process of its own, with the processes of its nodes."""

import subprocess
import sys
from pathlib import Path

from patience import PATIENCE_S, wait_until

FLYING_BYTES = 50_000
"""The file of a bag begins with the topics; it grows when there is something to tell."""


class Run:
    """One ``orchestrate.py`` under way, by default ``run``."""

    def __init__(self, out: Path, *options: str, scenario: str = 'ecc2009') -> None:
        self.out = out
        self._begin('run', scenario, '--out', str(out), *options)

    def _begin(self, *words: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, '-m', 'c3_station', *words],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def resume(self) -> None:
        """Go on with it after all its processes have ended."""
        self._begin('resume', str(self.out))

    def wait_for_flight(self, recorded_bytes: int = FLYING_BYTES) -> None:
        """Wait until the mission is being recorded."""
        bag = self.out / 'bag' / 'bag.mcap'

        def flies() -> bool:
            assert self.process.poll() is None, self.end()
            return bag.exists() and bag.stat().st_size > recorded_bytes

        wait_until(flies)

    def nodes(self) -> dict[str, int]:
        """Return the pids of the node processes by node name."""
        found = {}
        for status in Path('/proc').glob('[0-9]*/cmdline'):
            try:
                words = status.read_text().split('\0')
            except OSError:
                continue
            if str(self.out / 'params.yaml') in words:
                (namespace,) = (word for word in words if word.startswith('__ns:=/'))
                found[namespace.removeprefix('__ns:=/')] = int(status.parent.name)
        return found

    def end(self) -> tuple[int, str]:
        """Wait for the end; return exit code and output."""
        output, _ = self.process.communicate(timeout=PATIENCE_S)
        return self.process.returncode, output
