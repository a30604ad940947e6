"""FakeBench: a bench whose device is a fake of `arcor2_fakes.registers` in its own process."""

import abc
import contextlib
import json
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from typing import Any, ClassVar

from arcor2_hw.testing.bench import Bench

ANSWER_TIMEOUT = 5.0
"""Time limit of an answer on the control channel, s."""


def modbus_address(address: str) -> dict[str, Any]:
    """Return the settings of a Modbus device (see ModbusSettings) at HOST:PORT, or at the path of a serial port."""
    if address.startswith("/"):
        return {"serial_port": address}
    host, _, port = address.rpartition(":")
    return {"host": host, "port": int(port)}


class FakeFaults(Bench):
    """The faults of the wire, injected by the fake."""

    @abc.abstractmethod
    def do(self, command: str, **arguments: Any) -> Any:
        """Call a command of the control channel of the fake, and return its result."""

    def cut(self) -> None:
        """Make the wire silent."""
        self.do("silence")

    def heal(self) -> None:
        """End the faults of the wire."""
        self.do("heal")

    def reset_link(self) -> None:
        """Reset the connection."""
        self.do("reset")

    def half_frame(self) -> None:
        """Cut off the next answer in the middle."""
        self.do("half_frame")


class FakeBench(FakeFaults):
    """Start the fake, and send faults and commands over its control channel."""

    fake: ClassVar[str]
    """Module of the fake, as in `python -m`."""
    arguments: ClassVar[tuple[str, ...]] = ()
    """Arguments of the fake, such as `--rtu`."""

    def start(self) -> None:
        """Start the fake, which prints its addresses when it is ready."""
        command = [sys.executable, "-m", self.fake, *self.arguments]
        self._process = subprocess.Popen(command, stdout=subprocess.PIPE)  # noqa: S603 - the fake of the driver
        assert self._process.stdout is not None
        ready = json.loads(self._process.stdout.readline().removeprefix(b"ready "))
        self._address = str(ready["address"])
        host, _, port = ready["control"].rpartition(":")
        self._control = socket.create_connection((host, int(port)), ANSWER_TIMEOUT)
        self._answers = self._control.makefile("rb")
        self._one_command = threading.Lock()

    def end(self) -> None:
        """End the fake."""
        self._answers.close()
        self._control.close()
        self._process.terminate()
        self._process.wait(ANSWER_TIMEOUT)
        assert self._process.stdout is not None
        self._process.stdout.close()

    def do(self, command: str, **arguments: Any) -> Any:
        """Call a command of the control channel, from any thread, and return its result."""
        with self._one_command:
            self._control.sendall(json.dumps({"id": 1, "do": command, **arguments}).encode() + b"\n")
            answer = json.loads(self._answers.readline())
        assert answer["ok"], answer
        return answer["data"]

    @property
    def address(self) -> str:
        """Return the address of the fake."""
        return self._address

    def reset(self) -> None:
        """Bring the fake to its state after power on."""
        self.do("heal")
        self.do("rest")

    def writes(self) -> Any:
        """Return everything that was written to the fake."""
        return self.do("truth")["written"]

    @contextlib.contextmanager
    def foreign(self) -> Iterator[None]:
        """Give control to the operator panel in this context."""
        self.do("panel", on=True)
        try:
            yield
        finally:
            self.do("panel", on=False)
