"""Starts the world of the cell: `python -m arcor2_fakes.cell`."""

from __future__ import annotations

import asyncio
import contextlib
import sys
import time
from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, Parameter, validators

from arcor2_fakes.cell.boards import MAX_BOARDS, Board, draw_boards
from arcor2_fakes.cell.devices import DeviceGone, Fake, FakeDevices, RobotFeed
from arcor2_fakes.cell.layout import Layout, LayoutError, read_layout
from arcor2_fakes.cell.world import World
from arcor2_fakes.control import ControlServer, parse_address
from arcor2_fakes.process import announce, run, until_told_to_end

GONE_STATUS = 3
_ROBOT_RATE = 100.0  # Hz; a tool at 1 m/s is known to a centimetre, a resting one exactly

app = App(name="arcor2_fakes.cell", help="The small world of boards that the fakes share.", version_flags=[])


def register_commands(control: ControlServer, world: World, lock: asyncio.Lock) -> None:
    """Make what a test can do to the world known to the control channel."""

    async def gripper(works: bool) -> None:
        async with lock:
            world.gripper_works = bool(works)

    async def drop() -> None:
        async with lock:
            await world.drop()

    async def sensor(stuck: bool | None) -> None:
        async with lock:
            await world.stick_sensor(stuck)

    async def remove_board(code: str) -> None:
        async with lock:
            await world.remove(code)

    control.command("gripper", gripper)
    control.command("drop", drop)
    control.command("sensor", sensor)
    control.command("remove_board", remove_board)
    control.source("truth", world.truth)


async def follow(world: World, feed: RobotFeed, lock: asyncio.Lock) -> str:
    """Let the world follow the robot; gives the reason when it can't any more."""
    began = time.monotonic()
    try:
        async with lock:
            await world.begin()
        while True:
            sample = await feed.next()
            async with lock:
                await world.step(time.monotonic() - began, sample)
    except DeviceGone as e:
        return str(e)


async def first_of(*waits: Any) -> Any:
    """Give the result of whichever ends first; the others are cancelled."""
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
    """Run the world until a fake has gone; gives a sentence that says which."""
    async with contextlib.AsyncExitStack() as stack:
        fakes: dict[str, Fake] = {}
        for name, address in addresses.items():
            fakes[name] = await Fake.connect(name, address, patience)
            stack.push_async_callback(fakes[name].client.close)
        devices = FakeDevices(fakes["robot"], fakes["tester"], fakes["reader"], layout.gripper.sensor)
        world, feed, lock = World(layout, boards, devices), RobotFeed(), asyncio.Lock()
        register_commands(control, world, lock)
        await fakes["robot"].client.subscribe(feed.take, rate=_ROBOT_RATE)
        await control.start()
        stack.push_async_callback(control.close)
        announce(name="cell", control=control.address, boards=len(boards))
        ended: str = await first_of(*(fake.gone() for fake in fakes.values()), follow(world, feed, lock))
        return ended


@app.default
def main(
    *,
    layout: Path,
    robot: str,
    tester: str,
    reader: str,
    boards: Annotated[int, Parameter(validator=validators.Number(gte=0, lte=MAX_BOARDS))] = 5,
    seed: int = 0,
    control: str = "127.0.0.1:0",
    patience: Annotated[float, Parameter(validator=validators.Number(gte=0))] = 30.0,
) -> int:
    """Start the world; it prints one line `ready {json}` with its address and ends on SIGTERM.

    Exit status: 0 told to end, 1 the control port is taken, 2 a wrong argument or layout, 3 a fake can't be reached or
    has gone.

    Args:
        layout: JSON file of the cell's places.
        robot: HOST:PORT of the fake robot controller's control channel.
        tester: HOST:PORT of the fake tester's control channel.
        reader: HOST:PORT of the fake reader's control channel.
        boards: how many boards lie in the feeder.
        seed: decides the boards: their codes, and which are bad.
        control: HOST:PORT of the world's own control channel; port 0 takes a free one.
        patience: how long to wait for each fake that isn't there yet, s.
    """
    addresses = {"robot": robot, "tester": tester, "reader": reader}
    try:
        channel = ControlServer(*parse_address(control))
        for address in addresses.values():
            parse_address(address)
        cell = read_layout(layout)
    except (LayoutError, ValueError) as e:
        return _say(str(e), 2)
    problem: str | None = None

    async def body() -> None:
        nonlocal problem
        try:
            drawn = draw_boards(boards, seed)
            problem = await first_of(until_told_to_end(), live(cell, drawn, addresses, channel, patience))
        except DeviceGone as e:
            problem = str(e)

    status = run(body, "cell")
    return status if problem is None else _say(problem, GONE_STATUS)


def _say(problem: str, status: int) -> int:
    sys.stderr.write(f"cell: {problem}\n")
    return status


if __name__ == "__main__":
    sys.exit(app())
