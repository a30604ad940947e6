"""The fake block from the host's side: raw frames and pymodbus, as on the device page."""

import logging
import os
import signal
import socket
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from pymodbus.client import ModbusSerialClient, ModbusTcpClient
from pymodbus.exceptions import ModbusException

EXPIRED = 2


@pytest.fixture
def fake(start_fake: Callable[..., Any]) -> Any:
    return start_fake("remote_io")


@pytest.fixture
def host(fake: Any) -> Iterator[ModbusTcpClient]:
    logging.getLogger("pymodbus.logging").setLevel(logging.CRITICAL)
    name, port = fake.ready["modbus"].split(":")
    client = ModbusTcpClient(name, port=int(port), timeout=30.0, retries=0)
    assert client.connect()
    yield client
    client.close()


def image(host: Any) -> list[int]:
    answer = host.read_input_registers(0, count=17, device_id=1)
    assert not answer.isError(), answer
    return list(answer.registers)


def test_frames_byte_by_byte(fake: Any) -> None:
    fake.control.do("set_input", number=0, on=True)
    fake.control.do("set_input", number=9, on=True)
    fake.control.do("set_analog", number=1, raw=-2)
    name, port = fake.ready["modbus"].split(":")
    with socket.create_connection((name, int(port)), 2.0) as raw:
        for request, answer in [
            # transaction, protocol, length, unit, then function and data
            ("0001 0000 0006 01 02 0000 0010", "0001 0000 0005 01 02 02 01 02"),  # discrete inputs 0 to 15
            ("0002 0000 0006 01 05 0004 ff00", "0002 0000 0006 01 05 0004 ff00"),  # DO4 on
            ("0003 0000 0006 01 01 0000 0008", "0003 0000 0004 01 01 01 10"),  # coils 0 to 7
            ("0004 0000 0006 01 04 0000 0004", "0004 0000 000b 01 04 08 0201 0010 0000 fffe"),  # image
            ("0005 0000 0006 01 06 0001 ffff", "0005 0000 0006 01 06 0001 ffff"),  # AO1 = -1
            ("0006 0000 0006 01 03 0000 0002", "0006 0000 0007 01 03 04 0000 ffff"),  # AO0, AO1
            ("0007 0000 0008 01 0f 0000 0003 01 05", "0007 0000 0006 01 0f 0000 0003"),  # DO0, DO2 on, DO1 off
            ("0008 0000 0006 01 03 0002 0001", "0008 0000 0003 01 83 02"),  # outside the map
            ("0009 0000 0006 01 02 0010 0001", "0009 0000 0003 01 82 02"),  # no DI16
            ("000a 0000 0006 01 06 0010 ffff", "000a 0000 0003 01 86 03"),  # too long a pulse
            ("000b 0000 0006 01 06 0040 0001", "000b 0000 0003 01 86 03"),  # too short a watchdog
        ]:
            raw.sendall(bytes.fromhex(request))
            assert raw.recv(260).hex() == answer.replace(" ", "")
    truth = fake.truth()
    assert [number for number, on in enumerate(truth["outputs"]) if on] == [0, 2, 4]
    assert truth["analog_outputs"] == [0, -1]


def test_watchdog_over_the_wire(fake: Any, host: Any, wait_for: Callable[..., Any]) -> None:
    assert not host.write_registers(80, [150, 4711, 0, 0b11, 0b11, 0b10, 0, 0, 0, 0], device_id=1).isError()
    assert not host.write_coil(0, True, device_id=1).isError()
    words = image(host)
    assert (words[1], words[10], words[14]) == (1, 1, 4711)
    words = wait_for(lambda: image(host), lambda words: words[10] == EXPIRED)  # reading does not trigger the watchdog
    assert words[1] == 0b10
    for refused in (host.write_coil(0, True, device_id=1), host.write_registers(16, [50], device_id=1)):
        assert refused.exception_code == 4
    assert not host.write_coil(2, True, device_id=1).isError()
    host.write_register(82, 1, device_id=1)
    assert not host.write_coil(0, True, device_id=1).isError()
    assert host.read_holding_registers(80, count=10, device_id=1).registers == [150, 0, 0, 3, 3, 2, 0, 0, 0, 0]


