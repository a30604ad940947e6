"""Requests to robots of the scene that is online (protocol, 7.5)."""

from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from typing import Any

from arcor2_hw.data.base import UNSET, Unset
from arcor2_hw.data.events import (
    HandTeachingModeData,
    MoveEventType,
    RobotMoveToActionPointJointsData,
    RobotMoveToActionPointOrientationData,
    RobotMoveToJointsData,
    RobotMoveToPoseData,
)
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.project_index import global_pose
from arcor2_hw.data.robot import Joint
from arcor2_hw.data.rpc import (
    ForwardKinematicsArgs,
    GetEndEffectorPoseArgs,
    GetEndEffectorsArgs,
    GetGrippersArgs,
    GetRobotArmsArgs,
    GetRobotJointsArgs,
    GetSuctionsArgs,
    HandTeachingModeArgs,
    InverseKinematicsArgs,
    MoveToActionPointArgs,
    MoveToJointsArgs,
    MoveToPoseArgs,
    RegisterForRobotEventArgs,
    SetEefPerpendicularToWorldArgs,
    StepAxis,
    StepMode,
    StepRobotEefArgs,
    StepWhat,
    StopRobotArgs,
)
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.exceptions import NotInControl
from arcor2_server.errors import RequestRefused
from arcor2_server.hosts.process import CellError
from arcor2_server.online.motion import (
    Told,
    move,
    require_feature,
    require_not_moving,
    require_ready,
    require_speed,
    take_control,
)
from arcor2_server.online.online_scene import OnlineCell
from arcor2_server.rpc.editing import optional
from arcor2_server.rpc.registry import Context, rpc
from arcor2_server.workspace import kinematics
from arcor2_server.workspace.robot_models import model_of_type


@asynccontextmanager
async def _reading(context: Context, robot_id: str) -> AsyncIterator[OnlineCell]:
    """Hold the robot's read lock meanwhile; the scene is online, and it is a robot."""
    services = context.services
    services.session.require_scene_open()
    async with services.locks.read(context.user, robot_id):
        services.cell.require_online()
        services.cell.robot(robot_id)
        yield services.cell


def require_robot_online(context: Context, robot_id: str) -> OnlineCell:
    """Give the cell when it is online and the object is a robot; else RequestRefused, NotFound."""
    services = context.services
    services.session.require_scene_open()
    services.cell.require_online()
    services.cell.robot(robot_id)
    return services.cell


# ------------------------------------------------------------------------------------------------ observing
@rpc("GetRobotJoints")
async def get_robot_joints(context: Context, args: GetRobotJointsArgs) -> list[Joint]:
    """Give the present joint values."""
    async with _reading(context, args.robot_id) as cell:
        return await cell.robot_joints(args.robot_id, optional(args.arm_id))


@rpc("GetEndEffectorPose")
async def get_end_effector_pose(context: Context, args: GetEndEffectorPoseArgs) -> Pose:
    """Give the present pose of an end effector."""
    async with _reading(context, args.robot_id) as cell:
        return await cell.end_effector_pose(args.robot_id, args.end_effector_id, optional(args.arm_id))


async def _names(
    context: Context, args: GetEndEffectorsArgs | GetGrippersArgs | GetSuctionsArgs, method: str
) -> list[str]:
    async with _reading(context, args.robot_id) as cell:
        arm = cell.arm(args.robot_id, optional(args.arm_id))
        return sorted(await cell.ask(set[str], args.robot_id, method, arm))


@rpc("GetEndEffectors")
async def get_end_effectors(context: Context, args: GetEndEffectorsArgs) -> list[str]:
    """Give the names of the end effectors."""
    return await _names(context, args, "get_end_effectors_ids")


@rpc("GetGrippers")
async def get_grippers(context: Context, args: GetGrippersArgs) -> list[str]:
    """Give the names of the grippers."""
    return await _names(context, args, "grippers")


@rpc("GetSuctions")
async def get_suctions(context: Context, args: GetSuctionsArgs) -> list[str]:
    """Give the names of the suction cups."""
    return await _names(context, args, "suctions")


@rpc("GetRobotArms")
async def get_robot_arms(context: Context, args: GetRobotArmsArgs) -> list[str]:
    """Give the names of the arms of a robot that has several."""
    async with _reading(context, args.robot_id) as cell:
        robot = cell.robot(args.robot_id)
        if not context.services.types.robot_meta(robot.type).multi_arm:
            raise RequestRefused(f"{robot.name} has one arm.")
        return sorted(await cell.ask(set[str], args.robot_id, "get_arm_ids"))


