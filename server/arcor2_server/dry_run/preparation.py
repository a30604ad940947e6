"""Prepares the task of a dry run from a project: the graph, the motions, and data of earlier runs."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import msgspec
from msgspec import Struct

from arcor2_hw.compute.dry_run_tasks import ActionMoves, DryRunTask, MovingRobot
from arcor2_hw.compute.program_walk import END_STEP, Edge, Graph, Step, action_of
from arcor2_hw.data.base import UNSET, Unset
from arcor2_hw.data.dry_run import Assumption, DurationSource
from arcor2_hw.data.object_type import ObjectAction
from arcor2_hw.data.project import CALL, Action, Project, ProjectFunction
from arcor2_hw.data.project_index import ProjectIndex
from arcor2_hw.data.robot import Joint
from arcor2_hw.data.rpc import StartDryRunArgs
from arcor2_hw.data.run_trace import RunTrace
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import Arcor2Error, InvalidData, NotFound
from arcor2_hw.messages import Message
from arcor2_server.documents import logic_graph
from arcor2_server.documents.logic_graph import Flow
from arcor2_server.dry_run import past_runs
from arcor2_server.dry_run.motions import UnknownTarget, maxima_of, moves_of


class Device(Struct, frozen=True):
    """An object of the scene.

    Args:
        name: its name.
        type: its object type.
        actions: the actions of the type, by name.
        robot: whether it is a robot.
        model: whether it has a model (URDF) in the collision world.
        settings: its settings with defaults.
        joints: the present joint values of a robot; empty: unknown.
    """

    name: str
    type: str
    actions: Mapping[str, ObjectAction]
    robot: bool = False
    model: bool = False
    settings: Mapping[str, Any] = {}
    joints: Sequence[Joint] = ()


class Experience(Struct, frozen=True):
    """Data of earlier runs.

    Args:
        traces: the traces of the newest runs of the project, the newest first.
        unchanged: the traces of runs since the last edit of project or scene.
        additions: measured additional time of motions compared with their plans, s, by method.
    """

    traces: Sequence[RunTrace]
    unchanged: Sequence[RunTrace]
    additions: Mapping[str, float]


def prepare(
    scene: Scene, project: Project, devices: Mapping[str, Device], earlier: Experience, args: StartDryRunArgs
) -> DryRunTask:
    """Return the task of a dry run. It takes tenths of a second for large projects.

    Args:
        scene: the scene.
        project: the project.
        devices: the objects of the scene, by id.
        earlier: data of earlier runs.
        args: the arguments of the request.

    Raises:
        InvalidProject: the logic of the project is incomplete.
        NotFound: the requested action is not part of the program.
        InvalidData: a requested branch does not exist.
    """
    parameters = {parameter.id for parameter in project.parameters}
    flow = logic_graph.read(project, parameters)
    flows = _called(flow, {function.id: function for function in project.functions}, parameters)
    index = ProjectIndex(scene, project)
    steps = _steps(flow, 0, flows)
    program = len(steps)
    firsts: dict[str, int] = {}
    for key, called in flows.items():
        firsts[key] = len(steps)
        steps += _steps(called, len(steps), flows)
    actions = [action for one in (flow, *flows.values()) for action in one.actions]
    graph = Graph(steps)
    following = {step.action_id: [action_of(graph, edge) for edge in step.edges] for step in steps}
    names = {action.id: action.name for action in actions}
    branches = {} if isinstance(args.branches, Unset) else args.branches
    for action_id, wanted in branches.items():
        if wanted not in following.get(action_id, ()):
            raise InvalidData(
                "The program has no branch from {action} to {next}.",
                action=names.get(action_id, action_id),
                next=names.get(wanted, wanted),
            )
    traces = earlier.traces
    usual = past_runs.branches(traces[0], following) if traces else {}
    moves, assumptions = _moves(actions, index, devices)
    methods = {action.id: _method(action, devices) for action in actions}
    measured = past_runs.durations(earlier.unchanged, {key: one.method for key, one in moves.items()})
    return DryRunTask(
        Graph(steps, branches, usual, firsts),
        {key: device.name for key, device in devices.items()},
        _first(steps[:program], args.from_action),
        {step.device: _moving(devices[step.device], project, step.device) for step in steps if step.action_id in moves},
        moves,
        past_runs.durations(traces, methods),
        {key: one.seconds for key, one in measured.items() if one.source.source is DurationSource.ACTION},
        dict(earlier.additions),
        assumptions,
    )


def _called(program: Flow, functions: Mapping[str, ProjectFunction], parameters: Collection[str]) -> dict[str, Flow]:
    """Return the logic of the functions that a program calls, also through functions."""
    found: dict[str, Flow] = {}
    waiting = [program]
    while waiting:
        for action in waiting.pop().actions:
            key, _, method = action.type.partition("/")
            if method == CALL and key in functions and key not in found:
                found[key] = logic_graph.read(functions[key], parameters)
                waiting.append(found[key])
    return found


def _steps(flow: Flow, first: int, functions: Collection[str]) -> list[Step]:
    """Return the steps of the program or of a function. `first`: number of its first step in the graph."""
    steps = []
    for number, action in enumerate(flow.actions):
        object_id, _, _ = action.type.partition("/")
        branches = flow.parallel.get(number, ())
        # The successor of parallel work, which is after the last branch in the graph of the logic.
        edges = flow.edges[branches[-1] if branches else number]
        function = object_id if object_id in functions else ""
        device = "" if function or branches else object_id
        steps.append(
            Step(
                action.id,
                action.name,
                device,
                [_edge(edge, first) for edge in edges],
                bool(flow.exits[number]),
                function,
                [first + branch for branch in branches],
            )
        )
    return steps


def _edge(edge: logic_graph.Edge, first: int) -> Edge:
    target = END_STEP if edge.target == logic_graph.END_NODE else first + edge.target
    tested = edge.condition
    value = msgspec.json.encode(tested.value).decode() if isinstance(tested, logic_graph.Condition) else UNSET
    return Edge(target, value)


def _first(steps: Sequence[Step], wanted: str | Unset) -> int:
    if isinstance(wanted, Unset):
        return 0
    for number, step in enumerate(steps):
        if step.action_id == wanted:
            return number
    raise NotFound("The program does not execute an action {id}.", id=wanted)


def _method(action: Action, devices: Mapping[str, Device]) -> past_runs.Method:
    object_id, method = action.parse_type()
    device = devices.get(object_id)
    return f"{object_id if device is None else device.type}.{method}"


def _moving(device: Device, project: Project, key: str) -> MovingRobot:
    joints = list(device.joints)
    if not joints:
        stored = (each for point in project.action_points for each in point.robot_joints if each.robot_id == key)
        joints = next((each.joints for each in stored if isinstance(each.arm_id, Unset)), [])
    return MovingRobot(device.name, maxima_of(device.settings), joints)


def _moves(
    actions: Sequence[Action], index: ProjectIndex, devices: Mapping[str, Device]
) -> tuple[dict[str, ActionMoves], list[Assumption]]:
    """Return the motions of actions, and assumptions about those that cannot be planned."""
    found: dict[str, ActionMoves] = {}
    assumptions: list[Assumption] = []
    without_model: dict[str, None] = {}
    for action in actions:
        object_id, method = action.parse_type()
        device = devices.get(object_id)
        declared = None if device is None else device.actions.get(method)
        if device is None or declared is None or not device.robot:
            continue
        try:
            moves = moves_of(action, declared, _method(action, devices), index, device.settings)
        except UnknownTarget:
            text = "The target of {name} is known only in a run, so its motion is not planned."
            assumptions.append(_assumption(Message.of(text, name=action.name), action.id))
            continue
        except (Arcor2Error, msgspec.DecodeError) as error:
            message = Message.of("The motion of {name} is not planned: {reason}", name=action.name, reason=error)
            assumptions.append(_assumption(message, action.id))
            continue
        if moves is not None and not device.model:
            without_model[device.name] = None
        elif moves is not None:
            found[action.id] = moves
    for name in without_model:
        message = Message.of("{name} has no model (URDF), so its motions are not planned.", name=name)
        assumptions.append(_assumption(message))
    return found, assumptions


def _assumption(message: Message, action_id: str | Unset = UNSET) -> Assumption:
    return Assumption(message.text, action_id, **message.translation())
