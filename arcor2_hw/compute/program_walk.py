"""The walk through the logic of a program for a dry run: the actions that one cycle executes, in their order.

Imports no numerics.
"""

import itertools
from collections.abc import Mapping
from typing import Final

from msgspec import field

from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.data.dry_run import Assumption
from arcor2_hw.data.project import END
from arcor2_hw.messages import Message

END_STEP: Final = -1
"""The target of an edge that leads to END."""
OUTSIDE: Final = -1
"""Placeholder for the call around a step of the program itself."""


class Edge(Data, frozen=True):
    """A connection to step number `target`, or END_STEP. value: the value of its condition, as JSON."""

    target: int
    value: str | Unset = UNSET


class Step(Data, frozen=True):
    """An action of the graph.

    Attributes:
        action_id: Id of the action.
        name: Name of the action.
        device: Id of its object; empty for a call of a function and for parallel work.
        edges: Connections to the next steps, in the order in which their conditions are tested.
        exits: Whether it has error exits.
        function: Id of the function that it calls.
        branches: Numbers of the steps that it executes at once.
    """

    action_id: str
    name: str
    device: str
    edges: list[Edge]
    exits: bool = False
    function: str = ""
    branches: list[int] = field(default_factory=list)


class UsualBranch(Data, frozen=True):
    """The branch that a run took most often after an action. next_action: id of the next action, or END."""

    run: int
    next_action: str


class Graph(Data, frozen=True):
    """The logic of a project.

    Attributes:
        steps: The actions, the first one of the program first; then those of functions.
        wanted: The branches requested by the client: id of the action to the id of the next one, or END.
        usual: The branches of the newest run, by id of the action.
        functions: Numbers of the first steps of functions, by id.
    """

    steps: list[Step]
    wanted: dict[str, str] = field(default_factory=dict)
    usual: dict[str, UsualBranch] = field(default_factory=dict)
    functions: dict[str, int] = field(default_factory=dict)


class Visit(Data, frozen=True):
    """An executed step. branch: the value of the condition after which it followed the step before it, as JSON.

    call: number of the visit of the call or of the parallel work around it; OUTSIDE for a step of the program. lane: id
    of the branch of parallel work; empty in the program itself.
    """

    step: int
    branch: str | Unset = UNSET
    call: int = OUTSIDE
    lane: str = ""


class Walk(Data, frozen=True):
    """The executed steps of one cycle in their order, and the assumptions about branches."""

    visits: list[Visit]
    assumptions: list[Assumption]


def walk(graph: Graph, first: int = 0) -> Walk:
    """Walk from a step to END, or to a step that was executed before: every loop ends after one cycle.

    The steps of a function, and those of the branches of parallel work, follow their call. A branch is that requested
    by the client, otherwise that of the newest run, otherwise the first one.

    Args:
        graph: The logic.
        first: Number of the first step.
    """
    visits: list[Visit] = []
    assumptions: list[Assumption] = []
    _walk(graph, first, OUTSIDE, "", frozenset(), visits, assumptions)
    if any(graph.steps[visit.step].exits for visit in visits):
        assumptions.append(Assumption(Message.of("No action fails, so no error exit is taken.").text))
    return Walk(visits, assumptions)


def _walk(
    graph: Graph,
    first: int,
    call: int,
    lane: str,
    callers: frozenset[str],
    visits: list[Visit],
    assumptions: list[Assumption],
) -> None:
    """Append the visits from a step to the end of the program or of a function. `callers`: the functions around it."""
    seen: set[int] = set()
    number, branch = first, UNSET
    while number != END_STEP and number not in seen:
        seen.add(number)
        _visit(graph, Visit(number, branch, call, lane), callers, visits, assumptions)
        edge = _next(graph, number, assumptions)
        number, branch = edge.target, edge.value  # type: ignore[assignment]
    if number in seen:
        step = graph.steps[number]
        message = Message.of("The loop back to {name} ends after one cycle.", name=step.name)
        assumptions.append(_assumption(message, step))


def _visit(
    graph: Graph, visit: Visit, callers: frozenset[str], visits: list[Visit], assumptions: list[Assumption]
) -> None:
    """Append the visit of a step, and those inside it."""
    step = graph.steps[visit.step]
    own = len(visits)
    visits.append(visit)
    for branch in step.branches:
        lane = graph.steps[branch].action_id
        _visit(graph, Visit(branch, call=own, lane=lane), callers, visits, assumptions)
    first = graph.functions.get(step.function)
    if first is not None and step.function not in callers:
        _walk(graph, first, own, visit.lane, callers | {step.function}, visits, assumptions)


def _next(graph: Graph, number: int, assumptions: list[Assumption]) -> Edge:
    step = graph.steps[number]
    if len(step.edges) == 1:
        return step.edges[0]
    by_action = {action_of(graph, edge): edge for edge in reversed(step.edges)}
    usual = graph.usual.get(step.action_id)
    if (edge := by_action.get(graph.wanted.get(step.action_id, ""))) is not None:
        text = "After {name}, the requested branch leads to {next}."
    elif usual is not None and (edge := by_action.get(usual.next_action)) is not None:
        text = "After {name}, the branch leads to {next}, as most often in run {run}."
    else:
        edge = step.edges[0]
        text = "After {name}, the first branch leads to {next}, because no run shows which one is usual."
    following = END if edge.target == END_STEP else graph.steps[edge.target].name
    run = 0 if usual is None else usual.run
    assumptions.append(_assumption(Message.of(text, name=step.name, next=following, run=run), step))
    return edge


def action_of(graph: Graph, edge: Edge) -> str:
    """Return the id of the action to which an edge leads, or END."""
    return END if edge.target == END_STEP else graph.steps[edge.target].action_id


def _assumption(message: Message, step: Step) -> Assumption:
    return Assumption(message.text, step.action_id, **message.translation())


def usual_branches(run: int, executed: list[str], edges: Mapping[str, list[str]]) -> dict[str, UsualBranch]:
    """Return the branch that a run took most often after each action; of several, the one that it took first.

    Args:
        run: Number of the run.
        executed: Ids of the executed actions in their order, of one thread.
        edges: Ids of the actions that may follow each action, or END, after which the first action of the run follows.
    """
    counts: dict[str, dict[str, int]] = {}
    for action, following in itertools.pairwise(executed):
        possible = edges.get(action, [])
        taken = following if following in possible else END if following == executed[0] and END in possible else ""
        if taken:
            counted = counts.setdefault(action, {})
            counted[taken] = counted.get(taken, 0) + 1
    return {
        action: UsualBranch(run, max(counted, key=lambda taken: counted[taken])) for action, counted in counts.items()
    }
