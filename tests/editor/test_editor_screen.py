"""A screen does not see data that earlier screens of the same browser context stored."""

from typing import Any

import pytest
from playwright.async_api import Browser

from tests.e2e.harness import Cell
from tests.editor.screen import screen_of

pytestmark = pytest.mark.asyncio(loop_scope="session")

_STORE = """() => {
    localStorage.setItem("test", "1");
    sessionStorage.setItem("test", "1");
    document.cookie = "test=1; max-age=60";
    return new Promise((done) => { indexedDB.open("test").onsuccess = done; });
}"""
_STORED = """async () => ({
    items: localStorage.length + sessionStorage.length,
    cookies: document.cookie,
    databases: (await indexedDB.databases()).length,
    dark: matchMedia("(prefers-color-scheme: dark)").matches,
    width: innerWidth,
})"""


async def test_a_reused_context_has_no_stored_data(cell: Cell, browser: Browser) -> None:
    async def stored(**options: Any) -> tuple[object, dict[str, object]]:
        async with screen_of(browser, cell.url, **options) as screen:
            await screen.page.goto(f"{screen.url}/?q=low")
            found = await screen.page.evaluate(_STORED)
            await screen.page.evaluate(_STORE)
            return screen.page.context, found

    empty = {"items": 0, "cookies": "", "databases": 0}
    first, found = await stored(viewport="phone", dark=True)
    assert found == {**empty, "dark": True, "width": 390}
    second, found = await stored()
    assert found == {**empty, "dark": False, "width": 1280}
    assert first is second
