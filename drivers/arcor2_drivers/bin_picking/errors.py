"""What a bin and a blister refuse."""

from arcor2_hw.exceptions import Refused


class Empty(Refused):
    """There is no part left."""

    code = "empty"


class Full(Refused):
    """There is no free place left."""

    code = "full"


class PartsTouch(Refused):
    """Parts lie so that they cannot be told apart."""

    code = "parts_touch"


class BadFit(Refused):
    """What lies there does not fit the model of the part well enough."""

    code = "bad_fit"
