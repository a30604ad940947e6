"""The script of the open project, and the changes of the project that an edited script makes."""

import asyncio
import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import NotFound
from arcor2_server.build import script
from arcor2_server.build.frame import TypeFacts
from arcor2_server.build.service import package_code, type_facts
from arcor2_server.documents import Session
from arcor2_server.documents.changes import Change, Item
from arcor2_server.documents.closed_history import differences
from arcor2_server.documents.document import Document
from arcor2_server.documents.undo import inverse_changes
from arcor2_server.errors import RequestRefused
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.storage import Storage


class ProjectScript(NamedTuple):
    """The script of a project.

    Args:
        revision: the revision of the project from which it was generated.
        source: source code.
        generated: whether it was generated from logic, so that an edited script can be converted to logic.
    """

    revision: int
    source: str
    generated: bool


@dataclass(frozen=True, slots=True)
class ScriptEditing:
    """Generates and reads the script of the open project, with its unsaved changes."""

    _storage: Storage
    _types: ObjectTypes
    _session: Session

    def _facts(self, scene: Scene, *, all_actions: bool) -> dict[str, TypeFacts]:
        code = package_code(self._types, dict.fromkeys(obj.type for obj in scene.objects))
        return type_facts(self._types, scene, self._session.require_project(), code, all_actions=all_actions)

    async def script(self) -> ProjectScript:
        """Return the script of the open project.

        Raises:
            RequestRefused: no project is open.
            InvalidProject: the script cannot be generated.
            NotFound: an object type is unknown.
        """
        session = self._session
        project, scene, revision = session.require_project(), session.require_scene(), session.revision
        facts = self._facts(scene, all_actions=False)
        if project.has_logic:
            source = await asyncio.to_thread(script.from_logic, scene, project, facts)
            return ProjectScript(revision, source, True)
        with contextlib.suppress(NotFound):
            return ProjectScript(revision, await self._storage.project_source(project.id), False)
        return ProjectScript(revision, script.without_logic(scene, project, facts), False)

    async def changes(self, source: str, revision: int) -> list[Change]:
        """Return the changes of the open project that an edited script makes.

        The script is compared with the project of the revision from which it was generated, so edits of others since
        then are not reverted.

        Args:
            source: source code of the edited script.
            revision: the revision of the project from which the script was generated.

        Raises:
            RequestRefused: no project with logic is open, or the revision is not stored any more.
            NotUnderstood: a line cannot be converted.
            InvalidProject: the script or the project is invalid.
            NotFound: an object type is unknown.
        """
        session = self._session
        document = session.require_project_open()
        if not session.bare_project().has_logic:
            raise RequestRefused("The project {name} has a script instead of logic.", name=session.bare_project().name)
        if not session.oldest_revision <= revision <= session.revision:
            raise RequestRefused("The project has changed too much since this script was loaded. Load it again.")
        facts = self._facts(session.require_scene(), all_actions=True)
        later = inverse_changes(session.history.since(revision))
        found = await asyncio.to_thread(_changes, source, document.items(), later, facts)
        # Added items come after those that other users have added in the meantime.
        return [
            document.add(each.kind, each.id, each.after, each.parent) if each.before is None else each for each in found
        ]


def _changes(
    source: str, items: Sequence[Item], later: Sequence[Change], facts: Mapping[str, TypeFacts]
) -> list[Change]:
    """Return the changes that a script makes to these items, ignoring later changes."""
    base = Document(items)
    base.apply(later)
    scene, project = base.scene, base.project
    assert scene is not None
    assert project is not None
    wanted = Document().changes_to_fill(scene, script.read_with_text(source, scene, project, facts))
    return differences(base, [Item(each.kind, each.id, each.parent, each.rank, each.after) for each in wanted])
