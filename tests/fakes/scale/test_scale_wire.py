"""The fake scale as a host sees it: pyserial against the process, bytes as in the MT-SICS command set."""

from collections.abc import Callable
from typing import Any

import serial


def test_commands_on_the_wire(start_fake: Callable[..., Any]) -> None:
    fake = start_fake("scale", "--settling", "0.2", "--stability-timeout", "0.3")
    with serial.serial_for_url(fake.ready["port"], timeout=2.0) as line:

        def ask(command: bytes) -> bytes:
            line.write(command + b"\r\n")
            return bytes(line.read_until(b"\r\n"))

        assert ask(b"I4") == b'I4 A "B021002593"\r\n'
        fake.control.do("put", kg=0.1)
        assert ask(b"SI").startswith(b"S D ")
        assert ask(b"S") == b"S S     100.00 g\r\n"  # waited for
        assert ask(b"T") == b"T S     100.00 g\r\n"
        assert ask(b"SI") == b"S S       0.00 g\r\n"
        assert ask(b"@") == b'I4 A "B021002593"\r\n'
        assert ask(b"TA") == b"TA A       0.00 g\r\n"
        assert ask(b"Z") == b"Z +\r\n"
        assert ask(b"XY") == b"ES\r\n"
        assert ask(b"T 5") == b"EL\r\n"
        fake.control.do("put", kg=9.0)
        fake.control.wait_until(lambda truth: truth["stable"])
        assert ask(b"S") == b"S +\r\n"
        fake.control.do("put", kg=0.0)
        fake.control.do("vibrate", on=True)
        fake.control.do("unit", value="kg")
        assert ask(b"S") in (b"S I\r\n", b"S +\r\n")
        fake.control.do("error", code="ET")
        assert ask(b"SI") == b"ET\r\n"
