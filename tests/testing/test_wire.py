"""The wire between driver and device: forwarding, cuts, torn frames, recording, and decoding of frames."""

import contextlib
import os
import select
import socket
import tty
from collections.abc import Iterator
from typing import Any

import pytest

from arcor2_hw.exceptions import InvalidData
from arcor2_hw.testing.frames import CanopenSlcan, Lines, ModbusRtu, ModbusTcp, Rtde, reader
from arcor2_hw.testing.life import wait_until
from arcor2_hw.testing.serial_wire import SerialWire
from arcor2_hw.testing.tcp_wire import TcpWire

QUIET = 0.2  # s without a message


# ------------------------------------------------------------------------------------------------ TCP
@pytest.fixture
def device() -> Iterator[socket.socket]:
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(30.0)
        yield server


@pytest.fixture
def wire(device: socket.socket) -> Iterator[TcpWire]:
    wire = TcpWire("127.0.0.1", [device.getsockname()[1]])
    wire.start()
    yield wire
    wire.close()


@pytest.fixture
def ends(device: socket.socket, wire: TcpWire) -> Iterator[tuple[socket.socket, socket.socket]]:
    """The ends of driver and device of one connection."""
    with dial(wire) as driver:
        at_device, _ = device.accept()
        at_device.settimeout(30.0)
        with at_device:
            yield driver, at_device


def dial(wire: TcpWire) -> socket.socket:
    return socket.create_connection((wire.host, wire.ports[0]), 5.0)


def is_quiet(end: socket.socket) -> bool:
    return not select.select([end], [], [], QUIET)[0]


def test_bytes_are_forwarded_and_recorded(wire: TcpWire, ends: tuple[socket.socket, socket.socket]) -> None:
    driver, device = ends
    driver.sendall(b"ask")
    assert device.recv(9) == b"ask"
    device.sendall(b"answer")
    assert driver.recv(9) == b"answer"
    first, second = wire.record()
    assert (first.by, first.data, second.by, second.data) == ("driver", b"ask", "device", b"answer")
    assert first.at <= second.at
    wire.forget()
    assert not wire.record()


def test_large_data_is_forwarded_to_a_slow_reader(ends: tuple[socket.socket, socket.socket]) -> None:
    driver, device = ends
    much = os.urandom(3 << 20)
    device.setblocking(False)
    sent = received = b""
    while len(received) < len(much):
        with contextlib.suppress(BlockingIOError):
            sent += much[len(sent) : len(sent) + device.send(much[len(sent) : len(sent) + 65536])]
        if len(sent) == len(much) or is_quiet_now(device):
            received += driver.recv(1 << 20)
    assert received == much


def is_quiet_now(end: socket.socket) -> bool:
    return not select.select([], [end], [], 0.0)[1]


def test_a_cut_delays_data_until_it_is_healed(wire: TcpWire, ends: tuple[socket.socket, socket.socket]) -> None:
    driver, device = ends
    wire.cut()
    driver.sendall(b"lost?")
    device.sendall(b"late")
    assert is_quiet(device)
    assert is_quiet(driver)
    wire.heal()
    assert device.recv(9) == b"lost?"
    assert driver.recv(9) == b"late"


def test_a_close_during_a_cut_is_not_forwarded(wire: TcpWire, ends: tuple[socket.socket, socket.socket]) -> None:
    driver, device = ends
    wire.cut()
    driver.sendall(b"start")
    driver.close()
    wait_until(lambda: len(wire.record()) == 1, 2.0, "the recording of the sent data")
    assert is_quiet(device)
    wire.heal()
    with pytest.raises(ConnectionResetError):
        device.recv(9)


def test_a_connection_opened_during_a_cut_is_reset(wire: TcpWire, device: socket.socket) -> None:
    wire.cut()
    with dial(wire) as driver:
        driver.sendall(b"hello")
        assert is_quiet(driver)
        assert not select.select([device], [], [], QUIET)[0], "the device noticed a connection over a cut cable"
        wire.heal()
        with pytest.raises(ConnectionResetError):
            driver.recv(9)
    with dial(wire) as driver:
        device.accept()[0].close()


def test_half_a_frame_is_forwarded_and_nothing_more(wire: TcpWire, ends: tuple[socket.socket, socket.socket]) -> None:
    driver, device = ends
    wire.half_frame()
    driver.sendall(b"ask")
    assert device.recv(9) == b"ask"
    device.sendall(b"12345678")
    assert driver.recv(9) == b"1234"
    device.sendall(b"more")
    assert is_quiet(driver)
    wire.heal()
    with pytest.raises(ConnectionResetError):
        driver.recv(9)


def test_a_reset_reaches_both_ends_and_new_connections_work(
    wire: TcpWire, device: socket.socket, ends: tuple[socket.socket, socket.socket]
) -> None:
    wire.reset()
    for end in ends:
        with pytest.raises(ConnectionResetError):
            end.recv(9)
    with dial(wire), device.accept()[0]:
        pass


def test_a_connection_in_progress_is_reset_too(
    wire: TcpWire, device: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    connect = socket.create_connection

    def connect_and_reset(*arguments: Any) -> socket.socket:
        connection = connect(*arguments)
        wire.reset()
        return connection

    monkeypatch.setattr(socket, "create_connection", connect_and_reset)
    with pytest.raises(ConnectionResetError), connect((wire.host, wire.ports[0]), 5.0) as driver:
        driver.recv(9)


def test_a_missing_device_resets_the_connection() -> None:
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))
        wire = TcpWire("127.0.0.1", [closed.getsockname()[1]])
        wire.start()
        try:
            with pytest.raises(ConnectionResetError), dial(wire) as driver:
                driver.recv(9)
        finally:
            wire.close()


