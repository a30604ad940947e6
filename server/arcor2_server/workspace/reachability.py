"""Reachability of the orientations and joints of the open project, computed in the background."""

import asyncio
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final

import structlog
from msgspec.structs import replace

from arcor2_hw.collision.description import RobotSource, WorldItem
from arcor2_hw.compute.kinematics_tasks import DescribeRobot, JudgeJoints, JudgePoses, ReachResult
from arcor2_hw.compute.task import ComputeStopped
from arcor2_hw.data.base import UNSET, Unset
from arcor2_hw.data.editor import Reach, ReachabilityData, ReachOfItem
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.project import ProjectRobotJoints
from arcor2_hw.data.project_index import global_pose
from arcor2_hw.data.robot import Joint
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.exceptions import Arcor2Error, NotFound
from arcor2_hw.messages import Message
from arcor2_server.compute.workers import Compute
from arcor2_server.documents import Session
from arcor2_server.events import EventHub, make_event
from arcor2_server.hosts.session import HostSession
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.workspace.obstacles import ObstacleRegistry
from arcor2_server.workspace.robot_calibrations import RobotCalibrations
from arcor2_server.workspace.robot_models import RobotModels
from arcor2_server.workspace.robots import SceneRobots, end_effector_link
from arcor2_server.workspace.scene_collisions import SceneCollisions
from arcor2_server.workspace.stopped_robots import PERIOD, StoppedRobots

if TYPE_CHECKING:
    from arcor2_hw.data.rpc.editor import ReachabilityArgs

log = structlog.get_logger(__name__)

NAME: Final = "ReachabilityChanged"
DELAY: Final = 0.05
"""Delay after an edit, s; successive edits are computed once."""
MAX_DELAY: Final = 0.3
"""Maximum delay while further edits arrive, s."""
ANSWER_TIMEOUT: Final = 1.0
"""Time that a request waits for running computations, s."""
DESCRIPTION_TIMEOUT: Final = 10.0
"""Time that a request waits for the list of end effectors, s, which includes the start of a worker."""
BATCH_SIZE: Final = 100
"""Number of poses in one compute task. Other tasks run between two batches."""

Target = Pose | list[Joint]


@dataclass(slots=True)
class _Row:
    """The results for one end effector. `targets`: the poses and joints for which `results` is valid in `world`."""

    robot: str
    end_effector: str
    arm: str | Unset = UNSET
    targets: dict[str, Target] = field(default_factory=dict)
    world: Mapping[str, WorldItem] = field(default_factory=dict)
    results: dict[str, ReachOfItem] = field(default_factory=dict)


