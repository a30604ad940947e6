"""Kinematic calibration of a robot, read from its controller and used by the model."""

import math
import socket
import struct
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import arcor2_drivers
from arcor2_drivers.universal_robots import primary
from arcor2_drivers.universal_robots.primary import calibration_in, parts, read_calibration
from arcor2_drivers.universal_robots.ur5e import UR5e
from arcor2_hw.exceptions import ConnectionLost, DeviceTimeout, NotConnected
from arcor2_hw.kinematics.dh import calibrated, chain, rows_of
from arcor2_hw.kinematics.model import RobotModel

from .conftest import FakeUr, make

NOMINAL_D = [0.1625, 0.0, 0.0, 0.1333, 0.0997, 0.0996]
NONE = [[0.0] * 6 for _ in range(4)]
MODEL = Path(next(iter(arcor2_drivers.__path__))) / "universal_robots" / "urdf" / "ur5e"


@pytest.fixture
def arm(robot: UR5e, fake: FakeUr) -> Iterator[UR5e]:
    yield robot
    fake.do("calibration", deltas=NONE)


def test_the_calibration_is_read_and_used_by_the_model(arm: UR5e, fake: FakeUr) -> None:
    nominal = arm.kinematic_calibration()
    assert [each.d for each in nominal.joints] == NOMINAL_D
    assert [each.a for each in nominal.joints] == [0.0, -0.425, -0.3922, 0.0, 0.0, 0.0]
    assert nominal.joints[4].alpha == -math.pi / 2.0
    assert len(nominal.checksum.split("-")) == 6
    deltas = np.random.default_rng(3).uniform(-1e-3, 1e-3, (4, 6)).tolist()
    deltas[2][1] += 12.0  # of two nearly parallel axes, the offsets are opposite
    deltas[2][2] -= 12.0
    fake.do("calibration", deltas=deltas)
    read = arm.kinematic_calibration()
    assert [each.theta for each in read.joints] == deltas[0]
    rows = rows_of(read)
    rows[1], rows[2] = (rows[at]._replace(alpha=0.0) for at in (1, 2))  # exactly parallel
    model = calibrated(RobotModel.load(MODEL), "tcp", rows)
    q = np.array((0.4, -1.3, 1.1, 0.2, -0.7, 2.0))
    turned = np.diag((-1.0, -1.0, 1.0, 1.0))
    assert np.allclose(model.arm("tcp").forward(q), turned @ chain(rows, q), atol=1e-9)
    off = np.linalg.norm(model.arm("tcp").forward(q)[:3, 3] - RobotModel.load(MODEL).arm("tcp").forward(q)[:3, 3])
    assert 1e-4 < off < 0.02


def test_a_controller_without_calibration_or_answer_is_named(arm: UR5e, fake: FakeUr) -> None:
    fake.do("calibration", deltas=NONE, reported=False)
    with pytest.raises(DeviceTimeout, match=f"{fake.host}:30001"):
        read_calibration(fake.host, timeout=0.3)
    with pytest.raises(NotConnected, match=r"127\.99\.0\.2:30001"):
        read_calibration("127.99.0.2", timeout=0.3)
    with pytest.raises(NotConnected, match="not connected"):
        make("127.99.0.2").kinematic_calibration()


def served(content: bytes) -> tuple[str, threading.Thread, socket.socket]:
    server = socket.create_server(("127.99.0.3", 30001))

    def serve() -> None:
        client, _ = server.accept()
        with client:
            client.sendall(content)

    thread = threading.Thread(target=serve)
    thread.start()
    return "127.99.0.3", thread, server


@pytest.mark.parametrize(
    "content", [b"", b"\0\0\0\1\x10", b"\xff" * 64, struct.pack(">IBIB", 30, 16, 25, 5) + bytes(20)]
)
def test_garbage_on_the_primary_port_is_a_lost_connection(content: bytes) -> None:
    host, thread, server = served(content)
    try:
        with pytest.raises(ConnectionLost, match=r"127\.99\.0\.3:30001"):
            read_calibration(host, timeout=2.0)
    finally:
        thread.join()
        server.close()


def test_messages_in_pieces_are_joined_and_garbage_is_refused() -> None:
    numbers = struct.pack(">6I24dI", *range(6), *([0.1] * 24), 0)
    package = struct.pack(">IB", 5 + len(numbers), 5) + numbers
    whole = struct.pack(">IB", 5 + len(package), 16) + package
    rest, found = b"", []
    for byte in whole * 2:
        some, rest = parts(rest + bytes((byte,)))
        found += some
    assert (found, rest) == ([(16, package)] * 2, b"")
    read = calibration_in(package)
    assert read is not None
    assert read.joints[0].alpha == 0.1
    assert calibration_in(struct.pack(">IB", 9, 0) + bytes(4)) is None
    broken = struct.pack(">6I24dI", *range(6), math.nan, *([0.1] * 23), 0)
    with pytest.raises(ValueError, match="impossible numbers"):
        calibration_in(struct.pack(">IB", 5 + len(broken), 5) + broken)
    with pytest.raises(ValueError, match=f"{primary.MAX_MESSAGE + 1} bytes"):
        parts(struct.pack(">IB", primary.MAX_MESSAGE + 1, 16))
