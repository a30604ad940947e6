"""States of the fake controller, in simulated time."""

import math

import pytest

from arcor2_fakes.ur.control_script import ControlScript
from arcor2_fakes.ur.controller import HOME, Controller, Refused
from arcor2_fakes.ur.dashboard import NOT_IN_LOCAL, Dashboard
from arcor2_fakes.ur.language import WrittenProgram
from arcor2_fakes.ur.script_port import ScriptPort
from arcor2_fakes.ur.states import RobotMode, Runtime, SafetyMode
from arcor2_fakes.ur.urscript import Call, ForeignProgram, Splitter, calls, parse_call

GOAL = [1.5, *HOME[1:]]


@pytest.fixture
def c():
    return Controller("ur5e", (5, 25, 0, 0), 500.0)


def wait(c, seconds):
    for _ in range(round(seconds * c.frequency)):
        c.tick()


def until(c, holds, within=20.0):
    for n in range(round(within * c.frequency)):
        if holds():
            return n * c.period
        c.tick()
    raise AssertionError("never")


def start_move(c, v=1.0):
    c.start_program(WrittenProgram(c, "move", f"movej({GOAL}, a=2, v={v})"))
    wait(c, 0.8)
    assert c.arm.moving


# ----------------------------------------------------------------------------------------------------- protective stop
def test_play_resumes_the_motion_after_a_protective_stop(c):
    start_move(c)
    c.protective_stop("test")
    assert c.safety_bits >> 2 & 1
    assert c.safety_bits >> 10 & 1
    assert until(c, lambda: not c.arm.moving) < 0.2
    resting = c.arm.q
    wait(c, 4.5)
    with pytest.raises(Refused, match="5s after occurrence"):
        c.unlock_protective_stop()
    with pytest.raises(Refused):
        c.play_program()
    wait(c, 0.6)
    c.unlock_protective_stop()
    wait(c, 1.0)
    assert c.runtime is Runtime.PAUSED
    assert c.arm.q == resting
    c.play_program()
    until(c, lambda: c.program is None)
    assert c.arm.q == pytest.approx(GOAL)


def test_stopping_the_program_first_drops_the_old_motion(c):
    start_move(c)
    c.protective_stop("test")
    wait(c, 5.1)
    c.stop_program("dashboard stop")
    c.unlock_protective_stop()
    resting = c.arm.q
    with pytest.raises(Refused):
        c.play_program()
    wait(c, 2.0)
    assert c.arm.q == resting
    assert c.runtime is Runtime.STOPPED


# ------------------------------------------------------------------------------------------------------ safeguard stop
@pytest.mark.parametrize("reports_paused", [False, True])
def test_a_program_continues_after_a_safeguard_stop(c, reports_paused):
    start_move(c)
    c.safeguard_stop(True, reports_paused)
    assert c.safety is SafetyMode.SAFEGUARD_STOP
    assert until(c, lambda: not c.arm.moving) < 0.25
    wait(c, 0.01)
    assert c.runtime is (Runtime.PAUSED if reports_paused else Runtime.PLAYING)
    resting = c.arm.q
    wait(c, 3.0)
    assert c.arm.q == resting
    c.safeguard_stop(False)
    until(c, lambda: c.program is None)
    assert c.arm.q == pytest.approx(GOAL)


def test_a_safeguard_stop_does_not_resume_a_stopped_or_paused_program(c):
    start_move(c)
    c.pause_program()
    wait(c, 0.5)
    resting = c.arm.q
    c.safeguard_stop(True)
    c.safeguard_stop(False)
    wait(c, 1.0)
    assert c.runtime is Runtime.PAUSED
    c.safeguard_stop(True)
    c.stop_program("client")
    c.safeguard_stop(False)
    wait(c, 1.0)
    assert c.arm.q == resting
    assert c.program is None
    start_move(c)  # and a new one moves
    c.safeguard_stop(True)
    c.pause_program()
    wait(c, 0.5)
    c.safeguard_stop(False)
    wait(c, 0.5)
    assert c.runtime is Runtime.PAUSED
    assert not c.arm.moving


