"""A user at a browser: Chromium with the server's page, what it shows, and its layout faults."""

import contextlib
import os
import re
import shutil
from base64 import b64encode
from collections.abc import AsyncIterator, Iterable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any, Final
from weakref import WeakKeyDictionary

from playwright.async_api import Browser, BrowserContext, ConsoleMessage, Error, Page, async_playwright, expect

from tests.editor import texts

ARGUMENTS: Final = [
    "--no-sandbox",  # containers seldom allow a sandbox
    "--disable-background-networking",
    "--disable-gpu",  # the page is composed without OpenGL, which halves the processor time on machines without a GPU
    "--enable-unsafe-swiftshader",  # WebGL in software
]
SELDOM_OPTIMISED: Final = "--js-flags=--invocation-count-for-maglev=4000,--invocation-count-for-turbofan=30000"
"""Optimise functions after ten times the usual number of calls. In a test, few are called often enough to repay their
compilation, a fifth of the page's processor time."""
VIEWPORTS: Final = {
    "tablet": {"width": 1280, "height": 800},
    "ipad": {"width": 1180, "height": 820},
    "small tablet": {"width": 1024, "height": 768},
    "desktop": {"width": 1920, "height": 1080},
    "portrait": {"width": 800, "height": 1280},
    "phone": {"width": 390, "height": 844},
}
PICTURES: Final = os.environ.get("ARCOR2_HW_PICTURES")
"""Directory for the screenshots of `Screen.picture`. Unset: none are taken."""
SEEN_WITHIN: Final = 30.0
"""Timeout for something to appear on the screen, s. Software rendering on a busy machine is slow."""
SMALLEST: Final = 44
"""Smallest side of a control, CSS pixels."""
expect.set_options(timeout=SEEN_WITHIN * 1000)
SERVER_GONE: Final = ("WebSocket connection to", "net::ERR_CONNECTION_", "net::ERR_CONTENT_LENGTH_MISMATCH")
"""Errors that Chromium logs when the server is killed while the page is connected or still loads a file."""
USERS: Final = set[str]()
"""Names of the users who have joined since the workplace was reset."""

MAX_FREE: Final = 3
"""Largest number of browser contexts that are cached for later screens."""
_FREE: Final = WeakKeyDictionary[Browser, list[tuple[tuple[bool, str], BrowserContext]]]()
"""Contexts that no screen uses, with touch and locale, of each browser that reuses contexts."""

FONTS: Final = {"narrow": "62%", "wide": "125%"}
"""Two fonts for layout tests, by their width: narrower and wider than the usual fonts of machines."""

_NODE_MODULES: Final = Path(__file__).resolve().parents[2] / "editor" / "node_modules"
_ARCHIVO: Final = _NODE_MODULES / "@fontsource-variable" / "archivo" / "files" / "archivo-latin-wdth-normal.woff2"
_FONT: Final = Path(__file__).with_name("font.js").read_text()
_LOW_PRIORITY: Final = Path(__file__).with_name("low_priority.sh")
_LAYOUT: Final = Path(__file__).with_name("layout.js").read_text()
_CLIPPED: Final = Path(__file__).with_name("clipped.js").read_text()
_AXE: Final = _NODE_MODULES / "axe-core" / "axe.min.js"
_UNDRAWN: Final = """
window.__drawn = { frame: -1, calls: 0, triangles: 0, most: { calls: 0, triangles: 0 } };
window.__drawing = false;
const drawn = (mode, indices, instances = 1) => {
  const tally = window.__drawn, frame = window.__engine?.frames ?? 0;
  if (frame !== tally.frame) Object.assign(tally, { frame, calls: 0, triangles: 0 });
  tally.calls += 1;
  if (mode === WebGL2RenderingContext.TRIANGLES) tally.triangles += (indices / 3) * instances;
  for (const key of ["calls", "triangles"]) tally.most[key] = Math.max(tally.most[key], tally[key]);
};
const counted = {
  clear: () => {},
  drawArrays: (mode, first, count) => drawn(mode, count),
  drawArraysInstanced: (mode, first, count, instances) => drawn(mode, count, instances),
  drawElements: (mode, count) => drawn(mode, count),
  drawElementsInstanced: (mode, count, type, offset, instances) => drawn(mode, count, instances),
};
for (const [name, count] of Object.entries(counted)) {
  const draw = WebGL2RenderingContext.prototype[name];
  WebGL2RenderingContext.prototype[name] = function (...given) {
    return window.__drawing ? draw.apply(this, given) : count(...given);
  };
}
// The drawing buffer keeps its first size: a new one takes more time than all other work of a frame that is not drawn.
for (const side of ["width", "height"]) {
  const { get, set } = Object.getOwnPropertyDescriptor(HTMLCanvasElement.prototype, side);
  const wanted = new WeakMap();
  Object.defineProperty(HTMLCanvasElement.prototype, side, {
    configurable: true,
    get() {
      return wanted.get(this) ?? get.call(this);
    },
    set(size) {
      if (this.dataset.engine && !window.__xrOptions) wanted.set(this, size);
      else set.call(this, size);
    },
  });
}"""
_RULES: Final = """async () => {
  const tags = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa"];
  const { violations } = await axe.run(document, { runOnly: tags, resultTypes: ["violations"] });
  const grave = violations.filter((each) => each.impact === "serious" || each.impact === "critical");
  return grave.flatMap((each) => each.nodes.map((node) => `${each.id}: ${node.html.slice(0, 160)} ${
    node.any[0]?.message ?? each.help}`));
}"""


