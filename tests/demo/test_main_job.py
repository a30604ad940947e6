"""Tests of the demo's main program: all counts agree, and faults are reported. See test_parts_benchmark for kills."""

import asyncio
import io
import json
import random
import re
import signal
import zipfile
from collections.abc import AsyncIterator, Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest
import pytest_asyncio
from asyncua import Client as OpcUaClient
from pymodbus.client import AsyncModbusTcpClient

from arcor2_fakes.cell.boards import draw_boards
from arcor2_hw.client import Client
from arcor2_hw.data import rpc
from arcor2_hw.data.base import Unset
from arcor2_hw.data.package import PackageStateEnum
from arcor2_hw.data.parts import PartCounts, PlaceKind
from arcor2_server.demo.workplace import confirm_emptied
from tests.demo.running import Run, demo
from tests.e2e.harness import until
from tests.ports import free_port
from tests.waiting import WITHIN

pytestmark = pytest.mark.asyncio(loop_scope="module")
BOARDS = 2
SEEDS = iter(lambda: random.SystemRandom().randrange(1_000_000), None)
SEED = next(seed for seed in SEEDS if draw_boards(BOARDS, seed)[0].defect is None)
"""A random seed whose first board is good, so that the second one is loaded while the first one gets its label."""
GOOD = 3
"""A seed whose first board is good."""
FIRST_VERSION = Path(__file__).parents[1] / "compatibility" / "recorded" / "demo-package.zip"


class Cell:
    """A demo that has completed its order and keeps running, and an observer's record of that run."""

    def __init__(self, run: Run, script: list[bool], order: list[str]) -> None:
        self.run, self.script, self.order = run, script, order

    @property
    def url(self) -> str:
        at = self.run.at()
        assert at is not None
        return str(at["url"])

    async def renew(self, boards: int = 1) -> None:
        """Prepare a new start like an operator: remove everything and insert new boards."""
        await self.run.command_fake("world", "renew", boards=boards, seed=GOOD)
        async with Client(self.url, "operator") as client:
            await confirm_emptied(client)

    async def run_program(
        self, client: Client, at: dict[str, Callable[[], Awaitable[Any]]] | None = None, package_id: str = ""
    ) -> str:
        """Run a package, by default the newest; return its error, empty for none.

        at: functions that the test calls when the program action of that name starts.
        """
        if not package_id:
            package_id = (await client.call("ListPackages"))[-1].id
        await client.subscribe_events({"ProgramPosition"})  # with it, actions of functions are announced
        await client.call("RunPackage", rpc.RunPackageArgs(package_id))
        names: dict[str, str] = {}
        problem = ""
        while True:
            event = await client.next_event(timeout=40)
            match event.event:
                case "PackageInfo":
                    names = {action.id: action.name for action in event.data.project.all_actions()}
                case "ActionStateBefore" if at and (act := at.get(names.get(event.data.action_id, ""))):
                    await act()
                case "ProjectException":
                    problem = event.data.message
                case "PackageState" if event.data.state is PackageStateEnum.STOPPED:
                    return problem


async def watch(url: str, results: list[bool], order: list[str]) -> None:
    """Observe the server without registering a user; collect the events of the script.

    order: starts and ends of actions, as `+name` and `-name`.
    """
    async with Client(url, reconnect=False) as client:
        names: dict[str, str] = {}
        await client.subscribe_events({"ProgramPosition"})
        async for event in client.events():
            match event.event:
                case "PackageInfo":
                    names = {action.id: action.name for action in event.data.project.all_actions()}
                case "ActionStateBefore":
                    order.append(f"+{names[event.data.action_id]}")
                case "ActionStateAfter":
                    order.append(f"-{names[event.data.action_id]}")
                    if names[event.data.action_id] == "test":
                        assert not isinstance(event.data.results, Unset)
                        results.append(event.data.results == ["true"])


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def cell(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Cell]:
    print(f"seed {SEED}")  # noqa: T201
    options = ("--boards", str(BOARDS), "--seed", str(SEED), "--opcua", "--opcua-port", str(free_port()))
    async with demo(tmp_path_factory.mktemp("demo"), *options) as run:
        at = await until(run.at, "the demo prints its addresses", 40)
        script: list[bool] = []
        order: list[str] = []
        observer = asyncio.create_task(watch(at["url"], script, order))
        await until(
            lambda: "The server runs at" in run.output or run.process.returncode is not None, "the cycle ends", 200
        )
        yield Cell(run, script, order)
        run.process.send_signal(signal.SIGINT)
        assert await asyncio.wait_for(run.process.wait(), WITHIN) == 0, run.output
        await asyncio.wait_for(observer, WITHIN)  # its events end with the server
        assert run.at() is None


