"""The scene when it is online: its state, its host, calls to its devices, streams to those who subscribed."""

import asyncio
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

import msgspec
import structlog

from arcor2_hw.data.base import UNSET
from arcor2_hw.data.events import ActionResultData, Event, SceneStateData, SceneStateEnum
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Joint
from arcor2_hw.data.scene import Scene, SceneObject
from arcor2_hw.exceptions import Arcor2Error, ConnectionLost
from arcor2_hw.runtime import messages as m
from arcor2_server.collaboration.locks import PROJECT, SCENE, SERVER
from arcor2_server.errors import RequestRefused
from arcor2_server.events import make_event
from arcor2_server.hosts.devices import DeviceBoard
from arcor2_server.hosts.open_request import opening
from arcor2_server.hosts.pool import CellHosts
from arcor2_server.hosts.process import CellHost, json_of
from arcor2_server.hosts.streams import RobotStreams
from arcor2_server.hosts.workspace_updates import calibrations, with_world
from arcor2_server.online.actions import LastStop, RunningAction
from arcor2_server.online.hold_to_run import HeldRobots
from arcor2_server.online.progress import SceneTask

if TYPE_CHECKING:
    from arcor2_server.services import Services

log = structlog.get_logger(__name__)

SPARE_AFTER: Final = 0.5
"""Seconds from the start of the server to that of the first spare host, which must not delay it."""
START_WITHIN: Final = 60.0
"""Seconds for importing object types (which may hang) and connecting; the host gives each device less."""
STOP_WITHIN: Final = 5.0
"""Seconds in which the host says that it has closed the devices; it allows itself two."""


