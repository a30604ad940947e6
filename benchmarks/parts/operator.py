"""The operator: sends only the requests of the operator's screen, and acts at the cell by hand."""

import asyncio
import contextlib
import time
from collections import Counter
from collections.abc import Callable
from typing import Any, Final

from msgspec import UNSET

from arcor2_hw.client import Client, RequestFailed
from arcor2_hw.data import rpc
from arcor2_hw.data.alarms import AlarmFilter
from arcor2_hw.data.base import Unset
from arcor2_hw.data.held import HeldData, HoldChoice
from arcor2_hw.data.parts import ConfirmedPart, Part, PartInventory
from arcor2_hw.exceptions import Arcor2Error
from benchmarks.parts.cell import Cell, waiting
from benchmarks.parts.checks import Checks
from benchmarks.parts.faults import Faults
from benchmarks.parts.places import NAMES, PICKS, PLACES, REPORTS
from tests.e2e.harness import until

DELIVERY_TIMEOUT: Final = 60.0
"""Time within which the planning service receives stored results, s."""
DECISION_TIMEOUT: Final = 40.0
"""Time within which a decision is accepted: a device reconnects, a controller restarts, s."""
TRIES: Final = 6
"""Attempts of one action after which the operator ends the program."""


class Operator:
    """Resolves each fault: removes its cause, corrects the inventory, acknowledges and decides."""

    def __init__(self, cell: Cell, faults: Faults, checks: Checks, say: Callable[[str], None]) -> None:
        self._cell, self._faults, self._checks, self._say = cell, faults, checks, say
        self.tries: Counter[int | str] = Counter()
        """Attempts by action."""
        self.devices: dict[str, str] = {}
        """Names of the devices by their ids."""
        self.parallel = False
        """Whether the program tests a board while it fetches the next one."""
        self._gone: set[str] = set()
        """Boards that have left the inventory by hand, or without a serial number."""

    async def resolve(self, client: Client, held: HeldData) -> None:
        """Remove the cause, inspect the cell, correct the inventory, acknowledge, and decide."""
        self._checks.result.holds += 1
        before = await self._cell.joints()
        self.tries[held.action_id] += 1
        tries = self.tries[held.action_id]
        self._say(f"  held at {held.action_name} ({held.kind}): {held.text}")
        device = self.devices.get(held.device, "")
        device = "io" if device in ("tower", "feeder") else device
        await self._faults.cure(device if tries < 3 else "")
        # A person takes longer. Alarms are listed and drives notice the loss of their master within a second.
        await asyncio.sleep(0.3 if tries == 1 else 1.0)
        await self.confirm(client)
        shown = (await client.call("GetHeld")).held
        if not isinstance(shown, Unset) and shown.since == held.since:
            held = shown  # with fewer choices after the confirmation
        choice, results = await self._choose(client, held, tries)
        await self._checks.check_no_motion(before, f"while held at {held.action_name}")
        deadline = time.monotonic() + DECISION_TIMEOUT
        while not self._faults.killed.is_set():
            await self._acknowledge(client, held)
            try:
                args = rpc.DecideHeldArgs(held.number, choice, confirmed=True, results=results)
                await client.call("DecideHeld", args)
            except RequestFailed as error:
                if "not held at this action" in str(error):
                    return  # the next event states the reason
                if time.monotonic() > deadline:
                    self._checks.found(
                        self._checks.result.unresolved, f"{held.action_name}: {choice} is refused: {error}"
                    )
                    choice, results = HoldChoice.END, []
                    deadline += DECISION_TIMEOUT
                await asyncio.sleep(0.2)
                await self._faults.cure(device)
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
        """Decide by the visible state of the cell."""
        name, choices = held.action_name, held.choices
        boards = await self._cell.boards()
        by_place = {board["place"]: board for board in boards}
        if name not in REPORTS and (await self._cell.finished() or tries > TRIES):
            return HoldChoice.END, []
        retry = HoldChoice.RETRY if HoldChoice.RETRY in choices else HoldChoice.END
        if held.before:
            return retry, []
        if name in PICKS:
            if held.kind == "place_occupied" and "gripper" in by_place:  # occupied by the board of an earlier program
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
        if name == "board_there" and not waiting(boards):
            return (HoldChoice.SKIP if self.parallel else HoldChoice.END), []  # no board comes any more
        if name in REPORTS and await self._is_reported(name, boards):
            return HoldChoice.SKIP, []
        return retry, []

    async def _is_reported(self, name: str, boards: list[dict[str, Any]]) -> bool:
        """Return whether the planning service has the result of the newest board in a box, or receives it soon."""
        await self._faults.cure("erp")  # the sender of the held program delivers results that are stored
        await until(lambda: not self._cell.waiting_results(), "the results to be delivered", DELIVERY_TIMEOUT)
        results = (await self._cell.command("erp", "truth"))["results"]
        boxed = [board for board in boards if board["place"] in ("good", "bad")]
        if name == "report_unread":
            unread = [board for board in boxed if "tester" not in [event["place"] for event in board["history"]]]
            return len(unread) == [result["serial"] for result in results].count("unread")
        newest = max(boxed, key=lambda board: board["history"][-1]["time"])
        return newest["code"] in {result["serial"] for result in results}

    async def _done(self, client: Client, held: HeldData, target: str) -> tuple[HoldChoice, list[str]]:
        """Return the decision that the movement is done if the inventory agrees, otherwise that the program ends."""
        (inventory,) = await client.get_parts()
        there = {inventory.name_of(part.place) for part in inventory.parts}
        # A part that was moved into a box is no longer tracked.
        arrived = NAMES["gripper"] not in there if target in ("good", "bad") else NAMES[target] in there
        return (HoldChoice.SKIP if arrived and HoldChoice.SKIP in held.choices else HoldChoice.END), []

    async def _take_out(self, client: Client, code: str) -> None:
        """Take a board out of the cell, and confirm that in the inventory."""
        await self._remove(code)
        self._gone.add(code)
        for inventory in await client.get_parts():
            if found := [ConfirmedPart(part.number, "") for part in inventory.parts if part.serial == code]:
                await self._send_confirmation(client, inventory.scene_id, found)

    async def _send_confirmation(self, client: Client, scene_id: str, found: list[ConfirmedPart]) -> None:
        """Confirm parts. Actions of other branches may still run; the server refuses it until they have ended."""
        deadline = time.monotonic() + DECISION_TIMEOUT
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

    async def confirm(self, client: Client, *, every: bool = False) -> None:
        """Compare the inventory with the cell, and confirm the place of each part. Boards on the table are taken out.

        every: also take out the boards that are in the way of a new start.
        """
        inventories = await client.get_parts()
        for board in await self._cell.boards():
            if board["place"] == "lost":
                self._say(f"    on the table: {board['code']}: {[event['why'] for event in board['history'][-2:]]}")
            if board["place"] == "lost" or (every and board["place"] in ("gripper", "tester", "label")):
                await self._remove(board["code"])
        for inventory in inventories:
            boards = await self._cell.boards()
            found = [one for part in inventory.parts if (one := self._found(part, inventory, boards)) is not None]
            if found or not isinstance(inventory.run, Unset):
                await self._send_confirmation(client, inventory.scene_id, found)
                self._say(f"    confirmed {[(one.number, one.place) for one in found]}")
        await self._checks.inventory(client)

    def _found(self, part: Part, inventory: PartInventory, boards: list[dict[str, Any]]) -> ConfirmedPart | None:
        """Return the place of a part, None if the inventory states it correctly."""
        board = self._board_of(part, inventory, boards)
        ids = {place.name: place.id for place in inventory.places}
        place = "" if board is None else ids.get(NAMES.get(board["place"], ""), "")
        if part.confirmed and isinstance(part.moving_to, Unset) and part.place == place:
            return None
        if board is not None and place in ("", ids["bad_boards"]):
            self._gone.add(board["code"])
        return ConfirmedPart(part.number, place, exists=board is not None)

    def _board_of(self, part: Part, inventory: PartInventory, boards: list[dict[str, Any]]) -> dict[str, Any] | None:
        """Return the board that corresponds to a part of the inventory."""
        if part.serial:
            return next(board for board in boards if board["code"] == part.serial)
        known = {one.serial for one in inventory.parts} | {code for place in inventory.places for code in place.parts}
        rest = [board for board in boards if board["code"] not in known | self._gone]
        moved = [board for board in rest if board["place"] not in ("stop", "belt", "feeder")]
        return next(iter(moved or [board for board in rest if board["place"] == "stop"]), None)
