"""SafeMoves: kinematics, and ways around obstacles, of a robot of which there is a URDF. Poses are in the world.

What computes, Pinocchio and coal, comes with the extra `kinematics` and is imported on first use.
"""

import contextlib
import dataclasses
import logging
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeVar

from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.object_type import Mesh
from arcor2_hw.data.robot import Joint
from arcor2_hw.exceptions import Arcor2Error, KinematicsError, Refused
from arcor2_hw.objects.robot import Robot
from arcor2_hw.objects.surroundings import Obstacle, Surroundings

if TYPE_CHECKING:
    from arcor2_hw.kinematics.arm import Arm
    from arcor2_hw.kinematics.inverse import InverseKinematics
    from arcor2_hw.kinematics.model import RobotModel
    from arcor2_hw.kinematics.shapes import Array, TriangleMesh
    from arcor2_hw.kinematics.sweep import Sweep
    from arcor2_hw.kinematics.timing import Timed
    from arcor2_hw.kinematics.world import CollisionWorld

MARGIN: Final = 0.005
"""m by which a way keeps away from what is around, half of the resolution: so nothing is missed between two checks.
Where the robot stands, or shall stand, nearer than that, the way has to be free without it."""
RESOLUTION: Final = 0.01
"""m that no point of the robot travels farther between two configurations that are looked at."""
WITHIN: Final = 2.0
"""s that is searched for a way."""
STANDS: Final = 0.01
"""rad, or m, by which a joint may have moved since its way was planned."""
TCP_RAMP: Final = 4.0
"""1/s: acceleration along a line, by the speed along it."""

log = logging.getLogger(__name__)

Stopped = Callable[[], bool]
T = TypeVar("T")


@dataclasses.dataclass(frozen=True)
class Way:
    """Where a robot is to be led: from waypoint to waypoint, all joints in proportion between two of them.

    waypoints: joint values, first those where it stands. line: an end effector is led in a straight line so, and the
    waypoints are near each other. speed: fraction of the maxima.
    """

    waypoints: list[list[Joint]]
    speed: float
    line: bool
    _timed: "Callable[[float | None], Timed]" = dataclasses.field(repr=False)

    def require_begin(self, name: str, now: Sequence[Joint]) -> None:
        """Raise Refused unless the robot `name` still stands where the way begins: planning takes time."""
        present = {joint.name: joint.value for joint in now}
        for joint in self.waypoints[0]:
            if abs(present[joint.name] - joint.value) > STANDS:
                raise Refused(f"{name} was moved while its way was planned")

    def timed(self, tcp_speed: float | None = None) -> "Timed":
        """Give joint values and velocities by time, for a controller that is led by these: see `Timed.sampled`.

        The limits are those of the URDF, times `speed`. A line is passed through at `tcp_speed` m/s at most (None: as
        fast as the joints can); at the waypoints of other ways the robot stands, as nothing beside them was looked at.
        """
        return self._timed(tcp_speed)


