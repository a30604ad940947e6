"""The world as a process between the fakes: real tester and reader, and a test robot controller."""

import asyncio
import math
import subprocess
import sys
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import pytest

import arcor2_fakes.cell
from arcor2_fakes.cell.boards import draw_boards
from arcor2_fakes.control import ControlClient, ControlError, ControlServer
from tests.fakes.conftest import run_fake

EXAMPLE = str(Path(arcor2_fakes.cell.__file__).with_name("example.json"))
FEEDER, READER, TESTER = (0.4, -0.3, 0.08), (0.3, 0.0, 0.35), (0.5, 0.15, 0.1)
GOOD, BAD, NOWHERE = (0.2, 0.5, 0.06), (-0.15, 0.52, 0.06), (0.0, -0.6, 0.1)
TIP = 0.1
SEED = 11


class StandInRobot:
    """The control channel of a robot controller whose arm moves instantly."""

    def __init__(self) -> None:
        self.control = ControlServer()
        self.control.source("truth", self.truth)
        self.control.command("set_input", self.set_input)
        self.outputs = 0
        self.inputs = 0
        self.tcp_pose = (0.0, 0.0, 0.5, 0.0, math.pi, 0.0)

    def truth(self) -> dict[str, Any]:
        return {"tcp_pose": self.tcp_pose, "tcp_offset": (0.0,) * 6, "digital_outputs": self.outputs, "q": (0.0,) * 6}

    def set_input(self, bit: int, on: bool = True) -> None:
        self.inputs = self.inputs & ~(1 << bit) | int(on) << bit

    def at(self, x: float, y: float, z: float) -> None:
        """Move the tip to a point, pointing down. The base of the controller is base_link rotated by 180°."""
        self.tcp_pose = (-x, -y, z + TIP, 0.0, math.pi, 0.0)


class Cell:
    """All fakes and the world, with an asynchronous client for each control channel."""

    def __init__(self, robot: StandInRobot, tester: ControlClient, reader: ControlClient, world: ControlClient) -> None:
        self.robot, self.tester, self.reader, self.world = robot, tester, reader, world

    async def until(self, client: ControlClient, holds: Callable[[Any], bool], within: float = 20.0) -> Any:
        async with asyncio.timeout(within):
            while not holds(truth := await client.do("truth")):
                await asyncio.sleep(0.005)
        return truth

    async def move(self, x: float, y: float, z: float) -> None:
        self.robot.at(x, y, z)
        await self.until(self.world, lambda truth: truth["gripper"]["tip"] == pytest.approx((x, y, z), abs=1e-9))

    async def grip(self, on: bool) -> None:
        self.robot.outputs = int(on)
        await self.until(self.world, lambda truth: truth["gripper"]["closed"] is on)

    async def carry(self, source: tuple[float, ...], target: tuple[float, ...]) -> None:
        await self.move(*source)
        await self.grip(True)
        await self.move(*target)
        await self.grip(False)

    async def door(self, opening: bool) -> None:
        await self.tester.do("push_door", opening=opening)

    async def test(self) -> str:
        """Test the board in the fixture, like the buttons at the station."""
        await self.door(False)
        for command, state in (("reset", "Idle"), ("start", "Complete")):
            assert await self.tester.do("command", name=command) == "accepted"
            truth = await self.until(self.tester, lambda truth, state=state: truth["state"] == state)  # type: ignore[misc]
        await self.door(True)
        result: str = truth["results"][-1]["result"]
        return result


@pytest.fixture
async def cell(start_fake: Callable[..., Any]) -> AsyncIterator[Cell]:
    robot = StandInRobot()
    await robot.control.start()
    clients = []
    try:
        tester = await asyncio.to_thread(start_fake, "functional_tester", "--time-scale", "20", "--test-time", "2")
        reader = await asyncio.to_thread(start_fake, "barcode_reader")
        addresses = ["--robot", robot.control.address, "--tester", tester.ready["control"]]
        addresses += ["--reader", reader.ready["control"]]
        world = await asyncio.to_thread(
            start_fake, "cell", "--layout", EXAMPLE, *addresses, "--boards", "4", "--seed", str(SEED)
        )
        clients.extend([await ControlClient.connect(fake.ready["control"]) for fake in (tester, reader, world)])
        yield Cell(robot, *clients)
    finally:
        for client in clients:
            await client.close()
        await robot.control.close()


async def test_boards_are_read_tested_and_sorted(cell: Cell) -> None:
    drawn = draw_boards(4, SEED)
    await cell.door(True)
    for _ in drawn:
        await cell.until(cell.world, lambda truth: truth["at_pick_place"] is not None)
        await cell.move(*FEEDER)
        await cell.grip(True)
        assert cell.robot.inputs == 1
        await cell.move(*READER)
        code = (await cell.until(cell.reader, lambda truth: truth["code"] is not None))["code"]
        await cell.move(*TESTER)
        await cell.until(cell.reader, lambda truth: truth["code"] is None)
        await cell.grip(False)
        assert cell.robot.inputs == 0
        assert (await cell.tester.do("truth"))["board"] == code
        verdict = await cell.test()
        await cell.carry(TESTER, GOOD if verdict == "pass" else BAD)
        assert (await cell.tester.do("truth"))["board"] is None
    truth = await cell.world.do("truth")
    assert {board["code"]: board["place"] for board in truth["boards"]} == {
        board.code: "bad" if board.defect else "good" for board in drawn
    }
    tested = await cell.tester.do("truth")
    assert [result["code"] for result in tested["results"]] == [board.code for board in drawn]
    assert (tested["passed"], tested["failed"]) == (truth["counts"]["good"], truth["counts"]["bad"])
    assert tested["failed"] > 0 < tested["passed"]