@rpc("RegisterForRobotEvent")
async def register_for_robot_event(context: Context, args: RegisterForRobotEventArgs) -> None:
    """Send joints or end effector poses of a robot to this client, or no longer."""
    async with _reading(context, args.robot_id) as cell:
        cell.streams.subscribe(context.client, args.robot_id, args.what, args.send)


@rpc("InverseKinematics")
async def inverse_kinematics(context: Context, args: InverseKinematicsArgs) -> list[Joint]:
    """Give joints that reach a pose: as the robot computes them, else by its model, for which nothing need run."""
    async with _modelled(context, args.robot_id, args.arm_id) as robot:
        if kinematics.solves(context.services, robot, "inverse_kinematics"):
            return await solve_inverse(context, args)
        return await kinematics.inverse(context.services, robot, args)


@asynccontextmanager
async def _modelled(context: Context, robot_id: str, arm_id: str | Unset) -> AsyncIterator[SceneObject]:
    """Hold the robot's read lock meanwhile; it is a robot, and has a model where it cannot be asked itself."""
    services = context.services
    services.session.require_scene_open()
    async with services.locks.read(context.user, robot_id):
        robot = services.cell.robot(robot_id)
        if model_of_type(services, robot.type) is None:
            services.cell.require_online()
        services.cell.arm(robot_id, optional(arm_id))
        yield robot


async def solve_inverse(context: Context, args: InverseKinematicsArgs) -> list[Joint]:
    """Give joints that reach a pose; RequestRefused when the robot cannot compute that, CellError when none do."""
    cell = context.services.cell
    arguments: dict[str, Any] = cell.arm(args.robot_id, optional(args.arm_id))
    require_feature(context.services, args.robot_id, "inverse_kinematics")
    arguments |= {
        "end_effector_id": args.end_effector_id,
        "pose": args.pose,
        "avoid_collisions": args.avoid_collisions,
    }
    if not isinstance(args.start_joints, Unset):
        arguments["start_joints"] = args.start_joints
    joints: list[Joint]
    try:
        joints = await cell.ask(list[Joint], args.robot_id, "inverse_kinematics", arguments)
    except CellError as error:
        robot = cell.robot(args.robot_id)
        # Some controllers answer only whom they obey. The question moves nothing: its model answers as well.
        if error.code != NotInControl.code or model_of_type(context.services, robot.type) is None:
            raise
        return await kinematics.inverse(context.services, robot, args)
    return joints


@rpc("ForwardKinematics")
async def forward_kinematics(context: Context, args: ForwardKinematicsArgs) -> Pose:
    """Give the pose that joints lead to: as the robot computes it, else by its model, for which nothing need run."""
    async with _modelled(context, args.robot_id, args.arm_id) as robot:
        services = context.services
        if not kinematics.solves(services, robot, "forward_kinematics"):
            return await kinematics.forward(services, robot, args)
        cell = services.cell
        arguments: dict[str, Any] = cell.arm(args.robot_id, optional(args.arm_id))
        arguments |= {"end_effector_id": args.end_effector_id, "joints": args.joints}
        pose: Pose = await cell.ask(Pose, args.robot_id, "forward_kinematics", arguments)
        return pose


# ------------------------------------------------------------------------------------------------ motion
def begin_motion(
    context: Context, robot_id: str, method: str, arguments: Mapping[str, Any], event: str, told: Told, lock: str = ""
) -> None:
    """Answer, tell the start, and move; `lock` is the user whose lock on the robot ends with the motion."""
    services = context.services
    require_not_moving(services, robot_id)  # another request may have been quicker
    services.cell.moving.add(robot_id)
    context.emit(event, told(MoveEventType.START, UNSET))

    async def whole() -> None:
        try:
            await move(services, robot_id, method, arguments, event, told, context.received_at)
        finally:
            if lock:
                services.locks.release(lock, robot_id)

    services.cell.spawn(whole(), f"motion of {robot_id}")


@asynccontextmanager
async def _locked_for_motion(context: Context, robot_id: str) -> AsyncIterator[None]:
    """Lock the robot; the lock stays with the motion that begins inside, and is given back when none does."""
    services = context.services
    services.session.require_scene_open()
    user = context.user
    await services.locks.acquire(user, robot_id)
    try:
        require_robot_online(context, robot_id)
        yield
    except BaseException:
        services.locks.release(user, robot_id)
        raise


