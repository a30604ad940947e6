"""A motion of a robot on a person's request: checked, told from start to end, its lock held until it has ended."""

import asyncio
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import structlog

from arcor2_hw.data.base import UNSET, Unset
from arcor2_hw.data.events import MoveEventType
from arcor2_hw.exceptions import Arcor2Error
from arcor2_server.errors import RequestRefused
from arcor2_server.events import make_event

if TYPE_CHECKING:
    from arcor2_server.services import Services

log = structlog.get_logger(__name__)

FEATURES = {
    "move_to_pose": "move to a pose",
    "move_to_joints": "move to joint values",
    "stop": "be stopped",
    "inverse_kinematics": "compute inverse kinematics",
    "forward_kinematics": "compute forward kinematics",
    "hand_teaching": "be moved by hand",
    "jog": "be jogged",
    "acknowledge_stop": "be acknowledged from here: do it at the robot",
}

Told = Callable[[MoveEventType, str | Unset], Any]
"""Makes the data of the event that tells a phase of the motion."""


def require_feature(services: "Services", robot_id: str, feature: str) -> None:
    """RequestRefused when the robot's type does not have the feature."""
    robot = services.cell.robot(robot_id)
    if not getattr(services.types.robot_meta(robot.type).features, feature):
        raise RequestRefused(f"{robot.name} cannot {FEATURES[feature]}.")


def require_speed(speed: float) -> None:
    """RequestRefused unless the speed is a fraction of the maximum."""
    if not 0.0 < speed <= 1.0:
        raise RequestRefused(f"The speed must be more than 0 and at most 1, not {speed:g}.")


def require_not_moving(services: "Services", robot_id: str, *, held: bool = False) -> None:
    """RequestRefused while the robot moves by a request, is held, or executes the running action; or is not there.

    held: whether the caller is the one who holds it.
    """
    cell = services.cell
    name = cell.robot(robot_id).name
    cell.board.require_not_failed(robot_id)
    if not held and (holder := cell.held.holder(robot_id)) is not None:
        raise RequestRefused(f"{name} is held by {holder}.")
    if robot_id in cell.moving:
        raise RequestRefused(f"{name} is moving.")
    if cell.running_action is not None and cell.running_action.object_id == robot_id:
        raise RequestRefused(f"{name} is executing an action.")


async def require_ready(services: "Services", robot_id: str, feature: str, arm_id: str | None) -> None:
    """RequestRefused unless the robot may begin a motion now."""
    cell = services.cell
    arm = cell.arm(robot_id, arm_id)
    require_not_moving(services, robot_id)
    require_feature(services, robot_id, feature)
    robot = cell.robot(robot_id)
    if services.types.robot_meta(robot.type).features.hand_teaching and await cell.ask(
        bool, robot_id, "get_hand_teaching_mode", arm
    ):
        raise RequestRefused(f"{robot.name} is being moved by hand.")


async def take_control(services: "Services", robot_id: str, arm_id: str | None) -> None:
    """Take control before a goal is computed from where the robot is: with control comes the tool of its settings.

    Raises what the robot refuses with.
    """
    if arm_id is None:  # of several arms each has its own tool all the time
        await services.cell.call(robot_id, "check_if_ready_to_move", control=True)


async def move(
    services: "Services",
    robot_id: str,
    method: str,
    arguments: Mapping[str, Any],
    event: str,
    told: Told,
    requested_at: float,
) -> None:
    """Move, and publish the end or the failure. The robot counts as moving from the request on (`cell.moving`)."""
    phase, problem = MoveEventType.END, ""
    try:
        await services.cell.call(robot_id, method, arguments, control=True, requested_at=requested_at)
    except asyncio.CancelledError:
        raise
    except Arcor2Error as error:
        phase, problem = MoveEventType.FAILED, str(error)
        log.info("motion failed", robot=robot_id, reason=problem, detail=error.detail)
    finally:
        services.cell.moving.discard(robot_id)
    services.hub.broadcast(make_event(event, told(phase, problem or UNSET)))
