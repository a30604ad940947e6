"""The books of parts under faults: the demo cell with random faults, and an operator who resolves each of them.

The truth is that of the simulated world and of the simulated planning service, never that of the books. The operator
sends only the requests that the operator's screen sends, and acts at the simulated cell by hand: removes a cause, takes
a board out, opens a door.
"""

import asyncio
import contextlib
import os
import random
import signal
import socket
import sqlite3
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, NamedTuple

from msgspec import UNSET

from arcor2_hw.client import Client, RequestFailed
from arcor2_hw.data import rpc
from arcor2_hw.data.alarms import AlarmFilter
from arcor2_hw.data.base import Unset
from arcor2_hw.data.held import HeldData, HoldChoice, OnError
from arcor2_hw.data.package import PackageStateEnum
from arcor2_hw.data.parts import ConfirmedPart, Part, PartBooks, PartCounts
from arcor2_hw.exceptions import Arcor2Error
from arcor2_server.demo.control import ask
from arcor2_server.demo.fakes import fakes, world_arguments
from arcor2_server.demo.processes import Child, python_module
from arcor2_server.demo.run import FAST, FAST_ACCELERATIONS
from arcor2_server.demo.workplace import Creation, Scalar, layout_file, load
from benchmarks.metrics import Metric, Report
from tests.e2e.harness import until

SEEDS, LONG_SEEDS = 1, 10
BOARDS, FAULTS = 20, 50
SILENT_AFTER: Final = 60.0
"""Time without any event after which a program counts as stuck, s."""
DECIDED_WITHIN: Final = 40.0
"""Time within which a decision is accepted: a device reconnects, a controller restarts, s."""
TRIES: Final = 6
"""Attempts of one action after which the operator ends the program."""

PICKS: Final = {"pick": "stop", "pick_unread": "stop", "take_out": "tester", "out_of_nest": "label"}
"""The physical place from which an action takes a board."""
PLACES: Final = {
    "insert": "tester", "into_nest": "label", "into_good_box": "good", "into_bad_box": "bad", "reject_unread": "bad",
}  # fmt: skip
NAMES: Final = {
    "stop": "feeder", "belt": "feeder", "gripper": "robot", "tester": "tester", "label": "label_place",
    "good": "good_boards", "bad": "bad_boards",
}  # fmt: skip
"""The place in the books for each physical place; all others are outside of the cell."""
REPORTS: Final = ("report", "report_unread")


class Do(NamedTuple):
    """A command to a fake."""

    fake: str
    command: str
    arguments: dict[str, Any]


def do(fake: str, command: str, **arguments: Any) -> Do:
    """Return a command to a fake."""
    return Do(fake, command, {name: value for name, value in arguments.items() if value != ""})


class Fault(NamedTuple):
    """A fault: how it is injected, and how a person removes its cause at the cell.

    device: where its effect shows. kill: which processes are killed: host or server. at: the actions at which it is
    injected; empty: any.
    """

    name: str
    device: str
    cause: tuple[Do, ...] = ()
    cure: tuple[Do, ...] = ()
    kill: str = ""
    at: tuple[str, ...] = ()


def _lost(device: str, *, serial: bool = False, wire: str = "") -> list[Fault]:
    """Return the faults in which the connection of a device is lost. serial: whether a cable can be unplugged."""
    broken = Fault(f"{device} unplugged", device, (do(device, "unplug"),), (do(device, "plug"),))
    if not serial:
        broken = Fault(f"{device} reset", device, (do(device, "reset", wire=wire),))
    return [
        Fault(f"{device} silent", device, (do(device, "silence", wire=wire),), (do(device, "heal", wire=wire),)),
        broken,
    ]


