"""States, commands and modes of PackML (ISA-TR88.00.02, OPC 30050), with their numbers."""

import enum


class MachineState(enum.IntEnum):
    """States of PackML with their numbers."""

    CLEARING = 1
    STOPPED = 2
    STARTING = 3
    IDLE = 4
    SUSPENDED = 5
    EXECUTE = 6
    STOPPING = 7
    ABORTING = 8
    ABORTED = 9
    HOLDING = 10
    HELD = 11
    UNHOLDING = 12
    SUSPENDING = 13
    UNSUSPENDING = 14
    RESETTING = 15
    COMPLETING = 16
    COMPLETE = 17


class MachineCommand(enum.IntEnum):
    """Commands of PackML with their numbers (CntrlCmd)."""

    RESET = 1
    START = 2
    STOP = 3
    HOLD = 4
    UNHOLD = 5
    SUSPEND = 6
    UNSUSPEND = 7
    ABORT = 8
    CLEAR = 9
    COMPLETE = 10


class UnitMode(enum.IntEnum):
    """Unit modes of PackML with their numbers. It leaves the modes from 4 on to the manufacturer."""

    PRODUCE = 1
    MAINTENANCE = 2
    MANUAL = 3
    CHANGEOVER = 4


_S = MachineState
_ACTIVE = frozenset(_S) - {_S.STOPPED, _S.STOPPING, _S.ABORTED, _S.ABORTING, _S.CLEARING}

ALLOWED: dict[MachineCommand, frozenset[MachineState]] = {
    MachineCommand.RESET: frozenset({_S.STOPPED, _S.COMPLETE}),
    MachineCommand.START: frozenset({_S.IDLE}),
    MachineCommand.STOP: _ACTIVE,
    MachineCommand.HOLD: frozenset({_S.EXECUTE}),
    MachineCommand.UNHOLD: frozenset({_S.HELD}),
    MachineCommand.SUSPEND: frozenset({_S.EXECUTE}),
    MachineCommand.UNSUSPEND: frozenset({_S.SUSPENDED}),
    MachineCommand.ABORT: frozenset(_S) - {_S.ABORTED, _S.ABORTING},
    MachineCommand.CLEAR: frozenset({_S.ABORTED}),
    MachineCommand.COMPLETE: frozenset({_S.EXECUTE}),
}
"""States in which PackML allows each command."""