# ------------------------------------------------------------------------------------------------ serial
@pytest.fixture
def port() -> Iterator[tuple[int, str]]:
    """The device's end of a serial line, and the path of the other end."""
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    yield ours, os.ttyname(theirs)
    for end in (ours, theirs):
        os.close(end)


def test_a_serial_wire_forwards_cuts_and_unplugs(port: tuple[int, str]) -> None:
    device, path = port
    wire = SerialWire(path)
    wire.start()
    driver = os.open(wire.address, os.O_RDWR | os.O_NOCTTY)
    try:
        os.write(driver, b"ask\r")
        assert os.read(device, 9) == b"ask\r"
        wire.cut()
        os.write(device, b"lost")
        os.write(driver, b"lost")
        assert not select.select([device, driver], [], [], QUIET)[0]
        wire.heal()
        assert not select.select([device, driver], [], [], QUIET)[0], "a line does not store data"
        wire.half_frame()
        os.write(device, b"12345678")
        assert os.read(driver, 9) == b"1234"
        wire.heal()
        wire.reset()
        with contextlib.suppress(OSError):  # reading from an unplugged port returns no data or fails
            assert os.read(driver, 9) == b""
        again = os.open(wire.address, os.O_RDWR | os.O_NOCTTY)
        os.write(again, b"again")
        assert os.read(device, 9) == b"again"
        os.close(again)
        assert wire.frames(Lines(())) == [b"ask", b"lost", b"again"]
    finally:
        os.close(driver)
        wire.close()


# ------------------------------------------------------------------------------------------------ frames
def hexed(text: str) -> bytes:
    return bytes.fromhex(text)


@pytest.mark.parametrize(
    ("frames", "read", "acts", "words"),
    [
        (ModbusTcp(), "0001 0000 0006 01 03 006b 0003", "0002 0000 0006 01 06 0001 0003", "function 6"),
        (ModbusTcp(), "0003 0000 0005 01 2b 0e 01 00", "0004 0000 0009 01 10 0001 0001 02 000a", "function 16"),
        (ModbusTcp(), "0001 0000 0006 01 04 0008 0001", "0005 0000 0008 01 16 0004 00f2 0025", "function 22"),
        (ModbusRtu(), "11 03 006b 0003 7687", "11 06 0001 0003 9a9b", "function 6"),
        (ModbusRtu(), "11 01 0013 0025 0e84", "11 10 0001 0002 04 000a 0102 c6f0", "function 16"),
    ],
)
def test_modbus_writes_count_as_acting(frames: ModbusTcp | ModbusRtu, read: str, acts: str, words: str) -> None:
    stream = hexed(read) + hexed(acts) + hexed(read)
    assert frames.split(stream) == [hexed(read), hexed(acts), hexed(read)]
    assert frames.acting(hexed(read)) == ""
    assert frames.acting(hexed(acts)).startswith(words)


def test_an_invalid_frame_counts_as_acting() -> None:
    for frames in (ModbusTcp(), ModbusRtu()):
        assert frames.split(b"\xff\xfe\xfd") == [b"\xff\xfe\xfd"]
        assert "invalid Modbus" in frames.acting(b"\xff\xfe\xfd")


def test_the_first_word_decides_whether_a_line_acts() -> None:
    frames = Lines(["LON", "RST"])
    assert frames.split(b"STAT\rLON 5\r\nVER\r") == [b"STAT", b"LON 5", b"VER"]
    assert [frames.acting(each) for each in (b"STAT", b"LON 5", b"PLON")] == ["", "LON 5", ""]


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("t60584041600000000000", ""),  # SDO upload of 6041h
        ("t6058234060000F000000", "SDO download to 6040h"),
        ("t60582B17100001000000", ""),  # declared: producer heartbeat
        ("t00020105", "NMT 01 05"),
        ("t20520F00", "process data 205h"),
        ("t77F105", ""),  # our own heartbeat
        ("S6", ""),
        ("O", ""),
    ],
)
def test_nmt_process_data_and_downloads_count_as_acting(line: str, words: str) -> None:
    assert CanopenSlcan(["0x1017"]).acting(line.encode()) == words


def test_an_unknown_kind_of_frames_is_named() -> None:
    with pytest.raises(InvalidData, match="morse"):
        reader("morse", [])


def test_frames_of_a_ur_controller_are_read() -> None:
    reader = Rtde(["programState"])
    asked, started, inputs, data = b"\0\5V\0\2", b"\0\3S", b"\0\6Ia,b", b"\0\5U\1\7"
    assert reader.split(asked + started + inputs + data + b"\0") == [asked, started, inputs, data, b"\0"]
    assert [reader.acting(each) for each in (asked, started, inputs, data)] == [
        "",
        "",
        "RTDE message I",
        "RTDE message U",
    ]
    lines = reader.split(b"programState\nplay\n  movej([0, 0, 0, 0, 0, 0])\n")
    assert [reader.acting(each) for each in lines] == ["", "play", "  movej([0, 0, 0, 0, 0, 0])"]
