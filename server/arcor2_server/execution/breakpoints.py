"""Breakpoints that users share, on action points and actions of a project."""

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

MOST: Final = 1000
"""Breakpoints of one project."""
IN_MEMORY: Final = 64
_KINDS: Final = frozenset({Kind.POINT, Kind.ACTION})


class SharedBreakpoints:
    """The breakpoints of each project. Only breakpoints on existing items are active."""

    def __init__(self, hub: EventHub, storage: Storage, session: Session, data: SharedData) -> None:
        self._hub = hub
        self._storage = storage
        self._session = session
        self._data = data
        self._set: dict[str, tuple[set[str], str]] = {}
        self._last: tuple[str, set[str]] = ("", set())
        self._turn = asyncio.Lock()
        self.on_change: list[Callable[[str, set[str]], None]] = []
        """Called with a project, and the breakpoints that it has now."""

    async def get(self, project_id: str) -> ProjectBreakpoints:
        """Return the breakpoints of a project, open or saved. Raise NotFound or StorageError if that is impossible."""
        async with self._turn:
            return self._data_of(project_id, await self._known(project_id), await self._items(project_id))

    async def ids(self, project_id: str) -> set[str]:
        """Return what was set on a project, whether that is there or not. Raise StorageError if that is impossible."""
        async with self._turn:
            return set((await self._known(project_id))[0])

    async def change(self, project_id: str, add: set[str], remove: set[str], user: str) -> ProjectBreakpoints:
        """Set and remove breakpoints, and publish them.

        Raise NotFound, RequestRefused or StorageError if that is impossible.
        """
        async with self._turn:
            before, _ = known = await self._known(project_id)
            items = await self._items(project_id)
            if unknown := add - items:
                names = ", ".join(sorted(unknown)[:5])
                raise RequestRefused("The project has no action point or action {names}.", names=names)
            # Those that are not there wait for an undo, but not beyond what is kept.
            after = (before | add) - remove
            if len(after & items) > MOST:
                raise RequestRefused("A project has at most {most} breakpoints.", most=MOST)
            if len(after) > MOST:
                after &= items
            if after == before:
                return self._data_of(project_id, known, items)
            await self._data.put_breakpoints(project_id, after, user)
            self._set[project_id] = (after, user)
            data = self._data_of(project_id, (after, user), items)
        self._publish(data)
        return data

    def changed(self, changes: Sequence[Change]) -> None:
        """Publish breakpoints whose items were added or removed."""
        project = self._session.document.of_kind(Kind.PROJECT)
        if not project or (known := self._set.get(project[0].id)) is None:
            return
        ids = {c.id for c in changes if c.kind in _KINDS and (c.before is None or c.after is None)}
        if ids & known[0]:
            data = self._data_of(project[0].id, known, self._of_open())
            if self._last != (data.project_id, data.ids):
                self._publish(data)

    async def forget(self, project_id: str) -> None:
        """Forget the breakpoints of a deleted project. Those on disk are deleted with its views."""
        self._set.pop(project_id, None)

    # -------------------------------------------------------------------------------- inside
    async def _known(self, project_id: str) -> tuple[set[str], str]:
        if (known := self._set.get(project_id)) is None:
            if len(self._set) >= IN_MEMORY:
                open_one = {item.id for item in self._session.document.of_kind(Kind.PROJECT)}
                self._set = {key: value for key, value in self._set.items() if key in open_one}
            known = self._set[project_id] = await self._data.breakpoints(project_id)
        return known

    async def _items(self, project_id: str) -> set[str]:
        """Return the ids on which a project may have breakpoints. Raise NotFound if there is none."""
        if any(item.id == project_id for item in self._session.document.of_kind(Kind.PROJECT)):
            return self._of_open()
        points = (await self._storage.project(project_id)).action_points
        return {point.id for point in points} | {action.id for point in points for action in point.actions}

    def _of_open(self) -> set[str]:
        document = self._session.document
        return {item.id for kind in _KINDS for item in document.of_kind(kind)}

    @staticmethod
    def _data_of(project_id: str, known: tuple[set[str], str], items: set[str]) -> ProjectBreakpoints:
        return ProjectBreakpoints(project_id, known[0] & items, known[1] or UNSET)

    def _publish(self, data: ProjectBreakpoints) -> None:
        self._last = (data.project_id, data.ids)
        self._hub.broadcast(make_event("BreakpointsChanged", data))
        for notify in self.on_change:
            notify(data.project_id, data.ids)
