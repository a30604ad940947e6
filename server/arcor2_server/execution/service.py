"""The Execution service: runs packages (protocol, section 12)."""

import asyncio
import time
from collections.abc import Mapping
from typing import Any, Final

import msgspec
import structlog
from msgspec.structs import replace

from arcor2_hw.data import events as e
from arcor2_hw.data.base import UNSET
from arcor2_hw.data.editor import RunEnd
from arcor2_hw.data.events import Event, MainScreen, ProjectExceptionData
from arcor2_hw.data.held import OnError
from arcor2_hw.data.package import PackageStateEnum
from arcor2_hw.data.position import ProgramStep
from arcor2_hw.data.rpc import ConfirmPartsArgs, DecideHeldArgs
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.exceptions import Arcor2Error, ProgramInterrupted
from arcor2_hw.messages import Message
from arcor2_hw.runtime import messages as m
from arcor2_server.background import BackgroundTasks
from arcor2_server.errors import RequestRefused
from arcor2_server.events import EventHub, encode, make_event
from arcor2_server.execution.breakpoints import SharedBreakpoints
from arcor2_server.execution.holds import ProgramHold
from arcor2_server.execution.packages import PackageLibrary
from arcor2_server.execution.part_inventories import PartInventories
from arcor2_server.execution.program_run import ProgramRun
from arcor2_server.execution.program_streams import ProgramStreams
from arcor2_server.execution.run_message import RunMessages
from arcor2_server.execution.run_observers import RunObservers
from arcor2_server.execution.run_statistics import verdicts_of
from arcor2_server.execution.runs import Runs, RunStart
from arcor2_server.hosts.devices import DeviceBoard, overlay_for
from arcor2_server.hosts.group import HostGroup
from arcor2_server.hosts.placement import Placement
from arcor2_server.hosts.process import json_of
from arcor2_server.hosts.session import HostSession, decoded_info
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.settings import ServerSettings
from arcor2_server.storage.packages import Packages
from arcor2_server.storage.setting_secrets import SettingSecrets

log = structlog.get_logger(__name__)
S = PackageStateEnum

STOP_TIMEOUT: Final = 5.0
"""Time limit for a stopped program to end before its host is killed, s."""
SPARE_AFTER: Final = 1.0
"""Time from PackageInfo to the start of the next spare host, s, so that it does not delay the starting program."""
POSITION: Final = "ProgramPosition"
"""The additional event with the position of the program."""
RUN_STATES: Final = frozenset({S.RUNNING, S.PAUSING, S.PAUSED, S.RESUMING})
_IDLE: Final = frozenset({S.UNDEFINED, S.STOPPED})