# ------------------------------------------------------------------------------------------------- emergency and faults
def test_an_emergency_stop_switches_power_off_at_standstill(c):
    start_move(c, v=3.0)
    c.emergency_stop(True)
    assert c.program is None
    assert c.robot_mode is RobotMode.RUNNING
    assert until(c, lambda: c.robot_mode is RobotMode.POWER_OFF) < 0.2
    assert not c.arm.moving
    with pytest.raises(Refused):
        c.power_on()
    c.emergency_stop(False)
    assert c.safety is SafetyMode.NORMAL
    with pytest.raises(Refused):
        c.start_program(ForeignProgram(c))
    c.brake_release()
    assert c.robot_mode is RobotMode.POWER_ON
    until(c, lambda: c.robot_mode is RobotMode.IDLE)
    until(c, lambda: c.robot_mode is RobotMode.RUNNING)
    start_move(c)


@pytest.mark.parametrize(("violation", "mode"), [(True, SafetyMode.VIOLATION), (False, SafetyMode.FAULT)])
def test_violation_and_fault_need_a_restart_of_safety(c, violation, mode):
    c.fault(violation)
    wait(c, 0.1)
    c.unlock_protective_stop()
    assert c.safety is mode
    c.restart_safety()
    assert c.safety is SafetyMode.NORMAL
    assert c.robot_mode is RobotMode.POWER_OFF


def test_the_worst_safety_condition_is_reported(c):
    c.reduced(True)
    c.safeguard_stop(True)
    c.protective_stop("both")
    assert c.safety is SafetyMode.SAFEGUARD_STOP
    c.safeguard_stop(False)
    assert c.safety is SafetyMode.PROTECTIVE_STOP
    wait(c, 5.1)
    c.unlock_protective_stop()
    assert c.safety is SafetyMode.REDUCED


def test_reduced_mode_limits_the_speed(c):
    c.reduced(True)
    start_move(c, v=3.0)
    assert max(map(abs, c.arm.qd)) <= 1.0 + 1e-9


def test_impossible_line_is_a_protective_stop(c):
    c.start_program(WrittenProgram(c, "far", "movel(p[-2.0, 0, 0.3, 0, 3.14, 0], a=1.2, v=0.5)"))
    until(c, lambda: c.safety is SafetyMode.PROTECTIVE_STOP)
    until(c, lambda: not c.arm.moving)
    assert math.hypot(*c.arm.pose[:3]) < 1.1


# ------------------------------------------------------------------------------------------------------------- watchdog
def test_watchdog_stops_program_and_arm(c):
    start_move(c, v=3.0)
    c.set_watchdog(24, 10.0)
    for _ in range(10):
        wait(c, 0.09)
        c.integer_written(24)
    assert c.program is not None or c.arm.q == pytest.approx(GOAL)
    c.start_program(ForeignProgram(c))
    c.set_watchdog(24, 10.0)
    wait(c, 0.09)
    assert c.program is not None
    wait(c, 0.02)
    assert c.program is None
    assert c.watchdog_trips == 1
    assert until(c, lambda: not c.arm.moving) < 0.3


def test_the_watchdog_does_not_count_cycles_that_are_caught_up(c):
    """While the fake was not scheduled, a signal may have arrived."""
    c.start_program(ForeignProgram(c))
    c.set_watchdog(24, 10.0)
    for _ in range(500):
        c.tick(late=True)
    assert c.program is not None


# ------------------------------------------------------------------------------------------------------------ dashboard
def test_dashboard_answers(c):
    d = Dashboard(c)
    assert d.answer("stop") == "Stopped"
    assert d.answer("robotmode") == "Robotmode: RUNNING"
    assert d.answer("safetystatus") == "Safetystatus: NORMAL"
    assert d.answer("is in remote control") == "true"
    assert d.answer("get serial number").isdigit()
    assert "5.25.0.0" in d.answer("PolyscopeVersion")
    assert d.answer("get robot model") == "UR5"
    assert d.answer("running") == "Program running: false"
    assert d.answer("programState") == "STOPPED null"
    assert d.answer("play") == "Failed to execute: play"
    assert d.answer("load ../x.sh").startswith("File not found")
    c.load_program = lambda name: ForeignProgram(c, name)
    assert d.answer("load weld.urp") == "Loading program: weld.urp"
    assert d.answer("play") == "Starting program"
    assert d.answer("programState") == "PLAYING weld.urp"
    assert d.answer("pause") == "Pausing program"
    wait(c, 0.5)
    assert d.answer("programState") == "PAUSED weld.urp"
    assert d.answer("nonsense").startswith("could not understand")
    assert d.answer("set operational mode manual") == "Setting operational mode: MANUAL"
    assert d.answer("get operational mode") == "MANUAL"


