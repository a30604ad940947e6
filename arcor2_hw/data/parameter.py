"""Named values: settings of an object, parameters of an action."""

from arcor2_hw.data.base import Data


class Parameter(Data, frozen=True):
    """A named value; `value` is a JSON document in a string."""

    name: str
    type: str
    value: str


class IdValue(Data, frozen=True):
    """A value with the id of its owner."""

    id: str
    value: str


class Range(Data, frozen=True):
    """An inclusive range."""

    min: float
    max: float
