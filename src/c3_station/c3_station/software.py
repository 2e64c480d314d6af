"""Which Shearwater this is."""

from __future__ import annotations

from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import auv_sim
import c3_station
import msgs_json
import uav_planner

_PACKAGES = (auv_sim, c3_station, msgs_json, uav_planner)


def software_version() -> str:
    """Return the version of what is installed."""
    try:
        return version('c3_station')
    except PackageNotFoundError:
        return 'not installed'


def this_software() -> str:
    """Return the version of Shearwater with a digest of its code."""
    return f'{software_version()}, code {code_digest()}'


def code_digest() -> str:
    """Return twelve characters that differ where any code of Shearwater does."""
    digest = sha256()
    for package in _PACKAGES:
        for folder in package.__path__:
            for file in sorted(Path(folder).rglob('*.py')):
                digest.update(f'{file.relative_to(folder)}\0'.encode() + file.read_bytes())
    return digest.hexdigest()[:12]