def test_local_control_refuses_motions(c):
    c.remote = False
    d = Dashboard(c)
    for command in ("play", "stop", "power on", "brake release", "unlock protective stop", "load a.urp"):
        assert d.answer(command) == NOT_IN_LOCAL
    assert d.answer("is in remote control") == "false"
    assert d.answer("robotmode") == "Robotmode: RUNNING"


def test_power_on_by_the_dashboard_takes_time(c):
    d = Dashboard(c)
    assert d.answer("power off") == "Powering off"
    assert d.answer("robotmode") == "Robotmode: POWER_OFF"
    assert d.answer("power on") == "Powering on"
    assert until(c, lambda: c.robot_mode is RobotMode.IDLE) == pytest.approx(4.0, abs=0.1)
    assert d.answer("brake release") == "Brake releasing"
    assert until(c, lambda: c.robot_mode is RobotMode.RUNNING) == pytest.approx(3.0, abs=0.1)


# ------------------------------------------------------------------------------------------------------- control script
TEXT = """def rtde_control():
    global reg_offset_int = # int register offset
{offset}
    def exec_move_path():
        {path}
    end
end"""


def control_script(c, offset=0, path=""):
    script = ControlScript(c, TEXT.format(offset=offset, path=path))
    c.start_program(script)
    c.tick()
    assert c.output_ints[offset] == 1
    return script


def command(c, code, doubles=(), ints=(), offset=0):
    """Send a command like the library: the code, done, zero, ready."""
    c.input_doubles[offset : offset + len(doubles)] = doubles
    c.input_ints[offset + 1 : offset + 1 + len(ints)] = ints
    c.input_ints[offset] = code
    until(c, lambda: c.output_ints[offset] == 2)
    c.input_ints[offset] = 0
    until(c, lambda: c.output_ints[offset] == 1)


@pytest.mark.parametrize("offset", [0, 24])
def test_asynchronous_status_counts_operations(c, offset):
    control_script(c, offset)
    before = c.output_ints[offset + 2]
    assert not before >> 15 & 1
    command(c, 1, [*GOAL, 2.0, 3.0], [1], offset)
    running = c.output_ints[offset + 2]
    assert running >> 15 & 1
    assert (running >> 24) - (before >> 24) == 1
    assert c.arm.moving
    until(c, lambda: not c.output_ints[offset + 2] >> 15 & 1)
    assert c.arm.q == pytest.approx(GOAL)
    assert c.output_ints[offset + 2] >> 24 == running >> 24


def test_the_kind_of_stop_depends_on_earlier_stops(c):
    """Synchronous stops run stopj at first; after the first asynchronous stop all run stopl."""
    control_script(c)
    for code, asynchronous, kind in [(33, 0, "stopj"), (34, 0, "stopj"), (34, 1, "stopl"), (34, 0, "stopl")]:
        command(c, 1, [*(GOAL if c.arm.q[0] < 1.0 else HOME), 1.0, 3.0], [1])
        wait(c, 0.2)
        command(c, code, [2.0], [asynchronous])
        assert c.commands[-1]["kind"] == kind
        until(c, lambda: not c.arm.moving)


def test_a_synchronous_move_blocks_the_command_loop(c):
    control_script(c)
    c.input_doubles[:8] = [*GOAL, 1.0, 2.0]
    c.input_ints[1], c.input_ints[0] = 0, 1
    wait(c, 0.5)
    c.input_ints[0] = 34
    wait(c, 0.5)
    assert c.arm.moving
    assert c.output_ints[0] == 1
    until(c, lambda: c.output_ints[0] == 2)
    assert c.arm.q == pytest.approx(GOAL)


def test_a_path_runs_from_the_uploaded_script(c):
    moves = [f"movej({list(q)},a=3,v=2,r=0)" for q in (GOAL, HOME)]
    path = f"signal_async_progress(0)\n{moves[0]}\nsignal_async_progress(1)\n{moves[1]}"
    control_script(c, path=path)
    command(c, 45, ints=[1])
    until(c, lambda: c.output_ints[2] & 0x7FFF == 1)
    assert c.arm.q == pytest.approx(GOAL, abs=1e-3)
    until(c, lambda: not c.output_ints[2] >> 15 & 1)
    assert c.arm.q == pytest.approx(HOME)


def test_stop_script_ends_the_program(c):
    control_script(c)
    command(c, 1, [*GOAL, 1.0, 2.0], [1])
    wait(c, 0.3)
    c.input_ints[0] = 255
    wait(c, 0.01)
    assert c.program is None
    until(c, lambda: c.runtime is Runtime.STOPPED)
    assert c.arm.q[0] < 1.0


