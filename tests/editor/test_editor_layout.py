"""Layout of every screen, light and dark, with large text and with a wide font; with `--matrix` also a narrow font.

No control may be too small, covered, off the screen or overlapping on a phone and on a tablet in both orientations, and
with `--matrix` in all sizes. Accessibility violations (axe) are checked in one size, alternately in light and dark.
"""

from collections.abc import AsyncIterator, Iterable
from contextlib import asynccontextmanager

import pytest
import pytest_asyncio
from playwright.async_api import Browser

from arcor2_hw.data.project import Project
from tests.e2e.harness import Cell
from tests.editor import texts
from tests.editor.screen import FONTS, SERVER_GONE, VIEWPORTS, Screen, screen_of

pytestmark = pytest.mark.asyncio(loop_scope="session")


@pytest_asyncio.fixture(scope="module", loop_scope="session")
async def project(module_cell: Cell) -> AsyncIterator[Project]:
    """The project of three devices, saved and closed."""
    client = await module_cell.client("colleague")
    _, project = await module_cell.open(client)
    await client.call("CloseProject")
    yield project


@pytest_asyncio.fixture(scope="module", loop_scope="session")
async def opened(module_cell: Cell, project: Project, browser: Browser) -> AsyncIterator[Screen]:
    """The project open on a tablet, which several tests use after each other."""
    async with screen_of(browser, module_cell.url, touch=True) as screen:
        screen.expected_errors = SERVER_GONE
        await join_and_open(screen, "Adam", project)
        yield screen


FEW = ("tablet", "phone")
"""Sizes for screens that differ only in their panel: at the side or a sheet at the bottom."""


@pytest.fixture(scope="module", autouse=True)
def narrow_font(pytestconfig: pytest.Config) -> None:
    ScreenFaults.narrow = pytestconfig.getoption("--matrix")


class ScreenFaults:
    """Collects the layout faults of each screen, alternately in dark and light colours."""

    narrow = False
    """Whether the narrow font is used, too."""

    def __init__(self, screen: Screen, *, dark: bool = True) -> None:
        self.screen = screen
        self.faults: dict[str, list[str]] = {}
        self._dark = not dark

    async def check(self, label: str, sizes: Iterable[str]) -> None:
        """Check the screen in these sizes."""
        page = self.screen.page
        self._dark = not self._dark
        await page.emulate_media(color_scheme="dark" if self._dark else "light")
        few = [each for each in sizes if each in FEW] if self.narrow else []
        for font, in_sizes in {"wide": list(sizes), "narrow": few}.items():
            if not in_sizes:
                continue
            await self.screen.use_font(font)
            for name in in_sizes:
                await page.set_viewport_size(VIEWPORTS[name])  # type: ignore[arg-type]
                await self.screen.settle()
                await self._note(f"{label}, {name}, {font} font", await self.screen.faults())
                if font == "wide":
                    await self.screen.picture(f"{label} {name}{' dark' if self._dark else ''}")
        await self.screen.use_font()
        await page.set_viewport_size(VIEWPORTS["tablet"])  # type: ignore[arg-type]
        await self.screen.settle()
        await self._note(f"{label}, {'dark' if self._dark else 'light'}", await self.screen.barriers())

    async def check_with_large_text(self, label: str) -> None:
        """Check the screen with text of twice the size."""
        page = self.screen.page
        await page.evaluate("() => { document.documentElement.style.fontSize = '200%'; }")
        await self.screen.settle()
        await self._note(f"{label}, large text", await self.screen.faults_with(FONTS))
        await self.screen.picture(f"{label} large text")
        await page.evaluate("() => { document.documentElement.style.fontSize = ''; }")

    def report(self) -> str:
        return "\n".join(f"{where}: {fault}" for where, faults in self.faults.items() for fault in faults)

    async def _note(self, where: str, faults: list[str]) -> None:
        if faults:
            self.faults[where] = faults


async def join_and_open(screen: Screen, name: str, project: Project) -> None:
    """Join, and open the project unless it is open."""
    await screen.join(name)
    if await screen.until("() => document.querySelector('.home, .workplace')?.className") == "home":
        await screen.press(texts.open_document(project.name))
    await screen.item(project.action_points[0].id)


async def open_tool(screen: Screen, name: str) -> None:
    await screen.page.get_by_role("navigation").get_by_role("button").filter(has_text=name).click()
    await screen.page.get_by_role("complementary").get_by_role("heading", name=name, exact=True).wait_for()


async def go_online(screen: Screen) -> None:
    if await screen.page.get_by_role("button", name=texts.GO_ONLINE).is_visible():
        await screen.press(texts.GO_ONLINE)
    await screen.page.get_by_role("button", name=texts.STOP_MOTION).wait_for(timeout=60_000)


async def test_join_and_home_screens_have_no_layout_faults(
    module_cell: Cell, project: Project, browser: Browser, sizes: list[str]
) -> None:
    async with screen_of(browser, module_cell.url, touch=True) as screen:
        found = ScreenFaults(screen)
        page = screen.page
        await page.goto(f"{screen.url}/?q=low")
        await page.get_by_label(texts.YOUR_NAME).wait_for()
        await found.check("join", sizes)
        await found.check_with_large_text("join")
        await page.get_by_label(texts.YOUR_NAME).fill("colleague")
        await screen.press(texts.JOIN)
        await screen.sees("already in use")
        await found.check("join refused", FEW)
        await screen.join("Eva")
        await screen.sees("on PCB testing")
        await found.check("home", sizes)
        await found.check_with_large_text("home")
        await page.get_by_role("radio", name=texts.SCENES).click()
        await screen.press(texts.NEW_SCENE)
        await page.get_by_role("dialog").wait_for()
        await found.check("dialog", FEW)
        await page.keyboard.press("Escape")
        await page.get_by_role("radio", name=texts.PACKAGES).click()
        await found.check("empty list", FEW)
        assert not found.faults, found.report()


