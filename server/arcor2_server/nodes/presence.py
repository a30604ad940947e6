"""What a node announces about itself, so that servers and users see which nodes can be used."""

import os
import shutil
import socket
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Final

import msgspec

from arcor2_hw.messages import Message
from arcor2_server.nodes.lanes import PREFIX

PERIOD: Final = 1.0
"""Period of the announcements, s."""


class RunningSession(msgspec.Struct, frozen=True):
    """A session. kind: `scene`, `program` or empty. name: of the scene, or id of the package. age: s."""

    id: str
    kind: str
    name: str
    age: float


class LastError(msgspec.Struct, frozen=True):
    """The last error of a node, and how long ago it happened, s."""

    text: Message
    age: float


class Announcement(msgspec.Struct, frozen=True):
    """An announcement of a node. Ages instead of times, because clocks of computers differ.

    service: random id of this run of the service. age: of the service, s. load: of the last minute, per core. free:
    space of the disk, bytes.
    """

    name: str
    version: str
    computer: str
    service: str
    age: float
    load: float
    free: int
    sessions: list[RunningSession]
    error: LastError | None = None


def presence_subject(node: str) -> str:
    """Return the subject of the announcements of a node; `*` for those of all nodes."""
    return f"{PREFIX}.{node}.presence"


@cache
def own_version() -> str:
    """Return the version of this installation."""
    return version("arcor2-hw")


def computer() -> str:
    """Return the name of this computer."""
    return socket.gethostname()


def load() -> float:
    """Return the average load of the last minute, per processor core."""
    return os.getloadavg()[0] / (os.cpu_count() or 1)


def free_space(directory: Path) -> int:
    """Return the free space of the disk of a directory that may not exist yet, bytes; 0 if it is unknown."""
    while not directory.exists() and directory != directory.parent:
        directory = directory.parent
    try:
        return shutil.disk_usage(directory).free
    except OSError:
        return 0
