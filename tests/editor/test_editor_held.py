"""The robot stops when the hold-to-move button is released, and when the page or the server is lost."""

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator, Awaitable, Callable

import psutil
import pytest
import pytest_asyncio
from playwright.async_api import Browser, CDPSession, Error

from arcor2_hw.client import Client
from arcor2_hw.data.events import SceneStateEnum
from arcor2_hw.testing.own_time import own_time
from tests.e2e.harness import Cell, scene_state
from tests.editor import texts
from tests.editor.screen import SERVER_GONE, Screen, screen_of

pytestmark = pytest.mark.asyncio(loop_scope="session")

STOP_TIMEOUT = 5.0
"""Time limit for the robot to stop, s. A robot that is not stopped moves on. Benchmarks measure the stopping time."""
STANDSTILL_TIME = 0.6
"""Time for which the robot must stay at standstill afterwards, s."""
HOLD = "Hold to move along +Z"

PageLoss = Callable[[Screen, CDPSession], Awaitable[object]]


async def release_button(screen: Screen) -> None:
    await screen.page.mouse.up()


async def lose_focus(screen: Screen) -> None:
    await screen.page.evaluate("() => window.dispatchEvent(new Event('blur'))")


def _renderers() -> list[psutil.Process]:
    """Return the renderer processes of the browser."""
    below = psutil.Process().children(recursive=True)
    return [each for each in below if "--type=renderer" in each.cmdline()]


async def freeze(_: Screen, __: CDPSession) -> None:
    """Suspend the renderer process; its connection stays open."""
    for each in _renderers():
        each.suspend()


async def close(screen: Screen, _: CDPSession) -> None:
    await screen.page.close()


async def crash(_: Screen, devtools: CDPSession) -> None:
    """Crash the renderer process."""
    with contextlib.suppress(Error, TimeoutError):  # the crashed page does not answer
        await asyncio.wait_for(devtools.send("Page.crash"), 0.05)


async def close_panel(screen: Screen) -> None:
    """Close the panel that contains the held button."""
    await screen.page.evaluate("() => document.querySelector('.rail [aria-pressed=true]').click()")


async def is_moving(cell: Cell) -> bool:
    speeds: list[float] = (await cell.command_fake("robot", "truth"))["qd"]
    return max(map(abs, speeds)) > 1e-3


async def await_standstill(cell: Cell) -> None:
    """Wait for standstill. Fail if the robot moves again."""
    start = own_time()
    while await is_moving(cell):
        assert not start.is_past(STOP_TIMEOUT), "the robot does not stop"
    end = time.monotonic() + STANDSTILL_TIME
    while time.monotonic() < end:
        assert not await is_moving(cell), "the robot moves again"


@pytest_asyncio.fixture(loop_scope="session")
async def online(cell: Cell) -> AsyncIterator[Client]:
    client = await cell.client("colleague")
    await cell.open(client)
    await client.call("StartScene")
    await scene_state(client, SceneStateEnum.STARTED, 30)
    yield client


async def open_jog_panel(screen: Screen) -> None:
    await screen.join("Eva")
    await screen.press(texts.ROBOT)
    await screen.page.get_by_role("complementary").get_by_role("radio", name=texts.HOLD_TO_MOVE).click()


async def hold(screen: Screen, cell: Cell) -> None:
    """Hold the button that moves the tool up, until the arm moves.

    Press again if the hold ends by itself, as a user would. The first press takes control of the robot, which may take
    longer than the deadman timeout, and a page rendered in software on a busy machine may renew the hold too late.
    """
    button = screen.page.locator(f"button[aria-label='{HOLD}']:not([aria-disabled])")
    end = time.monotonic() + 60
    while not await is_moving(cell):
        assert time.monotonic() < end, "the arm does not move"
        if not await screen.page.locator("[data-held=true]").count():
            await screen.page.mouse.up()
            await button.hover()
            await screen.page.mouse.down()
        await screen.settle()


async def test_robot_stops_when_the_button_is_released(online: Client, cell: Cell, browser: Browser) -> None:
    async with screen_of(browser, cell.url) as screen:
        await open_jog_panel(screen)
        for release in (release_button, lose_focus, close_panel):
            await hold(screen, cell)
            await release(screen)
            await await_standstill(cell)
            await screen.page.mouse.up()


@pytest.mark.parametrize("loss", [freeze, close, crash], ids=["freeze", "close", "crash"])
async def test_robot_stops_when_the_page_freezes_closes_or_crashes(
    loss: PageLoss, online: Client, cell: Cell, browser: Browser
) -> None:
    async with screen_of(browser, cell.url) as screen:
        await open_jog_panel(screen)
        devtools = await screen.page.context.new_cdp_session(screen.page)
        await hold(screen, cell)
        try:
            await loss(screen, devtools)
            await await_standstill(cell)
        finally:
            if loss is freeze:
                for each in _renderers():
                    each.resume()


async def test_robot_stops_when_the_server_is_killed_and_stays_stopped(
    online: Client, cell: Cell, browser: Browser
) -> None:
    async with screen_of(browser, cell.url) as screen:
        screen.expected_errors = SERVER_GONE
        await open_jog_panel(screen)
        await hold(screen, cell)
        await cell.kill("server")
        await await_standstill(cell)
        # The button is still held.
        await screen.sees(texts.NO_CONNECTION)
        await cell.restart_server()
        await screen.until("() => !document.querySelector('.lost')")
        await await_standstill(cell)
        await screen.sees(texts.GO_ONLINE)
        assert await screen.page.locator("[data-held=true]").count() == 0
