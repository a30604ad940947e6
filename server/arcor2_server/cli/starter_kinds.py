"""The kinds of device that `arcor2-hw device new` supports, with their parts of the templates."""

import enum
from typing import Final, NamedTuple


class Base(enum.StrEnum):
    """What kind of device it is."""

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
    """What a base brings into the texts.

    observe, ask, command, run_long: what the suite's bench calls; run_long is empty where nothing takes its time.
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
    own_test: str
    fake: str
    rest_value: int = 0


NO_ACT: Final = "the device does nothing that takes its time"
STATUS: Final = "state (0 idle, 1 busy)"
MOTION_WRITES: Final = (
    "1 go (with the target, then tenths of a mm a second), 2 stop, 3 reset, 4 home; register 2: ms of silence after "
    "which it stops, 0 lets go"
)
COMMON_WORDS: Final = "fault (0: none), owner (0 nobody, 1 the host, 2 the panel)"
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
        "command (PackML) and with a start the tenths to do; register 2: ms of silence after which it stops, 0 lets go",
        "`process` does one piece of work: it resets the machine where necessary, starts it and waits for its end.",
        """def test_pieces_are_counted(bench):
    device = bench.controlled()
    assert device.process(0.4) == 1
    assert device.process(0.4) == 2
    assert device.machine_state() is MachineState.COMPLETE


def test_a_command_that_the_state_forbids_is_refused_naming_both(bench):
    device = bench.controlled()
    with pytest.raises(Refused, match="CLEAR is not allowed in STOPPED"):
        device.command(MachineCommand.CLEAR)
""",
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
        "1 go and the tenths to do, 2 stop, 3 reset; register 2: ms of silence after which it stops, 0 lets go",
        "`work` does one piece of work and waits for its end.",
        """def test_work_that_is_done_is_told(bench):
    device = bench.controlled()
    assert device.work(0.4) == 0.4
""",
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
        """def test_it_moves_to_where_it_was_told(bench):
    device = bench.controlled()
    device.home()
    device.move_absolute(0.05, 0.5)
    assert device.position().value == pytest.approx(0.05)
    device.move_relative(-0.02, 0.5)
    assert device.position().value == pytest.approx(0.03)
""",
        "motion",
    ),
    Base.GRIPPER: Kind(
        "activate, grip, release",
        "state()",
        "fresh()",
        "release()",
        "grip(0.0, 10.0, 0.05)",
        "hold",
        MOTION_WORDS,
        MOTION_WRITES,
        "`grip` closes until something is held or the width is reached, and tells which; `release` opens.",
        """def test_a_part_is_held(bench):
    device = bench.controlled()
    device.activate()
    bench.do("put_part", width=4900)
    assert device.grip(0.48, 10.0, 0.2) == (True, pytest.approx(0.49))
    device.release()
    bench.do("put_part")
    assert device.grip(0.48, 10.0, 0.2) == (False, pytest.approx(0.48))
""",
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
        f"state (0 at rest, 1 moving), grams, tares done, {COMMON_WORDS}",
        "4 tare, 5 zero; register 2: ms of silence after which control is given back, 0 gives it back",
        "`weight` gives the weight when it stands, or at once; `tare` and `zero` take the present one as nothing.",
        """def test_a_weight_and_what_is_left_of_it_after_taring(bench):
    device = bench.controlled()
    bench.do("put", grams=1250)
    assert device.weight() == 1.25
    device.tare()
    bench.do("put", grams=1000)
    assert device.weight() == -0.25
""",
        "scale",
    ),
    Base.READER: Kind(
        "scan",
        "current()",
        "fresh()",
        "scan(0.1)",
        "scan(30.0)",
        "none",
        f"{STATUS}, the code, codes read, {COMMON_WORDS}",
        "1 read a code, 2 stop; register 2: ms of silence after which it stops, 0 lets go",
        "`scan` waits for one code; one that was shown before does not count.",
        """def test_a_code_that_was_shown_before_does_not_count(bench):
    device = bench.controlled()
    bench.do("show", code=4711)
    assert device.scan(0.1) == ""


def test_a_code_that_is_shown_while_reading(bench):
    device = bench.controlled()
    timer = threading.Timer(0.2, lambda: bench.do("show", code=4711))
    timer.start()
    assert device.scan(5.0) == "4711"
    timer.join()
""",
        "reader",
    ),
    Base.PRINTER: Kind(
        "print",
        "counter()",
        "fresh()",
        'print("A1")',
        'print(40 * "x")',
        "none",
        f"{STATUS}, characters printed, labels printed, {COMMON_WORDS}",
        "1 print, with a character a register, 2 stop; register 2: ms of silence after which it stops, 0 lets go",
        "`print` prints a label of up to 40 plain characters and waits until it is out.",
        """def test_a_label_is_printed_once(bench):
    device = bench.controlled()
    assert device.print("B-7") == "1"
    assert bench.do("truth")["labels"] == ["B-7"]
    assert (device.status(), device.counter()) == ("ready", 1)
""",
        "printer",
    ),
    Base.IOBLOCK: Kind(
        "read_point, write_point",
        'read("DI0")',
        "fresh()",
        'write("DO1", True)',
        "",
        "off",
        f"state (0), inputs, outputs (a bit each), {COMMON_WORDS}",
        "3 switch an output, with its number and 0 or 1; register 2: ms of silence after which all are off, 0 lets go",
        "`read_point` tells a point, `write_point` switches an output; outputs are off when the device has lost us.",
        """def test_points_are_read_and_switched(bench):
    device = bench.controlled()
    bench.do("set_input", number=3, on=True)
    device.fresh()
    assert [device.read_point(f"DI{n}") for n in (2, 3)] == [False, True]
    device.write_point("DO5", True)
    assert device.fresh()[2] == 1 << 5
    device.disconnect()
    assert bench.do("truth")["outputs"] == 0
""",
        "ioblock",
    ),
}
