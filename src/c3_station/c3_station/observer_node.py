"""The orchestrator's ear: listens to the graph for the live view, and says nothing."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

from auv_sim.world import WORLD
from c3_station.mission_monitor import MissionMonitor
from c3_station.node_params import C3
from msgs_json.guest_node import GuestNode
from msgs_json.messages import Waiting
from msgs_json.refusals import body_decoder
from msgs_json.ros_messages import (
    ClockTime,
    RosMessage,
    Text,
    clock_from_cdr,
    odometry_from_cdr,
    text_from_cdr,
)
from msgs_json.topics import (
    CLOCK,
    MISSION_EVENTS,
    MISSION_STATUS,
    ODOM,
    RADIO_STATUS,
    WORLD_WAITING,
    Topic,
)

_waiting = body_decoder(Waiting)


class Observer:
    """
    A node in a context of its own; signals stay with the orchestrator.

    It always hears the mission's log and C3's status. Clock and poses, which come at every tick,
    are for a mission that is paced for people: at full speed they would cost a tenth of it, and no
    eye could follow.
    """

    def __init__(
        self,
        domain_id: int,
        monitor: MissionMonitor,
        *,
        every_tick: bool,
        heed: Callable[[Waiting], None] = lambda _: None,
    ) -> None:
        """Listen; ``heed`` is told whom the world waits for."""
        self._monitor = monitor
        self._heed = heed
        self._guest = GuestNode('observer', 'orchestrator', domain_id)
        self._listen(MISSION_EVENTS, '/', _text)
        self._listen(MISSION_STATUS, f'/{C3}', _text)
        self._listen(RADIO_STATUS, f'/{WORLD}', _text)
        self._guest.listen(WORLD_WAITING, self._take_waiting)
        if every_tick:
            self._listen(CLOCK, '/', _clock)
            for name in (monitor.uav_name, *monitor.auvs):
                self._listen(ODOM, f'/{name}', odometry_from_cdr)

    def spin(self, duration_s: float) -> None:
        """Listen for a while."""
        self._guest.spin(duration_s)

    def close(self) -> None:
        """Leave the graph."""
        self._guest.close()

    def _take_waiting(self, cdr: bytes) -> None:
        with suppress(ValueError):  # what is not sound is nothing to heed
            self._heed(_waiting(cdr)[1])

    def _listen(self, topic: Topic, namespace: str, decode: Callable[[bytes], RosMessage]) -> None:
        name = topic.resolve(namespace)

        def take(cdr: bytes) -> None:
            try:
                message = decode(cdr)
            except ValueError:
                return  # the nodes count and log what they refuse; the view shows what is sound
            self._monitor.message(name, message)

        self._guest.listen(topic, take, namespace)


def _text(cdr: bytes) -> Text:
    return Text(text_from_cdr(cdr))


def _clock(cdr: bytes) -> ClockTime:
    return ClockTime(time_s=clock_from_cdr(cdr))
