"""The kinds of devices that `arcor2-hw device new` supports, and their parts of the templates."""

import enum
from typing import Final, NamedTuple


class Base(enum.StrEnum):
    """Kind of device."""

    MACHINE = "machine"
    ROBOT = "robot"
    CAMERA = "camera"
    GRIPPER = "gripper"
    IOBLOCK = "ioblock"
    AXIS = "axis"
    READER = "reader"
    SCALE = "scale"
    PRINTER = "printer"
    GENERIC = "generic"


class Kind(NamedTuple):
    """The parts of the templates that depend on the kind of device.

    Args:
        actions: names of the actions.
        observe: a call that reads the state, for the bench of the conformance suite.
        ask: a call that waits for a new state.
        command: a call that needs control.
        run_long: a call that takes some seconds; empty if no action does.
        on_loss: state of the outputs after a connection loss.
        words: the registers that are read.
        writes: the commands in register 0.
        does: description of the actions.
        fake: name of the template of the fake.
        rest_value: value of the fake at the start.
        acts: calls that act until the process is killed, if `run_long` is empty.
        not_run: cases of the conformance suite that the device does not have, with the reason.
    """

    actions: str
    observe: str
    ask: str
    command: str
    run_long: str
    on_loss: str
    words: str
    writes: str
    does: str
    fake: str
    rest_value: int = 0
    acts: str = ""
    not_run: tuple[tuple[str, str], ...] = ()


NO_ACT: Final = "the device has no action that takes time"
_OF_ACTIONS: Final = tuple(
    (case, NO_ACT) for case in ("nothing_resumes", "stop_passes", "one_act_at_a_time", "disconnecting_ends_an_act")
)
STATUS: Final = "state (0 idle, 1 busy)"
MOTION_WRITES: Final = (
    "1 go (with target in 0.1 mm and speed in 0.1 mm/s), 2 stop, 3 reset, 4 home. Register 2: ms without a request "
    "after which it stops; 0 releases control"
)
COMMON_WORDS: Final = "fault (0: none), owner (0 none, 1 the host, 2 the panel)"
MOTION_WORDS: Final = f"{STATUS}, tenths of a mm, flags (1 homed, 2 part held), {COMMON_WORDS}"
KINDS: Final = {
    Base.MACHINE: Kind(
        "process",
        "machine_state()",
        "fresh()",
        "command(MachineCommand.RESET)",
        "process(8.0)",
        "none",
        f"state (PackML), tenths done, pieces done, {COMMON_WORDS}",
        "command (PackML), and the amount in tenths after START. Register 2: ms without a request after which it "
        "stops; 0 releases control",
        "`process` does one piece of work: it resets the machine if necessary, starts it and waits until it ends.",
        "machine",
    ),
    Base.GENERIC: Kind(
        "work",
        "current()",
        "fresh()",
        'send("a reset", lambda: device._io.$write(0, 3))',
        "work(8.0)",
        "none",
        f"{STATUS}, tenths done, pieces done, {COMMON_WORDS}",
        "1 go and the amount in tenths, 2 stop, 3 reset. Register 2: ms without a request after which it stops; 0 "
        "releases control",
        "`work` does one piece of work and waits until it ends.",
        "generic",
    ),
    Base.AXIS: Kind(
        "home, move_absolute, move_relative",
        "position()",
        "fresh()",
        "fault_reset()",
        "move_absolute(0.9, 0.1)",
        "none",
        MOTION_WORDS,
        MOTION_WRITES,
        "`home` references it; `move_absolute` and `move_relative` move it, and are refused before homing.",
        "motion",
    ),
    Base.GRIPPER: Kind(
        "activate, grip, release, set_part, set_part_object",
        "state()",
        "fresh()",
        "release()",
        "grip(0.0, 10.0, 0.05)",
        "hold",
        MOTION_WORDS,
        MOTION_WRITES,
        "`grip` closes until a part is gripped or the width is reached, and returns which; `release` opens.",
        "motion",
        5000,
    ),
    Base.SCALE: Kind(
        "tare, weight, zero",
        "current()",
        "fresh()",
        "tare()",
        "",
        "none",
        f"state (0 stable, 1 changing), grams, tares done, {COMMON_WORDS}",
        "4 tare, 5 zero. Register 2: ms without a request after which control is released; 0 releases control",
        "`weight` returns the weight, on request when it is stable; `tare` and `zero` set the present weight to zero.",
        "scale",
        not_run=(
            *_OF_ACTIONS,
            ("loss_reaction", NO_ACT),
            ("limits_are_refused", "its calls have no values with limits"),
        ),
    ),
    Base.READER: Kind(
        "scan",
        "current()",
        "fresh()",
        "scan(0.1)",
        "scan(30.0)",
        "none",
        f"{STATUS}, the code, codes read, {COMMON_WORDS}",
        "1 read a code, 2 stop. Register 2: ms without a request after which it stops; 0 releases control",
        "`scan` waits for a code; codes from before the call do not count.",
        "reader",
        not_run=(("units_and_frames", "the reader returns codes, and no value with a unit"),),
    ),
    Base.PRINTER: Kind(
        "print",
        "counter()",
        "fresh()",
        'print("A1")',
        'print(40 * "x")',
        "none",
        f"{STATUS}, characters printed, labels printed, {COMMON_WORDS}",
        "1 print, with one character per register, 2 stop. Register 2: ms without a request after which it stops; 0 "
        "releases control",
        "`print` prints a label of up to 40 ASCII characters and waits until it is printed.",
        "printer",
    ),
    Base.IOBLOCK: Kind(
        "read_point, write_point",
        'read("DI0")',
        "fresh()",
        'write("DO1", True)',
        "",
        "off",
        f"state (0), inputs, outputs (one bit each), {COMMON_WORDS}",
        "3 switch an output, with its number and 0 or 1. Register 2: ms without a request after which all outputs are "
        "off; 0 releases control",
        "`read_point` returns a point, `write_point` switches an output. Without a connection, all outputs are off.",
        "ioblock",
        acts='write("DO1", True)\nwhile True:\n    device.fresh()',
        not_run=_OF_ACTIONS,
    ),
}
