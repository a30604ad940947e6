"""A named value on the wire: settings of an object, parameters of an action."""

from arcor2_hw.data.base import Data


class Parameter(Data, frozen=True):
    """`value` is a JSON document inside a string."""

    name: str
    type: str
    value: str


class IdValue(Data, frozen=True):
    """A value by the id of what it belongs to."""

    id: str
    value: str


class Range(Data, frozen=True):
    """An inclusive range."""

    min: float
    max: float
