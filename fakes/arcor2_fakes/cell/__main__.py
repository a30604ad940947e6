"""Start the simulated cell: `python -m arcor2_fakes.cell`."""

from __future__ import annotations

import asyncio
import contextlib
import sys
import time
from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, Parameter, validators
from cyclopts.types import NonNegativeFloat

from arcor2_fakes.cell.boards import MAX_BOARDS, Board, draw_boards
from arcor2_fakes.cell.devices import DeviceFeed, DeviceUnreachable, Fake, FakeDevices, RobotFeed
from arcor2_fakes.cell.layout import Layout, LayoutError, read_layout
from arcor2_fakes.cell.world import World
from arcor2_fakes.control import ControlServer, parse_address
from arcor2_fakes.process import announce, run, wait_for_end

GONE_STATUS = 3
_PICTURE_PERIOD = 0.1  # s; the camera renders a new image when something has moved
NAMES = {"io": "I/O block", "printer": "label printer", "arm": "two-axis robot"}
_ROBOT_RATE = 100.0  # Hz; error of the position: 1 cm at 1 m/s

app = App(name="arcor2_fakes.cell", help="The small world of boards that the fakes share.", version_flags=[])


class Cell:
    """The world and its devices; `renew` replaces the world."""

    def __init__(self, layout: Layout, boards: list[Board], fakes: dict[str, Fake]) -> None:
        self._layout = layout
        self._devices = FakeDevices(fakes, layout.gripper.sensor)
        self._robot, self._others = RobotFeed(), DeviceFeed(layout)
        self._fakes = fakes
        self._lock = asyncio.Lock()
        self.world = World(layout, boards, self._devices)

    def register(self, control: ControlServer) -> None:
        """Register the commands of the control channel."""

        async def gripper(works: bool) -> None:
            async with self._lock:
                self.world.gripper_works = bool(works)

        async def drop() -> None:
            async with self._lock:
                await self.world.drop()

        async def sensor(stuck: bool | None) -> None:
            async with self._lock:
                await self.world.stick_sensor(stuck)

        async def barrier(number: int, stuck: bool | None) -> None:
            async with self._lock:
                await self.world.stick_barrier(number, stuck)

        async def remove_board(code: str) -> None:
            async with self._lock:
                await self.world.remove(code)

        async def renew(boards: int, seed: int) -> None:
            """Replace all boards, and end the simulated faults of sensors."""
            if not 0 <= boards <= MAX_BOARDS:
                raise ValueError(f"boards must be 0 to {MAX_BOARDS}")
            drawn = draw_boards(boards, seed)
            async with self._lock:
                if (refused := await self.world.clear_tester()) is not None:
                    raise ValueError(refused)
                self.world = World(self._layout, drawn, self._devices)
                await self.world.begin()

        for command in (gripper, drop, sensor, barrier, remove_board, renew):
            control.command(command.__name__, command)
        control.source("truth", lambda: self.world.truth())

    async def follow(self) -> str:
        """Update the world from the devices. Return the reason if that fails."""
        began = time.monotonic()
        try:
            await self._fakes["robot"].client.subscribe(self._robot.take, rate=_ROBOT_RATE)
            await self._others.follow(self._fakes)
            async with self._lock:
                await self._devices.aim(self._layout)
                await self.world.begin()
            shown = -_PICTURE_PERIOD
            while True:
                sample = await self._robot.next()
                self._others.check()
                now = time.monotonic() - began
                async with self._lock:
                    await self.world.step(now, sample, self._others.inputs)
                    if now - shown >= _PICTURE_PERIOD:
                        shown = now
                        await self._devices.show(self.world.seen())
        except DeviceUnreachable as e:
            return str(e)


async def first_of(*waits: Any) -> Any:
    """Return the result of the awaitable that ends first, and cancel the others."""
    tasks = [asyncio.ensure_future(wait) for wait in waits]
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        return next(task for task in tasks if task in done).result()
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def live(
    layout: Layout, boards: list[Board], addresses: dict[str, str], control: ControlServer, patience: float
) -> str:
    """Run the world until a fake ends. Return a sentence that names this fake."""
    async with contextlib.AsyncExitStack() as stack:
        fakes: dict[str, Fake] = {}
        for name, address in addresses.items():
            fakes[name] = await Fake.connect(NAMES.get(name, name), address, patience)
            stack.push_async_callback(fakes[name].client.close)
        cell = Cell(layout, boards, fakes)
        cell.register(control)
        await control.start()
        stack.push_async_callback(control.close)
        announce(name="cell", control=control.address, boards=len(boards))
        ended: str = await first_of(*(fake.gone() for fake in fakes.values()), cell.follow())
        return ended


@app.default
def main(
    *,
    layout: Path,
    robot: str,
    tester: str,
    reader: str,
    conveyor: str | None = None,
    io: str | None = None,
    printer: str | None = None,
    arm: str | None = None,
    camera: str | None = None,
    boards: Annotated[int, Parameter(validator=validators.Number(gte=0, lte=MAX_BOARDS))] = 5,
    seed: int = 0,
    control: str = "127.0.0.1:0",
    patience: NonNegativeFloat = 30.0,
) -> int:
    """Start the cell; it prints one line `ready {json}` with its address and ends on SIGTERM.

    Exit status: 0 on SIGTERM, 1 if the control port is in use, 2 for a wrong argument or layout, 3 if a fake cannot be
    reached or has ended.

    Args:
        layout: JSON file with the layout of the cell.
        robot: HOST:PORT of the fake robot controller's control channel.
        tester: HOST:PORT of the fake tester's control channel.
        reader: HOST:PORT of the fake reader's control channel.
        conveyor: HOST:PORT of the fake conveyor's control channel, if the layout has a belt.
        io: HOST:PORT of the fake remote I/O block's control channel, if it has light barriers or a tower light.
        printer: HOST:PORT of the fake label printer's control channel, if it has a place for labelling.
        arm: HOST:PORT of the fake two-axis robot's control channel, if it has a place for labelling.
        camera: HOST:PORT of the fake camera's control channel, if it has one.
        boards: number of boards.
        seed: seed of the boards: their codes and defects.
        control: HOST:PORT of the control channel of the cell; port 0 takes a free one.
        patience: time to wait for each fake to start, s.
    """
    given = {
        **{"robot": robot, "tester": tester, "reader": reader},
        **{"conveyor": conveyor, "io": io, "printer": printer, "arm": arm},
        **{"camera": camera},
    }
    addresses = {name: address for name, address in given.items() if address is not None}
    try:
        channel = ControlServer(*parse_address(control))
        for address in addresses.values():
            parse_address(address)
        cell = read_layout(layout)
        if missing := [name for name in cell.needs() if name not in addresses]:
            raise LayoutError(f"layout {layout} needs --{missing[0]}")
    except (LayoutError, ValueError) as e:
        return _say(str(e), 2)
    problem: str | None = None

    async def body() -> None:
        nonlocal problem
        try:
            drawn = draw_boards(boards, seed)
            problem = await first_of(wait_for_end(), live(cell, drawn, addresses, channel, patience))
        except DeviceUnreachable as e:
            problem = str(e)

    status = run(body, "cell")
    return status if problem is None else _say(problem, GONE_STATUS)


def _say(problem: str, status: int) -> int:
    sys.stderr.write(f"cell: {problem}\n")
    return status


if __name__ == "__main__":
    sys.exit(app())
