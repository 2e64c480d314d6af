"""Every random draw of a mission comes from here: one seed, one stream per agent."""

from __future__ import annotations

import numpy as np


def agent_rng(seed: int, name: str) -> np.random.Generator:
    """
    Return the random stream of an agent.

    Streams are spawned by name, so that adding a vehicle does not change what the others draw.
    """
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=tuple(name.encode())))
