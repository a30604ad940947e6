"""Where each action stands in the text: a graph without loops as nested blocks, each action once, in linear time.

An action that one edge leads to stands right behind that edge. One that several lead to (a join) stands once, behind
the branching of its immediate dominator: the last action that every way to it passes. So placed, what a block ends with
most often leads to what the text says next, and nothing need be written. Where a way on passes by other joins, the
program notes the action it goes to, and the joins that may be passed by are guarded: they run only if the note names
them.

Placement by the dominator tree: N. Ramsey, Beyond Relooper (ICFP 2022), section 4; Python has no labelled block to
leave, hence the guards. Dominators of a graph in topological order are the nearest common ancestors of all predecessors
(K. D. Cooper, T. J. Harvey, K. Kennedy, A Simple, Fast Dominance Algorithm, 2001), found here by jump pointers in
logarithmic time (E. W. Myers, An applicative random-access stack, 1983).
"""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from arcor2_server.documents.logic_graph import END_NODE, Edge

MAX_NESTING: Final = 12
"""Blocks within blocks that the text may have; deeper ones are moved out. Python itself ends at 100 indentations."""
_NOWHERE: Final = -1


class Tree:
    """A tree that grows by leaves and finds the nearest common ancestor of two nodes in logarithmic time."""

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
        """Return the deepest node that is both, or an ancestor of both."""
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
class Placed:
    """How one action stands in the text.

    joins: what stands behind it in the same block, in order. last: the one branch that is written behind the others
    instead of inside an `else`, or -1. follow: the action that the text says next when a branch of this one ends, -1
    for the end of the cycle. guarded: it runs only if the note names it.
    """

    joins: tuple[int, ...]
    last: int
    follow: int
    guarded: bool


@dataclass(frozen=True, slots=True)
class Layout:
    """The whole text. `is_join[n]` tells that n does not stand right behind the edge that leads to it."""

    placed: list[Placed]
    is_join: list[bool]
    nesting: list[int]
    _begin: list[int]
    _end: list[int]

    def always_before(self, earlier: int, later: int) -> bool:
        """Return whether every path to `later` passes `earlier`. Valid for a layout without moved actions."""
        return self._begin[earlier] <= self._begin[later] < self._end[earlier]

    def needs_note(self, source: int, target: int) -> bool:
        """Return whether the edge from `source` to the join `target` needs a note."""
        return target != self.placed[source].follow or self.placed[target].guarded


class _Placing:
    def __init__(self, edges: Sequence[tuple[Edge, ...]], moved: Collection[int]) -> None:
        self.edges = edges
        count = len(edges)
        before: list[list[int]] = [[] for _ in edges]
        for node, ways in enumerate(edges):
            for edge in ways:
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
        """Determine the number of branchings of each subtree, and how far up its exits lead."""
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
        """Return whether every path into a branch ends the cycle, so that none reaches the code after it."""
        if target == END_NODE:
            return True
        return not self.is_join[target] and self.leads_up_to[target] >= self.tree.depths[target]

    def _last(self, node: int, follow: int) -> int:
        """Choose the branch that is better written behind the other, since the other ends the cycle."""
        ways = self.edges[node]
        if len(ways) != 2:
            return _NOWHERE
        candidates = [
            (self.branchings[flat.target], place, flat.target)
            for place, (flat, other) in enumerate(((ways[0], ways[1]), (ways[1], ways[0])))
            if flat.target != END_NODE and not self.is_join[flat.target] and self._ends(other.target)
        ]
        if not candidates:
            return _NOWHERE
        branchings, _, target = max(candidates)
        # Two short branches that both end the cycle read best side by side.
        return target if branchings or follow != _NOWHERE else _NOWHERE

    def layout(self) -> Layout:
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
            max((begin[e.target] for e in ways if e.target != END_NODE and self.is_join[e.target]), default=-1)
            for ways in self.edges
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
        placed = [Placed(tuple(self.joins[n]), lasts[n], follows[n], guarded[n]) for n in range(count)]
        return Layout(placed, self.is_join, nesting, begin, end)


def _too_deep(layout: Layout, edges: Sequence[tuple[Edge, ...]], parents: Sequence[int]) -> Iterator[int]:
    for node in range(1, len(edges)):
        level = layout.nesting[node]
        if level > layout.nesting[parents[node]] and level % MAX_NESTING == 0:
            yield node


def arrange(edges: Sequence[tuple[Edge, ...]]) -> tuple[Layout, Layout]:
    """Return the layout of a graph, and for `always_before` the one before too deep blocks were moved out."""
    placing = _Placing(edges, ())
    natural = layout = placing.layout()
    moved: set[int] = set()
    while max(layout.nesting) > MAX_NESTING:
        moved.update(_too_deep(layout, edges, placing.tree.parents))
        placing = _Placing(edges, moved)
        layout = placing.layout()
    return layout, natural
