"""Parameters: the setup of the drive that it stores (CiA 402), for backups."""

import struct
from typing import Final

from arcor2_hw.data.maintenance import DeviceParameter, ParameterFailure
from arcor2_hw.exceptions import DeviceFault
from arcor2_hw.messages import Message

from .cia402 import Entry
from .link import CanLink

STORE: Final = Entry(0x1010, 1, "<I", "store parameters")
SAVE: Final = int.from_bytes(b"save", "little")
"""The value of 1010h:01 that stores all parameters (CiA 301)."""
_ABSENT: Final = frozenset({"06020000h", "06090011h"})
"""SDO aborts of objects and subindices that a drive does not have."""

PARAMETERS: Final = {
    f"{entry.title} ({entry.at:04X}h{f':{entry.subindex:02X}' if entry.subindex else ''})": (entry, unit)
    for entry, unit in (
        (Entry(0x605B, 0, "<h", "shutdown option"), ""),
        (Entry(0x605C, 0, "<h", "disable operation option"), ""),
        (Entry(0x605D, 0, "<h", "halt option"), ""),
        (Entry(0x605E, 0, "<h", "fault reaction option"), ""),
        (Entry(0x6065, 0, "<I", "following error window"), "counts"),
        (Entry(0x6066, 0, "<H", "following error timeout"), "ms"),
        (Entry(0x6067, 0, "<I", "position window"), "counts"),
        (Entry(0x6068, 0, "<H", "position window time"), "ms"),
        (Entry(0x606D, 0, "<H", "velocity window"), ""),
        (Entry(0x606E, 0, "<H", "velocity window time"), "ms"),
        (Entry(0x6072, 0, "<H", "maximum torque"), "0.1 %"),
        (Entry(0x6073, 0, "<H", "maximum current"), "0.1 %"),
        (Entry(0x607C, 0, "<i", "home offset"), "counts"),
        (Entry(0x607D, 1, "<i", "lower position limit"), "counts"),
        (Entry(0x607D, 2, "<i", "upper position limit"), "counts"),
        (Entry(0x607E, 0, "<B", "polarity"), ""),
        (Entry(0x607F, 0, "<I", "maximum profile velocity"), ""),
        (Entry(0x6080, 0, "<I", "maximum motor speed"), "1/min"),
        (Entry(0x6086, 0, "<h", "motion profile type"), ""),
        (Entry(0x608F, 1, "<I", "encoder increments"), ""),
        (Entry(0x608F, 2, "<I", "motor revolutions of the encoder"), ""),
        (Entry(0x6091, 1, "<I", "motor revolutions of the gear"), ""),
        (Entry(0x6091, 2, "<I", "shaft revolutions of the gear"), ""),
        (Entry(0x6092, 1, "<I", "feed"), ""),
        (Entry(0x6092, 2, "<I", "shaft revolutions of the feed"), ""),
    )
}
"""Entries and units of the parameters by name. The driver writes none of them from its settings."""


def dump(link: CanLink) -> list[DeviceParameter]:
    """Read the parameters that the drive has. Raise DeviceTimeout, ConnectionLost or DeviceFault."""
    found = []
    for name, (entry, unit) in PARAMETERS.items():
        try:
            found.append(DeviceParameter(name, link.read(entry), unit))
        except DeviceFault as error:
            if error.fault_code not in _ABSENT:
                raise
    return found


def restore(link: CanLink, parameters: list[DeviceParameter]) -> list[ParameterFailure]:
    """Write parameters, and let the drive store them. Return those that it refused. Raise as `dump`."""
    reasons = {each.name: _write(link, each) for each in parameters}
    written = [name for name, reason in reasons.items() if reason is None]
    try:
        if written:
            link.write(STORE, SAVE)
    except DeviceFault as error:
        lost = Message.of("It is written, but lost when the drive is switched off: {reason}", reason=error.message)
        reasons |= dict.fromkeys(written, lost)
    return [
        ParameterFailure(name, reason.text, **reason.translation())
        for name, reason in reasons.items()
        if reason is not None
    ]


def _write(link: CanLink, parameter: DeviceParameter) -> Message | None:
    """Write a parameter. Return the reason if the drive does not use it, otherwise None."""
    if (known := PARAMETERS.get(parameter.name)) is None:
        return Message.of("The driver knows no parameter {parameter}.", parameter=parameter.name)
    entry, _ = known
    try:
        if type(parameter.value) is not int:
            raise struct.error
        struct.pack(entry.form, parameter.value)
    except struct.error:
        return Message.of("{value} is not a value of this parameter.", value=parameter.value)
    try:
        link.write(entry, parameter.value)
    except DeviceFault as error:
        return error.message
    return None
