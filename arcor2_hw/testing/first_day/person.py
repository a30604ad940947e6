"""The person at the device, who answers the questions of the session."""

from typing import Any, Protocol

from arcor2_hw.exceptions import Arcor2Error


class Person(Protocol):
    """The person at the device."""

    def say(self, text: str, style: Any = "text") -> None:
        """Show a line."""

    def show(self, columns: list[str], rows: list[list[str]]) -> None:
        """Show a table."""

    def confirm(self, question: str) -> bool:
        """Ask a question that is answered by yes or no."""

    def done(self, instruction: str) -> None:
        """Wait until something is done."""

    def ask(self, question: str) -> str:
        """Ask for a text."""


class Interrupted(Arcor2Error):
    """The person ended the session."""

    code = "interrupted"
