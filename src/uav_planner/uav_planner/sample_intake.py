"""Taking samples over from AUVs: those that can be theirs, and a note of those that cannot."""

from __future__ import annotations

from typing import TYPE_CHECKING

from msgs_json.agent import Output, Refuse
from msgs_json.codec import Refusal
from msgs_json.number_set import NumberSet

if TYPE_CHECKING:
    from collections.abc import Iterable

    from msgs_json.custody import SampleCustody
    from msgs_json.geometry import GridSpec
    from msgs_json.messages import Sample
    from msgs_json.store import Store

_REFUSED = 'refused'
"""Kind of the entries of the store that name refused samples, by AUV."""


class SampleIntake:
    """
    Hands sound samples to the custody, and refuses the others.

    An AUV says a sample again and again until somebody holds it. One that is damaged will never
    be taken, so nobody must wait for it.
    """

    def __init__(self, store: Store, custody: SampleCustody) -> None:
        self._store = store
        self._custody = custody
        spans = store.load(_REFUSED, tuple[tuple[int, int], ...])
        self._refused = {auv: NumberSet.from_spans(each) for auv, each in spans.items()}

    def take(self, auv: str, samples: Iterable[Sample], region: GridSpec) -> list[Output]:
        """Take over what an AUV says that it has measured in a region; say what cannot be."""
        sound: list[Sample] = []
        output: list[Output] = []
        for sample in samples:
            problem = _problem_with(sample, auv, region)
            if problem is None:
                sound.append(sample)
            else:
                self._note_refused(auv, sample.number)
                output.append(Refuse(auv, Refusal.CONTRADICTORY, problem))
        self._custody.take(sound)
        return output

    def has_all(self, auv: str, samples_taken: int) -> bool:
        """Return whether nothing is to come of what an AUV has taken, but what was refused."""
        return self._custody.has_all(auv, samples_taken, self._refused.get(auv, NumberSet()))

    def _note_refused(self, auv: str, number: int) -> None:
        refused = self._refused.setdefault(auv, NumberSet())
        if number not in refused:
            refused.add(number, number + 1)
            self._store.put(_REFUSED, auv, refused.spans)


def _problem_with(sample: Sample, auv: str, region: GridSpec) -> str | None:
    """Return why an AUV cannot have taken a sample, or None."""
    if sample.auv != auv:
        return f'sample {sample.number} that {auv} hands over is of {sample.auv}'
    problem = region.problem_with(sample.cell)
    return f'sample {sample.number} of {auv}: {problem}' if problem else None
