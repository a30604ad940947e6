"""The barcode reader's driver on a fake, on a pty and on TCP: single readings, named errors, reconnecting."""

import itertools
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import pytest

from arcor2_drivers.barcode_reader.barcode_reader import BarcodeReader
from arcor2_drivers.barcode_reader.settings import BarcodeReaderSettings
from arcor2_hw.data.device import Connection, Health, Identity
from arcor2_hw.exceptions import (
    Cancelled,
    ConnectionLost,
    DeviceFault,
    DeviceTimeout,
    NotConnected,
    OutOfRange,
    Refused,
)
from arcor2_hw.objects import Code, NoRead
from tests.drivers.background_call import BackgroundCall
from tests.fakes.conftest import FakeProcess

on_both = pytest.mark.parametrize("fake", ["pty", "tcp"], indirect=True)


@on_both
def test_connecting_only_asks(fake: FakeProcess, reader: BarcodeReader) -> None:
    reader.connect()  # has no effect when connected
    assert reader.connection is Connection.ONLINE
    assert reader.health is Health.NORMAL
    assert reader.identify() == Identity("Fake Optics", "BR-20", "FB0001", "2.01")
    assert set(fake.truth()["received"]) == {"STAT", "VER"}
    assert fake.truth()["reading"] is False


@pytest.mark.parametrize(
    ("crlf", "stx"), list(itertools.product([False, True], repeat=2)), ids=lambda on: "with" if on else "without"
)
def test_every_framing_is_read(fake: FakeProcess, make: Callable[..., BarcodeReader], crlf: bool, stx: bool) -> None:
    fake.control.do("renew", crlf=crlf, stx=stx)
    reader = make(fake.ready["port"])
    reader.connect()
    longest = "".join(chr(0x21 + i % 94) for i in range(128))
    for code in ("A", "PCB 0001", longest):
        fake.control.do("present", code=code)
        assert reader.scan() == code
    assert reader.identify().serial == "FB0001"


@on_both
def test_a_code_is_consumed_once(fake: FakeProcess, reader: BarcodeReader) -> None:
    fake.control.do("present", code="ONCE")
    assert reader.trigger(1.0) == Code("ONCE")
    fake.control.do("present", code=None)
    assert reader.trigger(0.3) == NoRead("timeout")
    assert not reader.code_present(0.1)
    with pytest.raises(Refused, match=f"^reader at {fake.ready['port']}: no new code has been read"):
        reader.last_code()
    fake.control.do("present", code="TWICE")
    assert reader.code_present(1.0)
    assert reader.last_code() == "TWICE"
    with pytest.raises(Refused):
        reader.last_code()
    assert reader.code_present(1.0)
    assert reader.scan(1.0) == "TWICE"  # a reading in between discards the stored code
    with pytest.raises(Refused):
        reader.last_code()


def test_nothing_to_read_fails_with_the_name_within_the_timeout(fake: FakeProcess, reader: BarcodeReader) -> None:
    began = time.monotonic()
    with pytest.raises(DeviceFault, match=f"^reader at {fake.ready['port']}: no code was read within 0.8 s$") as raised:
        reader.scan(0.8)
    assert time.monotonic() - began > 0.75
    assert raised.value.fault_code == "no_read"
    assert fake.truth()["received"].count("LON") == 2  # the reader's own time-out is 0.5 s
    assert fake.truth()["reading"] is False


def test_a_code_that_appears_late_is_read(fake: FakeProcess, reader: BarcodeReader) -> None:
    doing = BackgroundCall(lambda: reader.scan(5.0))
    time.sleep(0.7)  # past the reader's own time-out
    fake.control.do("present", code="AT LAST")
    assert doing.outcome() == "AT LAST"


def test_a_code_decoded_too_late_is_not_matched_to_a_later_trigger(fake: FakeProcess, reader: BarcodeReader) -> None:
    fake.control.do("late", seconds=0.4)
    fake.control.do("present", code="OLD")
    assert reader.trigger(0.3) == NoRead("timeout")
    fake.control.do("present", code="NEW")
    assert reader.trigger(2.0) == Code("NEW")


class UntidyReader:
    """A reader on TCP with delayed codes: surplus codes of a LON are sent just before the next answer."""

    def __init__(self) -> None:
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port = "socket://{}:{}".format(*self._server.getsockname())
        self.in_time = ""
        self._ended = False
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def end(self) -> None:
        self._ended = True
        self._thread.join(30.0)
        self._server.close()

    def _serve(self) -> None:
        self._server.settimeout(0.05)
        while not self._ended:
            try:
                line, _ = self._server.accept()
            except TimeoutError:
                continue
            with line:
                line.settimeout(0.05)
                self._answer(line)

    def _answer(self, line: socket.socket) -> None:
        late, triggers = b"", 0
        while not self._ended:
            try:
                data = line.recv(512)
            except TimeoutError:
                continue
            if not data:
                return
            for command in data.decode().split("\r")[:-1]:
                line.sendall(late)
                late = b""
                match command:
                    case "STAT":
                        line.sendall(b"STAT,1,OK\r")
                    case "RST":
                        line.sendall(b"OK,RST\r")
                    case "LON" if self.in_time:
                        line.sendall(self.in_time.encode() + b"\r")
                        late = b"SECOND READING\r"
                    case "LON":
                        triggers += 1
                        late = b"LATE %d\r" % triggers


