"""The page of inputs and outputs: live values, search, and a forced output that an operator sees and ends."""

import re
from pathlib import Path

import pytest
from playwright.async_api import Browser, expect

from arcor2_hw.client import Client
from arcor2_hw.data import rpc
from tests.e2e.harness import Cell
from tests.editor import texts
from tests.editor.screen import screen_of

pytestmark = pytest.mark.asyncio(loop_scope="session")

PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "io.md"


async def with_lamp(client: Client, cell: Cell) -> None:
    """Add a lamp of the type in the how-to guide to the scene, and go online."""
    source = PAGE.read_text().partition("```python\n")[2].partition("```")[0]
    await client.rest.put_object_type("Lamp", source)
    scene, _ = await cell.open(client)
    await client.call("CloseProject")
    await client.call("OpenScene", rpc.IdArgs(scene.id))
    await client.call("AddObjectToScene", rpc.AddObjectToSceneArgs("signal", "Lamp"))
    await client.call("StartScene")


async def test_an_output_is_forced_and_an_operator_ends_it(cell: Cell, browser: Browser) -> None:
    await with_lamp(await cell.client("colleague"), cell)
    async with screen_of(browser, cell.url, touch=True) as screen, screen_of(browser, cell.url, "phone") as phone:
        page, other = screen.page, phone.page
        await screen.join("Eva")
        await page.get_by_role("button", name=texts.DEVICES).click()
        await screen.press("Inputs and outputs")
        tester = page.get_by_role("region", name="tester")
        row = tester.get_by_role("listitem").filter(has_text="door open")
        await expect(row).to_contain_text(re.compile("on|off"))
        await cell.command_fake("tester", "push_door", opening=False)
        await expect(row).to_contain_text("off")
        await cell.command_fake("tester", "push_door", opening=True)
        await expect(row).to_contain_text("on")
        await page.get_by_placeholder("Search device or point").fill("digital_out[0]")
        await expect(tester).to_have_count(0)
        await page.get_by_role("button", name="Force robot: digital_out[0]").click(force=True)  # it says why not
        await screen.sees("The device would keep a forced value")

        await page.get_by_placeholder("Search device or point").fill("lamp")
        await screen.press("Force signal: lamp")
        await screen.press("Force on")
        lamp = page.get_by_role("region", name="signal").get_by_role("listitem")
        await expect(lamp).to_contain_text("forced by Eva")
        await expect(lamp.locator(".io-value")).to_contain_text("on")
        await screen.settle()
        assert await screen.faults() == []
        assert await screen.barriers() == []
        await screen.picture("io-forced")

        await phone.join("Oskar", "/?q=low#/operator")
        banner = other.get_by_role("status", name="Forced outputs")
        await expect(banner).to_contain_text("Forced: signal: lamp = on")
        await expect(banner).to_contain_text("Eva")
        await phone.settle()
        assert await phone.faults() == []
        await phone.picture("io-operator")
        await banner.get_by_role("button", name="End force: signal: lamp").click()
        await other.get_by_role("alertdialog").get_by_role("button", name="End force").click()
        await expect(banner).to_have_count(0)
        await expect(lamp.locator(".io-value")).to_have_text("off")