class Execution(PackageLibrary, RunObservers):
    """Runs one package at a time in its own cell host.

    Methods raise RequestRefused if the present state does not allow them.
    """

    def __init__(
        self,
        packages: Packages,
        host: HostSession,
        online: OnlineScene,
        settings: ServerSettings,
        hub: EventHub,
        types: ObjectTypes,
        runs: Runs,
        breakpoints: SharedBreakpoints,
        secrets: SettingSecrets,
        messages: RunMessages,
        parts: PartInventories,
    ) -> None:
        super().__init__(hub, packages)
        RunObservers.__init__(self)
        self.state = S.UNDEFINED
        self.stop_within = STOP_TIMEOUT
        self._reserved = False
        self.program = ProgramRun(runs)
        """The present or last run."""
        self.hold = ProgramHold(hub, runs)
        """The hold of the present run."""
        self.parts = parts
        """The part inventory."""
        self.streams = ProgramStreams(host, types)
        """The subscriptions to the devices of the program."""
        self._host = host
        self._online = online
        self._settings = settings
        self._types = types
        self._runs = runs
        self._secrets = secrets
        self._messages = messages
        self._over: asyncio.Future[None] | None = None
        self._killing: asyncio.TimerHandle | None = None
        self._background = BackgroundTasks()
        host.observe(self._handle, self._host_ended)
        online.before_start.append(self.require_no_program)
        breakpoints.on_change.append(self._breakpoints_changed)

    # -------------------------------------------------------------------------------- state
    @property
    def running(self) -> bool:
        """Whether a program is running, pausing, paused or resuming."""
        return self.state in RUN_STATES

    @property
    def busy(self) -> bool:
        """Whether documents and other programs must not be opened or started: around and during a run."""
        return self._reserved or self.active

    @property
    def active(self) -> bool:
        """Whether a program is starting, running or ending."""
        return self.state not in _IDLE

    @property
    def board(self) -> DeviceBoard:
        """The states of the program's devices."""
        return self._host.board

    def require_permitted(self, how: RunStart) -> None:
        """Raise RequestRefused if no program may be started in this way now."""
        for check in self.before_start:
            check(how)

    def require_no_program(self) -> None:
        """Raise RequestRefused while a program runs."""
        if self.busy:
            raise RequestRefused("A program is running. Stop it first.")

    def state_and_info(self) -> tuple[Event, bytes | None]:
        """Return the present PackageState, and the encoded PackageInfo while a program runs."""
        return self._state_event(), self._host.package_info

    def greeting(self) -> list[Event]:
        """Return the events that describe the running program to a new client; empty if no program runs."""
        if self._host.package_info is None:
            return []
        encoded = [event for event in (self._host.package_info, self.program.action) if event is not None]
        return [self._state_event(), *(msgspec.json.decode(event, type=Event) for event in encoded)]

    def _state_event(self) -> Event:
        return make_event("PackageState", e.PackageStateData(self.state, self.program.package_id or UNSET))

    def _enter(self, state: PackageStateEnum) -> None:
        self.state = state
        log.info("package", id=self.program.package_id, state=state.value)
        self._hub.broadcast(self._state_event())
        self._state_changed()

    def _state_changed(self) -> None:
        for notify in self.on_state:
            notify()

    # -------------------------------------------------------------------------------- commands
    def _require_not_used(self, package_id: str) -> None:
        if self.state not in _IDLE and package_id == self.program.package_id:
            raise RequestRefused("This package is running. Stop it first.")

    async def run(self, package_id: str, how: RunStart | None = None) -> None:
        """Start a package. Its state is published as PackageState."""
        self._require_not_reserved()
        await self._run(package_id, how or RunStart())

    async def run_through(
        self, package_id: str, how: RunStart, *, temporary: bool = True, started: "asyncio.Future[None] | None" = None
    ) -> None:
        """Run a package and wait for its end. Clients do not show the list of packages afterwards.

        Args:
            package_id: the package.
            how: options of the run.
            temporary: whether the package is deleted after the run.
            started: future that is set when the program has started.
        """
        over = self._over = asyncio.get_running_loop().create_future()
        try:
            await self._run(package_id, how, temporary=temporary)
            if started is not None and not started.done():
                started.set_result(None)
            await over
        finally:
            self._over = None

    async def _run(self, package_id: str, how: RunStart, *, temporary: bool = False) -> None:
        self.require_permitted(how)
        self._require_idle()
        requested_at = time.monotonic()
        directory = await asyncio.to_thread(self.packages.directory, package_id)
        project_id = await asyncio.to_thread(self.packages.project_id, package_id) if how.shared_breakpoints else ""
        placement = self._host.place(await self._messages.objects(directory))
        scene_id = await self.parts.require_confirmed(directory)
        if how.continues:
            if how.on_error is not OnError.HOLD:
                raise RequestRefused("A program can only continue if it is held on errors.")
            former = self._runs.get(await self.parts.require_continues(scene_id, package_id, how.continue_at))
            how = how if former is None else how.continuing(former)
        for prepare in self.before_run:
            how = await prepare(package_id, how)
        self.require_permitted(how)
        self._require_idle()
        self._online.last_stop.require_none_since(requested_at)
        self.program = program = ProgramRun(self._runs, package_id, project_id)
        self.hold.reset()
        self._host.package_info = None
        self.board.clear()
        self._enter(S.STARTED)
        program.begin(how, temporary=temporary)
        message = replace(self._messages.prepare(package_id, directory, how), run=program.number)
        self.parts.begin_run(scene_id)
        for begin in self.on_begin:
            begin(program.number, package_id, scene_id, how)
        self._background.spawn(self._begin(message, placement), "program start")
        self._background.spawn(program.describe(self.packages), "description of the run")

    def reserve(self) -> None:
        """Refuse other runs while a document is closed for a run, or a project is about to run."""
        self._reserved = True

    def release(self) -> None:
        """End `reserve`."""
        self._reserved = False

    def _require_not_reserved(self) -> None:
        if self._reserved:
            raise RequestRefused("A project is being run. Wait until it is open again, or stop it.")

    def _require_idle(self) -> None:
        if self.state not in _IDLE:
            raise RequestRefused("A package is {value}. Stop it first.", value=self.state.value)
        if self._online.state.value != "stopped":
            raise RequestRefused("The scene is online and uses the devices. Stop the scene first.")

    async def _begin(self, message: m.RunPackage, placement: Placement) -> None:
        try:
            host = await self._host.take(placement)
            message = await self._messages.complete(message, self.program.shared_of)
        except Arcor2Error as error:
            self._fail(error.message, type(error).__name__)
            self._ended()
            return
        if self.state is S.STOPPING:  # stopped while its host was starting
            await host.close()
            self._ended()
            return
        self._host.host = host
        host.send(message)

    def stop(self, by: str = "") -> None:
        """Stop the devices, then the script. The host is killed if the program does not end in time.

        As the protocol requires, a program cannot be stopped while it is starting, unless its host does not answer.
        """
        host = self._require(RUN_STATES if self.board.answering else RUN_STATES | {S.STARTED}, "stopped")
        self._stop(by)
        host.send(m.StopProgram())

    def _stop(self, by: str) -> None:
        self.program.stopped_by = by
        self._end_hold()
        self._enter(S.STOPPING)
        if self._host.host is not None:
            self._killing = asyncio.get_running_loop().call_later(self.stop_within, self._kill, self._host.host)

    def begin_stop_all(self, by: str) -> HostGroup | None:
        """Begin to stop the program in any state. Return its host, or None without one."""
        if self.state in RUN_STATES | {S.STARTED}:
            self._stop(by)
        return self._host.host

    def pause(self) -> None:
        """Pause the program before its next action."""
        host = self._require({S.RUNNING}, "paused")
        self._enter(S.PAUSING)
        host.send(m.Pause())

    def resume(self) -> None:
        """Resume a paused program."""
        self.hold.require_none()
        host = self._require({S.PAUSED}, "resumed")
        self._require_may_resume()
        self._enter(S.RESUMING)
        host.send(m.Resume())

    def step(self, mode: ProgramStep = ProgramStep.OVER, branch: str = "") -> None:
        """Let a paused program execute one action.

        Args:
            mode: whether actions inside of functions count.
            branch: id of the branch; empty for the one that waits longest.

        Raises:
            RequestRefused: the program is not paused or is held, or has no such branch.
        """
        self.hold.require_none()
        host = self._require({S.PAUSED}, "stepped")
        if branch and branch not in (one.id for one in self.program.position.branches):
            raise RequestRefused("The program has no branch {branch}.", branch=branch)
        self._require_may_resume()
        self._enter(S.RESUMING)
        host.send(m.Step(mode, branch))

    def _require_may_resume(self) -> None:
        for check in self.before_resume:
            check()

    async def decide(self, args: DecideHeldArgs, by: str) -> None:
        """Continue the held program as a user has decided."""
        await self.hold.decide(self._host.host, args, by)

    async def confirm_parts(self, args: ConfirmPartsArgs, by: str) -> None:
        """Record where a user has found parts."""
        await self.parts.confirm(self._host.host, args, by)

    def device_of_hold(self, object_id: str) -> SceneObject:
        """Return a device of the held program, on which a user may act. Raise RequestRefused unless it is held."""
        if self.hold.present is None:
            raise RequestRefused("A program is running. Its devices are available while it is held at a failed action.")
        return self.board.object(object_id)

    async def call(self, object_id: str, method: str, args: Mapping[str, Any], deadline: float) -> bytes:
        """Call a method of a device of the held program; return the result as JSON.

        Args:
            object_id: the device.
            method: the name of the method.
            args: its arguments.
            deadline: time limit, s.

        Raises:
            CellError: the device refused the call or failed.
            ConnectionLost: the host ended.
            DeviceTimeout: the device or the host did not answer in time.
        """
        host = self._require({S.PAUSING, S.PAUSED}, "operated")
        encoded = {name: json_of(value) for name, value in args.items()}
        return await host.call(object_id, method, encoded, deadline=deadline)

    def _breakpoints_changed(self, project_id: str, ids: set[str]) -> None:
        if self.program.shared_of == project_id and self.state not in _IDLE:
            self._host.send(m.SetBreakpoints(sorted(ids)))

    def _require(self, states: "set[PackageStateEnum] | frozenset[PackageStateEnum]", what: str) -> HostGroup:
        host = self._host.host
        if self.state not in states or host is None:
            raise RequestRefused("The package is {value} and cannot be {what}.", value=self.state.value, what=what)
        return host

    def _kill(self, host: HostGroup) -> None:
        log.warning("program killed because it did not stop", package=self.program.package_id, within=self.stop_within)
        host.kill()

    async def close(self) -> None:
        """Mark the running program as lost when the server ends. The online scene closes the hosts."""
        self._host.host = None  # the end of the host is expected
        if self.state not in _IDLE:
            message = Message.of("The server ended during the run.")
            self.program.error = m.ErrorData("error", "ConnectionLost", message)
            self.program.stopped_by = None  # a requested stop was not completed
            self.program.end(lost=True)
            self.state = S.STOPPED
        if self._killing is not None:
            self._killing.cancel()
        await self._background.cancel()

    # -------------------------------------------------------------------------------- from the host
    def _handle(self, host: HostGroup, message: m.ServerBound) -> None:
        match message:
            case m.ProgramEvent():
                self.program.handle_event(message)
                if message.event == "ActionStateBefore":
                    for notify_device in self.on_device_action:
                        notify_device(message.device)
                if message.event == "PackageInfo":
                    self._show_devices(message.encoded)
                if message.frames or message.event == "ActionStateAfter":
                    self._publish_position()
                if message.call:  # actions of functions are unknown to other clients
                    for client in self._hub.subscribers(POSITION):
                        client.put(message.encoded)
                else:
                    self._hub.broadcast_encoded(message.event, message.encoded)
                if message.event == "ActionStateAfter":
                    self._action_ended(message.number)
            case m.ActionFailed():
                self._runs.ended(message)
                self._action_ended(message.number)
                if self.program.action_over(message.number):
                    self._publish_position()
            case m.ProgramHeld():
                self._held(message)
            case m.HeldChanged():
                self.hold.change(message.held)
            case m.PartsChanged():
                self.parts.changed(message.inventory)
            case m.PartStep():
                for notify in self.on_part_step:
                    notify(message)
            case m.ProgramChanged():
                self._program_changed(host, message)
            case _:
                pass

    def _action_ended(self, number: int) -> None:
        for notify in self.on_action_end:
            notify(number)

    def _publish_position(self) -> None:
        if self._hub.subscribers(POSITION):
            event = make_event(POSITION, self.program.position)
            self._hub.stream_to_subscribers(POSITION, "program", encode(event))

    def _show_devices(self, package_info: bytes) -> None:
        self._host.package_info = package_info
        info = decoded_info(package_info)
        _, overlaid = overlay_for(self._settings.cell, self._secrets.is_secret, info.scene)
        self.board.show(info.scene.objects, overlaid)
        self.program.collect_statistics(info, verdicts_of(info, self._types))
        asyncio.get_running_loop().call_later(SPARE_AFTER, self._host.prepare)

    def _held(self, message: m.ProgramHeld) -> None:
        if self.state is S.STOPPING:
            return
        if self.state is not S.PAUSING:  # wait until no action runs
            self._enter(S.PAUSING)
        run = self.program.number
        self.hold.begin(run, message.held)
        self._state_changed()
        if message.held.kind != ProgramInterrupted.code:  # the interruption has its own alarm
            for notify in self.on_error:
                notify(message.error, run, message.held.action_name)

    def _end_hold(self) -> None:
        if self.hold.present is None:
            return
        if (decided := self.hold.end()) is not None:
            for notify in self.on_decided:
                notify(decided)
        self.program.handle_held(self.hold.seconds)
        self._state_changed()

    def _program_changed(self, host: HostGroup, message: m.ProgramChanged) -> None:
        if message.state == "stopped":
            self.program.handle_end(message.error)
            if message.error is not None and self.program.stopped_by is None and not self.hold.ended_program:
                run = self.program.number
                for notify in self.on_error:
                    notify(message.error, run, self._runs.last_action(run))
            self._ended()
            self._background.spawn(host.wait_or_kill(), "end of the program's host")
        elif self.state is not S.STOPPING:
            state = S(message.state)
            if state is S.RUNNING:
                self._end_hold()
            if self.state is not state:
                self._enter(state)
            if state is S.PAUSED:
                self.program.handle_paused()

    def _host_ended(self, reason: Message) -> None:
        """Report that the host has ended before the program."""
        if self.state is not S.STOPPING:
            self._fail(Message.of("Connection to the program lost: {reason}.", reason=reason), "ConnectionLost")
        self._ended(lost=True)

    def _fail(self, message: Message, kind: str) -> None:
        self.program.error = m.ErrorData("error", kind, message)
        data = ProjectExceptionData(message.text, kind, **message.translation())
        self._hub.broadcast(make_event("ProjectException", data))

    def _ended(self, *, lost: bool = False) -> None:
        host, self._host.host = self._host.host, None
        self._end_hold()
        if self.program.end(lost=lost) in (RunEnd.FAILED, RunEnd.LOST):
            for notify in self.on_failed:
                notify(self.program.number, self.program.error, host)
        self._publish_position()
        self._host.streams.clear()
        error = self.program.error
        self.board.clear(None if error is None else error.message)
        self._host.package_info = None
        if self._killing is not None:
            self._killing.cancel()
            self._killing = None
        self._enter(S.STOPPED)
        self._background.spawn(self.parts.publish(self.parts.end_run()), "part inventory after the run")
        if self._over is None:
            screen = e.ShowMainScreenData(MainScreen.PACKAGES_LIST, self.program.package_id)
            self._hub.broadcast(make_event("ShowMainScreen", screen))
        elif not self._over.done():
            self._over.set_result(None)
        self._host.prepare()
