"""The example docs/examples/tower_light_client.py with a real server and a simulated tower light."""

import asyncio
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from arcor2_hw.client import Client
from arcor2_hw.data.geometry import Position
from arcor2_hw.data.project import ActionParameter, Flow
from tests.client.test_client_on_server import RestartableServer
from tests.fakes.conftest import FakeProcess

EXAMPLE = Path(__file__).parents[2] / "docs" / "examples" / "tower_light_client.py"
RED, AMBER, GREEN = range(3)
WITHIN = 30.0
BREAKER = '''"""Fails."""

from arcor2_hw.actions import action
from arcor2_hw.objects import Generic


class Breaker(Generic):
    """Fail on request."""

    _ABSTRACT = False

    @action
    def fail(self, *, an: str | None = None) -> None:
        """Fail."""
        raise ValueError("broken")
'''


@pytest.fixture
def block() -> Iterator[FakeProcess]:
    fake = FakeProcess("remote_io", "--control", "127.0.0.1:0")
    yield fake
    fake.end()


class Lamps:
    """The lamps of the simulated block."""

    def __init__(self, block: FakeProcess) -> None:
        self.block = block

    async def wait_for(self, lamp: int | None, blinking: bool = False) -> None:
        """Wait until exactly one lamp is lit or blinks."""
        async with asyncio.timeout(WITHIN):
            while not await asyncio.to_thread(self._is_shown, lamp, blinking):
                await asyncio.sleep(0.05)

    def _is_shown(self, lamp: int | None, blinking: bool) -> bool:
        """Return whether the lamps are in this state. The last changes of a lamp show that it blinks."""
        truth: dict[str, Any] = self.block.truth()
        lit = {number for number in range(3) if truth["outputs"][number]}
        changes = [entry for entry in truth["history"] if entry["output"] < 3][-3:]
        if blinking:
            # On, off, on: half a second apart, of one lamp.
            alone = len(changes) == 3 and {entry["output"] for entry in changes} == {lamp}
            return alone and lit <= {lamp} and changes[-1]["time"] - changes[0]["time"] < 2.5
        return lit == (set() if lamp is None else {lamp})


async def test_the_tower_light_example_shows_the_state_of_the_server(tmp_path: Path, block: FakeProcess) -> None:
    lamps = Lamps(block)
    host, _, port = block.ready["modbus"].rpartition(":")
    server = RestartableServer(tmp_path / "data")
    url = await server.start()
    process = subprocess.Popen([sys.executable, str(EXAMPLE), host, "--port", port, "--url", url])
    try:
        async with Client(url, "ann") as client:
            await client.rest.put_object_type("Breaker", BREAKER)
            await client.new_scene("bench")
            await client.add_object_to_scene(name="time", type="TimeActions")
            await client.add_object_to_scene(name="breaker", type="Breaker")
            await client.save_scene()
            scene = await client.get_scene((await client.list_scenes())[0].id)
            ids = {obj.name: obj.id for obj in scene.objects}
            await client.start_scene()
            await lamps.wait_for(GREEN, blinking=True)
            await client.stop_scene()
            await lamps.wait_for(None)
            await client.new_project(scene_id=scene.id, name="wait and break")
            await client.add_action_point(name="here", position=Position(0.0, 0.0, 0.0))
            point = (await client.next_event("ActionPointChanged")).data.id
            last = "START"
            for name, of, parameters in (
                ("wait", "time/sleep", [ActionParameter("seconds", "double", "2.0")]),
                ("fail", "breaker/fail", []),
            ):
                thing, _, method = of.partition("/")
                await client.add_action(
                    action_point_id=point,
                    name=name,
                    type=f"{ids[thing]}/{method}",
                    parameters=parameters,
                    flows=[Flow()],
                )
                added = (await client.next_event("ActionChanged")).data.id
                await client.add_logic_item(start=last, end=added)
                last = added
            await client.add_logic_item(start=last, end="END")
            await client.save_project()
            project = (await client.list_projects())[0].id
            package = (await client.build_project(project_id=project, package_name="wait")).package_id
            await client.close_project()
            await client.run_package(package, start_paused=True)
            await lamps.wait_for(AMBER)
            await client.resume_package()
            await lamps.wait_for(GREEN)
            await lamps.wait_for(RED, blinking=True)
            # The lamp stays red after the program has ended, until another program starts.
            await client.run_package(package, start_paused=True)
            await lamps.wait_for(AMBER)
            await client.stop_package()
            await lamps.wait_for(None)
        await server.end()
        await lamps.wait_for(AMBER, blinking=True)
        await server.start()
        await lamps.wait_for(None)
        # The killed client cannot switch the lamps; the block's own watchdog does.
        process.kill()
        await lamps.wait_for(RED)
    finally:
        process.kill()
        process.wait(60)
        await server.end(signal.SIGTERM)
