"""Operations shared by the requests that edit the open document: commit, locks, free names, secrets."""

from collections.abc import AsyncIterator, Iterable, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass

from arcor2_hw.data.events import ChangeType, LockData
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.scene import SceneObject
from arcor2_server.collaboration.locks import Locks
from arcor2_server.documents import Session
from arcor2_server.documents.changes import Change, Kind
from arcor2_server.errors import RequestRefused
from arcor2_server.execution.service import Execution
from arcor2_server.rpc.change_events import EVENTS, emit_functions
from arcor2_server.rpc.registry import Context
from arcor2_server.storage import Storage
from arcor2_server.storage.setting_secrets import SettingSecrets


@dataclass(frozen=True, slots=True)
class Editing:
    """Operations shared by the requests that edit the open document."""

    _locks: Locks
    _storage: Storage
    _session: Session
    _execution: Execution
    _secrets: SettingSecrets

    async def commit(self, context: Context, changes: Sequence[Change]) -> bool:
        """Commit changes as one edit, except in a dry run; return whether they were made."""
        if context.dry_run:
            return False
        await self._session.commit(context.client.user or "", changes, context.request, step=context.step)
        return True

    async def commit_one(self, context: Context, change: Change, update: ChangeType = ChangeType.UPDATE) -> bool:
        """Commit one change and send its event, except in a dry run; return whether it was made.

        Args:
            context: the request.
            change: the change.
            update: change type of the event if the change replaces an item.
        """
        if not await self.commit(context, [change]):
            return False
        if not emit_functions(context, self._session, [change]):
            return True
        if change.after is None:
            context.emit(EVENTS[change.kind], change.before, ChangeType.REMOVE)
        elif change.before is None:
            context.emit(EVENTS[change.kind], change.after, ChangeType.ADD, change.parent or None)
        else:
            context.emit(EVENTS[change.kind], change.after, update)
        return True

    async def hide_secrets(
        self,
        context: Context,
        obj: SceneObject,
        given: Iterable[Parameter],
        before: Iterable[Parameter] = (),
        *,
        of_project: bool = False,
    ) -> list[Parameter]:
        """Store the secret settings of an object; return the settings with references instead (SettingSecrets.hide).

        This waits for the disk, so other requests may change the document meanwhile.

        Args:
            context: the request.
            obj: the object as it is in the scene.
            given: its new settings, or with `of_project` its new overrides.
            before: its present settings or overrides.
            of_project: whether the settings are overrides. They are changed one by one, so their addresses are
                checked when the scene or the package is started.
        """
        if context.dry_run:
            return list(given)
        secrets = self._secrets
        below = obj.parameters if of_project else ()
        hidden = secrets.hide(obj.type, given, before, name=obj.name, below=below, check=not of_project)
        await secrets.store.flush()
        return hidden

    def unlock(self, context: Context, *ids: str) -> None:
        """Release the locks of the caller on these items, and publish the released ones."""
        if freed := self._locks.release_announced(context.user, ids):
            context.emit("ObjectsUnlocked", LockData(freed, context.user))

    def drop_locks(self, context: Context, *ids: str) -> None:
        """Drop the locks of removed items, and publish the other items that this unlocks."""
        for owner, freed in self._locks.drop(ids).items():
            context.emit("ObjectsUnlocked", LockData(freed, owner))

    def require_locked(self, context: Context, item: str, *, tree: bool = False) -> None:
        """Raise RequestRefused unless the caller is registered and holds the write lock of an item."""
        self._locks.require_held(context.user, item, tree=tree)

    @asynccontextmanager
    async def opening_allowed(self) -> AsyncIterator[None]:
        """Exclude all other requests while a document is opened. Raise RequestRefused while a program runs."""
        async with self._locks.exclusive():
            self.require_no_program()
            yield

    def require_no_program(self) -> None:
        """Raise RequestRefused while a package runs."""
        if self._execution.busy:
            raise RequestRefused("A program is running. Stop it first.")

    async def require_document_name_free(self, name: str, what: str) -> None:
        """Raise RequestRefused if the name is empty, or a saved or open scene or project has it."""
        if not name:
            raise RequestRefused("The {what} needs a name.", what=what)
        session = self._session
        opened = [item.value.name for kind in (Kind.SCENE, Kind.PROJECT) for item in session.document.of_kind(kind)]
        if name in opened or await self._storage.name_taken(name):
            raise RequestRefused("A scene or project called {name} already exists. Choose another name.", name=name)

    def require_name_free(self, kind: Kind, name: str, description: str, parent: str = "") -> None:
        """Raise RequestRefused if an item of this kind, of the action point `parent` if given, has the name."""
        if self._session.document.named(kind, name, parent) is not None:
            raise RequestRefused(
                "There is already {what} called {name}. Choose another name.", what=description, name=name
            )
