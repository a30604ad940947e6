"""Interlocks are set up without code, and the panel shows live whether they are met."""

import pytest
from playwright.async_api import Browser, Page, expect

from arcor2_hw.client import Client
from arcor2_hw.data import rpc
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.object_type import Box, Model3dType, ObjectModel
from tests.e2e.harness import Cell
from tests.editor import texts
from tests.editor.screen import Screen, screen_of

pytestmark = pytest.mark.asyncio(loop_scope="session")

ZONE = "inside"


async def add_zone_body(client: Client, cell: Cell) -> None:
    """Open the scene, and add the body of a zone."""
    scene, _ = await cell.open(client)
    await client.call("CloseProject")
    await client.call("OpenScene", rpc.IdArgs(scene.id))
    model = ObjectModel(Model3dType.BOX, Box(ZONE, 0.2, 0.2, 0.2))
    pose = Pose(Position(0.5, 0.15, 0.2))
    await client.call("AddVirtualCollisionObjectToScene", rpc.AddVirtualCollisionObjectToSceneArgs(ZONE, pose, model))


async def add_interlock(page: Page, screen: Screen) -> None:
    """Add the interlock `Door` of the zone on the screen."""
    await screen.press("Add interlock")
    await page.get_by_label("Name", exact=True).fill("Door")
    await page.get_by_label("Body of the zone").select_option(ZONE)
    await screen.press("Add condition")
    await page.get_by_label("Device", exact=True).select_option("tester")
    await page.get_by_label("Value", exact=True).select_option("door open")


async def test_an_interlock_is_set_up_and_shown_live(cell: Cell, browser: Browser) -> None:
    client = await cell.client("colleague")
    await add_zone_body(client, cell)
    await client.call("StartScene")
    async with screen_of(browser, cell.url, touch=True) as screen:
        page = screen.page
        await screen.join("Eva")
        await page.get_by_role("button", name=texts.DEVICES).click()
        await screen.press("Interlocks and zones")
        await add_interlock(page, screen)
        await screen.settle()
        assert await screen.faults() == []
        await screen.picture("interlock-form")
        await page.get_by_role("dialog").get_by_role("button", name="Save").click()

        row = page.get_by_role("listitem").filter(has_text="Door").first
        await expect(row).to_contain_text("tester: door open")
        await cell.command_fake("tester", "push_door", opening=False)
        await expect(row).to_contain_text("not met")
        await screen.settle()
        assert await screen.faults() == []
        assert await screen.barriers() == []
        await screen.picture("interlocks-not-met")
        await cell.command_fake("tester", "push_door", opening=True)
        await expect(row.get_by_text("met", exact=True)).to_be_visible()

        await page.get_by_role("button", name="Delete Door").click()
        await page.get_by_role("alertdialog").get_by_role("button", name="Delete").click()
        await expect(row).to_have_count(0)
        assert (await client.call("ListInterlocks")).interlocks == []
