"""Modbus fakes on the wire: raw requests that no library sends, and the answers that the standard prescribes."""

import os
import select
import socket
import struct
import time
from collections.abc import Callable, Iterator

import pytest

from tests.fakes.conftest import FakeProcess


def crc(data: bytes) -> bytes:
    """Compute the checksum of an RTU frame, bit by bit."""
    value = 0xFFFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0xA001 if value & 1 else 0)
    return struct.pack("<H", value)


class Tcp:
    """A Modbus TCP host."""

    def __init__(self, address: str) -> None:
        host, port = address.split(":")
        self.socket = socket.create_connection((host, int(port)), 5.0)

    def send(self, frames: str) -> None:
        self.socket.sendall(bytes.fromhex(frames))

    def receive(self) -> str:
        head = self._exactly(6)
        return (head + self._exactly(head[5])).hex()

    def ask(self, request: str, unit: int = 1) -> str:
        """Send a function code and data, and return the function code and data of the answer."""
        pdu = bytes.fromhex(request)
        self.socket.sendall(struct.pack(">HHHB", 0x1234, 0, len(pdu) + 1, unit) + pdu)
        answer = bytes.fromhex(self.receive())
        assert answer[:7] == struct.pack(">HHHB", 0x1234, 0, len(answer) - 6, unit)
        return answer[7:].hex()

    def _exactly(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            more = self.socket.recv(count - len(data))
            assert more, "the fake closed the connection"
            data += more
        return data


class Rtu:
    """A Modbus RTU host."""

    def __init__(self, path: str) -> None:
        self.port = os.open(path, os.O_RDWR | os.O_NOCTTY)

    def send(self, frame: str, *, checksum: bool = True) -> None:
        data = bytes.fromhex(frame)
        os.write(self.port, data + crc(data) if checksum else data)

    def receive(self, within: float = 5.0) -> str:
        """Return a frame without its checksum; empty if none arrives in time."""
        data, deadline = b"", time.monotonic() + within
        while len(data) < 4 or crc(data) != b"\0\0":
            if not select.select([self.port], [], [], max(deadline - time.monotonic(), 0.0))[0]:
                assert data == b"", f"incomplete: {data.hex()}"
                return ""
            data += os.read(self.port, 300)
        return data[:-2].hex()


@pytest.fixture(scope="module")
def block() -> Iterator[FakeProcess]:
    """A remote I/O block on TCP; one process serves the tests of this file."""
    with FakeProcess("remote_io") as fake:
        yield fake


@pytest.fixture
def tcp(block: FakeProcess) -> Iterator[Tcp]:
    block.control.do("renew")
    host = Tcp(block.ready["modbus"])
    yield host
    host.socket.close()


@pytest.fixture(scope="module")
def serial_block() -> Iterator[FakeProcess]:
    """A remote I/O block on a pty; one process serves the tests of this file."""
    with FakeProcess("remote_io", "--serial") as fake:
        yield fake


@pytest.fixture
def rtu(serial_block: FakeProcess) -> Iterator[Rtu]:
    serial_block.control.do("renew")
    host = Rtu(serial_block.ready["modbus"])
    yield host
    os.close(host.port)


@pytest.mark.parametrize(
    ("request_", "answer"),
    [
        ("63", "e301"),  # functions that it does not have
        ("63 0001 0002", "e301"),
        ("00", "8001"),
        ("07", "8701"),
        ("2b 0d 01", "ab01"),  # another MEI type
        ("03 0000 0000", "8303"),  # quantities
        ("03 0000 007e", "8303"),
        ("04 0000 0000", "8403"),
        ("04 0000 007e", "8403"),
        ("04 0000 ffff", "8403"),
        ("01 0000 0000", "8103"),
        ("01 0000 07d1", "8103"),
        ("02 0000 07d1", "8203"),
        ("0f 0000 0000 00", "8f03"),
        ("0f 0000 07b1 f7" + 247 * "00", "8f03"),
        ("10 0000 0000 00", "9003"),
        ("10 0000 007c f6" + 246 * "00", "9003"),
        ("17 0000 0000 0000 0001 02 0000", "9703"),
        ("17 0000 0001 0000 0000 00", "9703"),
        ("17 0080 0001 0000 0001 04 0000", "9703"),
        ("17 0000 0001 0080 0001 02 0000", "9702"),
        ("01 0000 0011", "8102"),  # addresses
        ("02 0010 0001", "8202"),
        ("02 ffff 0002", "8202"),
        ("03 007f 0002", "8302"),
        ("04 0011 0001", "8402"),
        ("05 0010 ff00", "8502"),
        ("06 0080 0000", "8602"),
        ("0f 000f 0002 01 03", "8f02"),
        ("10 007f 0002 04 0000 0000", "9002"),
        ("16 0080 ffff 0000", "9602"),
        ("05 0000 0001", "8503"),  # values
        ("05 0000 00ff", "8503"),
        ("05 0000 ff01", "8503"),
        ("05 0010 1234", "8503"),
        ("03 0000", "8303"),  # lengths
        ("03 0000 0001 00", "8303"),
        ("06 0000", "8603"),
        ("0f 0000 0009 01 ff", "8f03"),
        ("0f 0000 0008 01", "8f03"),
        ("10 0000 0001 02 00", "9003"),
        ("10 0000 0001 04 0000 0000", "9003"),
        ("16 0000 ffff", "9603"),
        ("2b 0e", "ab03"),
        ("2b 0e 05 00", "ab03"),
        ("2b 0e 04 40", "ab02"),
    ],
)
def test_exceptions_of_invalid_requests(tcp: Tcp, block: FakeProcess, request_: str, answer: str) -> None:
    assert tcp.ask(request_) == answer
    truth = block.truth()
    assert truth["outputs"] == [False] * 16
    assert truth["writes"] == 0


def test_valid_requests(tcp: Tcp, block: FakeProcess) -> None:
    assert tcp.ask("06 0000 1234") == "0600001234"
    assert tcp.ask("16 0000 00f2 0025") == "16000000f20025"  # mask write
    assert tcp.ask("03 0000 0001") == "03020035"  # (1234h & 00f2h) | (0025h & ~00f2h)
    assert tcp.ask("17 0000 0002 0001 0001 02 8001") == "170400358001"  # writes before it reads
    assert tcp.ask("06 0010 0032") == "0600100032"  # the answer echoes the written value of a pulse
    assert tcp.ask("0f 0000 0003 01 fd") == "0f00000003"
    assert tcp.ask("01 0000 0003") == "010105"  # the other bits of the byte are ignored, and zero
    assert tcp.ask("01 0000 0010") == "01020500"
    assert tcp.ask("2b 0e 01 00").startswith("2b0e01820000030012") is True
    assert tcp.ask("2b 0e 02 02") == "2b0e0282000002" + "0203" + b"2.0".hex() + "0410" + b"Remote I/O block".hex()
    assert tcp.ask("2b 0e 01 63").startswith("2b0e0182000003"), "an unknown first object is the first one"
    assert tcp.ask("2b 0e 04 01") == "2b0e0482000001" + "0106" + b"RIO-16".hex()


def test_units_on_tcp(tcp: Tcp, block: FakeProcess) -> None:
    for own in (0, 1, 255):
        assert tcp.ask("03 0000 0001", own) == "03020000"
    for other in (2, 9, 247):
        assert tcp.ask("05 0000 ff00", other) == "850b"  # gateway: the target device failed to respond
    assert block.truth()["outputs"] == [False] * 16


def test_pipelined_requests_are_answered_in_order(tcp: Tcp) -> None:
    requests = [
        "0001 0000 0006 01 06 0000 0007",
        "0002 0000 0006 01 03 0000 0001",
        "fffe 0000 0006 01 03 0000 0000",
        "0000 0000 0002 01 63",
        "0003 0000 0006 01 06 0000 0008",
        "0004 0000 0006 01 03 0000 0001",
    ]
    tcp.send("".join(requests))
    assert [tcp.receive() for _ in requests] == [
        "000100000006010600000007",
        "0002000000050103020007",
        "fffe00000003018303",
        "00000000000301e301",
        "000300000006010600000008",
        "0004000000050103020008",
    ]


def test_requests_in_several_segments(tcp: Tcp, block: FakeProcess) -> None:
    tcp.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    request = "0001 0000 0006 01 06 0000 0007" + "0002 0000 0006 01 03 0000 0001"
    data = bytes.fromhex(request)
    for end in range(1, len(data)):
        tcp.socket.sendall(data[:end])
        block.truth()  # a request on another connection; by then the fake has probably read the first segment
        tcp.socket.sendall(data[end:])
        assert tcp.receive() == "000100000006010600000007"
        assert tcp.receive() == "0002000000050103020007"


def test_frames_of_other_protocols(tcp: Tcp, block: FakeProcess) -> None:
    tcp.send("0001 0001 0006 01 05 0000 ff00" + "0002 0000 0006 01 01 0000 0008")  # protocol id 1: not Modbus
    assert tcp.receive() == "00020000000401010100"
    for length in ("0000", "0001", "00ff", "ffff"):  # no such frame exists, so its end cannot be found
        other = Tcp(block.ready["modbus"])
        other.send(f"0001 0000 {length} 01 03 0000 0001")
        with other.socket as stream:
            assert stream.recv(100) == b""


def test_tables_that_a_device_does_not_have(start_fake: Callable[..., FakeProcess]) -> None:
    tester = Tcp(start_fake("functional_tester").ready["modbus"])
    assert tester.ask("01 0000 0000") == "8101"
    assert tester.ask("05 0000 1234") == "8501"
    assert tester.ask("0f 0000 0001 01 01") == "8f01"
    assert tester.ask("02 0000 0005") == "020102"
    assert tester.ask("02 0004 0002") == "8202"
    tester.socket.close()


def test_exceptions_on_rtu(rtu: Rtu) -> None:
    for request, answer in (
        ("01 03 0000 0000", "018303"),
        ("01 03 0080 0001", "018302"),
        ("01 05 0000 0001", "018503"),
        ("01 63", "01e301"),
        ("01 63 0000 0001", "01e301"),
        ("01 03 0000 0001 00", "018303"),
        ("01 10 0000 0001 04 0000 0000", "019003"),
        ("01 03 0000 0001", "0103020000"),
    ):
        rtu.send(request)
        assert rtu.receive() == answer


def test_frames_that_an_rtu_device_ignores(rtu: Rtu, serial_block: FakeProcess) -> None:
    rtu.send("01 05 0000 ff00 0000", checksum=False)  # a wrong checksum
    assert rtu.receive(0.2) == ""
    for other in (
        "02 05 0000 ff00",
        "02 03 0000 0001",
        "02 03 02 0001",  # the answer of the other unit, which this unit receives, too
        "02 83 02",
        "02 63 00",
    ):
        rtu.send(other)
    assert rtu.receive(0.2) == ""
    rtu.send("01 01 0000 0008")
    assert rtu.receive() == "01010100"
    assert serial_block.truth()["writes"] == 0


def test_other_units_do_not_delay_the_next_request(rtu: Rtu) -> None:
    for _ in range(3):  # request and answer of another unit, then a request to this one, at once
        rtu.send("02 03 0000 0001")
        rtu.send("02 03 02 0001")
        rtu.send("02 83 02")
        rtu.send("01 01 0000 0008")
        assert rtu.receive() == "01010100"


def test_broadcasts_are_executed_and_not_answered(rtu: Rtu, serial_block: FakeProcess) -> None:
    rtu.send("00 0f 0000 0003 01 05")
    truth = serial_block.control.wait_until(lambda truth: truth["outputs"][2])
    assert truth["outputs"][:3] == [True, False, True]
    rtu.send("00 06 0001 0007")
    rtu.send("00 05 0000 1234")
    assert rtu.receive(0.2) == ""
    rtu.send("01 03 0000 0002")
    assert rtu.receive() == "010304" + "00000007"


@pytest.mark.parametrize("half", ["01 06 00", "01 10 0000 0002 04 0001", "01 63", "ff", "02 03", "01 03 0000 0001"])
def test_silence_ends_half_a_frame(rtu: Rtu, serial_block: FakeProcess, half: str) -> None:
    rtu.send(half, checksum=False)
    assert rtu.receive(0.2) == ""
    rtu.send("01 03 0000 0001")
    assert rtu.receive() == "0103020000"
    assert serial_block.truth()["writes"] == 0
