"""The simulated devices of the demo: their start commands and their addresses in the scene."""

import contextlib
import random
import socket
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

from msgspec import Struct

from arcor2_server.demo.processes import ChildFailed, python_module
from arcor2_server.demo.workplace import Scalar

Ready = Mapping[str, Any]
"""The content of a fake's ready line."""

_UR_PORTS: Final = (30004, 30003, 29999)
_FAST: Final = ("--time-scale", "3")
_PICTURES: Final = ("--width", "640", "--height", "360", "--fps", "5")
"""Picture size that shows boards on the conveyor. It is small, because the whole cell must run on two cores."""


class Fake(Struct, frozen=True):
    """A simulated device.

    Args:
        name: its name in the demo.
        module: its module.
        arguments: its arguments.
        wire: the key of its address in the ready line.
        settings: returns the settings of the scene object from the ready line.
        role: its name in the simulated world; empty if the world does not need it.
        low_priority: run it with low priority, since it needs much processor time.
    """

    name: str
    module: str
    arguments: tuple[str, ...]
    wire: str
    settings: Callable[[Ready], dict[str, Scalar]]
    role: str = ""
    low_priority: bool = False

    def command(self) -> list[str]:
        """Return the command that starts it."""
        priority = ["nice", "-n", "10"] if self.low_priority else []
        return [*priority, *python_module(self.module, *self.arguments, "--control", "127.0.0.1:0")]


def _host_and_port(name: str, key: str) -> Callable[[Ready], dict[str, Scalar]]:
    def split(ready: Ready) -> dict[str, Scalar]:
        host, _, port = str(ready[key]).rpartition(":")
        return {f"{name}_host": host, f"{name}_port": int(port)}

    return split


def _plain(name: str, key: str, prefix: str = "") -> Callable[[Ready], dict[str, Scalar]]:
    return lambda ready: {name: f"{prefix}{ready[key]}"}


def fakes(boards: int, seed: int, fast: bool) -> list[Fake]:
    """Return the fakes of a run. With `fast`, machines run three times as fast."""
    robot = free_loopback_address(_UR_PORTS)
    loopback = "127.0.0.1:0"
    speed = _FAST if fast else ()
    order = f"ORDER-{seed:06d}=Controller board:{boards}"
    return [
        Fake("robot", "arcor2_fakes.ur", ("--host", robot), "host", _plain("robot", "host"), "robot"),
        Fake("tester", "arcor2_fakes.functional_tester", speed, "modbus", _host_and_port("tester", "modbus"), "tester"),
        Fake("reader", "arcor2_fakes.barcode_reader", (), "port", _plain("reader", "port"), "reader"),
        Fake("belt", "arcor2_fakes.conveyor", speed, "can", _plain("belt", "can", "socket://"), "conveyor"),
        Fake("io", "arcor2_fakes.remote_io", (), "modbus", _host_and_port("io", "modbus"), "io"),
        Fake(
            "printer", "arcor2_fakes.label_printer", ("--tcp", loopback), "port", _plain("printer", "port"), "printer"
        ),
        Fake("press", "arcor2_fakes.two_axis_robot", speed, "port", _plain("press", "port"), "arm"),
        Fake("camera", "arcor2_fakes.oak_d", _PICTURES, "stream", _plain("camera", "stream"), "camera", True),
        Fake("erp", "arcor2_fakes.erp", ("--order", order), "url", _plain("erp", "url")),
    ]


def wires(started: Mapping[str, tuple[Fake, Ready]]) -> dict[str, str]:
    """Return the address of each device. The tower light is connected to the I/O block."""
    found = {name: str(ready[fake.wire]).removeprefix("socket://") for name, (fake, ready) in started.items()}
    return found | {"tower": found["io"]}


def world_arguments(
    started: Mapping[str, tuple[Fake, Ready]], layout: Path | Any, boards: int, seed: int
) -> tuple[str, ...]:
    """Return the arguments of the simulated world."""
    devices = [
        part for fake, ready in started.values() if fake.role for part in (f"--{fake.role}", str(ready["control"]))
    ]
    return ("--layout", str(layout), *devices, "--boards", str(boards), "--seed", str(seed))


def free_loopback_address(ports: tuple[int, ...] = _UR_PORTS) -> str:
    """Return an address 127.x.y.z on which all `ports` are free. The ports of a UR controller are fixed."""
    for _ in range(100):
        address = f"127.{random.randint(1, 254)}.{random.randint(0, 255)}.{random.randint(1, 254)}"
        with contextlib.ExitStack() as stack:
            try:
                for port in ports:
                    probe = stack.enter_context(socket.socket())
                    probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                    probe.bind((address, port))
            except OSError:
                continue
            return address
    raise ChildFailed("The ports of a UR controller are in use on all tried loopback addresses.")
