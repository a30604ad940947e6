"""Runs dry runs of the open project in the compute worker, and stores their results."""

import asyncio
from collections import OrderedDict
from collections.abc import Mapping
from datetime import datetime
from typing import Any, Final, Protocol

import msgspec
import structlog
from msgspec import UNSET, Struct
from msgspec.structs import replace

from arcor2_hw.compute.dry_run_tasks import DryRunTask
from arcor2_hw.data.base import Unset, now
from arcor2_hw.data.dry_run import DryRunHead, DryRunState, Prediction
from arcor2_hw.data.editor import Run, TaskKind
from arcor2_hw.data.project import Project
from arcor2_hw.data.rpc import GetDryRunData, ListRunsArgs, StartDryRunArgs
from arcor2_hw.data.run_trace import RunTrace
from arcor2_hw.data.scene import Scene, SceneObject
from arcor2_hw.exceptions import Arcor2Error, Conflict, NotFound
from arcor2_hw.messages import Message
from arcor2_server.collaboration.tasks import Tasks
from arcor2_server.compute.workers import Compute
from arcor2_server.documents import Session
from arcor2_server.dry_run.past_runs import MAX_RUNS
from arcor2_server.dry_run.preparation import Device, Experience, prepare
from arcor2_server.events import EventHub, make_event
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.workspace.robots import SceneRobots
from arcor2_server.workspace.scene_collisions import SceneCollisions

log = structlog.get_logger(__name__)

EVENT: Final = "DryRunChanged"
PLACE: Final = "dry run"
"""Name of the world in the compute worker."""
MAX_STORED: Final = 10
"""Maximum number of stored results."""
SEARCHED_RUNS: Final = 20
"""Number of newest runs among which runs with a trace are searched."""


class RunHistory(Protocol):
    """The history of runs."""

    def find(self, args: ListRunsArgs) -> list[Run]:
        """Return runs, newest first."""

    async def run_trace(self, number: int) -> RunTrace:
        """Return the trace of a run. Raise NotFound if it has none."""


class _Stored(Struct):
    head: DryRunHead
    content: tuple[Any, ...]
    """The checked content. The result is outdated if the content has changed."""
    prediction: Prediction | Unset = UNSET


