"""An OPC UA client that subscribes to all points: `python -m benchmarks.opcua_client URL COUNT`."""

import asyncio
import logging
import signal
import sys
from typing import Any

from asyncua import Client, Node, ua

logging.getLogger("asyncua").setLevel(logging.ERROR)


class Counter:
    """Counts notifications."""

    count = 0

    def datachange_notification(self, _node: Node, _value: Any, _data: Any) -> None:
        self.count += 1


async def points_below(node: Node) -> list[Node]:
    """Return the variables of all folders Points."""
    found = []
    for child in await node.get_children(nodeclassmask=ua.NodeClass.Object):
        if (await child.read_browse_name()).Name == "Points":
            found += await child.get_variables()
        elif (await child.read_browse_name()).NamespaceIndex:
            found += await points_below(child)
    return found


async def main(url: str, count: int) -> None:
    ended = asyncio.Event()
    asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, ended.set)
    async with Client(url, timeout=60.0) as client:
        counter = Counter()
        points: dict[str, Node] = {}
        while len(points) < count:
            points = {each.nodeid.to_string(): each for each in await points_below(client.nodes.objects)}
        subscription = await client.create_subscription(100, counter)
        await subscription.subscribe_data_change(list(points.values()))
        counter.count = 0
        print("subscribed", flush=True)
        await ended.wait()
        print(counter.count, flush=True)


asyncio.run(main(sys.argv[1], int(sys.argv[2])))
