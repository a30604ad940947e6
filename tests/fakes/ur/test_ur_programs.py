"""Programs of clients, blends, and collisions of the tool, in simulated time."""

import itertools
import math

import pytest

from arcor2_fakes.ur.contact import COLLISION_FORCE, STIFFNESS, Obstacle
from arcor2_fakes.ur.controller import HOME, Controller
from arcor2_fakes.ur.language import WrittenProgram, parse
from arcor2_fakes.ur.states import Runtime, SafetyMode


@pytest.fixture
def c():
    return Controller("ur5e", (5, 25, 0, 0), 500.0)


def play(c, text, within=20.0):
    """Run a program to its end; return the TCP positions on its path."""
    c.start_program(WrittenProgram(c, "test", text))
    seen = []
    for _ in range(round(within * c.frequency)):
        c.tick()
        seen.append(c.arm.pose[:3])
        if c.runtime is Runtime.STOPPED:
            return seen
    raise AssertionError("it plays on")


def test_programs_have_variables_conditions_loops_and_threads(c):
    play(
        c,
        """
def test():
  count = 0
  global seen = 0
  thread beside():
    while True:
      seen = seen + 1
      sync()
    end
  end
  other = run beside()
  while count < 7:
    count = count + 1
    if count == 3:
      write_output_integer_register(1, 33)
    elif count == 4 or not (count != 5):
      write_output_integer_register(count, 10 * count)
    else:
      write_output_float_register(0, norm([3, 4]) + sqrt(p[4, 0, 0, 0, 0, 0][0]))
    end
    sync()
  end
  kill other
  at = seen
  sleep(0.1)
  write_output_integer_register(0, seen - at)
  write_output_integer_register(2, seen)
end
""",
    )
    assert c.output_ints[1] == 33
    assert (c.output_ints[4], c.output_ints[5]) == (40, 50)
    assert c.output_doubles[0] == pytest.approx(7.0)
    assert c.output_ints[0] == 0, "a killed thread has no further effect"
    assert c.output_ints[2] in (6, 7)


@pytest.mark.parametrize("text", ["while True:\n  sync()", "if 1 ==:\nend", "end", "x = = 1", "else:\nend", "run f("])
def test_a_program_that_cannot_be_parsed_does_not_start(text):
    with pytest.raises(ValueError, match=r"cannot parse|block|beginning"):
        parse(text)


@pytest.mark.parametrize("text", ["nowhere(1)[0]", "x = y", "while True:\n  x = 1\nend", "x = [1][4]", "x = 'a' - 1"])
def test_an_invalid_call_ends_the_program(c, text):
    killed = c.programs_killed
    c.start_program(WrittenProgram(c, "bad", text))
    for _ in range(100):
        c.tick()
    assert c.program is None
    assert c.programs_killed == killed + 1


def test_a_watchdog_started_by_a_program_stops_it(c):
    with pytest.raises(AssertionError, match="plays on"):
        play(c, "sleep(9)", within=1.0)
    c.stop_program("test")
    seen = play(c, 'rtde_set_watchdog("input_int_register_18", 10.0, "stop")\nsleep(9)', within=1.0)
    assert len(seen) * c.period == pytest.approx(0.1, abs=0.02)
    assert c.watchdog_trips == 1


def corner(c, blend, kind="movel"):
    """Move around a corner; return the smallest distance to it, and the lowest TCP speed between the ends."""
    x, y, z, *turn = c.arm.pose
    places = [(x, y - 0.2, z), (x, y - 0.2, z + 0.2)]
    lines = [
        f"{kind}(p[{', '.join(map(str, (*place, *turn)))}], a=1.2, v=0.25, r={r})"
        for place, r in zip(places, (blend, 0.0), strict=True)
    ]
    seen = play(c, "def path():\n  " + "\n  ".join(lines) + "\nend")
    assert math.dist(c.arm.pose[:3], places[1]) < 1e-6
    speeds = [math.dist(a, b) / c.period for a, b in itertools.pairwise(seen)]
    ramp = round(0.3 * c.frequency)
    return min(math.dist(place, places[0]) for place in seen), min(speeds[ramp : len(speeds) - 2 * ramp])


def test_without_a_blend_the_arm_stops_at_the_corner(c):
    nearest, slowest = corner(c, 0.0)
    assert nearest < 1e-6
    assert slowest < 1e-3


@pytest.mark.parametrize("kind", ["movel", "movej"])
def test_a_blend_rounds_the_corner_within_its_radius_without_a_stop(c, kind):
    nearest, slowest = corner(c, 0.02, kind)
    assert 1e-3 < nearest <= 0.02
    assert slowest > 0.02


def test_a_blend_has_no_jump_in_its_speed(c):
    x, y, z, *turn = c.arm.pose
    pose = ", ".join(map(str, turn))
    c.start_program(
        WrittenProgram(
            c,
            "path",
            f"movel(p[{x}, {y - 0.2}, {z}, {pose}], a=1.2, v=0.25, r=0.02)\n"
            f"movel(p[{x - 0.1}, {y - 0.2}, {z}, {pose}], a=1.2, v=0.25)",
        )
    )
    last = [0.0] * 6
    while c.runtime is not Runtime.STOPPED:
        c.tick()
        now = c.arm.twist()
        assert math.dist(last[:3], now[:3]) < 2 * 1.2 * c.period * 1.2  # two motions at 1.2 m/s² at most
        last = now


def test_an_obstacle_acts_like_a_spring_and_a_collision_stops_the_arm(c):
    x, y, z, *turn = c.arm.pose
    down = ", ".join(map(str, turn))
    c.place_obstacle(Obstacle.of((0.0, 0.0, z - 0.05), (0.0, 0.0, 2.0)))
    play(c, f"movel(p[{x}, {y}, {z - 0.052}, {down}], a=1.2, v=0.05)")
    assert c.tcp_force == pytest.approx((0.0, 0.0, 0.002 * STIFFNESS, 0.0, 0.0, 0.0), rel=1e-3)
    assert c.touching
    assert c.safety is SafetyMode.NORMAL
    c.start_program(WrittenProgram(c, "deep", f"movel(p[{x}, {y}, {z - 0.2}, {down}], a=1.2, v=0.1)"))
    for _ in range(1500):
        c.tick()
    assert c.safety is SafetyMode.PROTECTIVE_STOP
    assert COLLISION_FORCE < c.tcp_force[2] < 2.0 * COLLISION_FORCE
    assert not c.arm.moving


def test_recovery_mode_ends_a_program_and_refuses_a_new_one(c):
    c.start_program(WrittenProgram(c, "move", f"movej({[1.0, *HOME[1:]]})"))
    for _ in range(200):
        c.tick()
    c.recovery(True)
    assert c.safety is SafetyMode.RECOVERY
    for _ in range(200):
        c.tick()
    assert c.runtime is Runtime.STOPPED
    assert not c.arm.moving
    with pytest.raises(ValueError, match="RECOVERY"):
        c.start_program(WrittenProgram(c, "again", "sync()"))
    c.recovery(False)
    assert c.safety is SafetyMode.NORMAL
