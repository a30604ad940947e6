"""Problems of saved scenes and projects, for the lists in clients."""

import asyncio
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final

import msgspec
import structlog

from arcor2_hw.analysis.snapshot import code_digest
from arcor2_hw.data.base import Data
from arcor2_hw.data.project import BareProject, Project
from arcor2_hw.data.scene import BareScene, Scene
from arcor2_hw.messages import Message
from arcor2_server.documents.checks.project import project_problems
from arcor2_server.documents.checks.scene import scene_problems
from arcor2_server.files import write_private
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.storage import Storage

log = structlog.get_logger(__name__)

_CHECKS: Final = Path(__file__).parent
"""The directory of the checks. Stored problems are outdated when its code changes."""

Problems = dict[str, list[Message]]
"""Problems by id of the document."""


class Checked(Data, frozen=True, array_like=True):
    """The problems of a document.

    Attributes:
        sources: Modification times of the document and its scene, and the digest of the types.
        problems: Problems in the order of their detection; empty if the document can be opened.
    """

    sources: tuple[str, ...]
    problems: list[Message]


class StoredProblems(Data, frozen=True):
    """The content of the file: all problems by document id, and a digest of the code of the checks."""

    code: str
    scenes: dict[str, Checked]
    projects: dict[str, Checked]


class SavedProblems:
    """Checks saved documents. A result is reused until the document, its scene or an object type changes.

    The results are stored in a file for the next start.
    """

    def __init__(self, storage: Storage, types: ObjectTypes, file: Path) -> None:
        self._storage = storage
        self._types = types
        self._file = file
        self._stored: StoredProblems | None = None
        self._changing = asyncio.Lock()
        self._writing: asyncio.Task[None] | None = None

    async def close(self) -> None:
        """Wait until the last results are stored."""
        if self._writing is not None:
            await self._writing

    async def of_scenes(self, scenes: Sequence[BareScene]) -> Problems:
        """Return the problems of each of these saved scenes by id."""
        async with self._changing:
            known = await self._known()
            sources = {scene.id: (str(scene.modified), self._types.digest) for scene in scenes}
            found = await self._storage.scenes_with_ids(_outdated(sources, known.scenes))
            fresh = await asyncio.to_thread(lambda: {scene.id: scene_problems(scene, self._types) for scene in found})
            checked = _merged(sources, known.scenes, fresh)
            self._store(msgspec.structs.replace(known, scenes=checked))
        return {key: each.problems for key, each in checked.items()}

    async def of_projects(self, projects: Sequence[BareProject], scenes: Sequence[BareScene]) -> Problems:
        """Return the problems of each of these saved projects by id, given all saved scenes."""
        async with self._changing:
            known = await self._known()
            modified = {scene.id: str(scene.modified) for scene in scenes}
            digest = self._types.digest
            sources = {each.id: (str(each.modified), modified.get(each.scene_id, ""), digest) for each in projects}
            found = await self._storage.projects_with_ids(_outdated(sources, known.projects))
            used = await self._storage.scenes_with_ids(sorted({project.scene_id for project in found}))
            fresh = await asyncio.to_thread(self._checker({scene.id: scene for scene in used}), found)
            checked = _merged(sources, known.projects, fresh)
            self._store(msgspec.structs.replace(known, projects=checked))
        return {key: each.problems for key, each in checked.items()}

    def _checker(self, scenes: Mapping[str, Scene]) -> Callable[[Sequence[Project]], Problems]:
        def check(project: Project) -> list[Message]:
            if (scene := scenes.get(project.scene_id)) is None:
                return [Message.of("The scene of the project {name} does not exist.", name=project.name)]
            return project_problems(scene, project, self._types)

        return lambda projects: {project.id: check(project) for project in projects}

    def _read(self) -> StoredProblems:
        """Return the stored problems; none if the file is missing, damaged or written by other code."""
        code = code_digest(_CHECKS)
        try:
            stored = msgspec.msgpack.decode(self._file.read_bytes(), type=StoredProblems)
        except (OSError, msgspec.MsgspecError):
            return StoredProblems(code, {}, {})
        return stored if stored.code == code else StoredProblems(code, {}, {})

    async def _known(self) -> StoredProblems:
        if self._stored is None:
            self._stored = await asyncio.to_thread(self._read)
        return self._stored

    def _store(self, known: StoredProblems) -> None:
        if known != self._stored:
            self._stored = known
            if self._writing is None or self._writing.done():
                self._writing = asyncio.create_task(self._write_newest())

    async def _write_newest(self) -> None:
        """Write the results until the newest ones are in the file, one write at a time."""
        written: StoredProblems | None = None
        while self._stored is not None and self._stored is not written:
            written = self._stored
            await asyncio.to_thread(self._write, written)

    def _write(self, known: StoredProblems) -> None:
        try:
            write_private(self._file, msgspec.msgpack.encode(known))
        except OSError as error:
            log.warning("problems not stored: the next list takes longer", file=str(self._file), reason=error.strerror)


def _outdated(sources: Mapping[str, tuple[str, ...]], checked: Mapping[str, Checked]) -> list[str]:
    return [key for key, source in sources.items() if key not in checked or checked[key].sources != source]


def _merged(
    sources: Mapping[str, tuple[str, ...]], checked: Mapping[str, Checked], fresh: Problems
) -> dict[str, Checked]:
    """Merge stored and new problems; a document that was deleted before it could be read has none."""
    return {
        key: Checked(source, fresh[key] if key in fresh else checked[key].problems if key in checked else [])
        for key, source in sources.items()
    }
