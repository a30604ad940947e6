"""What older sources declare themselves with."""

from typing import NamedTuple


class DynamicParamTuple(NamedTuple):
    """A value of DYNAMIC_PARAMS: the method that gives the values of a parameter, and the parameters it needs first."""

    method: str
    parents: set[str]
