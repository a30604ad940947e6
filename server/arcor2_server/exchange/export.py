"""Exports a saved document from a server, with everything it needs."""

import tempfile
from collections.abc import Collection, Iterable
from pathlib import Path

from msgspec.structs import replace

from arcor2_hw.analysis import BUILT_IN
from arcor2_hw.client import Client, ResourceNotFound
from arcor2_hw.client.rest import Listed
from arcor2_hw.data.base import Unset
from arcor2_hw.data.object_type import ObjectModel, ObjectTypeSource
from arcor2_hw.data.project import Project
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import Conflict, NotFound
from arcor2_server.exchange.archive import Archive, AssetFile, mesh_of, with_needed


def find_id(listed: Iterable[Listed], wanted: str, kind: str, url: str) -> str:
    """Return the id of a document given by id or name. Raise NotFound, or Conflict if the name is not unique."""
    found = [one.id for one in listed if one.id == wanted] or [one.id for one in listed if one.name == wanted]
    if not found:
        raise NotFound("the server at {url} has no {what} {wanted}", url=url, what=kind, wanted=wanted)
    if len(found) > 1:
        raise Conflict(
            "{count} {what}s are named {wanted}: give an id: {found}",
            count=len(found),
            what=kind,
            wanted=wanted,
            found=", ".join(sorted(found)),
        )
    return found[0]


class Exporter:
    """Exports documents from a server. Use it while the client is connected."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self._rest = client.rest
        self._uploaded: dict[str, ObjectTypeSource] | None = None

    async def scene(self, wanted: str) -> Archive:
        """Export a scene, by name or id."""
        key = find_id(await self._rest.scenes(), wanted, "scene", self._client.url)
        scene = await self._rest.scene(key)
        return await self._with_dependencies(Archive("scene", scene), scene)

    async def project(self, wanted: str) -> Archive:
        """Export a project with its scene, by name or id."""
        rest = self._rest
        key = find_id(await rest.projects(), wanted, "project", self._client.url)
        project = await rest.project(key)
        try:
            scene = await rest.scene(project.scene_id)
        except ResourceNotFound:
            raise NotFound(
                "the scene {scene_id} of the project {name} no longer exists",
                scene_id=project.scene_id,
                name=project.name,
            ) from None
        script = None
        if not project.has_logic:
            try:
                script = await rest.project_script(key)
            except ResourceNotFound:
                script = ""
        archive = Archive(
            "project",
            scene,
            project,
            script,
            parameters=await rest.kept_parameters(key),
            overrides=await rest.kept_overrides(key),
        )
        return await self._with_dependencies(archive, scene, project)

    async def object_types(self, wanted: Collection[str]) -> Archive:
        """Export uploaded object types with their bases, mixins, models and meshes."""
        uploaded = await self.uploaded()
        for name in wanted:
            if name not in uploaded:
                raise NotFound(
                    "the server at {url} has no uploaded object type {name}", url=self._client.url, name=name
                )
        types = with_needed(wanted, uploaded)
        return Archive("object-type", types=types, assets=await self._assets(types, ()))

    async def uploaded(self) -> dict[str, ObjectTypeSource]:
        """Return the uploaded object types with their models."""
        if self._uploaded is None:
            models = {name.id: name for name in await self._rest.models()}
            self._uploaded = {}
            for listed in await self._rest.object_types():
                one = await self._rest.object_type(listed.id)
                if listed.id in models:
                    one = replace(one, model=ObjectModel.of(await self._rest.model(models[listed.id])))
                self._uploaded[listed.id] = one
        return self._uploaded

    async def _with_dependencies(self, archive: Archive, scene: Scene, project: Project | None = None) -> Archive:
        uploaded = await self.uploaded()
        named = {obj.type for obj in scene.objects}
        if project is not None and not isinstance(project.project_objects_ids, Unset):
            named |= set(project.project_objects_ids)
        types = with_needed(named, uploaded)
        installed = sorted(named - types.keys() - set(BUILT_IN))
        assets = await self._assets(types, named)
        return replace(archive, types=types, installed=installed, assets=assets)

    async def _assets(self, types: dict[str, ObjectTypeSource], robots: Iterable[str]) -> dict[str, AssetFile]:
        """Fetch the meshes of the types, and the descriptions of the robots among `robots`."""
        wanted = {mesh for one in types.values() if (mesh := mesh_of(one)) is not None}
        for robot in await self._client.get_robot_meta():
            if robot.type in {*robots, *types} and not isinstance(robot.urdf_package_filename, Unset):
                wanted.add(robot.urdf_package_filename)
        available = {asset.id: asset for asset in await self._rest.assets()}
        assets: dict[str, AssetFile] = {}
        with tempfile.TemporaryDirectory(prefix="arcor2-export-") as directory:
            for key in sorted(wanted & available.keys()):
                file = Path(directory) / "asset"
                await self._rest.download_asset(key, file)
                name = available[key].file_name
                assets[key] = AssetFile(file.read_bytes(), "" if isinstance(name, Unset) else name)
        return assets
