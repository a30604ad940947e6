"""Requests that start the scene, execute single actions, and run packages (protocol, 7.2, 7.4, 7.6)."""

from dataclasses import dataclass

from msgspec.structs import replace

from arcor2_hw.data.base import Unset
from arcor2_hw.data.editor import TaskKind
from arcor2_hw.data.events import ActionExecutionData, ChangeType
from arcor2_hw.data.held import OnError
from arcor2_hw.data.package import PackageSummary
from arcor2_hw.data.parts import PartInventory
from arcor2_hw.data.position import ProgramPosition
from arcor2_hw.data.rpc import (
    ConfirmPartsArgs,
    DecideHeldArgs,
    ExecuteActionArgs,
    GetHeldData,
    IdArgs,
    RenamePackageArgs,
    RunPackageArgs,
    StepActionArgs,
    TemporaryPackageArgs,
    UploadPackageArgs,
)
from arcor2_hw.messages import Message
from arcor2_server.collaboration.locks import ACTION, Locks
from arcor2_server.collaboration.tasks import Tasks
from arcor2_server.documents import Session
from arcor2_server.errors import RequestRefused
from arcor2_server.execution.package_runs import PackageRuns
from arcor2_server.execution.runs import RunStart
from arcor2_server.execution.service import Execution
from arcor2_server.execution.temporary import TemporaryRuns
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.online.actions import RunningAction, execute, prepare
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.rpc.registry import Context, rpc


def _run_options(context: Context, args: RunPackageArgs | TemporaryPackageArgs) -> RunStart:
    breakpoints = frozenset[str]() if isinstance(args.breakpoints, Unset) else args.breakpoints
    on_error = OnError.END if isinstance(args.on_error, Unset) else args.on_error
    shared, checkpoints = args.shared_breakpoints is True, args.checkpoints is not False
    how = RunStart(
        args.start_paused, breakpoints, shared, context.client.name, on_error, checkpoints, role=context.client.role
    )
    if isinstance(args, TemporaryPackageArgs):
        return how
    return replace(
        how,
        continues=args.continues is True,
        continue_at=None if isinstance(args.continue_at, Unset) else args.continue_at,
        recipe_id=args.recipe_id or "",
        recipe_values=args.recipe_values or {},
        order=args.order or "",
    )


