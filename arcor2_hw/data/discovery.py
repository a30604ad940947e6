"""Results of the integrator's commands: devices found on a machine, and the state of the devices of a cell."""

import enum
from typing import Final

from msgspec import field

from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.data.device import Alarm, Connection, Health, Identity


class Search(enum.StrEnum):
    """Kinds of searches: serial ports, nodes of a CAN bus, OAK cameras, devices in a network."""

    SERIAL = "serial"
    CAN = "can"
    OAK = "oak"
    UR = "ur"
    MODBUS = "modbus"


NETWORK: Final = (Search.UR, Search.MODBUS)
"""Searches of addresses that a user enters."""


class Found(Data, frozen=True):
    """A detected device: its kind, its address (as in a setting), and its identity. node: number on a CAN bus."""

    kind: str
    address: str
    description: str = ""
    serial: str = ""
    node: int | Unset = UNSET


class Checked(Data, frozen=True):
    """State of one device of a cell. seconds: time to connect, s. problem: description of the problem, or empty."""

    name: str
    type: str
    address: str = ""
    connection: Connection = Connection.FAILED
    identity: Identity | None = None
    health: Health = Health.NORMAL
    alarms: list[Alarm] = field(default_factory=list)
    control_owner: str | None = None
    seconds: float = 0.0
    problem: str = ""

    @property
    def fit(self) -> bool:
        """Return whether the device is connected and works."""
        return not self.problem and self.health not in (Health.FAILURE, Health.OFF_SPEC)
