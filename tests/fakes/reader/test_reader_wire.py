"""The fake barcode reader from the host's side: pyserial and the bytes of the device page."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import serial

from arcor2_fakes.control import ControlError
from tests.fakes.conftest import FakeProcess


class Host:
    """A minimal host, written from the device page."""

    def __init__(self, port: str, timeout: float = 30.0) -> None:
        self.serial = serial.serial_for_url(port, baudrate=9600, timeout=timeout)

    def send(self, command: str) -> None:
        self.serial.write(command.encode() + b"\r")

    def receive(self) -> bytes:
        return self.serial.read_until(b"\r")

    def ask(self, command: str) -> bytes:
        self.send(command)
        return self.receive()

    def close(self) -> None:
        below = getattr(self.serial, "_socket", None)
        self.serial.close()
        if below is not None:
            below.close()  # pyserial 3.5 does not close the socket if the other end has reset it

    def silent_for(self, seconds: float) -> bool:
        self.serial.timeout = seconds
        return self.serial.read(1) == b""


@pytest.fixture(scope="module")
def on_pty(tmp_path_factory: pytest.TempPathFactory) -> Iterator[FakeProcess]:
    with FakeProcess("barcode_reader", "--link", str(tmp_path_factory.mktemp("line") / "reader")) as fake:
        yield fake


@pytest.fixture(scope="module")
def on_tcp() -> Iterator[FakeProcess]:
    with FakeProcess("barcode_reader", "--tcp", "127.0.0.1:0") as fake:
        yield fake


@pytest.fixture
def reader(on_pty: FakeProcess) -> FakeProcess:
    """Reset the reader to its factory state, on a pty. One process serves all tests of this file."""
    on_pty.control.do("renew")
    return on_pty


@pytest.fixture(params=["pty", "tcp"])
def any_reader(request: pytest.FixtureRequest) -> FakeProcess:
    fake: FakeProcess = request.getfixturevalue(f"on_{request.param}")
    fake.control.do("renew")
    return fake


@pytest.fixture
def host(reader: Any) -> Iterator[Host]:
    host = Host(reader.ready["port"])
    yield host
    host.close()


def test_the_code_in_front_is_read(any_reader: Any) -> None:
    host = Host(any_reader.ready["port"])
    any_reader.control.do("present", code="PCB-0001")
    for _ in range(3):
        began = time.monotonic()
        assert host.ask("LON") == b"PCB-0001\r"
        assert time.monotonic() - began >= 0.05
    assert host.silent_for(0.2)  # a code is sent once
    assert any_reader.truth()["received"] == ["LON"] * 3
    host.close()


def test_a_board_that_appears_during_reading_is_read(start_fake: Callable[..., Any]) -> None:
    reader = start_fake("barcode_reader", "--timeout", "60")
    host = Host(reader.ready["port"])
    host.send("LON")
    reader.control.wait_until(lambda truth: truth["reading"])
    reader.control.do("present", code="LATE-1")
    assert host.receive() == b"LATE-1\r"
    host.send("LON")
    reader.control.wait_until(lambda truth: truth["reading"])
    reader.control.do("present", code=None)
    reader.control.do("present", code="NEXT-2")
    assert host.receive() == b"NEXT-2\r"
    host.close()


def test_no_read_is_reported_after_the_readers_timeout(start_fake: Callable[..., Any]) -> None:
    reader = start_fake("barcode_reader", "--timeout", "0.4")
    host = Host(reader.ready["port"])
    began = time.monotonic()
    assert host.ask("LON") == b"ERROR\r"
    assert time.monotonic() - began > 0.38
    host.close()


def test_loff_ends_reading_without_an_answer(reader: Any, host: Host) -> None:
    host.send("LON")
    host.send("LOFF")
    reader.control.wait_until(lambda truth: truth["received"] == ["LON", "LOFF"])
    reader.control.do("present", code="PCB-1")
    assert host.silent_for(1.2)


def test_a_code_decoded_before_loff_still_comes(reader: Any, host: Host) -> None:
    reader.control.do("present", code="PCB-1")
    reader.control.do("late", seconds=0.5)
    host.send("LON")
    reader.control.wait_until(lambda truth: truth["received"] == ["LON"] and not truth["reading"])
    host.send("LOFF")
    assert host.ask("STAT") == b"STAT,1,OK\r"
    assert host.receive() == b"PCB-1\r"
    reader.control.do("late", seconds=0.5)
    host.send("LON")
    reader.control.wait_until(lambda truth: truth["received"][-1] == "LON" and not truth["reading"])
    assert host.ask("RST") == b"OK,RST\r"
    assert host.silent_for(0.8)  # a reset clears the buffer


@pytest.mark.parametrize(
    ("options", "answer"),
    [
        (["--cr"], b"A1\r"),
        (["--crlf"], b"A1\r\n"),
        (["--stx"], b"\x02A1\x03\r"),
        (["--stx", "--crlf"], b"\x02A1\x03\r\n"),
    ],
)
def test_framing(start_fake: Callable[..., Any], options: list[str], answer: bytes) -> None:
    reader = start_fake("barcode_reader", *options)
    host = Host(reader.ready["port"])
    reader.control.do("present", code="A1")
    host.send("LON")
    assert host.serial.read(len(answer)) == answer
    assert host.silent_for(0.1)
    host.close()


def test_identification_status_and_unknown_commands(reader: Any, host: Host) -> None:
    fields = host.ask("VER").decode().rstrip("\r").split(",")
    assert len(fields) == 5
    assert fields[0] == "VER"
    assert all(fields)
    assert host.ask("STAT") == b"STAT,1,OK\r"
    reader.control.do("health", value="DIRTY")
    assert host.ask("STAT") == b"STAT,1,DIRTY\r"
    reader.control.do("health", value="FAIL")
    assert host.ask("STAT") == b"STAT,0,FAIL\r"
    reader.control.do("present", code="PCB-1")
    assert host.ask("LON") == b"ERROR\r"
    assert host.ask("lon") == b"ERR,lon,00\r"
    host.serial.write(b"\r\n" + b"x" * 5000 + b"\rSTAT\r\n")
    assert host.receive() == b"STAT,0,FAIL\r"


def test_an_unreadable_code_is_refused(reader: Any) -> None:
    for code in ("", "x" * 129, "ř", "A\rB", "ERROR", 7):
        with pytest.raises(ControlError):
            reader.control.do("present", code=code)
    assert reader.truth()["code"] is None
    with pytest.raises(ControlError, match="health must be one of"):
        reader.control.do("health", value="TIRED")


@pytest.mark.parametrize("link_given", [True, False])
def test_a_cable_can_be_pulled(start_fake: Callable[..., Any], tmp_path: Path, link_given: bool) -> None:
    """A host gets a link, never the path of the terminal, which the line of another device may use later."""
    reader = start_fake("barcode_reader", *(["--link", str(tmp_path / "reader")] if link_given else []))
    link = Path(reader.ready["port"])
    host = Host(str(link))
    assert link.is_symlink()
    reader.control.do("unplug")
    assert not link.exists()
    with pytest.raises((serial.SerialException, OSError)):
        host.ask("STAT")
    host.close()
    with pytest.raises(serial.SerialException):
        Host(str(link))
    assert reader.control.do("plug") == str(link)
    again = Host(str(link))
    assert again.ask("STAT") == b"STAT,1,OK\r"
    again.close()
    assert reader.terminate() == 0
    assert not link.is_symlink()
    assert link_given or not link.parent.exists()


def test_tcp_can_be_unplugged(start_fake: Callable[..., Any]) -> None:
    reader = start_fake("barcode_reader", "--tcp", "127.0.0.1:0")
    host = Host(reader.ready["port"])
    assert host.ask("STAT") == b"STAT,1,OK\r"
    reader.control.do("unplug")
    with pytest.raises(serial.SerialException):
        host.ask("STAT")
    with pytest.raises(serial.SerialException):
        Host(reader.ready["port"])
    host.close()
    reader.control.do("plug")
    again = Host(reader.ready["port"])
    assert again.ask("STAT") == b"STAT,1,OK\r"
    newest = Host(reader.ready["port"])
    assert newest.ask("STAT") == b"STAT,1,OK\r"
    again.close()
    newest.close()


@pytest.mark.parametrize(
    ("fault", "answer"), [("silence", b""), ("half_frame", b"STAT,"), ("garbage", None), ("slow", b"")]
)
def test_a_faulty_line_garbles_bytes(any_reader: Any, fault: str, answer: bytes | None) -> None:
    host = Host(any_reader.ready["port"], timeout=0.3)
    any_reader.control.do(fault, seconds=0.5)
    reply = host.ask("STAT")
    assert reply == answer if answer is not None else reply != b"STAT,1,OK\r"
    host.close()
    any_reader.control.do("heal")
    host = Host(any_reader.ready["port"])
    assert host.ask("STAT") == b"STAT,1,OK\r"
    host.close()


@pytest.mark.parametrize("fault", ["reset", "refuse"])
def test_a_line_can_disappear(any_reader: Any, fault: str) -> None:
    host = Host(any_reader.ready["port"], timeout=0.3)
    assert host.ask("STAT") == b"STAT,1,OK\r"
    any_reader.control.do(fault)
    if fault == "reset" or not any_reader.ready["port"].startswith(
        "socket"
    ):  # a refusing TCP port keeps its connection
        with pytest.raises((serial.SerialException, OSError)):
            host.ask("STAT")
    if fault == "refuse":
        with pytest.raises(serial.SerialException):
            Host(any_reader.ready["port"])
    host.close()
    any_reader.control.do("heal")
    again = Host(any_reader.truth()["port"])
    assert again.ask("STAT") == b"STAT,1,OK\r"
    again.close()


def test_an_unread_line_does_not_stall_the_reader(reader: Any) -> None:
    host = Host(reader.ready["port"])
    for _ in range(20):
        host.serial.write(b"VER\r" * 100)
        reader.control.wait_until(lambda truth: truth["received"][-1:] == ["VER"])
    assert reader.truth()["health"] == "OK"
    host.serial.reset_input_buffer()
    host.close()


def test_an_existing_file_at_the_link_path_is_kept(tmp_path: Path) -> None:
    import subprocess
    import sys

    (tmp_path / "precious").write_text("mine")
    ended = subprocess.run(
        [sys.executable, "-m", "arcor2_fakes.barcode_reader", "--link", str(tmp_path / "precious")],
        capture_output=True,
        text=True,
        timeout=20,
        check=False,
    )
    assert ended.returncode == 1
    assert len(ended.stderr.splitlines()) == 1
    assert "precious" in ended.stderr
    assert (tmp_path / "precious").read_text() == "mine"


def test_a_power_cycle_ends_reading(any_reader: Any) -> None:
    host = Host(any_reader.ready["port"])
    host.send("LON")
    any_reader.control.wait_until(lambda truth: truth["reading"])
    any_reader.control.do("power_cycle")
    host.close()
    truth = any_reader.truth()
    assert (truth["reading"], truth["plugged"]) == (False, True)
    again = Host(truth["port"])
    assert again.ask("STAT") == b"STAT,1,OK\r"
    again.close()
