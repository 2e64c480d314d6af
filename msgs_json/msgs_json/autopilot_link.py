"""
The link of a ``topics`` driver to an autopilot: setpoints out, measured poses in.

Setpoints are geometry_msgs/PoseStamped on `topics.SETPOINT`, poses nav_msgs/Odometry on
`topics.VEHICLE_ODOM`, both in frame ``map``. MAVROS has both under these names in its own
namespace, so two remappings join it. Its local origin must lie at the region's south-west corner,
with z = 0 at the sea surface. PX4 leaves its offboard mode where setpoints come at 2 Hz or less:
with PX4 a tick must be shorter than 0.5 s; ArduPilot's guided mode holds the last setpoint.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from msgs_json.drivers import VehicleUnavailableError
from msgs_json.ros_messages import Odometry, PoseSetpoint
from msgs_json.topics import SETPOINT, VEHICLE_ODOM

if TYPE_CHECKING:
    from msgs_json.drivers import DriverPorts

POSE_LIMIT_S = 5.0
"""
A pose older than this is no pose.

Autopilots send several a second, so this is no single lost message but a lost link; a UAV at 4 m/s
has by then left the place by 20 m, the reference mission's radio range.
"""


class AutopilotLink:
    """Remembers the last pose of the vehicle, and when it came."""

    def __init__(self, ports: DriverPorts) -> None:
        self._ports = ports
        self._pose: Odometry | None = None
        self._is_new = False
        self._heard_s = 0.0
        ports.subscribe_odometry(VEHICLE_ODOM, self._hear)

    @property
    def last_pose(self) -> Odometry | None:
        """The last pose, however old; None before the first."""
        return self._pose

    def pose(self, now_s: float) -> Odometry:
        """
        Return the last pose; ask at every step.

        Its age counts from the step that found it new, not from its stamp: the autopilot's clock
        may not be this node's.

        Raises
        ------
        VehicleUnavailableError
            There is none, or none for `POSE_LIMIT_S`.

        """
        if self._is_new:
            self._heard_s, self._is_new = now_s, False
        if self._pose is None:
            raise VehicleUnavailableError(f'no pose on {VEHICLE_ODOM.name} yet')
        age_s = now_s - self._heard_s
        if age_s > POSE_LIMIT_S:
            raise VehicleUnavailableError(
                f'no pose on {VEHICLE_ODOM.name} for {age_s:.1f} s; limit is {POSE_LIMIT_S:g} s'
            )
        return self._pose

    def send(self, setpoint: PoseSetpoint) -> None:
        """Send a setpoint; autopilots need it at every step, changed or not."""
        self._ports.publish(SETPOINT, setpoint)

    def _hear(self, odometry: Odometry) -> None:
        self._pose, self._is_new = odometry, True
