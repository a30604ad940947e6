"""Three devices on three computers: the robot on the server's computer, the tester and the reader on one node each."""

import os
import signal
from collections.abc import AsyncIterator, Iterator
from pathlib import Path

import pytest

from arcor2_hw.client import Client
from arcor2_hw.data import rpc
from arcor2_hw.data.editor import RunEnd
from arcor2_hw.data.events import SceneStateEnum
from arcor2_hw.data.project import Project
from arcor2_hw.data.rpc import StopKind
from arcor2_hw.data.scene import Scene
from tests.e2e.harness import Cell, running_cell, scene_state
from tests.e2e.test_faults import assert_standstill, is_moving, is_stopped, program_error, until
from tests.server.nodes.conftest import Broker, Node

pytestmark = pytest.mark.xdist_group("nodes")

PRESS, OVEN = "press", "oven"


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[Broker]:
    running = Broker(tmp_path)
    yield running
    running.end()


@pytest.fixture
def nodes(broker: Broker, tmp_path: Path) -> Iterator[dict[str, Node]]:
    running = {name: Node(broker.url, tmp_path / name, name=name) for name in (PRESS, OVEN)}
    yield running
    for each in running.values():
        os.kill(each.process.pid, signal.SIGCONT)
        each.end()


@pytest.fixture
async def cell(
    broker: Broker, nodes: dict[str, Node], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> AsyncIterator[Cell]:
    monkeypatch.setenv("ARCOR2_HW_NATS_URL", broker.url)
    async with running_cell(tmp_path, boards=2, seed=4) as running:
        yield running


async def open_on_nodes(cell: Cell, client: Client) -> tuple[Scene, Project]:
    """Open the scene and the project; the tester runs on one node, the reader on the other."""
    scene, project = await cell.open(client, boards=1)
    for name, node in (("tester", PRESS), ("reader", OVEN)):
        (found,) = (each.id for each in scene.objects if each.name == name)
        await client.call("SetObjectNode", rpc.SetObjectNodeArgs(found, node))
    await client.call("SaveProject")
    return scene, project


async def test_a_scene_and_a_program_run_on_three_computers(cell: Cell, nodes: dict[str, Node]) -> None:
    client = await cell.client("technician")
    scene, project = await open_on_nodes(cell, client)
    robot, reader = (next(each.id for each in scene.objects if each.name == name) for name in ("robot", "reader"))

    await client.call("SetObjectNode", rpc.SetObjectNodeArgs(robot, PRESS))
    await client.call("StartScene", dry_run=True)
    await client.call("Undo")
    await client.call("StartScene")
    await scene_state(client, SceneStateEnum.STARTED)
    stopped = await client.call("StopAll")
    assert reader in {each.id for each in stopped.outcomes if each.kind is StopKind.DEVICE}
    await client.call("StopScene")
    await scene_state(client, SceneStateEnum.STOPPED)

    package = await cell.build(client, project)
    await client.call("RunPackage", rpc.RunPackageArgs(package))
    assert await program_error(client) == ""
    [run, *_] = (await client.call("ListRuns")).runs
    assert run.end is RunEnd.FINISHED

    await client.call("RunPackage", rpc.RunPackageArgs(package))
    await until(lambda: is_moving(cell), "the arm moves")
    os.kill(nodes[OVEN].process.pid, signal.SIGSTOP)
    assert f"the node {OVEN}" in await program_error(client)
    await until(lambda: is_stopped(cell), "the arm stops")
    os.kill(nodes[OVEN].process.pid, signal.SIGCONT)
    await assert_standstill(cell, 0.5)
