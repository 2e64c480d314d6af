"""The orchestrator's ear: listens to the graph for the live view, and says nothing."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic

import rclpy
from rclpy.context import Context
from rclpy.signals import SignalHandlerOptions

from c3_station.mission_monitor import MissionMonitor
from msgs_json import codec
from msgs_json.codec import MessageError
from msgs_json.host_node import make_executor, message_class, qos_profile
from msgs_json.messages import Event
from msgs_json.ros_messages import clock_from_cdr, odometry_from_cdr, text_from_cdr
from msgs_json.topics import CLOCK, MISSION_EVENTS, ODOM, Topic


class Observer:
    """
    A node in a context of its own; signals stay with the orchestrator.

    It always hears the mission's log. Clock and poses, which come at every tick, are for a
    mission that is paced for people: at full speed they would cost a tenth of it, and no eye could
    follow.
    """

    def __init__(self, domain_id: int, monitor: MissionMonitor, *, every_tick: bool) -> None:
        self._monitor = monitor
        self._context = Context()
        rclpy.init(
            context=self._context,
            domain_id=domain_id,
            signal_handler_options=SignalHandlerOptions.NO,
        )
        self._node = rclpy.create_node('observer', namespace='orchestrator', context=self._context)
        self._executor = make_executor(self._context)
        self._executor.add_node(self._node)
        self._listen(MISSION_EVENTS, '/', self._event)
        if every_tick:
            self._listen(CLOCK, '/', self._clock)
            for name in (monitor.uav_name, *monitor.auvs):
                self._listen(ODOM, f'/{name}', self._odometry(name))

    def spin(self, duration_s: float) -> None:
        """Listen for a while."""
        end_s = monotonic() + duration_s
        while (left_s := end_s - monotonic()) > 0:
            self._executor.spin_once(timeout_sec=left_s)

    def close(self) -> None:
        """Leave the graph."""
        self._node.destroy_node()
        self._context.try_shutdown()

    def _listen(self, topic: Topic, namespace: str, callback: Callable[[bytes], None]) -> None:
        self._node.create_subscription(
            message_class(topic.ros_type),
            topic.resolve(namespace),
            callback,
            qos_profile(topic.qos),
            raw=True,
        )

    def _clock(self, cdr: bytes) -> None:
        self._monitor.clock(clock_from_cdr(cdr))

    def _event(self, cdr: bytes) -> None:
        try:
            envelope, body = codec.decode(text_from_cdr(cdr))
        except (ValueError, MessageError):
            return  # the nodes count and log what they refuse; the view shows what is sound
        if isinstance(body, Event):
            self._monitor.event(envelope.src, envelope.stamp, body)

    def _odometry(self, name: str) -> Callable[[bytes], None]:
        def take(cdr: bytes) -> None:
            self._monitor.odometry(name, odometry_from_cdr(cdr))

        return take
