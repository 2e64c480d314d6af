"""Campaigns and results that nobody had to fly."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np

from c3_station.campaign_mission import MissionExit, MissionResult, SortieTimes
from c3_station.campaign_plan import Campaign, plan_campaign
from c3_station.scenario_changes import read_variants

LIMIT_S = 60.0


def sample_campaign(
    *vary: str,
    scenarios: tuple[str, ...] = ('minimal',),
    planners: tuple[str, ...] = ('ecc2009', 'robust'),
    seeds: int = 5,
) -> Campaign:
    return plan_campaign(
        scenarios=scenarios,
        planners=planners,
        variations=[read_variants(text) for text in vary],
        first_seed=0,
        seeds=seeds,
    )


def sample_result(number: int, **fields: Any) -> MissionResult:  # noqa: ANN401
    """Return the result of a mission without trouble, with other figures where they are given."""
    result = MissionResult(
        number=number,
        exit=MissionExit.COMPLETE,
        reason=None,
        explored_s=450.0 + number,
        delivered_s=500.0 + number,
        mission_s=510.0 + number,
        lower_bound_s=330.0,
        neglect_fraction=0.15,
        c3_wait_s=60.0,
        data_age_max_s=110.0,
        sorties_total=2,
        violations=0,
        longest_sortie_s=58.0,
        bound_ratio_max=0.9831,
        missed=0,
        searches_broken_off=0,
        auvs_lost=0,
        samples_collected=140,
        samples_delivered=140,
        samples_lost=0,
        samples_doubled=0,
        restarts=0,
        forged=0,
        obeyed=0,
        refused=0,
        moves_total=120,
        revisits=20,
        sortie_times=(SortieTimes(58.0, 59.0, LIMIT_S), SortieTimes(44.0, 45.0, LIMIT_S)),
        wall_s=0.1,
    )
    return msgspec.structs.replace(result, **fields)


def sample_results(campaign: Campaign) -> list[MissionResult]:
    """Return results of all missions, scattered as real ones are; ecc2009 breaks the limit."""
    rng = np.random.default_rng(9)
    results = []
    for number in range(1, campaign.missions_total + 1):
        case, _ = campaign.place(number)
        late = campaign.cases[case].planner == 'ecc2009' and rng.random() < 0.6
        worst_s = rng.uniform(40.0, LIMIT_S, 10) + (15.0 if late else 0.0)
        times = tuple(
            SortieTimes(float(worst * share), float(worst), LIMIT_S)
            for worst, share in zip(worst_s, rng.uniform(0.6, 1.0, 10), strict=True)
        )
        durations_s = [each.duration_s or 0.0 for each in times]
        results.append(
            sample_result(
                number,
                explored_s=float(rng.normal(600.0, 60.0)) if rng.random() < 0.95 else None,
                neglect_fraction=float(rng.uniform(0.1, 0.6)),
                c3_wait_s=float(rng.uniform(50.0, 200.0)),
                data_age_max_s=float(rng.normal(110.0, 6.0)),
                sorties_total=len(times),
                violations=sum(duration_s > LIMIT_S for duration_s in durations_s),
                longest_sortie_s=max(durations_s),
                bound_ratio_max=max(
                    each.duration_s / each.worst_case_s for each in times if each.duration_s
                ),
                sortie_times=times,
            )
        )
    return results
