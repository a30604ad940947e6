"""Requests for saved scenes and projects; the lists are kept encoded until something is written."""

from typing import Any

import msgspec
from msgspec import UNSET, Raw

from arcor2_hw.data.project import Project
from arcor2_hw.data.rpc import IdArgs, ListProjectsData, ListScenesData
from arcor2_hw.data.scene import Scene
from arcor2_server.events import encode
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
    scenes = await services.storage.scenes()
    problems = await services.saved_problems.of_scenes(scenes)
    answer = [
        ListScenesData(
            id=scene.id,
            name=scene.name,
            created=_saved(scene.created),
            modified=_saved(scene.modified),
            description=scene.description or UNSET,
            problems=problems[scene.id] or UNSET,
        )
        for scene in scenes
    ]
    return services.kept.keep("ListScenes", revisions, encode(answer))


@rpc("ListProjects")
async def list_projects(context: Context, args: None) -> Raw:  # noqa: ARG001
    """Give all saved projects with what is wrong with them."""
    await notice_new_types(context)
    services = context.services
    revisions = _revisions(services)
    if (kept := services.kept.get("ListProjects", revisions)) is not None:
        return kept
    projects, scenes = await services.storage.projects(), await services.storage.scenes()
    problems = await services.saved_problems.of_projects(projects, scenes)
    answer = [
        ListProjectsData(**msgspec.structs.asdict(project), problems=problems[project.id] or UNSET)
        for project in projects
    ]
    return services.kept.keep("ListProjects", revisions, encode(answer))


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
