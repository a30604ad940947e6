"""Every screen in every size, light and dark, with large text: nothing too small, covered, off the screen, unreadable.

What is too small, covered, off the screen or overlapping is looked for in all sizes, and what stands in the way of who
sees, hears or moves otherwise (axe) once light and once dark.
"""

from collections.abc import AsyncIterator, Iterable

import pytest
import pytest_asyncio
from playwright.async_api import Browser

from arcor2_hw.data.project import Project
from tests.e2e.harness import Cell
from tests.editor.screen import VIEWPORTS, Screen, screen_of

pytestmark = [pytest.mark.asyncio(loop_scope="module"), pytest.mark.timeout(300)]


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def project(cell: Cell) -> AsyncIterator[Project]:
    """The project of three devices, saved and closed."""
    client = await cell.client("colleague")
    _, project = await cell.open(client)
    await client.call("CloseProject")
    yield project


FEW = ("phone", "tablet")
"""What differs from another screen by its panel alone: that is a sheet from below, or stands at the side."""


class Looks:
    """What is wrong with each screen that was looked at."""

    def __init__(self, screen: Screen) -> None:
        self.screen = screen
        self.found: dict[str, list[str]] = {}
        self._dark = False

    async def at(self, what: str, sizes: Iterable[str] = VIEWPORTS) -> None:
        """Look at what is on the screen, in every size, or in these."""
        page = self.screen.page
        self._dark = not self._dark
        await page.emulate_media(color_scheme="dark" if self._dark else "light")
        for name in sizes:
            await page.set_viewport_size(VIEWPORTS[name])  # type: ignore[arg-type]
            await self.screen.settle()
            await self._note(f"{what}, {name}", await self.screen.faults())
            await self.screen.picture(f"{what} {name}{' dark' if self._dark else ''}")
        await page.set_viewport_size(VIEWPORTS["tablet"])  # type: ignore[arg-type]
        await self.screen.settle()
        await self._note(f"{what}, {'dark' if self._dark else 'light'}", await self.screen.barriers())

    async def with_large_text(self, what: str) -> None:
        """Look again with letters twice as large."""
        page = self.screen.page
        await page.evaluate("() => { document.documentElement.style.fontSize = '200%'; }")
        await self.screen.settle()
        await self._note(f"{what}, large text", await self.screen.faults())
        await self.screen.picture(f"{what} large text")
        await page.evaluate("() => { document.documentElement.style.fontSize = ''; }")

    def told(self) -> str:
        return "\n".join(f"{where}: {fault}" for where, faults in self.found.items() for fault in faults)

    async def _note(self, where: str, faults: list[str]) -> None:
        if faults:
            self.found[where] = faults


async def at_the_project(screen: Screen, name: str, project: Project) -> None:
    """Come in, and open the project where nobody has."""
    await screen.join(name)
    if await screen.until("() => document.querySelector('.home, .workplace')?.className") == "home":
        await screen.press(f"Open {project.name}")
    await screen.item(project.action_points[0].id)


async def test_joining_and_the_lists(cell: Cell, project: Project, browser: Browser) -> None:
    async with screen_of(browser, cell.url, touch=True) as screen:
        looks = Looks(screen)
        page = screen.page
        await page.goto(f"{screen.url}/?q=low")
        await page.get_by_label("Your name").wait_for()
        await looks.at("join")
        await looks.with_large_text("join")
        await page.get_by_label("Your name").fill("colleague")
        await screen.press("Join")
        await screen.sees("already in use")
        await looks.at("join refused", FEW)
        await screen.join("Eva")
        await screen.sees("on PCB testing")
        await looks.at("home")
        await looks.with_large_text("home")
        await page.get_by_role("radio", name="Scenes").click()
        await screen.press("New scene")
        await page.get_by_role("dialog").wait_for()
        await looks.at("dialog", FEW)
        await page.keyboard.press("Escape")
        await page.get_by_role("radio", name="Packages").click()
        await looks.at("empty list", FEW)
        assert not looks.found, looks.told()