async def test_a_board_dropped_in_the_wrong_place_is_neither_tested_nor_counted(cell: Cell) -> None:
    await cell.carry(FEEDER, TESTER)  # the door is closed
    await cell.until(cell.world, lambda truth: truth["at_pick_place"] is not None)
    await cell.carry(FEEDER, NOWHERE)
    truth = await cell.world.do("truth")
    assert [board["place"] for board in truth["boards"]] == ["lost", "lost", "feeder", "feeder"]
    assert "door is closed" in truth["boards"][0]["history"][-1]["why"]
    assert (await cell.tester.do("truth"))["board"] is None


async def test_a_broken_gripper_moves_nothing(cell: Cell) -> None:
    await cell.door(True)
    await cell.world.do("gripper", works=False)
    await cell.move(*FEEDER)
    cell.robot.outputs = 1
    await asyncio.sleep(0.3)
    await cell.move(*TESTER)
    cell.robot.outputs = 0
    assert (await cell.world.do("truth"))["counts"]["feeder"] == 4
    assert cell.robot.inputs == 0
    assert (await cell.tester.do("truth"))["board"] is None


async def test_other_faults_can_be_injected(cell: Cell) -> None:
    await cell.move(*FEEDER)
    await cell.grip(True)
    await cell.world.do("sensor", stuck=False)
    assert cell.robot.inputs == 0
    await cell.world.do("sensor", stuck=None)
    assert cell.robot.inputs == 1
    await cell.world.do("drop")
    assert cell.robot.inputs == 0
    with pytest.raises(ControlError, match="no board is gripped"):
        await cell.world.do("drop")
    last = (await cell.world.do("truth"))["boards"][-1]["code"]
    await cell.world.do("remove_board", code=last)
    counts = (await cell.world.do("truth"))["counts"]
    assert (counts["removed"], counts["feeder"]) == (1, 2 if counts["lost"] else 3)


async def test_the_world_waits_for_starting_fakes(start_fake: Callable[..., Any]) -> None:
    robot = StandInRobot()
    address = await robot.control.start()
    await robot.control.close()
    tester = await asyncio.to_thread(start_fake, "functional_tester")
    reader = await asyncio.to_thread(start_fake, "barcode_reader")
    addresses = ["--robot", address, "--tester", tester.ready["control"], "--reader", reader.ready["control"]]
    starting = asyncio.create_task(asyncio.to_thread(start_fake, "cell", "--layout", EXAMPLE, *addresses))
    await asyncio.sleep(0.8)
    assert not starting.done()
    late = StandInRobot()
    late.control = ControlServer(*address.split(":")[:1], int(address.split(":")[1]))
    late.control.source("truth", late.truth)
    late.control.command("set_input", late.set_input)
    await late.control.start()
    world = await starting
    assert world.ready["boards"] == 5
    # The process of the world ends when one of the fakes ends.
    await asyncio.to_thread(reader.terminate)
    assert await asyncio.to_thread(world.process.wait, 30.0) == 3
    world.end()
    assert world.errors == f"cell: the reader at {reader.ready['control']} has gone\n"
    await late.control.close()


async def test_an_unknown_robot_is_refused(start_fake: Callable[..., Any]) -> None:
    tester = await asyncio.to_thread(start_fake, "functional_tester")
    reader = await asyncio.to_thread(start_fake, "barcode_reader")
    at = reader.ready["control"]
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "arcor2_fakes.cell", "--layout", EXAMPLE),
        *("--robot", tester.ready["control"], "--tester", tester.ready["control"], "--reader", at),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    _, errors = await process.communicate()
    assert process.returncode == 3
    assert errors.decode().startswith("cell: the robot")
    assert len(errors.decode().splitlines()) == 1


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--layout", "none.json"], "none.json"),
        (["--layout", EXAMPLE, "--robot", "here"], "HOST:PORT"),
        (["--layout", EXAMPLE, "--patience", "0"], "can't be reached"),
    ],
)
def test_invalid_arguments_are_reported_in_one_line(arguments: list[str], says: str) -> None:
    options = {"--robot": "127.0.0.1:1", "--tester": "127.0.0.1:1", "--reader": "127.0.0.1:1"}
    options |= dict(zip(arguments[::2], arguments[1::2], strict=True))
    line = [part for option in options.items() for part in option]
    ended = run_fake("cell", *line)
    assert ended.returncode == (3 if "reached" in says else 2)
    assert len(ended.stderr.splitlines()) == 1
    assert says in ended.stderr
