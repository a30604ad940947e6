"""What the kinematics worker is asked. Imports no numerics: the server knows it.

Poses are in the world. Tasks that name a robot by its id need it, and what stands around it, in the world that is told
with them; others bring the robot's model along.
"""

from typing import ClassVar

from msgspec import field

from arcor2_hw.collision.description import RobotSource, StoredFile
from arcor2_hw.compute.task import Room, Task
from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.data.editor import Reach
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.robot import Joint

_JOBS = "arcor2_hw.compute.moving"


# ------------------------------------------------------------------------------------------------ one robot
class JointRange(Data, frozen=True):
    """A joint with its limits (rad or m, left out where there is none) and its maximum velocity (per s)."""

    name: str
    prismatic: bool
    lower: float | Unset = UNSET
    upper: float | Unset = UNSET
    velocity: float | Unset = UNSET


class ModelDescription(Data, frozen=True):
    """What a model says. triangles: of what it looks like."""

    name: str
    joints: list[JointRange]
    end_effectors: list[str]
    links: list[str]
    triangles: int


class DescribeRobot(Task[ModelDescription], frozen=True):
    """What a model is of. Fails for one that cannot be used."""

    gives: ClassVar = ModelDescription
    runs: ClassVar = f"{_JOBS}:description"
    room: ClassVar = Room.KINEMATICS
    what: ClassVar = "the model of a robot"

    model: RobotSource


class SolveForward(Task[Pose], frozen=True):
    """Where an end effector is with joints."""

    gives: ClassVar = Pose
    runs: ClassVar = f"{_JOBS}:forward"
    room: ClassVar = Room.KINEMATICS
    what: ClassVar = "forward kinematics"

    model: RobotSource
    end_effector: str
    joints: list[Joint]


class SolveInverse(Task[list[Joint]], frozen=True):
    """Joints with which an end effector is at a pose, nearest to `start`; free of collision if that is asked."""

    gives: ClassVar = list[Joint]
    runs: ClassVar = f"{_JOBS}:inverse"
    room: ClassVar = Room.KINEMATICS
    what: ClassVar = "inverse kinematics"

    robot: str
    end_effector: str
    pose: Pose
    start: list[Joint] | None = None
    avoid_collisions: bool = True


# ------------------------------------------------------------------------------------------------ reachability
class Judged(Data, frozen=True):
    """Whether an end effector gets somewhere; reason: why not, or not well, a sentence."""

    reach: Reach
    reason: str = ""


class JudgePoses(Task[list[Judged]], frozen=True):
    """How an end effector gets to each of these poses; what was asked before is worked out anew only if need be."""

    gives: ClassVar = list[Judged]
    runs: ClassVar = f"{_JOBS}:judged_poses"
    room: ClassVar = Room.KINEMATICS
    within: ClassVar = 20.0
    what: ClassVar = "reachability"

    robot: str
    end_effector: str
    poses: list[Pose]


class JudgeJoints(Task[list[Judged]], frozen=True):
    """Whether a robot may stand with each of these joints."""

    gives: ClassVar = list[Judged]
    runs: ClassVar = f"{_JOBS}:judged_joints"
    room: ClassVar = Room.KINEMATICS
    within: ClassVar = 20.0
    what: ClassVar = "reachability of joints"

    robot: str
    joints: list[list[Joint]]


# ------------------------------------------------------------------------------------------------ the world
class Line(Data, frozen=True):
    """A straight line; m."""

    start: Position
    end: Position


class LineHit(Data, frozen=True):
    """What a line meets first: its id, that of a robot with the link, and at which share of the line."""

    id: str
    share: float


class CheckLines(Task[list[LineHit | None]], frozen=True):
    """What each line meets first. inflation: sizes count as larger by so much, m. ignore: ids that are no obstacle."""

    gives: ClassVar = list[LineHit | None]
    runs: ClassVar = f"{_JOBS}:checked_lines"
    room: ClassVar = Room.KINEMATICS
    what: ClassVar = "the safety of a line"

    lines: list[Line]
    inflation: float = 0.0
    ignore: list[str] = field(default_factory=list)


class PlaceInLink(Task[Pose], frozen=True):
    """Where a pose in the world is in the frame of a robot's link, as the robot stands now."""

    gives: ClassVar = Pose
    runs: ClassVar = f"{_JOBS}:placed_in_link"
    room: ClassVar = Room.KINEMATICS
    what: ClassVar = "where a held object is"

    model: RobotSource
    joints: list[Joint]
    link: str
    pose: Pose


class MeshFacts(Data, frozen=True):
    """How large a mesh is: triangles, and the edges of the box around it, m."""

    triangles: int
    size: tuple[float, float, float]


class ReadMesh(Task[MeshFacts], frozen=True):
    """How large a mesh is. Fails for one that cannot be used."""

    gives: ClassVar = MeshFacts
    runs: ClassVar = f"{_JOBS}:mesh_facts"
    room: ClassVar = Room.KINEMATICS
    within: ClassVar = 30.0
    what: ClassVar = "a mesh"

    file: StoredFile
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)


KinematicsTask = (
    DescribeRobot | SolveForward | SolveInverse | JudgePoses | JudgeJoints | CheckLines | PlaceInLink | ReadMesh
)
