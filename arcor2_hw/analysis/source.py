"""Source files, and problems in them."""

from collections.abc import Mapping
from pathlib import Path
from typing import Final

import humps
from msgspec.structs import replace

from arcor2_hw.data.base import Data
from arcor2_hw.data.object_type import ObjectTypeSource
from arcor2_hw.messages import Message

UPLOADED: Final = "object_types"
"""The package of uploaded types."""


def module_name(type_name: str) -> str:
    """Return the name of the module of an object type: `DobotM1` -> `dobot_m1` (protocol, section 9.1).

    A name of capitals and digits only is unchanged.
    """
    return str(humps.depascalize(type_name))


Stamp = tuple[int, int]
"""Modification time in ns and size in bytes of a file, to detect changes without reading it."""


def stamp_of(path: Path) -> Stamp | None:
    """Return the stamp of a file, None if it cannot be found or reached."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size


class SourceFile(Data, frozen=True):
    """The Python module of an object type, as text or as the bytes of its file.

    Attributes:
        name: Name of the class; empty for a file that is only needed by others.
        module: Dotted name; `module_name(name)` for uploaded types, the full name for those of a distribution.
        path: Path of the file, or empty; it is shown in problems, and files are looked for next to it.
        modules: Modules that belong to this type only, with their full names. The type is a package then.
    """

    name: str
    module: str
    source: str | bytes
    path: str = ""
    is_package: bool = False
    modules: "tuple[SourceFile, ...]" = ()

    def with_modules(self, modules: "Mapping[str, SourceFile]") -> "SourceFile":
        """Return an uploaded type with the modules that belong to it, by name."""
        own = tuple(replace(each, name="", module=f"{UPLOADED}.{self.module}.{name}") for name, each in modules.items())
        return replace(self, modules=own, is_package=bool(own))

    @classmethod
    def of_upload(cls, uploaded: ObjectTypeSource) -> "SourceFile":
        """Return the file of an uploaded type."""
        file = cls(uploaded.id, module_name(uploaded.id), uploaded.source)
        return file.with_modules({name: cls("", name, text) for name, text in uploaded.own_modules.items()})


class Problem(Data, frozen=True):
    """An error in a source, and its place. `str(problem)` contains both."""

    what: Message
    path: str
    line: int

    @property
    def message(self) -> Message:
        """The error with its place."""
        return Message.of("{path}:{line}: {problem}", path=self.path, line=self.line, problem=self.what)

    def __str__(self) -> str:
        return self.message.text


class AnalysisStopped(Exception):
    """Reading cannot continue. The analysis catches this error.

    Args:
        message: The message; with values its template.
        values: Values of the fields of the template, by name.
    """

    def __init__(self, message: str | Message, path: str, line: int, /, **values: object) -> None:
        self.message = _sendable(message if isinstance(message, Message) else Message.of(message, **values))
        super().__init__(self.message.text)
        self.problem = Problem(self.message, sendable(path), line)

    def within(self, template: str, /, **values: object) -> "AnalysisStopped":
        """Return this error as `reason` of another message about the same place."""
        return AnalysisStopped(template, self.problem.path, self.problem.line, **values, reason=self)


def _sendable(message: Message) -> Message:
    """Return a message without the lone surrogates of a source, which could not be sent to a client."""
    values = {
        name: _sendable(value) if isinstance(value, Message) else sendable(value)
        for name, value in message.values.items()
    }
    return Message(sendable(message.text), sendable(message.key), values)


def sendable(text: str) -> str:
    """Return `text` without characters that UTF-8 cannot encode."""
    return text.encode("utf-8", "replace").decode("utf-8")
