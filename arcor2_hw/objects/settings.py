"""Settings of an object type: a dataclass, filled from the scene object's parameters.

Users set the parameters, and the cell host uses them with the rights of the server. Check settings with a port, a URL
or a file by the functions of this module, which raise OutOfRange.
"""

import dataclasses
import math
import os
import stat
import typing
import urllib.parse
from collections.abc import Collection
from pathlib import Path

from arcor2_hw.data.address import HOST
from arcor2_hw.data.device import DEVICE_FILES
from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.messages import Message


@dataclasses.dataclass(frozen=True)
class Range:
    """The range of a number setting, both limits included: `timeout: Annotated[float, Range(0.1, 5.0, "s")] = 1.0`."""

    low: float
    high: float
    unit: str = ""


def within(name: str, value: float, low: float, high: float, unit: str = "") -> None:
    """Raise OutOfRange, which names the parameter, unless a number is finite and in the range."""
    if not (math.isfinite(value) and low <= value <= high):
        raise OutOfRange(
            "{name} must be {low:g} to {high:g}{unit}, not {value!r}",
            name=name,
            low=low,
            high=high,
            unit=unit and " " + unit,
            value=value,
        )


def one_of(name: str, value: object, allowed: Collection[object]) -> None:
    """Raise OutOfRange, which names the parameter, unless a value is one of those allowed."""
    if value not in allowed:
        choices = ", ".join(map(str, allowed))
        raise OutOfRange("{name} must be one of {choices}, not {value!r}", name=name, choices=choices, value=value)


@dataclasses.dataclass
class Settings:
    """Base class of settings: a dataclass with fields of type bool, int, float, str or an enumeration.

    The range of a number is declared in its type (see Range) and checked when the settings are created. A class with
    further checks overrides `__post_init__` and calls `super().__post_init__()` in it.

    Declare a secret by its metadata: `password: str = field(default="", repr=False, metadata={"secret": True})`.
    The server stores its value separately and never sends it to clients. A str whose name indicates a secret
    (`password`, `token`, `api_key`, ...) is treated the same unless its metadata has `"secret": False`.

    A stored secret is sent only to the address that it was entered for. A str whose name indicates an address (`host`,
    `url`, `address`, `port`, ...) is part of that address; metadata `"address": True` or `False` overrides this.

    A setting with metadata `"for_control": True` must be set before the device can be controlled. Its default means
    "not set". The editor asks for it when a device is added, and names it where it is missing.

    The metadata `"found_by"` names the search (arcor2_hw.data.discovery.Search) that finds values of a setting:
    `serial` or `oak` for an address, `can` for the number of a node on the bus of the settings interface, channel and
    bitrate, `ur` or `modbus` for an address in the network, among those that the user enters. The editor then offers
    what it finds.
    """

    def __post_init__(self) -> None:
        hints = typing.get_type_hints(type(self), include_extras=True) if _has_text_ranges(self) else {}
        for field in dataclasses.fields(self):
            for limits in getattr(hints.get(field.name, field.type), "__metadata__", ()):
                if isinstance(limits, Range):
                    within(field.name, getattr(self, field.name), limits.low, limits.high, limits.unit)


def check_host(host: str, port: int = 1) -> None:
    """Check the settings `host`, a name or an address, and `port`."""
    if not HOST.fullmatch(host):
        raise OutOfRange("host must be the name or address of the device, not {host!r}", host=host)
    if not 1 <= port <= 65535:
        raise OutOfRange("port must be 1 to 65535, not {port!r}", port=port)


def check_url(name: str, url: str, *schemes: str) -> urllib.parse.SplitResult:
    """Check a URL of one of the schemes, and return its parts: host, optional port and path, nothing else."""
    allowed: str | Message = f"{schemes[0]}://host:port"
    for scheme in schemes[1:]:
        allowed = Message.of("{first} or {second}", first=allowed, second=f"{scheme}://host:port")
    try:
        parts = urllib.parse.urlsplit(url)
        sound = bool(parts.hostname and HOST.fullmatch(parts.hostname)) and parts.port != 0
    except ValueError:
        raise OutOfRange("{name} must be {allowed}", name=name, allowed=allowed) from None
    if "@" in parts.netloc or parts.query or parts.fragment:
        raise OutOfRange(
            "{name} must be {allowed}, without user, password, query and fragment", name=name, allowed=allowed
        )
    if not sound or parts.scheme not in schemes or not url.startswith(parts.scheme) or not url.isprintable():
        raise OutOfRange("{name} must be {allowed}, not {url!r}", name=name, allowed=allowed, url=url)
    return parts


def check_serial_port(name: str, port: str, *, sockets: bool = True) -> None:
    """Check a serial port: the path of a serial device or, with `sockets`, socket://host:port.

    Other URLs of pyserial are rejected, because some of them write files (spy://) or load classes (alt://).
    """
    if sockets and port.startswith("socket://"):
        parts = check_url(name, port, "socket")
        if parts.port is None or parts.path.strip("/"):
            raise OutOfRange("{name} must be socket://host:port, not {port!r}", name=name, port=port)
        return
    text = (
        "{name} must be the path of a serial device, or socket://host:port, not {port!r}"
        if sockets
        else "{name} must be the path of a serial device, not {port!r}"
    )
    if not port.startswith("/") or "\0" in port:
        raise OutOfRange(text, name=name, port=port)
    try:
        present = Path(port).stat()
    except OSError:
        return  # not plugged in
    if not stat.S_ISCHR(present.st_mode):
        raise OutOfRange(text, name=name, port=port)


def device_file(name: str, path: str) -> str:
    """Check the path of a file or directory, and return it as an absolute path; an empty path stays empty.

    Where DEVICE_FILES is set, the path must be in one of its directories; a relative path starts in the first one.
    """
    directories = _device_files()
    if not path or not directories:
        return path
    found = _normal(directories[0] / path)
    if not any(found.is_relative_to(directory) for directory in directories):
        places = " or ".join(map(str, directories))
        raise OutOfRange(
            "{name} must be in {places}, not {path!r}. Move the file there, or set {device_files}.",
            name=name,
            places=places,
            path=path,
            device_files=DEVICE_FILES,
        )
    return str(found)


def secret_file(name: str, path: str, host: str | None) -> str:
    """Check the path of a file whose content is sent to `host`, as `device_file` does.

    Where DEVICE_FILES is set, the file must be in a directory that is named after the host. A user who changes the host
    in the settings can thus not send the secret of one device to another machine.
    """
    found = device_file(name, path)
    directories = _device_files()
    wanted = (host or "").lower()
    if found and directories and not any(Path(found).is_relative_to(each / wanted) for each in directories if wanted):
        raise OutOfRange(
            "{name} must be in {directorie}, not {path!r}: "
            "a secret is sent only to the host that its directory is named after. Move the file there.",
            name=name,
            directorie=directories[0] / wanted,
            path=path,
        )
    return found


def _has_text_ranges(settings: Settings) -> bool:
    """Return whether ranges are declared in annotations that are text (`from __future__ import annotations`)."""
    return any(isinstance(field.type, str) and "Range(" in field.type for field in dataclasses.fields(settings))


def _device_files() -> list[Path]:
    return [_normal(Path(each)) for each in os.environ.get(DEVICE_FILES, "").split(os.pathsep) if each]


def _normal(path: Path) -> Path:
    """Return a path without `..`; links are kept, because only an administrator creates them."""
    return Path(os.path.normpath(path))
