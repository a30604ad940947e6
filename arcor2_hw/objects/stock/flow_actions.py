"""Program flow: end the program, wait, repeat, show a message."""

import logging
import threading
from typing import ClassVar

from arcor2_hw.actions import StrEnum, action
from arcor2_hw.data.device import Severity
from arcor2_hw.exceptions import Cancelled, ProgramFinished
from arcor2_hw.objects import Generic, Settings

log = logging.getLogger(__name__)


class AlarmLevel(StrEnum):
    """Urgency of an alarm of a program."""

    INFO = "info"
    WARNING = "warning"
    ERROR = "error"


class FlowActions(Generic):
    """Ends a program, waits, repeats, and shows messages."""

    category = "Program"
    icon = "flow"
    _ABSTRACT = False
    display_name = "Program flow"
    CANCEL_MAPPING: ClassVar[dict[str, str]] = {"wait": "cancel"}

    def __init__(self, obj_id: str, name: str, settings: Settings | None = None) -> None:
        super().__init__(obj_id, name, settings)
        self._cancelled = threading.Event()
        self._rounds: dict[str | None, int] = {}

    @action
    def finish(self, *, an: str | None = None) -> None:
        """End the program."""
        raise ProgramFinished

    @action(deadline=None)
    def wait(self, seconds: float = 1.0, *, an: str | None = None) -> None:
        """Wait before the next action.

        :param seconds: duration, s
        """
        assert 0.0 <= seconds <= 86400.0

        self._cancelled.clear()
        if self._cancelled.wait(seconds):
            raise Cancelled("{name}: the wait was cancelled", name=self.name)

    def cancel(self) -> None:
        """Cancel the present wait."""
        self._cancelled.set()

    @action
    def show_message(self, text: str, *, an: str | None = None) -> None:
        """Show a message on the operator's screen until the next one or the end of the program. Does not wait.

        :param text: message, such as "Refill the labels"
        """
        log.info("%s: message: %s", self.name, text)

    @action(quick=True)
    def raise_alarm(self, text: str, level: AlarmLevel = AlarmLevel.WARNING, *, an: str | None = None) -> None:
        """Raise an alarm for the operator and continue. It stays until the program clears it or ends.

        :param text: what the operator needs to know or do, such as "Empty the box for bad parts"
        :param level: how urgent it is
        """
        self.set_condition(f"raised_{level.value}:{text[:40]}", True, text, severity=Severity(level.value))

    @action(quick=True)
    def clear_alarms(self, *, an: str | None = None) -> None:
        """Clear the alarms that this object has raised."""
        self.conditions.clear()

    @action
    def repeat(self, times: int = 2, *, an: str | None = None) -> bool:
        """Return true the given number of times, then once false, then start again: a loop condition.

        Each action has its own count, by its name.

        :param times: number of times that the branch for true is taken
        """
        assert 0 <= times <= 1000000

        done = self._rounds.get(an, 0)
        if done < times:
            self._rounds[an] = done + 1
            return True
        self._rounds[an] = 0
        return False