class SafeMoves:
    """Answers for one robot. It may be asked on several threads; each has what it computes with.

    Its URDF is the package that the type's `urdf_package_name` names: in `urdf/` beside the module of the class that
    does, unless one of that name was uploaded. Joints that the robot tells beside those of the URDF, a gripper's, are
    passed over. `settings` gives what the URDF follows, by name; left out, the settings of the object.
    """

    def __init__(self, robot: Robot, settings: Callable[[], Mapping[str, object]] | None = None) -> None:
        self._robot = robot
        self._settings = settings or (lambda: _fields(robot))
        self._here = threading.local()

    def prepare(self) -> None:
        """Import and read what is needed, on this thread; what cannot be is told to who needs it first.

        To be called before control is taken of anything: for some tenths of a second nothing else of this process runs,
        and no watchdog is fed.
        """
        try:
            from arcor2_hw.kinematics import planning  # noqa: F401

            self._world([], 0.0, alone=True)
        except (ImportError, Arcor2Error) as error:
            log.info("%s: no safe moves: %s", self._robot.name, error)

    # -------------------------------------------------------------------------------- kinematics
    def end_effectors(self) -> list[str]:
        """Give the names of the end effectors. Raises Refused without a URDF, ModelError for one that is not right."""
        return list(self._tools().model.end_effectors)

    def joint_limits(self) -> dict[str, tuple[float, float]]:
        """Give lower and upper limit of each joint, rad, m where it slides. Raises as `end_effectors`."""
        return {joint.name: (joint.lower, joint.upper) for joint in self._tools().model.joints}

    def forward(self, end_effector: str, joints: Sequence[Joint]) -> Pose:
        """Give the pose that joints lead to.

        Raises NotFound for the end effector, ModelError (InvalidData) for joints that are missing or no numbers.
        """
        arm = self._tools().arm(end_effector)
        return self._robot.pose * arm.pose(arm.values(joints))

    def inverse(
        self, end_effector: str, pose: Pose, near: Sequence[Joint], avoid_collisions: bool = True
    ) -> list[Joint]:
        """Give joints that reach a pose, of those that are free the nearest to `near`.

        With `avoid_collisions`: free of the robot itself, and of what is around it. Raises KinematicsException naming
        why there are none, NotFound, InvalidData.
        """
        with self._named():
            tools = self._tools()
            arm, target = tools.arm(end_effector), self._target(pose)
            if not avoid_collisions:
                return arm.named(tools.inverse(end_effector).solve(target, arm.values(near)))
            from arcor2_hw.kinematics.inverse import blocked_in

            def solved(world: "CollisionWorld") -> list[Joint]:
                blocked = blocked_in(world, self._robot.name, arm)
                return arm.named(tools.inverse(end_effector).solve(target, arm.values(near), blocked))

            return self._with_margin(near, solved)

    # -------------------------------------------------------------------------------- ways
    def to_joints(
        self,
        now: Sequence[Joint],
        goal: Sequence[Joint],
        speed: float = 1.0,
        *,
        safe: bool = True,
        stopped: Stopped | None = None,
    ) -> Way:
        """Give a way to joint values: straight in joint space where that is free, else around what is in the way.

        With `safe` false what is in the way does not count. Raises KinematicsException naming what is met where it
        stands or at the goal, or that no way was found; InvalidData beyond limits, Refused, Cancelled once `stopped`.
        """
        with self._named():
            arm = self._widest(goal)
            if not safe:
                return self._way(arm, [arm.values(now), arm.values(goal)], speed)

            def planned(world: "CollisionWorld") -> Way:
                planner = self._planner(world, arm)
                way = planner.to_joints(arm.values(now), arm.values(goal), within=WITHIN, stopped=stopped)
                return self._way(arm, way, speed)

            return self._with_margin(now, planned)

    def to_pose(
        self,
        end_effector: str,
        now: Sequence[Joint],
        pose: Pose,
        speed: float = 1.0,
        *,
        safe: bool = True,
        stopped: Stopped | None = None,
    ) -> Way:
        """Give a way to a pose, to whichever of its joint values it is shortest. Raises as `to_joints`, NotFound."""
        with self._named():
            tools = self._tools()
            arm, target = tools.arm(end_effector), self._target(pose)
            start = arm.values(now)
            if not safe:
                return self._way(arm, [start, tools.inverse(end_effector).solve(target, start)], speed)

            def planned(world: "CollisionWorld") -> Way:
                way = self._planner(world, arm).to_pose(start, target, within=WITHIN, stopped=stopped)
                return self._way(arm, way, speed)

            return self._with_margin(now, planned)

    def line(
        self, end_effector: str, now: Sequence[Joint], pose: Pose, speed: float = 1.0, *, safe: bool = True
    ) -> Way:
        """Give a straight line of an end effector to a pose; never another way.

        Raises KinematicsException naming where the line breaks, or, with `safe`, what it meets where; NotFound.
        """
        with self._named():
            from arcor2_hw.kinematics.errors import StartInCollision
            from arcor2_hw.kinematics.paths import require_free, straight_line

            arm = self._tools().arm(end_effector)
            way = straight_line(arm, arm.values(now), self._target(pose), self._robot.name)

            def looked_at(world: "CollisionWorld") -> None:
                sweep = self._sweep(world, arm)
                if world.margin and not (sweep.is_free(way[0]) and sweep.is_free(way[-1])):
                    raise StartInCollision
                require_free(sweep, way, self._robot.name)

            if safe:
                self._with_margin(now, looked_at)
            return self._way(arm, way, speed, line=True)

    def contacts(self, joints: Sequence[Joint]) -> list[str]:
        """Give what the robot would be in collision with in joints: pairs of names, none when it is free."""
        with self._named():
            return [str(contact) for contact in self._world(joints, 0.0).contacts(self._robot.name, self._q(joints))]

    # -------------------------------------------------------------------------------- inside
    def _way(self, arm: "Arm", points: "list[Array]", speed: float, *, line: bool = False) -> Way:
        def timed(tcp_speed: float | None) -> "Timed":
            from arcor2_hw.kinematics.timing import MotionLimits, led, with_stops

            limits = MotionLimits.of(arm, speed)
            if not line:
                return with_stops(points, limits)
            begin = points[0]
            first = arm.pose(begin).position
            lengths = [first.distance_to(arm.pose(q).position) for q in points]
            fastest = 100.0 if tcp_speed is None else tcp_speed
            return led(points, limits, lengths, fastest, TCP_RAMP * fastest)

        return Way([arm.named(q) for q in points], speed, line, timed)

    def _planner(self, world: "CollisionWorld", arm: "Arm") -> Any:
        from arcor2_hw.kinematics.planning import Planner

        return Planner(self._sweep(world, arm), self._robot.name)

    def _sweep(self, world: "CollisionWorld", arm: "Arm") -> "Sweep":
        from arcor2_hw.kinematics.sweep import Sweep

        return Sweep(world, self._robot.name, arm, RESOLUTION)

    def _with_margin(self, now: Sequence[Joint], ask: "Callable[[CollisionWorld], T]") -> T:
        """Ask with the margin; where it stands, or shall stand, too near for that, without."""
        from arcor2_hw.kinematics.errors import GoalInCollision, OnlyInCollision, StartInCollision

        try:
            return ask(self._world(now, MARGIN))
        except (GoalInCollision, OnlyInCollision, StartInCollision):
            return ask(self._world(now, 0.0))

    def _world(self, now: Sequence[Joint], margin: float, *, alone: bool = False) -> "CollisionWorld":
        """Give the robot in its joints among what stands around it now, or `alone`."""
        from arcor2_hw.kinematics.world import CollisionWorld

        robot, tools = self._robot, self._tools()
        world = CollisionWorld(margin=margin)
        world.add_robot(robot.name, tools.model, robot.pose, self._q(now))
        if alone:
            return world
        for other, joints in robot.surroundings.robots():
            model = tools.other(other)
            if model is not None:
                world.add_robot(other.name, model, other.pose, model.values(joints, model.neutral()))
        for obstacle in robot.surroundings.obstacles():
            world.put(obstacle.name, tools.shape(obstacle), obstacle.pose)
        return world

    def _q(self, joints: Sequence[Joint]) -> "Array":
        model = self._tools().model
        return model.values(joints, model.neutral())

    def _widest(self, goal: Sequence[Joint]) -> "Arm":
        """Give the chain that moves all of the joints: that of the end effector with the most of them."""
        tools = self._tools()
        names = {joint.name for joint in goal}
        arms = [tools.arm(name) for name in tools.model.end_effectors]
        return max(arms, key=lambda arm: len(names.intersection(arm.joint_names)))

    def _target(self, pose: Pose) -> "Array":
        target: Array = (self._robot.pose.inverted() * pose).matrix()
        return target

    @contextlib.contextmanager
    def _named(self) -> Iterator[None]:
        """Give errors of kinematics as the robot's own."""
        try:
            yield
        except KinematicsError as error:
            if isinstance(error, self._robot.KinematicsException):
                raise
            raise self._robot.KinematicsException(str(error), error.detail or error.code) from error

    def _tools(self) -> "_Tools":
        """Give what the present thread computes with, made anew when settings, or the model's file, have changed."""
        settings, package = dict(self._settings()), _package(self._robot)
        found: _Tools | None = getattr(self._here, "tools", None)
        if found is None or found.made_of != (settings, package):
            found = self._here.tools = _Tools(self._robot, settings, package)
        return found


