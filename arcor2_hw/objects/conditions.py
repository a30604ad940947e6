"""The conditions that a driver reports: its active alarms, with the times at which they became active."""

import threading
import time
from collections.abc import Callable, Iterator
from typing import Final

from arcor2_hw.data.base import now
from arcor2_hw.data.device import Alarm, Severity
from arcor2_hw.messages import Message

_CREATION: Final = threading.Lock()


class Conditions:
    """The active conditions of one object. Any thread may report them."""

    def __init__(self) -> None:
        self._active: dict[str, tuple[Alarm, float]] = {}
        self._lock = threading.Lock()
        self.listener: Callable[[], None] = lambda: None
        """Called after each change, on the thread that reports it. It neither waits nor raises."""

    def set(
        self,
        code: str,
        active: bool,
        text: str | Message = "",
        remedy: str | Message = "",
        severity: Severity = Severity.ERROR,
    ) -> None:
        """Report a condition as active or as ended. Nothing changes for a condition that already is in this state."""
        with self._lock:
            if active == (code in self._active):
                return
            if active:
                self._active[code] = Alarm.of(code, severity, text, remedy, now()), time.monotonic()
            else:
                del self._active[code]
        self.listener()

    def clear(self) -> None:
        """Report all conditions as ended."""
        for code in list(self._active):
            self.set(code, False)

    def alarms(self) -> list[Alarm]:
        """Return the active conditions, oldest first."""
        return [alarm for alarm, _ in list(self._active.values())]

    def raised(self, code: str) -> float | None:
        """Return the time at which a condition became active, on the monotonic clock, s; None if it is not active."""
        found = self._active.get(code)
        return None if found is None else found[1]

    def __contains__(self, code: object) -> bool:
        return code in self._active

    def __iter__(self) -> Iterator[str]:
        return iter(list(self._active))

    def __len__(self) -> int:
        return len(self._active)


def conditions_of(instance: object) -> Conditions:
    """Return the conditions of an object. Types with a constructor of their own need not create them."""
    with _CREATION:
        found = vars(instance).get("_conditions")
        if not isinstance(found, Conditions):
            found = vars(instance)["_conditions"] = Conditions()
        return found