KINDS: Final[tuple[Fault, ...]] = (
    Fault("unreadable code", "reader", (do("reader", "health", value="FAIL"),), (do("reader", "health", value="OK"),),
          at=("picture", "board_there", "halt")),
    *_lost("reader", serial=True),
    *_lost("belt"),
    Fault("belt jammed", "belt", (do("belt", "follow_error"),),
          (do("belt", "follow_error", on=False), do("belt", "power_cycle"))),
    Fault("belt emergency", "belt", (do("belt", "emergency", code=0x2310),), (do("belt", "power_cycle"),)),
    *_lost("io"),
    Fault("barrier sees nothing", "io", (do("world", "barrier", number=0, stuck=False),),
          (do("world", "barrier", number=0, stuck=None),)),
    Fault("barrier sees a board", "io", (do("world", "barrier", number=0, stuck=True),),
          (do("world", "barrier", number=0, stuck=None),)),
    *_lost("robot", wire="rtde"),
    Fault("protective stop", "robot", (do("robot", "protective_stop"),)),
    Fault("safeguard stop", "robot", (do("robot", "safeguard_stop"),), (do("robot", "safeguard_stop", on=False),)),
    Fault("no air", "robot", (do("world", "gripper", works=False),), (do("world", "gripper", works=True),)),
    Fault("board slips", "robot", (do("world", "drop"),)),
    Fault("part sensor off", "robot", (do("world", "sensor", stuck=False),), (do("world", "sensor", stuck=None),)),
    Fault("part sensor on", "robot", (do("world", "sensor", stuck=True),), (do("world", "sensor", stuck=None),)),
    *_lost("tester"),
    Fault("no contact", "tester", (do("tester", "fault", code=103, armed=True),)),
    Fault("supply overload", "tester", (do("tester", "fault", code=104, armed=True),)),
    Fault("door opened", "tester", (do("tester", "push_door", opening=True),), at=("test",)),
    Fault("tester emergency stop", "tester", (do("tester", "emergency_stop"),),
          (do("tester", "emergency_stop", pressed=False),)),
    *_lost("printer"),
    Fault("labels out", "printer", (do("printer", "media", labels=0),), (do("printer", "media", labels=100),)),
    Fault("head open", "printer", (do("printer", "head_open"),), (do("printer", "head_open", on=False),)),
    Fault("printer paused", "printer", (do("printer", "pause"),), (do("printer", "pause", on=False),)),
    *_lost("press", serial=True),
    Fault("servo overload", "press", (do("press", "hardware_error", servo=1),)),
    *_lost("camera"),
    *_lost("erp"),
    Fault("host killed", "", kill="host"),
    Fault("host killed", "", kill="host", at=(*PLACES, *REPORTS)),
    Fault("host killed", "", kill="host", at=(*PICKS, "label", "test")),
    Fault("server killed", "", kill="server"),
    Fault("server killed", "", kill="server", at=(*PLACES, *REPORTS)),
)  # fmt: skip


@dataclass
class Result:
    """What was found for a seed. Each entry of the lists is a sentence."""

    boards: int = 0
    faults: Counter[str] = field(default_factory=Counter)
    kills: int = 0
    holds: int = 0
    starts: int = 0
    unaccounted: list[str] = field(default_factory=list)
    not_once: list[str] = field(default_factory=list)
    moved: list[str] = field(default_factory=list)
    unresolved: list[str] = field(default_factory=list)

    def problems(self) -> list[str]:
        """Return everything that contradicts the goals."""
        return [*self.unaccounted, *self.not_once, *self.moved, *self.unresolved]


class Interrupted(Exception):
    """The test has killed a process."""


