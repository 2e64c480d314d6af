"""The environment of nodes that have a ROS graph to themselves."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path


def graph_environment(domain: int, logs: Path) -> dict[str, str]:
    """Return the variables that put nodes on a graph of their own, on loopback."""
    return {
        'ROS_DOMAIN_ID': str(domain),
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
        'ROS_LOG_DIR': str(logs.resolve() / 'ros'),
        # Nothing to clean up in shared memory when a node is killed, and just as fast.
        'FASTDDS_BUILTIN_TRANSPORTS': 'UDPv4',
        # Peers find each other within a second, and notice within five that one is gone.
        'FASTRTPS_DEFAULT_PROFILES_FILE': str(files('c3_station') / 'fastdds_profile.xml'),
    }
