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
from arcor2_server.documents.extensions import keep_extensions
from arcor2_server.rest.operations import operation
from arcor2_server.rest.scenes import STORAGE, IdDesc, PutQuery, check_id
from arcor2_server.storage import Storage
from arcor2_server.storage.project_tables import ProjectTables


class ProjectSources(Data, frozen=True):
    """The script of a project without logic."""

    id: str
    script: str


class CloneQuery(Data, frozen=True):
    """The project to copy, and id, name and description of the copy."""

    project_id: str
    new_project_name: str
    new_project_id: str | Unset = UNSET
    new_description: str | Unset = UNSET


@dataclass(frozen=True, slots=True)
class ProjectOperations:
    """Projects, their sources and parameters over REST (protocol, section 13)."""

    _storage: Storage

    @operation("GET", "/projects", STORAGE, Role.OPERATOR)
    async def list_projects(self) -> list[IdDesc]:
        """Return all saved projects."""
        return [
            IdDesc(one.id, one.name, str(one.created), str(one.modified), one.description or UNSET)
            for one in await self._storage.projects()
        ]

    @operation("GET", "/projects/{project_id}", STORAGE, Role.OPERATOR)
    async def get_project(self, project_id: str) -> Project:
        """Return a saved project."""
        return await self._storage.project(project_id)

    @operation("PUT", "/projects", STORAGE, Role.ADVANCED_USER)
    async def put_project(self, query: PutQuery, body: Project) -> Timestamp:
        """Save a new or changed project; return the time. Its scene must be saved before.

        Functions, error exits and names of errors that the body lacks are kept by their ids, unless `exact`.
        """
        check_id(body.id, "project")
        if not query.exact:
            with contextlib.suppress(NotFound):
                body = keep_extensions(body, await self._storage.project(body.id))
        return str((await self._storage.put_project(body)).modified)

    @operation("DELETE", "/projects/{project_id}", STORAGE, Role.ADVANCED_USER)
    async def delete_project(self, project_id: str) -> None:
        """Delete a saved project with its source, parameters and overrides."""
        await self._storage.delete_project(project_id)

    @operation("PUT", "/projects/clone", STORAGE, Role.ADVANCED_USER)
    async def clone_project(self, query: CloneQuery) -> Project:
        """Copy a project with its source, parameters and overrides; return the copy."""
        storage, tables = self._storage, ProjectTables(self._storage)
        key = new_id("pro") if isinstance(query.new_project_id, Unset) else query.new_project_id
        check_id(key, "project")
        if not query.new_project_name:
            raise InvalidData("A project needs a name.")
        original = await storage.project(query.project_id)
        if await storage.identify(key) is not None:
            raise Conflict("The id {key!r} is used already.", key=key)
        copy = replace(original, id=key, name=query.new_project_name)
        if not isinstance(query.new_description, Unset):
            copy = replace(copy, description=query.new_description)
        copy = await storage.put_project(copy)
        with contextlib.suppress(NotFound):  # a project with logic has no script
            await storage.put_project_source(key, await storage.project_source(original.id))
        await tables.put_parameters(key, await tables.parameters(original.id))
        await tables.put_object_parameters(key, await tables.object_parameters(original.id))
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

    # ------------------------------------------------------------------------------------------------ parameters
    @operation("GET", "/projects/{project_id}/parameters", STORAGE, Role.OPERATOR)
    async def get_parameters(self, project_id: str) -> list[ProjectParameter]:
        """Return the parameters stored next to a project, not those in the project document."""
        return await ProjectTables(self._storage).parameters(project_id)

    @operation("PUT", "/projects/{project_id}/parameters", STORAGE, Role.ADVANCED_USER)
    async def put_parameters(self, project_id: str, body: list[ProjectParameter]) -> Timestamp:
        """Store parameters next to a project; return the time."""
        await ProjectTables(self._storage).put_parameters(project_id, body)
        return now()

    @operation("GET", "/projects/{project_id}/object-parameters", STORAGE, Role.OPERATOR)
    async def get_object_parameters(self, project_id: str) -> list[SceneObjectOverride]:
        """Return the overrides of object settings stored next to a project."""
        return await ProjectTables(self._storage).object_parameters(project_id)

    @operation("PUT", "/projects/{project_id}/object-parameters", STORAGE, Role.ADVANCED_USER)
    async def put_object_parameters(self, project_id: str, body: list[SceneObjectOverride]) -> None:
        """Store overrides of object settings next to a project."""
        await ProjectTables(self._storage).put_object_parameters(project_id, body)
