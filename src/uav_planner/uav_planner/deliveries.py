"""What the UAV brings to C3: reports of its sorties, and samples, until C3 has them."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

from msgs_json.agent import Output, Transmit
from msgs_json.messages import SortieReport

if TYPE_CHECKING:
    from msgs_json.custody import SampleCustody
    from msgs_json.messages import SampleSpan
    from msgs_json.store import Store

_REPORT = 'report'
"""Kind of the entries of the store that are reports."""


class Deliveries:
    """
    Reports that C3 has not acknowledged, oldest first, and samples that it has not.

    Parameters
    ----------
    c3
        Name of the station.
    store
        Keeps the reports.
    custody
        Keeps the samples.

    """

    def __init__(self, c3: str, store: Store, custody: SampleCustody) -> None:
        self._c3 = c3
        self._store = store
        self._custody = custody
        reports = store.load(_REPORT, SortieReport).values()
        self._reports = deque(sorted(reports, key=lambda report: report.sortie))

    @property
    def cargo(self) -> tuple[SampleSpan, ...]:
        """Return the samples that C3 has not, as far as is known here."""
        return self._custody.spans

    @property
    def is_done(self) -> bool:
        """Return whether C3 has everything."""
        return not self._reports and not self.cargo

    def add(self, report: SortieReport) -> None:
        """Have C3 told of another sortie."""
        self._reports.append(report)
        self._store.put(_REPORT, str(report.sortie), report)

    def acknowledged(self, sortie_number: int) -> bool:
        """Note that C3 has the report of a sortie; return False for a late copy of that word."""
        if not self._reports or sortie_number != self._reports[0].sortie:
            return False
        self._reports.popleft()
        self._store.drop(_REPORT, str(sortie_number))
        return True

    def say(self, now_s: float, *, with_samples: bool) -> list[Output]:
        """Say the oldest report that C3 lacks, and what is due of the samples."""
        output: list[Output] = [Transmit(self._c3, report) for report in [*self._reports][:1]]
        if with_samples:
            output += [Transmit(self._c3, batch) for batch in self._custody.batches(now_s)]
        return output
