"""Parity, stop bits and data bits of serial links, as they are requested from the operating system."""

import os
import termios
import tty
from collections.abc import Iterator
from typing import Any

import pytest
import serial.serialposix

from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects.line import Line
from arcor2_hw.objects.modbus_link import ModbusLink
from arcor2_hw.objects.modbus_settings import ModbusSettings, Parity

FLAGS = {"none": 0, "even": termios.PARENB, "odd": termios.PARENB | termios.PARODD}


@pytest.fixture
def port() -> Iterator[str]:
    ends = os.openpty()
    tty.setraw(ends[1])
    yield os.ttyname(ends[1])
    for end in ends:
        os.close(end)


@pytest.fixture
def requested(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The control flags of the port. A pty refuses a parity bit, so it is set without one."""
    flags: list[int] = []
    set_attributes = termios.tcsetattr

    def record(descriptor: int, when: int, attributes: Any) -> None:
        flags.append(attributes[2])
        set_attributes(descriptor, when, [*attributes[:2], attributes[2] & ~termios.PARENB, *attributes[3:]])

    monkeypatch.setattr(serial.serialposix.termios, "tcsetattr", record)
    return flags


@pytest.mark.parametrize("stopbits", [1, 2])
@pytest.mark.parametrize("parity", Parity)
def test_a_modbus_link_has_the_format_of_its_settings(
    port: str, requested: list[int], parity: Parity, stopbits: int
) -> None:
    link = ModbusLink.of("press", ModbusSettings(serial_port=port, parity=parity, stopbits=stopbits))
    link.open(1.0)
    link.close()
    assert requested[-1] & (termios.PARENB | termios.PARODD) == FLAGS[parity]
    assert bool(requested[-1] & termios.CSTOPB) is (stopbits == 2)
    assert requested[-1] & termios.CSIZE == termios.CS8


def test_a_line_has_the_given_format(port: str, requested: list[int]) -> None:
    for format_, flags in (({"parity": "E", "stopbits": 2, "data_bits": 7}, termios.PARENB), ({}, 0)):
        line = Line("scale", port, 9600, **format_)
        line.open(1.0)
        line.close()
        assert requested[-1] & (termios.PARENB | termios.PARODD) == flags
        assert bool(requested[-1] & termios.CSTOPB) is bool(flags)
        assert requested[-1] & termios.CSIZE == (termios.CS7 if flags else termios.CS8)


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        ({}, "host must be the address"),
        ({"host": "10.0.0.7", "serial_port": "/dev/ttyUSB0"}, "host must be the address"),
        ({"host": "10.0.0.7", "port": 0}, "port must be 1"),
        ({"serial_port": "ttyUSB0"}, "serial_port must be"),
        ({"serial_port": "/dev/ttyUSB0", "unit_id": 0}, "unit_id must be 1 to 247"),
        ({"serial_port": "/dev/ttyUSB0", "stopbits": 3}, "stopbits must be 1 to 2"),
        ({"host": "10.0.0.7", "request_timeout": 0.01}, "request_timeout must be 0.05 to 5 s"),
    ],
)
def test_invalid_settings_name_the_parameter(settings: dict[str, Any], named: str) -> None:
    with pytest.raises(OutOfRange, match=f"^{named}"):
        ModbusSettings(**settings)
