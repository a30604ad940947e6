"""The fleet page lists the cells and reports a lost signal. Its other pages show the stored results of all cells."""

import re
from pathlib import Path

import msgspec
import pytest
from msgspec.structs import replace
from playwright.async_api import Browser, expect

from arcor2_hw.data.alarms import AlarmCategory, AlarmRecord, Priority
from arcor2_hw.data.base import now
from arcor2_hw.data.units import UnitState
from arcor2_hw.messages import Message
from arcor2_server.fleet.file import FILE, FleetFile, ReceivedResult
from arcor2_server.fleet.summaries import alarm_columns, unit_columns
from tests.editor.screen import FONTS, Screen, screen_of
from tests.ports import free_port
from tests.server.core.serving import running
from tests.server.fleet.broker import Server
from tests.server.fleet.cells import unit
from tests.server.fleet.test_reports import received
from tests.server.fleet.test_results import FleetProcess

pytestmark = pytest.mark.asyncio(loop_scope="session")
NOT_REACHED = "the broker is not reached"


def store_results(folder: Path) -> None:
    """Store a good and a bad unit, and an alarm whose driver has Czech texts."""
    folder.mkdir()
    file = FleetFile(folder / FILE)
    states = (UnitState.GOOD, UnitState.BAD)
    good, bad = (replace(unit(number, state=state), left=now()) for number, state in enumerate(states, 1))
    error = Message.of("No arc at {current}.", current="1.5 A")
    bad = replace(bad, steps=[replace(bad.steps[0], name="weld", error=error.text, **error.translation())])
    czech = {"cs": {error.key: "Žádný oblouk při {current}."}}
    alarm = AlarmRecord(3, "d-1", "no_part", Priority.HIGH, AlarmCategory.DEVICE, "No part.", now(), 3)
    columns = alarm_columns(alarm, {"cs": {"No part.": "Chybí díl."}}, 0)
    document = msgspec.json.encode(alarm)
    results = [
        received(good),
        received(bad)._replace(columns=unit_columns(bad, czech, 0)),
        ReceivedResult("oven", "b" * 32, "alarm", 3, now(), 1, document, columns),
    ]
    file.put_results(results)
    file.close()


async def check_results(screen: Screen) -> None:
    page = screen.page
    await page.get_by_role("link", name="Units").click()
    await expect(page.get_by_role("row", name="press-3 1 1 0 50 %")).to_be_visible()
    await expect(page.get_by_text("weld: No arc at 1.5 A.")).to_be_visible()
    assert await screen.faults_with(FONTS) == []
    assert await screen.barriers() == []
    await screen.picture("fleet units phone")
    await page.get_by_label("Search all units by serial number").fill("000001")
    await page.get_by_role("button", name="SN-000001").press("Enter")
    await expect(page.get_by_role("dialog")).to_contain_text("Passed")
    await page.keyboard.press("Escape")
    async with page.expect_download() as download:
        await page.get_by_role("button", name="Export CSV").click()
    saved = Path(await (await download.value).path()).read_text().splitlines()
    assert (len(saved), "SN-000001" in saved[1]) == (2, True)
    await page.get_by_role("link", name="Alarms").click()
    await expect(page.get_by_text("No part.").first).to_be_visible()
    await page.get_by_label("Language").select_option("cs")
    await expect(page.get_by_text("Chybí díl.")).to_have_count(2)
    assert await screen.faults_with(FONTS) == []
    assert await screen.barriers() == []
    await screen.picture("fleet alarms phone")
    await page.get_by_role("link", name="Kusy").click()
    await expect(page.get_by_text("weld: Žádný oblouk při 1,5 A.")).to_be_visible()
    await page.get_by_role("button", name="SN-000002").press("Enter")
    await expect(page.get_by_role("dialog")).to_contain_text("Žádný oblouk při 1,5 A.")
    await page.keyboard.press("Escape")
    await page.get_by_role("link", name="Alarmy").click()
    await page.get_by_text("Den", exact=True).click()
    await page.get_by_label("Den", exact=True).last.fill("2020-01-01")
    await expect(page.get_by_text("Žádné alarmy.").first).to_be_visible()


async def test_fleet_page_opens_a_cell_and_reports_its_lost_signal(
    browser: Browser, built_editor: Path, tmp_path: Path
) -> None:
    port = free_port()
    store_results(tmp_path / "fleet")
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
                # Without a broker, the cell works and logs one warning.
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

                # The card opens the cell, which shows its name and a button that leads back.
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
            # The cell has stopped.
            await expect(screen.page.locator('.fleet-card[data-level="gone"]')).to_contain_text("No signal since")
            await screen.page.get_by_role("button", name="Remove press-3 from this page").click()
            await screen.sees("No cells yet")
            await check_results(screen)
    finally:
        fleet.kill()
        if broker is not None:
            broker.kill()
