"""Problems of saved scenes and projects, for the lists that clients show."""

import asyncio
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from arcor2_hw.data.project import BareProject, Project
from arcor2_hw.data.scene import BareScene
from arcor2_server.object_types import ObjectTypes
from arcor2_server.session.checks import project_problems, scene_problems
from arcor2_server.storage import Storage

Sources = tuple[Any, ...]
"""What the problems of a document depend on: its own revision, its scene's and that of the object types."""
Checked = Mapping[str, tuple[Sources, list[str]]]
"""By document id, the problems found and what they were found from."""


class SavedProblems:
    """Checks saved documents, and checks one again only after it, its scene or an object type has changed."""

    def __init__(self, storage: Storage, types: ObjectTypes) -> None:
        self._storage = storage
        self._types = types
        self._scenes: Checked = {}
        self._projects: Checked = {}

    async def of_scenes(self, scenes: Sequence[BareScene]) -> dict[str, list[str]]:
        """Return the problems of each of these saved scenes by id, empty where it can be opened."""
        sources = {scene.id: (scene.modified, self._types.revision) for scene in scenes}
        found = await self._storage.scenes_with_ids(_outdated(sources, self._scenes))
        fresh = await asyncio.to_thread(lambda: {scene.id: scene_problems(scene, self._types) for scene in found})
        self._scenes = _merged(sources, self._scenes, fresh)
        return {key: problems for key, (_, problems) in self._scenes.items()}

    async def of_projects(self, projects: Sequence[BareProject], scenes: Sequence[BareScene]) -> dict[str, list[str]]:
        """Return the problems of each of these saved projects by id, given all saved scenes."""
        modified = {scene.id: scene.modified for scene in scenes}
        sources = {each.id: (each.modified, modified.get(each.scene_id), self._types.revision) for each in projects}
        found = await self._storage.projects_with_ids(_outdated(sources, self._projects))
        fresh = await asyncio.to_thread(self._checker(await self._scenes_of(found)), found)
        self._projects = _merged(sources, self._projects, fresh)
        return {key: problems for key, (_, problems) in self._projects.items()}

    async def _scenes_of(self, projects: Sequence[Project]) -> dict[str, Any]:
        scenes = await self._storage.scenes_with_ids(sorted({project.scene_id for project in projects}))
        return {scene.id: scene for scene in scenes}

    def _checker(self, scenes: Mapping[str, Any]) -> Callable[[Sequence[Project]], dict[str, list[str]]]:
        def check(project: Project) -> list[str]:
            if (scene := scenes.get(project.scene_id)) is None:
                return [f"The scene of the project {project.name} does not exist."]
            return project_problems(scene, project, self._types)

        return lambda projects: {project.id: check(project) for project in projects}


def _outdated(sources: Mapping[str, Sources], checked: Checked) -> list[str]:
    return [key for key, source in sources.items() if key not in checked or checked[key][0] != source]


def _merged(sources: Mapping[str, Sources], checked: Checked, fresh: Mapping[str, list[str]]) -> Checked:
    """Return what is known now; a document that was deleted while it was to be read has no problems."""
    known = {key: problems for key, (_, problems) in checked.items()} | {
        key: [] for key in sources if key not in checked
    }
    known.update(fresh)
    return {key: (source, known[key]) for key, source in sources.items()}
