"""Requests for saved scenes and projects. The encoded lists are cached."""

from dataclasses import dataclass
from typing import Any

import msgspec
from msgspec import UNSET, Raw

from arcor2_hw.data.project import Project
from arcor2_hw.data.rpc import IdArgs, ListProjectsData, ListScenesData
from arcor2_hw.data.scene import Scene
from arcor2_hw.messages import Message
from arcor2_server.documents.saved_problems import SavedProblems
from arcor2_server.events import encode
from arcor2_server.object_types.notifications import TypeNotifications
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.rpc.answer_cache import AnswerCache, cache_name
from arcor2_server.rpc.registry import Context, cached, rpc
from arcor2_server.storage import Storage


def _problems(problems: list[Message], codes: bool) -> dict[str, Any]:
    """Return the fields with problems; empty without any."""
    if not problems:
        return {}
    return {"problems": [each.text for each in problems], "problem_messages": problems if codes else UNSET}


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

    def _cached(self, name: str) -> Raw | None:
        return self._answer_cache.get(name, self._revisions()) if self._types.up_to_date else None

    @cached("ListScenes")
    def cached_scenes(self, codes: bool) -> Raw | None:
        """Return the cached list of scenes, None if it is outdated."""
        return self._cached(cache_name("ListScenes", codes))

    @cached("ListProjects")
    def cached_projects(self, codes: bool) -> Raw | None:
        """Return the cached list of projects, None if it is outdated."""
        return self._cached(cache_name("ListProjects", codes))

    @rpc("ListScenes")
    async def list_scenes(self, context: Context, args: None) -> Raw:
        """Return all saved scenes with their problems."""
        await self._type_notifications.publish()
        name, revisions = cache_name("ListScenes", context.codes), self._revisions()
        if (cached_answer := self._answer_cache.get(name, revisions)) is not None:
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
                **_problems(problems[scene.id], context.codes),
            )
            for scene in scenes
        ]
        return self._answer_cache.store(name, revisions, encode(answer))

    @rpc("ListProjects")
    async def list_projects(self, context: Context, args: None) -> Raw:
        """Return all saved projects with their problems."""
        await self._type_notifications.publish()
        name, revisions = cache_name("ListProjects", context.codes), self._revisions()
        if (cached_answer := self._answer_cache.get(name, revisions)) is not None:
            return cached_answer
        projects, scenes = await self._storage.projects(), await self._storage.scenes()
        problems = await self._saved_problems.of_projects(projects, scenes)
        answer = [
            ListProjectsData(**msgspec.structs.asdict(project), **_problems(problems[project.id], context.codes))
            for project in projects
        ]
        return self._answer_cache.store(name, revisions, encode(answer))

    @rpc("GetScene")
    async def get_scene(self, context: Context, args: IdArgs) -> Scene:
        """Return a saved scene, without unsaved changes."""
        return await self._storage.scene(args.id)

    @rpc("GetProject")
    async def get_project(self, context: Context, args: IdArgs) -> Project:
        """Return a saved project, without unsaved changes."""
        return await self._storage.project(args.id)
