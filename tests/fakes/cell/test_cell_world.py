"""The physics of the cell, with test devices and a simulated clock."""

import math
from pathlib import Path
from typing import Any

import msgspec
import pytest
from hypothesis import given, settings, strategies as st

import arcor2_fakes.cell
from arcor2_fakes.cell.boards import Board
from arcor2_fakes.cell.layout import Layout, Pose, read_layout
from arcor2_fakes.cell.world import PLACES, Robot, World

LAYOUT = read_layout(Path(arcor2_fakes.cell.__file__).with_name("example.json"))
BOARDS = [Board("A"), Board("B", "short"), Board("C")]
FEEDER, READER, TESTER = LAYOUT.feeder.pose.position, LAYOUT.reader.pose.position, LAYOUT.tester.pose.position
GOOD, BAD = LAYOUT.good_box.pose.position, LAYOUT.bad_box.pose.position
NOWHERE = (0.0, -0.6, 0.1)
TIP = 0.1


class Devices:
    """A tester with a door. It records the values sent to the reader and the sensor."""

    def __init__(self) -> None:
        self.door_open = True
        self.board: str | None = None
        self.shown: str | None = "nothing shown yet"
        self.sensor: bool | None = None

    async def put_into_tester(self, board: Board) -> str | None:
        if not self.door_open or self.board is not None:
            return "closed" if not self.door_open else "occupied"
        self.board = board.code
        return None

    async def take_from_tester(self) -> str | None:
        if not self.door_open or self.board is None:
            return "closed" if not self.door_open else "empty"
        self.board = None
        return None

    async def present(self, code: str | None) -> None:
        self.shown = code

    async def set_sensor(self, held: bool) -> None:
        self.sensor = held


class Cell:
    """A world with a robot that moves instantly."""

    def __init__(self, boards: list[Board] = BOARDS, layout: Layout = LAYOUT, turned: float = 0.0) -> None:
        self.devices = Devices()
        self.world = World(layout, boards, self.devices)
        self.now = 0.0
        self.bits = 0
        self.turned = turned  # robot base about z
        self.pose = (*NOWHERE, 0.0, math.pi, 0.0)

    async def at(self, x: float, y: float, z: float, tilt: float = 0.0, wait: float = 0.5) -> None:
        """Move the tip to a point of the world, pointing down except for `tilt`."""
        angle = math.pi - tilt
        c, s = math.cos(-self.turned), math.sin(-self.turned)
        link_x, link_y = c * x - s * y, s * x + c * y
        # base_link to the controller's base: 180° about z. The flange is TIP behind the tip.
        self.pose = (
            -link_x - TIP * math.sin(angle),
            -link_y,
            z - TIP * math.cos(angle),
            0.0,
            angle,
            0.0,
        )
        await self.wait(wait)

    async def wait(self, seconds: float) -> None:
        end = self.now + seconds
        while self.now < end:
            await self.world.step(self.now, Robot(self.pose, (0.0,) * 6, self.bits))  # type: ignore[arg-type]
            self.now += 0.02

    async def grip(self, on: bool) -> None:
        self.bits = int(on)
        await self.wait(0.2)

    async def carry(self, source: Any, target: Any) -> None:
        await self.at(*source)
        await self.grip(True)
        await self.at(*target)
        await self.grip(False)

    @property
    def places(self) -> str:
        return " ".join(board["place"] for board in self.world.truth()["boards"])


async def test_a_board_moves_with_the_gripper() -> None:
    cell = Cell()
    await cell.world.begin()
    assert (cell.devices.sensor, cell.devices.shown) == (False, None)
    await cell.at(*FEEDER)
    await cell.grip(True)
    assert cell.places == "gripper feeder feeder"
    assert cell.devices.sensor
    await cell.at(*READER)
    assert cell.devices.shown == "A"
    assert cell.world.truth()["boards"][0]["position"] == pytest.approx(READER)
    await cell.at(*TESTER)
    assert cell.devices.shown is None
    await cell.grip(False)
    assert (cell.places, cell.devices.board, cell.devices.sensor) == ("tester feeder feeder", "A", False)
    await cell.carry(TESTER, GOOD)
    assert (cell.places, cell.devices.board) == ("good feeder feeder", None)
    await cell.carry(FEEDER, BAD)
    assert cell.places == "good bad feeder"
    truth = cell.world.truth()
    assert truth["counts"] == {"feeder": 1, "gripper": 0, "tester": 0, "good": 1, "bad": 1, "lost": 0, "removed": 0}
    assert [event["place"] for event in truth["boards"][0]["history"]] == ["gripper", "tester", "gripper", "good"]


