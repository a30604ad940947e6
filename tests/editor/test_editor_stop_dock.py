"""The Stop dock and the jog pad: Stop covers no control, and no control moves or is covered during a hold."""

import contextlib
import time
from collections.abc import AsyncIterator
from dataclasses import dataclass
from pathlib import Path

import pytest
import pytest_asyncio
from playwright.async_api import Browser, Error, Locator, Page

from arcor2_hw.client import Client
from arcor2_hw.data import rpc
from arcor2_hw.data.editor import ViewScope
from arcor2_hw.data.events import SceneStateEnum
from arcor2_hw.data.project import Project
from tests.e2e.harness import Cell, scene_state, until
from tests.editor import texts
from tests.editor.screen import VIEWPORTS, Screen, screen_of

pytestmark = pytest.mark.asyncio(loop_scope="session")

SIZES = ("tablet", "desktop", "ipad", "phone")
BUTTONS = {"Tool": 6, "By hand": 1}
"""Visible buttons of the pad. How many joints are visible at once depends on the screen."""
_WATCH = Path(__file__).with_name("pad.js").read_text()


@dataclass
class Online:
    """A project whose scene another user has brought online."""

    colleague: Client
    project: Project
    robot: str

    async def ask_for_robot(self) -> None:
        """Send a message to the user who has locked the robot."""
        request = {f"asked/{self.robot}": {"by": "colleague", "at": time.time() * 1000}}
        await self.colleague.call("SetViewState", rpc.SetViewStateArgs(ViewScope.SHARED, request, self.project.id))


@pytest_asyncio.fixture(scope="module", loop_scope="session")
async def online(module_cell: Cell) -> AsyncIterator[Online]:
    client = await module_cell.client("colleague")
    scene, project = await module_cell.open(client)
    await client.call("StartScene")
    await scene_state(client, SceneStateEnum.STARTED, 60)
    yield Online(client, project, next(each.id for each in scene.objects if each.name == "robot"))


async def resize(screen: Screen, size: str) -> None:
    await screen.page.set_viewport_size(VIEWPORTS[size])  # type: ignore[arg-type]
    await screen.settle()


async def open_tool(page: Page, name: str) -> None:
    if not await page.get_by_role("complementary", name=name).count():
        await page.get_by_role("navigation").get_by_role("button", name=name, exact=True).click()
    await page.get_by_role("complementary").get_by_role("heading", name=name, exact=True).wait_for()


async def test_no_control_reaches_into_the_stop_dock(
    online: Online, module_cell: Cell, browser: Browser, sizes: list[str]
) -> None:
    async with screen_of(browser, module_cell.url, touch=True) as screen:
        page = screen.page
        stop = page.get_by_role("button", name=texts.STOP_MOTION)
        found: dict[str, list[str]] = {}

        async def check(label: str, picture: bool = True) -> None:
            await screen.settle()
            if faults := await screen.faults():
                found[label] = faults
            if picture:
                await screen.picture(f"dock {label}")

        await screen.join("Eva")
        await stop.wait_for()
        for size in filter(sizes.__contains__, SIZES):
            await resize(screen, size)
            for tool in texts.TOOLS:
                await open_tool(page, tool)
                await check(f"{tool}, {size}", tool == texts.ROBOT)
            await page.get_by_role("button", name="Undo", exact=True).click(force=True)
            await page.get_by_text("There is nothing to undo.").first.wait_for()
            await check(f"message, {size}")
            await screen.press(texts.SETTINGS)
            await page.get_by_role("menu").wait_for()
            await check(f"menu, {size}")
            await page.get_by_role("menuitem", name="Messages").click()
            await page.get_by_role("dialog").wait_for()
            await check(f"dialog, {size}")
            await stop.click(trial=True)
            await page.get_by_role("dialog").get_by_role("button", name="Close").click()
        await open_tool(page, texts.ROBOT)
        await screen.press(texts.LARGER_PANEL)
        await check("large sheet, phone")
        await resize(screen, "tablet")
        await page.evaluate("() => { document.documentElement.style.fontSize = '200%'; }")
        await check("large text, tablet")
        await page.evaluate("() => { document.documentElement.style.fontSize = ''; }")
        await page.evaluate("location.hash = '#/operator'")
        for size in filter(sizes.__contains__, SIZES):
            await resize(screen, size)
            await stop.wait_for()
            await check(f"operator, {size}")
        assert not found, "\n".join(f"{label}: {fault}" for label, faults in found.items() for fault in faults)


async def hold(page: Page, button: Locator) -> None:
    """Hold a button until the panel shows the user who moves the robot. If the hold ends by itself, press again."""

    async def reported() -> bool:
        if await button.get_attribute("data-held") != "true":
            await page.mouse.up()
            await button.hover()
            await page.mouse.down()
        return await page.get_by_role("complementary").get_by_text("Eva is ").count() > 0

    await until(reported, "the hold is shown", 20)


async def faults_during_hold(online: Online, screen: Screen, tab: str, size: str) -> list[str]:
    """Hold a button of a pad while a message arrives, and return the controls that moved or were covered."""
    page = screen.page
    panel = page.get_by_role("complementary")
    await panel.get_by_role("radiogroup", name=texts.ROBOT_CONTROL).get_by_role("radio", name=tab, exact=True).click()
    if tab != "By hand":
        await panel.get_by_role("radio", name=texts.HOLD_TO_MOVE).click()
    button = panel.locator("button.hold:not([aria-disabled])").last
    await button.hover()
    await screen.settle()
    shown = await page.evaluate(_WATCH, "button.hold")
    assert shown >= 1, "no button is visible"
    assert shown == BUTTONS.get(tab, shown), f"only {shown} buttons are visible"
    message = page.get_by_text("colleague asks for").first

    async def message_is_shown() -> bool:
        """Only the user who holds the robot gets the message. On a busy computer, the hold may end before."""
        await hold(page, button)
        await online.ask_for_robot()
        with contextlib.suppress(Error):
            await message.wait_for(timeout=5_000)
        return await message.is_visible()

    await until(message_is_shown, "the message is shown during a hold", 60)
    frames = await page.evaluate("window.padFrames")
    await screen.until("(before) => window.padFrames > before + 3", frames)
    await screen.picture(f"hold {tab} {size}")
    await page.mouse.up()
    await screen.until("() => !document.querySelector('[data-held=true]')")
    await screen.settle()
    faults: list[str] = await page.evaluate("window.padFaults()")
    dismiss = page.get_by_role("button", name=texts.DISMISS)
    while await dismiss.count():
        await dismiss.first.click()
    return faults


async def test_nothing_moves_or_is_covered_during_a_hold(
    online: Online, module_cell: Cell, browser: Browser, sizes: list[str]
) -> None:
    async with screen_of(browser, module_cell.url) as screen:
        await screen.join("Eva")
        await screen.page.get_by_role("button", name=texts.STOP_MOTION).wait_for()
        await open_tool(screen.page, texts.ROBOT)
        found = {}
        for size in filter(sizes.__contains__, SIZES):
            await resize(screen, size)
            for tab in ("Tool", "Joints", "By hand"):
                if faults := await faults_during_hold(online, screen, tab, size):
                    found[f"{tab}, {size}"] = faults
        assert not found, "\n".join(f"{label}: {fault}" for label, faults in found.items() for fault in faults)
