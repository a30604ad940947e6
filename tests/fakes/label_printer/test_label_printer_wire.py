"""The fake label printer as a host sees it: pyserial against the process, bytes as in the ZPL guide."""

from collections.abc import Callable
from typing import Any

import serial

GETVAR = b'! U1 getvar "odometer.total_label_count"\r\n'


def test_commands_on_the_wire(start_fake: Callable[..., Any]) -> None:
    fake = start_fake("label_printer", "--duration", "0.05")
    with serial.serial_for_url(fake.ready["port"], timeout=30.0) as line:

        def status() -> bytes:
            line.write(b"~HS")
            return bytes(line.read_until(b"1234,0\x03\r\n"))

        assert status() == (
            b"\x02030,0,0,1245,000,0,0,0,000,0,0,0\x03\r\n\x02000,0,0,0,1,2,6,0,00000000,1,000\x03\r\n\x021234,0\x03\r\n"
        )
        line.write(b"~HI")
        assert line.read_until(b"\n") == b"\x02ZT411-203dpi,V92.21.39Z,8,65536KB\x03\r\n"
        line.write(b"^XA^FO10,20^FH_^FDa_5Eb^FS^BCN^FDx>0^FS^PQ2^XZ")
        truth = fake.control.wait_until(lambda truth: truth["counter"] == 2)
        assert truth["labels"][0]["fields"] == [
            {"x": 10, "y": 20, "barcode": False, "text": "a^b"},
            {"x": 10, "y": 20, "barcode": True, "text": "x>"},
        ]
        line.write(GETVAR)
        assert line.read(3) == b'"2"'
        line.write(b"^XA^FDhalf")
        assert status().startswith(b"\x02030,0,0,1245,000,0,0,1,")
        fake.control.do("media", labels=0)
        line.timeout = 0.2
        line.write(b"~HS")
        assert line.read(1) == b""  # out of media: no reply
