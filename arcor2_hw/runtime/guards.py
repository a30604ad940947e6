"""Motions that interlocks have admitted, and the reasons for refused ones."""

from collections.abc import Callable
from typing import NamedTuple

from arcor2_hw.data.geometry import Position
from arcor2_hw.exceptions import Interlocked
from arcor2_hw.messages import Message
from arcor2_hw.runtime.device import Device
from arcor2_hw.runtime.retreat import ZoneExit


class Guard:
    """An action or hold-to-run motion that was admitted and has not ended.

    Args:
        device: its device.
        what: its name, for messages.
        zones: the zones that it has.
        watched: ids of the interlocks whose conditions it needs until its end.
        targets_known: whether the targets were known when it was admitted.
        stop: stops it, with the reason.
    """

    def __init__(
        self,
        device: Device,
        what: str,
        zones: set[str],
        watched: set[str],
        targets_known: bool,
        stop: Callable[[Interlocked], None],
    ) -> None:
        self.device, self.what, self.zones, self.watched = device, what, zones, watched
        self.targets_known, self.stop = targets_known, stop
        self.broken: Interlocked | None = None
        """Reason of the stop."""
        self.leaving: ZoneExit | None = None
        """Set if the motion may only leave the zones in which the robot is."""
        self.retracts = False
        """Whether the motion follows the retract paths of these zones."""


class Obstruction(NamedTuple):
    """Reason why an action may not start. patience: maximum waiting time, s."""

    reason: Message
    patience: float


class Track(NamedTuple):
    """The positions of the end effectors of a robot. inside: the zones in which they are."""

    at: float
    tips: list[Position]
    inside: frozenset[str]
