"""Start and end fakes in separate processes, for tests on the wire."""

import contextlib
import select
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import IO, Any, Self

import msgspec
import pytest

from arcor2_fakes.control import BlockingControlClient
from tests import waiting
from tests.forking import Forked, Forker

READY_TIMEOUT = 60.0  # s; imports take long on a busy machine, above all OPC UA
END_TIMEOUT = 30.0  # s


IMPORTED_LATER = {"oak_d": ("arcor2_fakes.oak_d.render", "arcor2_fakes.oak_d.sensor")}
"""Modules that a fake imports only when it needs them, in seconds of processor time."""

_forker = Forker()


def start_forked_fake(module: str, arguments: Sequence[str], stderr: IO[Any] | int) -> Forked | subprocess.Popen[bytes]:
    """Start a fake as `python -m arcor2_fakes.MODULE`, forked from a process that has imported it."""
    name = f"arcor2_fakes.{module}"
    return _forker.start(name, arguments, [f"{name}.__main__", *IMPORTED_LATER.get(module, ())], stderr)


def run_fake(module: str, *arguments: str) -> "subprocess.CompletedProcess[str]":
    """Run a forked fake that ends by itself; return its exit status and output."""
    with tempfile.TemporaryFile("w+") as stderr:
        process = start_forked_fake(module, arguments, stderr)
        assert process.stdout is not None
        with process.stdout as stdout:
            output = stdout.read().decode()
        status = process.wait(END_TIMEOUT)
        stderr.seek(0)
        return subprocess.CompletedProcess((module, *arguments), status, output, stderr.read())


class FakeProcess:
    """A running fake: `ready` is its ready line, `control` is a client of its control channel."""

    def __init__(self, module: str | Path, *arguments: str) -> None:
        """Start a module of `arcor2_fakes`, or the file of another fake."""
        self.stderr = tempfile.TemporaryFile("w+")  # noqa: SIM115 - closed in `end`
        self.process: Forked | subprocess.Popen[bytes]
        if isinstance(module, Path):
            command = [sys.executable, str(module), *arguments]
            self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=self.stderr)
        else:
            self.process = start_forked_fake(module, arguments, self.stderr)
        self._control: BlockingControlClient | None = None
        line = self._first_line()
        if not line.startswith(b"ready "):
            self.end()
            pytest.fail(f"{module} gave {line!r} instead of its ready line, and on stderr: {self.errors!r}")
        self.ready: dict[str, Any] = msgspec.json.decode(line.removeprefix(b"ready "))

    def _first_line(self) -> bytes:
        assert self.process.stdout is not None
        readable, _, _ = select.select([self.process.stdout], [], [], READY_TIMEOUT)
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
        """Terminate the fake like an operator; return the exit status."""
        self.process.terminate()
        return self.process.wait(END_TIMEOUT)

    def __enter__(self) -> Self:
        """Open the control channel, so that it stays open for all tests that share the fake."""
        self.truth()
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

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


@contextlib.contextmanager
def fakes_of(module: str, *common: str, **kinds: Sequence[str]) -> Iterator[dict[str, FakeProcess]]:
    """Start a fake per kind with its own options and the common ones."""
    with contextlib.ExitStack() as stack:
        yield {kind: stack.enter_context(FakeProcess(module, *own, *common)) for kind, own in kinds.items()}


@pytest.fixture
def start_fake() -> Iterator[Callable[..., FakeProcess]]:
    """Return ``start_fake("functional_tester", "--seed", "1")``; all started fakes are ended after the test."""
    with contextlib.ExitStack() as stack:

        def start(module: str, *arguments: str) -> FakeProcess:
            fake = FakeProcess(module, *arguments)
            stack.callback(fake.end)
            return fake

        yield start


@pytest.fixture
def wait_for() -> Callable[..., Any]:
    """Return `tests.waiting.wait_for`."""
    return waiting.wait_for
