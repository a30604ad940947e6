"""Requests for saved scenes and projects; the lists are kept encoded until something is written."""

from collections.abc import Awaitable, Callable
from typing import Any

import msgspec
from msgspec import UNSET, Raw

from arcor2_hw.data.project import Project
from arcor2_hw.data.rpc import IdArgs, ListProjectsData, ListScenesData
from arcor2_hw.data.scene import Scene
from arcor2_server.hub import encode
from arcor2_server.rpc.object_types import notice_new_types
from arcor2_server.rpc.registry import Context, at_once, rpc
from arcor2_server.services import Services


def _revisions(services: Services) -> tuple[int, ...]:
    return services.storage.revision, services.types.revision


@at_once("ListScenes")
def _kept_scenes(services: Services) -> Raw | None:
    return services.kept.get("ListScenes", _revisions(services)) if services.types.up_to_date else None


@at_once("ListProjects")
def _kept_projects(services: Services) -> Raw | None:
    return services.kept.get("ListProjects", _revisions(services)) if services.types.up_to_date else None


@rpc("ListScenes")
async def list_scenes(context: Context, args: None) -> Raw:  # noqa: ARG001
    """Give all saved scenes with what is wrong with them."""
    await notice_new_types(context)
    services = context.services
    revisions = _revisions(services)
    if (kept := services.kept.get("ListScenes", revisions)) is not None:
        return kept
    answer = []
    known = _Problems(services, "ListScenes")
    for scene in await services.storage.scenes():

        async def look(key: str = scene.id) -> list[str]:
            return services.session.scene_problems(await services.storage.scene(key))

        problems = await known.of(scene.id, (scene.modified, services.types.revision), look)
        answer.append(
            ListScenesData(
                id=scene.id,
                name=scene.name,
                created=_saved(scene.created),
                modified=_saved(scene.modified),
                description=scene.description or UNSET,
                problems=problems or UNSET,
            )
        )
    return services.kept.keep("ListScenes", revisions, encode(answer))


@rpc("ListProjects")
async def list_projects(context: Context, args: None) -> Raw:  # noqa: ARG001
    """Give all saved projects with what is wrong with them."""
    await notice_new_types(context)
    services = context.services
    revisions = _revisions(services)
    if (kept := services.kept.get("ListProjects", revisions)) is not None:
        return kept
    answer = []
    scenes = {scene.id: scene.modified for scene in await services.storage.scenes()}
    known = _Problems(services, "ListProjects")
    for project in await services.storage.projects():

        async def look(key: str = project.id) -> list[str]:
            return await services.session.project_problems(await services.storage.project(key))

        made_from = (project.modified, scenes.get(project.scene_id), services.types.revision)
        problems = await known.of(project.id, made_from, look)
        answer.append(ListProjectsData(**msgspec.structs.asdict(project), problems=problems or UNSET))
    return services.kept.keep("ListProjects", revisions, encode(answer))


class _Problems:
    """What is wrong with the documents of one list.

    They are looked at again only when they, or what they are made of, were changed: one that was saved among hundreds
    costs one. No two are saved at the same time.
    """

    def __init__(self, services: Services, request: str) -> None:
        self._before = services.kept.problems.get(request, {})
        self._found = services.kept.problems[request] = {}

    async def of(self, key: str, made_from: tuple[Any, ...], look: Callable[[], Awaitable[list[str]]]) -> list[str]:
        """Give what is wrong with a document, which `look` finds out."""
        found = self._before.get(key)
        if found is None or found[0] != made_from:
            found = made_from, await look()
        self._found[key] = found
        return found[1]


@rpc("GetScene")
async def get_scene(context: Context, args: IdArgs) -> Scene:
    """Give a scene as it was last saved."""
    return await context.services.storage.scene(args.id)


@rpc("GetProject")
async def get_project(context: Context, args: IdArgs) -> Project:
    """Give a project as it was last saved."""
    return await context.services.storage.project(args.id)


def _saved(stamp: Any) -> str:
    """Everything in storage carries both time stamps."""
    return str(stamp)
