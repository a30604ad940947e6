"""The online scene: going online and offline, calls to devices, running actions."""

import asyncio
from collections.abc import Callable, Mapping
from typing import Any, Final

import structlog
from msgspec.structs import replace

from arcor2_hw.data.base import UNSET
from arcor2_hw.data.events import ActionResultData, Event, SceneStateData, SceneStateEnum
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Joint
from arcor2_hw.data.scene import Scene, SceneObject
from arcor2_hw.exceptions import Arcor2Error, ConnectionLost
from arcor2_hw.messages import Message
from arcor2_hw.runtime import messages as m
from arcor2_server.background import BackgroundTasks
from arcor2_server.collaboration.locks import PROJECT, SCENE, SERVER, Locks
from arcor2_server.collaboration.tasks import Tasks
from arcor2_server.documents import Session
from arcor2_server.documents.changes import Edit, Kind
from arcor2_server.errors import RequestRefused
from arcor2_server.events import EventHub, make_event
from arcor2_server.hosts.devices import DeviceBoard
from arcor2_server.hosts.group import HostGroup
from arcor2_server.hosts.placement import shown
from arcor2_server.hosts.session import READ_TIMEOUT, HostSession
from arcor2_server.hosts.streams import RobotStreams
from arcor2_server.online.actions import LastStop, RunningAction
from arcor2_server.online.forces import Forces
from arcor2_server.online.hold_to_run import HoldToRun
from arcor2_server.online.progress import SceneTask
from arcor2_server.online.scene_opening import SceneOpening
from arcor2_server.workspace.robot_calibrations import RobotCalibrations
from arcor2_server.workspace.robots import SceneRobots

log = structlog.get_logger(__name__)

SPARE_AFTER: Final = 0.5
"""Time from the start of the server to the start of the first spare host, s."""
START_TIMEOUT: Final = 60.0
"""Time limit for importing object types and connecting devices, s; the host has a shorter limit for each device."""
STOP_TIMEOUT: Final = 5.0
"""Time limit for the host to close the devices, s; the host allows 2 s."""


