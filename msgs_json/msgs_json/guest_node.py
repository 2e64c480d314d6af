"""A node of a process that does other things as well: it hears and speaks when it is let."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic

import rclpy
from rclpy.context import Context
from rclpy.publisher import Publisher
from rclpy.signals import SignalHandlerOptions

from msgs_json.host_node import make_executor, message_class, qos_profile
from msgs_json.topics import Topic


class GuestNode:
    """
    A node in a context and an executor of its own, which takes no part in signals.

    Parameters
    ----------
    name, namespace
        Its name on the graph.
    domain_id
        The graph; None: the one of the environment.

    """

    def __init__(self, name: str, namespace: str, domain_id: int | None) -> None:
        self._context = Context()
        rclpy.init(
            context=self._context,
            domain_id=domain_id,
            signal_handler_options=SignalHandlerOptions.NO,
        )
        self.node = rclpy.create_node(name, namespace=namespace, context=self._context)
        self._executor = make_executor(self._context)
        self._executor.add_node(self.node)

    def publisher(self, topic: Topic, namespace: str = '/') -> Publisher:
        """Return a publisher of raw bytes on somebody's topic."""
        return self.node.create_publisher(
            message_class(topic.ros_type), topic.resolve(namespace), qos_profile(topic.qos)
        )

    def listen(
        self, topic: Topic, callback: Callable[[bytes], None], namespace: str = '/'
    ) -> None:
        """Call back with the raw bytes that come on somebody's topic."""
        self.node.create_subscription(
            message_class(topic.ros_type),
            topic.resolve(namespace),
            callback,
            qos_profile(topic.qos),
            raw=True,
        )

    def spin(self, duration_s: float) -> None:
        """Call back for so long."""
        end_s = monotonic() + duration_s
        while (left_s := end_s - monotonic()) > 0:
            self._executor.spin_once(timeout_sec=left_s)

    def take(self, callbacks: int) -> None:
        """Call back at most so many times, and not wait."""
        for _ in range(callbacks):
            self._executor.spin_once(timeout_sec=0.0)

    def close(self) -> None:
        """Leave the graph at once."""
        self._executor.shutdown()
        self.node.destroy_node()
        self._context.try_shutdown()
        # Only then does nobody see the node any more: the garbage collector may come late.
        self._context.destroy()
