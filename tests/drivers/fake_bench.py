"""Benches of drivers on their fakes. Either the fake injects connection faults, or a recording wire in between."""

import abc
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, ClassVar

from arcor2_fakes.control import BlockingControlClient
from arcor2_hw.objects import Generic, Robot
from arcor2_hw.testing.bench import Bench
from arcor2_hw.testing.fake_bench import FakeFaults
from arcor2_hw.testing.serial_wire import SerialWire
from arcor2_hw.testing.tcp_wire import TcpWire
from tests.fakes.conftest import FakeProcess


class _OnFake(Bench):
    """A driver connected to its fake.

    Attributes:
        module: Module of the fake.
        options: Arguments of the fake.
        link: Name of the link to its serial port; empty for a network device.
        port: Key of its address in the ready line.
        nowhere: Address where nothing answers.
        folder: Directory that exists while the fake runs.
    """

    module: ClassVar[str]
    options: ClassVar[tuple[str, ...]] = ()
    link: ClassVar[str] = ""
    port: ClassVar[str] = "port"
    nowhere: ClassVar[str] = "127.0.0.1:1"
    folder: tempfile.TemporaryDirectory[str]
    fake: FakeProcess
    control: BlockingControlClient

    @abc.abstractmethod
    def build(self, address: str) -> Generic:
        """Return a new, unconnected object for the device at an address."""

    def start(self) -> None:
        self.folder = tempfile.TemporaryDirectory()
        link = ("--link", f"{self.folder.name}/{self.link}") if self.link else ()
        self.fake = FakeProcess(self.module, *link, *self.options)
        self.control = self.fake.control

    def do(self, command: str, **arguments: Any) -> Any:
        return self.control.do(command, **arguments)

    def end(self) -> None:
        self.fake.end()
        self.folder.cleanup()

    @property
    def address(self) -> str:
        return str(self.fake.ready[self.port])

    def make(self) -> Generic:
        return self.build(self.address)

    def absent(self) -> tuple[Generic, str]:
        return self.build(self.nowhere), self.nowhere


class FakeBench(_OnFake, FakeFaults):
    """A driver connected to its fake, which injects connection faults."""


class WiredBench(_OnFake):
    """A driver connected to its fake through a wire that can be cut and is recorded."""

    def start(self) -> None:
        super().start()
        address = super().address
        host, _, port = address.rpartition(":")
        self.wire = SerialWire(address) if self.link else TcpWire(host, [int(port)])
        self.wire.start()

    def end(self) -> None:
        if self.wire is not None:
            self.wire.close()
        super().end()

    @property
    def address(self) -> str:
        assert self.wire is not None
        return self.wire.address


class ControllerBench(FakeFaults):
    """An arm on its fake controller, which has an address of its own and injects connection faults."""

    fake: Any
    """The fake, with `host`, `do`, `end` and `reset`."""

    def do(self, command: str, **arguments: Any) -> Any:
        return self.fake.do(command, **arguments)

    def end(self) -> None:
        self.fake.end()

    def reset(self) -> None:
        self.fake.reset()

    @property
    def address(self) -> str:
        return str(self.fake.host)

    @abc.abstractmethod
    def turn(self, device: Generic, by: float) -> object:
        """Turn a joint, and return the result of the motion."""

    def observe(self, device: Generic) -> object:
        assert isinstance(device, Robot)
        return device.robot_joints()

    def ask(self, device: Generic) -> object:
        return self.turn(device, 0.1)

    def command(self, device: Generic) -> object:
        return self.turn(device, 0.1)

    def run_long(self, device: Generic) -> object:
        return self.turn(device, 3.0)

    @contextmanager
    def foreign(self) -> Iterator[None]:
        self.do("foreign_program", on=True)
        try:
            yield
        finally:
            self.do("foreign_program", on=False)
