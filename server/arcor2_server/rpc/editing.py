"""Shared by all requests that edit the open document."""

from collections.abc import AsyncIterator, Iterable, Sequence
from contextlib import asynccontextmanager
from typing import Any

from arcor2_hw.data.base import Unset
from arcor2_hw.data.events import ChangeType, LockData
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.scene import SceneObject
from arcor2_server.collaboration.locks import Locks
from arcor2_server.documents import Session
from arcor2_server.documents.changes import Change, Kind
from arcor2_server.errors import RequestRefused
from arcor2_server.execution.service import Execution
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.rpc.registry import Context
from arcor2_server.storage import Storage
from arcor2_server.storage.setting_secrets import SettingSecrets
from arcor2_server.workspace.robots import optional


def emit_changes(
    context: Context, changes: Sequence[Change], event: str, change: ChangeType, parent: str | None = None
) -> None:
    """Send one event for each change: with the item as it is now, or as it was last."""
    for made in changes:
        data: Any = made.before if made.after is None else made.after
        context.emit(event, data, change, parent)


class Editing:
    """What requests that edit the open document have in common."""

    def __init__(
        self,
        locks: Locks,
        storage: Storage,
        session: Session,
        online: OnlineScene,
        execution: Execution,
        secrets: SettingSecrets,
    ) -> None:
        self._locks = locks
        self._storage = storage
        self._session = session
        self._online = online
        self._execution = execution
        self._secrets = secrets

    async def commit(self, context: Context, changes: Sequence[Change]) -> bool:
        """Make changes, unless this is a dry run; return whether they were made."""
        if context.dry_run:
            return False
        await self._session.commit(context.client.user or "", changes, context.request)
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
        """Store the secrets among the settings of an object; return the settings with references (SettingSecrets.hide).

        Others may edit while this waits for the disk.

        Args:
            context: the request.
            obj: the object as it is in the scene.
            given: its settings, or with `of_project` its overrides.
            before: the same as they are.
            of_project: the settings are overrides. They are changed one by one, so their addresses are checked when the
                scene or the package is started.
        """
        if context.dry_run:
            return list(given)
        secrets = self._secrets
        below = obj.parameters if of_project else ()
        hidden = secrets.hide(obj.type, given, before, name=obj.name, below=below, check=not of_project)
        await secrets.store.flush()
        return hidden

    def unlock(self, context: Context, *ids: str) -> None:
        """Release the caller's locks among `ids` and publish it."""
        if freed := self._locks.release_announced(context.user, ids):
            context.emit("ObjectsUnlocked", LockData(freed, context.user))

    def drop_locks(self, context: Context, *ids: str) -> None:
        """Drop the locks of removed items and publish the other items that became free."""
        for owner, freed in self._locks.drop(ids).items():
            context.emit("ObjectsUnlocked", LockData(freed, owner))

    def require_held(self, context: Context, item: str, *, tree: bool = False) -> None:
        """Raise RequestRefused unless the caller is logged in and holds the write lock."""
        self._locks.require_held(context.user, item, tree=tree)

    @asynccontextmanager
    async def opening_allowed(self, context: Context) -> AsyncIterator[None]:
        """Exclude all other requests while a document is opened; refuse while a program runs."""
        async with self._locks.exclusive():
            self.require_no_program(context)
            yield

    def require_no_program(self, context: Context) -> None:
        """Raise RequestRefused while a package runs."""
        if self._execution.busy:
            raise RequestRefused("A program is running: stop it first.")

    async def require_name_free(self, context: Context, name: str, what: str) -> None:
        """Raise RequestRefused unless the name is given and no scene or project has it, saved or open."""
        if not name:
            raise RequestRefused("The {what} needs a name.", what=what)
        session = self._session
        opened = [item.value.name for kind in (Kind.SCENE, Kind.PROJECT) for item in session.document.of_kind(kind)]
        if name in opened or await self._storage.name_taken(name):
            raise RequestRefused("There is a scene or project called {name} already: choose another name.", name=name)

    def require_free(self, context: Context, kind: Kind, name: str, what: str, parent: str = "") -> None:
        """Raise RequestRefused when something of that kind (within its action point) has the name."""
        if self._session.document.named(kind, name, parent) is not None:
            raise RequestRefused("There is {what} called {name} already: choose another name.", what=what, name=name)

    async def eef_pose(self, context: Context, robot_id: str, end_effector: str, arm_id: str | Unset) -> Pose:
        """Return the pose of an end effector in the world, as the robot has it now."""
        pose: Pose = await self._online.end_effector_pose(robot_id, end_effector, optional(arm_id))
        return pose