class OnlineScene:
    """The open scene, which goes online and offline. Create it inside the event loop.

    Calls to devices raise CellError, ConnectionLost or DeviceTimeout.
    """

    def __init__(
        self,
        host: HostSession,
        opening: SceneOpening,
        hub: EventHub,
        locks: Locks,
        session: Session,
        robots: SceneRobots,
        tasks: Tasks,
        robot_calibrations: RobotCalibrations,
    ) -> None:
        self.state = SceneStateEnum.STOPPED
        self.running_action: RunningAction | None = None
        self.results: dict[str, list[str]] = {}
        """Results of executed actions by action id, as JSON; deleted when the scene goes offline."""
        self.last_stop = LastStop()
        self.moving: set[str] = set()
        """Ids of the robots that are moving on request."""
        self.before_start: list[Callable[[], None]] = []
        """Called before the scene goes online; may raise RequestRefused."""
        self.on_device_action: list[Callable[[str], None]] = []
        """Called with the id of the object of each action that has ended."""
        self.background = BackgroundTasks()
        """Tasks that are cancelled when the server ends."""
        self.held = HoldToRun(host, hub, locks, robots, self.moving, self.background)
        self.forces = Forces(host, hub, self.background)
        """The outputs that persons force."""
        self.host = host
        """The devices. Its calls raise RequestRefused while the scene is offline."""
        self._opening = opening
        self._hub = hub
        self._locks = locks
        self._session = session
        self._robots = robots
        self._robot_calibrations = robot_calibrations
        self._progress = SceneTask(tasks)
        self._requested_by = ""
        """The user who last started or stopped the scene."""
        self._task: asyncio.Task[None] | None = None
        self._answer: asyncio.Future[m.ErrorData | None] | None = None
        self._preparing = asyncio.get_running_loop().call_later(SPARE_AFTER, host.prepare)
        host.observe(self._handle, self._host_ended)
        host.board.on_connection.append(self._connection_changed)
        hub.on_leave += [self.held.forget, self.forces.forget]
        session.on_change.append(self._edited)

    # -------------------------------------------------------------------------------- state
    @property
    def board(self) -> DeviceBoard:
        """The states of the devices."""
        return self.host.board

    @property
    def streams(self) -> RobotStreams:
        """The subscriptions to joints and end effector poses."""
        return self.host.streams

    @property
    def online(self) -> bool:
        """Whether the scene is online."""
        return self.host.online

    def require_online(self) -> None:
        """Raise RequestRefused unless the scene is online."""
        self.host.require_online()

    def require_offline(self) -> None:
        """Raise RequestRefused unless the scene is offline."""
        if self.state is not SceneStateEnum.STOPPED:
            raise RequestRefused("The scene is online. Stop it first.")

    async def settled(self) -> SceneStateEnum:
        """Wait until the scene neither starts nor stops; return its state."""
        while self._task is not None:
            await asyncio.wait([self._task])
        return self.state

    def _connection_changed(self) -> None:
        if self.state is SceneStateEnum.STARTING:
            self._progress.connected(self.board.states())
        self._robot_calibrations.read_connected()

    def _publish(self, state: SceneStateEnum, message: Message | None = None) -> None:
        self.state = state
        self.host.online = state is SceneStateEnum.STARTED
        scene = self._session.scene
        self._progress.entered(state, "" if scene is None else scene.name, message, self._requested_by)
        log.info("scene", state=state.value, reason=str(message or ""))
        data = SceneStateData(state)
        if message is not None:
            data = SceneStateData(state, message.text, **message.translation())
        self._hub.broadcast(make_event("SceneState", data))
        self._robot_calibrations.read_connected()

    # -------------------------------------------------------------------------------- going online
    async def begin_start(self, by: str, *, dry_run: bool = False, keep_going: bool = False) -> None:
        """Start going online. The event SceneState reports the progress.

        Args:
            by: name of the user, for the task.
            dry_run: only check whether the scene may go online.
            keep_going: leave out objects that cannot be created or connected.

        Raises:
            RequestRefused: the scene cannot go online now.
            SeveralNodes: its robots and grippers are on different computers.
            Locked: a user is editing the scene or project.
        """
        self._session.require_scene_open()
        self.require_offline()
        self.host.place(self._session.require_scene().objects)
        for check in self.before_start:
            check()
        if self._session.project is None and (locked := self._locks.write_locked_roots()):
            raise RequestRefused(
                "These items are being edited: {locked}. Wait until they are unlocked.", locked=", ".join(locked)
            )
        await self._locks.acquire(SERVER, SCENE, PROJECT)
        try:
            self.require_offline()
            if not dry_run:
                self.state, self._requested_by = SceneStateEnum.STARTING, by
                self._task = self.background.spawn(
                    self._start(self._session.require_scene(), keep_going), "scene start"
                )
        finally:
            if self._task is None:
                self._locks.release(SERVER, SCENE, PROJECT)

    async def _start(self, scene: Scene, keep_going: bool) -> None:
        self._publish(SceneStateEnum.STARTING)
        self.board.clear()
        try:
            problem = await self._go_online(scene, keep_going)
        except Arcor2Error as error:
            problem = error.message
        except Exception as error:
            log.exception("scene start failed")
            problem = Message.of("An error inside the server: {reason}", reason=error)
        if problem is None:
            failed = self.board.failed()
            missing = Message.of("Not connected: {names}.", names=", ".join(failed)) if failed else None
            self._done(SceneStateEnum.STARTED, missing)
            self.host.prepare()
            return
        self._publish(SceneStateEnum.STOPPING, problem)
        host, self.host.host = self.host.host, None
        if host is not None:
            await host.close()
        self._gone_offline(problem)

    async def _go_online(self, scene: Scene, keep_going: bool) -> Message | None:
        """Start a host and connect the devices; return the reason for a failure, None on success."""
        self.board.show(scene.objects, {})
        message, overlaid = await self._opening.prepare(scene, keep_going)
        self.board.show(scene.objects, overlaid)
        self._answer = asyncio.get_running_loop().create_future()
        host = self.host.host = await self.host.take(self.host.place(scene.objects))
        host.send(self._opening.with_workspace(message, scene))
        try:
            async with asyncio.timeout(START_TIMEOUT):
                error = await self._answer
        except TimeoutError:
            host.kill()
            return Message.of("The scene was not online within {limit:g} s.", limit=START_TIMEOUT)
        if error is None:
            return None
        if error.detail:
            log.warning("scene start failed", reason=error.message.text, detail=error.detail)
        return error.message

    def _done(self, state: SceneStateEnum, message: Message | None = None) -> None:
        self._task = None
        self._answer = None
        self._locks.release(SERVER, SCENE, PROJECT)
        self._publish(state, message)

    def _gone_offline(self, message: Message | None = None) -> None:
        self.host.host = None
        self.board.clear(message)
        self.results.clear()
        self.held.offline(message)
        self.forces.offline(message)
        self.moving.clear()
        self.streams.clear()
        self._done(SceneStateEnum.STOPPED, message)
        self.host.prepare()

    async def prepare_addition(self, obj: SceneObject, *, dry_run: bool = False) -> None:
        """Start a host for an object that will be added to the online scene, unless a host runs on its node.

        Args:
            obj: the object.
            dry_run: only check whether it may be added.

        Raises:
            SeveralNodes: robots and grippers would be on different computers.
            RequestRefused: the program and the interlocks would have to move to another computer.
            Arcor2Error: the host cannot be started.
        """
        if not self.online or (hosts := self.host.host) is None:
            return
        scene = self._session.require_scene()
        placement = self.host.place([*scene.objects, obj])
        if placement.main != hosts.placement.main:
            raise RequestRefused(
                "The program and the interlocks of the scene must move to {computer} with {name}. "
                "Go offline, add {name}, and go online again.",
                name=obj.name,
                computer=shown(placement.main),
            )
        if not dry_run:
            await self.host.extend(placement.nodes[obj.id], self._opening.without_objects(scene))

    def connect_added(self, obj: SceneObject) -> None:
        """Create and connect an object that was added to the online scene. ObjectState reports the result."""
        self.background.spawn(self._connect_added(obj), f"connection of {obj.name}")

    async def _connect_added(self, obj: SceneObject) -> None:
        try:
            message, overlaid = await self._opening.prepare(replace(self._session.require_scene(), objects=[obj]), True)
            self.board.add(obj, overlaid.get(obj.id, []))
            await self.host.add(message, self.host.place(self._session.require_scene().objects).nodes[obj.id])
        except Arcor2Error as error:  # ObjectState has reported the reason, unless the scene has gone offline
            log.warning("added object is not connected", object=obj.name, reason=str(error))

    def _edited(self, edit: Edit | None) -> None:
        """Let the host use changed interlocks at once."""
        if edit is not None and self.online and any(change.kind is Kind.INTERLOCK for change in edit.changes):
            self.host.send(m.SetInterlocks(self._session.document.interlocks()))

    # -------------------------------------------------------------------------------- going offline
    async def begin_stop(self, by: str, *, dry_run: bool = False) -> None:
        """Start going offline. The event SceneState reports the progress.

        Args:
            by: name of the user, for the task.
            dry_run: only check whether the scene may go offline.

        Raises:
            RequestRefused: the scene cannot go offline now.
            Locked: a user is editing the scene or project.
        """
        self._session.require_scene_open()
        if not self.online:
            raise RequestRefused("The scene is not online.")
        if self.running_action is not None and not self.running_action.stop_requested:
            raise RequestRefused("An action is running. Wait until it ends, or stop it.")
        await self._locks.acquire(SERVER, SCENE, PROJECT)
        try:
            self.require_online()
            if not dry_run:
                self.state, self._requested_by = SceneStateEnum.STOPPING, by
                self._task = self.background.spawn(self._stop(), "scene stop")
        finally:
            if self._task is None:
                self._locks.release(SERVER, SCENE, PROJECT)

    async def _stop(self) -> None:
        self._publish(SceneStateEnum.STOPPING)
        host = self.host.host
        problem: Message | None = None
        if host is not None:
            self._answer = asyncio.get_running_loop().create_future()
            host.send(m.CloseScene())
            try:
                async with asyncio.timeout(STOP_TIMEOUT):
                    error = await self._answer
                problem = None if error is None else error.message
            except ConnectionLost as lost:
                problem = lost.message
            except TimeoutError:
                problem = Message.of("The devices could not be closed in time.")
                host.kill()
            self.host.host = None  # the end of the host is expected from now on
            await host.wait_or_kill()
        self._gone_offline(problem)

    async def close(self) -> None:
        """Close the hosts when the server ends. They stop all motion and disconnect."""
        self._preparing.cancel()
        await self.host.close()
        await self.background.cancel()

    # -------------------------------------------------------------------------------- from the host
    def _handle(self, host: HostGroup, message: m.ServerBound) -> None:  # noqa: ARG002
        match message:
            case m.HoldEnded():
                self.held.ended(message)
            case m.ForceEnded():
                self.forces.ended(message)
            case m.HandTeachingEnded():
                self.held.teaching_ended(message)
            case m.SceneOpened():
                self._answered(None)
            case m.SceneFailed() | m.SceneClosed():
                self._answered(message.error)
            case _:
                pass

    def _answered(self, error: m.ErrorData | None) -> None:
        if self._answer is not None and not self._answer.done():
            self._answer.set_result(error)

    def _host_ended(self, reason: Message) -> None:
        """Go offline."""
        if self._answer is not None and not self._answer.done():
            self._answer.set_exception(ConnectionLost("Connection to the devices lost: {reason}.", reason=reason))
        elif self.online:
            message = Message.of("Connection to the devices lost: {reason}.", reason=reason)
            self._publish(SceneStateEnum.STOPPING, message)
            self._gone_offline(message)

    # -------------------------------------------------------------------------------- calls
    async def call(
        self,
        object_id: str,
        method: str,
        args: Mapping[str, Any] | None = None,
        *,
        control: bool = False,
        deadline: float | None = None,
        requested_at: float | None = None,
    ) -> bytes:
        """Call a method of an object as `HostSession.call`.

        If `requested_at` is set, s of the monotonic clock, raise Cancelled if everything was stopped since.
        """
        self.last_stop.require_none_since(requested_at)
        return await self.host.call(object_id, method, args, control=control, deadline=deadline)

    def begin_stop_all(self, by: str) -> HostGroup | None:
        """End all holds and prevent requested motion from starting; return the host, None if offline."""
        self.last_stop.note()
        self.held.stop(by)
        if self.running_action is not None:
            self.running_action.stop_requested = True
            self.running_action.cancelled = True  # the end of the action is published as ActionCancelled
        return self.host.host

    async def ask(self, kind: type[Any], object_id: str, method: str, args: Mapping[str, Any] | None = None) -> Any:
        """Call a method that only reads, and decode its result as `kind`."""
        return await self.host.ask(kind, object_id, method, args)

    async def robot_joints(self, robot_id: str, arm_id: str | None = None, *, gripper: bool = False) -> list[Joint]:
        """Return the present joint values of a robot."""
        return await self._robots.robot_joints(robot_id, arm_id, gripper=gripper)

    async def end_effector_pose(self, robot_id: str, end_effector: str, arm_id: str | None = None) -> Pose:
        """Return the present pose of an end effector in world coordinates."""
        return await self._robots.end_effector_pose(robot_id, end_effector, arm_id)

    async def object_pose_changed(self, object_id: str, pose: Pose) -> None:
        """Update the pose of an online object."""
        await self.call(object_id, "set_pose", {"pose": pose}, deadline=READ_TIMEOUT)

    def robot(self, robot_id: str) -> SceneObject:
        """Return the scene object of a robot. Raise NotFound if it is missing, RequestRefused if it is not a robot."""
        return self._robots.robot(robot_id)

    def arm(self, robot_id: str, arm_id: str | None) -> dict[str, Any]:
        """Return the argument for the arm. Raise RequestRefused unless exactly multi-arm robots have an arm."""
        return self._robots.arm(robot_id, arm_id)

    def action_ended(self, action: RunningAction, results: list[str] | None, error: Message | None) -> None:
        """Store the results of the running action, and publish its end unless it was cancelled."""
        self.running_action = None
        for notify in self.on_device_action:
            notify(action.object_id)
        if results is not None and self.online:
            self.results[action.action_id] = results
        if not action.cancelled:
            data = ActionResultData(action.action_id, results or UNSET)
            if error is not None:
                data = ActionResultData(action.action_id, results or UNSET, error.text, **error.translation())
            self._hub.broadcast(Event("ActionResult", data=data))
