"""The clock of an agent in real time: set once from the ROS clock, steady from then on."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

if TYPE_CHECKING:
    from msgs_json.store import Store

_CLOCK = 'clock'
"""Kind of the one entry of the store."""


class _Base(msgspec.Struct, frozen=True, kw_only=True):
    """The same moment on two clocks."""

    ros_s: float
    steady_s: float
    boot_id: str
    """Of the machine: its steady clock begins anew with each boot."""


class MissionClock:
    """
    Tells a mission's time, which no correction of the ROS clock makes jump.

    A process that is started again goes on with the base of the one before. Only where the machine
    has booted meanwhile the ROS clock is asked again.

    Parameters
    ----------
    store
        Where the base is kept; a new one lasts from the store's next commit on.
    ros_s
        The ROS clock, seconds since its epoch.
    steady_s
        The machine's steady clock at the same moment, seconds since any moment of this boot.
    boot_id
        Names the boot.
    latest_s
        When anything was stored last, mission time: it never goes back behind that, though a
        machine without a battery for its clock may boot in the past.

    Raises
    ------
    StoreError
        What is stored cannot be read.

    """

    def __init__(
        self,
        store: Store,
        *,
        ros_s: float,
        steady_s: float,
        boot_id: str,
        latest_s: float = 0.0,
    ) -> None:
        base = store.load(_CLOCK, _Base).get('')
        if base is None or base.boot_id != boot_id:
            base = _Base(ros_s=max(ros_s, latest_s), steady_s=steady_s, boot_id=boot_id)
            store.put(_CLOCK, '', base)
        self._base = base

    def now_s(self, steady_s: float) -> float:
        """Return the mission's time for a time of the steady clock."""
        return self._base.ros_s + (steady_s - self._base.steady_s)
