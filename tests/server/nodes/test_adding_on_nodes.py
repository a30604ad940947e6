"""Objects are added to an online scene on a computer where none of its objects runs yet."""

from collections.abc import AsyncIterator
from pathlib import Path

import pytest
import pytest_asyncio

from arcor2_hw.data.base import UNSET
from arcor2_hw.data.cell import Cell, CellDevice
from arcor2_hw.data.scene import Scene, SceneObject
from arcor2_hw.exceptions import Arcor2Error, SeveralNodes
from tests.server.cell.conftest import Server, robot_meta, running_server
from tests.server.cell.test_execution_history import subscribe
from tests.server.nodes.conftest import NODE, Broker, Node

pytestmark = pytest.mark.xdist_group("nodes")

CLOCK = """
class Clock(Generic):
    _ABSTRACT = False

    def stop(self):
        pass

    def pid(self) -> int:
        return os.getpid()
"""


async def add_object(server: Server, name: str, **more: str) -> str:
    """Add an object; return its id when it is online."""
    await server.ask("AddSceneObject", {"name": name, "type": "Clock", **more})
    state = await server.client.event("ObjectState", lambda data: data["state"] in ("online", "failed"))
    assert state["state"] == "online", state
    return str(state["object_id"])


@pytest_asyncio.fixture
async def server(broker: Broker, node: Node, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Server]:
    monkeypatch.setenv("ARCOR2_HW_NATS_URL", broker.url)
    async with running_server(tmp_path / "data") as running:
        subscribe(running, "ObjectState")
        running.types.add("Clock", CLOCK)
        running.types.add("Arm", CLOCK.replace("Clock", "Arm"), robot=robot_meta("Arm"))
        running.services.hosts._derives = running.types.derives_from
        yield running


async def test_a_host_is_started_where_an_added_object_runs(server: Server) -> None:
    """The first object and the program run on a node. The cell file assigns the nodes of later objects."""
    server.services.hosts._cell = Cell([CellDevice("away", "Clock", node="saw")])
    await server.open(Scene("scene", id="scn_1", objects=[SceneObject("first", "Clock", id="obj_1", node=NODE)]))
    await server.start()
    online = server.services.online

    added_ids = [await add_object(server, name) for name in ("second", "third")]
    pids = [await online.call(each, "pid", deadline=5.0) for each in ("obj_1", *added_ids)]
    assert pids[0] != pids[1] == pids[2]
    assert len(online.host.host.rings) == 2
    assert {each.object_id for each in await online.host.host.stop_all()} == {"obj_1", *added_ids}

    for name, kind, reason in (
        ("away", "Clock", r"The node saw is not connected\."),
        ("arm", "Arm", "Go offline, add arm, and go online again"),
    ):
        with pytest.raises(Arcor2Error, match=reason):
            await server.ask("AddSceneObject", {"name": name, "type": kind})
    assert len(server.services.session.require_scene().objects) == 3
    assert online.online
    await server.ask("StopScene")
    stopped = await server.client.state("stopped")
    assert "message" not in stopped


async def test_a_request_names_the_node_of_an_added_object(server: Server) -> None:
    """The first objects and the program run on the computer of the server."""
    await server.open(Scene("scene", id="scn_1"))
    for name, request in (("first", "AddObjectToScene"), ("arm", "AddSceneObject")):
        await server.ask(request, {"name": name, "type": "Arm" if name == "arm" else "Clock", "node": ""})
    assert [each.node for each in server.services.session.require_scene().objects] == [UNSET, UNSET]
    with pytest.raises(Arcor2Error, match=r"The node saw is not connected\."):
        await server.ask("CheckConnection", {"type": "Clock", "node": "saw"})
    await server.start()
    online = server.services.online
    hosts = online.host.host

    for name, kind, node, error, reason in (
        ("away", "Clock", "saw", Arcor2Error, r"The node saw is not connected\."),
        ("first", "Clock", NODE, Arcor2Error, "first"),
        ("second_arm", "Arm", NODE, SeveralNodes, r"on one computer: arm .*, second_arm \(node press\)\."),
    ):
        with pytest.raises(error, match=reason):
            await server.ask("AddSceneObject", {"name": name, "type": kind, "node": node})
    assert len(hosts.rings) == 1, "nothing was started"
    assert len(server.services.session.require_scene().objects) == 2

    remote = await add_object(server, "remote", node=NODE)
    assert server.services.session.document.scene_object(remote).node == NODE
    assert online.host.host is hosts
    assert len(hosts.rings) == 2
    assert await online.call(remote, "pid", deadline=5.0) != await online.call(
        server.services.session.require_scene().objects[0].id, "pid", deadline=5.0
    )
    assert (await server.ask("CheckConnection", {"type": "Clock", "node": NODE})).alarms == []
    await server.ask("StopScene")
    assert "message" not in await server.client.state("stopped")

    await server.ask("AddObjectToScene", {"name": "later", "type": "Clock", "node": "saw"})
    assert server.services.session.require_scene().objects[-1].node == "saw"
