"""The server is killed and started again: users see the connection loss and continue where they were."""

import pytest
from playwright.async_api import Browser

from arcor2_hw.data import rpc
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.object_type import Box, Model3dType, ObjectModel
from tests.e2e.harness import Cell
from tests.editor import texts
from tests.editor.screen import SERVER_GONE, screen_of

pytestmark = pytest.mark.asyncio(loop_scope="session")


async def test_the_view_stays_while_the_server_is_gone_and_reconnects(browser: Browser, cell: Cell) -> None:
    client = await cell.client("maker")
    await client.call("NewScene", rpc.NewSceneArgs("cell"))
    model = ObjectModel(Model3dType.BOX, box=Box("table", 1.0, 0.6, 0.02))
    await client.call(
        "AddVirtualCollisionObjectToScene",
        rpc.AddVirtualCollisionObjectToSceneArgs("table", Pose(Position(0.2, 0.0, 0.0)), model),
    )
    table = (await client.next_event("SceneObjectChanged")).data.id
    async with screen_of(browser, cell.url) as screen:
        screen.expected_errors = SERVER_GONE
        await screen.join("Eva")
        await screen.press(texts.OBJECTS)
        await screen.page.get_by_role("row", name="table").click()
        assert (await screen.item(table))["pose"]["position"]["x"] == 0.2
        await cell.kill("server")
        await screen.sees(texts.NO_CONNECTION)
        await screen.sees("Unsaved changes are kept on the server.")
        assert (await screen.item(table))["name"] == "table"
        assert await screen.page.get_by_role("button", name=texts.SAVE, exact=True).is_disabled()

        await cell.restart_server()
        await screen.until("() => !document.querySelector('.lost')")
        await screen.sees("Your unsaved changes are still available")
        # The selection is restored, from the journal of the killed server.
        assert (await screen.item(table))["pose"]["position"]["x"] == 0.2
        await screen.page.get_by_role("complementary").get_by_role("heading", name="table").wait_for()
        # A new tab shows the unsaved changes, too.
        async with screen_of(browser, cell.url) as second_tab:
            await second_tab.join("Eva's other tab")
            await second_tab.sees("Your unsaved changes are still available")
            await second_tab.sees(texts.NOT_SAVED)
            assert (await second_tab.item(table))["name"] == "table"
        await screen.press(texts.SAVE)
        await screen.sees("saved")
        await screen.until("() => !document.querySelector('.document').textContent.includes('not saved')")
