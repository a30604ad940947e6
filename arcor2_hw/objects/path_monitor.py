"""Monitoring of obstacles during a safe move: the robot stops when an obstacle comes into its path."""

import itertools
import logging
import threading
from collections.abc import Callable, Iterable, Sequence
from types import TracebackType
from typing import TYPE_CHECKING, Final, NamedTuple

from arcor2_hw.exceptions import Arcor2Error, Cancelled, PathBlocked, Refused, message_of
from arcor2_hw.messages import Message
from arcor2_hw.objects.obstacle_snapshot import ObstacleSnapshot, Others, build_world, other_robots
from arcor2_hw.objects.robot import Robot

if TYPE_CHECKING:
    from arcor2_hw.collision.world import CollisionWorld, Contact
    from arcor2_hw.kinematics.arm import Arm
    from arcor2_hw.kinematics.shapes import Array
    from arcor2_hw.objects.robot_tools import RobotTools

PERIOD: Final = 0.04
"""Time between two checks of the surroundings, s."""
RESOLUTION: Final = 0.005
"""Maximum travel of any point of the robot between two checked configurations, m."""
JOIN_TIMEOUT: Final = 2.0
"""Time that the end of a move waits for a check in progress, s."""

log = logging.getLogger(__name__)


class PlannedPath(NamedTuple):
    """A path that was free of collisions when it was planned, and the data of its planning.

    Attributes:
        tools: Models and shapes. The planning thread does not use them while the robot moves.
        arm: The joints that move.
        points: Waypoints, joint values of the arm.
        around: The surroundings during planning.
        margin: Distance that the path keeps from them, m.
    """

    tools: "RobotTools"
    arm: "Arm"
    points: "list[Array]"
    around: ObstacleSnapshot
    margin: float


class PathMonitor:
    """Context manager for a motion: checks the rest of the path whenever the surroundings change.

    An obstacle in the rest of the path stops the robot at once, at any distance. Only changes since planning count. The
    exit raises PathBlocked, whose message names the obstacle and states whether the robot stopped before it.
    """

    def __init__(self, robot: Robot, path: PlannedPath, take_snapshot: Callable[[Others], ObstacleSnapshot]) -> None:
        self._robot, self._path, self._take_snapshot = robot, path, take_snapshot
        self._over = threading.Event()
        self._stopping = threading.Lock()
        self._others: Others | None = None
        self._world: CollisionWorld | None = None
        self._contact: Contact | None = None
        self._problem: Arcor2Error | None = None
        self._thread = threading.Thread(target=self._run, name=f"path of {robot.name}", daemon=True)

    def __enter__(self) -> "PathMonitor":
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self._stopping:  # a stop that was already sent must not end the next motion
            self._over.set()
        self._thread.join(JOIN_TIMEOUT)
        blocked = self._contact is not None or self._problem is not None
        if blocked and (error is None or isinstance(error, Cancelled)):
            raise PathBlocked(self._message()) from error

    # -------------------------------------------------------------------------------- monitoring
    def _run(self) -> None:
        seen = self._path.around
        while True:
            try:
                now = self._snapshot(seen)
                if now != seen:
                    seen = now
                    self._contact = self._first_contact(now)
            except Arcor2Error as error:
                self._problem = error
            except Exception as error:
                log.exception("the path of %s cannot be checked", self._robot.name)
                self._problem = Refused(message_of(error))
            if self._contact is not None or self._problem is not None:
                self._stop()
                return
            if self._over.wait(PERIOD):
                return

    def _snapshot(self, before: ObstacleSnapshot) -> ObstacleSnapshot:
        """Return the present surroundings. For a robot that does not answer, use its last known joints."""
        if self._others is None:
            try:
                others = other_robots(self._robot)
            except Arcor2Error as error:
                log.warning("%s continues with the last known joints of other robots: %s", self._robot.name, error)
                others = self._others = list(before.robots.values())
        else:
            others = self._others
        return self._take_snapshot(others).settled(before)

    def _first_contact(self, now: ObstacleSnapshot) -> "Contact | None":
        from arcor2_hw.collision.sweep import Sweep
        from arcor2_hw.collision.world import Contact

        path, name = self._path, self._robot.name
        around = now.changed_since(path.around, name)
        if around.empty:
            return None
        joints = self._robot.robot_joints()
        # Half of the margin, because repeated measurements of an obstacle differ slightly.
        self._world = build_world(self._robot, path.tools, joints, around, path.margin / 2.0)
        sweep = Sweep(self._world, name, path.arm, RESOLUTION)
        hit = sweep.first_contact(rest_of(path.points, path.arm.values(joints), sweep.levers))
        if hit is None:
            return None
        q = self._world.robot(name).q.copy()
        q[path.arm.indices] = hit
        found = self._with_surroundings(self._world.contacts(name, q))
        return found[0] if found else Contact(name, "an obstacle", 0.0)

    def _with_surroundings(self, contacts: "Iterable[Contact]") -> "list[Contact]":
        """Remove contacts of the robot with itself or its held parts."""
        name, world = self._robot.name, self._world
        assert world is not None
        held = world.robot(name).held
        return [each for each in contacts if not (each.second in held or each.second.startswith(f"{name}/"))]

    # -------------------------------------------------------------------------------- stopping
    def _stop(self) -> None:
        with self._stopping:
            if self._over.is_set():
                self._contact = self._problem = None  # the motion has ended by itself
                return
            try:
                stop: Callable[[], None] = self._robot.stop
                stop()
            except Exception:
                log.exception("%s could not be stopped in front of an obstacle", self._robot.name)

    def _message(self) -> Message:
        name, contact = self._robot.name, self._contact
        if contact is None:
            return Message.of(
                "{name} stopped: its surroundings changed, and the rest of its path cannot be checked: "
                "{problem} Fix the cause, then start the move again.",
                name=name,
                problem=self._problem,
            )
        touched = self._touched()
        if touched is not None:
            return Message.of(
                "{name} stopped at once, but {obstacle} appeared within its braking distance: {contact} are in "
                "contact. Check for damage, and move the robot clear before you go on.",
                name=name,
                obstacle=touched.second,
                contact=touched.message,
            )
        return Message.of(
            "{name} stopped: {obstacle} came into its path; {contact} would collide. "
            "Remove {obstacle} or choose another path, then start the move again.",
            name=name,
            obstacle=contact.second,
            contact=contact.message,
        )

    def _touched(self) -> "Contact | None":
        """Return a contact of the robot at standstill, or None."""
        world, tools = self._world, self._path.tools
        assert world is not None
        try:
            q = tools.model.values(self._robot.robot_joints(), tools.model.neutral())
        except Arcor2Error:
            return None
        world.margin = 0.0
        return next(iter(self._with_surroundings(world.contacts(self._robot.name, q))), None)


def rest_of(points: "Sequence[Array]", q: "Array", levers: "Array") -> "list[Array]":
    """Return the rest of a path, from joint values on or near it to its end.

    Args:
        points: Waypoints of the whole path.
        q: Present joint values.
        levers: Weight of each joint when distances are compared, m per unit.
    """
    import numpy as np

    best, segment = np.inf, 0
    for number, (a, b) in enumerate(itertools.pairwise(points)):
        way = (b - a) * levers
        length = float(way @ way)
        share = 0.0 if length == 0.0 else min(max(float(((q - a) * levers) @ way) / length, 0.0), 1.0)
        off = float(np.linalg.norm((q - a - share * (b - a)) * levers))
        if off < best - 1e-9:
            best, segment = off, number
    return [q, *points[segment + 1 :]]