class ReachabilityBoard:
    """The reachability of the open project. It is computed only for subscribers, or after a request for it."""

    def __init__(
        self,
        hub: EventHub,
        types: ObjectTypes,
        session: Session,
        host: HostSession,
        compute: Compute,
        collisions: ObstacleRegistry,
        robot_calibrations: RobotCalibrations,
        robots: SceneRobots,
        robot_models: RobotModels,
        scene_collisions: SceneCollisions,
    ) -> None:
        self._hub = hub
        self._types = types
        self._session = session
        self._compute = compute
        self._robots = robots
        self._robot_models = robot_models
        self._scene_collisions = scene_collisions
        self._rows: dict[tuple[str, str], _Row] = {}
        self._effectors: dict[bytes, list[str]] = {}
        self._requested = False
        self._wake = asyncio.Event()
        self._idle = asyncio.Event()
        self._idle.set()
        self._described = asyncio.Event()
        """Set when the rows exist."""
        self._working: asyncio.Task[None] | None = None
        self._stopped = StoppedRobots(host, robots)
        session.on_change.append(lambda edit: self.schedule() if edit is not None else self._reset())
        collisions.on_change.append(self.schedule)
        host.board.on_obstacles_changed.append(self.schedule)
        robot_calibrations.on_change.append(lambda _: self.schedule())

    # -------------------------------------------------------------------------------- requests
    async def ask(self, args: "ReachabilityArgs") -> list[ReachabilityData]:
        """Return the results after a short wait for running computations.

        Raises:
            RequestRefused: No project is open, or the object is not a robot with a model.
            NotFound: The robot, an orientation or joints do not exist.
        """
        self._session.require_project_open()
        project = self._session.require_project()
        chosen = self._chosen(args)
        known = {key for point in project.action_points for key in _items(point)}
        wanted = known if isinstance(args.ids, Unset) else args.ids
        if unknown := sorted(wanted - known):
            raise NotFound("The project has no orientation or joints {unknown!r}.", unknown=unknown[0])
        self._requested = True
        self.schedule()
        for event, within in ((self._described, DESCRIPTION_TIMEOUT), (self._idle, ANSWER_TIMEOUT)):
            try:
                async with asyncio.timeout(within):
                    await event.wait()
            except TimeoutError:
                log.debug("reachability is still being computed")
        rows = [row for row in self._rows.values() if row.robot in chosen and _is_requested(row, args)]
        return [self._data(row, self._items_of(row, wanted)) for row in rows]

    def _chosen(self, args: "ReachabilityArgs") -> set[str]:
        if isinstance(args.robot_id, Unset):
            return {robot.id for robot in self._robots.with_models()}
        robot = self._robots.robot(args.robot_id)
        self._robot_models.require(robot, "to compute its reachability")
        return {robot.id}

    def _items_of(self, row: _Row, wanted: set[str]) -> list[ReachOfItem]:
        """Return the results of a row for the requested ids, without joints of other robots."""
        project = self._session.require_project()
        own = {orientation.id for point in project.action_points for orientation in point.orientations}
        own |= {each.id for point in project.action_points for each in point.robot_joints if _is_of(each, row)}
        return [row.results.get(key, ReachOfItem(key, Reach.UNKNOWN)) for key in sorted(wanted & own)]

    def _data(self, row: _Row, items: list[ReachOfItem]) -> ReachabilityData:
        return ReachabilityData(row.robot, row.end_effector, self._session.revision, items, row.arm)

    # -------------------------------------------------------------------------------- schedule
    @property
    def _wanted(self) -> bool:
        return self._requested or bool(self._hub.subscribers(NAME))

    def schedule(self) -> None:
        """Compute changed items after a short delay."""
        if not self._wanted or self._session.project is None:
            return
        self._idle.clear()
        self._wake.set()
        if self._working is None:
            self._working = asyncio.create_task(self._work(), name="reachability")

    def _reset(self) -> None:
        """Drop all results, since another document was opened or closed."""
        self._requested = False
        self._stop()
        self.schedule()

    def _stop(self) -> None:
        if self._working is not None:
            self._working.cancel()
            self._working = None
        self._rows.clear()
        self._effectors.clear()
        self._stopped.forget()
        self._wake.clear()
        self._described.set()  # wakes the waiting requests
        self._described = asyncio.Event()
        self._idle.set()

    async def close(self) -> None:
        """Cancel the computation."""
        working = self._working
        self._stop()
        if working is not None:
            await asyncio.gather(working, return_exceptions=True)

    async def _work(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            await self._changed()
            since = loop.time()
            while self._wake.is_set() and loop.time() < since + MAX_DELAY:
                self._wake.clear()
                await asyncio.sleep(DELAY)
            self._wake.clear()
            try:
                await self._compute_all()
            except Exception:
                log.exception("reachability failed")
            if not self._wake.is_set():
                self._idle.set()

    async def _changed(self) -> None:
        """Wait for a change of the document, or of the joints of stopped robots."""
        while not self._wake.is_set():
            try:
                async with asyncio.timeout(PERIOD):
                    await self._wake.wait()
            except TimeoutError:
                if self._wanted and await self._moved():
                    self.schedule()

    async def _moved(self) -> bool:
        try:
            return await self._stopped.update(self._neighbours())
        except Exception:
            log.exception("joints of robots cannot be read")
            return False

    def _neighbours(self) -> list[SceneObject]:
        """Return the robots with a model if there are several, else an empty list."""
        found = self._robots.with_models()
        return found if len(found) > 1 else []

    # -------------------------------------------------------------------------------- computation
    async def _compute_all(self) -> None:
        robots = self._robots.with_models()
        await self._stopped.update(self._neighbours())
        ids = {robot.id for robot in robots}
        for key in [key for key in self._rows if key[0] not in ids]:
            del self._rows[key]
        problems = {robot.id: await self._describe(robot) for robot in robots}
        self._described.set()
        poses = await self._poses()
        for robot in robots:
            problem = problems[robot.id]
            # Robots with an unusable model or with unknown joints are not obstacles.
            others = [
                one for one in robots if one is not robot and not problems[one.id] and one.id in self._stopped.joints
            ]
            for row in [row for row in self._rows.values() if row.robot == robot.id]:
                await self._update(row, [robot, *others], poses | self._joints(row), problem)
            if self._wake.is_set():
                return  # the next computation uses the new state

    async def _describe(self, robot: SceneObject) -> Message | None:
        """Update the rows of a robot; return the reason if its model cannot be used, otherwise None."""
        model = self._robot_models.find(robot)
        if model is None:
            return None
        try:
            await self._update_rows(robot, model)
        except Arcor2Error as error:
            if not any(row.robot == robot.id for row in self._rows.values()):
                self._rows[robot.id, ""] = _Row(robot.id, "")
            return error.message
        return None

    async def _update_rows(self, robot: SceneObject, model: RobotSource) -> None:
        """Create a row for each end effector of a robot's model, and delete the other rows of the robot."""
        key = repr((model.urdf, sorted(model.settings.items(), key=str))).encode()
        if key not in self._effectors:
            found = await self._compute.run(DescribeRobot(model), background=True)
            self._effectors[key] = found.end_effectors
        several = self._types.robot_meta(robot.type).multi_arm
        wanted: dict[tuple[str, str], _Row] = {}
        for link in self._effectors[key]:
            arm, _, name = link.partition("_") if several else ("", "", link)
            wanted[robot.id, link] = _Row(robot.id, name or link, arm if name and several else UNSET)
        for removed in [key for key in self._rows if key[0] == robot.id and key not in wanted]:
            del self._rows[removed]
        self._rows = {**wanted, **self._rows}

    async def _poses(self) -> dict[str, Target]:
        """Return the orientations of the project as poses in the world. Yields to the event loop between batches."""
        session = self._session
        project = session.project
        found: dict[str, Target] = {}
        for point in project.action_points if project is not None else ():
            for orientation in point.orientations:
                try:
                    bare, named = session.document.orientation(orientation.id)
                    found[orientation.id] = global_pose(session.document, bare, named.orientation)
                except NotFound:
                    continue  # removed meanwhile
                if len(found) % BATCH_SIZE == 0:
                    await asyncio.sleep(0)
        return found

    def _joints(self, row: _Row) -> dict[str, Target]:
        """Return the joints of the project for the arm of an end effector."""
        project = self._session.project
        points = project.action_points if project is not None else ()
        return {each.id: each.joints for point in points for each in point.robot_joints if _is_of(each, row)}

    async def _update(
        self, row: _Row, robots: list[SceneObject], targets: dict[str, Target], problem: Message | None
    ) -> None:
        """Compute new and possibly changed items. `robots`: the robot, and those with which it may collide."""
        for removed in row.results.keys() - targets.keys():
            del row.results[removed]
            row.targets.pop(removed, None)
        joints = {key: values for key, values in self._stopped.joints.items() if key != row.robot}
        world = self._scene_collisions.world(robots, joints)
        if world != row.world:
            row.targets.clear()
            row.world = world
        new = {key: target for key, target in targets.items() if row.targets.get(key) != target}
        if problem is not None:
            self._note(row, {key: ReachResult(Reach.UNKNOWN, problem) for key in new}, targets)
            return
        for kind in (list, Pose):
            of_kind = [key for key, target in new.items() if isinstance(target, kind)]
            for start in range(0, len(of_kind), BATCH_SIZE):
                batch = of_kind[start : start + BATCH_SIZE]
                try:
                    judged = await self._judge(row, [new[key] for key in batch])
                except Arcor2Error as error:
                    judged = [ReachResult(Reach.UNKNOWN, error.message)] * len(batch)
                self._note(row, dict(zip(batch, judged, strict=True)), targets)
                if self._wake.is_set():
                    return

    async def _judge(self, row: _Row, targets: list[Any]) -> list[ReachResult]:
        """Compute the reachability of poses or joints in the worker."""
        effector = end_effector_link(row.end_effector, row.arm)
        joints = isinstance(targets[0], list)
        task = JudgeJoints(row.robot, targets) if joints else JudgePoses(row.robot, effector, targets)
        run, place = self._compute.run, f"reach of {row.robot}"
        try:
            return await run(task, world=row.world, place=place, background=True)
        except ComputeStopped:
            # Another task may have crashed the worker, so try once more.
            return await run(task, world=row.world, place=place, background=True)

    def _note(self, row: _Row, judged: dict[str, ReachResult], targets: dict[str, Target]) -> None:
        """Store the results and publish those that changed."""
        changed = []
        for key, one in judged.items():
            item = ReachOfItem(key, one.reach)
            if one.reason is not None:
                reason = self._scene_collisions.named(one.reason)
                item = replace(item, reason=reason.text, **reason.translation())
            row.targets[key] = targets[key]
            if row.results.get(key) != item:
                row.results[key] = item
                changed.append(item)
        if changed:
            self._hub.broadcast(make_event(NAME, self._data(row, changed)))


def _items(point: Any) -> set[str]:
    return {each.id for each in (*point.orientations, *point.robot_joints)}


def _is_of(joints: ProjectRobotJoints, row: _Row) -> bool:
    """Return whether joints belong to the robot of an end effector, and to its arm if they name one."""
    if joints.robot_id != row.robot:
        return False
    return isinstance(joints.arm_id, Unset) or isinstance(row.arm, Unset) or joints.arm_id == row.arm


def _is_requested(row: _Row, args: "ReachabilityArgs") -> bool:
    arm = isinstance(args.arm_id, Unset) or args.arm_id == row.arm
    return arm and (isinstance(args.end_effector_id, Unset) or args.end_effector_id == row.end_effector)
