"""A program that is held at a failed action until a person decides how to continue."""

import enum

from msgspec import field

from arcor2_hw.data.base import UNSET, Data, Timestamp, TranslatableData, Unset
from arcor2_hw.data.object_type import Again


class OnError(enum.StrEnum):
    """Reaction of a program if an action fails and no error exit applies: end, or hold until a person decides."""

    END = "end"
    HOLD = "hold"


class HoldChoice(enum.StrEnum):
    """The continuation of a held program.

    RETRY repeats the action, or starts it if the program is held before it. RESULT continues with results that a person
    supplies. SKIP continues as if an action without results had succeeded. ERROR_EXIT takes an error exit although it
    does not name this error. END ends the program with the error.
    """

    RETRY = "retry"
    RESULT = "result"
    SKIP = "skip"
    ERROR_EXIT = "error_exit"
    END = "end"


class ResultType(Data, frozen=True):
    """Type of a result that a person may supply: boolean, integer, double, string, integer_enum or string_enum.

    members: the values of an enumeration, JSON in a text.
    """

    type: str
    members: list[str] = field(default_factory=list)


class HoldExit(Data, frozen=True):
    """An error exit: id of its logic item, the kinds that it names, and the name of the next action (empty: END)."""

    id: str
    kinds: list[str]
    next: str = ""


class HeldData(TranslatableData, frozen=True):
    """Data of the event Held: the action at which the program is held, its error, and the possible decisions.

    run: number of the run. number: of the action in the run. device: id of the object. kind: code of the error. text:
    the error, with `key` and `values`. again: whether the action is safe to retry, or the person has to be asked;
    omitted if a retry is not possible or nothing is repeated. returns: types of the results for the choice `result`.
    exits: error exits for the choice `error_exit`. before: whether the action has not started, because the connection
    of a device was lost.
    """

    run: int
    number: int
    action_id: str
    action_name: str
    device: str
    kind: str
    text: str
    choices: list[HoldChoice]
    since: Timestamp
    again: Again | Unset = UNSET
    returns: list[ResultType] | Unset = UNSET
    exits: list[HoldExit] | Unset = UNSET
    before: bool | Unset = UNSET


class HoldDecidedData(Data, frozen=True):
    """Data of the event HoldDecided: the decision about the action with this number, and its author."""

    run: int
    number: int
    choice: HoldChoice
    by: str = ""


class ActionHold(Data, frozen=True):
    """Duration of a hold at an action, and the author of the decision.

    duration: s; omitted while the program is held. choice, by: the decision, and the name of a user or token; omitted
    while the program is held, and if it was stopped.
    """

    since: Timestamp
    duration: float | Unset = UNSET
    choice: HoldChoice | Unset = UNSET
    by: str | Unset = UNSET
