"""Messages between the terminal and the process that leads through the first day with a real device.

The process prints one output message per line on standard output, and reads one input message per line.
"""

from typing import Literal

from arcor2_hw.data.base import Data

Style = Literal["heading", "text", "good", "bad", "warning"]


class Say(Data, frozen=True, tag="say"):
    """A line of text."""

    text: str
    style: Style = "text"


class Show(Data, frozen=True, tag="show"):
    """A table."""

    columns: list[str]
    rows: list[list[str]]


class Ask(Data, frozen=True, tag="ask"):
    """A question that the person answers: by yes or no, by Enter when something is done, or by a text."""

    question: str
    answer: Literal["yes_no", "done", "text"]


Output = Say | Show | Ask


class Answer(Data, frozen=True, tag="answer"):
    """The answer to the latest question: `yes`, `no`, or the text."""

    text: str


class Interrupt(Data, frozen=True, tag="interrupt"):
    """Ctrl-C, or the end of the terminal: stop the device, disconnect, and write the report."""


Input = Answer | Interrupt
