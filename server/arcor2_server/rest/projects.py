"""Projects, their sources and parameters over REST (protocol, section 13)."""

import contextlib
from dataclasses import dataclass

from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.data.base import Data, Timestamp, Unset, new_id, now
from arcor2_hw.data.project import Project, ProjectParameter
from arcor2_hw.data.role import Role
from arcor2_hw.data.scene import SceneObjectOverride
from arcor2_hw.exceptions import Conflict, InvalidData, NotFound
from arcor2_server.rest.operations import operation
from arcor2_server.rest.scenes import STORAGE, IdDesc, check_id
from arcor2_server.storage import Storage
from arcor2_server.storage.project_tables import ProjectTables


class ProjectSources(Data, frozen=True):
    """The script of a project without logic."""

    id: str
    script: str


class CloneQuery(Data, frozen=True):
    """Which project becomes which."""

    project_id: str
    new_project_name: str
    new_project_id: str | Unset = UNSET
    new_description: str | Unset = UNSET


@dataclass(frozen=True, slots=True)
class ProjectOperations:
    """Projects over REST: documents, sources, and what is kept beside them (protocol, section 13)."""

    _storage: Storage

    @operation("GET", "/projects", STORAGE, Role.OPERATOR)
    async def list_projects(self) -> list[IdDesc]:
        """List the saved projects."""
        return [
            IdDesc(one.id, one.name, str(one.created), str(one.modified), one.description or UNSET)
            for one in await self._storage.projects()
        ]

    @operation("GET", "/projects/{project_id}", STORAGE, Role.OPERATOR)
    async def get_project(self, project_id: str) -> Project:
        """Return a saved project."""
        return await self._storage.project(project_id)

    @operation("PUT", "/projects", STORAGE, Role.ADVANCED_USER)
    async def put_project(self, body: Project) -> Timestamp:
        """Save a project, new or changed; answers the time. Its scene has to be saved."""
        check_id(body.id, "project")
        return str((await self._storage.put_project(body)).modified)

    @operation("DELETE", "/projects/{project_id}", STORAGE, Role.ADVANCED_USER)
    async def delete_project(self, project_id: str) -> None:
        """Delete a saved project with its source, parameters and overrides."""
        await self._storage.delete_project(project_id)

    @operation("PUT", "/projects/clone", STORAGE, Role.ADVANCED_USER)
    async def clone_project(self, query: CloneQuery) -> Project:
        """Copy a project with its source, parameters and overrides; answer the copy."""
        storage, beside = self._storage, ProjectTables(self._storage)
        key = new_id("pro") if isinstance(query.new_project_id, Unset) else query.new_project_id
        check_id(key, "project")
        if not query.new_project_name:
            raise InvalidData("A project needs a name.")
        original = await storage.project(query.project_id)
        if await storage.identify(key) is not None:
            raise Conflict("There is something with the id {key!r} already.", key=key)
        copy = replace(original, id=key, name=query.new_project_name)
        if not isinstance(query.new_description, Unset):
            copy = replace(copy, description=query.new_description)
        copy = await storage.put_project(copy)
        with contextlib.suppress(NotFound):  # one with logic has none
            await storage.put_project_source(key, await storage.project_source(original.id))
        await beside.put_parameters(key, await beside.parameters(original.id))
        await beside.put_object_parameters(key, await beside.object_parameters(original.id))
        return copy

    # ------------------------------------------------------------------------------------------------ sources
    @operation("PUT", "/projects/sources", STORAGE, Role.PROGRAMMER)
    async def put_sources(self, body: ProjectSources) -> None:
        """Save the script of a project."""
        await self._storage.put_project_source(body.id, body.script)

    @operation("GET", "/projects/{project_id}/sources", STORAGE, Role.OPERATOR)
    async def get_sources(self, project_id: str) -> ProjectSources:
        """Return the script of a project."""
        return ProjectSources(project_id, await self._storage.project_source(project_id))

    # ------------------------------------------------------------------------------------------------ beside
    @operation("GET", "/projects/{project_id}/parameters", STORAGE, Role.OPERATOR)
    async def get_parameters(self, project_id: str) -> list[ProjectParameter]:
        """Return the parameters stored next to a project, not those inside it."""
        return await ProjectTables(self._storage).parameters(project_id)

    @operation("PUT", "/projects/{project_id}/parameters", STORAGE, Role.ADVANCED_USER)
    async def put_parameters(self, project_id: str, body: list[ProjectParameter]) -> Timestamp:
        """Store parameters next to a project; answer the time."""
        await ProjectTables(self._storage).put_parameters(project_id, body)
        return now()

    @operation("GET", "/projects/{project_id}/object-parameters", STORAGE, Role.OPERATOR)
    async def get_object_parameters(self, project_id: str) -> list[SceneObjectOverride]:
        """Return the overrides of settings stored next to a project."""
        return await ProjectTables(self._storage).object_parameters(project_id)

    @operation("PUT", "/projects/{project_id}/object-parameters", STORAGE, Role.ADVANCED_USER)
    async def put_object_parameters(self, project_id: str, body: list[SceneObjectOverride]) -> None:
        """Store overrides of settings next to a project."""
        await ProjectTables(self._storage).put_object_parameters(project_id, body)
