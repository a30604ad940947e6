"""The open scene as the compute worker is told of it: bodies, robots, what these hold; and lines through it."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from arcor2_hw.collision.description import (
    Attachment,
    MeshShape,
    RobotSource,
    Shape,
    StoredFile,
    WorldBody,
    WorldItem,
    WorldRobot,
)
from arcor2_hw.compute.kinematics_tasks import CheckLines, Line, PlaceInLink
from arcor2_hw.data.base import Unset
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.object_type import Mesh
from arcor2_hw.data.robot import Joint
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.exceptions import Arcor2Error, Conflict
from arcor2_hw.kinematics.primitives import primitive_of
from arcor2_server.workspace.collisions import Hit, Placed, first_hit
from arcor2_server.workspace.robot_models import model_of_type, settings_of

if TYPE_CHECKING:
    from arcor2_server.services import Services

Joints = Mapping[str, list[Joint]]
"""Present joint values by robot."""


# ------------------------------------------------------------------------------------------------ bodies
def kept_mesh(services: "Services", asset_id: str) -> StoredFile:
    """Give the file of a mesh; one that is gone has no path, and is named by who tries to read it."""
    path = str(services.assets.file(asset_id)) if services.assets.exists(asset_id) else "/nonexistent"
    return StoredFile(path, asset_id)


def body_of(services: "Services", key: str, placed: Placed) -> WorldBody:
    """Give a placed model as the worker is told of it."""
    model = placed.model
    shape: Shape = (
        MeshShape(kept_mesh(services, model.asset_id), placed.scale) if isinstance(model, Mesh) else primitive_of(model)
    )
    return WorldBody(key, shape, placed.pose, placed.attachment)


def standing(services: "Services") -> dict[str, Placed]:
    """Give what stands in the open scene, online or not, and what was put in over REST."""
    found = services.collisions.everything(services)
    scene = services.session.scene
    if scene is not None and not services.cell.online:
        for obj in scene.objects:
            model = services.types.meta(obj.type).object_model
            if not isinstance(model, Unset) and not isinstance(obj.pose, Unset) and obj.id not in found:
                found[obj.id] = Placed(model.model(), obj.pose)
    return found


# ------------------------------------------------------------------------------------------------ robots
def robots(services: "Services") -> list[SceneObject]:
    """Give the robots of the open scene that have a model."""
    scene = services.session.scene
    if scene is None:
        return []
    return [
        obj
        for obj in scene.objects
        if services.types.derives_from(obj.type, "Robot") and model_of_type(services, obj.type) is not None
    ]


def robot_model(services: "Services", robot: SceneObject) -> RobotSource | None:
    """Give a robot's model where it stands, None when it has none."""
    file = model_of_type(services, robot.type)
    if file is None:
        return None
    base = Pose() if isinstance(robot.pose, Unset) else robot.pose
    calibration = services.arm_calibrations.in_force(robot)
    return RobotSource(file, base, settings_of(services, robot), calibration=calibration)


async def present_joints(services: "Services", robot: SceneObject) -> list[Joint]:
    """Give the joints of a robot as they are; none where that cannot be known."""
    if not services.cell.online:
        return []
    try:
        if services.types.robot_meta(robot.type).multi_arm:  # without an arm's name it tells those of all
            joints: list[Joint] = await services.cell.ask(list[Joint], robot.id, "robot_joints")
            return joints
        return await services.cell.robot_joints(robot.id)
    except Arcor2Error:
        return []


def things(services: "Services", chosen: list[SceneObject], joints: Joints | None = None) -> dict[str, WorldItem]:
    """Give the world of the open scene with the robots that are chosen, and what these hold.

    joints: of those robots; one without stands in its middle position. Of what other robots hold nothing is said.
    """
    present = joints or {}
    found: dict[str, WorldItem] = {}
    for robot in chosen:
        model = robot_model(services, robot)
        if model is not None:
            found[robot.id] = WorldRobot(robot.id, model, present.get(robot.id, []))
    for key, placed in standing(services).items():
        if key not in found and (placed.attachment is None or placed.attachment.robot in found):
            found[key] = body_of(services, key, placed)
    return found


def in_names(services: "Services", text: str) -> str:
    """Give a sentence of the worker, which knows ids, with the names by which people know the objects."""
    scene = services.session.scene
    if not text or scene is None:
        return text
    met = [obj for obj in scene.objects if obj.id in text]
    for obj in sorted(met, key=lambda obj: len(obj.id), reverse=True):  # an id may begin as another one does
        text = text.replace(obj.id, obj.name)
    return text


# ------------------------------------------------------------------------------------------------ lines
async def hit(services: "Services", start: Position, end: Position) -> Hit | None:
    """Give what a straight line meets first of what is in operation, None when it is free.

    Robots are no obstacle, as in the protocol: who asks is one of them. What they hold is.
    """
    placed = services.collisions.everything(services)
    inflation = services.collisions.inflation
    found = first_hit(start, end, placed.items(), inflation)
    rest = {key: one for key, one in placed.items() if not one.simple}
    if not rest:
        return found
    holders = {one.attachment.robot for one in rest.values() if one.attachment is not None}
    chosen = [robot for robot in robots(services) if robot.id in holders]
    joints = {robot.id: await present_joints(services, robot) for robot in chosen}
    world: dict[str, WorldItem] = {
        key: thing for key, thing in things(services, chosen, joints).items() if key in rest or key in holders
    }
    task = CheckLines([Line(start, end)], inflation, sorted(holders))
    (further,) = await services.compute.run(task, world=world)
    if further is not None and (found is None or further.share < found.share):
        return Hit(further.id, further.share)
    return found


# ------------------------------------------------------------------------------------------------ holding
async def attach(services: "Services", key: str, robot: SceneObject, link: str) -> None:
    """Let a robot hold a model that was put in, from where both are now on; it moves with the link.

    NotFound; Conflict when it is held, when the robot has no model, or its joints are not known.
    """
    placed = services.collisions.given(key)
    if placed.attachment is not None:
        raise Conflict(f"{key} is held already.")
    in_link = await _in_link(services, robot, link, placed.pose)
    services.collisions.put(Placed(placed.model, in_link, placed.scale, Attachment(robot.id, link)))


async def detach(services: "Services", key: str) -> Pose:
    """Let go of a model, which stays where it is now; gives where. NotFound; Conflict as `attach`."""
    placed = services.collisions.given(key)
    if placed.attachment is None:
        raise Conflict(f"{key} is not held.")
    robot = services.cell.robot(placed.attachment.robot)
    link_from_world = await _in_link(services, robot, placed.attachment.link, Pose())
    pose = link_from_world.inverted() * placed.pose
    services.collisions.put(Placed(placed.model, pose, placed.scale))
    return pose


async def _in_link(services: "Services", robot: SceneObject, link: str, pose: Pose) -> Pose:
    model = robot_model(services, robot)
    if model is None:
        raise Conflict(f"{robot.name} has no model (URDF) that could hold anything.")
    joints = await present_joints(services, robot)
    if not joints:
        raise Conflict(f"The joints of {robot.name} are not known: start the scene first.")
    return await services.compute.run(PlaceInLink(model, joints, link, pose))
