"""The client interfaces of the fake controller, with plain sockets: primary, secondary and real-time port."""

import socket
import struct
from itertools import pairwise

import pytest

from arcor2_fakes.control import parse_address


class Client:
    """A client of a port whose messages begin with their length."""

    def __init__(self, fake, port):
        self.socket = socket.create_connection(parse_address(fake.ready[port]), 5.0)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.socket.close()

    def read(self, size):
        data = b""
        while len(data) < size:
            more = self.socket.recv(size - len(data))
            assert more, "the fake closed the connection"
            data += more
        return data

    def message(self):
        head = self.read(4)
        return head + self.read(struct.unpack(">I", head)[0] - 4)

    def state(self):
        """Return the packages of the next robot state by type, without their headers."""
        while (message := self.message())[4] != 16:
            pass
        packages, at = {}, 5
        while at < len(message):
            size, kind = struct.unpack_from(">IB", message, at)
            packages[kind] = message[at + 5 : at + size]
            at += size
        assert at == len(message)
        return packages

    def robot_message(self, kind):
        """Return the content of the next message of a type, after time stamp, source and type."""
        while True:
            message = self.message()
            if message[4] == 20 and message[14] == kind:
                return message[15:]


@pytest.mark.parametrize("port", ["primary", "secondary", "script"])
def test_each_port_takes_programs(ur, port):
    with Client(ur, port) as client:
        client.socket.sendall(b"set_standard_digital_out(2, True)\n")
        ur.control.wait_until(lambda t: t["digital_outputs"] == 4)
        client.socket.sendall(b"def move():\n  movej([0.2, -1.5, 1.5, -1.5, -1.5, 0], v=3, a=20)\nend\n")
        ur.control.wait_until(lambda t: t["q"][0] == pytest.approx(0.2))
        client.socket.sendall(b"sec aside():\n  set_standard_digital_out(2, False)\nend\n")
        ur.control.wait_until(lambda t: t["digital_outputs"] == 0)


def test_the_real_time_port_sends_each_control_cycle(ur):
    ur.do("place", q=[0.1, -1.5, 1.4, -1.3, -1.2, 0.5])
    ur.do("set_input", bit=5)
    with Client(ur, "script") as client:
        frames = [client.message() for _ in range(200)]
        assert {len(frame) for frame in frames} == {1220}
        times = [struct.unpack_from(">d", frame, 4)[0] for frame in frames]
        assert [round(b - a, 6) for a, b in pairwise(times)] == [0.002] * 199
        values = (None, *struct.unpack_from(">152d", frames[-1], 4))  # counted from 1, as the manual counts columns
        truth = ur.do("truth")
    joints = pytest.approx([0.1, -1.5, 1.4, -1.3, -1.2, 0.5])
    assert list(values[2:8]) == joints
    assert list(values[32:38]) == joints
    assert list(values[56:62]) == pytest.approx(truth["tcp_pose"])
    assert values[86] == 32.0  # digital inputs
    assert values[95] == 7.0  # running
    assert set(values[96:102]) == {253.0}
    assert values[102] == 1.0  # safety mode: normal
    assert list(values[109:112]) == [0.0, 0.0, -9.81]
    assert values[122] == 48.0
    assert values[132] == 1.0  # program stopped
    assert values[139] == 1.0


@pytest.mark.parametrize(
    ("version", "size", "period"), [("3.15", 1108, 0.008), ("5.3", 1108, 0.002), ("5.8", 1116, 0.002)]
)
def test_the_real_time_state_depends_on_the_version(start_ur, version, size, period):
    with Client(start_ur("--controller-version", version), "script") as client:
        frames = [client.message() for _ in range(10)]
    assert {len(frame) for frame in frames} == {size}
    times = [struct.unpack_from(">d", frame, 4)[0] for frame in frames]
    assert [round(b - a, 6) for a, b in pairwise(times)] == [period] * 9


@pytest.mark.parametrize("port", ["primary", "secondary"])
def test_states_are_sent_ten_times_per_second(ur, port):
    with Client(ur, port) as client:
        version = client.robot_message(3)
        assert version[:10] == b"\x09URControl"
        assert version[10:12] == bytes((5, 25))
        client.state()
        states = [client.state() for _ in range(5)]
        assert {kind: len(content) + 5 for kind, content in states[0].items()} == {
            **{0: 47, 1: 251, 2: 37, 3: 74, 4: 101, 5: 225, 7: 61},
        }
        times = [struct.unpack_from(">Q", state[0])[0] for state in states]
        assert [b - a for a, b in pairwise(times)] == [100_000] * 4
        ur.do("place", q=[0.1, -1.5, 1.4, -1.3, -1.2, 0.5])
        ur.do("emergency_stop")
        while not (state := client.state())[0][11]:  # emergency stop
            pass
        assert struct.unpack_from(">d", state[1], 41)[0] == pytest.approx(-1.5)  # actual position of joint 2
        assert list(struct.unpack_from(">6d", state[4])) == pytest.approx(ur.do("truth")["tcp_pose"])
        assert state[0][8:11] == b"\x01\x01\x00"  # connected, enabled, no power
        assert state[0][15] == 3  # robot mode: off


def test_the_primary_port_reports_errors_of_programs(ur):
    with Client(ur, "primary") as primary, Client(ur, "secondary") as secondary:
        primary.state()
        secondary.robot_message(3)
        secondary.socket.sendall(b"def wrong():\n  movej([0, 0])\nend\n")
        assert primary.robot_message(10)[8:] == b"a goal is six numbers"
        secondary.socket.sendall(b"def wrong():\n  not_a_function(1)\nend\n")
        assert b"not_a_function" in primary.robot_message(10)
        assert {secondary.message()[4] for _ in range(3)} == {16}


def test_a_client_that_does_not_read_does_not_delay_others(ur):
    with Client(ur, "script"), Client(ur, "script") as reading:
        times = [struct.unpack_from(">d", reading.message(), 4)[0] for _ in range(1000)]
    assert [round(b - a, 6) for a, b in pairwise(times)] == [0.002] * 999