async def test_base_rotation_and_tcp_do_not_change_the_physics() -> None:
    yaw = 0.7
    layout = msgspec.structs.replace(
        LAYOUT,
        robot=msgspec.structs.replace(
            LAYOUT.robot, base=Pose((0.0, 0.0, 0.0), (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)))
        ),
        # With the base rotated, the tool that points straight down in the base is rotated as well.
        tester=msgspec.structs.replace(
            LAYOUT.tester, tolerance=msgspec.structs.replace(LAYOUT.tester.tolerance, turn=None)
        ),
    )
    cell = Cell(layout=layout, turned=yaw)
    await cell.carry(FEEDER, TESTER)
    assert cell.places == "tester feeder feeder"
    # The same flange, reported with a TCP of 0.3 m: the reported pose is 0.3 m lower.
    x, y, z, *rotation = cell.pose
    sample = Robot((x, y, z - 0.3, *rotation), (0.0, 0.0, 0.3, 0.0, 0.0, 0.0), 0)  # type: ignore[arg-type]
    before = cell.world.truth()["gripper"]["tip"]
    await cell.world.step(cell.now, sample)
    assert cell.world.truth()["gripper"]["tip"] == pytest.approx(before, abs=1e-9)


@pytest.mark.parametrize(
    "miss",
    [
        {"x": FEEDER[0] + 0.006},
        {"z": FEEDER[2] + 0.02},
        {"z": FEEDER[2] - 0.02},
        {"tilt": 0.15},
    ],
)
async def test_jaws_that_miss_the_board_grip_nothing(miss: dict[str, float]) -> None:
    cell = Cell()
    await cell.at(**({"x": FEEDER[0], "y": FEEDER[1], "z": FEEDER[2]} | miss))
    await cell.grip(True)
    assert cell.places == "feeder feeder feeder"
    await cell.at(*FEEDER)  # arriving with closed jaws
    assert cell.places == "feeder feeder feeder"


@pytest.mark.parametrize(
    ("target", "door", "why"),
    [
        (NOWHERE, True, "let go"),
        ((TESTER[0], TESTER[1], TESTER[2] + 0.02), True, "let go"),
        ((TESTER[0] + 0.005, *TESTER[1:]), True, "let go"),
        (TESTER, False, "closed"),
        ((GOOD[0], GOOD[1], GOOD[2] + 0.2), True, "let go"),
    ],
)
async def test_a_board_released_elsewhere_is_lost(target: Any, door: bool, why: str) -> None:
    cell = Cell()
    cell.devices.door_open = door
    await cell.carry(FEEDER, target)
    assert cell.places == "lost feeder feeder"
    assert cell.devices.board is None
    board = cell.world.truth()["boards"][0]
    assert why in board["history"][-1]["why"]
    assert board["position"] == pytest.approx((target[0], target[1], LAYOUT.table_height))
    await cell.at(target[0], target[1], LAYOUT.table_height)
    await cell.grip(True)
    assert cell.places == "lost feeder feeder"


async def test_a_second_board_does_not_fit_into_the_tester() -> None:
    cell = Cell()
    await cell.carry(FEEDER, TESTER)
    await cell.carry(FEEDER, TESTER)
    assert cell.places == "tester lost feeder"


async def test_a_board_gripped_askew_is_released_askew() -> None:
    cell = Cell()
    await cell.at(*FEEDER, tilt=0.09)
    await cell.grip(True)
    await cell.at(*TESTER)
    await cell.grip(False)
    assert cell.places == "lost feeder feeder"
    await cell.at(*FEEDER, tilt=0.09)
    await cell.grip(True)
    await cell.at(*TESTER, tilt=0.09)
    await cell.grip(False)
    assert cell.places == "lost tester feeder"


async def test_the_door_keeps_the_board_in() -> None:
    cell = Cell()
    await cell.carry(FEEDER, TESTER)
    cell.devices.door_open = False
    await cell.carry(TESTER, GOOD)
    assert cell.places == "tester feeder feeder"
    cell.devices.door_open = True
    await cell.carry(TESTER, GOOD)
    assert cell.places == "good feeder feeder"