class _Tools:
    """Model, arms and meshes for one thread."""

    def __init__(self, robot: Robot, settings: dict[str, object], package: Path | None) -> None:
        self.made_of = settings, package
        self._surroundings: Surroundings = robot.surroundings
        if package is None:
            raise Refused(f"{robot.name} has no model (URDF) from which anything could be computed")
        self.model = _load(robot, settings, package)
        self.model.name = robot.name
        self._arms: dict[str, Arm] = {}
        self._inverse: dict[str, InverseKinematics] = {}
        self._others: dict[str, tuple[dict[str, object], RobotModel | None]] = {}
        self._meshes: dict[Path, TriangleMesh] = {}

    def arm(self, end_effector: str) -> "Arm":
        if end_effector not in self._arms:
            self._arms[end_effector] = self.model.arm(end_effector)
        return self._arms[end_effector]

    def inverse(self, end_effector: str) -> "InverseKinematics":
        from arcor2_hw.kinematics.inverse import InverseKinematics

        if end_effector not in self._inverse:
            self._inverse[end_effector] = InverseKinematics(self.arm(end_effector))
        return self._inverse[end_effector]

    def other(self, robot: Robot) -> "RobotModel | None":
        """Give the model of another robot, None when it has none."""
        settings = _fields(robot)
        known = self._others.get(robot.name)
        if known is None or known[0] != settings:
            package = _package(robot)
            model = None if package is None else _load(robot, settings, package)
            known = self._others[robot.name] = settings, model
        return known[1]

    def shape(self, obstacle: Obstacle) -> Any:
        """Give the shape of an obstacle. Raises Refused for a mesh that is not known here, BadMesh."""
        from arcor2_hw.kinematics import shapes
        from arcor2_hw.kinematics.meshes import read_mesh
        from arcor2_hw.kinematics.source import MAX_MESH

        model = obstacle.model
        if not isinstance(model, Mesh):
            return shapes.of_model(model)
        file = self._surroundings.asset(model.asset_id)
        if file is None or not file.is_file():
            raise Refused(f"the mesh of {obstacle.name} is not known here, so no way can be looked at for collisions")
        if file not in self._meshes:
            with file.open("rb") as opened:
                self._meshes[file] = read_mesh(opened.read(MAX_MESH + 1), model.asset_id)
        return shapes.of_model(model, self._meshes[file])