def test_delayed_codes_are_discarded(make: Callable[..., BarcodeReader]) -> None:
    untidy = UntidyReader()
    try:
        reader = make(untidy.port)
        reader.connect()
        for _ in range(2):
            assert reader.trigger(0.1) == NoRead("timeout")
        for code in ("ONE", "TWO"):
            untidy.in_time = code
            assert reader.trigger(1.0) == Code(code)
        reader.disconnect()
    finally:
        untidy.end()


@pytest.mark.parametrize("timeout", [0.0, -1.0, 61.0, float("nan"), float("inf")])
def test_timeouts_out_of_range_send_nothing(fake: FakeProcess, reader: BarcodeReader, timeout: float) -> None:
    with pytest.raises(OutOfRange, match="timeout must be"):
        reader.trigger(timeout)
    with pytest.raises(AssertionError):
        reader.scan(timeout)
    assert "LON" not in fake.truth()["received"]


# ------------------------------------------------------------------------------------------------ stop
def test_stop_ends_a_reading(fake: FakeProcess, reader: BarcodeReader, wait_for: Callable[..., Any]) -> None:
    doing = BackgroundCall(lambda: reader.scan(30.0))
    wait_for(lambda: fake.truth()["reading"])
    with pytest.raises(Refused, match="is reading already"):
        reader.scan()
    reader.stop()
    assert isinstance(doing.outcome(), Cancelled)
    assert fake.truth()["reading"] is False
    fake.control.do("present", code="NEXT")
    assert reader.scan() == "NEXT"


@on_both
def test_disconnecting_ends_a_reading(fake: FakeProcess, reader: BarcodeReader, wait_for: Callable[..., Any]) -> None:
    doing = BackgroundCall(lambda: reader.scan(30.0))
    wait_for(lambda: fake.truth()["reading"])
    reader.disconnect()
    assert isinstance(doing.outcome(), Cancelled)
    assert fake.truth()["reading"] is False
    with pytest.raises(NotConnected, match=fake.ready["port"]):
        reader.scan()
    reader.disconnect()
    reader.connect()
    assert reader.connection is Connection.ONLINE


# ------------------------------------------------------------------------------------------------ condition
def test_health_follows_the_reader(fake: FakeProcess, reader: BarcodeReader, wait_for: Callable[..., Any]) -> None:
    assert reader.alarms() == []
    for word, health in (
        ("DIRTY", Health.MAINTENANCE_REQUIRED),
        ("HOT", Health.OFF_SPEC),
        ("FAIL", Health.FAILURE),
    ):
        fake.control.do("health", value=word)
        wait_for(lambda: reader.health, lambda value, wanted=health: value is wanted)
        [alarm] = reader.alarms()
        assert alarm.code == word.lower()
        assert alarm.remedy
    fake.control.do("health", value="OK")
    wait_for(lambda: reader.health, lambda value: value is Health.NORMAL)
    assert reader.alarms() == []


# ------------------------------------------------------------------------------------------------ faults
@on_both
def test_unplugging_and_reconnecting(fake: FakeProcess, reader: BarcodeReader, wait_for: Callable[..., Any]) -> None:
    doing = BackgroundCall(lambda: reader.scan(30.0))
    wait_for(lambda: fake.truth()["reading"])
    fake.control.do("unplug")
    outcome = doing.outcome()
    assert isinstance(outcome, ConnectionLost)
    assert f"reader at {fake.ready['port']}: the connection was lost" in str(outcome)
    wait_for(lambda: reader.connection, lambda state: state is Connection.LOST)
    assert reader.health is Health.FAILURE
    with pytest.raises(ConnectionLost, match=fake.ready["port"]):
        reader.scan()
    fake.control.do("present", code="BACK")
    fake.control.do("plug")
    wait_for(lambda: reader.connection, lambda state: state is Connection.BACK)
    assert reader.scan() == "BACK"
    assert reader.connection is Connection.ONLINE


@on_both
def test_unplugging_while_idle_is_detected(
    fake: FakeProcess, reader: BarcodeReader, wait_for: Callable[..., Any]
) -> None:
    fake.control.do("unplug")
    wait_for(lambda: reader.connection, lambda state: state is Connection.LOST)
    fake.control.do("plug")
    wait_for(lambda: reader.connection, lambda state: state is Connection.BACK)


