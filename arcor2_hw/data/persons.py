"""Persons who log on at shared devices."""

from msgspec import field

from arcor2_hw.data.base import UNSET, Data, Timestamp, TranslatableData, Unset
from arcor2_hw.data.role import RoleName


class LockOut(Data, frozen=True):
    """Wrong PINs of a person at a device.

    Args:
        device: name of the token of the device, or its address.
        wrong: number of wrong PINs since the last log-on there.
        until: when the person can try again there; unset if they can try now.
    """

    device: str
    wrong: int
    until: Timestamp | Unset = UNSET


class Person(Data, frozen=True):
    """A person who logs on at shared devices.

    Args:
        id: id of the person.
        name: their name, which is unique.
        role: their role. The token of the device may lower it.
        pin: whether they log on with a PIN.
        card: whether they log on with a card.
        lock_outs: wrong PINs; only administrators receive them.
    """

    id: str
    name: str
    role: RoleName
    pin: bool
    card: bool
    lock_outs: list[LockOut] = field(default_factory=list)


class LogOnChangedData(TranslatableData, frozen=True):
    """Data of LogOnChanged: the person who is logged on at the connection, and the reason of a log-off.

    Args:
        role: the role of the connection.
        person: the person; unset if nobody is logged on.
        reason: reason why the server logged the person off; empty otherwise.
    """

    role: RoleName
    person: Person | Unset = UNSET
    reason: str = ""
