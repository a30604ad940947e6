"""The process: follows the updates of the server and publishes them."""

import asyncio
import logging
import time
from collections.abc import Sequence
from typing import Protocol

from arcor2_hw.mqtt import messages as m
from arcor2_hw.mqtt.cell import CellState, Changes
from arcor2_hw.mqtt.edge_node import EdgeNode
from arcor2_hw.mqtt.plain import PlainJson
from arcor2_hw.plant.messages import BEAT_PERIOD, STALE_AFTER
from arcor2_hw.plant.process import ServerLink, run_until_closed


class Publisher(Protocol):
    """A publisher of the cell in one format."""

    def changed(self, changes: Changes) -> None:
        """Follow a change of the cell."""

    async def run(self) -> None:
        """Publish until cancelled."""


def main(arguments: Sequence[str]) -> int:
    """Publish until the socket with the given file descriptor is closed."""
    logging.getLogger("mqtt").setLevel(logging.CRITICAL)  # lost connections are reported to the server
    return run_until_closed("arcor2_hw.mqtt", arguments, run)


async def run(descriptor: int) -> None:
    """Publish until the server closes the connection, then publish death certificates and disconnect.

    Raises:
        IncompleteReadError: it has closed the connection.
    """
    link = ServerLink(descriptor, m.decode_to_process)
    await link.open()
    setup: m.Setup = await link.read()
    cell = CellState()
    publishers: list[Publisher] = []
    if setup.sparkplug is not None:
        publishers.append(EdgeNode(setup, cell, link.send))
    if setup.prefix:
        publishers.append(PlainJson(setup, cell, link.send))
    heard = time.monotonic()

    def change(changes: Changes) -> None:
        for each in publishers:
            each.changed(changes)

    async def watch() -> None:
        """Mark values as stale if they are not renewed, also if the server does not answer."""
        while True:
            await asyncio.sleep(BEAT_PERIOD)
            changes = cell.expire(silent=time.monotonic() - heard > STALE_AFTER)
            if changes != Changes():
                change(changes)

    change(cell.apply(await link.read()))
    tasks = [asyncio.create_task(each.run()) for each in publishers]
    tasks.append(asyncio.create_task(watch()))
    try:
        while True:
            update = await link.read()
            heard = time.monotonic()
            change(cell.apply(update))
            for task in tasks:
                if task.done():
                    task.result()  # an internal error; the server restarts this process
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
