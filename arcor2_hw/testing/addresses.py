"""Places: the address of a device in its settings, whether it is on this machine, and a wire to it."""

import ipaddress
import itertools
import os
import urllib.parse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from arcor2_hw.data.base import Data
from arcor2_hw.testing.serial_wire import SerialWire
from arcor2_hw.testing.tcp_wire import TcpWire
from arcor2_hw.testing.wire import Wire

HOSTS: Final = ("host", "hostname", "address", "ip")
SERIAL: Final = ("port", "serial_port", "device", "channel", "path")
OTHER: Final = ("interface", "channel", "serial", "mxid")
"""Settings of a device that is neither on TCP nor on a serial port: a CAN interface, a camera on USB."""
PORT_OF: Final = {"http": 80, "opc.tcp": 4840, "ws": 80}
_numbers = itertools.count(1)


class Place(Data, frozen=True):
    """The address of a device.

    Attributes:
        settings: The settings with the address: host and port, or one of them.
        ports: TCP ports.
    """

    settings: tuple[str, ...]
    host: str = ""
    ports: tuple[int, ...] = ()
    path: str = ""
    url: str = ""

    @property
    def here(self) -> bool:
        """Return whether it must be a simulation on this machine: on loopback, or a pseudo terminal."""
        if self.path:
            return os.path.realpath(self.path).startswith("/dev/pts/")
        if self.host.lower() == "localhost":
            return True
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return False

    @property
    def fixed(self) -> bool:
        """Return whether the device has fixed ports, so that its settings contain only the host."""
        return bool(self.ports) and len(self.settings) == 1 and not self.url

    @property
    def error_text(self) -> str:
        """Return the text that an error has to contain."""
        if self.path:
            return self.path
        return str(self.ports[0]) if len(self.settings) == 2 or self.url else self.host

    def wire(self) -> Wire | None:
        """Return a wire to it, not started; None when no wire is possible."""
        if self.path:
            return SerialWire(self.path)
        if not self.ports:
            return None
        if self.fixed:
            return TcpWire(self.host, self.ports, own_loopback(), fixed=True)
        return TcpWire(self.host, self.ports)

    def moved(self, host: str, port: int, path: str) -> dict[str, Any]:
        """Return the settings for the same device at another address."""
        if self.path:
            return {self.settings[0]: path}
        if self.url:
            parts = urllib.parse.urlsplit(self.url)
            return {self.settings[0]: urllib.parse.urlunsplit(parts._replace(netloc=f"{host}:{port}"))}
        return dict(zip(self.settings, (host, port), strict=False))

    def behind(self, wire: Wire) -> dict[str, Any]:
        """Return the settings that lead to the device through a wire."""
        if isinstance(wire, TcpWire):
            return self.moved(wire.host, wire.ports[0], "")
        return self.moved("", 0, wire.address)


def own_loopback() -> str:
    """Return an address of this machine that no other process of a test run uses."""
    number = next(_numbers)
    return f"127.{64 + os.getpid() % 32}.{os.getpid() // 32 % 250}.{number % 250 + 1}"


def places(settings: Mapping[str, Any], named: Sequence[str | int] = ()) -> list[Place]:
    """Return the addresses of a device in its settings.

    Args:
        settings: The settings.
        named: Settings to use, and fixed ports; default: all settings.

    Raises:
        KeyError: A name is not a setting.
    """
    keys = [each for each in named if isinstance(each, str)]
    fixed = tuple(each for each in named if isinstance(each, int))
    chosen = {key: settings[key] for key in keys} if keys else dict(settings)
    found = []
    for key, value in chosen.items():
        if not isinstance(value, str) or not value.strip():
            continue
        if "://" in value:
            found += _of_url(key, value)
        elif key in HOSTS or key.endswith("_host") or (keys and _is_address(value)):
            found.append(_of_host(key, value, chosen, fixed))
        elif value.startswith("/dev/") or ((key in SERIAL or keys) and Path(value).exists()):
            found.append(Place((key,), path=value))
        elif key in OTHER:
            found.append(Place((key,), host=f"{key} {value}"))
    return found


def _is_address(value: str) -> bool:
    try:
        ipaddress.ip_address(value)
    except ValueError:
        return value.lower() == "localhost"
    return True


def _of_url(key: str, value: str) -> list[Place]:
    try:
        parts = urllib.parse.urlsplit(value)
        port = parts.port or PORT_OF.get(parts.scheme)
    except ValueError:
        return []
    if not parts.hostname:
        return []
    return [Place((key,), host=parts.hostname, ports=() if port is None else (port,), url=value)]


def _of_host(key: str, value: str, settings: Mapping[str, Any], fixed: tuple[int, ...]) -> Place:
    for other in (key.removesuffix("host") + "port", "port"):
        if isinstance(number := settings.get(other), int) and not fixed:
            return Place((key, other), host=value, ports=(number,))
    numbers = [value for value in settings.values() if isinstance(value, int)]
    if len(settings) == 2 and len(numbers) == 1 and not fixed:  # both are named
        return Place(tuple(settings), host=value, ports=(numbers[0],))
    return Place((key,), host=value, ports=fixed)
