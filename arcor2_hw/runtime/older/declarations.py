"""Types that older sources use in their declarations."""

from typing import NamedTuple


class DynamicParamTuple(NamedTuple):
    """Value of DYNAMIC_PARAMS: the method that returns the values of a parameter, and the parameters it depends on."""

    method: str
    parents: set[str]
