"""
Where and when a simulated AUV comes up: the uncertainty that the whole method is about.

A model is named in JSON (``{"model": "early", "probability": 0.1}``) and tells the fate of a leg
when the leg begins, drawn from the AUV's own generator. A model that draws does so equally often
whatever comes out, so that the fate of one leg does not shift the draws of the next.

Times are seconds since the AUV was put into the water, which is the mission's time in simulation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import msgspec

from auv_sim.tagged_json import decode_tagged
from msgs_json.straight_motion import STILL, Flow

if TYPE_CHECKING:
    import numpy as np

CurrentMps = Annotated[float, msgspec.Meta(ge=-100, le=100)]
TimeS = Annotated[float, msgspec.Meta(ge=0, le=1e7)]


@dataclass(frozen=True, slots=True, kw_only=True)
class LegFate:
    """What happens to an AUV from the beginning of a leg to that of the next; as is: nothing."""

    surfaces_at: int | None = None
    """
    Place at which it comes up by itself; None where it waits to be told.

    Place 0 is where the leg begins (the centre of P_0), place k its k-th waypoint (P_k).
    """
    speed_factor: float = 1.0
    """Its speed through the water, as a share of the nominal one."""
    current: Flow = STILL
    """It holds its track against it."""
    needs_help_s: float = math.inf
    """From then on it has a fault for which it must come up."""
    lost_s: float = math.inf
    """From then on an AUV under water neither swims nor comes up: it lies where it is."""


class _Model(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field='model'
):
    """Base of the models."""

    def draw(self, waypoints_total: int, rng: np.random.Generator) -> LegFate:
        """Return the fate of a leg; nothing is drawn."""
        return LegFate()


class OnTime(_Model, frozen=True, kw_only=True, tag='on_time'):
    """The AUV swims the whole leg (the nominal case of ECC 2009)."""


class Early(_Model, frozen=True, kw_only=True, tag='early'):
    """The AUV may come up at any cell before the last (the uncertain surfacing of ECC 2009)."""

    probability: Annotated[float, msgspec.Meta(ge=0, le=1, description='per leg')]

    def draw(self, waypoints_total: int, rng: np.random.Generator) -> LegFate:
        """Return the fate of a leg: with ``probability`` one of P_0 ... P_{q-1}, all alike."""
        comes_up, where = rng.random(2)
        if comes_up >= self.probability:
            return LegFate()
        return LegFate(surfaces_at=int(where * waypoints_total))


class Slow(_Model, frozen=True, kw_only=True, tag='slow'):
    """The AUV swims slower than planned, or in a current; its surface time finds it anywhere."""

    least_factor: Annotated[float, msgspec.Meta(gt=0, le=1)] = 1.0
    """The speed of each leg lies between this share of the nominal one and the whole of it."""
    current_east_mps: CurrentMps = 0.0
    current_north_mps: CurrentMps = 0.0

    def draw(self, waypoints_total: int, rng: np.random.Generator) -> LegFate:
        """Return the fate of a leg: a speed, all between the bounds alike, and the current."""
        return LegFate(
            speed_factor=rng.uniform(self.least_factor, 1.0),
            current=Flow(east_mps=self.current_east_mps, north_mps=self.current_north_mps),
        )


class Abort(_Model, frozen=True, kw_only=True, tag='abort'):
    """The AUV comes up at a time, wherever it is, and asks for help."""

    at_s: TimeS

    def draw(self, waypoints_total: int, rng: np.random.Generator) -> LegFate:
        """Return the fate of a leg; nothing is drawn."""
        return LegFate(needs_help_s=self.at_s)


class Lost(_Model, frozen=True, kw_only=True, tag='lost'):
    """The AUV never comes up from a time on; one that is up then is lost when it next dives."""

    from_s: TimeS

    def draw(self, waypoints_total: int, rng: np.random.Generator) -> LegFate:
        """Return the fate of a leg; nothing is drawn."""
        return LegFate(lost_s=self.from_s)


class Silent(_Model, frozen=True, kw_only=True, tag='silent'):
    """
    The AUV swims and surfaces on time, but its radio is dead for a while.

    That is the radio channel's affair: see `radio_channel.RadioOutage`.
    """

    from_s: TimeS
    sorties: Annotated[int, msgspec.Meta(ge=1, le=1000)]
    """For how long: as many times the sortie limit."""


SurfacingModel = OnTime | Early | Slow | Abort | Lost | Silent

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