@on_both
@pytest.mark.parametrize("fault", ["silence", "half_frame", "garbage"])
def test_invalid_answers_of_the_reader_are_typed_errors(
    fake: FakeProcess, reader: BarcodeReader, wait_for: Callable[..., Any], fault: str
) -> None:
    fake.control.do("present", code="HERE")
    fake.control.do(fault)
    late = f"^reader at {fake.ready['port']} (did not answer|gave no valid answer to) RST within 0.25 s$"
    with pytest.raises(DeviceTimeout, match=late):
        reader.scan()
    wait_for(lambda: reader.connection, lambda state: state is Connection.LOST)
    with pytest.raises(DeviceTimeout, match=f"^reader at {fake.ready['port']}"):
        reader.scan()
    fake.control.do("heal")
    wait_for(lambda: reader.connection, lambda state: state is Connection.BACK)
    assert reader.scan() == "HERE"


def test_a_reader_that_goes_silent_during_reading(
    fake: FakeProcess, reader: BarcodeReader, wait_for: Callable[..., Any]
) -> None:
    doing = BackgroundCall(lambda: reader.scan(1.0))
    wait_for(lambda: fake.truth()["reading"])
    fake.control.do("silence")
    assert isinstance(doing.outcome(), DeviceTimeout)


def test_a_silent_reader_is_detected_while_idle(
    fake: FakeProcess, reader: BarcodeReader, wait_for: Callable[..., Any]
) -> None:
    fake.control.do("silence")
    wait_for(lambda: reader.connection, lambda state: state is Connection.LOST)
    with pytest.raises(DeviceTimeout, match=f"^reader at {fake.ready['port']} did not answer STAT within 0.25 s"):
        reader.scan()


@pytest.mark.parametrize("port", ["/dev/does-not-exist", "socket://127.0.0.1:1"])
def test_a_missing_port_is_named(make: Callable[..., BarcodeReader], port: str) -> None:
    reader = make(port)
    with pytest.raises(NotConnected, match=f"^reader at {port}: the port cannot be opened"):
        reader.connect(1.0)
    assert reader.connection is Connection.FAILED
    with pytest.raises(NotConnected, match=port):
        reader.scan()


def test_port_without_a_reader(make: Callable[..., BarcodeReader]) -> None:
    ours, theirs = os.openpty()
    try:
        port = os.ttyname(theirs)
        with pytest.raises(DeviceTimeout, match=f"^reader at {port} did not answer STAT"):
            make(port).connect(0.6)
    finally:
        os.close(ours)
        os.close(theirs)


def test_port_that_is_in_use(start_fake: Callable[..., FakeProcess], make: Callable[..., BarcodeReader]) -> None:
    fake = start_fake("barcode_reader")
    first, second = make(fake.ready["port"]), make(fake.ready["port"])
    first.connect()
    with pytest.raises(NotConnected, match=f"{fake.ready['port']}: the port is used by another program"):
        second.connect()
    assert first.identify().model == "BR-20"


def test_a_partial_command_of_another_host_is_flushed(
    start_fake: Callable[..., FakeProcess], make: Callable[..., BarcodeReader]
) -> None:
    fake = start_fake("barcode_reader")
    line = os.open(fake.ready["port"], os.O_RDWR | os.O_NOCTTY)
    os.write(line, b"LO")
    os.close(line)
    reader = make(fake.ready["port"])
    reader.connect()
    assert reader.identify().model == "BR-20"


@pytest.mark.parametrize(
    ("name", "value"),
    [("port", ""), ("baud_rate", 0), ("baud_rate", 10**7), ("answer_timeout", 0.0), ("answer_timeout", float("nan"))],
)
def test_settings_out_of_range_name_the_parameter(name: str, value: Any) -> None:
    with pytest.raises(OutOfRange, match=f"^{name} must be"):
        BarcodeReaderSettings(**{"port": "/dev/ttyUSB0", name: value})


HOST = """
import sys
from arcor2_drivers.barcode_reader.barcode_reader import BarcodeReader
from arcor2_drivers.barcode_reader.settings import BarcodeReaderSettings
reader = BarcodeReader("id", "reader", settings=BarcodeReaderSettings(sys.argv[1]))
reader.connect()
reader.scan(60.0)
"""


def test_a_killed_process_leaves_no_reading_active(
    fake: FakeProcess, make: Callable[..., BarcodeReader], wait_for: Callable[..., Any]
) -> None:
    process = subprocess.Popen([sys.executable, "-c", HOST, fake.ready["port"]])
    try:
        wait_for(lambda: fake.truth()["received"].count("LON") >= 2)
        wait_for(lambda: fake.truth()["reading"])
    finally:
        process.kill()
        process.wait()
    wait_for(lambda: not fake.truth()["reading"])
    fake.control.do("present", code="AFTER")
    reader = make(fake.ready["port"])
    reader.connect()
    assert reader.scan() == "AFTER"
