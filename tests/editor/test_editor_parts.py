"""The operator's tablet after an interruption: where the parts are, and how the program continues."""

import os
import signal
from pathlib import Path

import psutil
import pytest
from playwright.async_api import Browser, expect

from arcor2_hw.client import Client
from arcor2_hw.data.held import OnError
from arcor2_hw.data.parts import PartCounts
from arcor2_hw.data.rpc import RunPackageArgs
from arcor2_server.demo.processes import Child, python_module
from tests.e2e.harness import until
from tests.editor.screen import screen_of
from tests.runtime.test_host_parts import ONE, write_package

pytestmark = pytest.mark.asyncio(loop_scope="session")


def hang(folder: Path, hangs: bool) -> None:
    """Set whether the gripper of the package hangs while it picks."""
    (folder / "hang").touch() if hangs else (folder / "hang").unlink()


async def test_operator_confirms_a_part_and_continues_after_the_host_was_killed(
    tmp_path: Path, browser: Browser
) -> None:
    notes = tmp_path / "notes"
    hang(tmp_path, True)
    write_package(tmp_path / "data" / "packages" / "pkg_1", tmp_path, ONE)
    serve = python_module("arcor2_server.cli.main", "serve", "--port", "0", "--data-dir", str(tmp_path / "data"))
    server = Child("server", serve, tmp_path / "server.log")
    url = await server.start()
    try:
        async with Client(url, "colleague", reconnect=False) as client:
            await client.call("RunPackage", RunPackageArgs("pkg_1", on_error=OnError.HOLD))
            await until(notes.exists, "the gripper picks the part")
            for process in psutil.Process(server.pid).children():
                if "arcor2_hw.runtime.host" in process.cmdline():
                    os.kill(process.pid, signal.SIGKILL)
            hang(tmp_path, False)
            async with screen_of(browser, url.replace("ws://", "http://"), "ipad", touch=True) as screen:
                await screen.join("Olga", "/?q=low#/operator?kiosk")
                parts = screen.page.get_by_role("region", name="Parts in the cell")
                await expect(parts).to_contain_text("demo was at pick.")
                await expect(parts).to_contain_text("Where is part A-1?")
                assert await screen.faults() == []
                await screen.picture("parts, where")
                await parts.get_by_role("button", name="arm", exact=True).click()
                await expect(parts).to_contain_text("after your decision.")
                assert await screen.faults() == []
                await screen.picture("parts, continue")
                await parts.get_by_text("Continue at another action").click()
                await expect(parts.get_by_role("button", name="scan", exact=True)).to_be_visible()
                assert await screen.faults() == []
                await screen.picture("parts, continue at another action")
                await parts.get_by_role("button", name="Continue at pick").click()
                held = screen.page.get_by_role("region", name="The program is held")
                await expect(held).to_contain_text("pick was interrupted.")
                await held.get_by_text("Parts in the cell").click()
                await expect(held.get_by_role("button", name="Correct A-1")).to_be_visible()
                assert await screen.faults() == []
                await screen.picture("parts, held")
                assert notes.read_text().split() == ["pick"]  # the gripper has not moved since
                await held.get_by_role("button", name="Done by hand, continue").click()
                await expect(held).to_have_count(0)
                await expect(parts).to_have_count(0)
            await until(lambda: notes.read_text().split() == ["pick", "place"], "the part is placed")
            (inventory,) = await client.get_parts()
            assert inventory.counts == PartCounts(fed=1, in_cell=1)
    finally:
        await server.stop()
