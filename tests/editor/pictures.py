"""Take the pictures of the documentation from the demo workplace in a fixed state.

`python -m tests.editor.pictures [DIRECTORY]` writes `editor-*.png` into docs/pictures or the directory.
"""

import asyncio
import re
import sys
import tempfile
from pathlib import Path
from typing import Final

from playwright.async_api import Browser, expect

from arcor2_hw.client import Client
from arcor2_hw.data import rpc
from tests.demo.running import Run, demo
from tests.e2e.harness import until
from tests.editor import texts
from tests.editor.screen import Screen, running_browser, screen_of

SEED: Final = 3

STEP_TIMEOUT: Final = 240_000
"""Timeout of each step, ms: without a graphics card, a frame in high quality takes up to seconds."""


async def _join(screen: Screen) -> None:
    screen.page.set_default_timeout(STEP_TIMEOUT)
    await screen.page.goto(f"{screen.url}/?q=high")
    await screen.page.get_by_label(texts.YOUR_NAME).fill("Ada")
    await screen.press(texts.JOIN)
    shows = "() => document.querySelector('.home') ? 'home' : window.__engine?.ids().length > 20 && 'workplace'"
    if await (await screen.page.wait_for_function(shows)).json_value() == "home":
        await screen.page.get_by_role("radio", name=texts.PROJECTS).click()
        await screen.page.get_by_role("button", name=re.compile("^Open ")).first.click()
        await screen.page.wait_for_function("() => window.__engine?.ids().length > 20")


async def _wait_until_drawn(screen: Screen) -> None:
    """Wait until everything is loaded and drawn."""
    await screen.page.wait_for_function(
        """() => {
            const now = performance.now(), last = window.lastDrawn;
            const frames = window.__engine?.frames ?? 0;
            if (last?.frames !== frames) window.lastDrawn = { frames, since: now };
            return last?.frames === frames && now - last.since > 1200;
        }"""
    )


async def _tablet(browser: Browser, run: Run, to: Path) -> None:
    at = run.at()
    assert at is not None
    async with screen_of(browser, at["url"], drawn=True) as screen:
        page = screen.page

        async def take(name: str) -> None:
            await _wait_until_drawn(screen)
            (to / f"editor-{name}.png").write_bytes(await page.screenshot())

        await _join(screen)
        # The view becomes the thumbnail of the project when it is saved.
        await _wait_until_drawn(screen)
        async with Client(at["url"].replace("http", "ws", 1), "Carl", reconnect=False) as client:
            project = (await client.call("ListProjects"))[0].id
            description = rpc.UpdateProjectDescriptionArgs(project, "Test boards, and sort them.")
            await client.call("UpdateProjectDescription", description)
        await page.get_by_text(texts.NOT_SAVED).wait_for()
        await screen.press(texts.SAVE)
        await page.get_by_text(texts.NOT_SAVED).wait_for(state="detached")
        await screen.press(texts.GO_ONLINE)
        await page.get_by_role("button", name=texts.STOP_MOTION).wait_for()
        await screen.page.wait_for_function("() => __engine.ids().some((id) => __engine.item(id).endEffectors?.length)")
        await take("workplace")
        tools = page.get_by_role("navigation")
        await tools.get_by_role("button", name=texts.ROBOT, exact=True).click()
        await page.get_by_role("complementary").get_by_text(texts.HOLD_TO_MOVE).wait_for()
        await take("teach")
        await page.get_by_role("radio", name="Split", exact=True).click()
        await tools.get_by_role("button", name=texts.PROGRAM, exact=True).click()
        await page.get_by_role("region", name=texts.GRAPH).wait_for()
        await take("program")
        await _open_function(screen, "handle", "handle_board")
        graph = page.get_by_role("region", name=texts.GRAPH)
        await page.get_by_role("radio", name="Flow", exact=True).click()
        await graph.get_by_role("button", name=texts.WHOLE_PROGRAM).click()
        await _wait_until_drawn(screen)
        await graph.get_by_role("button", name=texts.SELECT_SEVERAL).click()
        for name in ("into_nest", "out_of_nest"):
            await graph.locator(f'.react-flow__node[aria-label^="{name},"]').click()
        await page.get_by_text("3 actions selected").wait_for()
        await take("function")
        await page.get_by_role("group", name="Make a function").get_by_role("button", name=texts.CANCEL).click()
        await graph.locator('.react-flow__node[aria-label^="label_and_load"] .flow-title').first.click()
        await page.get_by_role("complementary").get_by_role("region", name="Branches").wait_for()
        await take("parallel")
        await page.get_by_role("navigation", name="Open function").get_by_role("button", name="Back").click()


