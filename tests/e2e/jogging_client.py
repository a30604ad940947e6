"""A client that jogs a robot and renews its hold every 50 ms: `python -m tests.e2e.jogging_client URL ROBOT_ID`."""

import asyncio
import sys
import time

from arcor2_hw.client import Client, RequestFailed
from arcor2_hw.data.geometry import Position
from arcor2_hw.data.rpc import WriteLockArgs

VALID_MS = 200
PERIOD = 0.05


async def main(url: str, robot_id: str) -> None:
    """Lock the robot and jog it up. Print each answer after the monotonic time at which the request was sent, s."""
    async with Client(url, "jogger", reconnect=False) as client:
        await client.call("WriteLock", WriteLockArgs(robot_id))

        async def renew() -> None:
            sent = time.monotonic()
            try:
                await client.jog_robot(
                    robot_id=robot_id,
                    hold=1,
                    sent_ms=sent * 1e3,
                    valid_ms=VALID_MS,
                    linear=Position(0.0, 0.0, 0.1),
                )
                sys.stdout.write(f"{sent} granted\n")
            except RequestFailed as error:
                sys.stdout.write(f"{sent} refused {error}\n")
            sys.stdout.flush()

        async with asyncio.TaskGroup() as tasks:
            while True:
                tasks.create_task(renew())
                await asyncio.sleep(PERIOD)


if __name__ == "__main__":
    asyncio.run(main(*sys.argv[1:]))
