"""
What the AUVs measure: a scalar field over the region, the same for all of them.

A field is named in JSON, ``{"kind": "synthetic", "seed": 7}`` or ``{"kind": "grid_file", "path":
"sst.nc"}``.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Protocol

import msgspec
import numpy as np

from auv_sim.tagged_json import decode_tagged
from msgs_json.geometry import Point
from msgs_json.randomness import agent_rng

if TYPE_CHECKING:
    from msgs_json.geometry import GridSpec


class SurveyField(Protocol):
    """A scalar field in frame ``map``."""

    def sample(self, point: Point) -> float:
        """Return the value at a point, in the field's unit."""
        ...


class SyntheticFieldSpec(
    msgspec.Struct,
    frozen=True,
    kw_only=True,
    forbid_unknown_fields=True,
    tag_field='kind',
    tag='synthetic',
):
    """A made-up temperature field."""

    seed: Annotated[int, msgspec.Meta(ge=0, le=2**53)] = 0


class GridFileSpec(
    msgspec.Struct,
    frozen=True,
    kw_only=True,
    forbid_unknown_fields=True,
    tag_field='kind',
    tag='grid_file',
):
    """A field on a grid, from a file (`gridded_field`)."""

    path: Annotated[str, msgspec.Meta(min_length=1)]


FieldSpec = SyntheticFieldSpec | GridFileSpec

_decoder: msgspec.json.Decoder[FieldSpec] = msgspec.json.Decoder(FieldSpec)


def make_field(spec_json: str, region: GridSpec) -> SurveyField:
    """
    Return the field that a specification in JSON names.

    Raises
    ------
    ValueError
        Names the field of the specification or the file, the value, and what is allowed.

    """
    spec = decode_tagged('field', spec_json, _decoder)
    if isinstance(spec, SyntheticFieldSpec):
        return SyntheticField(spec.seed, region)
    # Imported here: only missions with a file pay for scipy, in memory and start-up time.
    from auv_sim.gridded_field import read_grid_file

    return read_grid_file(Path(spec.path), region)


MEAN_C = 12.0
"""Temperature in the middle of the region, degrees Celsius: a temperate sea in summer."""
GRADIENT_C = 2.0
"""From one side of the region to the other: a weak front."""
PLUMES = 4
"""Enough for a map with structure, few enough to tell apart."""
PLUME_C = (0.5, 2.0)
"""Excess temperature in the middle of a plume, from ... to: as strong as the front at most."""
PLUME_RADIUS = (0.08, 0.2)
"""Standard deviation of a plume, from ... to, as a share of the region's diagonal."""


class SyntheticField:
    """Sea temperature in degrees Celsius: warm plumes (Gaussians) on a gradient."""

    def __init__(self, seed: int, region: GridSpec) -> None:
        rng = agent_rng(seed, 'survey_field')
        extent_m = np.array([region.cols, region.rows]) * region.cell_m
        diagonal_m = float(np.hypot(*extent_m))
        direction_rad = rng.uniform(-math.pi, math.pi)
        self._middle = Point(east_m=float(extent_m[0]) / 2.0, north_m=float(extent_m[1]) / 2.0)
        self._east_c_per_m = GRADIENT_C / diagonal_m * math.cos(direction_rad)
        self._north_c_per_m = GRADIENT_C / diagonal_m * math.sin(direction_rad)
        middles_m = rng.uniform(0.0, extent_m, size=(PLUMES, 2)).tolist()
        excesses_c = rng.uniform(*PLUME_C, size=PLUMES).tolist()
        radii_m = (rng.uniform(*PLUME_RADIUS, size=PLUMES) * diagonal_m).tolist()
        self._plumes = [
            (Point(east_m=east_m, north_m=north_m), excess_c, radius_m)
            for (east_m, north_m), excess_c, radius_m in zip(
                middles_m, excesses_c, radii_m, strict=True
            )
        ]

    def sample(self, point: Point) -> float:
        """Return the temperature at a point, degrees Celsius."""
        # Point by point without numpy, whose linear algebra keeps a thread spinning on each core.
        temperature_c = MEAN_C
        temperature_c += self._east_c_per_m * (point.east_m - self._middle.east_m)
        temperature_c += self._north_c_per_m * (point.north_m - self._middle.north_m)
        for middle, excess_c, radius_m in self._plumes:
            distance = point.distance_m(middle) / radius_m
            temperature_c += excess_c * math.exp(-0.5 * distance * distance)
        return temperature_c
