"""The position of a running program: the call stack of each branch."""

import enum
from typing import Final

from msgspec import field

from arcor2_hw.data.base import UNSET, Data, Unset

MAIN_BRANCH: Final = "main"
"""Id of the branch of the program itself."""


class ProgramStep(enum.StrEnum):
    """End of a step: before the next action of the same function or a caller, of any function, or of a caller."""

    OVER = "over"
    INTO = "into"
    OUT = "out"


class Frame(Data, frozen=True):
    """A position in the program or in a function.

    action_id: the action that runs, or that is announced. function_id: the function that contains it; omitted in the
    program itself. call_action_id: the action of the frame before this one that called the function.
    """

    action_id: str
    function_id: str | Unset = UNSET
    call_action_id: str | Unset = UNSET


class Branch(Data, frozen=True):
    """The call stack of a branch, from the program itself to the innermost function."""

    id: str = MAIN_BRANCH
    frames: list[Frame] = field(default_factory=list)


class ProgramPosition(Data, frozen=True):
    """The position of a program; without branches no action has been announced, or the run has ended.

    run: number of the run; 0 before the first one.
    """

    run: int = 0
    branches: list[Branch] = field(default_factory=list)
