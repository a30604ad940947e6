"""Settings of an object type: a dataclass, filled from the scene object's parameters."""

import dataclasses

from arcor2_hw.exceptions import OutOfRange


@dataclasses.dataclass
class Settings:
    """Base of every settings dataclass: fields are bool, int, float, str or enumerations."""


def check_host(host: str, port: int) -> None:
    """Raise OutOfRange, naming the setting, unless a host is given and the port is one."""
    if not host.strip():
        raise OutOfRange("host must be the address of the device")
    if not 1 <= port <= 65535:
        raise OutOfRange(f"port must be 1 to 65535, not {port!r}")
