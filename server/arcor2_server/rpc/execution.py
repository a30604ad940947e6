"""Requests that bring the scene online, execute single actions, and run packages (protocol, 7.2, 7.4, 7.6)."""

from arcor2_hw.data.base import Unset
from arcor2_hw.data.editor import TaskKind
from arcor2_hw.data.events import ActionExecutionData, ChangeType
from arcor2_hw.data.package import PackageSummary
from arcor2_hw.data.rpc import (
    ExecuteActionArgs,
    IdArgs,
    RenamePackageArgs,
    RunPackageArgs,
    TemporaryPackageArgs,
    UploadPackageArgs,
)
from arcor2_server.collaboration.locks import ACTION
from arcor2_server.errors import RequestRefused
from arcor2_server.execution.runs import How
from arcor2_server.online.actions import RunningAction, execute, prepare
from arcor2_server.rpc import left_open
from arcor2_server.rpc.registry import Context, rpc


# ------------------------------------------------------------------------------------------------ scene
@rpc("StartScene")
async def start_scene(context: Context, args: None) -> None:  # noqa: ARG001
    """Bring the scene online; SceneState tells how it goes."""
    context.services.cell.task.asked_by = context.client.name
    await context.services.cell.begin_start(dry_run=context.dry_run)


@rpc("StartSceneKeepGoing")
async def start_scene_keep_going(context: Context, args: None) -> None:  # noqa: ARG001
    """Bring the scene online without what cannot be connected; SceneState and ObjectState tell how it goes."""
    context.services.cell.task.asked_by = context.client.name
    await context.services.cell.begin_start(dry_run=context.dry_run, keep_going=True)


@rpc("StopScene")
async def stop_scene(context: Context, args: None) -> None:  # noqa: ARG001
    """Take the scene offline; SceneState tells how it goes."""
    context.services.cell.task.asked_by = context.client.name
    await context.services.cell.begin_stop(dry_run=context.dry_run)


# ------------------------------------------------------------------------------------------------ single actions
@rpc("ExecuteAction")
async def execute_action(context: Context, args: ExecuteActionArgs) -> None:
    """Execute one action of the project; ActionResult tells how it ended."""
    services = context.services
    session, cell = services.session, services.cell
    session.require_project_open()
    async with services.locks.auto(context.user, ACTION):
        action = session.action(args.action_id)[1]
        cell.require_online()
        if cell.running_action is not None:
            name = session.action(cell.running_action.action_id)[1].name
            raise RequestRefused(f"The action {name} is running.")
        object_id, _, method = action.type.partition("/")
        obj = session.scene_object(object_id)
        cell.board.require_not_failed(object_id)
        if object_id in cell.moving:
            raise RequestRefused(f"{obj.name} is moving.")
        prepared = prepare(action, services.types.action(obj.type, method), session, cell.results)
        if context.dry_run:
            return
        running = cell.running_action = RunningAction(action.id, object_id, method, context.received_at)
    context.emit("ActionExecution", ActionExecutionData(action.id))
    cell.spawn(execute(cell, prepared, running), f"action {action.name}")


@rpc("CancelAction")
async def cancel_action(context: Context, args: None) -> None:  # noqa: ARG001
    """Cancel the action that runs."""
    services = context.services
    services.session.require_project_open()
    running = services.cell.running_action
    if running is None:
        raise RequestRefused("No action is running.")
    obj = services.session.scene_object(running.object_id)
    if not services.types.action(obj.type, running.method).meta.cancellable:
        raise RequestRefused(f"{obj.name}.{running.method} cannot be cancelled. StopAll stops its device.")
    running.cancelled = True
    try:
        await services.cell.cancel(running.object_id, running.method)
    except BaseException:
        running.cancelled = False
        raise
    context.emit("ActionCancelled")


# ------------------------------------------------------------------------------------------------ packages
@rpc("ListPackages")
async def list_packages(context: Context, args: None) -> list[PackageSummary]:  # noqa: ARG001
    """Give all packages."""
    return await context.services.execution.list()


@rpc("UploadPackage")
async def upload_package(context: Context, args: UploadPackageArgs) -> None:
    """Take a package as a zip."""
    services = context.services
    with services.tasks.running(TaskKind.UPLOAD, f"Taking in the package {args.id}", context.client.name):
        summary = await services.execution.upload(args.id, args.data)
    context.emit("PackageChanged", summary, ChangeType.ADD)


@rpc("DeletePackage")
async def delete_package(context: Context, args: IdArgs) -> None:
    """Delete a package."""
    summary = await context.services.execution.delete(args.id)
    context.emit("PackageChanged", summary, ChangeType.REMOVE)


@rpc("RenamePackage")
async def rename_package(context: Context, args: RenamePackageArgs) -> None:
    """Give a package another name."""
    summary = await context.services.execution.rename(args.package_id, args.new_name)
    context.emit("PackageChanged", summary, ChangeType.UPDATE)


@rpc("RunPackage")
async def run_package(context: Context, args: RunPackageArgs) -> None:
    """Run a package; a scene or project that nobody uses any more does not prevent it."""
    await left_open.run_package(context.services, args.id, how(context, args))


def how(context: Context, args: RunPackageArgs | TemporaryPackageArgs) -> How:
    """Give how a package is to be run."""
    breakpoints = frozenset[str]() if isinstance(args.breakpoints, Unset) else args.breakpoints
    return How(args.start_paused, breakpoints, args.shared_breakpoints is True, context.client.name)


@rpc("StopPackage")
async def stop_package(context: Context, args: None) -> None:  # noqa: ARG001
    """Stop the program."""
    context.services.execution.stop(context.client.name)


@rpc("PausePackage")
async def pause_package(context: Context, args: None) -> None:  # noqa: ARG001
    """Pause the program before its next action."""
    context.services.execution.pause()


@rpc("ResumePackage")
async def resume_package(context: Context, args: None) -> None:  # noqa: ARG001
    """Let a paused program go on."""
    context.services.execution.resume()


@rpc("StepAction")
async def step_action(context: Context, args: None) -> None:  # noqa: ARG001
    """Let a paused program go on for one action."""
    context.services.execution.step()
