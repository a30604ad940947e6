"""The world with the fake UR controller: boards move with the arm of a running program."""

import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import arcor2_fakes.cell

EXAMPLE = str(Path(arcor2_fakes.cell.__file__).with_name("example.json"))

# In the controller's base, x and y have the opposite sign of the world's; the TCP is the example gripper's tip.
CARRY = """def carry():
  set_tcp(p[0, 0, {tcp}, 0, 0, 0])
  movej(p[-0.4, 0.3, {above}, 0, 3.14159265358979, 0], a=12, v=3.1)
  movel(p[-0.4, 0.3, {feeder}, 0, 3.14159265358979, 0], a=6, v=2)
  set_standard_digital_out(0, True)
  sleep(0.2)
  movel(p[-0.4, 0.3, {above}, 0, 3.14159265358979, 0], a=6, v=2)
  movej(p[-0.5, -0.15, {above}, 0, 3.14159265358979, 0], a=12, v=3.1)
  movel(p[{x}, -0.15, {tester}, 0, 3.14159265358979, 0], a=6, v=2)
  set_standard_digital_out(0, False)
  sleep(0.2)
end
"""


def play(ur: Any, tcp: float = 0.1, x: float = -0.5) -> None:
    """Send the program; heights refer to the tip, which may differ from the controller's TCP."""
    lift = 0.1 - tcp
    program = CARRY.format(tcp=tcp, x=x, above=0.25 + lift, feeder=0.08 + lift, tester=0.1 + lift)
    host, port = ur.ready["script"].split(":")
    with socket.create_connection((host, int(port)), 2.0) as script:
        script.sendall(program.encode())
    ur.control.wait_until(lambda truth: truth["program"] == "carry")
    ur.control.wait_until(lambda truth: truth["program"] is None, within=30.0)


@pytest.fixture
def cell(start_fake: Callable[..., Any]) -> tuple[Any, Any, Any]:
    names = ("rtde", "script", "dashboard", "primary", "secondary")
    ports = [part for name in names for part in (f"--{name}-port", "0")]
    ur = start_fake("ur", *ports)
    tester = start_fake("functional_tester", "--time-scale", "20")
    reader = start_fake("barcode_reader")
    world = start_fake(
        "cell",
        *("--layout", EXAMPLE, "--seed", "5", "--boards", "2"),
        *("--robot", ur.ready["control"], "--tester", tester.ready["control"], "--reader", reader.ready["control"]),
    )
    tester.control.do("push_door", opening=True)
    return ur, tester, world


def test_the_arm_carries_a_board_into_the_tester(cell: tuple[Any, Any, Any]) -> None:
    ur, tester, world = cell
    play(ur, tcp=0.04)
    board = world.truth()["boards"][0]
    assert [event["place"] for event in board["history"]] == ["gripper", "tester"]
    assert tester.truth()["board"] == board["code"]
    assert ur.truth()["digital_inputs"] == 0


def test_a_board_placed_5_mm_off_the_fixture_is_lost(cell: tuple[Any, Any, Any]) -> None:
    ur, tester, world = cell
    world.control.do("sensor", stuck=True)
    assert ur.truth()["digital_inputs"] == 1
    play(ur, x=-0.505)
    assert [board["place"] for board in world.truth()["boards"]] == ["lost", "feeder"]
    assert tester.truth()["board"] is None