async def test_counts_of_program_tester_simulation_and_planning_agree(cell: Cell) -> None:
    run, at = cell.run, cell.run.at()
    assert at is not None, run.output
    assert f"seed {SEED}" in run.output
    found = re.search(r"cycle complete: (\d+) boards, (\d+) passed, (\d+) failed, ([\d.]+) s", run.output)
    assert found, run.output
    boards, passed, failed = (int(number) for number in found.groups()[:3])

    host, _, port = at["tester"]["modbus"].rpartition(":")
    tester = AsyncModbusTcpClient(host, port=int(port))
    await tester.connect()
    counters = (await tester.read_input_registers(12, count=3, device_id=1)).registers
    tester.close()
    world, erp = await run.command_fake("world", "truth"), await run.command_fake("erp", "truth")

    assert boards == BOARDS
    assert passed > 0 < failed
    assert (cell.script.count(True), cell.script.count(False)) == (passed, failed)
    assert counters == [boards, passed, failed]
    where = [(board["good"], board["place"]) for board in world["boards"]]
    assert sorted(where) == sorted([(True, "good")] * passed + [(False, "bad")] * failed)
    reported = {(result["serial"], result["passed"]) for result in erp["results"]}
    assert reported == {(board["code"], board["good"]) for board in world["boards"]}
    assert len(erp["results"]) == boards

    async with Client(cell.url, "tests") as client:
        (inventory,) = await client.get_parts()
    assert inventory.counts == PartCounts(boards, passed, failed)
    boxes = {place.kind: set(place.parts) for place in inventory.places if place.kind.is_box}
    assert boxes[PlaceKind.GOOD] == {board["code"] for board in world["boards"] if board["good"]}
    assert boxes[PlaceKind.BAD] == {board["code"] for board in world["boards"] if not board["good"]}


async def test_any_opcua_client_reads_the_counts(cell: Cell) -> None:
    at = cell.run.at()
    assert at is not None
    async with OpcUaClient(at["opcua"], timeout=40.0) as client:
        index = await client.get_namespace_index("http://opcfoundation.org/UA/PackML/")
        (unit,) = await (await client.nodes.objects.get_child(f"{index}:PackMLObjects")).get_children()
        await client.load_data_type_definitions()
        (processed,) = await (await unit.get_child([f"{index}:Admin", f"{index}:ProdProcessedCount"])).read_value()
    assert processed.Count == BOARDS


async def test_the_belt_brings_the_next_board_while_the_tester_works(cell: Cell) -> None:
    order = cell.order
    work = order[order.index("+test_and_fetch") : order.index("-test_and_fetch")]
    assert work.index("+close") < work.index("-halt"), "the tester starts before the belt has ended"
    assert work.index("+bring") < work.index("-open_again"), "the belt starts before the tester has ended"


async def test_the_robot_loads_the_next_board_while_the_press_works(cell: Cell) -> None:
    order = cell.order
    work = order[order.index("+label_and_load") : order.index("-label_and_load")]
    assert work.index("+pick") < work.index("-label"), "the robot starts before the printer has ended"
    assert work.index("+press_away") < work.index("-insert"), "the press ends before the robot has ended"


async def test_good_boards_carry_their_own_label(cell: Cell) -> None:
    world, printer = await cell.run.command_fake("world", "truth"), await cell.run.command_fake("printer", "truth")
    good = [board["code"] for board in world["boards"] if board["good"]]
    labels = {board["code"]: board["label"] for board in world["boards"] if board["label"] is not None}
    assert labels == {code: {"code": code, "pressed": True} for code in good}
    assert (world["spilled_labels"], printer["counter"]) == ([], len(good))


async def test_the_tower_was_green_while_the_program_ran_and_is_red_after_it(cell: Cell) -> None:
    io, world = await cell.run.command_fake("io", "truth"), await cell.run.command_fake("world", "truth")
    green = [event["on"] for event in io["history"] if event["output"] == 2]
    assert green
    assert (green[0], green[-1]) == (True, False)
    assert world["tower"] == {"red": True, "amber": False, "green": False, "white": False}


