"""The one place that turns the depth of survey (positive down) into z (positive up)."""

from __future__ import annotations

from msgs_json.drivers import SUBMERGED_Z_M


def survey_z_m(depth_m: float) -> float:
    """
    Return the height of a vehicle at a depth.

    Raises
    ------
    ValueError
        A vehicle at that depth would not count as submerged.

    """
    if not -depth_m <= SUBMERGED_Z_M:
        raise ValueError(f'depth_m is {depth_m}; must be at least {-SUBMERGED_Z_M:g} m')
    return -depth_m
