"""Breakpoints that users share: on action points and actions of a project, kept beside it."""

import asyncio
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Final

from arcor2_hw.data.base import UNSET
from arcor2_hw.data.editor import ProjectBreakpoints
from arcor2_server.documents.changes import Change, Kind
from arcor2_server.errors import RequestRefused
from arcor2_server.events import make_event
from arcor2_server.storage.shared_data import SharedData

if TYPE_CHECKING:
    from arcor2_server.services import Services

MOST: Final = 1000
"""Breakpoints of one project."""
IN_MEMORY: Final = 64
_KINDS: Final = frozenset({Kind.POINT, Kind.ACTION})


class SharedBreakpoints:
    """By project: what was set, of which that counts which the project has."""

    def __init__(self, services: "Services", data: SharedData) -> None:
        self._services = services
        self._data = data
        self._set: dict[str, tuple[set[str], str]] = {}
        self._last: tuple[str, set[str]] = ("", set())
        self._turn = asyncio.Lock()
        self.on_change: list[Callable[[str, set[str]], None]] = []
        """Called with a project, and the breakpoints that it has now."""

    async def get(self, project_id: str) -> ProjectBreakpoints:
        """Give the breakpoints of a project, open or saved; NotFound, StorageError."""
        async with self._turn:
            return self._told(project_id, await self._known(project_id), await self._items(project_id))

    async def ids(self, project_id: str) -> set[str]:
        """Give what was set on a project, whether that is there or not; StorageError."""
        async with self._turn:
            return set((await self._known(project_id))[0])

    async def change(self, project_id: str, add: set[str], remove: set[str], user: str) -> ProjectBreakpoints:
        """Set and take away breakpoints, and tell it; NotFound, RequestRefused, StorageError."""
        async with self._turn:
            before, _ = known = await self._known(project_id)
            items = await self._items(project_id)
            if unknown := add - items:
                names = ", ".join(sorted(unknown)[:5])
                raise RequestRefused(f"The project has no action point or action {names}.")
            # Those that are not there wait for an undo, but not beyond what is kept.
            after = (before | add) - remove
            if len(after & items) > MOST:
                raise RequestRefused(f"A project has at most {MOST} breakpoints.")
            if len(after) > MOST:
                after &= items
            if after == before:
                return self._told(project_id, known, items)
            await self._data.put_breakpoints(project_id, after, user)
            self._set[project_id] = (after, user)
            told = self._told(project_id, (after, user), items)
        self._tell(told)
        return told

    def changed(self, changes: Sequence[Change]) -> None:
        """Tell of breakpoints that came or went with what they are on."""
        project = self._services.session.document.of_kind(Kind.PROJECT)
        if not project or (known := self._set.get(project[0].id)) is None:
            return
        ids = {c.id for c in changes if c.kind in _KINDS and (c.before is None or c.after is None)}
        if ids & known[0]:
            told = self._told(project[0].id, known, self._of_open())
            if self._last != (told.project_id, told.ids):
                self._tell(told)

    async def forget(self, project_id: str) -> None:
        """Drop those of a project that is gone: what is on disk goes with its views."""
        self._set.pop(project_id, None)

    # -------------------------------------------------------------------------------- inside
    async def _known(self, project_id: str) -> tuple[set[str], str]:
        if (known := self._set.get(project_id)) is None:
            if len(self._set) >= IN_MEMORY:
                open_one = {item.id for item in self._services.session.document.of_kind(Kind.PROJECT)}
                self._set = {key: value for key, value in self._set.items() if key in open_one}
            known = self._set[project_id] = await self._data.breakpoints(project_id)
        return known

    async def _items(self, project_id: str) -> set[str]:
        """Give the ids on which a project may have breakpoints; NotFound."""
        if any(item.id == project_id for item in self._services.session.document.of_kind(Kind.PROJECT)):
            return self._of_open()
        points = (await self._services.storage.project(project_id)).action_points
        return {point.id for point in points} | {action.id for point in points for action in point.actions}

    def _of_open(self) -> set[str]:
        document = self._services.session.document
        return {item.id for kind in _KINDS for item in document.of_kind(kind)}

    @staticmethod
    def _told(project_id: str, known: tuple[set[str], str], items: set[str]) -> ProjectBreakpoints:
        return ProjectBreakpoints(project_id, known[0] & items, known[1] or UNSET)

    def _tell(self, told: ProjectBreakpoints) -> None:
        self._last = (told.project_id, told.ids)
        self._services.hub.broadcast(make_event("BreakpointsChanged", told))
        for tell in self.on_change:
            tell(told.project_id, told.ids)
