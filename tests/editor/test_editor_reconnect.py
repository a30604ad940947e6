"""The server dies and comes back: who looks on sees it, and is in his place again by himself."""

from pathlib import Path
from urllib.parse import urlsplit

import pytest
from playwright.async_api import Browser

from arcor2_hw.data import rpc
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.object_type import Box, Model3dType, ObjectModel
from tests.e2e.harness import Cell
from tests.editor.screen import screen_of

pytestmark = pytest.mark.asyncio(loop_scope="module")


async def test_the_view_stays_without_the_server_and_it_comes_back_by_itself(
    browser: Browser, built_editor: Path, tmp_path: Path
) -> None:
    cell = Cell(tmp_path)
    try:
        await cell.start_server()
        client = await cell.client("maker")
        await client.call("NewScene", rpc.NewSceneArgs("cell"))
        model = ObjectModel(Model3dType.BOX, box=Box("table", 1.0, 0.6, 0.02))
        await client.call(
            "AddVirtualCollisionObjectToScene",
            rpc.AddVirtualCollisionObjectToSceneArgs("table", Pose(Position(0.2, 0.0, 0.0)), model),
        )
        table = (await client.next_event("SceneObjectChanged", timeout=10)).data.id
        async with screen_of(browser, cell.url) as screen:
            # A part of the page may be on its way just when the server dies.
            screen.expected_errors = ("WebSocket connection to", "Failed to load resource: net::ERR_CONNECTION_")
            await screen.join("Eva")
            await screen.press("Things")
            await screen.page.get_by_role("row", name="table").click()
            assert (await screen.item(table))["pose"]["position"]["x"] == 0.2
            port = urlsplit(cell.url).port
            assert port is not None
            await cell.kill("server")
            await screen.sees("No connection to the server.")
            await screen.sees("What was changed and not saved, the server keeps.")
            assert (await screen.item(table))["name"] == "table"
            assert await screen.page.get_by_role("button", name="Save").is_disabled()

            await cell.start_server(port)
            await screen.until("() => !document.querySelector('.lost')")
            await screen.sees("What was changed and not saved is still here")
            # The same thing is selected, from the journal of the server that was killed.
            assert (await screen.item(table))["pose"]["position"]["x"] == 0.2
            await screen.page.get_by_role("complementary").get_by_role("heading", name="table").wait_for()
            # So it is for who has lost the page as well: a new tab finds it.
            async with screen_of(browser, cell.url) as again:
                await again.join("Eva's other tab")
                await again.sees("What was changed and not saved is still here")
                await again.sees("not saved")
                assert (await again.item(table))["name"] == "table"
            await screen.press("Save")
            await screen.sees("saved")
            await screen.until("() => !document.querySelector('.document').textContent.includes('not saved')")
    finally:
        await cell.stop()
