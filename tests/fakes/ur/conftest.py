"""Fixtures: the fake controller in one process, and ur_rtde in another with a time limit."""

import contextlib
import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from arcor2_hw.testing.addresses import own_loopback
from tests.fakes.conftest import FakeProcess

_PRELUDE = """
import json, os, sys, time
from rtde_control import RTDEControlInterface as Control
from rtde_receive import RTDEReceiveInterface as Receive
from rtde_io import RTDEIOInterface as IO
from dashboard_client import DashboardClient as Dashboard
from arcor2_fakes.control import BlockingControlClient
host = sys.argv[1]
fake = BlockingControlClient(sys.argv[2])
HOME = [0.0, -1.5707963267948966, 1.5707963267948966, -1.5707963267948966, -1.5707963267948966, 0.0]

def report(**values):
    print("RESULT " + json.dumps(values), flush=True)
    os._exit(0)  # the library's own end takes half a second and is not what is tested

def until(holds, within=20.0):
    deadline = time.monotonic() + within
    while not holds():
        if time.monotonic() > deadline:
            report(error="not within %g s: %s" % (within, fake.do("truth")))
        time.sleep(0.002)
"""


class FakeUr(FakeProcess):
    """A running fake controller on its own address."""

    def __init__(self, *options: str) -> None:
        super().__init__("ur", "--host", own_loopback(), *options)

    @property
    def host(self) -> str:
        host: str = self.ready["host"]
        return host

    def do(self, command: str, **arguments: Any) -> Any:
        return self.control.do(command, **arguments)

    def library(self, body: str, within: float = 120.0) -> dict[str, Any]:
        """Run `body` with ur_rtde in a separate process; return its result."""
        run = subprocess.run(
            [sys.executable, "-c", _PRELUDE + body, self.host, self.ready["control"]],
            capture_output=True,
            text=True,
            timeout=within,
        )
        for line in run.stdout.splitlines():
            if "RESULT " in line:  # the library writes to the same stream without line ends
                reported: dict[str, Any] = json.loads(line.partition("RESULT ")[2])
                return reported
        raise AssertionError(f"status {run.returncode}\n{run.stdout[-3000:]}\n{run.stderr[-3000:]}")

    @contextmanager
    def library_running(self, body: str) -> Iterator[subprocess.Popen[bytes]]:
        """Run `body` concurrently with the test, for faults in which the library may hang or crash."""
        run = subprocess.Popen(
            [sys.executable, "-c", _PRELUDE + body, self.host, self.ready["control"]],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            yield run
        finally:
            run.kill()
            run.wait()


@pytest.fixture
def start_ur() -> Iterator[Callable[..., FakeUr]]:
    """Start fake controllers: ``start_ur("--time-scale", "0.1")``. They end after the test."""
    with contextlib.ExitStack() as stack:

        def start(*options: str) -> FakeUr:
            fake = FakeUr(*options)
            stack.callback(fake.end)
            return fake

        yield start


@pytest.fixture
def ur(start_ur: Callable[..., FakeUr]) -> FakeUr:
    """Start a fake UR5e, powered and ready, whose waits are ten times shorter."""
    return start_ur("--time-scale", "0.1")
