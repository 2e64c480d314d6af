"""Rules for what every driver remembers."""

from __future__ import annotations

from typing import TYPE_CHECKING

from msgs_json.driver_checks.shared_rules import WAY_TICKS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from msgs_json.driver_checks.bench import Bench, DriverT, StateT

CHANGES_MAX = 10
"""On the way of `Bench.depart`; of what is remembered, each change is stored before all else."""


def goes_on_from_its_memory(bench: Bench[DriverT, StateT]) -> Iterator[str]:
    """
    Go on as one that was never interrupted after ``recall`` of a ``memory`` in a new driver.

    The vehicle does not vanish with the process of its driver: it goes on meanwhile. That holds
    for a simulated one, too; a stand-in that the driver makes for itself is part of its memory.
    """
    trial, other = bench.trial(), bench.trial()
    trial.restart()
    for ticks in (0, 1, 1, 5, 1, 20, 20, WAY_TICKS - 48):
        yield from trial.keeps_up_with(other, ticks)
        if ticks == 0:
            bench.depart(trial.driver)
            bench.depart(other.driver)
        trial.restart()
    yield from trial.keeps_up_with(other, 2)


def has_the_same_memory_until_that_changes(bench: Bench[DriverT, StateT]) -> Iterator[str]:
    """
    Return the very same object from ``memory`` as long as there is nothing else to remember.

    It changes with commands and when a waypoint is reached, not with the time: whoever stores it
    looks at every tick whether it is another.
    """
    trial = bench.trial()
    trial.tick()
    bench.depart(trial.driver)
    memory, changes = trial.driver.memory(), 0
    for _ in range(WAY_TICKS):
        trial.tick()
        before, memory = memory, trial.driver.memory()
        changes += memory is not before
    if changes > CHANGES_MAX:
        yield f'{changes} other memories within {WAY_TICKS} ticks; allowed: {CHANGES_MAX}'


def refuses_what_is_no_memory(bench: Bench[DriverT, StateT]) -> Iterator[str]:
    """Raise `ValueError` when told to recall something that no ``memory`` returned."""
    for noise in (b'\xc1', b'no memory'):
        try:
            bench.trial().driver.recall(noise)
        except ValueError:
            continue
        yield f'recalled {noise!r}'


MEMORY_RULES = (
    goes_on_from_its_memory,
    has_the_same_memory_until_that_changes,
    refuses_what_is_no_memory,
)
