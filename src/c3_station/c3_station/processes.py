"""Node processes: started in groups of their own, watched by pid, never left behind."""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import time
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

_libc = ctypes.CDLL(None)
_PR_SET_PDEATHSIG = 1
_ESCALATION = ((signal.SIGINT, 5.0), (signal.SIGTERM, 2.0), (signal.SIGKILL, 2.0))
"""What a process is sent to end it, and how many seconds it then has."""


class NodeProcess:
    """One running executable with its log file."""

    def __init__(
        self,
        name: str,
        command: Sequence[str],
        environment: Mapping[str, str],
        log: Path,
        keeps: Sequence[int] = (),
    ) -> None:
        """Start it; ``keeps`` are open files of this process that stay open in it."""
        self.name = name
        self.log = log
        self.started_us = time.monotonic_ns() // 1000
        """On the clock of `host_node.steady_us`."""
        with log.open('ab') as sink:  # that of its former life stays
            # A group of its own, so that Ctrl-C in the terminal reaches the orchestrator alone,
            # which then ends the nodes in order. Should the orchestrator be killed, they end too.
            self._process = subprocess.Popen(
                list(command),
                env=dict(environment),
                stdin=subprocess.DEVNULL,
                stdout=sink,
                stderr=subprocess.STDOUT,
                process_group=0,
                pass_fds=keeps,
                preexec_fn=_end_with_parent,
            )

    @property
    def pid(self) -> int:
        """Return the process id."""
        return self._process.pid

    def exit_code(self) -> int | None:
        """Return the exit code, negative for a signal; None while it runs."""
        return self._process.poll()

    def wait(self, timeout_s: float) -> int | None:
        """Wait for the end, at most this long."""
        try:
            return self._process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            return None

    def send(self, signum: signal.Signals) -> None:
        """Send a signal, if it still runs."""
        if self.exit_code() is None:
            self._process.send_signal(signum)

    def peak_memory_bytes(self) -> int | None:
        """Return the largest resident set so far; None where it runs no more (Linux)."""
        try:
            status = Path(f'/proc/{self.pid}/status').read_text()
        except OSError:
            return None
        for line in status.splitlines():
            if line.startswith('VmHWM:'):
                return int(line.split()[1]) * 1024
        return None

    def last_lines(self, count: int) -> list[str]:
        """Return the end of its log."""
        return self.log.read_text(errors='replace').splitlines()[-count:]


def stop_all(processes: Iterable[NodeProcess]) -> list[str]:
    """
    End processes: INT, then TERM, then KILL, each with a time to comply.

    Returns
    -------
    list of str
        Names of those that had to be killed.

    """
    processes = list(processes)
    for signum, grace_s in _ESCALATION:
        alive = [process for process in processes if process.exit_code() is None]
        if not alive:
            break
        for process in alive:
            process.send(signum)
        deadline_s = time.monotonic() + grace_s
        for process in alive:
            process.wait(max(0.0, deadline_s - time.monotonic()))
    return [p.name for p in processes if p.exit_code() == -signal.SIGKILL]


def how_it_ended(exit_code: int) -> str:
    """Return an exit code in words."""
    if exit_code < 0:
        return f'ended by {signal.Signals(-exit_code).name}'
    return f'ended with exit code {exit_code}'


def executable(package: str, name: str) -> Path:
    """
    Return the path of a node's executable: what ``ros2 run package name`` runs.

    Raises
    ------
    ValueError
        No workspace on ``AMENT_PREFIX_PATH`` has it.

    """
    prefixes = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    for prefix in filter(None, prefixes):
        path = Path(prefix) / 'lib' / package / name
        if path.is_file():
            return path
    raise ValueError(
        f'no executable {package}/{name} on AMENT_PREFIX_PATH;'
        ' start through orchestrate.py, or source install/setup.bash'
    )


def _end_with_parent() -> None:
    """Ask the kernel for SIGTERM when the parent dies (Linux; runs in the child)."""
    _libc.prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