def chromium() -> str:
    """Return the path of the browser that `make test` installs."""
    found = filter(None, map(shutil.which, ("chromium-headless-shell", "chromium", "chromium-browser")))
    if not (path := next(found, None)):
        raise FileNotFoundError("Chromium is not installed. Run `make .make/browser`.")
    return path


@asynccontextmanager
async def running_browser(
    *more: str, low_priority: bool = False, reuse_contexts: bool = False
) -> AsyncIterator[Browser]:
    """Run Chromium with additional arguments.

    Args:
        more: additional arguments.
        low_priority: run the browser with a low priority, so that software rendering does not delay drivers and fakes.
        reuse_contexts: let later screens use the contexts again. Their code and process stay cached, which halves the
            processor time of loading the page. Cookies and storage are cleared. Less code is optimised. Measurements
            need new contexts.
    """
    if reuse_contexts:
        more = (*more, "--renderer-process-limit=1", SELDOM_OPTIMISED)  # one process for each context
    async with async_playwright() as playwright:
        path = _LOW_PRIORITY if low_priority else chromium()
        environment: dict[str, str | float | bool] = {**os.environ, "BROWSER": chromium()}
        browser = await playwright.chromium.launch(executable_path=path, args=[*ARGUMENTS, *more], env=environment)
        if reuse_contexts:
            _FREE[browser] = []
        try:
            yield browser
        finally:
            await browser.close()


class Screen:
    """One page. `errors` collects the page's errors; `screen_of` fails a test that leaves unexpected ones."""

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

    async def join(self, name: str, address: str = "/?q=low") -> None:
        """Open the page and join under a name."""
        USERS.add(name)
        await self.page.goto(f"{self.url}{address}")
        await self.page.get_by_label(texts.YOUR_NAME).fill(name)
        await self.press(texts.JOIN)

    async def press(self, name: str) -> None:
        await self.page.get_by_role("button", name=name, exact=True).click()

    async def sees(self, text: str | re.Pattern[str]) -> None:
        await expect(self.page.get_by_text(text).first).to_be_visible()

    async def until(self, expression: str, argument: Any = None) -> Any:
        """Wait until a JavaScript expression or function returns a true value, and return it."""
        handle = await self.page.wait_for_function(expression, arg=argument, timeout=SEEN_WITHIN * 1000, polling=50)
        return await handle.json_value()

    async def item(self, item_id: str) -> dict[str, Any]:
        """Wait until the 3D view shows an item, and return its state."""
        await self.until("id => window.__engine?.item(id) !== undefined", item_id)
        found: dict[str, Any] = await self.page.evaluate("id => window.__engine.item(id)", item_id)
        return found

    async def tap(self, item_id: str) -> None:
        """Tap the place where an item is drawn."""
        await self.item(item_id)
        at = await self.until("id => window.__engine.item(id).visible && window.__engine.item(id).screen", item_id)
        box = await self.page.locator(".view canvas").bounding_box()
        assert box is not None
        await self.page.mouse.click(box["x"] + at["x"], box["y"] + at["y"])

    async def settle(self) -> None:
        """Wait until the page is laid out, the 3D view is drawn at its present size, and animations have ended."""
        await self.page.evaluate(
            """async () => {
                const frame = () => new Promise((done) => requestAnimationFrame(done));
                await new Promise((done) => setTimeout(done, 60));
                await frame();
                await frame();
                const drawn = window.__engine?.frames;
                while (window.__engine?.scheduled && __engine.frames < drawn + 2) await frame();
                const ends = (each) => each.effect.getComputedTiming().endTime !== Infinity;
                await Promise.allSettled(document.getAnimations().filter(ends).map((each) => each.finished));
            }"""
        )

    async def close_panels(self) -> None:
        """Close the panels of the tool and of the selection."""
        close = self.page.get_by_role("button", name=texts.CLOSE_PANEL)
        while await close.count():
            await close.first.click()
            await self.settle()

    async def drawn(self) -> dict[str, int]:
        """Return the largest number of draw calls and of triangles of a frame so far, with `drawn=False`."""
        return dict(await self.page.evaluate("window.__drawn.most"))

    async def frames(self) -> int:
        return int(await self.page.evaluate("window.__engine.frames"))

    async def faults(self) -> list[str]:
        """Return which controls are too small, off the screen, covered or overlapping."""
        found = list(await self.page.evaluate(_LAYOUT, SMALLEST))
        if found:  # labels and clusters of the view move one frame after the layout
            await self.settle()
            found = list(await self.page.evaluate(_LAYOUT, SMALLEST))
        return found

    async def clipped(self) -> list[str]:
        """Return which texts of controls and headings are cut off."""
        return list(await self.page.evaluate(_CLIPPED))

    async def faults_with(self, fonts: Iterable[str]) -> list[str]:
        """Return the faults with each of these fonts, so that they do not depend on the machine's fonts."""
        found = []
        for name in fonts:
            await self.use_font(name)
            await self.settle()
            found += [f"{fault} ({name} font)" for fault in await self.faults()]
        await self.use_font()
        await self.settle()
        return found

    async def use_font(self, name: str = "") -> None:
        """Draw all texts with one of the `FONTS`, by default with those of the machine."""
        content = b64encode(_ARCHIVO.read_bytes()).decode() if name else ""
        await self.page.evaluate(_FONT, [content, name, FONTS.get(name, "")])

    async def barriers(self) -> list[str]:
        """Return the serious and critical accessibility violations that axe finds (WCAG 2.2, A and AA)."""
        if not await self.page.evaluate("() => 'axe' in window"):
            await self.page.evaluate(_AXE.read_text())
        return list(await self.page.evaluate(_RULES))

    async def picture(self, name: str) -> None:
        if PICTURES:
            Path(PICTURES).mkdir(parents=True, exist_ok=True)
            (Path(PICTURES) / f"{name}.png").write_bytes(await self.page.screenshot())

    def unexpected(self) -> list[str]:
        return [error for error in self.errors if not any(each in error for each in self.expected_errors)]


