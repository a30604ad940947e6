"""Nodes: the computers on which the devices of scenes run, and their state."""

from enum import StrEnum, auto
from typing import Annotated, Final

from msgspec import Meta, field

from arcor2_hw.data.base import UNSET, Data, Timestamp, TranslatableData, Unset
from arcor2_hw.messages import Message

NAME: Final = r"[a-z0-9][a-z0-9_-]{0,62}"
"""Pattern of a name of a node. It is part of subjects, in which dots, spaces and wildcards have a meaning."""
NodeName = Annotated[str, Meta(pattern=rf"^({NAME})?$(?!\n)")]
"""Name of a node; empty for none."""


class NodeState(StrEnum):
    """Whether a node can be used."""

    CONNECTED = auto()
    SILENT = auto()
    """The node has not announced itself for some seconds, or never."""
    OTHER_VERSION = auto()
    """The node runs another version than the server, so the server does not use it."""


class NodeSession(Data, frozen=True):
    """The scene or program that runs on a node.

    kind: `scene` or `program`; empty while it is being opened. name: of the scene; of a program, the id of its package.
    since: time of its start.
    """

    kind: str
    name: str
    since: Timestamp


class NodeError(TranslatableData, frozen=True):
    """The last error of a node: its text and time. `key` and `values` translate the text."""

    text: str
    at: Timestamp


class NodeStatus(Data, frozen=True):
    """A node according to its last announcement.

    Attributes:
        name: Its name.
        state: Whether it can be used.
        version: Version of its installation; empty if it has never announced itself.
        computer: Name of the computer.
        since: Start of its service. This and all following fields are omitted if it has never announced itself.
        seen: Time of its last announcement, for a silent node.
        load: Average load of the last minute, per processor core: 1 for as many running tasks as cores.
        free: Free space of its disk, bytes.
        sessions: The scene or program that runs on it.
        error: Its last error since its start.
        objects: Names of the objects of the open scene that run on it.
    """

    name: str
    state: NodeState
    version: str = ""
    computer: str = ""
    since: Timestamp | Unset = UNSET
    seen: Timestamp | Unset = UNSET
    load: float | Unset = UNSET
    free: int | Unset = UNSET
    sessions: list[NodeSession] = field(default_factory=list)
    error: NodeError | Unset = UNSET
    objects: list[str] = field(default_factory=list)


class NodesData(TranslatableData, frozen=True):
    """The nodes of a server.

    Attributes:
        configured: Whether the server uses nodes: it has a broker, or its cell file or the open scene names a node.
        nodes: The nodes by name: those that announced themselves, and those that the open scene or the cell file names.
        assigned: The nodes that the cell file of the server sets, by name of the object. They override those of scenes.
        problem: Reason why the state of the nodes is unknown; `key` and `values` translate it.
        apart: Reason why the objects of the open scene cannot work together across their nodes (`several_nodes`).
    """

    configured: bool
    nodes: list[NodeStatus] = field(default_factory=list)
    assigned: dict[str, str] = field(default_factory=dict)
    problem: str | Unset = UNSET
    apart: Message | Unset = UNSET
