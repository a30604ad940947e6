"""Breakpoints on action points and actions of a project, shared by all users."""

import asyncio
from collections.abc import Callable, Sequence
from typing import Final

from arcor2_hw.data.base import UNSET
from arcor2_hw.data.editor import ProjectBreakpoints
from arcor2_server.documents import Session
from arcor2_server.documents.changes import Change, Kind
from arcor2_server.errors import RequestRefused
from arcor2_server.events import EventHub, make_event
from arcor2_server.storage import Storage
from arcor2_server.storage.shared_data import SharedData

MAX_BREAKPOINTS: Final = 1000
"""Maximum number of breakpoints of a project."""
MAX_CACHED: Final = 64
"""Maximum number of projects whose breakpoints are cached."""
_KINDS: Final = frozenset({Kind.POINT, Kind.ACTION})


class SharedBreakpoints:
    """The breakpoints of each project. Only breakpoints on existing items are active."""

    def __init__(self, hub: EventHub, storage: Storage, session: Session, data: SharedData) -> None:
        self._hub = hub
        self._storage = storage
        self._session = session
        self._data = data
        self._cache: dict[str, tuple[set[str], str]] = {}
        """Breakpoints and the user who last changed them, by project."""
        self._last: tuple[str, set[str]] = ("", set())
        self._lock = asyncio.Lock()
        self.on_change: list[Callable[[str, set[str]], None]] = []
        """Called with the id of a project and its active breakpoints."""

    async def get(self, project_id: str) -> ProjectBreakpoints:
        """Return the active breakpoints of an open or saved project.

        Raises:
            NotFound: the project does not exist.
            StorageError: the breakpoints cannot be read.
        """
        async with self._lock:
            return self._data_of(project_id, await self._stored(project_id), await self._items(project_id))

    async def ids(self, project_id: str) -> set[str]:
        """Return all breakpoints of a project, also on missing items. Raise StorageError if they cannot be read."""
        async with self._lock:
            return set((await self._stored(project_id))[0])

    async def change(self, project_id: str, add: set[str], remove: set[str], user: str) -> ProjectBreakpoints:
        """Set and remove breakpoints, and publish them.

        Raises:
            NotFound: the project does not exist.
            RequestRefused: an item does not exist, or there are too many breakpoints.
            StorageError: the breakpoints cannot be stored.
        """
        async with self._lock:
            before, _ = stored = await self._stored(project_id)
            items = await self._items(project_id)
            if unknown := add - items:
                names = ", ".join(sorted(unknown)[:5])
                raise RequestRefused("The project has no action point or action {names}.", names=names)
            # Breakpoints on removed items are kept for an undo, up to the limit.
            after = (before | add) - remove
            if len(after & items) > MAX_BREAKPOINTS:
                raise RequestRefused("A project has at most {count} breakpoints.", count=MAX_BREAKPOINTS)
            if len(after) > MAX_BREAKPOINTS:
                after &= items
            if after == before:
                return self._data_of(project_id, stored, items)
            await self._data.put_breakpoints(project_id, after, user)
            self._cache[project_id] = (after, user)
            data = self._data_of(project_id, (after, user), items)
        self._publish(data)
        return data

    def changed(self, changes: Sequence[Change]) -> None:
        """Publish breakpoints whose items were added or removed."""
        project = self._session.document.of_kind(Kind.PROJECT)
        if not project or (stored := self._cache.get(project[0].id)) is None:
            return
        ids = {c.id for c in changes if c.kind in _KINDS and (c.before is None or c.after is None)}
        if ids & stored[0]:
            data = self._data_of(project[0].id, stored, self._items_of_open_project())
            if self._last != (data.project_id, data.ids):
                self._publish(data)

    async def forget(self, project_id: str) -> None:
        """Remove the breakpoints of a deleted project from the cache. The stored ones are deleted with its views."""
        self._cache.pop(project_id, None)

    async def _stored(self, project_id: str) -> tuple[set[str], str]:
        if (stored := self._cache.get(project_id)) is None:
            if len(self._cache) >= MAX_CACHED:
                open_ids = {item.id for item in self._session.document.of_kind(Kind.PROJECT)}
                self._cache = {key: value for key, value in self._cache.items() if key in open_ids}
            stored = self._cache[project_id] = await self._data.breakpoints(project_id)
        return stored

    async def _items(self, project_id: str) -> set[str]:
        """Return the ids of the action points and actions of a project. Raise NotFound if there is no such project."""
        if any(item.id == project_id for item in self._session.document.of_kind(Kind.PROJECT)):
            return self._items_of_open_project()
        project = await self._storage.project(project_id)
        return {point.id for point in project.action_points} | {action.id for action in project.all_actions()}

    def _items_of_open_project(self) -> set[str]:
        document = self._session.document
        return {item.id for kind in _KINDS for item in document.of_kind(kind)}

    @staticmethod
    def _data_of(project_id: str, stored: tuple[set[str], str], items: set[str]) -> ProjectBreakpoints:
        return ProjectBreakpoints(project_id, stored[0] & items, stored[1] or UNSET)

    def _publish(self, data: ProjectBreakpoints) -> None:
        self._last = (data.project_id, data.ids)
        self._hub.broadcast(make_event("BreakpointsChanged", data))
        for notify in self.on_change:
            notify(data.project_id, data.ids)
