"""
``orchestrate.py bench custody``: what it costs that nothing is lost and nobody is fooled.

A mission is flown in one process with and without: without, the agents' stores keep nothing, and
nothing is signed or checked. Processor time, in turns, so that both meet the same machine. What
agents do to be ready to be stored is part of both.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator, Mapping
from time import process_time
from typing import TypeVar

from rich.console import Console

from c3_station.bench_figure import Figure, at_most, spread
from c3_station.in_process import MakeSetting, fly
from c3_station.scenario import Scenario
from c3_station.scenario_files import load_scenario
from msgs_json.agent_shell import AgentSetting, Frame
from msgs_json.authentication import Authenticator
from msgs_json.key_file import new_key
from msgs_json.store import MemoryStore, Store

T = TypeVar('T')

_PAIRS = 60
_AIM = 1.15


class _NoStore:
    """A store that keeps nothing."""

    is_changed = False

    def load(self, kind: str, value_type: type[T]) -> dict[str, T]:
        """Return nothing."""
        return {}

    def put(self, kind: str, key: str, value: object) -> None:
        """Forget it."""

    def drop(self, kind: str, key: str) -> None:
        """Do nothing: it was not kept."""

    def commit(self) -> None:
        """Do nothing: there is nothing to store."""

    def close(self) -> None:
        """Do nothing: nothing was opened."""


def bench_custody(console: Console) -> Iterator[Figure]:
    """Return the figures."""
    costs = custody_costs(load_scenario('ecc2009'), _PAIRS)
    yield at_most(
        'custody and authentication, cost of ecc2009 with over without', costs[_BOTH], _AIM
    )
    yield Figure(what='custody alone', value=spread(costs[_CUSTODY]))
    yield Figure(what='authentication alone', value=spread(costs[_AUTHENTICATION]))


_BOTH, _CUSTODY, _AUTHENTICATION = 'both', 'custody', 'authentication'


def custody_costs(scenario: Scenario, pairs: int) -> Mapping[str, list[float]]:
    """Return for each way to fly the processor time over that of the flight without, by round."""
    authenticator = Authenticator(new_key())
    settings = {
        _BOTH: _setting(MemoryStore, authenticator),
        _CUSTODY: _setting(MemoryStore, None),
        _AUTHENTICATION: _setting(_NoStore, authenticator),
    }
    without = _setting(_NoStore, None)
    _flight_s(scenario, without)  # fills caches (walk tables, drivers)
    # A collection of garbage does not look through all that was imported, wherever it falls.
    gc.freeze()
    costs: dict[str, list[float]] = {way: [] for way in settings}
    for _ in range(pairs):
        without_s = _flight_s(scenario, without)
        for way, setting in settings.items():
            costs[way].append(_flight_s(scenario, setting) / without_s)
    gc.unfreeze()
    return costs


def _setting(make_store: Callable[[], Store], authenticator: Authenticator | None) -> MakeSetting:
    return lambda name: AgentSetting(store=make_store(), authenticator=authenticator)


def _flight_s(scenario: Scenario, setting: MakeSetting) -> float:
    began_s = process_time()
    fly(scenario, _let_go, make_setting=setting)
    return process_time() - began_s


def _let_go(name: str, frame: Frame) -> None:
    """Take a message and do nothing with it."""