async def test_the_next_board_needs_time_and_a_board_can_be_put_back() -> None:
    cell = Cell()
    await cell.at(*FEEDER)
    await cell.grip(True)
    taken = cell.world.truth()["boards"][0]["history"][0]["time"]
    assert cell.world.truth()["at_pick_place"] is None
    while cell.world.truth()["at_pick_place"] is None:
        await cell.wait(0.02)
    assert cell.now - taken == pytest.approx(0.3, abs=0.05)
    await cell.grip(False)
    assert cell.places == "lost feeder feeder"  # another board was there already
    await cell.grip(True)
    await cell.grip(False)  # at once, before the next one comes
    assert cell.places == "lost feeder feeder"
    assert cell.world.truth()["at_pick_place"] == "B"


async def test_a_reader_can_see_the_feeder() -> None:
    reader = msgspec.structs.replace(LAYOUT.reader, pose=LAYOUT.feeder.pose)
    cell = Cell(layout=msgspec.structs.replace(LAYOUT, reader=reader))
    await cell.at(*NOWHERE)
    assert cell.devices.shown == "A"
    await cell.at(*FEEDER)
    await cell.grip(True)
    assert cell.devices.shown == "A"  # held, still in view
    await cell.at(*TESTER, wait=0.02)
    assert cell.devices.shown is None
    await cell.wait(0.5)
    assert cell.devices.shown == "B"


async def test_jaws_need_time() -> None:
    cell = Cell()
    await cell.at(*FEEDER)
    cell.bits = 1
    await cell.wait(0.06)
    await cell.at(*NOWHERE)  # the board leaves before the jaws have closed
    assert cell.places == "feeder feeder feeder"
    assert cell.world.truth()["gripper"]["closed"]


async def test_faults_can_be_injected() -> None:
    cell = Cell()
    cell.world.gripper_works = False
    await cell.carry(FEEDER, TESTER)
    assert cell.places == "feeder feeder feeder"
    await cell.at(*FEEDER)
    await cell.grip(True)
    cell.world.gripper_works = True
    await cell.wait(0.2)  # the output is still on
    assert cell.places == "gripper feeder feeder"
    await cell.world.stick_sensor(False)
    assert cell.devices.sensor is False
    await cell.at(*READER)
    await cell.world.drop()
    assert cell.places == "lost feeder feeder"
    with pytest.raises(ValueError, match="no board is gripped"):
        await cell.world.drop()
    await cell.world.remove("C")
    assert cell.places == "lost feeder removed"
    with pytest.raises(ValueError, match="board Z does not exist"):
        await cell.world.remove("Z")


SPOTS = st.sampled_from([FEEDER, READER, TESTER, GOOD, BAD, NOWHERE])
DO = st.one_of(
    st.tuples(st.just("at"), SPOTS),
    st.tuples(st.just("grip"), st.booleans()),
    st.tuples(st.just("door"), st.booleans()),
    st.tuples(st.just("works"), st.booleans()),
    st.tuples(st.just("remove"), st.sampled_from("ABC")),
)


@settings(max_examples=60, deadline=None)
@given(steps=st.lists(DO, max_size=25))
async def test_the_number_of_boards_is_constant(steps: list[tuple[str, Any]]) -> None:
    cell = Cell()
    for what, value in steps:
        match what:
            case "at":
                await cell.at(*value, wait=0.1)
            case "grip":
                await cell.grip(value)
            case "door":
                cell.devices.door_open = value
            case "works":
                cell.world.gripper_works = value
            case "remove":
                try:
                    await cell.world.remove(value)
                except ValueError:
                    assert cell.devices.board == value
        truth = cell.world.truth()
        where = {board["code"]: board["place"] for board in truth["boards"]}
        assert sorted(where) == ["A", "B", "C"]
        assert sum(truth["counts"].values()) == 3
        assert set(where.values()) <= set(PLACES)
        assert list(where.values()).count("gripper") <= 1
        assert [code for code, place in where.items() if place == "tester"] == [cell.devices.board] * (
            cell.devices.board is not None
        )
        assert cell.devices.sensor in (None, "gripper" in where.values())
        assert truth["at_pick_place"] is None or where[truth["at_pick_place"]] == "feeder"
