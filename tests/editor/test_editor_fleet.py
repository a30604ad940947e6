"""The page with all cells: a cell starts without a broker, appears, is opened, left again, and loses its signal."""

import re
from pathlib import Path

import pytest
from playwright.async_api import Browser, expect

from tests.editor.screen import FONTS, screen_of
from tests.server.core.serving import running
from tests.server.fleet.broker import Server, free_port
from tests.server.fleet.test_results import FleetProcess

pytestmark = pytest.mark.asyncio(loop_scope="session")
NOT_REACHED = "the broker is not reached"


async def test_a_tablet_moves_between_workplaces(browser: Browser, built_editor: Path, tmp_path: Path) -> None:
    port = free_port()
    fleet = FleetProcess(f"nats://fleet:f@127.0.0.1:{port}", tmp_path / "fleet")
    environment = {
        "ARCOR2_HW_FLEET_NATS_URL": f"nats://cell:c@127.0.0.1:{port}",
        "ARCOR2_HW_CELL_NAME": "press-3",
        "ARCOR2_HW_FLEET_ADDRESS": fleet.url,
    }
    broker: Server | None = None
    try:
        async with screen_of(browser, fleet.url, "phone") as screen:
            async with running(tmp_path / "cell", **environment) as cell:
                # Without a broker, the cell works and says so once.
                async with screen_of(browser, cell.url, "phone") as alone:
                    await alone.join("Eva")
                    await expect(alone.page.get_by_text("press-3")).to_be_visible()
                await screen.page.goto(fleet.url)
                await screen.sees("The broker is not connected")
                broker = Server(tmp_path / "broker", "hub", port=port)
                card = screen.page.get_by_role("link", name="press-3")
                await expect(card).to_be_visible()
                assert cell.log.read_text().count(NOT_REACHED) == 1
                assert await screen.faults_with(FONTS) == []
                assert await screen.barriers() == []
                await screen.picture("fleet phone")

                # The card opens the cell, which shows its name and the way back.
                await card.click()
                await expect(screen.page).to_have_url(re.compile(r"#/operator$"))
                await screen.page.get_by_label("Your name").fill("Eva")
                await screen.page.get_by_role("button", name="Join").click()
                back = screen.page.get_by_role("button", name="press-3: show all workplaces")
                await expect(back).to_be_visible()
                await expect(screen.page).to_have_title("press-3")
                assert await screen.faults_with(FONTS) == []
                await screen.picture("operator of a named cell")
                await back.click()
                await expect(card).to_be_visible()
            # The cell has ended.
            await expect(screen.page.locator('.fleet-card[data-level="gone"]')).to_contain_text("No signal since")
            await screen.page.get_by_role("button", name="Remove press-3 from this page").click()
            await screen.sees("No cells yet")
    finally:
        fleet.kill()
        if broker is not None:
            broker.kill()
