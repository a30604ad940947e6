"""The operator's screen in Chromium on the real server: packages, start, pause, stop, errors in plain words."""

from collections.abc import AsyncIterator

import pytest
import pytest_asyncio
from playwright.async_api import Browser, expect

from arcor2_hw.client import Client
from arcor2_hw.data import rpc
from arcor2_hw.data.package import PackageStateEnum
from tests.e2e.harness import Cell
from tests.editor.screen import VIEWPORTS, Screen, screen_of

pytestmark = [pytest.mark.asyncio(loop_scope="module"), pytest.mark.timeout(240)]

BEGUN = 60_000
"""ms until a program that was started is there."""


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def colleague(cell: Cell) -> AsyncIterator[Client]:
    yield await cell.client("colleague")


async def at_the_machine(screen: Screen, kiosk: bool = False) -> None:
    await screen.page.goto(f"{screen.url}/?q=low#/operator{'?kiosk' if kiosk else ''}")
    await screen.page.get_by_label("Your name").fill("Olga")
    await screen.press("Join")


async def test_what_is_built_appears_is_run_and_its_error_is_plain(
    cell: Cell, colleague: Client, browser: Browser
) -> None:
    async with screen_of(browser, cell.url, touch=True) as screen:
        page = screen.page
        await at_the_machine(screen, kiosk=True)
        await screen.sees("There is no package yet.")
        assert await page.get_by_role("button", name="To the editor").count() == 0
        # A colleague builds one: it is there without anything being pressed.
        _, project = await cell.open(colleague)
        await cell.build(colleague, project)
        await page.get_by_role("radio", name=project.name).wait_for()
        await screen.press("Start")
        await page.get_by_role("button", name="Stop motion").wait_for(timeout=BEGUN)
        # No board is there: the reader finds no code.
        trouble = page.get_by_role("alert").filter(has_text="It failed in scan")
        await trouble.wait_for(timeout=25000)
        await expect(trouble).to_contain_text("no code was read")
        await screen.sees("It stopped with an error")
        assert [each.end.value for each in (await colleague.call("ListRuns")).runs] == ["failed"]
        for name, size in VIEWPORTS.items():
            await page.set_viewport_size(size)  # type: ignore[arg-type]
            await screen.settle()
            assert await screen.faults() == [], name
            await screen.picture(f"operator {name}")


async def test_pause_go_on_and_stop(cell: Cell, colleague: Client, browser: Browser) -> None:
    (package,) = await colleague.call("ListPackages")
    async with screen_of(browser, cell.url) as screen:
        page = screen.page
        await at_the_machine(screen)
        # Somebody else has started it, paused: it can be stepped, taken on and stopped from here.
        await colleague.call("RunPackage", rpc.RunPackageArgs(package.id, start_paused=True))
        await page.get_by_text("before more_boards").wait_for(timeout=BEGUN)
        await screen.press("One action")
        await page.get_by_text("before scan").wait_for()
        await screen.press("Stop")
        while (await colleague.next_event("PackageState", timeout=20)).data.state is not PackageStateEnum.STOPPED:
            pass
        await page.get_by_role("button", name="Start", exact=True).wait_for()
        run = (await colleague.call("ListRuns")).runs[0]
        assert (run.end.value, run.stopped_by) == ("stopped", "Olga")
        await screen.press("To the editor")
        await page.get_by_role("heading", name="Workplace").wait_for()
