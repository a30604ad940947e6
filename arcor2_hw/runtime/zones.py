"""Tokens of zones: at most one robot has a zone. They are taken in one order, the same for all robots."""

import threading
from collections.abc import Iterable
from typing import NamedTuple


class Busy(NamedTuple):
    """A zone of another robot. deadlock: whether that robot waits, directly or indirectly, for the requesting robot."""

    zone: str
    owner: str
    deadlock: bool


class ZoneTokens:
    """The owner of each zone. Any thread may call it; nothing waits.

    Each robot takes its zones in the order of their ids, and keeps those that it has while it waits for the next one.
    So robots that are in no zone cannot block each other. A robot inside of a zone can, which is detected.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._owners: dict[str, str] = {}
        self._wanted: dict[str, str] = {}
        """The zone for which each waiting robot waits."""

    def take(self, robot: str, zones: Iterable[str]) -> Busy | None:
        """Take zones in their order, up to the first one that another robot has.

        Return that zone, or None after taking all.

        Repeat it while it returns a zone. Call `release` to give up.
        """
        with self._lock:
            for zone in sorted(set(zones)):
                owner = self._owners.setdefault(zone, robot)
                if owner != robot:
                    self._wanted[robot] = zone
                    return Busy(zone, owner, self._waits_for(owner, robot))
            self._wanted.pop(robot, None)
            return None

    def _waits_for(self, robot: str, other: str) -> bool:
        seen: set[str] = set()
        while robot not in seen:
            if robot == other:
                return True
            seen.add(robot)
            if (wanted := self._wanted.get(robot)) is None:
                return False
            robot = self._owners.get(wanted, "")
        return False

    def release(self, robot: str, keep: Iterable[str] = ()) -> None:
        """Release the zones of a robot, except those in which it is. The robot no longer waits."""
        kept = set(keep)
        with self._lock:
            self._wanted.pop(robot, None)
            for zone in [zone for zone, owner in self._owners.items() if owner == robot and zone not in kept]:
                del self._owners[zone]

    def owned(self, robot: str) -> set[str]:
        """Return the zones of a robot."""
        with self._lock:
            return {zone for zone, owner in self._owners.items() if owner == robot}

    def owner(self, zone: str) -> str:
        """Return the robot that has a zone; empty if none has."""
        with self._lock:
            return self._owners.get(zone, "")
