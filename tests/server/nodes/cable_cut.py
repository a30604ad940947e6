"""Cut the cable between a server and a node while a device moves; print what happens as JSON.

Runs at the hub of a `Cable`: `python -m tests.server.nodes.cable_cut FOLDER CUT HEAL AT_NODE`, each argument a JSON
list of words.
"""

import asyncio
import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

import msgspec

from arcor2_hw.exceptions import Arcor2Error, OutcomeUnknown
from arcor2_hw.runtime import messages as m
from arcor2_server.hosts.process import CellHost
from tests.runtime.conftest import open_scene, scene_object, type_code
from tests.server.nodes.cable import HUB, run
from tests.server.nodes.conftest import NODE, PATIENCE, Broker, Listener, Node, tls_configuration
from tests.waiting import wait_for

MOVER = type_code(
    "Mover",
    """
    class Mover(Generic):
        _ABSTRACT = False
        moving = False

        def move(self, file: str) -> None:
            self.file, self.moving = file, True
            Path(file).touch()
            while self.moving:
                time.sleep(0.001)

        def stop(self) -> None:
            if self.moving:
                self.moving = False
                Path(self.file + ".part").write_text(str(time.monotonic()))
                os.rename(self.file + ".part", self.file + ".stopped")
""",
)


async def start(url: str) -> tuple[CellHost, Listener]:
    host = await CellHost.start(os.environ | {"ARCOR2_HW_NATS_URL": url}, NODE)
    listener = Listener()
    host.user = listener
    await asyncio.wait_for(asyncio.shield(host.ready), PATIENCE)
    host.send(open_scene([MOVER], scene_object("arm", "Mover")))
    await host.expect(m.SceneOpened, PATIENCE)
    return host, listener


def move(host: CellHost, file: Path) -> "asyncio.Task[bytes]":
    return asyncio.create_task(host.call("obj_arm", "move", {"file": msgspec.json.encode(str(file))}, control=True))


async def wait(read: Callable[[], object]) -> None:
    await asyncio.to_thread(wait_for, read)


async def main(folder: Path, cut: list[str], heal: list[str], at_node: list[str]) -> dict[str, object]:
    config, authority = tls_configuration(folder, HUB)
    os.environ["ARCOR2_HW_NATS_CA"] = str(authority)
    broker = Broker(folder, HUB, ("--config", str(config)))
    url = f"tls://{HUB}:{broker.url.rpartition(':')[2]}"
    node = Node(url, folder, wrapper=tuple(at_node))
    try:
        host, listener = await start(url)
        moving = move(host, folder / "first")
        await wait((folder / "first").exists)
        await asyncio.to_thread(run, *cut)
        moment = time.monotonic()
        late = move(host, folder / "late")
        await wait((folder / "first.stopped").exists)
        outcomes = [type(each) for each in await asyncio.gather(moving, late, return_exceptions=True)]
        stopped, named = float((folder / "first.stopped").read_text()) - moment, listener.ended_at - moment
        await asyncio.to_thread(run, *heal)
        again = None
        while again is None:  # the node connects again by itself
            try:
                again, _ = await start(url)
            except Arcor2Error:
                await asyncio.sleep(0.1)
        second = move(again, folder / "second")
        await wait((folder / "second").exists)
        await again.stop_motion("obj_arm")
        await asyncio.gather(second, return_exceptions=True)
        await asyncio.gather(host.close(), again.close())
        return {
            "stopped": stopped,
            "named": named,
            "reasons": listener.reasons,
            "unknown": outcomes == [OutcomeUnknown, OutcomeUnknown],
            "late": (folder / "late").exists(),
        }
    finally:
        node.end()
        broker.end()


if __name__ == "__main__":
    words = [json.loads(each) for each in sys.argv[2:]]
    sys.stdout.write(json.dumps(asyncio.run(main(Path(sys.argv[1]), *words))))
