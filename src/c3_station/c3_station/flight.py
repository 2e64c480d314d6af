"""How a mission was flown, as seen by whoever had it flown."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(slots=True)
class Flight:
    """The outcome of a flight; what happened in the mission is in its bag."""

    problem: str | None = None
    """Why the mission did not run to its end; None if it did."""
    first_tick_s: float | None = None
    """Wall time from the start of the first process to the first tick."""
    restarts: dict[str, int] = field(default_factory=dict)
    """How often each process was started again."""
    peak_memory_bytes: dict[str, int] = field(default_factory=dict)
    """Largest resident set of each process."""
