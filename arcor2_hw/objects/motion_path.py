"""MotionPath: a path of a robot, planned by `SafeMoves`."""

import dataclasses
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from arcor2_hw.data.robot import Joint
from arcor2_hw.exceptions import Refused
from arcor2_hw.objects.obstacle_snapshot import JOINT_TOLERANCE
from arcor2_hw.objects.path_monitor import PlannedPath

if TYPE_CHECKING:
    from arcor2_hw.planning.timing import Trajectory


@dataclasses.dataclass(frozen=True)
class MotionPath:
    """A planned path. Between two waypoints all joints move in proportion.

    Attributes:
        waypoints: Joint values; the first are those at the start.
        speed: Fraction of the maxima.
        line: Whether the end effector moves in a straight line; the waypoints are then closely spaced.
    """

    waypoints: list[list[Joint]]
    speed: float
    line: bool
    _timed: "Callable[[float | None], Trajectory]" = dataclasses.field(repr=False)
    _planned: PlannedPath | None = dataclasses.field(default=None, repr=False)

    def require_begin(self, name: str, now: Sequence[Joint]) -> None:
        """Require that the robot is still at the start of the path.

        Raises:
            Refused: It was moved since planning.
        """
        present = {joint.name: joint.value for joint in now}
        for joint in self.waypoints[0]:
            if abs(present[joint.name] - joint.value) > JOINT_TOLERANCE:
                raise Refused("{name} was moved while its path was planned. Start the move again.", name=name)

    def timed(self, tcp_speed: float | None = None) -> "Trajectory":
        """Return joint values and velocities over time, for controllers that need them; see `Trajectory.sampled`.

        The limits are those of the URDF times `speed`. The robot stops at the waypoints of a path that is not a line,
        because only the path itself was checked for collisions.

        Args:
            tcp_speed: Maximum speed along a line, m/s; None: as fast as the joints allow.
        """
        return self._timed(tcp_speed)
