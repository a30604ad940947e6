"""Numbers of the station: PackML states and commands (PackTags), answers, faults."""

from enum import IntEnum


class State(IntEnum):
    """PackML states of the station (PackTags numbers)."""

    CLEARING = 1
    STOPPED = 2
    STARTING = 3
    IDLE = 4
    EXECUTE = 6
    STOPPING = 7
    ABORTING = 8
    ABORTED = 9
    HOLDING = 10
    HELD = 11
    UNHOLDING = 12
    RESETTING = 15
    COMPLETING = 16
    COMPLETE = 17


class Command(IntEnum):
    """Commands of the station (PackTags `CntrlCmd`)."""

    RESET = 1
    START = 2
    STOP = 3
    HOLD = 4
    UNHOLD = 5
    ABORT = 8
    CLEAR = 9


class Answer(IntEnum):
    """Answers to a command."""

    ACCEPTED = 0
    WRONG_STATE = 1
    UNKNOWN_COMMAND = 2
    DOOR_NOT_CLOSED = 3
    NO_BOARD = 4
    UNKNOWN_PROGRAM = 5


class Fault(IntEnum):
    """Fault codes."""

    NONE = 0
    BOARD_LOST = 101
    DOOR_OPENED = 102
    NO_CONTACT = 103
    SUPPLY_OVERLOAD = 104
    HOST_LOST = 105
    EMERGENCY_STOP = 106
