"""Light cells for the benchmark of the fleet and its pictures: each cell has its own connection, like a real cell.

`python -m benchmarks.fleet_cells URL COUNT [ADDRESS]` publishes the states of COUNT cells. Commands are lines on
standard input: `change N` counts one more good unit at cell N, `die N` ends its connection without a farewell.
"""

import asyncio
import random
import sys
from datetime import UTC, datetime, timedelta
from typing import Any, Final

import nats
from msgspec.structs import replace

from arcor2_hw.data.alarms import Priority
from arcor2_hw.data.cell_state import CellAuthority, CellStateName
from arcor2_hw.data.package import PackageStateEnum
from arcor2_server.fleet.records import BEAT_PERIOD, FirstAlarm, FleetState, encode, state_subject
from tests.server.fleet.cells import state_of

CYCLE: Final = 7.0
"""Mean time in which a cell finishes a unit, s."""
KINDS: Final = ("press", "lathe", "pack", "test", "weld")
PROGRAMS: Final = ("Sort boards", "Load the press", "Pack and label", "Test and laser", "Weld frames")


def name_of(number: int) -> str:
    """Return the name of a cell."""
    return f"{KINDS[number % len(KINDS)]}-{number // len(KINDS) + 1:02}"


def situation(number: int) -> dict[str, Any]:
    """Return the situation of a cell: most run; some wait, are disturbed, or need attention."""
    program = PROGRAMS[number % len(PROGRAMS)]
    since = (datetime.now(UTC) - timedelta(minutes=number + 1)).isoformat()
    running = {"state": CellStateName.EXECUTE, "program_state": PackageStateEnum.RUNNING, "program": program}
    match number:
        case 3:
            alarm = FirstAlarm(Priority.HIGH, "The gripper did not close: no part was found.", since, "Gripper 2")
            return running | {"held": True, "high": 1, "first_alarm": alarm, "started_by": "Eva"}
        case 17:
            alarm = FirstAlarm(Priority.URGENT, "Protective stop: joint 3 exceeded its torque limit.", since, "UR5e")
            return {"state": CellStateName.ABORTED, "program": program, "urgent": 1, "low": 2, "first_alarm": alarm}
        case 8:
            alarm = FirstAlarm(Priority.MEDIUM, "The label roll is nearly empty.", since, "Label printer")
            return running | {"medium": 1, "first_alarm": alarm, "recipe": "PCB-7 3"}
        case 22:
            return running | {"missing": ("Camera above the conveyor",)}
        case 30 | 31:
            return running | {"authority": CellAuthority.PLC}
        case 40 | 41 | 42 | 43:
            return {"program": program}
        case 44:
            return {"users": ("Petr",), "controlling": ("Petr",)}
        case _:
            return running | {"started_by": ("Eva", "Jana", "Tomáš")[number % 3]}


class Cell:
    """One cell."""

    def __init__(self, number: int, address: str) -> None:
        self.name = name_of(number)
        good = random.Random(number).randrange(200, 1500)
        self.state: FleetState = replace(
            state_of(f"{number:032x}", f"{number + 1000:032x}"),
            **situation(number),
            good=good,
            bad=good // 90,
            address=address and f"{address}/{self.name}",
        )
        self.connected = asyncio.Event()
        self.changed = asyncio.Event()

    async def run(self, url: str) -> None:
        """Publish until the task is cancelled."""
        client = await nats.connect(url, allow_reconnect=False)
        self.connected.set()
        loop = asyncio.get_running_loop()
        finish = loop.time() + random.expovariate(1 / CYCLE)
        for number in range(1, 1 << 62):
            if self.state.state is CellStateName.EXECUTE and loop.time() > finish:
                self.state = replace(self.state, good=self.state.good + 1)
                finish = loop.time() + random.expovariate(1 / CYCLE)
            await client.publish(state_subject(self.name), encode(replace(self.state, number=number)))
            await client.flush()
            try:
                async with asyncio.timeout(BEAT_PERIOD):
                    await self.changed.wait()
            except TimeoutError:
                continue
            self.changed.clear()


async def _main(url: str, count: int, address: str) -> None:
    cells = [Cell(number, address) for number in range(count)]
    tasks = [asyncio.create_task(cell.run(url)) for cell in cells]
    for cell in cells:
        await cell.connected.wait()
    reader = asyncio.StreamReader()
    loop = asyncio.get_running_loop()
    await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), sys.stdin)
    print("ready", flush=True)
    while line := await reader.readline():
        command, number = line.decode().split()
        cell = cells[int(number)]
        if command == "change":
            cell.state = replace(cell.state, good=cell.state.good + 1)
            cell.changed.set()
        else:
            tasks[int(number)].cancel()
    for task in tasks:
        task.cancel()


if __name__ == "__main__":
    asyncio.run(_main(sys.argv[1], int(sys.argv[2]), sys.argv[3] if len(sys.argv) > 3 else ""))
