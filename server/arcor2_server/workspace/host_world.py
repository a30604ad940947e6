"""Sends collision models added over REST and robot calibrations to the cell hosts."""

import asyncio
from collections.abc import Iterable
from pathlib import Path
from typing import Final, TypeVar

import msgspec

from arcor2_hw.collision.description import Obstacle
from arcor2_hw.data.object_type import Mesh, ObjectModel
from arcor2_hw.data.project import Project
from arcor2_hw.data.robot import KinematicCalibration
from arcor2_hw.data.scene import Scene, SceneObject, SceneObjectOverride
from arcor2_hw.exceptions import InvalidPackage
from arcor2_hw.runtime import messages as m
from arcor2_hw.runtime.documents import read_document
from arcor2_server.hosts.session import HostSession
from arcor2_server.storage import AssetStore
from arcor2_server.workspace.obstacles import ObstacleRegistry
from arcor2_server.workspace.robot_calibrations import RobotCalibrations

Opening = TypeVar("Opening", m.OpenScene, m.RunPackage)

SHAPES: Final = (".stl", ".obj", ".ply", ".off", ".dae", ".zip", ".urdf")
"""File name extensions of assets that are meshes or robot models."""


class HostWorld:
    """Keeps the cell hosts up to date with the workspace.

    Args:
        collisions: Collision models that were added over REST.
        robot_calibrations: Kinematic calibrations read from controllers.
        assets: Meshes and robot models.
        scene_host: The host of the online scene.
        program_host: The host of the running program.
    """

    def __init__(
        self,
        collisions: ObstacleRegistry,
        robot_calibrations: RobotCalibrations,
        assets: AssetStore,
        scene_host: HostSession,
        program_host: HostSession,
    ) -> None:
        self._collisions = collisions
        self._robot_calibrations = robot_calibrations
        self._assets = assets
        self._hosts = (scene_host, program_host)
        collisions.on_put.append(lambda obstacle: self._send(m.AddBody(self._body(obstacle))))
        collisions.on_remove.append(lambda keys: self._send(m.RemoveBodies(keys)))
        robot_calibrations.on_change.append(
            lambda robot: scene_host.send(m.Calibrate(robot.id, robot_calibrations.in_force(robot)))
        )

    def _send(self, message: m.ToHost) -> None:
        for host in self._hosts:
            host.send(message)

    def shape_files(self) -> dict[str, str]:
        """Return the files of meshes and robot models among the assets, by id."""
        found = [asset.id for asset in self._assets.infos() if asset.id.lower().endswith(SHAPES)]
        return {key: str(self._assets.file(key)) for key in found}

    def with_world(self, message: Opening, calibrations: dict[str, KinematicCalibration]) -> Opening:
        """Return a message that opens a scene or runs a package, with the present collision models. Send it at once."""
        bodies = [self._body(obstacle) for obstacle in self._collisions.obstacles.values()]
        return msgspec.structs.replace(message, bodies=bodies, calibrations=calibrations)

    def calibrations(
        self, objects: Iterable[SceneObject], overrides: Iterable[SceneObjectOverride] | None = None
    ) -> dict[str, KinematicCalibration]:
        """Return the robot calibrations in force, by object id.

        Args:
            objects: The objects of the scene.
            overrides: The settings that the project overrides; None for those of the open project.
        """
        overrides = None if overrides is None else list(overrides)
        found = {obj.id: self._robot_calibrations.in_force(obj, overrides) for obj in objects}
        return {key: calibration for key, calibration in found.items() if calibration is not None}

    async def calibrations_of_package(self, directory: Path) -> dict[str, KinematicCalibration]:
        """Return the robot calibrations for a package; empty if the package is damaged, which its host reports."""
        if not self._robot_calibrations.any:
            return {}
        try:
            scene, project = await asyncio.to_thread(_documents, directory / "data")
        except InvalidPackage:
            return {}
        return self.calibrations(scene.objects, project.object_overrides)

    def _body(self, obstacle: Obstacle) -> m.AddedBody:
        model, attachment = obstacle.model, obstacle.attachment
        file = ""
        if isinstance(model, Mesh) and self._assets.exists(model.asset_id):
            file = str(self._assets.file(model.asset_id))
        held = ("", "", []) if attachment is None else (attachment.robot, attachment.link, list(attachment.touching))
        return m.AddedBody(model.id, ObjectModel.of(model), obstacle.pose, obstacle.scale, file, *held)


def _documents(data: Path) -> tuple[Scene, Project]:
    return read_document(data / "scene.json", Scene), read_document(data / "project.json", Project)
