"""The faults: their injection, and the removal of their causes by a person at the cell."""

import asyncio
import random
from collections.abc import Callable
from typing import Any, Final, NamedTuple

from benchmarks.parts.cell import Cell, FakeCommand
from benchmarks.parts.checks import Result
from benchmarks.parts.places import PICKS, PLACES, REPORTS


def do(fake: str, command: str, **arguments: Any) -> FakeCommand:
    """Return a command to a fake."""
    return FakeCommand(fake, command, {name: value for name, value in arguments.items() if value != ""})


class Fault(NamedTuple):
    """A fault: its injection, and the removal of its cause by a person at the cell.

    device: the affected device. kill: the processes that are killed: host or server. at: the actions at which it is
    injected; empty: any.
    """

    name: str
    device: str
    cause: tuple[FakeCommand, ...] = ()
    cure: tuple[FakeCommand, ...] = ()
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


class Faults:
    """Injects random faults while actions run, and removes their causes.

    Args:
        cell: the cell.
        random: the source of all decisions.
        number: number of injected faults.
        result: counts the faults.
        say: writes to the log.
    """

    def __init__(
        self, cell: Cell, random: random.Random, number: int, result: Result, say: Callable[[str], None]
    ) -> None:
        self._cell, self._random, self.left, self._result, self._say = cell, random, number, result, say
        self._active: list[Fault] = []
        self._until_next = random.randrange(3, 10)
        self._injecting: set[asyncio.Task[None]] = set()
        self.killed = asyncio.Event()
        """Set when a process was killed."""

    def maybe_inject(self, action: str) -> None:
        """Inject the next fault if it is due. action: name of the action that starts."""
        self._until_next -= 1
        if self.left <= 0 or self._until_next > 0:
            return
        kind = self._random.choice(KINDS)
        if kind.at and action not in kind.at:
            return  # at the next action
        self._until_next = self._random.randrange(4, 14)
        self.left -= 1
        self._result.faults[kind.name] += 1
        task = asyncio.create_task(self._inject(kind, self._random.choice((0.0, 0.02, 0.3, 0.8)), action))
        self._injecting.add(task)
        task.add_done_callback(self._injecting.discard)

    async def _inject(self, kind: Fault, delay: float, action: str) -> None:
        await asyncio.sleep(delay)
        self._say(f"{kind.name}, {delay} s after the start of {action}")
        if kind.kill:
            self.killed.set()
            self._result.kills += 1
            await self._cell.kill(kind.kill)
            return
        self._active.append(kind)
        await self._cell.apply(kind.cause)

    async def cure(self, device: str = "") -> None:
        """Remove the causes of the faults of a device, or of all devices."""
        for fault in [one for one in self._active if device in ("", one.device)]:
            self._active.remove(fault)
            await self._cell.apply(fault.cure)

    async def injected(self) -> None:
        """Wait until the present faults are injected."""
        await asyncio.gather(*self._injecting)

    def cancel(self) -> None:
        """Stop injecting faults."""
        for task in self._injecting:
            task.cancel()