class DryRuns:
    """The dry runs of the open project, one at a time. Results are stored until the server ends."""

    def __init__(
        self,
        hub: EventHub,
        types: ObjectTypes,
        session: Session,
        tasks: Tasks,
        compute: Compute,
        robots: SceneRobots,
        scene_collisions: SceneCollisions,
        runs: RunHistory,
    ) -> None:
        self._hub = hub
        self._types = types
        self._session = session
        self._tasks = tasks
        self._compute = compute
        self._robots = robots
        self._scene_collisions = scene_collisions
        self._runs = runs
        self._stored: OrderedDict[int, _Stored] = OrderedDict()
        self._additions: dict[str, float] = {}
        """Additional time of motions compared with their plans, s, by method."""
        self._number = 0
        self._preparing = False
        self._running: asyncio.Task[None] | None = None

    async def close(self) -> None:
        """Cancel the dry run in progress."""
        if self._running is not None:
            self._running.cancel()
            await asyncio.gather(self._running, return_exceptions=True)

    # -------------------------------------------------------------------------------- requests
    async def start(self, args: StartDryRunArgs, by: str) -> DryRunHead:
        """Start a dry run of the open project.

        Raises:
            RequestRefused: no project is open.
            Conflict: a dry run is running.
            InvalidProject: the logic is incomplete.
            NotFound: the first action does not exist.
            InvalidData: a requested branch does not exist.
        """
        self._session.require_project_open()
        if self._preparing or self._running is not None:
            raise Conflict("A dry run is running already. Wait until it ends, or cancel it.")
        scene, project = self._session.scene, self._session.require_project()
        assert scene is not None
        self._preparing = True
        revision = self._session.revision
        try:
            task = await self._prepare(scene, project, args)
        finally:
            self._preparing = False
        self._number += 1
        head = DryRunHead(
            self._number,
            project.id,
            project.name,
            revision,
            DryRunState.RUNNING,
            now(),
            by or UNSET,
            args.from_action,
        )
        stored = _Stored(head, _content(scene, project))
        self._put(stored, head)
        self._running = asyncio.create_task(self._work(stored, task), name="dry run")
        return head

    def cancel(self) -> None:
        """Cancel the dry run in progress. Raise Conflict if there is none."""
        if self._running is None:
            raise Conflict("No dry run is running.")
        self._running.cancel()

    def get(self, number: int | None) -> GetDryRunData:
        """Return a dry run: by its number, or the newest one of the open project.

        Raises:
            NotFound: it does not exist, or is no longer stored.
        """
        project = self._session.project
        if number is None:
            own = [one for one in reversed(self._stored.values()) if project and one.head.project_id == project.id]
            found = own[0] if own else None
        else:
            found = self._stored.get(number)
        if found is None:
            raise NotFound("There is no such dry run. Start one.")
        same = [one.head for one in reversed(self._stored.values()) if one.head.project_id == found.head.project_id]
        stored = [head for head in same if head.state is DryRunState.FINISHED]
        return GetDryRunData(found.head, self._outdated(found), stored, found.prediction)

    def _outdated(self, found: _Stored) -> bool:
        scene, project = self._session.scene, self._session.project
        if scene is None or project is None or project.id != found.head.project_id:
            return False
        return _content(scene, project) != found.content

    # -------------------------------------------------------------------------------- work
    async def _work(self, stored: _Stored, task: DryRunTask) -> None:
        head = stored.head
        title = Message.of("Dry run of {name}", name=head.project_name)
        joints = {key: list(robot.joints) for key, robot in task.robots.items()}
        try:
            with self._tasks.running(
                TaskKind.COMPUTATION, title, None if isinstance(head.started_by, Unset) else head.started_by
            ) as shown:
                world = self._scene_collisions.world(self._robots.with_models(), joints)
                answer = await self._compute.run(
                    task, world=world, place=PLACE, on_progress=lambda share, _: shown.at(share)
                )
            self._additions |= answer.additions
            prediction = stored.prediction = self._named(answer.prediction)
            self._put(stored, replace(head, state=DryRunState.FINISHED, cycle=prediction.summary.cycle))
        except asyncio.CancelledError:
            self._put(stored, replace(head, state=DryRunState.CANCELLED))
        except Arcor2Error as error:
            reason = self._scene_collisions.named(error.message)
            self._put(stored, replace(head, state=DryRunState.FAILED, error=reason.text, **reason.translation()))
        except Exception:
            log.exception("dry run failed")
            self._put(stored, replace(head, state=DryRunState.FAILED, error="An error inside the server."))
        finally:
            self._running = None

    def _put(self, stored: _Stored, head: DryRunHead) -> None:
        stored.head = head
        self._stored[head.number] = stored
        if len(self._stored) > MAX_STORED:
            self._stored.popitem(last=False)
        self._hub.broadcast(make_event(EVENT, head))

    async def _prepare(self, scene: Scene, project: Project, args: StartDryRunArgs) -> DryRunTask:
        models = {robot.id for robot in self._robots.with_models()}
        devices = {obj.id: await self._device(obj, models) for obj in scene.objects}
        earlier = await self._earlier(scene, project)
        return await asyncio.to_thread(prepare, scene, project, devices, earlier, args)

    async def _device(self, obj: SceneObject, models: set[str]) -> Device:
        actions = {action.name: action for action in self._types.actions(obj.type)}
        actions |= {
            former: action
            for action in actions.values()
            if not isinstance(action.former_names, Unset)
            for former in action.former_names
        }
        if not self._types.derives_from(obj.type, "Robot"):
            return Device(obj.name, obj.type, actions)
        joints = await self._robots.present_joints(obj)
        return Device(obj.name, obj.type, actions, True, obj.id in models, self._settings(obj), joints)

    def _settings(self, obj: SceneObject) -> Mapping[str, Any]:
        defaults = {
            setting.name: msgspec.json.decode(setting.default_value)
            for setting in self._types.meta(obj.type).settings
            if not isinstance(setting.default_value, Unset)
        }
        return defaults | self._robots.settings_of(obj)

    async def _earlier(self, scene: Scene, project: Project) -> Experience:
        """Return the data of the newest runs of a project."""
        traces: list[RunTrace] = []
        unchanged: list[RunTrace] = []
        edited = max((at for at in (scene.modified, project.modified) if not isinstance(at, Unset)), default="")
        for run in self._runs.find(ListRunsArgs(limit=SEARCHED_RUNS, project_id=project.id)):
            try:
                trace = await self._runs.run_trace(run.number)
            except Arcor2Error:
                continue
            if trace.spans:
                traces.append(trace)
                if edited and not self._session.has_changes and _later(run.started, edited):
                    unchanged.append(trace)
            if len(traces) == MAX_RUNS:
                break
        return Experience(traces, unchanged, self._additions)

    def _named(self, prediction: Prediction) -> Prediction:
        """Replace the ids of objects in the messages of the worker by their names."""
        names = self._scene_collisions
        trace = prediction.trace
        spans = [
            span if isinstance(span.error, Unset) else replace(span, error=names.with_names(span.error))
            for span in trace.spans
        ]
        problem = prediction.problem
        if not isinstance(problem, Unset):
            reason = names.named(problem.as_message(problem.reason))
            problem = replace(problem, reason=reason.text, **reason.translation())
        return replace(prediction, trace=replace(trace, spans=spans), problem=problem)


def _later(timestamp: str, other: str) -> bool:
    """Return whether a timestamp is later than another."""
    return datetime.fromisoformat(timestamp) > datetime.fromisoformat(other)


def _content(scene: Scene, project: Project) -> tuple[Any, ...]:
    """Return what a dry run depends on."""
    return (
        scene.objects,
        project.action_points,
        project.logic,
        project.parameters,
        project.object_overrides,
    )
