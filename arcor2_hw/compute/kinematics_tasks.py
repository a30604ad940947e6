"""Tasks of the kinematics worker. Imports no numerics, so that the server can use it.

Poses are in the world. A task that names a robot by its id needs that robot, and everything around it, in the world
description sent with the task. Other tasks contain the source of the robot's model.
"""

from typing import ClassVar

from msgspec import field

from arcor2_hw.collision.description import RobotSource, StoredFile
from arcor2_hw.compute.task import Task, WorkerKind
from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.data.editor import Reach
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.robot import Joint
from arcor2_hw.messages import Message

_FUNCTIONS = "arcor2_hw.compute.kinematics_functions"


# ------------------------------------------------------------------------------------------------ one robot
class JointRange(Data, frozen=True):
    """A joint with its limits in rad or m, unset where there is none, and its maximum velocity per s."""

    name: str
    prismatic: bool
    lower: float | Unset = UNSET
    upper: float | Unset = UNSET
    velocity: float | Unset = UNSET


class ModelDescription(Data, frozen=True):
    """The content of a robot model.

    Attributes:
        name: Name of the robot in the URDF.
        joints: Joints that take values.
        end_effectors: Links that are end effectors.
        links: All links.
        triangles: Number of triangles of the visual meshes.
    """

    name: str
    joints: list[JointRange]
    end_effectors: list[str]
    links: list[str]
    triangles: int


class DescribeRobot(Task[ModelDescription], frozen=True):
    """Describe a robot model. Fails for a model that cannot be used."""

    result_type: ClassVar = ModelDescription
    function: ClassVar = f"{_FUNCTIONS}:description"
    worker: ClassVar = WorkerKind.KINEMATICS
    label: ClassVar = Message.of("the model of a robot")

    model: RobotSource


class SolveForward(Task[Pose], frozen=True):
    """Compute the pose of an end effector for joint values."""

    result_type: ClassVar = Pose
    function: ClassVar = f"{_FUNCTIONS}:forward"
    worker: ClassVar = WorkerKind.KINEMATICS
    label: ClassVar = Message.of("forward kinematics")

    model: RobotSource
    end_effector: str
    joints: list[Joint]


class SolveInverse(Task[list[Joint]], frozen=True):
    """Compute joint values for a pose, nearest to `start`, free of collision if requested."""

    result_type: ClassVar = list[Joint]
    function: ClassVar = f"{_FUNCTIONS}:inverse"
    worker: ClassVar = WorkerKind.KINEMATICS
    label: ClassVar = Message.of("inverse kinematics")

    robot: str
    end_effector: str
    pose: Pose
    start: list[Joint] | None = None
    avoid_collisions: bool = True


# ------------------------------------------------------------------------------------------------ reachability
class ReachResult(Data, frozen=True):
    """Whether an end effector reaches a pose; `reason` is a sentence when it does not, or only with reservation."""

    reach: Reach
    reason: Message | None = None


class JudgePoses(Task[list[ReachResult]], frozen=True):
    """Judge the reachability of poses by an end effector. Results are cached in the world of the task."""

    result_type: ClassVar = list[ReachResult]
    function: ClassVar = f"{_FUNCTIONS}:judge_poses"
    worker: ClassVar = WorkerKind.KINEMATICS
    timeout: ClassVar = 20.0
    label: ClassVar = Message.of("reachability")

    robot: str
    end_effector: str
    poses: list[Pose]


class JudgeJoints(Task[list[ReachResult]], frozen=True):
    """Judge whether a robot may be in joint configurations."""

    result_type: ClassVar = list[ReachResult]
    function: ClassVar = f"{_FUNCTIONS}:judge_joints"
    worker: ClassVar = WorkerKind.KINEMATICS
    timeout: ClassVar = 20.0
    label: ClassVar = Message.of("reachability of joints")

    robot: str
    joints: list[list[Joint]]


# ------------------------------------------------------------------------------------------------ the world
class Line(Data, frozen=True):
    """A straight line, m."""

    start: Position
    end: Position


class LineHit(Data, frozen=True):
    """The first object that a line meets: its id, or "robot/link", and the position along the line (0 to 1)."""

    id: str
    share: float


class CheckLines(Task[list[LineHit | None]], frozen=True):
    """Find the first object that each line meets.

    Attributes:
        lines: The lines.
        inflation: Length added to all sizes, m.
        ignore: Ids of bodies and robots to ignore.
    """

    result_type: ClassVar = list[LineHit | None]
    function: ClassVar = f"{_FUNCTIONS}:check_lines"
    worker: ClassVar = WorkerKind.KINEMATICS
    label: ClassVar = Message.of("the safety of a line")

    lines: list[Line]
    inflation: float = 0.0
    ignore: list[str] = field(default_factory=list)


class PlaceInLink(Task[Pose], frozen=True):
    """Convert a pose in the world to the frame of a robot's link at joint values."""

    result_type: ClassVar = Pose
    function: ClassVar = f"{_FUNCTIONS}:place_in_link"
    worker: ClassVar = WorkerKind.KINEMATICS
    label: ClassVar = Message.of("the pose of a gripped part")

    model: RobotSource
    joints: list[Joint]
    link: str
    pose: Pose


class MeshFacts(Data, frozen=True):
    """Number of triangles of a mesh, and the edges of its bounding box, m."""

    triangles: int
    size: tuple[float, float, float]


class ReadMesh(Task[MeshFacts], frozen=True):
    """Measure a mesh. Fails for a mesh that cannot be used."""

    result_type: ClassVar = MeshFacts
    function: ClassVar = f"{_FUNCTIONS}:mesh_facts"
    worker: ClassVar = WorkerKind.KINEMATICS
    timeout: ClassVar = 30.0
    label: ClassVar = Message.of("a mesh")

    file: StoredFile
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)


KinematicsTask = (
    DescribeRobot | SolveForward | SolveInverse | JudgePoses | JudgeJoints | CheckLines | PlaceInLink | ReadMesh
)
