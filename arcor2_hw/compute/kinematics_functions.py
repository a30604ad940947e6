"""Functions of the kinematics worker, one for each task. Each function imports Pinocchio and coal if it needs them."""

import math
from typing import TYPE_CHECKING

from arcor2_hw.collision.description import MeshShape
from arcor2_hw.compute import kinematics_tasks as t
from arcor2_hw.compute.worker_state import WorkerState
from arcor2_hw.data.base import UNSET, Unset
from arcor2_hw.data.editor import Reach
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Joint
from arcor2_hw.messages import Message

if TYPE_CHECKING:
    from arcor2_hw.collision.world import CollisionWorld
    from arcor2_hw.kinematics.model import RobotModel
    from arcor2_hw.kinematics.shapes import Array


# ------------------------------------------------------------------------------------------------ one robot
def description(task: t.DescribeRobot, state: WorkerState) -> t.ModelDescription:
    """Describe a robot model."""
    from arcor2_hw.kinematics.shapes import triangles_of

    model = state.robot(task.model)
    joints = [
        t.JointRange(joint.name, joint.kind == "prismatic", *map(_finite, (joint.lower, joint.upper, joint.velocity)))
        for joint in model.joints
    ]
    triangles = sum(len(triangles_of(part.shape).triangles) for part in model.visual or model.collision)
    links = list(model.description.links)
    return t.ModelDescription(model.name, joints, list(model.end_effectors), links, triangles)


def _finite(value: float) -> float | Unset:
    return float(value) if math.isfinite(value) else UNSET


def forward(task: t.SolveForward, state: WorkerState) -> Pose:
    """Compute the pose of an end effector in the world."""
    model = state.robot(task.model)
    arm = model.arm(named_end_effector(model, task.end_effector))
    return task.model.base * arm.pose(arm.values(task.joints))


def named_end_effector(model: "RobotModel", name: str) -> str:
    """Return the link of an end effector: the link of that name, or the only end effector of the model."""
    if name not in model.description.links and len(model.end_effectors) == 1:
        return next(iter(model.end_effectors))
    return name


def inverse(task: t.SolveInverse, state: WorkerState) -> list[Joint]:
    """Compute joint values of the chain to an end effector."""
    import numpy as np

    from arcor2_hw.collision.world import collision_check

    world = state.world()
    standing = world.collisions.robot(task.robot)
    solver = world.inverse(task.robot, named_end_effector(standing.model, task.end_effector))
    arm = solver.arm
    others = standing.q if task.start is None else standing.model.values(task.start, standing.q)
    blocked = collision_check(world.collisions, task.robot, arm, others) if task.avoid_collisions else None
    target = np.linalg.inv(standing.base) @ task.pose.matrix()
    seed = arm.of(others) if task.start is not None else None
    return arm.named(solver.solve(target, seed, blocked))


# ------------------------------------------------------------------------------------------------ reachability
def judge_poses(task: t.JudgePoses, state: WorkerState) -> list[t.ReachResult]:
    """Judge how an end effector reaches poses."""
    world = state.world()
    model = world.collisions.robot(task.robot).model
    found = world.reachability(task.robot, named_end_effector(model, task.end_effector)).judge(task.poses)
    return [t.ReachResult(Reach(each.reach.value), each.reason) for each in found]


def judge_joints(task: t.JudgeJoints, state: WorkerState) -> list[t.ReachResult]:
    """Judge joint configurations."""
    collisions = state.world().collisions
    model = collisions.robot(task.robot).model
    return [_judge(collisions, task.robot, model, joints) for joints in task.joints]


def _judge(collisions: "CollisionWorld", robot: str, model: "RobotModel", joints: list[Joint]) -> t.ReachResult:
    from arcor2_hw.kinematics.errors import ModelError

    try:
        q = model.values(joints)
    except ModelError as error:
        return t.ReachResult(Reach.UNKNOWN, error.message)
    for column, joint in enumerate(model.joints):
        if not joint.lower - 1e-6 <= q[column] <= joint.upper + 1e-6:
            message = Message.of("The joint {joint} is beyond its limits.", joint=joint.name)
            return t.ReachResult(Reach.OUT_OF_REACH, message)
    if contacts := collisions.contacts(robot, q):
        return t.ReachResult(Reach.IN_COLLISION, Message.of("In collision: {contact}.", contact=contacts[0]))
    near = [name for end_effector in model.end_effectors for name in _near(model, end_effector, q)]
    if near:
        names = ", ".join(dict.fromkeys(near))
        return t.ReachResult(Reach.NEAR_LIMIT, Message.of("Near a limit: {joints}.", joints=names))
    return t.ReachResult(Reach.REACHABLE)


def _near(model: "RobotModel", end_effector: str, q: "Array") -> list[str]:
    arm = model.arm(end_effector)
    return arm.near_limits(arm.of(q))


# ------------------------------------------------------------------------------------------------ the world
def check_lines(task: t.CheckLines, state: WorkerState) -> list[t.LineHit | None]:
    """Find the first object that each line meets."""
    collisions = state.world().collisions
    hits = [collisions.ray(line.start, line.end, task.ignore, task.inflation) for line in task.lines]
    return [None if hit is None else t.LineHit(hit.name, hit.share) for hit in hits]


def place_in_link(task: t.PlaceInLink, state: WorkerState) -> Pose:
    """Convert a pose in the world to the frame of a link."""
    from arcor2_hw.exceptions import NotFound

    model = state.robot(task.model)
    frames = model.link_poses(model.values(task.joints))
    if task.link not in frames:
        raise NotFound(
            "{name} has no link {link!r}. Its links: {frames}.",
            name=model.name,
            link=task.link,
            frames=", ".join(frames),
        )
    return (task.model.base * Pose.from_matrix(frames[task.link])).inverted() * task.pose


def mesh_facts(task: t.ReadMesh, _: WorkerState) -> t.MeshFacts:
    """Measure a mesh."""
    from arcor2_hw.compute.world_replica import mesh_of

    mesh = mesh_of(MeshShape(task.file, task.scale))
    size = mesh.vertices.max(axis=0) - mesh.vertices.min(axis=0)
    return t.MeshFacts(len(mesh.triangles), (float(size[0]), float(size[1]), float(size[2])))