@asynccontextmanager
async def on_tablet(screen: Screen, *, dark: bool) -> AsyncIterator[tuple[Screen, ScreenFaults]]:
    """Close all panels. `dark`: colours of the first screen. Fails at the end if the layout had faults."""
    await screen.page.set_viewport_size(VIEWPORTS["tablet"])  # type: ignore[arg-type]
    await screen.close_panels()
    found = ScreenFaults(screen, dark=dark)
    yield screen, found
    assert not found.faults, found.report()


async def test_workplace_has_no_layout_faults(opened: Screen, sizes: list[str]) -> None:
    async with on_tablet(opened, dark=True) as (_, found):
        await found.check("workplace", sizes)
        await found.check_with_large_text("workplace")


async def test_tool_panels_have_no_layout_faults(opened: Screen) -> None:
    async with on_tablet(opened, dark=False) as (screen, found):
        for name in texts.TOOLS:
            await open_tool(screen, name)
            await found.check(name.lower(), FEW)


async def test_selection_panels_have_no_layout_faults(opened: Screen, project: Project) -> None:
    async with on_tablet(opened, dark=False) as (screen, found):
        page = screen.page
        action = project.action_points[0].actions[0].name
        point = project.action_points[0].name
        for name, kind, label in ((point, "Action point", "point"), (action, "Action", "action")):
            await open_tool(screen, texts.OBJECTS)
            await page.get_by_role("row", name=f"{name} {kind}", exact=True).click()
            await page.get_by_role("complementary").get_by_role("heading", name=name, exact=True).wait_for()
            await page.evaluate("document.querySelectorAll('details').forEach((each) => { each.open = true; })")
            await found.check(f"{label} selected", FEW)
            await screen.press(texts.CLOSE_PANEL)


async def test_search_and_views_have_no_layout_faults(opened: Screen, project: Project) -> None:
    async with on_tablet(opened, dark=False) as (screen, found):
        page = screen.page
        action = project.action_points[0].actions[0].name
        # Search by name.
        await page.keyboard.press("/")
        search = page.get_by_role("dialog", name="Find a command or an object")
        await search.get_by_role("option", name="Show all in the view").wait_for()
        await found.check("search", FEW)
        await page.keyboard.type(f"{action} act")
        await search.get_by_role("option").first.get_by_text(action, exact=True).wait_for()
        await page.keyboard.press("ArrowDown")
        await page.keyboard.press("Enter")
        await page.get_by_role("complementary").get_by_role("heading", name=action, exact=True).wait_for()
        await screen.press(texts.CLOSE_PANEL)
        for name in ("Flow", "Code", "3D"):
            await page.get_by_role("radio", name=name, exact=True).click()
            await screen.settle()
            await found.check(f"shown as {name}", FEW)


async def test_online_workplace_has_no_layout_faults(opened: Screen, sizes: list[str]) -> None:
    async with on_tablet(opened, dark=False) as (screen, found):
        await go_online(screen)
        await open_tool(screen, texts.ROBOT)
        await found.check("online", sizes)


async def test_left_handed_controls_have_no_layout_faults(opened: Screen, sizes: list[str]) -> None:
    async with on_tablet(opened, dark=True) as (screen, found):
        page = screen.page
        await go_online(screen)
        await open_tool(screen, texts.ROBOT)
        await screen.press(texts.SETTINGS)
        await page.get_by_role("menuitem", name="Left-handed controls").click()
        await found.check("left hand", sizes)
        await page.set_viewport_size(VIEWPORTS["phone"])  # type: ignore[arg-type]
        await screen.press(texts.LARGER_PANEL)
        await found.check("large panel", ("phone", "portrait"))
        await page.set_viewport_size(VIEWPORTS["phone"])  # type: ignore[arg-type]
        await page.get_by_role("button", name=texts.SMALLER_PANEL).click(trial=True)
        await page.get_by_role("button", name=texts.STOP_MOTION).click(trial=True)
        await page.get_by_role("button", name="Views", exact=True).click(trial=True)


async def test_reduced_motion_stops_animations(module_cell: Cell, project: Project, browser: Browser) -> None:
    async with screen_of(browser, module_cell.url, reduced_motion=True) as screen:
        await join_and_open(screen, "Berta", project)
        await screen.press(texts.OBJECTS)
        # Spinners are exempt.
        running = """() => document.getAnimations()
            .filter((each) => each.playState === "running" && !each.effect.target.matches(".spinner")).map(String)"""
        assert await screen.page.evaluate(running) == []


async def test_screen_without_a_server_has_no_layout_faults(
    module_cell: Cell, project: Project, browser: Browser, sizes: list[str]
) -> None:
    async with screen_of(browser, module_cell.url, touch=True) as screen:
        screen.expected_errors = SERVER_GONE
        await join_and_open(screen, "Cecil", project)
        if await (offline := screen.page.get_by_role("button", name=texts.GO_OFFLINE)).is_visible():
            await offline.click()
            await screen.page.get_by_role("button", name=texts.GO_ONLINE).wait_for()
        await screen.page.wait_for_load_state("networkidle")  # all lazily loaded parts are loaded
        await module_cell.kill("server")
        await screen.sees(texts.NO_CONNECTION)
        found = ScreenFaults(screen)
        await found.check("lost server", sizes)
        assert not found.faults, found.report()
