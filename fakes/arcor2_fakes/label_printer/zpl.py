"""ZPL on the side of the printer: split bytes into commands, and a format into its fields.

Source: ZPL II programming guide: ^XA, ^XZ, ^FO, ^FH, ^FD, ^FS, ^BC, ^PQ, ~HS, ~HI, and SGD getvar and setvar.
"""

from __future__ import annotations

import re
from typing import Final

import msgspec

MAX_FORMAT: Final = 65536
_COMMAND: Final = re.compile(r"\^(A[0-9@A-Z]|[A-Z][A-Z0-9])([^\^]*)")
_GETVAR: Final = re.compile(rb'! U1 getvar "([a-z0-9._]{1,64})"\r\n')
_SETVAR: Final = re.compile(rb'! U1 setvar "([a-z0-9._]{1,64})" "([\x20-\x21\x23-\x7e]{1,80})"\r\n')
_HEX: Final = 2


class Field(msgspec.Struct, frozen=True):
    """A field of a label: position (dots), whether it is a barcode, and text."""

    x: int
    y: int
    barcode: bool
    text: str


class Format(msgspec.Struct, frozen=True):
    """The content between ^XA and ^XZ."""

    zpl: str
    fields: list[Field]
    quantity: int


class Stream:
    """Splits received bytes into ``~HS``, ``~HI``, ``getvar NAME``, ``setvar NAME=VALUE`` and formats."""

    def __init__(self) -> None:
        self._format: bytearray | None = None
        self._rest = bytearray()

    @property
    def partial(self) -> bool:
        """Return whether a format was received partially."""
        return self._format is not None

    def clear(self) -> None:
        """Discard an incomplete command."""
        self._format = None
        self._rest.clear()

    def feed(self, data: bytes) -> list[str | Format]:
        """Return the complete commands, in order."""
        found: list[str | Format] = []
        for byte in data:
            self._rest.append(byte)
            item = self._step()
            if item is not None:
                found.append(item)
        return found

    def _step(self) -> str | Format | None:
        """Check whether the last byte completes a command. A ~ command is valid everywhere, also inside a format."""
        rest = self._rest
        if len(rest) >= 3 and rest[-3] == 0x7E:
            command = bytes(rest[-3:]).decode("latin-1")
            del rest[-3:]
            return command
        if self._format is None:
            if rest.endswith(b"^XA"):
                self._format = bytearray()
                rest.clear()
            elif rest.endswith(b"\r\n"):
                query, change = _GETVAR.search(bytes(rest)), _SETVAR.search(bytes(rest))
                rest.clear()
                if change:
                    return f"setvar {change[1].decode()}={change[2].decode()}"
                return f"getvar {query[1].decode()}" if query else None
            elif len(rest) > 256:
                del rest[:-3]  # noise between formats is ignored
        elif rest.endswith(b"^XZ"):
            text = bytes(rest[:-3])
            self.clear()
            return parse(text)
        elif len(rest) > MAX_FORMAT:
            self.clear()
        return None


def parse(body: bytes) -> Format:
    """Parse a format. Unknown commands are ignored, as by a printer."""
    text = body.decode("latin-1")
    fields: list[Field] = []
    quantity, x, y, barcode, escape = 1, 0, 0, False, ""
    for name, argument in _COMMAND.findall(text):
        if name == "FO":
            x, y = _numbers(argument, 2)
        elif name == "BC":
            barcode = True
        elif name == "FH":
            escape = argument[:1] or "_"
        elif name == "PQ":
            quantity = max(1, _numbers(argument, 1)[0])
        elif name == "FD":
            fields.append(Field(x, y, barcode, _data(argument, escape, barcode)))
        elif name == "FS":
            barcode, escape = False, ""
    return Format(text, fields, quantity)


def _numbers(argument: str, count: int) -> list[int]:
    parts = [int(part) if part.isdigit() else 0 for part in argument.split(",")]
    return (parts + [0] * count)[:count]


def _data(text: str, escape: str, barcode: bool) -> str:
    """Return the printed text: without hexadecimal escapes and, in Code 128, without invocation codes."""
    raw = bytearray()
    position = 0
    while position < len(text):
        digits = text[position + 1 : position + 1 + _HEX]
        if escape and text[position] == escape and re.fullmatch("[0-9A-Fa-f]{2}", digits):
            raw.append(int(digits, 16))
            position += 1 + _HEX
        else:
            raw += text[position].encode("latin-1")
            position += 1
    shown = raw.decode("utf-8", "replace")
    return re.sub(r">(.)", lambda code: ">" if code[1] == "0" else "", shown) if barcode else shown
