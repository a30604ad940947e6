"""Arranges an acyclic graph of actions as nested blocks of code in linear time. Each action occurs once.

An action with one incoming edge follows that edge directly. An action with several incoming edges (a join) follows the
branches of its immediate dominator, the last action on all paths to it. In most cases a block then ends right before
the action that runs next, and no jump is needed. Where a path skips other joins, the program stores the name of the
action it continues with in a variable (`frame.NEXT_ACTION`). Joins that may be skipped are guarded: they run only if
the variable contains their name.

The placement by the dominator tree is from N. Ramsey, Beyond Relooper (ICFP 2022), section 4. The guards replace
leaving a labelled block, which Python does not have. The dominator of a node, in topological order, is the nearest
common ancestor of all its predecessors (K. D. Cooper, T. J. Harvey, K. Kennedy, A Simple, Fast Dominance Algorithm,
2001). It is found by jump pointers in logarithmic time (E. W. Myers, An applicative random-access stack, 1983).
"""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from arcor2_server.documents.logic_graph import END_NODE, Edge

MAX_NESTING: Final = 12
"""Maximum nesting of blocks; deeper blocks are moved out. Python allows 100 indentation levels."""
_NOWHERE: Final = -1


class Tree:
    """A tree to which leaves are added. It finds the nearest common ancestor of two nodes in logarithmic time."""

    def __init__(self) -> None:
        self.parents: list[int] = []
        self.depths: list[int] = []
        self._jumps: list[int] = []

    def add(self, parent: int) -> int:
        """Add a leaf and return its number. The first one is the root, whose parent is ignored."""
        node = len(self.parents)
        if node == 0:
            parent, depth, jump = 0, 0, 0
        else:
            depth = self.depths[parent] + 1
            jump = self._jumps[parent]
            equal = self.depths[parent] - self.depths[jump] == self.depths[jump] - self.depths[self._jumps[jump]]
            jump = self._jumps[jump] if equal else parent
        self.parents.append(parent)
        self.depths.append(depth)
        self._jumps.append(jump)
        return node

    def common(self, a: int, b: int) -> int:
        """Return the nearest common ancestor of two nodes; a node counts as its own ancestor."""
        depths, jumps, parents = self.depths, self._jumps, self.parents
        if depths[a] < depths[b]:
            a, b = b, a
        depth = depths[b]
        while depths[a] > depth:
            a = jumps[a] if depths[jumps[a]] >= depth else parents[a]
        while a != b:
            if jumps[a] != jumps[b]:
                a, b = jumps[a], jumps[b]
            else:
                a, b = parents[a], parents[b]
        return a


@dataclass(frozen=True, slots=True)
class ActionPosition:
    """The position of an action in the code.

    Args:
        joins: the joins after it in the same block, in order.
        last: the branch that is written after the others instead of in an `else`; -1 if there is none.
        follow: the next action in the code after a branch of this one; -1 for the end of the cycle.
        guarded: whether it runs only if the variable contains its name.
    """

    joins: tuple[int, ...]
    last: int
    follow: int
    guarded: bool


@dataclass(frozen=True, slots=True)
class Layout:
    """The arrangement of all actions.

    Args:
        placed: the position of each action.
        is_join: whether an action does not directly follow the edge to it.
        nesting: the number of blocks around each action.
    """

    placed: list[ActionPosition]
    is_join: list[bool]
    nesting: list[int]
    _begin: list[int]
    _end: list[int]

    def always_before(self, earlier: int, later: int) -> bool:
        """Return whether all paths to `later` contain `earlier`. Valid only for a layout without moved actions."""
        return self._begin[earlier] <= self._begin[later] < self._end[earlier]

    def sets_next_action(self, source: int, target: int) -> bool:
        """Return whether the edge from `source` to the join `target` stores its name in the variable."""
        return target != self.placed[source].follow or self.placed[target].guarded