async def _open_function(screen: Screen, call: str, name: str) -> None:
    """Find a call of a function with the search, and open the function from the panel of the call."""
    page = screen.page
    await page.keyboard.press("/")
    search = page.get_by_role("dialog", name="Find a command or an object")
    await search.get_by_role("option").first.wait_for()
    await page.keyboard.type(f"{call} act")
    await search.get_by_role("option").filter(has=page.get_by_text(call, exact=True)).first.click()
    panel = page.get_by_role("complementary")
    await panel.get_by_role("heading", name=call, exact=True).wait_for()
    await panel.get_by_role("button", name="Open function").click()
    await page.get_by_role("navigation", name="Open function").get_by_text(name, exact=True).wait_for()


async def _operator(browser: Browser, run: Run, to: Path) -> None:
    """Take the operator's screen while the program runs, with the first board in its box."""
    async with screen_of(browser, run.at()["url"], drawn=True) as screen:  # type: ignore[index]
        screen.page.set_default_timeout(STEP_TIMEOUT)
        await screen.join("Olga", "/?q=low#/operator")
        await expect(screen.page.get_by_role("region", name="This run")).to_contain_text("Good1", timeout=STEP_TIMEOUT)
        await screen.page.get_by_role("button", name=texts.STOP, exact=True).wait_for()
        (to / "editor-operator.png").write_bytes(await screen.page.screenshot())


async def _home(browser: Browser, run: Run, to: Path) -> None:
    at = run.at()
    assert at is not None
    async with screen_of(browser, at["url"], drawn=True) as screen:
        await _join(screen)
        await screen.page.get_by_role("button", name=texts.GO_OFFLINE).click()
        await screen.page.get_by_role("button", name=texts.GO_ONLINE).wait_for()
        await screen.press(texts.CLOSE_DOCUMENT)
        await screen.page.get_by_role("radio", name=texts.PROJECTS).click()
        await screen.page.get_by_role("button", name=re.compile("^Open ")).first.wait_for()
        await screen.settle()
        (to / "editor-home.png").write_bytes(await screen.page.screenshot())


async def _phone(browser: Browser, run: Run, to: Path) -> None:
    at = run.at()
    assert at is not None
    async with screen_of(browser, at["url"], "phone", dark=True, touch=True, drawn=True) as screen:
        await screen.join("Ben")
        await screen.page.wait_for_function("() => window.__engine?.ids().length > 20")
        tools = screen.page.get_by_role("navigation")
        await tools.get_by_role("button", name=texts.POINTS, exact=True).click()
        await _wait_until_drawn(screen)
        (to / "editor-phone.png").write_bytes(await screen.page.screenshot())


async def main(to: Path) -> None:
    """Start the demo, wait until its program has run, and take the pictures."""
    to.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="arcor2-hw-pictures-") as name:
        async with demo(Path(name), "--boards", "3", "--seed", str(SEED)) as run, running_browser() as browser:
            await until(lambda: run.at() is not None, "the demo to start", 240)
            await _operator(browser, run, to)
            await until(lambda: "The server runs at" in run.output, "the demo to serve", 600)
            await _tablet(browser, run, to)
            await _phone(browser, run, to)
            await _home(browser, run, to)


if __name__ == "__main__":
    pictures = Path(__file__).resolve().parents[2] / "docs" / "pictures"
    asyncio.run(main(Path(sys.argv[1]) if len(sys.argv) > 1 else pictures))