def pose_motion(
    args: MoveToPoseArgs | StepRobotEefArgs | SetEefPerpendicularToWorldArgs, target: Pose
) -> tuple[dict[str, Any], Told]:
    """Give the arguments of a move to a pose without the arm, and what makes its events."""
    arguments = {
        "end_effector_id": args.end_effector_id,
        "target_pose": target,
        "speed": args.speed,
        "safe": args.safe,
        "linear": args.linear,
    }

    def told(phase: MoveEventType, message: str | Unset) -> RobotMoveToPoseData:
        return RobotMoveToPoseData(
            phase, args.robot_id, args.end_effector_id, target, args.safe, args.linear, message, args.arm_id
        )

    return arguments, told


@rpc("MoveToPose")
async def move_to_pose(context: Context, args: MoveToPoseArgs) -> None:
    """Move an end effector to a pose; position or orientation that is not given stays as it is."""
    services, arm_id = context.services, optional(args.arm_id)
    async with _locked_for_motion(context, args.robot_id):
        require_speed(args.speed)
        if isinstance(args.position, Unset) and isinstance(args.orientation, Unset):
            raise RequestRefused("Give a position, an orientation, or both.")
        await require_ready(services, args.robot_id, "move_to_pose", arm_id)
        if isinstance(args.position, Unset) or isinstance(args.orientation, Unset):
            await take_control(services, args.robot_id, arm_id)
        present = await services.cell.end_effector_pose(args.robot_id, args.end_effector_id, arm_id)
        target = Pose(
            present.position if isinstance(args.position, Unset) else args.position,
            present.orientation if isinstance(args.orientation, Unset) else args.orientation,
        )
        arguments, told = pose_motion(args, target)
        arguments |= services.cell.arm(args.robot_id, arm_id)
        begin_motion(context, args.robot_id, "move_to_pose", arguments, "RobotMoveToPose", told, context.user)


@rpc("MoveToJoints")
async def move_to_joints(context: Context, args: MoveToJointsArgs) -> None:
    """Move to joint values."""
    services, arm_id = context.services, optional(args.arm_id)
    async with _locked_for_motion(context, args.robot_id):
        require_speed(args.speed)
        await require_ready(services, args.robot_id, "move_to_joints", arm_id)
        arguments: dict[str, Any] = {"target_joints": args.joints, "speed": args.speed, "safe": args.safe}
        arguments |= services.cell.arm(args.robot_id, arm_id)

        def told(phase: MoveEventType, message: str | Unset) -> RobotMoveToJointsData:
            return RobotMoveToJointsData(phase, args.robot_id, args.joints, args.safe, message, args.arm_id)

        begin_motion(context, args.robot_id, "move_to_joints", arguments, "RobotMoveToJoints", told, context.user)


@rpc("MoveToActionPoint")
async def move_to_action_point(context: Context, args: MoveToActionPointArgs) -> None:
    """Move to an orientation at its action point, or to joints kept there."""
    services = context.services
    services.session.require_project_open()
    async with services.locks.auto(context.user, args.robot_id):
        require_robot_online(context, args.robot_id)
        require_speed(args.speed)
        if isinstance(args.orientation_id, Unset) == isinstance(args.joints_id, Unset):
            raise RequestRefused("Give either an orientation or joints.")
        if not isinstance(args.joints_id, Unset):
            await _to_joints(context, args, args.joints_id)
        elif not isinstance(args.orientation_id, Unset):
            await _to_orientation(context, args, args.orientation_id)


async def _to_joints(context: Context, args: MoveToActionPointArgs, joints_id: str) -> None:
    services, arm_id = context.services, optional(args.arm_id)
    joints = services.session.joints(joints_id)[1]
    if joints.robot_id != args.robot_id:
        raise RequestRefused(f"The joints {joints.name} belong to another robot.")
    await require_ready(services, args.robot_id, "move_to_joints", arm_id)
    arguments: dict[str, Any] = {"target_joints": joints.joints, "speed": args.speed, "safe": args.safe}
    arguments |= services.cell.arm(args.robot_id, arm_id)

    def told(phase: MoveEventType, message: str | Unset) -> RobotMoveToActionPointJointsData:
        return RobotMoveToActionPointJointsData(phase, args.robot_id, joints_id, args.safe, message, args.arm_id)

    begin_motion(context, args.robot_id, "move_to_joints", arguments, "RobotMoveToActionPointJoints", told)