@dataclass(frozen=True, slots=True)
class ExecutionRequests:
    """Requests that start the scene, execute single actions, and run packages (protocol, 7.2, 7.4, 7.6)."""

    _locks: Locks
    _types: ObjectTypes
    _session: Session
    _online: OnlineScene
    _execution: Execution
    _tasks: Tasks
    _package_runs: PackageRuns
    _temporary_runs: TemporaryRuns

    # ------------------------------------------------------------------------------------------------ scene
    @rpc("StartScene")
    async def start_scene(self, context: Context, args: None) -> None:
        """Start the scene: connect its devices. SceneState reports the progress."""
        await self._online.begin_start(context.client.name, dry_run=context.dry_run)

    @rpc("StartSceneKeepGoing")
    async def start_scene_keep_going(self, context: Context, args: None) -> None:
        """Start the scene without the devices that cannot be connected. SceneState reports the progress."""
        await self._online.begin_start(context.client.name, dry_run=context.dry_run, keep_going=True)

    @rpc("StopScene")
    async def stop_scene(self, context: Context, args: None) -> None:
        """Stop the scene: disconnect its devices. SceneState reports the progress."""
        await self._online.begin_stop(context.client.name, dry_run=context.dry_run)

    # ------------------------------------------------------------------------------------------------ single actions
    @rpc("ExecuteAction")
    async def execute_action(self, context: Context, args: ExecuteActionArgs) -> None:
        """Execute one action of the project. ActionResult reports its end."""
        session, cell = self._session, self._online
        session.require_project_open()
        async with self._locks.auto(context.user, ACTION):
            action = session.document.action(args.action_id)
            cell.require_online()
            if cell.running_action is not None:
                name = session.document.action(cell.running_action.action_id).name
                raise RequestRefused("The action {name} is running.", name=name)
            object_id, _, method = action.type.partition("/")
            if session.document.find_function(object_id) is not None:
                raise RequestRefused("{name} calls a function. Run the project to execute it.", name=action.name)
            obj = session.document.scene_object(object_id)
            cell.board.require_not_failed(object_id)
            if object_id in cell.moving:
                raise RequestRefused("{name} is moving.", name=obj.name)
            prepared = prepare(action, self._types.action(obj.type, method), session.document, cell.results)
            if context.dry_run:
                return
            running = cell.running_action = RunningAction(action.id, object_id, method, context.received_at)
        context.emit("ActionExecution", ActionExecutionData(action.id))
        cell.background.spawn(execute(cell, prepared, running), f"action {action.name}")

    @rpc("CancelAction")
    async def cancel_action(self, context: Context, args: None) -> None:
        """Cancel the running action."""
        self._session.require_project_open()
        running = self._online.running_action
        if running is None:
            raise RequestRefused("No action is running.")
        obj = self._session.document.scene_object(running.object_id)
        if not self._types.action(obj.type, running.method).meta.cancellable:
            raise RequestRefused(
                "{name}.{method} cannot be cancelled. StopAll stops its device.", name=obj.name, method=running.method
            )
        running.cancelled = True
        try:
            await self._online.host.cancel(running.object_id, running.method)
        except BaseException:
            running.cancelled = False
            raise
        context.emit("ActionCancelled")

    # ------------------------------------------------------------------------------------------------ packages
    @rpc("ListPackages")
    async def list_packages(self, context: Context, args: None) -> list[PackageSummary]:
        """Return all packages."""
        return await self._execution.list()

    @rpc("UploadPackage")
    async def upload_package(self, context: Context, args: UploadPackageArgs) -> None:
        """Store a package that was sent as a zip file."""
        with self._tasks.running(
            TaskKind.UPLOAD, Message.of("Uploading the package {id}", id=args.id), context.client.name
        ):
            summary = await self._execution.upload(args.id, args.data)
        context.emit("PackageChanged", summary, ChangeType.ADD)

    @rpc("DeletePackage")
    async def delete_package(self, context: Context, args: IdArgs) -> None:
        """Delete a package."""
        summary = await self._execution.delete(args.id)
        context.emit("PackageChanged", summary, ChangeType.REMOVE)

    @rpc("RenamePackage")
    async def rename_package(self, context: Context, args: RenamePackageArgs) -> None:
        """Rename a package."""
        summary = await self._execution.rename(args.package_id, args.new_name)
        context.emit("PackageChanged", summary, ChangeType.UPDATE)

    @rpc("RunPackage")
    async def run_package(self, context: Context, args: RunPackageArgs) -> None:
        """Run a package. A document left open by users who disconnected does not prevent it."""
        await self._package_runs.run_package(args.id, _run_options(context, args))

    @rpc("TemporaryPackage")
    async def temporary_package(self, context: Context, args: TemporaryPackageArgs) -> None:
        """Run the open project. It is closed during the run. The answer comes when the package is built."""
        await self._temporary_runs.run(_run_options(context, args))

    @rpc("StopPackage")
    async def stop_package(self, context: Context, args: None) -> None:
        """Stop the program."""
        self._execution.stop(context.client.name)

    @rpc("PausePackage")
    async def pause_package(self, context: Context, args: None) -> None:
        """Pause the program before its next action."""
        self._execution.pause()

    @rpc("ResumePackage")
    async def resume_package(self, context: Context, args: None) -> None:
        """Resume the paused program."""
        self._execution.resume()

    @rpc("StepAction")
    async def step_action(self, context: Context, args: StepActionArgs | None) -> None:
        """Resume the paused program for one action, over or into functions, or until the present function is left."""
        if args is None:
            self._execution.step()
        else:
            self._execution.step(args.mode, args.branch or "")

    @rpc("GetHeld")
    async def get_held(self, context: Context, args: None) -> GetHeldData:
        """Return the action at which the program is held, if any."""
        held = self._execution.hold.present
        return GetHeldData() if held is None else GetHeldData(context.translatable([held])[0])

    @rpc("DecideHeld")
    async def decide_held(self, context: Context, args: DecideHeldArgs) -> None:
        """Continue the held program. HoldDecided publishes the decision."""
        await self._execution.decide(args, context.client.name)

    @rpc("GetParts")
    async def get_parts(self, context: Context, args: None) -> list[PartInventory]:
        """Return the part inventories of all scenes."""
        return await self._execution.parts.all()

    @rpc("ConfirmParts")
    async def confirm_parts(self, context: Context, args: ConfirmPartsArgs) -> None:
        """Record the places where a person has found parts. PartsChanged publishes it."""
        await self._execution.confirm_parts(args, context.client.name)

    @rpc("GetProgramPosition")
    async def get_program_position(self, context: Context, args: None) -> ProgramPosition:
        """Return the position of the running program."""
        return self._execution.program.position
