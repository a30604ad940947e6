"""Placement: the computer on which each object of a scene runs."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Final

from arcor2_hw.data.cell import Cell, node_of
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.exceptions import SeveralNodes
from arcor2_hw.messages import Message

BODY: Final = "VirtualCollisionObject"
"""Base of the types of obstacles and zones, which are no devices."""
TOGETHER: Final = ("Robot", "HoldsParts")
"""Bases of the types whose objects work together in one process: robots and grippers."""


@dataclass(frozen=True, slots=True)
class Placement:
    """The nodes of the objects of a scene; an empty name is the computer of the server.

    Args:
        main: node of the main host, which has the robots, the interlocks and the program.
        nodes: by id of the object.
        names: names of the objects by id.
    """

    main: str = ""
    nodes: dict[str, str] = field(default_factory=dict)
    names: dict[str, str] = field(default_factory=dict)

    @property
    def all(self) -> list[str]:
        """Return all nodes, the main one first."""
        return list(dict.fromkeys([self.main, *self.nodes.values()]))

    def on(self, node: str) -> str:
        """Return the names of the objects on a node, for messages."""
        return ", ".join(self.names[key] for key, each in self.nodes.items() if each == node)


def place(
    cell: Cell | None,
    objects: Iterable[SceneObject],
    derives: Callable[[str, str], bool],
    running: str | None = None,
) -> Placement:
    """Return the placement of the objects of a scene.

    Robots and grippers determine the node of the main host. Without them, it is the node of most objects; if
    several nodes have equally many, the server is preferred. Obstacles and zones are in the main host.

    Args:
        cell: the cell file, which overrides the nodes of the scene.
        objects: the objects.
        derives: returns whether a type derives from a base class.
        running: node on which the main host already runs, so that the number of objects does not matter.

    Raises:
        SeveralNodes: robots and grippers are on different computers.
    """
    objects = list(objects)
    bodies = {each.id for each in objects if derives(each.type, BODY)}
    nodes = {each.id: node_of(cell, each) for each in objects if each.id not in bodies}
    bound = [each for each in objects if any(derives(each.type, base) for base in TOGETHER)]
    if len({nodes[each.id] for each in bound}) > 1:
        where = [Message.of("{name} ({computer})", name=each.name, computer=shown(nodes[each.id])) for each in bound]
        raise SeveralNodes(
            "The robots and grippers of a scene must run on one computer: {devices}.", devices=Message.listed(where)
        )
    counted = [nodes[each.id] for each in bound] or ([*nodes.values()] if running is None else [running])
    main = max(sorted(set(counted)), key=counted.count, default="")
    return Placement(
        main, {each.id: nodes.get(each.id, main) for each in objects}, {each.id: each.name for each in objects}
    )


def shown(node: str) -> Message:
    """Return the name of a computer for users."""
    return Message.of("node {node}", node=node) if node else Message.of("the computer of the server")
