"""Findings for a seed: the inventory, the results and the motion compared with the truth."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from arcor2_hw.client import Client
from arcor2_hw.data.parts import PartCounts
from benchmarks.parts.cell import Cell


@dataclass
class Result:
    """Findings for a seed. Each entry of the lists is a sentence."""

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


class Checks:
    """Compares the data of the server with the simulated world and the simulated planning service."""

    def __init__(self, cell: Cell, result: Result, say: Callable[[str], None]) -> None:
        self._cell, self.result, self._say = cell, result, say

    async def check_no_motion(self, before: Any, when: str) -> None:
        """Record a problem if anything has moved without a command of a person."""
        if (after := await self._cell.joints()) != before:
            self.found(self.result.moved, f"moved {when}: {before} -> {after}")

    def found(self, problems: list[str], text: str) -> None:
        """Add a problem to a list of the result."""
        problems.append(text)
        self._say(f"WRONG: {text}")

    async def inventory(self, client: Client) -> None:
        """Compare the counts of the inventory with the boards of the world."""
        boards = await self._cell.boards()
        for inventory in await client.get_parts():
            truth = Counter(board["place"] for board in boards)
            known = sum(inventory.name_of(part.place) == "feeder" for part in inventory.parts)
            in_cell = truth["gripper"] + truth["tester"] + truth["label"] + known
            fed = in_cell + truth["good"] + truth["bad"] + truth["removed"]
            wanted = PartCounts(fed, truth["good"], truth["bad"], truth["removed"], in_cell)
            if inventory.counts != wanted or truth["lost"] or known > truth["stop"] + truth["belt"]:
                self.found(
                    self.result.unaccounted, f"inventory {inventory.counts}, cell {wanted}, lost {truth['lost']}"
                )

    async def results(self) -> None:
        """Compare the results that the planning service has received with the boards of the world."""
        results = (await self._cell.command("erp", "truth"))["results"]
        reported = Counter(result["serial"] for result in results)
        passed = {result["serial"]: result["passed"] for result in results}
        unread = 0
        for board in await self._cell.boards():
            code, place = board["code"], board["place"]
            tested = "tester" in [event["place"] for event in board["history"]]
            boxed = place in ("good", "bad")
            unread += boxed and not tested
            text = f"{code} ({'good' if board['good'] else 'bad'}) in {place} was reported {reported[code]} times"
            if reported[code] != (boxed and tested):
                self.found(self.result.not_once, text)
            elif reported[code] and not passed[code] == board["good"] == (place == "good"):
                self.found(self.result.not_once, f"{text}, as {'good' if passed[code] else 'bad'}")
        if reported["unread"] != unread:
            text = f"{unread} boards were not read, {reported['unread']} were reported as such"
            self.found(self.result.not_once, text)
