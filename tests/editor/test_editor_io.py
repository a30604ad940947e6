"""Pages that the panel Devices opens: mode and authority of the cell, and the page of inputs and outputs."""

import re
from pathlib import Path

import pytest
from playwright.async_api import Browser, expect

from arcor2_hw.client import Client
from arcor2_hw.data import rpc
from arcor2_hw.data.cell_state import CellMode
from tests.e2e.harness import Cell
from tests.editor import texts
from tests.editor.screen import Screen, screen_of

pytestmark = pytest.mark.asyncio(loop_scope="session")

PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "io.md"

TREND_PIXELS = """(canvas) => {
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  const colour = getComputedStyle(canvas).getPropertyValue("--trend-1");
  const wanted = colour.match(/\\w\\w/g).map((each) => parseInt(each, 16));
  return data.filter((_, n) => n % 4 === 0 && wanted.every((each, part) => data[n + part] === each)).length;
}"""
"""Number of pixels in the colour of the first line."""


async def add_lamp(client: Client, cell: Cell) -> None:
    """Add a lamp of the type in the how-to guide to the scene, and go online."""
    source = PAGE.read_text().partition("```python\n")[2].partition("```")[0]
    await client.rest.put_object_type("Lamp", source)
    scene, _ = await cell.open(client)
    await client.call("CloseProject")
    await client.call("OpenScene", rpc.IdArgs(scene.id))
    await client.call("AddObjectToScene", rpc.AddObjectToSceneArgs("signal", "Lamp"))
    await client.call("StartScene")


async def change_the_mode(screen: Screen, client: Client) -> None:
    """Change the mode in the panel Devices and back, and read why the PLC cannot have the authority."""
    await screen.press("Mode and authority")
    dialog = screen.page.get_by_role("dialog", name="Mode and authority")
    for mode in (CellMode.MAINTENANCE, CellMode.PRODUCE):
        button = dialog.get_by_role("button", name=mode.value)
        await button.click()
        await expect(button).to_have_attribute("aria-pressed", "true")
        assert (await client.call("GetCell")).mode is mode
    await dialog.get_by_role("button", name=re.compile("^The PLC")).click()
    await screen.press("Let the PLC command")
    await expect(dialog.get_by_role("alert")).to_contain_text("Start it with --plc-modbus or --opcua.")
    await screen.settle()
    assert await screen.faults() == []
    assert await screen.barriers() == []
    await screen.picture("mode-and-authority")
    await dialog.get_by_role("button", name="Close").click()


async def show_the_history(screen: Screen) -> None:
    """Open the history of the lamp, which has been off, over an hour and over a day."""
    await screen.press("History of signal: lamp")
    dialog = screen.page.get_by_role("dialog", name="History of signal: lamp")
    await expect(dialog).to_contain_text("On for 0\u00a0% of the known time")
    chart = dialog.get_by_role("img", name="signal: lamp").locator("canvas")
    before = await chart.element_handle()
    async with screen.page.expect_response(lambda response: "/api/history/summary" in response.url):
        pass  # the chart follows the present without being replaced
    assert await chart.evaluate("(canvas, before) => canvas === before", before)
    await screen.picture("point-history-hour")
    await dialog.get_by_role("radio", name="1 day").click()
    await expect(dialog.get_by_role("img", name="signal: lamp")).to_be_visible()
    await screen.settle()
    assert await screen.faults() == []
    assert await screen.barriers() == []
    assert await dialog.locator(".trend-chart canvas").evaluate(TREND_PIXELS), "a single value is drawn as a dot"
    await screen.picture("point-history")
    await dialog.get_by_role("button", name="Close").click()


async def test_an_output_is_forced_and_an_operator_ends_the_force(cell: Cell, browser: Browser) -> None:
    colleague = await cell.client("colleague")
    await add_lamp(colleague, cell)
    async with screen_of(browser, cell.url, touch=True) as screen, screen_of(browser, cell.url, "phone") as phone:
        page, other = screen.page, phone.page
        await screen.join("Eva")
        await page.get_by_role("button", name=texts.DEVICES).click()
        await change_the_mode(screen, colleague)
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
        await page.get_by_role("button", name="Force robot: digital_out[0]").click(
            force=True
        )  # the message states the reason
        await screen.sees("The device would keep a forced value")

        await page.get_by_placeholder("Search device or point").fill("lamp")
        await show_the_history(screen)
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

        # Back returns to the page from which it was opened.
        await phone.press("Inputs and outputs")
        await expect(other.get_by_role("heading", name="Inputs and outputs")).to_be_visible()
        await phone.press("Back")
        await expect(other.get_by_role("heading", name="Operator")).to_be_visible()
        await screen.press("Back")
        await expect(page.get_by_role("button", name=texts.DEVICES)).to_be_visible()