async def _to_orientation(context: Context, args: MoveToActionPointArgs, orientation_id: str) -> None:
    services, arm_id, end_effector = context.services, optional(args.arm_id), args.end_effector_id
    if isinstance(end_effector, Unset):
        raise RequestRefused("Name the end effector that shall move there.")
    point, named = services.session.orientation(orientation_id)
    await require_ready(services, args.robot_id, "move_to_pose", arm_id)
    arguments: dict[str, Any] = {
        "end_effector_id": end_effector,
        "target_pose": global_pose(services.session, point, named.orientation),
        "speed": args.speed,
        "safe": args.safe,
        "linear": args.linear,
    }
    arguments |= services.cell.arm(args.robot_id, arm_id)

    def told(phase: MoveEventType, message: str | Unset) -> RobotMoveToActionPointOrientationData:
        return RobotMoveToActionPointOrientationData(
            phase, args.robot_id, end_effector, orientation_id, args.safe, args.linear, message, args.arm_id
        )

    begin_motion(context, args.robot_id, "move_to_pose", arguments, "RobotMoveToActionPointOrientation", told)


@rpc("StepRobotEef")
async def step_robot_eef(context: Context, args: StepRobotEefArgs) -> None:
    """Move an end effector by a step along, or about, an axis."""
    services, arm_id = context.services, optional(args.arm_id)
    cell = require_robot_online(context, args.robot_id)
    services.locks.require_held(context.user, args.robot_id)
    require_speed(args.speed)
    await require_ready(services, args.robot_id, "move_to_pose", arm_id)
    if not context.dry_run:
        await take_control(services, args.robot_id, arm_id)
    target = _stepped(
        args, await cell.end_effector_pose(args.robot_id, args.end_effector_id, arm_id), _base(cell, args)
    )
    if services.types.robot_meta(cell.robot(args.robot_id).type).features.inverse_kinematics:
        question = InverseKinematicsArgs(
            args.robot_id, args.end_effector_id, target, avoid_collisions=args.safe, arm_id=args.arm_id
        )
        await solve_inverse(context, question)
    if context.dry_run:
        return
    arguments, told = pose_motion(args, target)
    arguments |= cell.arm(args.robot_id, arm_id)
    begin_motion(context, args.robot_id, "move_to_pose", arguments, "RobotMoveToPose", told)


def _base(cell: OnlineCell, args: StepRobotEefArgs) -> Orientation:
    """Give the orientation in the world of the frame whose axis is meant."""
    match args.mode:
        case StepMode.WORLD:
            return Orientation()
        case StepMode.ROBOT:
            pose = cell.robot(args.robot_id).pose
            return Orientation() if isinstance(pose, Unset) else pose.orientation
        case StepMode.RELATIVE:
            if isinstance(args.pose, Unset):
                raise RequestRefused("Give the pose that the step is relative to.")
            return args.pose.orientation
    raise RequestRefused("Steps in a frame of the user's own are not available.")


def _stepped(args: StepRobotEefArgs, present: Pose, frame: Orientation) -> Pose:
    axis = Position(*(1.0 if args.axis is candidate else 0.0 for candidate in StepAxis)).rotated(frame)
    x, y, z = (component * args.step for component in axis)
    if args.what is StepWhat.POSITION:
        return Pose(present.position + Position(x, y, z), present.orientation)
    return Pose(present.position, Orientation.from_rotation_vector(x, y, z) * present.orientation)


@rpc("StopRobot")
async def stop_robot(context: Context, args: StopRobotArgs) -> None:
    """Stop a robot that moves, past whatever it does."""
    services = context.services
    cell = require_robot_online(context, args.robot_id)
    require_feature(services, args.robot_id, "stop")
    acting = cell.running_action is not None and cell.running_action.object_id == args.robot_id
    if args.robot_id not in cell.moving and not acting:
        raise RequestRefused(f"{cell.robot(args.robot_id).name} is not moving.")
    await cell.stop_motion(args.robot_id)


@rpc("HandTeachingMode")
async def hand_teaching_mode(context: Context, args: HandTeachingModeArgs) -> None:
    """Make a robot movable by hand, or stiff again."""
    services = context.services
    cell = require_robot_online(context, args.robot_id)
    services.locks.require_held(context.user, args.robot_id)
    arm = cell.arm(args.robot_id, optional(args.arm_id))
    require_feature(services, args.robot_id, "hand_teaching")
    require_not_moving(services, args.robot_id)
    if await cell.ask(bool, args.robot_id, "get_hand_teaching_mode", arm) is args.enable:
        raise RequestRefused("Hand teaching is on already." if args.enable else "Hand teaching is off already.")
    if context.dry_run:
        return
    await cell.call(args.robot_id, "set_hand_teaching_mode", {"enabled": args.enable} | arm, control=True)
    context.emit("HandTeachingMode", HandTeachingModeData(args.robot_id, args.enable, args.arm_id))
