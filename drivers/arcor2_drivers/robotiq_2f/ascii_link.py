"""AsciiLink: the gripper on the ASCII port of the URCap. Protocol: docs/devices/robotiq-2f.md."""

import re
from typing import Final

from arcor2_hw.exceptions import DeviceFault, Refused
from arcor2_hw.messages import device_at
from arcor2_hw.objects.line import Line

from .status import Activation, Command, Object, Status

LONGEST: Final = 64
"""Maximum length of an answer, bytes; a valid one has about ten."""
_VALUE: Final = re.compile(rb"([A-Z]{3}) ([0-9A-F]{1,3})\r?\n")
_ACKNOWLEDGED: Final = re.compile(rb"ack(\r?\n)?")
_ORDER: Final = ("ACT", "GTO", "STA", "FLT", "PRE", "OBJ", "POS")
"""Variables in the order of reading. OBJ comes after the request it depends on, so that it is never older."""


class AsciiLink(Line):
    """A gripper on a TCP port. A missing or invalid answer breaks the line, see `Line`."""

    def __init__(self, name: str, host: str, port: int, request_timeout: float) -> None:
        super().__init__(device_at(name, f"{host}:{port}"), f"socket://{host}:{port}", answer_timeout=request_timeout)

    def read(self) -> Status:
        """Read all variables. Raise DeviceTimeout, ConnectionLost, DeviceFault, or ValueError for an invalid status."""
        values = {name: self._get(name) for name in _ORDER}
        return Status(
            act=bool(values["ACT"]),
            go_to=bool(values["GTO"]),
            activation=Activation(values["STA"]),
            object=Object(values["OBJ"]),
            fault=values["FLT"] & 0x0F,
            echo=values["PRE"],
            position=values["POS"],
        )

    def write(self, command: Command) -> None:
        """Set variables in one line. Raise Refused, DeviceTimeout or ConnectionLost."""
        values = {
            "ACT": int(command.act),
            "GTO": int(command.go_to),
            "SPE": command.speed,
            "FOR": command.force,
            "POS": command.position,
        }
        line = " ".join(["SET", *(f"{name} {value}" for name, value in values.items() if value is not None)])
        if not self._exchange(line, _ACKNOWLEDGED):
            raise Refused("{device} refuses the command {line}.", device=self.who, line=line)

    def _get(self, name: str) -> int:
        found = self._exchange(f"GET {name}", _VALUE)
        if not found:
            raise DeviceFault("{device} has no variable {name}.", device=self.who, name=name)
        answered, value = found[1].decode(), found[2].decode()
        number = int(value, 16 if any(c in "ABCDEF" for c in value) else 10)  # FLT may come as two hex digits
        if answered != name or number > 255:
            raise self.broken(
                DeviceFault(
                    "{device} answered {answered} {value} to a request for {name}.",
                    device=self.who,
                    answered=answered,
                    value=value,
                    name=name,
                )
            )
        return number

    def _exchange(self, line: str, expected: re.Pattern[bytes]) -> re.Match[bytes] | None:
        """Send a line and return the answer; None if the gripper refuses the line."""

        def answer(received: bytes) -> re.Match[bytes] | bool | None:
            received = received.lstrip(b"\r\n ")
            if found := expected.fullmatch(received):
                return found
            if received.rstrip(b"\r\n") in (b"?", b"nack"):
                return False
            if received.endswith(b"\n") or len(received) > LONGEST or not received.isascii():
                raise self.broken(
                    DeviceFault(
                        "{device} sent an invalid answer to {line}.", repr(received[:32]), device=self.who, line=line
                    )
                )
            return None

        found = self.ask(line.encode("ascii") + b"\n", answer, line)
        return found if isinstance(found, re.Match) else None
