"""A person at a browser: Chromium on the real server's page, what stands on the screen, and what is wrong with it."""

import contextlib
import os
import shutil
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any, Final

from playwright.async_api import Browser, ConsoleMessage, Error, Page, async_playwright, expect

ARGUMENTS: Final = [
    "--no-sandbox",  # containers seldom allow one
    "--disable-background-networking",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
]
VIEWPORTS: Final = {
    "tablet": {"width": 1280, "height": 800},
    "ipad": {"width": 1180, "height": 820},
    "small tablet": {"width": 1024, "height": 768},
    "desktop": {"width": 1920, "height": 1080},
    "portrait": {"width": 800, "height": 1280},
    "phone": {"width": 390, "height": 844},
}
PICTURES: Final = os.environ.get("ARCOR2_HW_PICTURES")
"""Directory into which `Screen.picture` writes, for somebody who wants to look; none: nowhere."""
SEEN_WITHIN: Final = 30.0
"""Seconds for something to be on the screen: software rendering on a busy machine is slow."""
SMALLEST: Final = 44
"""CSS pixels of the smaller side of what is touched."""

_BEHIND: Final = Path(__file__).with_name("behind.sh")
_LAYOUT: Final = Path(__file__).with_name("layout.js").read_text()
_AXE: Final = Path(__file__).resolve().parents[2] / "editor" / "node_modules" / "axe-core" / "axe.min.js"
_RULES: Final = """async () => {
  const tags = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa"];
  const { violations } = await axe.run(document, { runOnly: tags, resultTypes: ["violations"] });
  const grave = violations.filter((each) => each.impact === "serious" || each.impact === "critical");
  return grave.flatMap((each) => each.nodes.map((node) => `${each.id}: ${node.html.slice(0, 160)} ${
    node.any[0]?.message ?? each.help}`));
}"""


def chromium() -> str:
    """The browser that `make test` installs."""
    found = shutil.which("chromium") or shutil.which("chromium-browser")
    assert found, "no chromium: `make test` installs it where it may"
    return found


@asynccontextmanager
async def running_browser(*, behind: bool = False) -> AsyncIterator[Browser]:
    """Chromium; `behind`: what it draws in software waits for others that are at work."""
    async with async_playwright() as playwright:
        path = _BEHIND if behind else chromium()
        browser = await playwright.chromium.launch(executable_path=path, args=ARGUMENTS)
        try:
            yield browser
        finally:
            await browser.close()


class Screen:
    """One page. `errors` are what the page reported; a test ends by looking that there are none (`screen_of` does)."""

    def __init__(self, page: Page, url: str) -> None:
        self.page = page
        self.url = url
        self.errors: list[str] = []
        self.expected_errors: tuple[str, ...] = ()
        page.set_default_timeout(SEEN_WITHIN * 1000)
        page.on("pageerror", lambda error: self.errors.append(f"{error}"))
        page.on("console", self._console)

    def _console(self, message: ConsoleMessage) -> None:
        if message.type == "error":
            self.errors.append(message.text)

    async def join(self, name: str) -> None:
        """Open the page and come in under a name."""
        await self.page.goto(f"{self.url}/?q=low")
        await self.page.get_by_label("Your name").fill(name)
        await self.press("Join")

    async def press(self, name: str) -> None:
        await self.page.get_by_role("button", name=name, exact=True).click()

    async def sees(self, text: str) -> None:
        await expect(self.page.get_by_text(text).first).to_be_visible(timeout=SEEN_WITHIN * 1000)

    async def until(self, expression: str, argument: Any = None) -> Any:
        """Wait until a JavaScript expression or function gives something true; gives that."""
        handle = await self.page.wait_for_function(expression, arg=argument, timeout=SEEN_WITHIN * 1000)
        return await handle.json_value()

    async def item(self, item_id: str) -> dict[str, Any]:
        """What the 3D view shows of a thing, once it does."""
        await self.until("id => window.__engine?.item(id) !== undefined", item_id)
        found: dict[str, Any] = await self.page.evaluate("id => window.__engine.item(id)", item_id)
        return found

    async def tap(self, item_id: str) -> None:
        """Tap where a thing is drawn."""
        await self.item(item_id)
        at = await self.until("id => window.__engine.item(id).visible && window.__engine.item(id).screen", item_id)
        box = await self.page.locator(".view canvas").bounding_box()
        assert box is not None
        await self.page.mouse.click(box["x"] + at["x"], box["y"] + at["y"])

    async def settle(self) -> None:
        """Let the page lay itself out and draw, and colours that change have changed."""
        await self.page.evaluate(
            """async () => {
                await new Promise((done) => setTimeout(() => requestAnimationFrame(done), 60));
                const ends = (each) => each.effect.getComputedTiming().endTime !== Infinity;
                await Promise.allSettled(document.getAnimations().filter(ends).map((each) => each.finished));
            }"""
        )

    async def frames(self) -> int:
        return int(await self.page.evaluate("window.__engine.frames"))

    async def faults(self) -> list[str]:
        """What is too small, off the screen, covered or overlapping."""
        return list(await self.page.evaluate(_LAYOUT, SMALLEST))

    async def barriers(self) -> list[str]:
        """What axe calls serious or critical for somebody who sees, hears or moves otherwise (WCAG 2.2, A and AA)."""
        if not await self.page.evaluate("() => 'axe' in window"):
            await self.page.evaluate(_AXE.read_text())
        return list(await self.page.evaluate(_RULES))

    async def picture(self, name: str) -> None:
        if PICTURES:
            Path(PICTURES).mkdir(parents=True, exist_ok=True)
            (Path(PICTURES) / f"{name}.png").write_bytes(await self.page.screenshot())

    def unexpected(self) -> list[str]:
        return [error for error in self.errors if not any(each in error for each in self.expected_errors)]


@asynccontextmanager
async def screen_of(
    browser: Browser,
    url: str,
    viewport: str = "tablet",
    *,
    dark: bool = False,
    touch: bool = False,
    reduced_motion: bool = False,
    text_scale: float = 1.0,
) -> AsyncIterator[Screen]:
    """A browser of somebody's own: no other's cookies or memory. `url` is that of the server, as ws or http."""
    context = await browser.new_context(
        viewport=VIEWPORTS[viewport],  # type: ignore[arg-type]
        color_scheme="dark" if dark else "light",
        has_touch=touch,
        reduced_motion="reduce" if reduced_motion else "no-preference",
        service_workers="block",
    )
    try:
        screen = Screen(await context.new_page(), url.replace("ws", "http", 1) if url.startswith("ws") else url)
        if text_scale != 1.0:
            scaled = f"document.documentElement.style.fontSize = '{100 * text_scale}%'"
            await screen.page.add_init_script(f"document.addEventListener('DOMContentLoaded', () => {{ {scaled} }})")
        try:
            yield screen
        except BaseException:
            with contextlib.suppress(Error):
                await screen.picture("failed")
            raise
        assert not (told := screen.unexpected()), f"the page told errors: {told}"
    finally:
        with contextlib.suppress(Error):  # the browser is gone, which the test has told
            await context.close()