class OnlineCell:
    """One scene, offline or online. Made inside the event loop.

    What is asked of devices raises CellError, ConnectionLost, DeviceTimeout.
    """

    def __init__(self, services: "Services") -> None:
        self.hosts = CellHosts(services.settings.device_files_dirs)
        self.state = SceneStateEnum.STOPPED
        self.running_action: RunningAction | None = None
        self.results: dict[str, list[str]] = {}
        """Results of executed actions by action id, as JSON; forgotten when the scene goes offline."""
        self.last_stop = LastStop()
        self.moving: set[str] = set()
        """Robots that move because a request said so."""
        self._services = services
        self._host: CellHost | None = None
        self._task: asyncio.Task[None] | None = None
        self._answer: asyncio.Future[m.ErrorData | None] | None = None
        self.streams = RobotStreams(services.hub, self.say)
        self.held = HeldRobots(services, self._online_host, self.moving)
        self.task = SceneTask(services.tasks)
        self.board = DeviceBoard(services.hub, self._one_connected)
        self._background: set[asyncio.Task[None]] = set()
        self._preparing = asyncio.get_running_loop().call_later(SPARE_AFTER, self.hosts.prepare)
        services.hub.on_leave += [self.streams.forget, self.held.forget]

    # -------------------------------------------------------------------------------- state
    @property
    def online(self) -> bool:
        """Tell whether the scene is online."""
        return self.state is SceneStateEnum.STARTED

    def require_online(self) -> None:
        """RequestRefused unless the scene is online."""
        if not self.online:
            raise RequestRefused("The scene is offline: start it first.")

    def require_offline(self) -> None:
        """RequestRefused unless the scene is offline."""
        if self.state is not SceneStateEnum.STOPPED:
            raise RequestRefused("The scene is online: stop it first.")

    async def settled(self) -> SceneStateEnum:
        """Wait until the scene neither comes up nor goes down; gives its state then."""
        while self._task is not None:
            await asyncio.wait([self._task])
        return self.state

    def _one_connected(self) -> None:
        if self.state is SceneStateEnum.STARTING:
            self.task.connected(self.board.states())
        self._services.arm_calibrations.look()

    def _tell(self, state: SceneStateEnum, message: str = "") -> None:
        self.state = state
        scene = self._services.session.scene
        self.task.entered(state, "" if scene is None else scene.name, message)
        log.info("scene", state=state.value, reason=message)
        self._services.hub.broadcast(make_event("SceneState", SceneStateData(state, message or UNSET)))
        self._services.arm_calibrations.look()

    # -------------------------------------------------------------------------------- going online
    async def begin_start(self, *, dry_run: bool = False, keep_going: bool = False) -> None:
        """Begin to bring the scene up: returns when that is allowed, the rest is told by SceneState.

        keep_going: objects that cannot be made or connected are left out. RequestRefused, Locked.
        """
        services = self._services
        services.session.require_scene_open()
        self.require_offline()
        if services.execution.busy:
            raise RequestRefused("A program is running: stop it first.")
        if services.session.project is None and (locked := services.locks.write_locked_roots()):
            raise RequestRefused(f"Something is being edited: {', '.join(locked)}.")
        await services.locks.acquire(SERVER, SCENE, PROJECT)
        try:
            self.require_offline()
            if not dry_run:
                self.state = SceneStateEnum.STARTING
                self._task = asyncio.create_task(
                    self._start(services.session.require_scene(), keep_going), name="scene start"
                )
        finally:
            if self._task is None:
                services.locks.release(SERVER, SCENE, PROJECT)

    async def _start(self, scene: Scene, keep_going: bool) -> None:
        self._tell(SceneStateEnum.STARTING)
        self.board.clear()
        try:
            problem = await self._bring_up(scene, keep_going)
        except Arcor2Error as error:
            problem = str(error)
        except Exception as error:
            log.exception("scene start failed")
            problem = f"An error inside the server: {error}"
        if problem is None:
            failed = self.board.failed()
            self._done(SceneStateEnum.STARTED, f"Not there: {', '.join(failed)}." if failed else "")
            self.hosts.prepare()
            return
        self._tell(SceneStateEnum.STOPPING, problem)
        host, self._host = self._host, None
        if host is not None:
            await host.close()
        self._gone_offline(problem)

    async def _bring_up(self, scene: Scene, keep_going: bool) -> str | None:
        """Give why the scene did not come up, None when it did."""
        self.board.show(scene.objects, {})
        message, overlaid = opening(self._services, scene, keep_going)
        await self._services.secrets.store.flush()
        self.board.show(scene.objects, overlaid)
        self._answer = asyncio.get_running_loop().create_future()
        host = self._host = await self.hosts.take(self)
        host.send(with_world(self._services, message, calibrations(self._services, scene.objects)))
        try:
            async with asyncio.timeout(START_WITHIN):
                error = await self._answer
        except TimeoutError:
            host.kill()
            return f"The scene did not come up within {START_WITHIN:g} s."
        if error is None:
            return None
        if error.detail:
            log.warning("scene start failed", reason=error.message, detail=error.detail)
        return error.message

    def _done(self, state: SceneStateEnum, message: str = "") -> None:
        self._task = None
        self._answer = None
        self._services.locks.release(SERVER, SCENE, PROJECT)
        self._tell(state, message)

    def _gone_offline(self, message: str = "") -> None:
        self._host = None
        self.board.clear(message)
        self.results.clear()
        self.held.offline(message)
        self.moving.clear()
        self.streams.clear()
        self._done(SceneStateEnum.STOPPED, message)
        self.hosts.prepare()

    # -------------------------------------------------------------------------------- going offline
    async def begin_stop(self, *, dry_run: bool = False) -> None:
        """Begin to take the scene down: returns when that is allowed, the rest is told by SceneState."""
        services = self._services
        services.session.require_scene_open()
        if not self.online:
            raise RequestRefused("The scene is not online.")
        if self.running_action is not None and not self.running_action.stop_requested:
            raise RequestRefused("An action is running: wait for it, or stop it.")
        await services.locks.acquire(SERVER, SCENE, PROJECT)
        try:
            self.require_online()
            if not dry_run:
                self.state = SceneStateEnum.STOPPING
                self._task = asyncio.create_task(self._stop(), name="scene stop")
        finally:
            if self._task is None:
                services.locks.release(SERVER, SCENE, PROJECT)

    async def _stop(self) -> None:
        self._tell(SceneStateEnum.STOPPING)
        host = self._host
        problem = ""
        if host is not None:
            self._answer = asyncio.get_running_loop().create_future()
            host.send(m.CloseScene())
            try:
                async with asyncio.timeout(STOP_WITHIN):
                    error = await self._answer
                problem = "" if error is None else error.message
            except ConnectionLost as lost:
                problem = str(lost)
            except TimeoutError:
                problem = "The devices could not be closed in time."
                host.kill()
            await host.gone()
        self._gone_offline(problem)

    async def close(self) -> None:
        """End with the server, and the program with it: the hosts stop motion and disconnect by themselves."""
        self._preparing.cancel()
        self._host = None  # its end is meant now
        await self._services.execution.close()
        tasks = [task for task in (self._task, *self._background) if task is not None]
        await self.hosts.close()
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    # -------------------------------------------------------------------------------- from the host
    def host_said(self, host: CellHost, message: m.ServerBound) -> None:
        """Take a message of the host."""
        match message:
            case m.StreamEvent():
                if host is self._host:
                    self.streams.heard(message)
            case m.HoldEnded():
                self.held.ended(message)
            case m.HandTeachingEnded():
                self.held.teaching_ended(message)
            case m.SceneOpened():
                self._answered(None)
            case m.SceneFailed() | m.SceneClosed():
                self._answered(message.error)
            case m.DeviceChanged():
                self.board.changed(message)
                log.info(
                    "device",
                    id=message.object_id,
                    connection=message.connection.value,
                    reason=message.reason,
                    health=message.health.value,
                    alarms=[alarm.text for alarm in message.alarms],
                    control=message.control_owner,
                )
            case m.LogLine():
                log.info("cell host", level=message.level, text=message.text, object=message.object_id)

    def _answered(self, error: m.ErrorData | None) -> None:
        if self._answer is not None and not self._answer.done():
            self._answer.set_result(error)

    def host_silent(self, host: CellHost, silent: bool) -> None:
        """Note that the host does not answer, or answers again."""
        if host is self._host:
            self.board.set_answering(not silent)
            log.warning("cell host does not answer" if silent else "cell host answers again", pid=host.pid)

    def host_ended(self, host: CellHost, reason: str) -> None:
        """Go offline with the reason when the host is gone."""
        if host is not self._host:
            return
        if self._answer is not None and not self._answer.done():
            self._answer.set_exception(ConnectionLost(reason[:1].upper() + reason[1:] + "."))
        elif self.online:
            message = f"Lost the devices: {reason}."
            self._tell(SceneStateEnum.STOPPING, message)
            self._gone_offline(message)

    # -------------------------------------------------------------------------------- calls
    def _online_host(self) -> CellHost:
        self.require_online()
        assert self._host is not None
        return self._host

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
        """Call a method of an object; return the result as JSON, empty for None.

        requested_at: when the motion was requested, s of the monotonic clock; Cancelled if all was stopped since.
        """
        self.last_stop.require_none_since(requested_at)
        encoded = {name: json_of(value) for name, value in (args or {}).items()}
        return await self._online_host().call(object_id, method, encoded, control=control, deadline=deadline)

    async def cancel(self, object_id: str, action: str) -> None:
        """Call what cancels an action of an object, past the action."""
        await self._online_host().call(object_id, action, cancel=True, deadline=STOP_WITHIN)

    async def retry(self, object_id: str) -> None:
        """Make and connect an object anew that has failed."""
        await self._online_host().retry(object_id)

    async def stop_motion(self, object_id: str) -> None:
        """Stop an object past whatever it does."""
        await self._online_host().stop_motion(object_id)

    def begin_stop_all(self, by: str) -> CellHost | None:
        """End holds and what is about to start; return the host whose devices are to be stopped, None without one."""
        self.last_stop.note()
        self.held.stop(by)
        if self.running_action is not None:
            self.running_action.stop_requested = True
            self.running_action.cancelled = True  # its end is published as ActionCancelled, unless it goes on
        return self._host

    async def ask(self, kind: type[Any], object_id: str, method: str, args: Mapping[str, Any] | None = None) -> Any:
        """Call a method that only observes, and read its result as `kind`."""
        raw = await self.call(object_id, method, args, deadline=OBSERVE_WITHIN)
        try:
            return msgspec.json.decode(raw, type=kind)
        except msgspec.MsgspecError as error:
            raise Arcor2Error(f"{method} gave something else than it should.", str(error)) from error

    async def robot_joints(self, robot_id: str, arm_id: str | None = None, *, gripper: bool = False) -> list[Joint]:
        """Give the present joint values of a robot."""
        args: dict[str, Any] = {"include_gripper": gripper} | self.arm(robot_id, arm_id)
        joints: list[Joint] = await self.ask(list[Joint], robot_id, "robot_joints", args)
        return joints

    async def end_effector_pose(self, robot_id: str, end_effector: str, arm_id: str | None = None) -> Pose:
        """Give the present pose of an end effector in the world."""
        arm = self.arm(robot_id, arm_id)
        if end_effector not in await self.ask(set[str], robot_id, "get_end_effectors_ids", arm):
            raise RequestRefused(f"{self.robot(robot_id).name} has no end effector {end_effector!r}.")
        args = {"end_effector": end_effector} | arm
        pose: Pose = await self.ask(Pose, robot_id, "get_end_effector_pose", args)
        return pose

    async def object_pose_changed(self, object_id: str, pose: Pose) -> None:
        """Tell the live instance that it stands elsewhere."""
        await self.call(object_id, "set_pose", {"pose": pose}, deadline=OBSERVE_WITHIN)

    def robot(self, robot_id: str) -> SceneObject:
        """Give the scene object of a robot; NotFound, RequestRefused when it is none."""
        found = self._services.session.scene_object(robot_id)
        if not self._services.types.derives_from(found.type, "Robot"):
            raise RequestRefused(f"{found.name} is not a robot.")
        return found

    def arm(self, robot_id: str, arm_id: str | None) -> dict[str, Any]:
        """Give the argument that names the arm; RequestRefused unless it is there exactly for multi-arm robots."""
        robot = self.robot(robot_id)
        multi_arm = self._services.types.robot_meta(robot.type).multi_arm
        if multi_arm and arm_id is None:
            raise RequestRefused(f"{robot.name} has several arms: name one.")
        if not multi_arm and arm_id is not None:
            raise RequestRefused(f"{robot.name} has one arm: do not name it.")
        return {} if arm_id is None else {"arm_id": arm_id}

    def say(self, message: m.ToHost) -> None:
        """Tell the scene's host, when there is one."""
        if self._host is not None:
            self._host.send(message)

    # -------------------------------------------------------------------------------- in the background
    def spawn(self, work: Any, name: str) -> None:
        """Run what goes on after a request was answered."""
        task = asyncio.create_task(work, name=name)
        self._background.add(task)
        task.add_done_callback(self._background.discard)

    def action_ended(self, action: RunningAction, results: list[str] | None, error: str | None) -> None:
        """Forget the running action, keep its results, and tell everybody unless it was cancelled."""
        self.running_action = None
        if results is not None and self.online:
            self.results[action.action_id] = results
        if not action.cancelled:
            data = ActionResultData(action.action_id, results or UNSET, error or UNSET)
            self._services.hub.broadcast(Event("ActionResult", data=data))


OBSERVE_WITHIN: Final = 5.0
"""Seconds for reading a value; a device on a local network answers within one."""
