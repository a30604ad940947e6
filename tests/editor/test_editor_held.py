"""A motion that is held in the page ends with whatever takes the hand from it, and no other begins by itself."""

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from urllib.parse import urlsplit

import psutil
import pytest
import pytest_asyncio
from playwright.async_api import Browser, CDPSession, Error

from arcor2_hw.client import Client
from arcor2_hw.data.events import SceneStateEnum
from tests.e2e.harness import Cell, scene_state
from tests.editor.screen import Screen, screen_of

pytestmark = [pytest.mark.asyncio(loop_scope="module"), pytest.mark.timeout(150), pytest.mark.alone]

RESTS_WITHIN = 0.5
"""Seconds from what took the hand away."""
STAYS = 0.6
"""Seconds to look whether it stays at rest."""
HOLD = "Move along +Z, as long as it is held"

Loss = Callable[[Screen, CDPSession], Awaitable[object]]


async def let_go(screen: Screen) -> None:
    await screen.page.mouse.up()


async def lose_focus(screen: Screen) -> None:
    await screen.page.evaluate("() => window.dispatchEvent(new Event('blur'))")


def _renderers() -> list[psutil.Process]:
    """The processes of this test's browser in which pages run."""
    below = psutil.Process().children(recursive=True)
    return [each for each in below if "--type=renderer" in each.cmdline()]


async def freeze(_: Screen, __: CDPSession) -> None:
    """The page's process stands still and says nothing; its connection stays."""
    for each in _renderers():
        each.suspend()


async def close(screen: Screen, _: CDPSession) -> None:
    await screen.page.close()


async def crash(_: Screen, devtools: CDPSession) -> None:
    """The page's process is gone without a word."""
    with contextlib.suppress(Error, TimeoutError):  # there is nobody left who could answer
        await asyncio.wait_for(devtools.send("Page.crash"), 0.05)


async def panel_away(screen: Screen) -> None:
    """The panel goes with the button that is under the finger."""
    await screen.page.evaluate("() => document.querySelector('.rail [aria-pressed=true]').click()")


async def moving(cell: Cell) -> bool:
    speeds: list[float] = (await cell.tell("robot", "truth"))["qd"]
    return max(map(abs, speeds)) > 1e-3


async def rests(cell: Cell, since: float) -> float:
    """Wait until it rests; gives the seconds since then. Fails when it begins again."""
    while await moving(cell):
        assert time.monotonic() - since < 5, "it does not stop"
    took = time.monotonic() - since
    end = time.monotonic() + STAYS
    while time.monotonic() < end:
        assert not await moving(cell), "it began again"
    return took


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def online(cell: Cell) -> AsyncIterator[Client]:
    client = await cell.client("colleague")
    await cell.open(client)
    await client.call("StartScene")
    await scene_state(client, SceneStateEnum.STARTED, 30)
    yield client


async def panel(screen: Screen) -> None:
    await screen.join("Eva")
    await screen.press("Robot")
    await screen.page.get_by_role("complementary").get_by_role("radio", name="Hold to move").click()


async def hold(screen: Screen, cell: Cell) -> None:
    """Hold the button that moves the tool up, until the arm moves.

    A press that ends by itself is made again, as a user would: the first one takes control, which may last
    longer than a lease, and a page that is drawn by software on a busy machine may renew too late.
    """
    button = screen.page.locator(f"button[aria-label='{HOLD}']:not([aria-disabled])")
    end = time.monotonic() + 20
    while not await moving(cell):
        assert time.monotonic() < end, "the arm does not move"
        if not await screen.page.locator("[data-held=true]").count():
            await screen.page.mouse.up()
            await button.hover()
            await screen.page.mouse.down()
        await screen.settle()


async def test_the_arm_rests_when_the_hand_lets_go(online: Client, cell: Cell, browser: Browser) -> None:
    async with screen_of(browser, cell.url) as screen:
        await panel(screen)
        for release in (let_go, lose_focus, panel_away):
            await hold(screen, cell)
            since = time.monotonic()
            await release(screen)
            assert await rests(cell, since) < RESTS_WITHIN, release.__name__
            await screen.page.mouse.up()


@pytest.mark.parametrize("loss", [freeze, close, crash], ids=["freeze", "close", "crash"])
async def test_the_arm_rests_when_the_page_is_gone(loss: Loss, online: Client, cell: Cell, browser: Browser) -> None:
    async with screen_of(browser, cell.url) as screen:
        await panel(screen)
        devtools = await screen.page.context.new_cdp_session(screen.page)
        await hold(screen, cell)
        since = time.monotonic()
        try:
            await loss(screen, devtools)
            assert await rests(cell, since) < RESTS_WITHIN
        finally:
            if loss is freeze:
                for each in _renderers():
                    each.resume()


async def test_a_server_that_dies_ends_it_and_when_it_is_back_nothing_moves(
    online: Client, cell: Cell, browser: Browser
) -> None:
    async with screen_of(browser, cell.url) as screen:
        screen.expected_errors = ("WebSocket connection to", "net::ERR_CONNECTION_")
        await panel(screen)
        await hold(screen, cell)
        port = urlsplit(cell.url).port
        assert port is not None
        since = time.monotonic()
        await cell.kill("server")
        assert await rests(cell, since) < RESTS_WITHIN
        # The finger is still on the button.
        await screen.sees("No connection to the server.")
        await cell.start_server(port)
        await screen.until("() => !document.querySelector('.lost')")
        assert await rests(cell, time.monotonic()) < RESTS_WITHIN
        await screen.sees("Go online")
        assert await screen.page.locator("[data-held=true]").count() == 0