async def close_abandoned(browser: Browser) -> None:
    """Close the contexts of screens that are still open."""
    kept = [context for _, context in _FREE.get(browser, [])]
    for context in browser.contexts:
        if context not in kept:
            await context.close()


@asynccontextmanager
async def _new_page(browser: Browser, origin: str, *, touch: bool, locale: str) -> AsyncIterator[Page]:
    """Open a page in a browser context that no other screen uses, with empty storage.

    A context whose page failed or crashed is closed; its state is unknown.
    """
    free = _FREE.get(browser)
    kind = (touch, locale)
    found = next((each for each in reversed(free or []) if each[0] == kind), None)
    if free and found:
        free.remove(found)
        context = found[1]
    else:
        context = await browser.new_context(has_touch=touch, locale=locale, service_workers="block")
    crashes: list[Page] = []
    reusable = False
    try:
        if free is not None and not found:  # as long as this page is open, the process of the context stays
            await (await context.new_page()).goto(f"{origin}/editor/favicon.svg")
        page = await context.new_page()
        page.on("crash", lambda crashed: crashes.append(crashed))
        if found:
            await context.clear_cookies()
            devtools = await context.new_cdp_session(page)
            await devtools.send("Storage.clearDataForOrigin", {"origin": origin, "storageTypes": "all"})
            await devtools.detach()
        yield page
        if free is not None and not crashes:
            for opened in context.pages[1:]:
                await opened.close()
            free.append((kind, context))
            reusable = len(free) <= MAX_FREE
            context = context if reusable else free.pop(0)[1]
    finally:
        if not reusable:
            with contextlib.suppress(Error):  # the browser has crashed; the test fails already
                await context.close()


@asynccontextmanager
async def screen_of(
    browser: Browser,
    url: str,
    viewport: str = "tablet",
    *,
    drawn: bool = False,
    dark: bool = False,
    touch: bool = False,
    reduced_motion: bool = False,
    text_scale: float = 1.0,
    locale: str = "en-US",
) -> AsyncIterator[Screen]:
    """Open a page in a browser context that no other screen uses. `url` is that of the server, ws or http.

    Args:
        drawn: Whether the 3D view is drawn, for tests of its picture. Without it, WebGL clears and draws nothing, which
            saves a fifth of a test's processor time. All else is the same: items, picking, labels, counted frames.
    """
    origin = url.replace("ws", "http", 1) if url.startswith("ws") else url
    async with _new_page(browser, origin, touch=touch, locale=locale) as page:
        await page.set_viewport_size(VIEWPORTS[viewport])  # type: ignore[arg-type]
        await page.emulate_media(
            color_scheme="dark" if dark else "light", reduced_motion="reduce" if reduced_motion else "no-preference"
        )
        if not (drawn or PICTURES):
            await page.add_init_script(_UNDRAWN)
        if text_scale != 1.0:
            scaled = f"document.documentElement.style.fontSize = '{100 * text_scale}%'"
            await page.add_init_script(f"document.addEventListener('DOMContentLoaded', () => {{ {scaled} }})")
        screen = Screen(page, origin)
        try:
            yield screen
        except BaseException:
            with contextlib.suppress(Error):
                await screen.picture("failed")
            raise
        assert not (errors := screen.unexpected()), f"the page logged errors: {errors}"
