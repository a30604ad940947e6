"""One browser, one server and one set of fakes per worker; each test gets an empty workplace with healthy devices."""

from collections.abc import AsyncIterator
from pathlib import Path

import pytest
import pytest_asyncio
from playwright.async_api import Browser

from arcor2_server.web.editor import FILES
from tests.e2e.harness import Cell, running_cell
from tests.editor.reset import reset
from tests.editor.screen import VIEWPORTS, running_browser

USUAL = ("tablet", "portrait", "phone")
"""Sizes in which layouts are checked without `--matrix`."""


@pytest.fixture(scope="session")
def built_editor() -> Path:
    assert (FILES / "index.html").is_file(), "the editor is not built: make .make/editor"
    return FILES


@pytest.fixture(scope="session")
def sizes(pytestconfig: pytest.Config) -> list[str]:
    """The sizes in which layouts are checked."""
    return list(VIEWPORTS) if pytestconfig.getoption("--matrix") else list(USUAL)


@pytest_asyncio.fixture(scope="package", loop_scope="session")
async def browser() -> AsyncIterator[Browser]:
    """The browser of this worker while it runs editor tests. Each open screen has its own browser context."""
    async with running_browser(low_priority=True, reuse_contexts=True) as running:
        yield running


@pytest_asyncio.fixture(scope="package", loop_scope="session")
async def shared_cell(tmp_path_factory: pytest.TempPathFactory, built_editor: Path) -> AsyncIterator[Cell]:
    """The server and the fakes of this worker while it runs editor tests, as the previous test left them."""
    async with running_cell(tmp_path_factory.mktemp("cell")) as running:
        yield running


@pytest_asyncio.fixture(loop_scope="session")
async def cell(shared_cell: Cell, browser: Browser) -> AsyncIterator[Cell]:
    """The shared workplace, reset for this test. Its clients are closed afterwards."""
    await reset(shared_cell, browser)
    yield shared_cell
    await shared_cell.close_clients()


@pytest_asyncio.fixture(scope="module", loop_scope="session")
async def module_cell(shared_cell: Cell, browser: Browser) -> AsyncIterator[Cell]:
    """The shared workplace, reset once for a module whose tests share an open document."""
    await reset(shared_cell, browser)
    yield shared_cell
    await shared_cell.close_clients()