def _load(robot: Robot, settings: Mapping[str, object], package: Path) -> "RobotModel":
    try:
        from arcor2_hw.kinematics.model import RobotModel
    except ImportError as error:
        raise Refused(
            f"{robot.name}: nothing can be computed here: install arcor2-hw[kinematics]", str(error)
        ) from error
    try:
        return RobotModel.load(package, settings)
    except Arcor2Error as error:
        raise type(error)(f"The model of {robot.name} cannot be used: {error}", error.detail) from error


def _package(robot: Robot) -> Path | None:
    """Give the file or folder with a robot's URDF: uploaded, or beside the class that names it."""
    for base in type(robot).__mro__:
        name: str | None = base.__dict__.get("urdf_package_name")
        if name is None:
            continue
        uploaded = robot.surroundings.asset(name)
        if uploaded is not None and uploaded.is_file():
            return uploaded
        module = sys.modules.get(base.__module__)
        if module is None or not module.__file__:
            return None
        beside = Path(module.__file__).parent / "urdf"
        return next((path for path in (beside / name.removesuffix(".zip"), beside / name) if path.exists()), None)
    return None


def _fields(robot: Robot) -> dict[str, object]:
    """Give the settings of an object by name."""
    settings = robot.__dict__.get("_settings")
    if settings is None or not dataclasses.is_dataclass(settings):
        return {}
    return {field.name: getattr(settings, field.name) for field in dataclasses.fields(settings)}
