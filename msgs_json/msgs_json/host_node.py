"""
What every node is made of: topics as raw CDR bytes, declared parameters, and the one main.

Bytes go in and out as they are: `ros_messages` converts, the same way for topics and for bags.
"""

from __future__ import annotations

import contextlib
import importlib
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from copy import copy
from functools import cache
from typing import Any, TypeVar

import rclpy
from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.context import Context
from rclpy.exceptions import ParameterException
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rclpy.utilities import try_shutdown

from msgs_json.codec import MessageError
from msgs_json.node_exit import NodeExit
from msgs_json.params import Params, ParamSpec, specs, validated
from msgs_json.refusals import Refusals
from msgs_json.ros_messages import prepare
from msgs_json.store import StoreError
from msgs_json.topics import Qos, Topic

STEADY_CLOCK = Clock(clock_type=ClockType.STEADY_TIME)
"""Wall time that is never set back, for what has to do with processes, not with missions."""

_MICROSECOND_NS = 1000

_PULSE_S = 0.1
"""A signal is noticed at the latest after this time."""

_TEARDOWN_S = 3
"""Leaving the graph takes less than 0.2 s."""

_ARRAY_TYPES: dict[type | None, Parameter.Type] = {
    int: Parameter.Type.INTEGER_ARRAY,
    float: Parameter.Type.DOUBLE_ARRAY,
    str: Parameter.Type.STRING_ARRAY,
}

ParamsT = TypeVar('ParamsT', bound=Params)
PayloadT = TypeVar('PayloadT')


def steady_us() -> int:
    """Return microseconds of the machine's steady clock, which tell lives apart."""
    return STEADY_CLOCK.now().nanoseconds // _MICROSECOND_NS


class SetupError(ValueError):
    """A node cannot start as it was told to; the text names the node and what is wrong."""


class HostedNode(Node):
    """A node whose callbacks get bytes, and whose refusals are counted and logged once."""

    def __init__(
        self,
        name: str,
        namespace: str,
        *,
        is_fixed: bool = False,
        use_sim_time: bool | None = None,
    ) -> None:
        """
        Create the node.

        Parameters
        ----------
        name, namespace
            Defaults, which the command line may change.
        is_fixed
            One of several nodes in a process: the command line must not rename it.
        use_sim_time
            Fixed here; None leaves it to the parameter.

        """
        fixed = ['--ros-args', '-r', f'__node:={name}', '-r', f'__ns:={namespace}']
        sim_time = [] if use_sim_time is None else [Parameter('use_sim_time', value=use_sim_time)]
        super().__init__(
            name,
            namespace=namespace,
            cli_args=fixed if is_fixed else None,
            parameter_overrides=sim_time,
        )
        self.on_end: Callable[[NodeExit], None]
        """To be called when the node's work is over; set by `run`."""
        self.is_told_to_end: Callable[[], bool]
        """Whether a signal has come, for callbacks that take long; set by `run`."""
        self.log = self.get_logger()  # type: ignore[no-untyped-call]
        self.refusals = Refusals(self.log.warning)

    def close(self) -> None:
        """Say and save what must not be lost; topics still work."""

    @contextlib.contextmanager
    def setup(self) -> Iterator[None]:
        """Name the node in errors of its set-up, which end the process with one clear line."""
        try:
            yield
        except (ValueError, StoreError, ParameterException) as error:
            raise SetupError(f'{self.get_fully_qualified_name()}: {error}') from error

    def params(self, params_type: type[ParamsT], **forced: object) -> ParamsT:
        """
        Declare the node's parameters and return their values.

        ``forced`` replaces values that the parameters leave empty.
        """
        values = {spec.name: self._declared(spec) for spec in specs(params_type)}
        values |= {name: value for name, value in forced.items() if not values[name]}
        return validated(params_type, values)

    def _declared(self, spec: ParamSpec) -> Any:  # noqa: ANN401  bool, int, float, str or list
        default = spec.default
        if spec.value_type is list:
            # An empty list has no type of its own, so none is given and NOT_SET stands for it.
            default = list(default) or _ARRAY_TYPES[spec.item_type]
        self.declare_parameter(spec.name, default, _descriptor(spec))
        value = self.get_parameter_or(spec.name).value
        return list(value or ()) if spec.value_type is list else value

    def raw_publisher(self, topic: Topic, namespace: str = '') -> Publisher:
        """Return a publisher of CDR bytes; in the node's own namespace unless one is given."""
        prepare(topic.ros_type)
        name = topic.resolve(namespace) if namespace else topic.name
        return self.create_publisher(message_class(topic.ros_type), name, qos_profile(topic.qos))

    def listen(
        self,
        topic: Topic,
        decode: Callable[[bytes], PayloadT],
        handle: Callable[[PayloadT], None],
        namespace: str = '',
    ) -> None:
        """Hand over what comes on a topic, decoded; what either function refuses is counted."""
        name = topic.resolve(namespace) if namespace else topic.name

        def take(cdr: bytes) -> None:
            try:
                payload = decode(cdr)
            except ValueError as error:
                self.refusals.add(name, error)
                return
            try:
                handle(payload)
            except MessageError as error:
                self.refusals.add(name, error)

        self.create_subscription(
            message_class(topic.ros_type), name, take, _listening_profile(topic.qos), raw=True
        )

    def every(self, wall_s: float, callback: Callable[[], None]) -> None:
        """Call back again and again, by the steady clock."""
        self.create_timer(wall_s, callback, clock=STEADY_CLOCK)


