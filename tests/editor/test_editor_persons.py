"""Persons at a shared device: the first administrator, PIN and card, log-off, and Stop motion without a log-on."""

import asyncio
import time
from pathlib import Path

import pytest
from playwright.async_api import Browser, expect

from arcor2_hw.data.role import Role
from arcor2_server.access.tokens import TokenFile
from arcor2_server.audit.chain import AuditFile
from tests.editor.screen import Screen, screen_of
from tests.server.core.serving import running

pytestmark = pytest.mark.asyncio(loop_scope="session")

PIN = "2580"
CARD = "0012345678"


async def read_card(screen: Screen, number: str = CARD) -> None:
    """Type as a card reader does: a key every 5 ms, and wherever the focus is."""
    session = await screen.page.context.new_cdp_session(screen.page)
    start = time.time()
    keys = [(digit, digit) for digit in number] + [("Enter", "\r")]
    await asyncio.gather(
        *(
            session.send(
                "Input.dispatchKeyEvent",
                {"type": "keyDown", "key": key, "text": text, "timestamp": start + 0.005 * index},
            )
            for index, (key, text) in enumerate(keys)
        )
    )
    await session.detach()


async def enter_pin(screen: Screen, name: str, pin: str) -> None:
    await screen.page.get_by_role("group", name="Persons").get_by_role("button", name=name).click()
    for digit in pin:
        await screen.press(digit)
    await screen.press("Log on")


async def test_persons_share_a_tablet(tmp_path: Path, built_editor: Path, browser: Browser) -> None:
    data = tmp_path / "data"
    token = TokenFile(data).add("tablet", Role.PROGRAMMER, shared=True)[1]
    async with running(data) as server, screen_of(browser, server.url, touch=True) as screen:
        page = screen.page
        await page.goto(f"{screen.url}/?token={token}&q=low")
        await page.get_by_label("Name", exact=True).fill("Eva")
        await page.get_by_label("PIN", exact=True).fill(PIN)
        await page.get_by_label("PIN again").fill(PIN)
        await screen.picture("persons-first-administrator")
        await screen.press("Add administrator")
        logged_on = page.get_by_role("button", name="Log off Eva")
        await expect(logged_on).to_be_visible()

        await screen.press("Settings")
        await page.get_by_role("menuitem", name="Persons").click()
        await screen.press("Add person")
        field = page.get_by_label("Name")
        await field.fill("Ivo")
        await screen.press("Read card")
        await field.focus()
        await read_card(screen)  # the focused field does not receive the digits
        await screen.sees("A card was read.")
        await expect(field).to_have_value("Ivo")
        assert await screen.faults() == []
        await screen.press("Save")
        await screen.sees("Ivo")
        await screen.picture("persons-list")
        await screen.press("Close")

        await page.reload()  # the same page continues without a PIN
        await logged_on.click()
        await screen.sees("Eva logged off.")
        await page.get_by_role("button", name="Stop motion").click()  # works without a person
        await enter_pin(screen, "Eva", "4444")
        await screen.sees("The PIN of Eva is wrong.")
        await screen.picture("persons-pin")
        assert await screen.faults() == []
        await screen.press("Back")
        await screen.picture("persons-log-on")
        assert await screen.faults() == []
        await read_card(screen)
        await expect(page.get_by_role("button", name="Log off Ivo")).to_be_visible()
        await screen.sees("Operator")  # the screen of the role operator
        await screen.picture("persons-operator")
        await screen.press("Log off Ivo")
        await enter_pin(screen, "Eva", PIN)
        await expect(logged_on).to_be_visible()
        await read_card(screen)  # a card logs on the next person
        await expect(page.get_by_role("button", name="Log off Ivo")).to_be_visible()
    entries = [(entry.request, entry.user, entry.outcome.value) for entry in AuditFile(data / "audit.sqlite").all()]
    assert ("StopAll", "tablet", "done") in entries
    assert ("LogOn", "Ivo", "done") in entries
