"""The whole workplace and a browser, one of each per module."""

from collections.abc import AsyncIterator
from pathlib import Path

import pytest
import pytest_asyncio
from playwright.async_api import Browser

from arcor2_server.web.editor import FILES
from tests.e2e.harness import Cell, running_cell
from tests.editor.screen import running_browser


@pytest.fixture(scope="session")
def built_editor() -> Path:
    assert (FILES / "index.html").is_file(), "the editor is not built: make .make/editor"
    return FILES


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def cell(tmp_path_factory: pytest.TempPathFactory, built_editor: Path) -> AsyncIterator[Cell]:
    """Fakes and server of the workplace of three devices."""
    async with running_cell(tmp_path_factory.mktemp("cell")) as running:
        yield running


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def browser() -> AsyncIterator[Browser]:
    async with running_browser(behind=True) as running:
        yield running
