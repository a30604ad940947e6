"""Differences between the open document and its saved version."""

from typing import Any

from arcor2_server.documents.changes import OF_SCENE, Change, Kind
from arcor2_server.documents.document import Document

_Values = dict[tuple[Kind, str], Any]


class Unsaved:
    """The items that differ from the saved version, with their saved values (None: not saved)."""

    def __init__(self) -> None:
        self._of_scene: _Values = {}
        self._of_project: _Values = {}

    @classmethod
    def between(cls, saved: Document, present: Document) -> "Unsaved":
        """Compare two documents."""
        found = cls()
        for item in saved.items():
            now = present.find(item.kind, item.id)
            if now is None or now.value != item.value:
                found._of(item.kind)[item.kind, item.id] = item.value
        for item in present.items():
            if saved.find(item.kind, item.id) is None:
                found._of(item.kind)[item.kind, item.id] = None
        return found

    def copy(self) -> "Unsaved":
        """Return a copy that notes changes of its own."""
        copied = Unsaved()
        copied._of_scene, copied._of_project = dict(self._of_scene), dict(self._of_project)
        return copied

    def _of(self, kind: Kind) -> _Values:
        return self._of_scene if kind in OF_SCENE else self._of_project

    @property
    def scene(self) -> bool:
        """Whether the scene differs."""
        return bool(self._of_scene)

    @property
    def project(self) -> bool:
        """Whether the project differs."""
        return bool(self._of_project)

    def note(self, change: Change) -> None:
        """Record an applied change."""
        values, key = self._of(change.kind), (change.kind, change.id)
        if key not in values:
            values[key] = change.before
        if values[key] == change.after:
            del values[key]

    def begin_saving(self, *, scene: bool) -> _Values:
        """Use the present state, which is being saved, for comparison from now on. Return the earlier differences."""
        if scene:
            before, self._of_scene = self._of_scene, {}
        else:
            before, self._of_project = self._of_project, {}
        return before

    def saving_failed(self, before: _Values, document: Document) -> None:
        """Compare with the earlier saved version again; `before` was returned by `begin_saving`."""
        for (kind, key), saved in before.items():
            values, now = self._of(kind), document.find(kind, key)
            values[kind, key] = saved
            if saved == (None if now is None else now.value):
                del values[kind, key]