@pytest.mark.parametrize(
    ("code", "doubles"),
    [(1, [math.nan] * 8), (1, [*HOME, 0.0, 1.0]), (3, [0.4, math.inf, 0, 0, 0, 0, 1, 1]), (11, [math.nan])],
)
@pytest.mark.parametrize("asynchronous", [0, 1])
def test_invalid_numbers_end_only_the_program(c, code, doubles, asynchronous):
    control_script(c)
    c.input_doubles[: len(doubles)] = doubles
    c.input_ints[1], c.input_ints[0] = asynchronous, code
    wait(c, 0.1)
    assert c.program is None
    assert c.arm.q == pytest.approx(HOME)
    start_move(c)


@pytest.mark.parametrize(
    "line", ["movej([1,2])", "movej('x')", "movel(p[9,9,9,0,0,0])", "movej(p[9,9,9,0,0,0])", "sleep([])"]
)
def test_invalid_scripts_end_in_an_error(c, line):
    c.start_program(WrittenProgram(c, "bad", line))
    wait(c, 8.0)
    assert c.program is None or c.safety is SafetyMode.PROTECTIVE_STOP
    assert not c.arm.moving


def test_inverse_without_solution_ends_the_program_as_a_runtime_error(c):
    control_script(c)
    c.input_doubles[:6] = [3.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    c.input_ints[0] = 46
    wait(c, 0.1)
    assert c.program is None


@pytest.mark.parametrize("code", [6, 8, 20, 21, 56, 57, 59, 62, 63, 66, 67, 68, 69, 71])
def test_commands_that_are_not_modelled_end_the_program(c, code):
    failed = []
    c.failed = failed.append
    control_script(c)
    command(c, 43, [0.0] * 12, [])
    pose = c.output_doubles[:6]
    assert pose == pytest.approx(c.arm.pose)
    c.input_ints[0] = 0
    wait(c, 0.01)
    c.input_ints[0] = code
    wait(c, 0.01)
    assert c.program is None
    assert failed == [f"command {code} is not modelled"]
    assert c.output_ints[0] == 1, "the command was not executed; the result is the previous command's"


def test_programs_with_unknown_functions_end_in_an_error(c):
    failed = []
    c.failed = failed.append
    port = ScriptPort(c)
    port.take("def", "p", "def p():\n  force_mode(1)\n  set_standard_digital_out(0, True)\nend")
    wait(c, 0.1)
    assert (c.program, c.digital_outputs) == (None, 0)
    port.take("def", "p", "def p():\n  if x\nend")
    assert c.program is None
    start_move(c)
    program = c.program
    for wrong in ("movej([0, 0, 0, 0, 0, 0])", "sleep(1)", "sync()", "no_function(1)", "x = y"):
        port.take("sec", "s", f"sec s():\n  {wrong}\nend")
    port.take("sec", "s", "sec s():\n  if 1 < 2:\n    set_standard_digital_out(3, True)\n  end\nend")
    assert c.digital_outputs == 8
    assert c.program is program
    assert len(failed) == 7


# ------------------------------------------------------------------------------------------------------------ URScript
def test_calls_with_literals_only():
    assert parse_call("movel(p[0.1,-.2, 0,0,3,0],a=1,v=.5)") == Call(
        "movel", ((0.1, -0.2, 0, 0, 3, 0),), {"a": 1, "v": 0.5}
    )
    assert parse_call("write_output_integer_register(0 +24, 2)") == Call("write_output_integer_register", (24, 2))
    for line in ("x = 1", "movej(q)", "movej([1,2", "while True:", "__import__('os').system('x')"):
        assert parse_call(line) is None
    assert [call.name for call in calls("def f():\n  sync() # note\n  # movej()\nend")] == ["sync"]


def test_scripts_are_split_at_their_end():
    splitter = Splitter()
    text = b"def a():\n  if x:\n    sync()\n  end\nend\nstopj(2)\nsec b():\n  textmsg(1)\nend\n"
    found = [entry for i in range(len(text)) for entry in splitter.feed(text[i : i + 1])]
    assert [(kind, name) for kind, name, _ in found] == [("def", "a"), ("line", "stopj(2)"), ("sec", "b")]
    flat = b"def a():\nif x:  # not indented\nsync()\nelif y:\nsync()\nend\nend # of a\nstopj(2)\n"
    assert [name for _, name, _ in Splitter().feed(flat)] == ["a", "stopj(2)"]
