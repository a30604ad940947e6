"""Languages: chosen in the settings, stored with the user, switched without reload; texts of every screen fit."""

import re
from collections.abc import AsyncIterator

import pytest
import pytest_asyncio
from playwright.async_api import Browser, Page, expect

from arcor2_hw.data.project import Project
from arcor2_hw.data.scene import Scene
from tests.e2e.harness import Cell
from tests.editor import texts
from tests.editor.pseudo import LOCALE, PseudoWords, names_in, untranslated, use_pseudo_locale
from tests.editor.screen import VIEWPORTS, Screen, screen_of
from tests.editor.tour import Tour
from tests.editor.words import Words

pytestmark = pytest.mark.asyncio(loop_scope="session")

DEFINED_BY_DEVICES = {
    *(f"{name} joint" for name in ("shoulder pan", "shoulder lift", "elbow", "wrist 1", "wrist 2", "wrist 3")),
    *("tcp", "gripper"),
    *("bgr", "jpeg"),
    "ur5e.zip",
}
"""Names in models of robots, and values of settings."""
GERMAN, CZECH = Words("de"), Words("cs")


@pytest_asyncio.fixture(scope="module", loop_scope="session")
async def documents(module_cell: Cell) -> AsyncIterator[tuple[Scene, Project]]:
    """The scene and project of three devices, saved and closed."""
    client = await module_cell.client("colleague")
    scene, project = await module_cell.open(client)
    await client.call("CloseProject")
    yield scene, project


async def choose(page: Page, words: Words, language: str) -> None:
    await page.get_by_role("button", name=words(texts.SETTINGS), exact=True).click()
    await page.get_by_role("menuitem", name=language).click()


async def test_language_follows_the_browser_and_is_then_stored_with_the_user(
    module_cell: Cell, documents: tuple[Scene, Project], browser: Browser
) -> None:
    _, project = documents
    html = "() => document.documentElement.lang"
    async with screen_of(browser, module_cell.url, locale="de-AT") as screen:
        page = screen.page
        await page.goto(f"{screen.url}/?q=low")
        await page.get_by_label(GERMAN(texts.YOUR_NAME)).fill("Jana")
        assert await page.evaluate(html) == "de"
        await page.get_by_role("button", name=GERMAN(texts.JOIN), exact=True).click()
        await page.get_by_role("button", name=GERMAN("Open {name}", name=project.name)).click()
        await screen.item(project.action_points[0].id)
        # Numbers have a decimal comma; typed ones may have either.
        point = project.action_points[0]
        tools = page.get_by_role("navigation")
        await tools.get_by_role("button", name=GERMAN(texts.OBJECTS), exact=True).click()
        await page.get_by_role("row", name=f"{point.name} {GERMAN('Action point')}", exact=True).click()
        number = page.get_by_role("button", name=re.compile(r"^X [\d.,]+ mm"))
        for typed in ("400.25", "400,5"):
            await number.click()
            await page.keyboard.type(typed)
            await page.keyboard.press("Enter")
            await expect(number).to_have_text(f"{typed.replace('.', ',')} mm")
        # Switched where the user is, without a reload: the view stays as it is.
        await page.evaluate("() => { window.sameEngine = window.__engine; }")
        await choose(page, GERMAN, "English")
        await tools.get_by_role("button", name=texts.POINTS, exact=True).wait_for()
        await expect(number).to_have_text("400.5 mm")
        await choose(page, Words("en"), "Čeština")
        await tools.get_by_role("button", name=CZECH(texts.POINTS), exact=True).wait_for()
        assert await page.evaluate(html) == "cs"
        assert await page.evaluate("() => window.sameEngine === window.__engine")
        await page.get_by_role("button", name=CZECH(texts.CLOSE_DOCUMENT), exact=True).click()
        await page.get_by_role("button", name=CZECH(texts.DISCARD_CHANGES)).click()
        await page.get_by_role("heading", name=CZECH(texts.HOME_HEADING)).wait_for()
    # On another device of the user, whose browser is in English.
    async with screen_of(browser, module_cell.url) as screen:
        await screen.join("Jana")
        await screen.page.get_by_role("heading", name=CZECH(texts.HOME_HEADING)).wait_for()
        await screen.page.reload()
        await screen.page.get_by_role("heading", name=CZECH(texts.HOME_HEADING)).wait_for()


class Fit:
    """Collects texts that are cut off, and controls that are covered or off the screen, on a tablet and on a phone."""

    def __init__(self, screen: Screen, language: str) -> None:
        self.screen = screen
        self.language = language
        self.found: list[str] = []
        self._sizes = ["ipad", "phone"]

    async def look(self, shown: str) -> None:
        """Check the screen in both sizes; the next one is opened in the size of the second."""
        for size in self._sizes:
            await self.screen.page.set_viewport_size(VIEWPORTS[size])  # type: ignore[arg-type]
            await self.screen.settle()
            faults = [*await self.screen.clipped(), *await self.screen.faults()]
            # Labels in the view are names of items, the same in every language.
            self.found += [f"{shown}, {size}: {fault}" for fault in faults if not fault.startswith("labels ")]
            await self.screen.picture(f"{self.language} {shown} {size}")
        self._sizes.reverse()


async def test_all_texts_are_translated_and_longer_ones_fit(
    module_cell: Cell, documents: tuple[Scene, Project], browser: Browser
) -> None:
    names = names_in(*documents) | {"Pseudo", "PS", "colleague", "CO"} | DEFINED_BY_DEVICES
    async with screen_of(browser, module_cell.url, "ipad", touch=True, locale=LOCALE) as screen:
        await use_pseudo_locale(screen.page)
        fit = Fit(screen, "pseudo")
        async for shown in Tour(screen, PseudoWords(), *documents).all("Pseudo"):
            fit.found += [f"{shown}: not translated: {text}" for text in await untranslated(screen.page, names)]
            await fit.look(shown)
        assert not fit.found, "\n".join(fit.found)


@pytest.mark.parametrize("language", ["cs", "de"])
async def test_no_text_is_cut_off(
    module_cell: Cell, documents: tuple[Scene, Project], browser: Browser, language: str
) -> None:
    async with screen_of(browser, module_cell.url, "ipad", touch=True, locale=language) as screen:
        fit = Fit(screen, language)
        async for shown in Tour(screen, Words(language), *documents).all(f"Eva-{language}"):
            await fit.look(shown)
        assert not fit.found, "\n".join(fit.found)
