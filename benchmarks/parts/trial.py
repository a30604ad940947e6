"""One seed: random faults until all boards have left the belt."""

import asyncio
import contextlib
import random
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from arcor2_hw.client import Client, RequestFailed
from arcor2_hw.data import rpc
from arcor2_hw.data.base import Unset
from arcor2_hw.data.held import HeldData, OnError
from arcor2_hw.data.package import PackageStateEnum
from arcor2_hw.exceptions import Arcor2Error
from benchmarks.parts.cell import Cell, waiting
from benchmarks.parts.checks import Checks, Result
from benchmarks.parts.faults import Faults
from benchmarks.parts.operator import DECISION_TIMEOUT, DELIVERY_TIMEOUT, Operator
from tests.e2e.harness import until

SILENT_AFTER: Final = 60.0
"""Time without any event after which a program counts as stuck, s."""


class Interrupted(Exception):
    """The test has killed a process."""


class Trial:
    """Starts the program repeatedly, and follows it."""

    def __init__(self, folder: Path, seed: int, boards: int, faults: int, say: Callable[[str], None]) -> None:
        self._cell = Cell(folder, boards, seed)
        self._say = say
        self._checks = Checks(self._cell, Result(boards), say)
        self._faults = Faults(self._cell, random.Random(seed), faults, self._checks.result, say)
        self._operator = Operator(self._cell, self._faults, self._checks, say)
        self._max_starts = 10 + 2 * faults

    async def run(self) -> Result:
        """Run the cell until every board is in a box, or was taken out."""
        result = self._checks.result
        await self._cell.start()
        try:
            while not await self._cell.finished():
                await self._run_program()
                if result.starts > self._max_starts:
                    raise RuntimeError(f"The program was started {result.starts} times: the cell makes no progress.")
            await self._last_results()
            await self._checks.results()
        finally:
            self._faults.cancel()
            await self._cell.stop()
        return result

    async def _run_program(self) -> None:
        """Start the program like an operator, and follow it until it has ended or was interrupted."""
        cell = self._cell
        self._faults.killed.clear()
        async with Client(cell.url, "operator", reconnect=False) as client:
            await client.subscribe_events({"ProgramPosition", "Held"})
            await self._faults.cure()
            interrupted = any(not isinstance(inventory.run, Unset) for inventory in await client.get_parts())
            await self._operator.confirm(client, every=not interrupted and not waiting(await cell.boards()))
            await self._start(client)
            self._checks.result.starts += 1
            try:
                await self._follow(client)
            except (Interrupted, Arcor2Error):
                if not self._faults.killed.is_set():
                    raise
                self._say("  interrupted")
        if self._faults.killed.is_set():
            await self._faults.injected()
            before = await cell.joints()
            await asyncio.sleep(0.3)
            await self._checks.check_no_motion(before, "after an interruption")

    async def _start(self, client: Client) -> None:
        deadline = time.monotonic() + DECISION_TIMEOUT
        while True:
            try:
                runs = [inventory.run for inventory in await client.get_parts()]
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
        since = ""
        while True:
            event = await self._next(client)
            match event.event:
                case "PackageInfo":
                    names = {action.id: action.name for action in event.data.project.all_actions()}
                    self._operator.devices = {one.id: one.name for one in event.data.scene.objects}
                case "ActionStateBefore":
                    name = names.get(event.data.action_id, "")
                    if name == "show_unread":
                        await self._faults.cure("reader")
                    if name == "order":
                        self._operator.tries.clear()
                    if name in ("order", "take_out", "test_and_fetch"):
                        self._operator.parallel = name == "test_and_fetch"
                    self._faults.maybe_inject(name)
                    if name == "order" and await self._cell.finished():
                        await client.call("StopPackage")
                case "Held" if event.data.since != since:  # a new hold, not only changed choices
                    held, since = event.data, event.data.since
                case "PackageState" if event.data.state is PackageStateEnum.PAUSED and held is not None:
                    # The actions of other branches have ended.
                    await self._operator.resolve(client, held)
                    held = None
                case "ProjectException":
                    self._say(f"  ended: {event.data.message}")
                case "PackageState" if event.data.state is PackageStateEnum.STOPPED:
                    return

    async def _next(self, client: Client) -> Any:
        waiting = asyncio.ensure_future(client.next_event(timeout=SILENT_AFTER))
        killed = asyncio.ensure_future(self._faults.killed.wait())
        try:
            await asyncio.wait({waiting, killed}, return_when=asyncio.FIRST_COMPLETED)
            if killed.done():
                raise Interrupted
            return waiting.result()
        finally:
            for task in (waiting, killed):
                task.cancel()
            await asyncio.gather(waiting, killed, return_exceptions=True)

    async def _last_results(self) -> None:
        """Let the planning service receive the last results."""
        await self._faults.cure()
        if not self._cell.waiting_results():
            return
        self._faults.left = 0
        async with Client(self._cell.url, "operator", reconnect=False) as client:
            await self._operator.confirm(client)
            await self._start(client)
            await until(lambda: not self._cell.waiting_results(), "the results to be delivered", DELIVERY_TIMEOUT)

            async def stopped() -> bool:
                with contextlib.suppress(RequestFailed):  # while it starts
                    await client.call("StopPackage")
                    return True
                return False

            await until(stopped, "the program to be stopped", DECISION_TIMEOUT)
