"""What is read: a source file, and how its problems are told."""

from pathlib import Path

import humps

from arcor2_hw.data.base import Data


def module_name(type_name: str) -> str:
    """Give the name of the module that holds an object type: `DobotM1` -> `dobot_m1` (protocol, 9.1).

    A name made only of capitals and digits stays as it is.
    """
    return str(humps.depascalize(type_name))


Stamp = tuple[int, int]
"""Time of the last change in ns, and size in bytes, of a file: what tells a changed one apart without reading it."""


def stamp_of(path: Path) -> Stamp | None:
    """Return the stamp of a file, None if it cannot be found or reached."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size


class SourceFile(Data, frozen=True):
    """The whole Python module of an object type, as text or as the bytes of its file.

    name: the class; empty for a file that is only needed by others. module: dotted name; uploaded types are neighbours
    of each other (`module_name(name)`), those of a distribution have their full name. path: where it lies, empty when
    it lies nowhere; it is shown in problems, and neighbours are looked for beside it.
    """

    name: str
    module: str
    source: str | bytes
    path: str = ""
    is_package: bool = False


class Problem(Data, frozen=True):
    """What is wrong with a source, and where."""

    text: str
    path: str
    line: int

    def __str__(self) -> str:
        return f"{self.path}:{self.line}: {self.text}"


class Broken(Exception):
    """Reading cannot go on; it never leaves the analysis."""

    def __init__(self, text: str, path: str, line: int) -> None:
        super().__init__(text)
        # Text may come out of the source; lone surrogates could never be sent to a client.
        self.problem = Problem(sendable(text), sendable(path), line)


def sendable(text: str) -> str:
    """Give `text` without what UTF-8 cannot hold."""
    return text.encode("utf-8", "replace").decode("utf-8")
