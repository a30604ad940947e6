"""The robots of the open scene: their joints and poses, their settings, and the files of their models."""

import re
from typing import Any, Final
from urllib.parse import unquote, urlsplit

import msgspec

from arcor2_hw.collision.description import RobotSource, StoredFile
from arcor2_hw.data.base import Unset
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Joint
from arcor2_hw.data.scene import SceneObject, SceneObjectOverride
from arcor2_hw.exceptions import Arcor2Error, NotFound
from arcor2_server.documents import Session
from arcor2_server.errors import RequestRefused
from arcor2_server.hosts.session import HostSession
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.storage import AssetStore

_ASSET: Final = re.compile(r"/assets/([^/]+)/data/?$")


def optional(value: str | Unset) -> str | None:
    """Return an optional identifier of the protocol as None or a string."""
    return None if isinstance(value, Unset) else value


def end_effector_link(name: str, arm_id: str | Unset) -> str:
    """Return the link of an end effector, which in the model of a multi-arm robot starts with the arm's name."""
    return name if isinstance(arm_id, Unset) else f"{arm_id}_{name}"


class SceneRobots:
    """The robots of the open scene."""

    def __init__(self, assets: AssetStore, types: ObjectTypes, session: Session, host: HostSession) -> None:
        self._assets = assets
        self._types = types
        self._session = session
        self._host = host
        self._end_effectors: dict[tuple[str, str | None], set[str]] = {}
        """End effectors by robot and arm, which stay the same while the robot is connected."""
        host.board.on_connection.append(self._end_effectors.clear)

    # -------------------------------------------------------------------------------- in the scene
    def robot(self, robot_id: str) -> SceneObject:
        """Return the scene object of a robot. Raise NotFound, or RequestRefused if the object is not a robot."""
        found = self._session.document.scene_object(robot_id)
        if not self._types.derives_from(found.type, "Robot"):
            raise RequestRefused("{name} is not a robot.", name=found.name)
        return found

    def arm(self, robot_id: str, arm_id: str | None) -> dict[str, Any]:
        """Return the argument that names the arm. Raise RequestRefused unless only multi-arm robots have one."""
        robot = self.robot(robot_id)
        multi_arm = self._types.robot_meta(robot.type).multi_arm
        if multi_arm and arm_id is None:
            raise RequestRefused("{name} has several arms: name one.", name=robot.name)
        if not multi_arm and arm_id is not None:
            raise RequestRefused("{name} has one arm: do not name it.", name=robot.name)
        return {} if arm_id is None else {"arm_id": arm_id}

    # -------------------------------------------------------------------------------- online
    async def robot_joints(self, robot_id: str, arm_id: str | None = None, *, gripper: bool = False) -> list[Joint]:
        """Return the present joint values of a robot."""
        args: dict[str, Any] = {"include_gripper": gripper} | self.arm(robot_id, arm_id)
        joints: list[Joint] = await self._host.ask(list[Joint], robot_id, "robot_joints", args)
        return joints

    async def present_joints(self, robot: SceneObject) -> list[Joint]:
        """Return the present joint values of all arms of a robot; empty if they are unknown."""
        if not self._host.online:
            return []
        try:
            if self._types.robot_meta(robot.type).multi_arm:  # without an arm it returns the joints of all arms
                joints: list[Joint] = await self._host.ask(list[Joint], robot.id, "robot_joints")
                return joints
            return await self.robot_joints(robot.id)
        except Arcor2Error:
            return []

    async def end_effectors(self, robot_id: str, arm_id: str | None = None) -> set[str]:
        """Return the names of a robot's end effectors, which are cached while the robot is connected."""
        arm = self.arm(robot_id, arm_id)
        key = robot_id, arm_id
        if (known := self._end_effectors.get(key)) is None:
            known = await self._host.ask(set[str], robot_id, "get_end_effectors_ids", arm)
            self._end_effectors[key] = known
        return known

    async def require_end_effector(self, robot_id: str, end_effector: str, arm_id: str | None = None) -> None:
        """Raise RequestRefused if a robot does not have an end effector."""
        if end_effector not in await self.end_effectors(robot_id, arm_id):
            raise RequestRefused(
                "{name} has no end effector {end_effector!r}.",
                name=self.robot(robot_id).name,
                end_effector=end_effector,
            )

    async def end_effector_pose(self, robot_id: str, end_effector: str, arm_id: str | None = None) -> Pose:
        """Return the present pose of an end effector in the world."""
        await self.require_end_effector(robot_id, end_effector, arm_id)
        args = {"end_effector": end_effector} | self.arm(robot_id, arm_id)
        pose: Pose = await self._host.ask(Pose, robot_id, "get_end_effector_pose", args)
        return pose

    # -------------------------------------------------------------------------------- models and settings
    def with_models(self) -> list[SceneObject]:
        """Return the robots of the open scene that have a model."""
        scene = self._session.scene
        if scene is None:
            return []
        return [
            obj
            for obj in scene.objects
            if self._types.derives_from(obj.type, "Robot") and self.model_of_type(obj.type) is not None
        ]

    def model_of_type(self, type_name: str) -> StoredFile | None:
        """Return the model file of a robot type, None if it has none."""
        name = self._types.robot_meta(type_name).urdf_package_filename
        if isinstance(name, Unset):
            return None
        return StoredFile(str(self._assets.file(name)), name) if self._assets.exists(name) else None

    def settings_of(self, robot: SceneObject, overrides: list[SceneObjectOverride] | None = None) -> dict[str, Any]:
        """Return the settings of an object by name.

        Args:
            robot: The object.
            overrides: The settings that a project overrides; None for those of the open project.
        """
        if overrides is None:
            project = self._session.project
            overrides = [] if project is None else list(project.object_overrides)
        parameters = list(robot.parameters)
        for override in overrides:
            if override.id == robot.id:
                parameters += override.parameters
        found: dict[str, Any] = {}
        for parameter in parameters:
            try:
                found[parameter.name] = msgspec.json.decode(parameter.value)
            except msgspec.DecodeError:
                continue  # reported by the checks of the scene
        return found

    def model_of_uri(self, uri: str) -> RobotSource:
        """Return the model in the asset that a URI names, by its id or its address on this server.

        Raises:
            NotFound: The asset does not exist. Other servers are not contacted.
        """
        path = urlsplit(uri).path
        found = _ASSET.search(path)
        for name in (uri, unquote(found[1]) if found else unquote(path.rsplit("/", 1)[-1])):
            if self._assets.exists(name):
                return RobotSource(StoredFile(str(self._assets.file(name)), name))
        raise NotFound("Asset {uri!r} with the model of the robot does not exist.", uri=uri)
