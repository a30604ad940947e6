"""What all requests that edit the open document share."""

from collections.abc import AsyncIterator, Iterable, Sequence
from contextlib import asynccontextmanager
from typing import Any

from arcor2_hw.data.base import Unset
from arcor2_hw.data.events import ChangeType, LockData
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.scene import SceneObject
from arcor2_server.documents.changes import Change, Kind
from arcor2_server.errors import RequestRefused
from arcor2_server.rpc.registry import Context


async def commit(context: Context, changes: Sequence[Change]) -> bool:
    """Make changes, unless this is a dry run; tells whether they were made."""
    if context.dry_run:
        return False
    await context.services.session.commit(context.client.user or "", changes, context.request)
    return True


async def hide_secrets(
    context: Context,
    obj: SceneObject,
    given: Iterable[Parameter],
    before: Iterable[Parameter] = (),
    *,
    of_project: bool = False,
) -> list[Parameter]:
    """Store the secrets among the settings of an object; returns the settings with references. See SettingSecrets.hide.

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
    secrets = context.services.secrets
    below = obj.parameters if of_project else ()
    hidden = secrets.hide(obj.type, given, before, name=obj.name, below=below, check=not of_project)
    await secrets.store.flush()
    return hidden


def unlock(context: Context, *ids: str) -> None:
    """Free the caller's locks among `ids` and tell everybody."""
    if freed := context.services.locks.release_announced(context.user, ids):
        context.emit("ObjectsUnlocked", LockData(freed, context.user))


def drop_locks(context: Context, *ids: str) -> None:
    """Forget the locks of what was removed; what else was locked with it is told to be free."""
    for owner, freed in context.services.locks.drop(ids).items():
        context.emit("ObjectsUnlocked", LockData(freed, owner))


def require_held(context: Context, item: str, *, tree: bool = False) -> None:
    """RequestRefused unless the caller is logged in and holds the write lock."""
    context.services.locks.require_held(context.user, item, tree=tree)


@asynccontextmanager
async def opening_allowed(context: Context) -> AsyncIterator[None]:
    """Keep everybody else out while something is opened; refused while a program runs."""
    async with context.services.locks.exclusive():
        require_no_program(context)
        yield


def require_no_program(context: Context) -> None:
    """RequestRefused while a package runs."""
    if context.services.execution.busy:
        raise RequestRefused("A program is running: stop it first.")


async def require_name_free(context: Context, name: str, what: str) -> None:
    """RequestRefused unless the name is given and no scene or project has it, saved or open."""
    if not name:
        raise RequestRefused(f"The {what} needs a name.")
    session = context.services.session
    opened = [item.value.name for kind in (Kind.SCENE, Kind.PROJECT) for item in session.document.of_kind(kind)]
    if name in opened or await context.services.storage.name_taken(name):
        raise RequestRefused(f"There is a scene or project called {name} already: choose another name.")


def require_free(context: Context, kind: Kind, name: str, what: str, parent: str = "") -> None:
    """RequestRefused when something of that kind (within its action point) has the name."""
    if context.services.session.document.named(kind, name, parent) is not None:
        raise RequestRefused(f"There is {what} called {name} already: choose another name.")


def optional(value: str | Unset) -> str | None:
    """Give an optional identifier as the cell takes it."""
    return None if isinstance(value, Unset) else value


async def eef_pose(context: Context, robot_id: str, end_effector: str, arm_id: str | Unset) -> Pose:
    """Give the pose of an end effector in the world, as the robot has it now."""
    pose: Pose = await context.services.cell.end_effector_pose(robot_id, end_effector, optional(arm_id))
    return pose


def tell(
    context: Context, changes: Sequence[Change], event: str, change: ChangeType, parent: str | None = None
) -> None:
    """Send one event for each change: with the item as it is now, or as it was last."""
    for made in changes:
        data: Any = made.before if made.after is None else made.after
        context.emit(event, data, change, parent)
