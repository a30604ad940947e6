"""ZPL of the host: builds and checks labels, parses answers. Pure functions.

Source: ZPL II programming guide, ~HS (host status return), ~HI (host identification), ^FH, ^BC, and SGD getvar and
setvar; docs/devices/label-printer.md lists what is used.
"""

import dataclasses
import re
from typing import Final

MAX_LABEL: Final = 32768
MAX_FIELD: Final = 200
HOST_STATUS: Final = b"~HS"
IDENTIFY: Final = b"~HI"
COUNTER: Final = "odometer.total_label_count"
UNIQUE_ID: Final = "device.unique_id"
PARAMETERS: Final = {
    "print.tone": "",
    "media.speed": "in/s",
    "ezpl.print_width": "dot",
    "ezpl.media_type": "",
    "ezpl.print_method": "",
    "ezpl.tear_off": "dot",
    "ezpl.power_up_action": "",
    "ezpl.head_close_action": "",
}
"""Settings of the printer that a technician adjusts, by their names of SGD, with their units."""
UNKNOWN: Final = "?"
"""Answer to getvar for a name that the printer does not have."""
FIELDS: Final = ("title", "text", "code")
DEFAULT_TEMPLATE: Final = (
    "^XA^CI28^PW400^LL240^FO20,20^A0N,40,40{title}^FO20,70^A0N,28,28{text}^FO20,110^BY2^BCN,80,Y,N,N{code}^XZ"
)

_FRAME: Final = re.compile(rb"\x02([\x20-\x7e]{1,120})\x03\r\n")
_QUOTED: Final = re.compile(rb'"([\x20-\x21\x23-\x7e]{0,80})"')
_PLAIN: Final = frozenset(b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789 .,:;-+/()#*=<>@!?%&'")
_PLACE: Final = re.compile(r"\{([^{}]*)\}")
_FORBIDDEN: Final = re.compile(r"\^(CC|CT|CD|DF|XF|JU|MP|XA|XZ|PQ(?!1(?![0-9])))", re.IGNORECASE)


class BadLabel(ValueError):
    """The text is not a single label; the message says why."""


@dataclasses.dataclass(frozen=True)
class Status:
    """The answer to ~HS."""

    paper_out: bool
    paused: bool
    head_open: bool
    ribbon_out: bool
    too_cold: bool
    too_hot: bool
    buffer_full: bool
    partial_format: bool
    formats_waiting: int
    labels_left: int

    @property
    def idle(self) -> bool:
        """Return whether no label is waiting to be printed."""
        return not (self.formats_waiting or self.labels_left or self.partial_format)


def status(data: bytes) -> Status | None:
    """Parse the three strings of ~HS; None while they are incomplete or invalid."""
    strings = [frame.decode("ascii").split(",") for frame in _FRAME.findall(data)]
    for one, two, three in zip(strings, strings[1:], strings[2:], strict=False):
        if (len(one), len(two), len(three)) != (12, 11, 2):
            continue
        flags = (one[1], one[2], one[5], one[7], one[10], one[11], two[2], two[3])
        if any(flag not in ("0", "1") for flag in flags) or not (one[4].isdigit() and two[8].isdigit()):
            continue
        out, pause, full, partial, cold, hot, head, ribbon = (flag == "1" for flag in flags)
        return Status(out, pause, head, ribbon, cold, hot, full, partial, int(one[4]), int(two[8]))
    return None


def identity(data: bytes) -> tuple[str, str] | None:
    """Parse model and firmware in the answer to ~HI; None for another answer."""
    for frame in _FRAME.findall(data):
        parts = frame.decode("ascii").split(",")
        if len(parts) >= 4 and parts[2].isdigit():
            return parts[0], parts[1]
    return None


def getvar(name: str) -> bytes:
    """Return the question for a variable of the printer."""
    return f'! U1 getvar "{name}"\r\n'.encode("ascii")


def setvar(name: str, value: str) -> bytes:
    """Return the command that sets a variable; the printer does not answer it. Raises ValueError."""
    if not re.fullmatch(r"[\x20-\x21\x23-\x7e]{1,80}", value):
        raise ValueError(value)
    return f'! U1 setvar "{name}" "{value}"\r\n'.encode("ascii")


def variable(data: bytes) -> str | None:
    """Parse the answer to getvar, a text in quotes; None for another answer."""
    match = _QUOTED.search(data)
    return None if match is None else match[1].decode("ascii")


def number(data: bytes) -> int | None:
    """Parse the answer to getvar when it is a number; None for another answer."""
    text = variable(data)
    return int(text) if text is not None and text.isdigit() else None


def field(text: str, barcode: bool = False) -> str:
    """Return ^FH^FD…^FS that prints exactly `text`: nothing in it acts as a command. Raises BadLabel."""
    if len(text) > MAX_FIELD:
        raise BadLabel(f"is longer than {MAX_FIELD} characters")
    if not text.isprintable():
        raise BadLabel("has characters that cannot be printed")
    if barcode:
        if not text.isascii():
            raise BadLabel("has characters that Code 128 does not contain")
        text = text.replace(">", ">0")  # > starts an invocation code of ^BC
    try:
        raw = text.encode("utf-8")
    except UnicodeEncodeError as e:
        raise BadLabel("has characters that cannot be sent") from e
    data = "".join(chr(byte) if byte in _PLAIN else f"_{byte:02X}" for byte in raw)
    return f"^FH_^FD{data}^FS"


def fill(template: str, fields: dict[str, str]) -> str:
    """Fill the places of a template, {title}, {text} and {code}. Raises BadLabel naming the field."""

    def place(match: re.Match[str]) -> str:
        name = match[1]
        try:
            return field(fields[name], barcode=name == "code")
        except BadLabel as e:
            raise BadLabel(f"{name} {e}") from e

    return _PLACE.sub(place, template)


def check_template(template: str) -> None:
    """Raise BadLabel unless the filled template is one label."""
    for name in _PLACE.findall(template):
        if name not in FIELDS:
            raise BadLabel(f"has a place {{{name}}}; there are {', '.join(FIELDS)}")
    check_label(fill(template, dict.fromkeys(FIELDS, "x")))


def check_label(label: str) -> bytes:
    """Return the bytes of a label. Raises BadLabel unless it is one format that is printed once."""
    text = label.strip()
    if not (text.startswith("^XA") and text.endswith("^XZ") and len(text) > len("^XA^XZ")):
        raise BadLabel("must start with ^XA and end with ^XZ")
    if len(text) > MAX_LABEL:
        raise BadLabel(f"is longer than {MAX_LABEL} characters")
    if "~" in text:
        raise BadLabel("has a ~: a label may not contain control commands")
    if found := _FORBIDDEN.search(text, 3, len(text) - 3):
        raise BadLabel(f"has {found[0]}, which is not allowed in a single label")
    return text.encode("utf-8")
