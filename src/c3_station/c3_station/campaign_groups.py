"""
A campaign's results, sorted for comparison: sections of scenarios, in them groups of missions.

A section is one scenario; where there are many (generated ones), one section holds them all. A
group is all that was flown in a section with one variation and one planner.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from c3_station.campaign_mission import MissionExit
from c3_station.campaign_statistics import Share, Spread, spread_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    from c3_station.campaign_mission import MissionResult
    from c3_station.campaign_plan import Campaign

_SECTIONS_MAX = 6
"""With more scenarios than this, nobody compares them one by one."""

FlightKey = tuple[str, int]
"""
What was flown, and the seed: missions of two groups with the same key had the same draws.

What was flown is named by its scenario; where a group has several variations, by both.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Metric:
    """A figure of a mission; less is better."""

    name: str
    title: str
    unit: str
    value: Callable[[MissionResult], float | None]


def _explored_ratio(result: MissionResult) -> float | None:
    if result.explored_s is None or not result.lower_bound_s:
        return None
    return result.explored_s / result.lower_bound_s


def _neglect_percent(result: MissionResult) -> float | None:
    return None if result.neglect_fraction is None else 100.0 * result.neglect_fraction


EXPLORED = Metric(
    name='explored', title='Region explored', unit='s', value=lambda result: result.explored_s
)
EXPLORED_RATIO = Metric(
    name='explored',
    title='Region explored, over the lower bound of its scenario',
    unit='\N{MULTIPLICATION SIGN}',
    value=_explored_ratio,
)
NEGLECT = Metric(name='neglect', title='Neglect', unit='%', value=_neglect_percent)
C3_WAIT = Metric(
    name='c3_wait',
    title='UAV waits at C3 in all',
    unit='s',
    value=lambda result: result.c3_wait_s,
)
DATA_AGE = Metric(
    name='data_age',
    title='Age of the oldest undelivered sample',
    unit='s',
    value=lambda result: result.data_age_max_s,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Group:
    """What was flown in a section with one variation and one planner."""

    variation: str
    planner: str
    results: Mapping[FlightKey, MissionResult]

    @property
    def sorties(self) -> Share:
        """Return how many of all sorties were over their limit."""
        flown = self.results.values()
        return Share(
            count=sum(result.violations for result in flown),
            total=sum(result.sorties_total for result in flown),
        )

    @property
    def missions(self) -> int:
        """Return how many missions were flown."""
        return len(self.results)

    @property
    def violations(self) -> Share:
        """Return in how many missions a sortie was over its limit."""
        return self.share(lambda result: result.violations > 0)

    @property
    def errors(self) -> int:
        """Return in how many missions the software failed."""
        return self.share(lambda result: result.exit is MissionExit.ERROR).count

    @property
    def stopped(self) -> int:
        """Return how many missions came to their hard stop."""
        return self.share(lambda result: result.exit is MissionExit.STOPPED).count

    @property
    def missed(self) -> int:
        """Return how many searches found no AUV although it was on its path."""
        return sum(result.missed for result in self.results.values())

    @property
    def auvs_lost(self) -> int:
        """Return how many AUVs were given up."""
        return sum(result.auvs_lost for result in self.results.values())

    @property
    def samples_lost(self) -> int:
        """Return how many samples did not come to C3."""
        return sum(result.samples_lost or 0 for result in self.results.values())

    @property
    def bound_ratio_max(self) -> float | None:
        """Return the largest realised sortie time over its worst case."""
        ratios = [result.bound_ratio_max for result in self.results.values()]
        return max((ratio for ratio in ratios if ratio is not None), default=None)

    def share(self, holds: Callable[[MissionResult], bool]) -> Share:
        """Return for how many missions something holds."""
        count = sum(holds(result) for result in self.results.values())
        return Share(count=count, total=len(self.results))

    def spread(self, metric: Metric) -> Spread | None:
        """Return how a figure is distributed; None where no mission has it."""
        return spread_of(metric.value(result) for result in self.results.values())


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """Groups that are compared with each other."""

    title: str
    scenarios: tuple[str, ...]
    groups: tuple[Group, ...]
    """Variation by variation; in each, planner by planner in the order asked for."""

    @property
    def planners(self) -> tuple[str, ...]:
        """Return the planners in the order of the campaign."""
        return tuple(dict.fromkeys(group.planner for group in self.groups))

    @property
    def variations(self) -> tuple[str, ...]:
        """Return the variations in the order of the campaign."""
        return tuple(dict.fromkeys(group.variation for group in self.groups))

    @property
    def metrics(self) -> tuple[Metric, ...]:
        """Return the figures that are compared; a time to explore only in one and the same sea."""
        explored = EXPLORED if len(self.scenarios) == 1 else EXPLORED_RATIO
        return (explored, NEGLECT, C3_WAIT, DATA_AGE)

    def beside_first(self) -> Iterator[tuple[Group, Group]]:
        """Yield the groups of every planner but the first, each with the first one's beside it."""
        first = self.planners[0]
        bases = {group.variation: group for group in self.groups if group.planner == first}
        for group in self.groups:
            if group.planner != first and group.variation in bases:
                yield group, bases[group.variation]


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """A figure of two planners on the same seeds: that of one minus that of the other."""

    difference: Spread
    better: Share
    """Seeds on which it is less than with the other planner."""
    worse: Share


def compare(group: Group, base: Group, metric: Metric) -> Comparison | None:
    """Return how a group does beside another, mission by mission; None without common figures."""
    differences = []
    for key, result in group.results.items():
        if key in base.results:
            value, other = metric.value(result), metric.value(base.results[key])
            if value is not None and other is not None:
                differences.append(value - other)
    difference = spread_of(differences)
    if difference is None:
        return None
    return Comparison(
        difference=difference,
        better=Share(count=sum(each < 0 for each in differences), total=len(differences)),
        worse=Share(count=sum(each > 0 for each in differences), total=len(differences)),
    )


def totals_of(campaign: Campaign, results: Iterable[MissionResult]) -> tuple[Group, ...]:
    """Return all that was flown with each planner, as one group."""
    found: dict[str, dict[FlightKey, MissionResult]] = {}
    for result in results:
        case_index, seed = campaign.place(result.number)
        case = campaign.cases[case_index]
        flown = found.setdefault(case.planner, {})
        flown[f'{case.scenario} {case.variation}', seed] = result
    return tuple(
        Group(variation='all', planner=planner, results=flown) for planner, flown in found.items()
    )


def sections_of(campaign: Campaign, results: Iterable[MissionResult]) -> tuple[Section, ...]:
    """Return all sections of a campaign; of which nothing is flown yet is left out."""
    scenarios = tuple(dict.fromkeys(case.scenario for case in campaign.cases))
    together = len(scenarios) > _SECTIONS_MAX
    found: dict[str, dict[tuple[str, str], dict[FlightKey, MissionResult]]] = {}
    groups = []
    for case in campaign.cases:
        title = f'{len(scenarios)} scenarios' if together else case.scenario
        section = found.setdefault(title, {})
        groups.append(section.setdefault((case.variation, case.planner), {}))
    for result in results:
        case_index, seed = campaign.place(result.number)
        groups[case_index][campaign.cases[case_index].scenario, seed] = result
    return tuple(
        Section(
            title=title,
            scenarios=scenarios if together else (title,),
            groups=tuple(
                Group(variation=variation, planner=planner, results=flown)
                for (variation, planner), flown in section.items()
                if flown
            ),
        )
        for title, section in found.items()
        if any(section.values())
    )
