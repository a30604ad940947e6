"""Starts fakes as processes of their own and ends them, for tests on the wire."""

import contextlib
import select
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from typing import Any

import msgspec
import pytest

from arcor2_fakes.control import BlockingControlClient

READY_WITHIN = 60.0  # s; imports on a busy machine, of OPC UA above all
ENDS_WITHIN = 5.0  # s


class FakeProcess:
    """A running fake: `ready` holds what its ready line said, `control` speaks to its control channel."""

    def __init__(self, module: str, *arguments: str) -> None:
        self.stderr = tempfile.TemporaryFile("w+")  # noqa: SIM115 - closed in `end`
        self.process = subprocess.Popen(
            [sys.executable, "-m", f"arcor2_fakes.{module}", *arguments], stdout=subprocess.PIPE, stderr=self.stderr
        )
        self._control: BlockingControlClient | None = None
        line = self._first_line()
        if not line.startswith(b"ready "):
            self.end()
            pytest.fail(f"{module} gave {line!r} instead of its ready line, and on stderr: {self.errors!r}")
        self.ready: dict[str, Any] = msgspec.json.decode(line.removeprefix(b"ready "))

    def _first_line(self) -> bytes:
        assert self.process.stdout is not None
        readable, _, _ = select.select([self.process.stdout], [], [], READY_WITHIN)
        return self.process.stdout.readline() if readable else b""

    @property
    def control(self) -> BlockingControlClient:
        if self._control is None:
            self._control = BlockingControlClient(self.ready["control"])
        return self._control

    def truth(self) -> dict[str, Any]:
        data = self.control.do("truth")
        assert isinstance(data, dict)
        return data

    def terminate(self) -> int:
        """End it as an operator would; gives the exit status."""
        self.process.terminate()
        return self.process.wait(ENDS_WITHIN)

    def end(self) -> None:
        if self._control is not None:
            self._control.close()
        if self.process.poll() is None:
            try:
                self.terminate()
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
        assert self.process.stdout is not None
        self.process.stdout.close()
        if not self.stderr.closed:
            self.stderr.seek(0)
            self.errors = self.stderr.read()
            self.stderr.close()


@pytest.fixture
def start_fake() -> Iterator[Callable[..., FakeProcess]]:
    """Gives ``start_fake("functional_tester", "--seed", "1")``; whatever was started is ended after the test."""
    with contextlib.ExitStack() as stack:

        def start(module: str, *arguments: str) -> FakeProcess:
            fake = FakeProcess(module, *arguments)
            stack.callback(fake.end)
            return fake

        yield start


@pytest.fixture
def wait_for() -> Callable[..., Any]:
    """Gives ``wait_for(read, holds, within=5.0)``: asks until the value satisfies `holds`, and returns it."""

    def wait(read: Callable[[], Any], holds: Callable[[Any], bool] = bool, within: float = 20.0) -> Any:
        deadline = time.monotonic() + within
        while not holds(value := read()):
            assert time.monotonic() < deadline, f"not as expected within {within:g} s, last {value!r}"
            time.sleep(0.005)
        return value

    return wait