class Cell:
    """The demo cell without its first run: fakes, world and a server that can be killed."""

    def __init__(self, folder: Path, boards: int, seed: int) -> None:
        self.folder, self._boards, self._seed = folder, boards, seed
        self._children: list[Child] = []
        self.at: dict[str, str] = {}
        """Control channels of the fakes."""
        self.url = ""
        self.package_id = ""
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self._port = probe.getsockname()[1]
        self._server = self._new_server()

    def _child(self, name: str, command: list[str]) -> Child:
        child = Child(name, command, self.folder / f"{name}.log")
        self._children.append(child)
        return child

    def _new_server(self) -> Child:
        serve = python_module(
            *("arcor2_server.cli.main", "serve", "--port", str(self._port), "--data-dir", str(self.folder / "data"))
        )
        return Child("server", serve, self.folder / "server.log")

    async def start(self) -> None:
        """Start everything, and build the package."""
        wanted = fakes(self._boards, self._seed, fast=True)
        options = {"robot": ("--time-scale", "0.1")}  # its times for unlocking
        children = [self._child(fake.name, [*fake.command(), *options.get(fake.name, ())]) for fake in wanted]
        async with asyncio.TaskGroup() as starts:
            found = [starts.create_task(child.start_json()) for child in children]
            serving = starts.create_task(self._server.start())
        self.url = serving.result()
        started = {fake.name: (fake, task.result()) for fake, task in zip(wanted, found, strict=True)}
        self.at = {name: str(ready["control"]) for name, (_, ready) in started.items()}
        arguments = world_arguments(started, layout_file(), self._boards, self._seed)
        world = self._child("world", python_module("arcor2_fakes.cell", *arguments, "--control", "127.0.0.1:0"))
        self.at["world"] = (await world.start_json())["control"]
        settings: dict[str, Scalar] = {"outbox": str((self.folder / "data" / "outbox").absolute())}
        settings |= FAST_ACCELERATIONS
        for fake, ready in started.values():
            settings |= fake.settings(ready)
        async with Client(self.url, "technician", reconnect=False) as client:
            creation = Creation(client, load(), settings)
            project = await creation.open_project(await creation.open_scene(), FAST)
            built = await client.call("BuildProject", rpc.BuildProjectArgs(project.id, project.name))
            self.package_id = built.package_id
            await client.close_project()

    async def stop(self) -> None:
        """Stop everything."""
        await self._server.stop()
        await asyncio.gather(*(child.stop() for child in reversed(self._children)))

    async def command(self, fake: str, command: str, **arguments: Any) -> Any:
        """Send a command to a fake."""
        return await ask(self.at[fake], command, within=15.0, **arguments)

    async def apply(self, commands: tuple[Do, ...]) -> None:
        """Send commands to fakes. One that is impossible now, such as dropping nothing, has no effect."""
        for fake, command, arguments in commands:
            with contextlib.suppress(Arcor2Error):
                await self.command(fake, command, **arguments)

    async def kill(self, what: str) -> None:
        """Kill the cell hosts, or the server, as a power cut does; then start the server again."""
        server = self._server.pid
        for pid in [server] if what == "server" else list(_hosts_of(server)):
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        if what == "server":
            await self._server.stop()
            self._server = self._new_server()
            self.url = await self._server.start()

    def waiting_results(self) -> int:
        """Return the number of results that are stored for the planning service and not delivered."""
        waiting = 0
        for file in (self.folder / "data" / "outbox").glob("*.sqlite"):
            with contextlib.closing(sqlite3.connect(f"file:{file}?mode=ro", uri=True)) as database:
                waiting += database.execute("SELECT count(*) FROM message WHERE state = 'waiting'").fetchone()[0]
        return waiting


def _hosts_of(server: int) -> Iterator[int]:
    for task in Path(f"/proc/{server}/task").iterdir():
        for pid in (task / "children").read_text().split():
            with contextlib.suppress(OSError):
                if b"arcor2_hw.runtime.host" in Path(f"/proc/{pid}/cmdline").read_bytes():
                    yield int(pid)


