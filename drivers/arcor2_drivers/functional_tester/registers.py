"""The register map (docs/devices/functional-tester.md) as data. Pure functions."""

import enum
import struct
from collections.abc import Sequence
from typing import Final, NamedTuple

from arcor2_hw.data.device import Health, Severity
from arcor2_hw.messages import translatable
from arcor2_hw.objects import MachineCommand, MachineState, UnitMode


class Holding(enum.IntEnum):
    """Addresses of the holding registers."""

    COMMAND = 0
    COMMAND_SEQUENCE = 1
    TEST_PROGRAM = 2
    DOOR_COMMAND = 3
    DOOR_SEQUENCE = 4
    HOST_WATCHDOG = 5


HOLDING_COUNT: Final = 6
INPUT_COUNT: Final = 17
DISCRETE_COUNT: Final = 5
DOOR_OPEN: Final = 1
DOOR_CLOSE: Final = 2
ACCEPTED: Final = 0
REFUSED_IN_STATE: Final = 1

S = MachineState
STATES: Final = frozenset(S) - {S.SUSPENDED, S.SUSPENDING, S.UNSUSPENDING}
RUNNING: Final = frozenset({S.STARTING, S.EXECUTE, S.COMPLETING, S.HOLDING, S.HELD, S.UNHOLDING})
DOOR_MAY_MOVE: Final = frozenset({S.STOPPED, S.IDLE, S.COMPLETE, S.ABORTED})
TRANSIENT_STATES: Final = frozenset({S.RESETTING, S.CLEARING, S.STOPPING, S.ABORTING})
"""Short states without a test that end by themselves."""
ABORT_STATES: Final = frozenset({S.ABORTING, S.ABORTED})
COMMANDS: Final = frozenset(
    {
        MachineCommand.RESET,
        MachineCommand.START,
        MachineCommand.STOP,
        MachineCommand.HOLD,
        MachineCommand.UNHOLD,
        MachineCommand.ABORT,
        MachineCommand.CLEAR,
    }
)

REFUSALS: Final = translatable(
    {
        REFUSED_IN_STATE: "this state does not allow it",
        2: "the tester does not know this command",
        3: "the door is not closed",
        4: "the fixture is empty",
        5: "the tester does not know this test program",
    }
)
"""Values of command_result other than 0 (accepted)."""


class Fault(NamedTuple):
    """Meaning of a fault code, its remedy, and the condition of the tester during the fault."""

    text: str
    remedy: str
    severity: Severity = Severity.ERROR
    health: Health = Health.CHECK_FUNCTION


FAULTS: Final = {
    101: Fault("board lost during the test", "put the board in, then acknowledge"),
    102: Fault("door opened during the test", "close the door, then acknowledge"),
    103: Fault(
        "no contact to the board",
        "clean the pins, check the position of the board, then acknowledge",
        health=Health.MAINTENANCE_REQUIRED,
    ),
    104: Fault("supply overload", "take the board out, then acknowledge", health=Health.OFF_SPEC),
    105: Fault("host lost", "check the network, then acknowledge"),
    106: Fault("emergency stop", "release the button, then acknowledge", Severity.CRITICAL),
}
EMERGENCY_STOP: Final = 106


def fault_of(code: int) -> Fault:
    """Return the meaning of a fault code; an unknown one counts as a failure."""
    unknown = Fault("unknown fault", "see the manual of the tester, then acknowledge", health=Health.FAILURE)
    return FAULTS.get(code, unknown)


class Inputs(NamedTuple):
    """All readable values at one instant; V, A, Ω."""

    state: MachineState
    command_acknowledged: int
    command_result: int
    fault_code: int
    result: int
    result_number: int
    supply_voltage: float
    supply_current: float
    contact_resistance: float
    tested: int
    passed: int
    failed: int
    life: int
    mode: UnitMode
    door_open: bool
    door_closed: bool
    board_present: bool
    board_clamped: bool
    emergency_stop: bool


def decode(words: Sequence[int], bits: Sequence[bool]) -> Inputs:
    """Decode the input registers and the discrete inputs. Raises ValueError for values outside the map."""
    if len(words) != INPUT_COUNT or len(bits) < DISCRETE_COUNT:
        raise ValueError(f"{len(words)} registers and {len(bits)} inputs instead of {INPUT_COUNT} and {DISCRETE_COUNT}")
    if words[0] not in STATES:
        raise ValueError(f"state {words[0]}")
    if words[16] not in tuple(UnitMode):
        raise ValueError(f"mode {words[16]}")
    voltage, current, resistance = struct.unpack(">fff", struct.pack(">6H", *words[6:12]))
    acknowledged, command_result, fault_code, result, result_number = words[1:6]
    tested, passed, failed, life = words[12:16]
    return Inputs(
        state=MachineState(words[0]),
        command_acknowledged=acknowledged,
        command_result=command_result,
        fault_code=fault_code,
        result=result,
        result_number=result_number,
        supply_voltage=voltage,
        supply_current=current,
        contact_resistance=resistance,
        tested=tested,
        passed=passed,
        failed=failed,
        life=life,
        mode=UnitMode(words[16]),
        door_open=bits[0],
        door_closed=bits[1],
        board_present=bits[2],
        board_clamped=bits[3],
        emergency_stop=bits[4],
    )


def title(state: MachineState) -> str:
    """Return the name of a state as PackML writes it."""
    return state.name.capitalize()
