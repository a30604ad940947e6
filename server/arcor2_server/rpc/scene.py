"""Requests that open, save, close, rename, copy and delete scenes (protocol, 7.2)."""

from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.data.base import new_id
from arcor2_hw.data.events import ChangeType, MainScreen, OpenSceneData, SceneStateData, ShowMainScreenData
from arcor2_hw.data.rpc import (
    CloseSceneArgs,
    CopySceneArgs,
    IdArgs,
    NewSceneArgs,
    RenameArgs,
    UpdateSceneDescriptionArgs,
)
from arcor2_hw.data.scene import BareScene, Scene
from arcor2_server.collaboration.locks import SCENE
from arcor2_server.documents.changes import Kind
from arcor2_server.documents.dependents import after_saving, forget_unused_types, uses_object
from arcor2_server.errors import RequestRefused
from arcor2_server.rpc.editing import commit, opening_allowed, require_held, require_name_free, unlock
from arcor2_server.rpc.object_types import notice_new_types
from arcor2_server.rpc.registry import Context, rpc

_BARE = BareScene.__struct_fields__


def bare(scene: BareScene) -> BareScene:
    """Give a scene without its objects."""
    return BareScene(**{name: getattr(scene, name) for name in _BARE})


def _tell_opened(context: Context, scene: Scene) -> None:
    context.emit("OpenScene", OpenSceneData(scene))
    context.emit("SceneState", SceneStateData(context.services.cell.state))


@rpc("NewScene")
async def new_scene(context: Context, args: NewSceneArgs) -> None:
    """Open a new scene, which exists in memory alone until it is saved."""
    session = context.services.session
    async with opening_allowed(context):
        session.require_nothing_open()
        await require_name_free(context, args.name, "scene")
        if context.dry_run:
            return
        await notice_new_types(context)
        await session.show(Scene(name=args.name, description=args.description, id=new_id("scn")))
        _tell_opened(context, session.require_scene())


@rpc("OpenScene")
async def open_scene(context: Context, args: IdArgs) -> None:
    """Open a saved scene."""
    session = context.services.session
    async with opening_allowed(context):
        session.require_nothing_open()
        scene = await context.services.storage.scene(args.id)
        await notice_new_types(context)
        if problems := session.scene_problems(scene):
            raise RequestRefused(f"{scene.name} cannot be opened. {' '.join(problems)}")
        await session.show(scene)
        _tell_opened(context, session.require_scene())


@rpc("CloseScene")
async def close_scene(context: Context, args: CloseSceneArgs) -> None:
    """Close the scene."""
    services, user = context.services, context.user
    async with services.locks.auto(user, SCENE):
        services.session.require_scene_alone()
        scene = services.session.require_scene()
        if services.session.scene_changed and not args.force:
            raise RequestRefused(f"{scene.name} has changes that are not saved: save it, or close it by force.")
        services.cell.require_offline()
        if services.locks.locked_roots(besides=(SCENE,)):
            raise RequestRefused("Something in the scene is locked: all locks have to be given back first.")
        if context.dry_run:
            return
        await services.session.discard()
    context.emit("SceneClosed")
    context.emit("ShowMainScreen", ShowMainScreenData(MainScreen.SCENES_LIST, scene.id))


@rpc("SaveScene")
async def save_scene(context: Context, args: None) -> None:  # noqa: ARG001
    """Save the open scene."""
    services = context.services
    async with services.locks.exclusive():
        services.session.require_scene_alone()
        if context.dry_run:
            return
        await save_open_scene(context)


async def save_open_scene(context: Context) -> None:
    """Save the open scene, with all that follows for its projects and for object types made for it."""
    services = context.services
    removed_types = await after_saving(services, services.session.save)
    context.emit("SceneSaved")
    if removed_types:
        context.emit("ChangedObjectTypes", removed_types, ChangeType.REMOVE)


@rpc("RenameScene")
async def rename_scene(context: Context, args: RenameArgs) -> None:
    """Give a scene another name."""
    await require_name_free(context, args.new_name, "scene")
    require_held(context, args.id)
    await _update_base(context, args.id, name=args.new_name)
    if not context.dry_run:
        unlock(context, args.id)


@rpc("UpdateSceneDescription")
async def update_scene_description(context: Context, args: UpdateSceneDescriptionArgs) -> None:
    """Give a scene another description."""
    async with context.services.locks.auto(context.user, args.scene_id):
        await _update_base(context, args.scene_id, description=args.new_description)


async def _update_base(context: Context, scene_id: str, **fields: str) -> None:
    session = context.services.session
    if (item := session.document.find(Kind.SCENE, scene_id)) is not None:
        change = session.document.update(Kind.SCENE, scene_id, replace(item.value, **fields))
        if await commit(context, [change]):
            context.emit_first("SceneChanged", session.bare_scene(), ChangeType.UPDATE_BASE)
        return
    scene = await context.services.storage.scene(scene_id)
    if not context.dry_run:
        saved = await context.services.storage.put_scene(replace(scene, **fields))
        context.emit_first("SceneChanged", bare(saved), ChangeType.UPDATE_BASE)


@rpc("CopyScene")
async def copy_scene(context: Context, args: CopySceneArgs) -> None:
    """Copy a saved scene. The objects keep their ids; existing clients expect to be told by update_base."""
    storage = context.services.storage
    async with context.services.locks.auto(context.user, args.source_id):
        await require_name_free(context, args.target_name, "copy of the scene")
        source = await storage.scene(args.source_id)
        copied = replace(source, id=new_id("scn"), name=args.target_name, created=UNSET, modified=UNSET)
        if not context.dry_run:
            context.emit_first("SceneChanged", bare(await storage.put_scene(copied)), ChangeType.UPDATE_BASE)


@rpc("DeleteScene")
async def delete_scene(context: Context, args: IdArgs) -> None:
    """Delete a saved scene, with the object types that were made for it alone."""
    services = context.services
    services.session.require_nothing_open()
    async with services.locks.auto(context.user, args.id):
        scene = await services.storage.scene(args.id)
        if projects := await services.storage.projects_with_scene(args.id):
            raise RequestRefused(f"{scene.name} is used by {len(projects)} projects: delete them first.", projects)
        if context.dry_run:
            return
        await services.storage.delete_scene(args.id)
        context.emit("SceneChanged", bare(scene), ChangeType.REMOVE)
        if removed := await forget_unused_types(services, {obj.type for obj in scene.objects}):
            context.emit("ChangedObjectTypes", removed, ChangeType.REMOVE)


@rpc("SceneObjectUsage")
async def scene_object_usage(context: Context, args: IdArgs) -> set[str]:
    """Give the projects that use an object of the open scene: as parent of a point, or in an action."""
    services = context.services
    services.session.require_scene_open()
    async with services.locks.read(context.user, args.id):
        return await uses_object(services, args.id)


@rpc("ProjectsWithScene")
async def projects_with_scene(context: Context, args: IdArgs) -> set[str]:
    """Give the saved projects of a scene."""
    async with context.services.locks.read(context.user, args.id):
        return set(await context.services.storage.projects_with_scene(args.id))
