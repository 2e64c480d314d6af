"""How many missions of a campaign are flown per second."""

from __future__ import annotations

from time import perf_counter

from c3_station.campaign_plan import plan_campaign
from c3_station.campaign_processes import ProcessPool
from c3_station.campaign_run import fly_all
from c3_station.scenario_changes import read_variants

_VARIATIONS = 'surfacing=early_10,early_30,early_50,slow,mixed'
"""Those with which the guarantee is tried."""

_SEEDS = 16
_FIRST_SEEDS = 1
"""Not counted: workers start, and fill their caches."""


def missions_per_s(jobs: int) -> float:
    """Return how many missions of ``ecc2009`` with ``robust`` a number of processes flies."""
    campaign = plan_campaign(
        scenarios=('ecc2009',),
        planners=('robust',),
        variations=(read_variants(_VARIATIONS),),
        first_seed=0,
        seeds=_FIRST_SEEDS + _SEEDS,
    )
    numbers = range(1, campaign.missions_total + 1)
    first = _FIRST_SEEDS * len(campaign.cases)
    with ProcessPool(jobs) as pool:
        fly_all(map(campaign.job, numbers[:first]), pool, lambda results: None, look=lambda: None)
        began_s = perf_counter()
        fly_all(map(campaign.job, numbers[first:]), pool, lambda results: None, look=lambda: None)
        took_s = perf_counter() - began_s
    return len(numbers[first:]) / took_s
