"""
Where a simulated AUV comes up: the uncertainty that the whole method is about.

A model is named in JSON (``{"model": "early", "probability": 0.1}``) and draws the fate of each
leg when the leg begins, from the AUV's own generator.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import msgspec

from auv_sim.tagged_json import decode_tagged

if TYPE_CHECKING:
    import numpy as np


@dataclass(frozen=True, slots=True, kw_only=True)
class LegFate:
    """What happens to an AUV on a leg."""

    surfaces_at: int | None
    """
    Place at which it comes up by itself; None where it waits to be told.

    Place 0 is where the leg begins (the centre of P_0), place k its k-th waypoint (P_k).
    """


class OnTime(
    msgspec.Struct,
    frozen=True,
    kw_only=True,
    forbid_unknown_fields=True,
    tag_field='model',
    tag='on_time',
):
    """The AUV swims the whole leg (the nominal case of ECC 2009)."""

    def draw(self, waypoints_total: int, rng: np.random.Generator) -> LegFate:
        """Return the fate of a leg; nothing is drawn."""
        return LegFate(surfaces_at=None)


class Early(
    msgspec.Struct,
    frozen=True,
    kw_only=True,
    forbid_unknown_fields=True,
    tag_field='model',
    tag='early',
):
    """The AUV may come up at any cell before the last (the uncertain surfacing of ECC 2009)."""

    probability: Annotated[float, msgspec.Meta(ge=0, le=1, description='per leg')]

    def draw(self, waypoints_total: int, rng: np.random.Generator) -> LegFate:
        """
        Return the fate of a leg: with ``probability`` one of P_0 ... P_{q-1}, all alike.

        Two draws whatever comes out, so that one leg's fate does not shift the draws of the next.
        """
        comes_up, where = rng.random(2)
        if comes_up >= self.probability:
            return LegFate(surfaces_at=None)
        return LegFate(surfaces_at=int(where * waypoints_total))


SurfacingModel = OnTime | Early

_decoder: msgspec.json.Decoder[SurfacingModel] = msgspec.json.Decoder(SurfacingModel)


def surfacing_model(spec_json: str) -> SurfacingModel:
    """
    Return the surfacing model named in JSON.

    Raises
    ------
    ValueError
        Names the field, its value and what is allowed.

    """
    return decode_tagged('surfacing', spec_json, _decoder)
