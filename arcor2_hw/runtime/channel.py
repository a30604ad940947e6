"""The interface through which a running program reports its events."""

from collections.abc import Sequence
from typing import Protocol

from arcor2_hw.data.position import MAIN_BRANCH, Frame
from arcor2_hw.messages import Message


class Channel(Protocol):
    """Destination of the events of a program."""

    def event(
        self,
        name: str,
        encoded: bytes,
        number: int = 0,
        action: str = "",
        time: float = 0.0,
        device: str = "",
        waited: float = 0.0,
        call: int = 0,
        frames: Sequence[Frame] = (),
        branch: str = MAIN_BRANCH,
        attempt: int = 1,
    ) -> None:
        """Send an encoded event. The other arguments describe the call of an action, see ProgramEvent."""

    def changed(self, state: str) -> None:
        """Report that the program is running or paused."""

    def action_over(self, number: int, duration: float, error: Message | None, waited: float) -> None:
        """Report the end of an action that sends no event at its end: it failed, or the project declares no actions.

        See ActionFailed.
        """