class _LayoutBuilder:
    def __init__(self, edges: Sequence[tuple[Edge, ...]], moved: Collection[int]) -> None:
        self.edges = edges
        count = len(edges)
        before: list[list[int]] = [[] for _ in edges]
        for node, outgoing in enumerate(edges):
            for edge in outgoing:
                if edge.target != END_NODE:
                    before[edge.target].append(node)
        self.tree = tree = Tree()
        self.is_join = [False] * count
        self.joins: list[list[int]] = [[] for _ in edges]
        for node in range(count):
            parent = 0
            if node and node not in moved:
                parent, *others = before[node]
                for other in others:
                    parent = tree.common(parent, other)
            tree.add(parent)
            if node and (len(before[node]) > 1 or node in moved):
                self.is_join[node] = True
                self.joins[parent].append(node)
        self._measure()

    def _measure(self) -> None:
        """Count the branching actions of each subtree, and find the smallest depth that its edges lead to."""
        count = len(self.edges)
        self.branchings = [0] * count
        self.leads_up_to = [count] * count
        for node in reversed(range(count)):
            targets = [edge.target for edge in self.edges[node]]
            self.branchings[node] += len(targets) > 1
            up = self.leads_up_to[node]
            for target in targets:
                if target != END_NODE and self.is_join[target]:
                    up = min(up, self.tree.depths[self.tree.parents[target]])
            self.leads_up_to[node] = up
            if node:
                parent = self.tree.parents[node]
                self.branchings[parent] += self.branchings[node]
                self.leads_up_to[parent] = min(self.leads_up_to[parent], up)

    def _ends(self, target: int) -> bool:
        """Return whether all paths of a branch end the cycle, so that none reaches the code after it."""
        if target == END_NODE:
            return True
        return not self.is_join[target] and self.leads_up_to[target] >= self.tree.depths[target]

    def _last(self, node: int, follow: int) -> int:
        """Return the branch to write after the other instead of in an `else`, because the other ends the cycle."""
        outgoing = self.edges[node]
        if len(outgoing) != 2:
            return _NOWHERE
        candidates = [
            (self.branchings[flat.target], place, flat.target)
            for place, (flat, other) in enumerate((outgoing, outgoing[::-1]))
            if flat.target != END_NODE and not self.is_join[flat.target] and self._ends(other.target)
        ]
        if not candidates:
            return _NOWHERE
        branchings, _, target = max(candidates)
        # Two short branches that both end the cycle are more readable as `if` and `else`.
        return target if branchings or follow != _NOWHERE else _NOWHERE

    def layout(self) -> Layout:
        """Return the arrangement."""
        count = len(self.edges)
        order: list[int] = []
        begin = [0] * count
        follows = [_NOWHERE] * count
        lasts = [_NOWHERE] * count
        stack = [(0, _NOWHERE)]
        while stack:
            node, after = stack.pop()
            begin[node] = len(order)
            order.append(node)
            joins = self.joins[node]
            follow = follows[node] = joins[0] if joins else after
            last = lasts[node] = self._last(node, follow)
            stack.extend(zip(reversed(joins), [after, *reversed(joins)], strict=False))
            if last != _NOWHERE:
                stack.append((last, follow))
            inside = follow if last == _NOWHERE else last
            for edge in reversed(self.edges[node]):
                target = edge.target
                if target not in (END_NODE, last) and not self.is_join[target]:
                    stack.append((target, inside))

        end = [0] * count
        furthest = [-1] * count
        for node in reversed(order):
            end[node] = max(end[node], begin[node] + 1)
            if node:
                parent = self.tree.parents[node]
                end[parent] = max(end[parent], end[node])
        own = [
            max((begin[e.target] for e in outgoing if e.target != END_NODE and self.is_join[e.target]), default=-1)
            for outgoing in self.edges
        ]
        for node in reversed(order):
            furthest[node] = max(furthest[node], own[node])
            if node:
                parent = self.tree.parents[node]
                furthest[parent] = max(furthest[parent], furthest[node])
        guarded = [False] * count
        for node, joins in enumerate(self.joins):
            if not joins:
                continue
            passing = own[node]
            for edge in self.edges[node]:
                if edge.target != END_NODE and not self.is_join[edge.target]:
                    passing = max(passing, furthest[edge.target])
            for join in joins:
                guarded[join] = passing > begin[join]
                passing = max(passing, furthest[join])

        nesting = [0] * count
        for node in order[1:]:
            parent = self.tree.parents[node]
            in_branch = len(self.edges[parent]) > 1 and lasts[parent] != node
            deeper = guarded[node] if self.is_join[node] else in_branch
            nesting[node] = nesting[parent] + deeper
        placed = [ActionPosition(tuple(self.joins[n]), lasts[n], follows[n], guarded[n]) for n in range(count)]
        return Layout(placed, self.is_join, nesting, begin, end)


def _too_deep(layout: Layout, edges: Sequence[tuple[Edge, ...]], parents: Sequence[int]) -> Iterator[int]:
    for node in range(1, len(edges)):
        level = layout.nesting[node]
        if level > layout.nesting[parents[node]] and level % MAX_NESTING == 0:
            yield node


def arrange(edges: Sequence[tuple[Edge, ...]]) -> tuple[Layout, Layout]:
    """Return the layout of a graph, and the layout before deep blocks were moved out, for `always_before`."""
    placing = _LayoutBuilder(edges, ())
    natural = layout = placing.layout()
    moved: set[int] = set()
    while max(layout.nesting) > MAX_NESTING:
        moved.update(_too_deep(layout, edges, placing.tree.parents))
        placing = _LayoutBuilder(edges, moved)
        layout = placing.layout()
    return layout, natural
