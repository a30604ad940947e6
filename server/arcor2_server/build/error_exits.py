"""The nodes of a layout: actions. An action with error exits has additional nodes for its success and each exit.

So an exit and the success are branches of the call. The dominator tree then also states where the results are set
(after the success) and where the error is set (after an exit).
"""

from collections.abc import Sequence
from dataclasses import dataclass

from arcor2_server.build.layout import Layout
from arcor2_server.documents.logic_graph import END_NODE, Edge, ErrorExit


@dataclass(frozen=True, slots=True)
class Nodes:
    """The nodes of a layout in topological order.

    Args:
        edges: the edges of each node.
        actions: the action of each node.
        names: suffix after the name of the action in the name of each node; empty for the node of the call.
        call: the node of the call of each action.
        success: the node after the success of each action, the same as `call` without error exits.
        exits: the nodes of the error exits of each action.
    """

    edges: Sequence[tuple[Edge, ...]]
    actions: Sequence[int]
    names: Sequence[str]
    call: Sequence[int]
    success: Sequence[int]
    exits: Sequence[Sequence[int]]

    def has_results(self, layout: Layout, action: int, node: int) -> bool:
        """Return whether the results of an action are set on all paths to a node."""
        return layout.always_before(self.success[action], node)

    def has_error(self, layout: Layout, action: int, node: int) -> bool:
        """Return whether the error of an action is set on all paths to a node."""
        return any(layout.always_before(one, node) for one in self.exits[action])


def nodes_of(edges: Sequence[tuple[Edge, ...]], exits: Sequence[Sequence[ErrorExit]]) -> Nodes:
    """Return the nodes for actions in topological order, by their edges and error exits."""
    count = len(edges)
    if not any(exits):
        numbers = range(count)
        return Nodes(edges, numbers, [""] * count, numbers, numbers, [()] * count)
    call: list[int] = []
    node = 0
    for failing in exits:
        call.append(node)
        node += len(failing) + 2 if failing else 1
    target_of = [*call, END_NODE]  # END_NODE is -1, the last
    made: list[tuple[Edge, ...]] = []
    actions: list[int] = []
    names: list[str] = []
    success: list[int] = []
    exit_nodes: list[range] = []
    for action, failing in enumerate(exits):
        first = call[action]
        after = [edge._replace(target=target_of[edge.target]) for edge in edges[action]]
        if failing:
            last = first + len(failing) + 1
            made.append(tuple(Edge(target, None) for target in range(first + 1, last + 1)))
            made += [(Edge(target_of[one.target], None),) for one in failing]
        else:
            last = first
        made.append(tuple(after))
        actions += [action] * (last - first + 1)
        names += ["", *(f"/{one.kinds[0]}" for one in failing), "/success"] if failing else [""]
        success.append(last)
        exit_nodes.append(range(first + 1, last))
    return Nodes(made, actions, names, call, success, exit_nodes)
