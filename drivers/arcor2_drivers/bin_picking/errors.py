"""Errors of bin and blister."""

from arcor2_hw.exceptions import Refused


class Empty(Refused):
    """No part is left."""

    code = "empty"


class NoFreePlace(Refused):
    """No free place is left."""

    code = "full"


class PartsTouch(Refused):
    """Touching parts cannot be distinguished."""

    code = "parts_touch"


class BadFit(Refused):
    """No object fits the model of the part well enough."""

    code = "bad_fit"
