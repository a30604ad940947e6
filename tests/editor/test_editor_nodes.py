"""Nodes: a user sees which computers can be used, and selects the one on which a device runs."""

from collections.abc import AsyncIterator, Iterator
from pathlib import Path

import pytest
import pytest_asyncio
from playwright.async_api import Browser, expect

from arcor2_hw.client.errors import RequestFailed
from arcor2_hw.data import rpc
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.parameter import Parameter
from tests.e2e.harness import Cell
from tests.editor import texts
from tests.editor.screen import screen_of
from tests.server.nodes.conftest import Broker, Node

pytestmark = pytest.mark.asyncio(loop_scope="session")

ROBOT = [Parameter("host", "string", '"127.0.0.1"')]


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[Broker]:
    running = Broker(tmp_path)
    yield running
    running.end()


@pytest.fixture
def node(broker: Broker, tmp_path: Path) -> Iterator[Node]:
    running = Node(broker.url, tmp_path)
    yield running
    running.end()


@pytest_asyncio.fixture(loop_scope="session")
async def served(
    broker: Broker, tmp_path: Path, built_editor: Path, monkeypatch: pytest.MonkeyPatch
) -> AsyncIterator[Cell]:
    """A separate server with a broker and without devices."""
    monkeypatch.setenv("ARCOR2_HW_NATS_URL", broker.url)
    cell = Cell(tmp_path)
    await cell.start_server()
    yield cell
    await cell.stop()


async def test_a_device_runs_on_a_selected_node_and_the_lost_node_is_shown(
    node: Node, served: Cell, browser: Browser
) -> None:
    client = await served.client("colleague")
    await client.call("NewScene", rpc.NewSceneArgs("workplace"))
    await client.call("AddObjectToScene", rpc.AddObjectToSceneArgs("clock", "TimeActions"))
    async with screen_of(browser, served.url, touch=True) as screen:
        page = screen.page
        await screen.join("Eva")
        tools = page.get_by_role("navigation")
        await client.call("SubscribeEvents", rpc.SubscribeEventsArgs({"ObjectState"}))
        await client.call("StartScene")
        while (await client.next_event("SceneState")).data.state != "started":
            continue
        await tools.get_by_role("button", name=texts.ADD, exact=True).click()
        panel = page.get_by_role("complementary")
        await panel.locator(".kind").filter(has_text="Random").first.click()
        await panel.get_by_label("Runs on").select_option("press")
        await screen.picture("added-on-node")
        await panel.locator("form button[type=submit]").click()
        while (added := (await client.next_event("SceneObjectChanged")).data).type != "RandomActions":
            continue
        assert added.node == "press"
        reached = ""
        while reached != "online":
            state = (await client.next_event("ObjectState")).data
            reached = state.state if state.object_id == added.id else ""
            assert reached != "failed", state
        await client.call("StopScene")
        while (await client.next_event("SceneState")).data.state != "stopped":
            continue
        await screen.press(texts.DUPLICATE)
        while (copy := (await client.next_event("SceneObjectChanged")).data).name == added.name:
            continue
        assert copy.node == "press", "the copy runs where the original does"

        await tools.get_by_role("button", name=texts.OBJECTS, exact=True).click()
        await page.get_by_role("treegrid", name="Without a pose").get_by_role("row").filter(has_text="clock").click()
        await page.get_by_label("Runs on").select_option("press")
        await tools.get_by_role("button", name=texts.DEVICES, exact=True).click()
        row = page.get_by_role("region", name="Nodes").get_by_role("listitem").filter(has_text="press")
        await expect(row).to_contain_text("Devices of this scene: clock, random_actions, random_actions_2")
        await expect(row.locator(".tag")).to_have_text("connected")

        for name, where in (("left", "press"), ("right", "")):
            await client.call("AddObjectToScene", rpc.AddObjectToSceneArgs(name, "UR5e", Pose(), ROBOT))
            while (robot := (await client.next_event("SceneObjectChanged")).data).name != name:
                continue
            await client.call("SetObjectNode", rpc.SetObjectNodeArgs(robot.id, where))
        apart = r"left \(node press\), right \(the computer of the server\)"
        with pytest.raises(RequestFailed, match=apart) as refused:
            await client.call("StartScene", dry_run=True)
        assert refused.value.reason == "several_nodes"
        await tools.get_by_role("button", name=texts.OBJECTS, exact=True).click()
        await page.get_by_role("treegrid", name="Without a pose").get_by_role("row").filter(has_text="clock").click()
        hint = "must run on one computer: left (node press), right (the computer of the server)."
        await expect(page.get_by_text(hint)).to_be_visible()
        await screen.picture("robots-apart")
        for _ in range(2):
            await client.call("Undo")
        await tools.get_by_role("button", name=texts.DEVICES, exact=True).click()

        node.end()
        await expect(row.locator(".tag")).to_have_text("not connected")
        await expect(row).to_contain_text("arcor2-hw node run press")
        await screen.settle()
        assert await screen.faults() == []
        assert await screen.barriers() == []
        await screen.picture("nodes")