def run(make_nodes: Callable[[], Sequence[HostedNode]]) -> int:
    """
    Run nodes in one executor until a signal comes or one of them ends; return the exit code.

    Signals only end the loop (rclpy's own handlers would shut the context down), so that nodes
    can still publish and save in `HostedNode.close`; a second signal changes nothing.
    """
    end = Future()
    exit_code = NodeExit.OK
    signals: list[int] = []
    for signum in (signal.SIGINT, signal.SIGTERM):
        signal.signal(signum, lambda signum, frame: signals.append(signum))

    def finish(code: NodeExit) -> None:
        nonlocal exit_code
        exit_code = max(exit_code, code)
        if not end.done():
            end.set_result(None)

    def look_for_signals() -> None:
        if signals:
            finish(NodeExit.OK)

    nodes: Sequence[HostedNode] = ()
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        executor = make_executor()
        nodes = make_nodes()
        for node in nodes:
            node.on_end = finish
            node.is_told_to_end = lambda: bool(signals)
            executor.add_node(node)
        # Python runs its signal handlers only when it runs anything at all.
        nodes[0].every(_PULSE_S, look_for_signals)
        while not end.done():
            # Not spin, which hangs in rclpy 7.1, and not spin_once, which costs a third more for
            # each message. The timeout is never reached, but without one this hangs, too.
            executor.spin_until_future_complete(end, timeout_sec=3600.0)
    except (SetupError, rclpy_implementation.RCLError) as error:
        sys.stderr.write(f'{error}\n')
        finish(NodeExit.BAD_PARAMETERS)
    except ExternalShutdownException:
        finish(NodeExit.OK)
    finally:
        for node in nodes:
            node.close()
        # Seen once in a thousand ends: Fast DDS spins for ever where its peers leave at the same
        # moment. Everything is said and saved by now.
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.alarm(_TEARDOWN_S)
        for node in nodes:
            node.destroy_node()  # type: ignore[no-untyped-call]
        try_shutdown()
        signal.alarm(0)
    return exit_code


def make_executor(context: Context | None = None) -> Executor:
    """Return the fastest executor there is; never call ``spin`` of it (see `run`)."""
    try:
        from rclpy.experimental.events_executor import EventsExecutor
    except ImportError:  # an rclpy before 7.1
        return SingleThreadedExecutor(context=context)
    return EventsExecutor(context=context)


@cache
def message_class(ros_type: str) -> Any:  # noqa: ANN401  a generated class
    """Return the class of a message type such as ``std_msgs/msg/String``."""
    package, _, name = ros_type.split('/')
    return getattr(importlib.import_module(f'{package}.msg'), name)


@cache
def qos_profile(qos: Qos) -> QoSProfile:
    """Return a named quality of service as ROS has it."""
    spec = qos.value
    return QoSProfile(
        depth=spec.depth,
        reliability=(
            ReliabilityPolicy.RELIABLE if spec.reliable else ReliabilityPolicy.BEST_EFFORT
        ),
        durability=(
            DurabilityPolicy.TRANSIENT_LOCAL if spec.transient_local else DurabilityPolicy.VOLATILE
        ),
    )


def _listening_profile(qos: Qos) -> QoSProfile:
    """Return a profile whose queue holds what the node has not come to yet."""
    profile = copy(qos_profile(qos))
    profile.depth = max(profile.depth, Qos.STREAM.value.depth)
    return profile


def _descriptor(spec: ParamSpec) -> ParameterDescriptor:
    unit = f' [{spec.unit}]' if spec.unit else ''
    descriptor = ParameterDescriptor(description=spec.description + unit, read_only=True)
    if spec.minimum is not None and spec.maximum is not None:
        if spec.value_type is float:
            limits = FloatingPointRange(
                from_value=float(spec.minimum), to_value=float(spec.maximum)
            )
            descriptor.floating_point_range = [limits]
        else:
            limits = IntegerRange(from_value=int(spec.minimum), to_value=int(spec.maximum), step=1)
            descriptor.integer_range = [limits]
    return descriptor
