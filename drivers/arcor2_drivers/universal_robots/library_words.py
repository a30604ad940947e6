"""What ur_rtde 1.6.5 says in words, and what it means: refusals of control, and a connection that broke."""

from typing import Final

from arcor2_hw.exceptions import DeviceError, DeviceFault, NotInControl

_BROKEN: Final = (b"disconnected", b"could not receive", b"closed the connection", b"lost connection", b"reconnecting")
"""In lower case, when its connection has broken and before it connects again."""


def says_broken(line: bytes) -> bool:
    """Tell whether a line of its output says that its connection broke."""
    return any(word in line.lower() for word in _BROKEN)


def refusal(who: str, upper: bool, text: str) -> DeviceError:
    """Give the error that its constructor's words mean; `upper`: it was to use the upper registers."""
    lower = text.lower()
    if "in use" in lower or "in_use" in lower:
        block = "24 to 47" if upper else "0 to 23"
        return NotInControl(f"the input registers {block} of {who} are used by a fieldbus or another client", text)
    if "remote control" in lower:
        return NotInControl(f"{who} is in local control", text)
    return DeviceFault(f"{who} does not start the control program", text)
