"""Fixtures of fault tests: a refusing port, a delaying relay, a driver in control, a killed host."""

import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TypeVar

import pytest

from arcor2_hw.data.device import Connection
from arcor2_hw.exceptions import DeviceError
from arcor2_hw.objects import Generic
from tests.drivers.relay import Relay
from tests.fakes.conftest import FakeProcess

D = TypeVar("D", bound=Generic)


@contextmanager
def refusing_address() -> Iterator[str]:
    """Return an address at which nothing listens, so that connections are refused."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        yield "{}:{}".format(*taken.getsockname())


@pytest.fixture
def relay(fake: FakeProcess) -> Iterator[Relay]:
    with Relay(fake.ready["modbus"]) as relay:
        yield relay


def in_control(device: D) -> D:
    device.connect()
    device.take_control()
    return device


@contextmanager
def host_process(code: str, *arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    """Start a Python process that a test kills."""
    process = subprocess.Popen([sys.executable, "-c", code, *arguments])
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def connect_after_invalid_answers(fake: FakeProcess, device: Generic, fault: str, error: type[DeviceError]) -> None:
    """Assert that a wire fault ends connecting with an error that names the device, and that it connects afterwards."""
    fake.control.do(fault)
    with pytest.raises(error, match=f"^{device.name} at {fake.ready['modbus']}"):
        device.connect(0.6)
    fake.control.do("heal")
    device.connect()


def disconnect_from_silence(fake: FakeProcess, device: Generic) -> None:
    """Assert that disconnecting from a silent device ends and may be repeated, and that it connects afterwards."""
    fake.control.do("silence")
    device.disconnect()
    assert device.connection is Connection.OFFLINE
    device.disconnect()
    fake.control.do("heal")
    device.connect()
