"""Robot motion requested by users: checks, execution and events."""

import asyncio
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import structlog
from msgspec.structs import replace

from arcor2_hw.data.base import UNSET, Unset
from arcor2_hw.data.events import MoveEventType
from arcor2_hw.data.robot import Joint
from arcor2_hw.data.rpc import InverseKinematicsArgs
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.exceptions import Arcor2Error, NotInControl
from arcor2_server.documents import Session
from arcor2_server.errors import RequestRefused
from arcor2_server.events import EventHub, make_event
from arcor2_server.hosts.process import CellError
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.workspace.kinematics import Kinematics
from arcor2_server.workspace.robots import SceneRobots, optional

log = structlog.get_logger(__name__)

FEATURES = {
    "move_to_pose": "move to a pose",
    "move_to_joints": "move to joint values",
    "stop": "be stopped",
    "inverse_kinematics": "compute inverse kinematics",
    "forward_kinematics": "compute forward kinematics",
    "hand_teaching": "be moved by hand",
    "jog": "be jogged",
    "acknowledge_stop": "be acknowledged from here. Acknowledge the stop at the robot",
}
"""Functions that a robot without a feature does not have, by feature."""

MoveEventData = Callable[[MoveEventType, str | Unset], Any]
"""Creates the data of the event for a phase of the motion."""


def require_speed(speed: float) -> None:
    """Raise RequestRefused unless the speed is a fraction of the maximum."""
    if not 0.0 < speed <= 1.0:
        raise RequestRefused("The speed must be more than 0 and at most 1, not {speed:g}.", speed=speed)


@dataclass(frozen=True, slots=True)
class RobotMotion:
    """Robot motion requested by a user."""

    _hub: EventHub
    _types: ObjectTypes
    _session: Session
    _online: OnlineScene
    _robots: SceneRobots
    _kinematics: Kinematics

    def require_feature(self, robot_id: str, feature: str) -> None:
        """Raise RequestRefused if the robot's type does not have the feature."""
        self.require_feature_of(self._online.robot(robot_id), feature)

    def require_feature_of(self, robot: SceneObject, feature: str) -> None:
        """Raise RequestRefused if an object is not a robot, or its type does not have the feature."""
        is_robot = self._types.derives_from(robot.type, "Robot")
        if not is_robot or not getattr(self._types.robot_meta(robot.type).features, feature):
            raise RequestRefused("{name} cannot {features}.", name=robot.name, features=FEATURES[feature])

    def require_not_moving(self, robot_id: str, *, held: bool = False) -> None:
        """Raise RequestRefused if the robot moves, is held by a user, executes an action, or failed to connect.

        Args:
            robot_id: the robot.
            held: whether the caller holds it.
        """
        cell = self._online
        name = cell.robot(robot_id).name
        cell.board.require_not_failed(robot_id)
        if not held and (holder := cell.held.holder(robot_id)) is not None:
            raise RequestRefused("{name} is being moved by {holder}.", name=name, holder=holder)
        if robot_id in cell.moving:
            raise RequestRefused("{name} is moving.", name=name)
        if cell.running_action is not None and cell.running_action.object_id == robot_id:
            raise RequestRefused("{name} is executing an action.", name=name)

    async def require_ready(self, robot_id: str, feature: str, arm_id: str | None, *, held: bool = False) -> None:
        """Raise RequestRefused unless the robot may start a motion now. `held`: see `require_not_moving`."""
        cell = self._online
        arm = cell.arm(robot_id, arm_id)
        self.require_not_moving(robot_id, held=held)
        self.require_feature(robot_id, feature)
        robot = cell.robot(robot_id)
        if self._types.robot_meta(robot.type).features.hand_teaching and await cell.ask(
            bool, robot_id, "get_hand_teaching_mode", arm
        ):
            raise RequestRefused("{name} is being moved by hand.", name=robot.name)

    async def take_control(self, robot_id: str, arm_id: str | None) -> None:
        """Take control before a target is computed from the present pose, since control activates the configured tool.

        Raises:
            CellError: the robot refused control.
        """
        if arm_id is None:  # the arms of multi-arm robots always have their own tools
            await self._online.call(robot_id, "check_if_ready_to_move", control=True)

    async def move(
        self,
        robot_id: str,
        method: str,
        arguments: Mapping[str, Any],
        event: str,
        event_data: MoveEventData,
        requested_at: float,
    ) -> None:
        """Move a robot and publish the end or failure. The caller has added the robot to `OnlineScene.moving`."""
        data = event_data(MoveEventType.END, UNSET)
        try:
            await self._online.call(robot_id, method, arguments, control=True, requested_at=requested_at)
        except asyncio.CancelledError:
            raise
        except Arcor2Error as error:
            data = replace(event_data(MoveEventType.FAILED, str(error)), **error.message.translation())
            log.info("motion failed", robot=robot_id, reason=str(error), detail=error.detail)
        finally:
            self._online.moving.discard(robot_id)
        self._hub.broadcast(make_event(event, data))

    def require_robot_online(self, robot_id: str) -> OnlineScene:
        """Return the online scene with the robot.

        Raises:
            RequestRefused: the scene is offline, or the object is not a robot.
            NotFound: the scene has no such object.
        """
        self._session.require_scene_open()
        self._online.require_online()
        self._online.robot(robot_id)
        return self._online

    async def solve_inverse(self, args: InverseKinematicsArgs) -> list[Joint]:
        """Return joints that reach a pose.

        Raises:
            RequestRefused: the robot does not compute inverse kinematics.
            CellError: no joints reach the pose.
        """
        cell = self._online
        arguments: dict[str, Any] = cell.arm(args.robot_id, optional(args.arm_id))
        self.require_feature(args.robot_id, "inverse_kinematics")
        arguments |= {
            "end_effector_id": args.end_effector_id,
            "pose": args.pose,
            "avoid_collisions": args.avoid_collisions,
        }
        if not isinstance(args.start_joints, Unset):
            arguments["start_joints"] = args.start_joints
        try:
            joints: list[Joint] = await cell.ask(list[Joint], args.robot_id, "inverse_kinematics", arguments)
        except CellError as error:
            robot = cell.robot(args.robot_id)
            # Some controllers compute it only for the client in control. In other cases use the kinematic model.
            if error.code != NotInControl.code or self._robots.model_of_type(robot.type) is None:
                raise
            return await self._kinematics.inverse(robot, args)
        return joints