async def test_the_workplace(cell: Cell, project: Project, browser: Browser) -> None:
    async with screen_of(browser, cell.url, touch=True) as screen:
        looks = Looks(screen)
        page = screen.page
        await screen.join("Adam")
        await screen.press(f"Open {project.name}")
        await screen.item(project.action_points[0].id)
        await looks.at("workplace")
        await looks.with_large_text("workplace")
        tools = page.get_by_role("navigation").get_by_role("button")
        for name in ("Things", "Points", "Program", "Run", "Robot", "Devices"):
            await tools.filter(has_text=name).click()
            await page.get_by_role("complementary").get_by_role("heading", name=name, exact=True).wait_for()
            await looks.at(name.lower(), FEW)
        await tools.filter(has_text="Things").click()
        action = project.action_points[0].actions[0].name
        for name, what in ((f"{project.action_points[0].name} Action point", "point"), (f"{action} Action", "action")):
            await page.get_by_role("row", name=name, exact=True).click()
            await looks.at(f"{what} selected", FEW)
            await screen.press("Close the panel")
            await tools.filter(has_text="Things").click()
        await screen.press("Close the panel")
        # Everything is found by its name.
        await page.keyboard.press("/")
        search = page.get_by_role("dialog", name="Find a command or a thing")
        await search.get_by_role("option", name="Show all in the view").wait_for()
        await looks.at("search", FEW)
        await page.keyboard.type(f"{action} act")
        await search.get_by_role("option").first.get_by_text(action, exact=True).wait_for()
        await page.keyboard.press("ArrowDown")
        await page.keyboard.press("Enter")
        await page.get_by_role("complementary").get_by_role("heading", name=action, exact=True).wait_for()
        await screen.press("Close the panel")
        for name in ("Flow", "Code", "3D"):
            await page.get_by_role("radio", name=name, exact=True).click()
            await screen.settle()
            await looks.at(f"shown as {name}", FEW)
        await screen.press("Go online")
        await page.get_by_role("button", name="Stop motion").wait_for(timeout=60_000)
        await tools.filter(has_text="Robot").click()
        await looks.at("online")
        await screen.press("Settings")
        await page.get_by_role("menuitem", name="Controls for the left hand").click()
        await looks.at("left hand")
        await page.set_viewport_size(VIEWPORTS["phone"])  # type: ignore[arg-type]
        await screen.press("Make the panel larger")
        await looks.at("large panel", ("phone", "portrait"))
        await page.set_viewport_size(VIEWPORTS["phone"])  # type: ignore[arg-type]
        await page.get_by_role("button", name="Make the panel smaller").click(trial=True)
        await page.get_by_role("button", name="Stop motion").click(trial=True)
        await page.get_by_role("button", name="Views", exact=True).click(trial=True)
        assert not looks.found, looks.told()


async def test_nothing_moves_for_who_wants_no_motion(cell: Cell, project: Project, browser: Browser) -> None:
    async with screen_of(browser, cell.url, reduced_motion=True) as screen:
        await at_the_project(screen, "Berta", project)
        await screen.press("Things")
        # What turns slowly while something is awaited stays.
        running = """() => document.getAnimations()
            .filter((each) => each.playState === "running" && !each.effect.target.matches(".spinner")).map(String)"""
        assert await screen.page.evaluate(running) == []


async def test_without_the_server(cell: Cell, project: Project, browser: Browser) -> None:
    """Last: it ends the server."""
    async with screen_of(browser, cell.url, touch=True) as screen:
        screen.expected_errors = ("WebSocket connection to", "net::ERR_CONNECTION_")
        await at_the_project(screen, "Cecil", project)
        await screen.page.wait_for_load_state("networkidle")  # all parts of the page are there
        await cell.kill("server")
        await screen.sees("No connection to the server.")
        looks = Looks(screen)
        await looks.at("lost server")
        assert not looks.found, looks.told()