# ---------------------------------------------------------------------------------------------------- faults
async def test_an_unread_board_is_rejected_and_late_results_are_delivered(cell: Cell) -> None:
    command_fake = cell.run.command_fake
    async with Client(cell.url, "tests") as client:
        # The label of the board cannot be read: the board is rejected and reported, and the program goes on.
        await cell.renew()
        await command_fake("erp", "add_order", order="UNREAD", product="Controller board", quantity=1)
        assert await cell.run_program(client, {"picture": lambda: command_fake("reader", "health", value="FAIL")}) == ""
        await command_fake("reader", "health", value="OK")
        assert (await command_fake("world", "truth"))["counts"]["bad"] == 1
        (unread,) = [
            result for result in (await command_fake("erp", "truth"))["results"] if result["order"] == "UNREAD"
        ]
        assert (unread["serial"], unread["passed"]) == ("unread", False)
        assert "no code was read" in unread["note"]
        await command_fake("erp", "add_order", order="AGAIN", product="Controller board", quantity=1)

        # The planning service stops: production continues, and the result is delivered afterwards.
        await cell.renew()
        missing: list[int] = []

        async def down() -> None:
            await command_fake("erp", "refuse")
            await command_fake("erp", "reset")

        async def up() -> None:
            erp = await command_fake("erp", "truth")
            missing.append(sum(result["order"] == "AGAIN" for result in erp["results"]))
            await command_fake("erp", "heal")

        assert await cell.run_program(client, {"bring": down, "all_sent": up}) == ""
    assert missing == [0]
    world, erp = await command_fake("world", "truth"), await command_fake("erp", "truth")
    assert world["counts"]["good"] == 1
    (board,) = world["boards"]
    repeated = [(result["serial"], result["passed"]) for result in erp["results"] if result["order"] == "AGAIN"]
    assert repeated == [(board["code"], True)]


async def test_a_package_of_the_first_version_runs_with_its_own_drivers(cell: Cell, tmp_path: Path) -> None:
    async with Client(cell.url, "tests") as client:
        newest = tmp_path / "newest.zip"
        await client.rest.download_package((await client.call("ListPackages"))[-1].id, newest)
        await client.rest.upload_package("first-version", with_settings_of(FIRST_VERSION, newest))
        await cell.renew()
        await cell.run.command_fake("erp", "add_order", order="FIRST", product="Controller board", quantity=1)
        assert await cell.run_program(client, package_id="first-version") == ""
        await client.call("DeletePackage", rpc.IdArgs("first-version"))
    world, erp = await cell.run.command_fake("world", "truth"), await cell.run.command_fake("erp", "truth")
    (board,) = world["boards"]
    assert (board["place"], board["label"]) == ("good", {"code": board["code"], "pressed": True})
    reported = [(result["serial"], result["passed"]) for result in erp["results"] if result["order"] == "FIRST"]
    assert reported == [(board["code"], True)]


def with_settings_of(package: Path, other: Path) -> bytes:
    """Return a package whose objects have the settings, and thus the addresses, of those in another package."""
    with zipfile.ZipFile(other) as archive:
        scene = json.loads(archive.read("data/scene.json"))
    settings = {each["name"]: each["parameters"] for each in scene["objects"]}
    packed = io.BytesIO()
    with zipfile.ZipFile(package) as archive, zipfile.ZipFile(packed, "w") as target:
        for name in archive.namelist():
            content = archive.read(name)
            if name == "data/scene.json":
                scene = json.loads(content)
                for each in scene["objects"]:
                    each["parameters"] = settings[each["name"]]
                content = json.dumps(scene).encode()
            target.writestr(name, content)
    return packed.getvalue()


async def test_once_prints_one_line_when_a_fault_ends_the_program(tmp_path: Path) -> None:
    async with demo(tmp_path, "--once", "--boards", "1", "--seed", str(GOOD)) as run:
        await until(run.at, "the demo prints its addresses", 40)
        # No call of the belt is running: the message must name it nevertheless.
        await until(lambda: "  board_there" in run.output, "the program waits for the board", 60)
        await run.command_fake("belt", "emergency", code=0x2310)
        assert await asyncio.wait_for(run.process.wait(), 60) == 8, run.output
    last = run.output.strip().splitlines()[-1]
    assert last.startswith("arcor2-hw demo: ")
    assert "belt" in last
    assert "cycle complete" not in run.output
    assert "Traceback" not in run.output