class Trial:
    """One seed: random faults until all boards have left the belt."""

    def __init__(self, folder: Path, seed: int, boards: int, faults: int, report: Callable[[str], None]) -> None:
        self._cell = Cell(folder, boards, seed)
        self._random = random.Random(seed)
        self._left = faults
        self._say = report
        self._active: list[Fault] = []
        self._until_next = self._random.randrange(3, 10)
        self._injecting: set[asyncio.Task[None]] = set()
        self._killed = asyncio.Event()
        self._tries: Counter[int | str] = Counter()
        self._devices: dict[str, str] = {}
        """Names of the devices by their ids."""
        self._parallel = False
        """Whether the program tests a board while it fetches the next one."""
        self._anonymous: set[str] = set()
        """Boards that have left the books without a serial number."""
        self.result = Result(boards)

    async def run(self) -> Result:
        """Run the cell until every board is in a box, or was taken out."""
        most = 10 + 2 * self._left
        await self._cell.start()
        try:
            while not await self._finished():
                await self._run_program()
                if self.result.starts > most:
                    raise RuntimeError(f"The program was started {most} times: the cell makes no progress.")
            await self._last_results()
            await self._check_results()
        finally:
            for task in self._injecting:
                task.cancel()
            await self._cell.stop()
        return self.result

    # -------------------------------------------------------------------------------- truth
    async def _boards(self) -> list[dict[str, Any]]:
        """Return the boards of the world. A board at the stop of the belt has the place `stop`."""
        truth = await self._cell.command("world", "truth")
        for board in truth["boards"]:
            if board["code"] == truth["at_pick_place"]:
                board["place"] = "stop"
        boards: list[dict[str, Any]] = truth["boards"]
        return boards

    @staticmethod
    def _waiting(boards: list[dict[str, Any]]) -> list[str]:
        """Return the boards that have not been picked yet."""
        return [board["code"] for board in boards if board["place"] in ("feeder", "belt", "stop")]

    async def _finished(self) -> bool:
        return all(board["place"] in ("good", "bad", "removed") for board in await self._boards())

    async def _joints(self) -> tuple[list[float], Any]:
        """Return the joints of the robot and of the press, once they and the gripper are at standstill."""
        while True:
            robot, press = await self._cell.command("robot", "truth"), await self._cell.command("press", "truth")
            speeds = [servo["speed"] for servo in press["servos"].values()]
            jaws = (await self._cell.command("world", "truth"))["gripper"]
            settled = not jaws["works"] or jaws["closed"] == bool(robot["digital_outputs"] & 1)
            if settled and not robot["moving"] and not any(abs(speed) > 1e-3 for speed in speeds):
                angles = {name: round(servo["angle"], 2) for name, servo in press["servos"].items()}
                return [round(q, 3) for q in robot["q"]], angles
            await asyncio.sleep(0.05)

    async def _check_still(self, before: Any, when: str) -> None:
        """Record whether something has moved without a command of a person."""
        if (after := await self._joints()) != before:
            self._found_wrong(self.result.moved, f"moved {when}: {before} -> {after}")

    # -------------------------------------------------------------------------------- program
    async def _run_program(self) -> None:
        """Start the program like an operator, and follow it until it has ended or was interrupted."""
        cell = self._cell
        self._killed.clear()
        async with Client(cell.url, "operator", reconnect=False) as client:
            await client.subscribe_events({"ProgramPosition", "Held"})
            await self._cure()
            interrupted = any(not isinstance(books.run, Unset) for books in await client.get_parts())
            await self._confirm(client, every=not interrupted and not self._waiting(await self._boards()))
            await self._start(client)
            self.result.starts += 1
            try:
                await self._follow(client)
            except (Interrupted, Arcor2Error):
                if not self._killed.is_set():
                    raise
                self._say("  interrupted")
        if self._killed.is_set():
            await asyncio.gather(*self._injecting)
            still = await self._joints()
            await asyncio.sleep(0.3)
            await self._check_still(still, "after an interruption")

    async def _start(self, client: Client) -> None:
        deadline = time.monotonic() + DECIDED_WITHIN
        while True:
            try:
                runs = [books.run for books in await client.get_parts()]
                continues = any(not isinstance(run, Unset) and run.continues and run.confirmed for run in runs)
                args = rpc.RunPackageArgs(self._cell.package_id, on_error=OnError.HOLD, continues=continues)
                await client.call("RunPackage", args)
                self._say(f"  started{' where it was interrupted' if continues else ''}")
            except RequestFailed as error:  # such as while the last host ends
                if time.monotonic() > deadline:
                    raise RuntimeError(f"The program does not start: {error}") from error
                await asyncio.sleep(0.2)
            else:
                return

    async def _follow(self, client: Client) -> None:
        names: dict[str, str] = {}
        held: HeldData | None = None
        while True:
            event = await self._next(client)
            match event.event:
                case "PackageInfo":
                    names = {action.id: action.name for action in event.data.project.all_actions()}
                    self._devices = {one.id: one.name for one in event.data.scene.objects}
                case "ActionStateBefore":
                    name = names.get(event.data.action_id, "")
                    if name == "show_unread":
                        await self._cure("reader")
                    if name == "order":
                        self._tries.clear()
                    if name in ("order", "take_out", "test_and_fetch"):
                        self._parallel = name == "test_and_fetch"
                    self._maybe_inject(name)
                    if name == "order" and await self._finished():
                        await client.call("StopPackage")
                case "Held":
                    held = event.data
                case "PackageState" if event.data.state is PackageStateEnum.PAUSED and held is not None:
                    # The actions of other branches have ended.
                    await self._resolve(client, held)
                    held = None
                case "ProjectException":
                    self._say(f"  ended: {event.data.message}")
                case "PackageState" if event.data.state is PackageStateEnum.STOPPED:
                    return

    async def _next(self, client: Client) -> Any:
        waiting = asyncio.ensure_future(client.next_event(timeout=SILENT_AFTER))
        killed = asyncio.ensure_future(self._killed.wait())
        try:
            await asyncio.wait({waiting, killed}, return_when=asyncio.FIRST_COMPLETED)
            if killed.done():
                raise Interrupted
            return waiting.result()
        finally:
            for task in (waiting, killed):
                task.cancel()
            await asyncio.gather(waiting, killed, return_exceptions=True)

    # -------------------------------------------------------------------------------- faults
    def _maybe_inject(self, action: str) -> None:
        self._until_next -= 1
        if self._left <= 0 or self._until_next > 0:
            return
        kind = self._random.choice(KINDS)
        if kind.at and action not in kind.at:
            return  # at the next action
        self._until_next = self._random.randrange(4, 14)
        self._left -= 1
        self.result.faults[kind.name] += 1
        task = asyncio.create_task(self._inject(kind, self._random.choice((0.0, 0.02, 0.3, 0.8)), action))
        self._injecting.add(task)
        task.add_done_callback(self._injecting.discard)

    async def _inject(self, kind: Fault, delay: float, action: str) -> None:
        await asyncio.sleep(delay)
        self._say(f"{kind.name}, {delay} s after the start of {action}")
        if kind.kill:
            self._killed.set()
            self.result.kills += 1
            await self._cell.kill(kind.kill)
            return
        self._active.append(kind)
        await self._cell.apply(kind.cause)

    async def _cure(self, device: str = "") -> None:
        """Remove the causes of the faults of a device, or of all devices."""
        for fault in [one for one in self._active if device in ("", one.device)]:
            self._active.remove(fault)
            await self._cell.apply(fault.cure)

    # -------------------------------------------------------------------------------- operator
    async def _resolve(self, client: Client, held: HeldData) -> None:
        """Remove the cause, look at the cell, correct the books, acknowledge, and decide."""
        self.result.holds += 1
        still = await self._joints()
        self._tries[held.action_id] += 1
        tries = self._tries[held.action_id]
        self._say(f"  held at {held.action_name} ({held.kind}): {held.text}")
        device = self._devices.get(held.device, "")
        device = "io" if device in ("tower", "feeder") else device
        await self._cure(device if tries < 3 else "")
        # A person takes longer. Alarms are listed and drives notice the loss of their master within a second.
        await asyncio.sleep(0.3 if tries == 1 else 1.0)
        await self._confirm(client)
        choice, results = await self._choose(client, held, tries)
        await self._check_still(still, f"while held at {held.action_name}")
        deadline = time.monotonic() + DECIDED_WITHIN
        while not self._killed.is_set():
            await self._acknowledge(client, held)
            try:
                args = rpc.DecideHeldArgs(held.number, choice, confirmed=True, results=results)
                await client.call("DecideHeld", args)
            except RequestFailed as error:
                if "not held at this action" in str(error):
                    return  # the next event says why
                if time.monotonic() > deadline:
                    self._found_wrong(self.result.unresolved, f"{held.action_name}: {choice} is refused: {error}")
                    choice, results = HoldChoice.END, []
                    deadline += DECIDED_WITHIN
                await asyncio.sleep(0.2)
                await self._cure(device)
            else:
                self._say(f"    {choice} {results or ''}")
                return

    async def _acknowledge(self, client: Client, held: HeldData) -> None:
        """Acknowledge the alarms of the held device, and the stop of a robot, as the card of the hold offers."""
        listed = await client.call("ListAlarms", rpc.ListAlarmsArgs(AlarmFilter.RETAINED, object_id=held.device))
        codes: list[str | Unset] = [UNSET, *(alarm.code for alarm in listed.alarms)]
        for code in codes:
            with contextlib.suppress(RequestFailed):
                await client.call("AcknowledgeStop", rpc.AcknowledgeStopArgs(held.device, code), timeout=40.0)

    async def _choose(self, client: Client, held: HeldData, tries: int) -> tuple[HoldChoice, list[str]]:
        """Decide by what a person sees in the cell."""
        name, choices = held.action_name, held.choices
        boards = await self._boards()
        by_place = {board["place"]: board for board in boards}
        if name not in REPORTS and (await self._finished() or tries > TRIES):
            return HoldChoice.END, []
        retry = HoldChoice.RETRY if HoldChoice.RETRY in choices else HoldChoice.END
        if held.before:
            return retry, []
        if name in PICKS:
            if held.kind == "place_occupied" and "gripper" in by_place:  # by the board of an earlier program
                await self._take_out(client, by_place["gripper"]["code"])
            elif "gripper" in by_place:
                return await self._done(client, held, "gripper")
            return (retry if PICKS[name] in by_place else HoldChoice.END), []
        if name in PLACES:
            target = PLACES[name]
            if "gripper" not in by_place:
                return await self._done(client, held, target)
            if target in by_place and target in ("tester", "label"):
                await self._take_out(client, by_place[target]["code"])
            return retry, []
        if name == "label" and (board := by_place.get("label")) and board["label"] is not None:
            return (HoldChoice.RESULT, ['"by hand"']) if HoldChoice.RESULT in choices else (HoldChoice.SKIP, [])
        if name == "test" and "tester" not in by_place:
            return HoldChoice.END, []
        if name == "board_there" and not self._waiting(boards):
            return (HoldChoice.SKIP if self._parallel else HoldChoice.END), []  # no board comes any more
        if name in REPORTS and await self._is_reported(name, boards):
            return HoldChoice.SKIP, []
        return retry, []

    async def _is_reported(self, name: str, boards: list[dict[str, Any]]) -> bool:
        """Return whether the planning service has the result of the newest board in a box, or receives it soon."""
        await self._cure("erp")  # the sender of the held program delivers results that are stored
        await until(lambda: not self._cell.waiting_results(), "the results to be delivered", SILENT_AFTER)
        results = (await self._cell.command("erp", "truth"))["results"]
        boxed = [board for board in boards if board["place"] in ("good", "bad")]
        if name == "report_unread":
            unread = [board for board in boxed if "tester" not in [event["place"] for event in board["history"]]]
            return len(unread) == [result["serial"] for result in results].count("unread")
        newest = max(boxed, key=lambda board: board["history"][-1]["time"])
        return newest["code"] in {result["serial"] for result in results}

    async def _done(self, client: Client, held: HeldData, target: str) -> tuple[HoldChoice, list[str]]:
        """Return that the movement counts as done if the books agree, otherwise end the program."""
        (books,) = await client.get_parts()
        there = {books.name_of(part.place) for part in books.parts}
        # A part that was moved into a box has left the books.
        arrived = NAMES["gripper"] not in there if target in ("good", "bad") else NAMES[target] in there
        return (HoldChoice.SKIP if arrived and HoldChoice.SKIP in held.choices else HoldChoice.END), []

    async def _take_out(self, client: Client, code: str) -> None:
        """Take a board out of the cell, and tell the books."""
        await self._remove(code)
        for books in await client.get_parts():
            if found := [ConfirmedPart(part.number, "") for part in books.parts if part.serial == code]:
                await self._send_confirmation(client, books.scene_id, found)

    async def _send_confirmation(self, client: Client, scene_id: str, found: list[ConfirmedPart]) -> None:
        """Confirm parts. Actions of other branches may still run; the server refuses it until they have ended."""
        deadline = time.monotonic() + DECIDED_WITHIN
        while True:
            try:
                await client.confirm_parts(scene_id=scene_id, parts=found)
            except RequestFailed:
                if time.monotonic() > deadline:
                    raise
                await asyncio.sleep(0.2)
            else:
                return

    async def _remove(self, code: str) -> None:
        """Take a board out of the cell by hand; open the door of the tester for it."""
        try:
            await self._cell.command("world", "remove_board", code=code)
        except Arcor2Error:
            await self._cell.command("tester", "push_door", opening=True)
            await self._cell.command("world", "remove_board", code=code)

    async def _confirm(self, client: Client, *, every: bool = False) -> None:
        """Compare the books with the cell, and confirm where each part is. Boards on the table are taken out.

        every: also take out the boards that are in the way of a new start.
        """
        all_books = await client.get_parts()
        for board in await self._boards():
            if board["place"] == "lost":
                self._say(f"    on the table: {board['code']}: {[event['why'] for event in board['history'][-2:]]}")
            if board["place"] == "lost" or (every and board["place"] in ("gripper", "tester", "label")):
                await self._remove(board["code"])
        for books in all_books:
            boards = await self._boards()
            found = [one for part in books.parts if (one := self._found(part, books, boards)) is not None]
            if found or not isinstance(books.run, Unset):
                await self._send_confirmation(client, books.scene_id, found)
                self._say(f"    confirmed {[(one.number, one.place) for one in found]}")
        await self._check_books(client)

    def _found(self, part: Part, books: PartBooks, boards: list[dict[str, Any]]) -> ConfirmedPart | None:
        """Return where a part is, None if the books state it correctly."""
        board = self._board_of(part, books, boards)
        ids = {place.name: place.id for place in books.places}
        place = "" if board is None else ids.get(NAMES.get(board["place"], ""), "")
        if part.confirmed and isinstance(part.moving_to, Unset) and part.place == place:
            return None
        if board is not None and not part.serial and place in ("", ids["bad_boards"]):
            self._anonymous.add(board["code"])
        return ConfirmedPart(part.number, place, exists=board is not None)

    def _board_of(self, part: Part, books: PartBooks, boards: list[dict[str, Any]]) -> dict[str, Any] | None:
        """Return the board that a part of the books is."""
        if part.serial:
            return next(board for board in boards if board["code"] == part.serial)
        known = {one.serial for one in books.parts} | {code for place in books.places for code in place.parts}
        rest = [board for board in boards if board["code"] not in known | self._anonymous]
        moved = [board for board in rest if board["place"] not in ("stop", "belt", "feeder")]
        return next(iter(moved or [board for board in rest if board["place"] == "stop"]), None)

    # -------------------------------------------------------------------------------- checks
    def _found_wrong(self, problems: list[str], text: str) -> None:
        problems.append(text)
        self._say(f"WRONG: {text}")

    async def _check_books(self, client: Client) -> None:
        """Compare the counts of the books with the boards of the world."""
        boards = await self._boards()
        for books in await client.get_parts():
            truth = Counter(board["place"] for board in boards)
            known = sum(books.name_of(part.place) == "feeder" for part in books.parts)
            in_cell = truth["gripper"] + truth["tester"] + truth["label"] + known
            fed = in_cell + truth["good"] + truth["bad"] + truth["removed"]
            wanted = PartCounts(fed, truth["good"], truth["bad"], truth["removed"], in_cell)
            if books.counts != wanted or truth["lost"] or known > truth["stop"] + truth["belt"]:
                self._found_wrong(self.result.unaccounted, f"books {books.counts}, cell {wanted}, lost {truth['lost']}")

    async def _last_results(self) -> None:
        """Let the planning service receive the last results."""
        await self._cure()
        if not self._cell.waiting_results():
            return
        self._left = 0
        async with Client(self._cell.url, "operator", reconnect=False) as client:
            await self._confirm(client)
            await self._start(client)
            await until(lambda: not self._cell.waiting_results(), "the results to be delivered", SILENT_AFTER)

            async def stopped() -> bool:
                with contextlib.suppress(RequestFailed):  # while it starts
                    await client.call("StopPackage")
                    return True
                return False

            await until(stopped, "the program to be stopped", DECIDED_WITHIN)

    async def _check_results(self) -> None:
        """Compare the results that the planning service has received with the boards of the world."""
        results = (await self._cell.command("erp", "truth"))["results"]
        reported = Counter(result["serial"] for result in results)
        passed = {result["serial"]: result["passed"] for result in results}
        unread = 0
        for board in await self._boards():
            code, place = board["code"], board["place"]
            tested = "tester" in [event["place"] for event in board["history"]]
            boxed = place in ("good", "bad")
            unread += boxed and not tested
            text = f"{code} ({'good' if board['good'] else 'bad'}) in {place} was reported {reported[code]} times"
            if reported[code] != (boxed and tested):
                self._found_wrong(self.result.not_once, text)
            elif reported[code] and not passed[code] == board["good"] == (place == "good"):
                self._found_wrong(self.result.not_once, f"{text}, as {'good' if passed[code] else 'bad'}")
        if reported["unread"] != unread:
            text = f"{unread} boards were not read, {reported['unread']} were reported as such"
            self._found_wrong(self.result.not_once, text)


async def run(report: Report, folder: Path, long: bool) -> None:
    """Measure everything in this group."""
    seeds = range(1, (LONG_SEEDS if long else SEEDS) + 1)
    results = [await trial(folder / f"books-{seed}", seed, BOARDS, FAULTS) for seed in seeds]
    found = "; ".join(problem for result in results for problem in result.problems())
    n = len(results)
    report.add(Metric("books_unaccounted", sum(len(each.unaccounted) for each in results), n, found))
    report.add(Metric("books_results_not_once", sum(len(each.not_once) for each in results), n))
    report.add(Metric("books_moved_alone", sum(len(each.moved) for each in results), n))
    report.add(Metric("books_unresolved", sum(len(each.unresolved) for each in results), n))


async def trial(folder: Path, seed: int, boards: int, faults: int) -> Result:
    """Run one seed; its log is on standard error."""
    await asyncio.to_thread(folder.mkdir, parents=True)
    began = time.monotonic()

    def say(text: str) -> None:
        sys.stderr.write(f"{time.monotonic() - began:7.2f} {text}\n")

    return await Trial(folder, seed, boards, faults, say).run()
