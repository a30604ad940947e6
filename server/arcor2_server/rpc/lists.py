"""Requests for saved scenes and projects. The encoded lists are cached."""

from dataclasses import dataclass

import msgspec
from msgspec import UNSET, Raw

from arcor2_hw.data.project import Project
from arcor2_hw.data.rpc import IdArgs, ListProjectsData, ListScenesData
from arcor2_hw.data.scene import Scene
from arcor2_server.documents.saved_problems import SavedProblems
from arcor2_server.events import encode
from arcor2_server.object_types.notifications import TypeNotifications
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.rpc.answer_cache import AnswerCache
from arcor2_server.rpc.registry import Context, cached, rpc
from arcor2_server.storage import Storage


@dataclass(frozen=True, slots=True)
class ListRequests:
    """Requests for saved scenes and projects. The encoded lists are cached until something is saved."""

    _storage: Storage
    _types: ObjectTypes
    _type_notifications: TypeNotifications
    _answer_cache: AnswerCache
    _saved_problems: SavedProblems

    def _revisions(self) -> tuple[int, ...]:
        return self._storage.revision, self._types.revision

    @cached("ListScenes")
    def cached_scenes(self) -> Raw | None:
        """Return the cached list of scenes, None if it is outdated."""
        return self._answer_cache.get("ListScenes", self._revisions()) if self._types.up_to_date else None

    @cached("ListProjects")
    def cached_projects(self) -> Raw | None:
        """Return the cached list of projects, None if it is outdated."""
        return self._answer_cache.get("ListProjects", self._revisions()) if self._types.up_to_date else None

    @rpc("ListScenes")
    async def list_scenes(self, context: Context, args: None) -> Raw:
        """Return all saved scenes with their problems."""
        await self._type_notifications.publish()
        revisions = self._revisions()
        if (cached_answer := self._answer_cache.get("ListScenes", revisions)) is not None:
            return cached_answer
        scenes = await self._storage.scenes()
        problems = await self._saved_problems.of_scenes(scenes)
        answer = [
            ListScenesData(
                id=scene.id,
                name=scene.name,
                created=str(scene.created),
                modified=str(scene.modified),
                description=scene.description or UNSET,
                problems=problems[scene.id] or UNSET,
            )
            for scene in scenes
        ]
        return self._answer_cache.store("ListScenes", revisions, encode(answer))

    @rpc("ListProjects")
    async def list_projects(self, context: Context, args: None) -> Raw:
        """Return all saved projects with their problems."""
        await self._type_notifications.publish()
        revisions = self._revisions()
        if (cached_answer := self._answer_cache.get("ListProjects", revisions)) is not None:
            return cached_answer
        projects, scenes = await self._storage.projects(), await self._storage.scenes()
        problems = await self._saved_problems.of_projects(projects, scenes)
        answer = [
            ListProjectsData(**msgspec.structs.asdict(project), problems=problems[project.id] or UNSET)
            for project in projects
        ]
        return self._answer_cache.store("ListProjects", revisions, encode(answer))

    @rpc("GetScene")
    async def get_scene(self, context: Context, args: IdArgs) -> Scene:
        """Return a saved scene, without unsaved changes."""
        return await self._storage.scene(args.id)

    @rpc("GetProject")
    async def get_project(self, context: Context, args: IdArgs) -> Project:
        """Return a saved project, without unsaved changes."""
        return await self._storage.project(args.id)
