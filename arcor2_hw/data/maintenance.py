"""Maintenance of devices: device cards, parameters and their backups."""

import hashlib
from typing import Annotated

import msgspec
from msgspec import Meta, field

from arcor2_hw.data.base import UNSET, Data, Timestamp, TranslatableData, Unset
from arcor2_hw.data.device import Identity

ParameterValue = bool | int | float | str
MAX_PARAMETERS = 10_000
"""Maximum number of parameters of a device."""


class DeviceParameter(Data, frozen=True):
    """A parameter that a device stores.

    name: unique in the device, as in its manual, such as "servo 1: homing offset". unit: of the value as the device
    stores it; empty for a plain number.
    """

    name: Annotated[str, Meta(min_length=1, max_length=200)]
    value: ParameterValue
    unit: str = ""


class ParameterFailure(TranslatableData, frozen=True):
    """A parameter that could not be written, and the reason."""

    name: str
    reason: str


class ParameterDifference(Data, frozen=True):
    """A parameter with different values in a backup and in the device. A missing value is omitted."""

    name: str
    backup: ParameterValue | Unset = UNSET
    device: ParameterValue | Unset = UNSET
    unit: str = ""


class BackupInfo(Data, frozen=True):
    """A backup of the parameters of a device, without the parameters.

    identity: of the device that was read. at, by: time, and the user who requested it. count: number of parameters.
        digest: SHA-256 of identity, type and parameters. uploaded: whether it was uploaded as a file.
    """

    id: str
    object_id: str
    object_type: str
    identity: Identity
    at: Timestamp
    by: str
    count: int
    digest: str
    uploaded: bool = False


class ParameterBackup(Data, frozen=True):
    """The parameters of a device in the form of the file. Fields as in BackupInfo."""

    object_type: str
    identity: Identity
    at: Timestamp
    parameters: Annotated[list[DeviceParameter], Meta(max_length=MAX_PARAMETERS)]
    digest: str = ""

    def computed_digest(self) -> str:
        """Return the digest of the contents."""
        contents = (self.object_type, self.identity, sorted(self.parameters, key=lambda each: each.name))
        return hashlib.sha256(msgspec.json.encode(contents)).hexdigest()


class DeviceCard(TranslatableData, frozen=True):
    """Identity and state of a device of the workplace.

    Attributes:
        object_id: Id of the scene object.
        name: Its name.
        object_type: Its object type.
        identity: The confirmed identity; the first one needs no confirmation.
        found: The identity of the connected device, if it is not the confirmed one. Then it is not commanded.
        differing: The fields of `found` that differ.
        first_seen: Time of the first connection of the device.
        seen: Time at which its identity was last read.
        confirmed_at: Time at which a technician confirmed the identity; omitted if it was seen first.
        confirmed_by: The technician who confirmed it.
        parameters: Whether the driver can read the parameters.
        restores: Whether it can write them.
        hours: Hours for which the device was connected since `counted_since`.
        cycles: Number of actions that it executed since then.
        counters: Counters of the device itself by name, read together with its identity.
        counted_since: Time at which this device, by its serial number, was put into operation here.
        problem: Reason why the identity could not be read at the last connection; `key` and `values` translate it.
        backups: The backups of its parameters, newest first.
    """

    object_id: str
    name: str
    object_type: str
    identity: Identity
    first_seen: Timestamp
    seen: Timestamp
    counted_since: Timestamp
    found: Identity | Unset = UNSET
    differing: list[str] = field(default_factory=list)
    confirmed_at: Timestamp | Unset = UNSET
    confirmed_by: str | Unset = UNSET
    parameters: bool = False
    restores: bool = False
    hours: float = 0.0
    cycles: int = 0
    counters: dict[str, int] = field(default_factory=dict)
    problem: str | Unset = UNSET
    backups: list[BackupInfo] = field(default_factory=list)