def test_the_watchdog_does_not_count_the_time_in_which_the_fake_does_not_run(fake: Any) -> None:
    """If a busy machine does not run the fake for a while, a real block would still have received the triggers."""
    name, port = fake.ready["modbus"].split(":")
    trigger = bytes.fromhex("0001 0000 000b 01 10 0050 0002 04 00c8 1267")  # watchdog 1: 200 ms, host 4711
    with socket.create_connection((name, int(port)), 30.0) as raw:
        raw.sendall(trigger)
        assert raw.recv(260)
        os.kill(fake.process.pid, signal.SIGSTOP)
        try:
            time.sleep(0.4)
            raw.sendall(trigger)
        finally:
            os.kill(fake.process.pid, signal.SIGCONT)
        assert raw.recv(260)
    assert fake.truth()["watchdogs"][1]["state"] == "running"


def test_triggering_the_running_watchdog_is_not_a_write(fake: Any, host: Any) -> None:
    host.write_registers(80, [60_000, 4711], device_id=1)
    started = fake.truth()["writes"]
    host.write_registers(81, [4711], device_id=1)
    assert fake.truth()["writes"] == started
    host.write_registers(81, [4712], device_id=1)  # another host takes it over
    host.write_registers(65, [4711], device_id=1)  # it is off
    host.write_registers(81, [4712, 0], device_id=1)  # a command as well
    assert fake.truth()["writes"] == started + 3


def test_a_partly_invalid_write_changes_nothing(fake: Any, host: Any) -> None:
    assert host.write_registers(0, [1, 2, 3], device_id=1).exception_code == 2
    assert fake.truth()["analog_outputs"] == [0, 0]


def test_power_cycle_and_faults(fake: Any, host: Any, wait_for: Callable[..., Any]) -> None:
    host.write_coil(3, True, device_id=1)
    fake.control.do("power_cycle")
    assert not any(fake.truth()["outputs"])
    host.close()
    host.connect()
    assert image(host)[1] == 0
    with pytest.raises(Exception, match="the numbers must be 0 to 15"):
        fake.control.do("set_input", number=16, on=True)


def test_the_world_switches_inputs_and_reads_outputs(fake: Any, host: Any) -> None:
    fake.control.do("set_inputs", inputs={"0": True, "7": True})
    assert image(host)[0] == 0b1000_0001
    fake.control.do("set_inputs", inputs={"0": False})
    assert image(host)[0] == 0b1000_0000
    with pytest.raises(Exception, match="the numbers must be 0 to 15"):
        fake.control.do("set_inputs", inputs={"1": True, "16": True})
    assert image(host)[0] == 0b1000_0000  # all or nothing
    host.write_coil(3, True, device_id=1)
    host.write_register(1, 77, device_id=1)
    outputs = fake.control.do("outputs")
    assert outputs["outputs"][3] is True
    assert outputs["analog_outputs"] == [0, 77]


def test_rtu_line(start_fake: Callable[..., Any]) -> None:
    fake = start_fake("remote_io", "--serial")
    host = ModbusSerialClient(fake.ready["modbus"], baudrate=115200, timeout=30.0, retries=0)
    assert host.connect()
    try:
        host.write_coil(1, True, device_id=1)
        assert image(host)[1] == 0b10
    finally:
        host.close()
    assert fake.terminate() == 0


def test_rtu_line_is_pulled_out_and_plugged(start_fake: Callable[..., Any], tmp_path: Path) -> None:
    link = tmp_path / "ttyBLOCK"
    fake = start_fake("remote_io", "--serial", "--link", str(link))
    assert fake.ready["modbus"] == str(link)
    first = ModbusSerialClient(str(link), baudrate=115200, timeout=0.3, retries=0)
    assert first.connect()
    try:
        assert len(image(first)) == 17
        fake.control.do("refuse")
        assert not link.exists()
        with pytest.raises((OSError, ModbusException)):
            image(first)
    finally:
        first.close()
    fake.control.do("heal")
    again = ModbusSerialClient(str(link), baudrate=115200, timeout=30.0, retries=0)
    assert again.connect()
    try:
        assert len(image(again)) == 17
    finally:
        again.close()
