"""Coming in: by a name that is free, with a token where one is asked for, and in the role that it gives."""

import asyncio
import hashlib
import json
import re
import ssl
import zipfile
from collections.abc import AsyncIterator
from pathlib import Path

import cv2
import numpy as np
import pytest
import pytest_asyncio
from playwright.async_api import Browser, expect

from arcor2_hw.data.role import Role
from arcor2_server.access.tokens import TokenFile
from tests.editor.screen import VIEWPORTS, Screen, screen_of
from tests.server.core.serving import ServerProcess, running

pytestmark = pytest.mark.asyncio(loop_scope="module")


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def server(tmp_path_factory: pytest.TempPathFactory, built_editor: Path) -> AsyncIterator[ServerProcess]:
    """A server that asks everybody for a token."""
    data_dir = tmp_path_factory.mktemp("join") / "data"
    TokenFile(data_dir).add("first", Role.TECHNICIAN)
    async with running(data_dir) as process:
        yield process


def secret(server: ServerProcess, role: Role) -> str:
    tokens = TokenFile(server.data_dir)
    return tokens.add(f"{role.name.lower()} {len(tokens.all())}", role)[1]


async def home(screen: Screen) -> None:
    await screen.page.get_by_role("radio", name="Projects").wait_for()


async def test_a_token_is_asked_for_taken_remembered_and_no_longer_valid(
    server: ServerProcess, browser: Browser
) -> None:
    async with screen_of(browser, server.url) as screen:
        await screen.join("Eva")
        field = screen.page.get_by_label("Token")
        await field.fill("not-a-token")
        await screen.press("Join")
        await screen.sees("The token is not valid")
        made, key = TokenFile(server.data_dir).add("Eva's tablet", Role.TECHNICIAN)
        await field.fill(key)
        await screen.press("Join")
        await home(screen)
        await screen.page.reload()
        await home(screen)
        TokenFile(server.data_dir).revoke(made.name)
        await screen.sees("not valid any more")
        await field.wait_for()


async def test_a_token_in_the_address_lets_in_and_is_not_left_there(server: ServerProcess, browser: Browser) -> None:
    async with screen_of(browser, server.url) as screen:
        await screen.page.goto(f"{screen.url}/?token={secret(server, Role.OPERATOR)}&q=low")
        await screen.page.get_by_label("Your name").fill("Operator")
        await screen.press("Join")
        await home(screen)
        assert "token" not in screen.page.url
        # An operator makes no scenes, and is shown so.
        await screen.page.get_by_role("radio", name="Scenes").click()
        await expect(screen.page.get_by_role("button", name="New scene")).to_be_disabled()


async def test_a_name_that_somebody_has_is_refused_with_the_reason(server: ServerProcess, browser: Browser) -> None:
    key = secret(server, Role.TECHNICIAN)
    async with screen_of(browser, server.url) as one, screen_of(browser, server.url) as two:
        for screen in (one, two):
            await screen.page.goto(f"{screen.url}/?token={key}&q=low")
            await screen.page.get_by_label("Your name").fill("Adam")
            await screen.press("Join")
            if screen is one:
                await home(one)
        await two.sees("The user name 'Adam' is already in use.")
        await two.page.get_by_label("Your name").fill("Berta")
        await two.press("Join")
        await home(two)
        await one.page.get_by_role("img", name="Berta").wait_for()
        assert await one.page.get_by_role("img", name="Adam (you)").is_visible()
        # Who shares a tablet chooses his name from those that were here, by one tap.
        await two.press("Settings")
        await two.page.get_by_role("menuitem", name="Leave (you are Berta)").click()
        people = two.page.get_by_role("group", name="Who was here with this device")
        assert await people.get_by_role("button").all_inner_texts() == ["Berta"]  # and not who was refused
        assert await two.faults() == []
        await two.picture("who was here")
        await two.press("Join as Berta")
        await home(two)


async def test_a_file_for_diagnosis_is_saved_by_one_press(server: ServerProcess, browser: Browser) -> None:
    async with screen_of(browser, server.url) as screen:
        key = secret(server, Role.TECHNICIAN)
        await screen.page.goto(f"{screen.url}/?token={key}&q=low")
        await screen.page.get_by_label("Your name").fill("Dora")
        await screen.press("Join")
        await home(screen)
        await screen.page.get_by_role("radio", name="Scenes").click()
        await screen.page.keyboard.press("?")
        await screen.sees("Only this machine reaches the server")
        async with screen.page.expect_download() as downloading:
            await screen.press("Save a file for diagnosis")
        saved = await downloading.value
        assert re.fullmatch(r"diagnosis-[\dT-]+\.zip", saved.suggested_filename)
        with zipfile.ZipFile(await saved.path()) as files:
            told = json.loads(files.read("client.json"))
            assert {"README.txt", "about.json", "types.json", "log.jsonl"} <= set(files.namelist())
            assert all(key.encode() not in files.read(name) for name in files.namelist())
        assert (told["user"], told["status"]) == ("Dora", "ready")
        # What the page has seen: that it came in, and the first that it was told.
        assert {"event ShowMainScreen", "connection open"} <= {
            f"{e['what']} {e['text'].split()[0]}" for e in told["seen"]
        }
        assert await screen.barriers() == []


async def test_over_tls_with_a_certificate_made_here_whose_fingerprint_is_told(
    tmp_path: Path, built_editor: Path, browser: Browser
) -> None:
    """What a tablet on the network gets, but for the address; and what invites the next one."""
    data_dir = tmp_path / "data"
    key = TokenFile(data_dir).add("tablet", Role.TECHNICIAN)[1]
    async with running(data_dir, "--host", "0.0.0.0") as server:
        assert server.url.startswith("wss://0.0.0.0:")
        address = server.url.replace("wss://0.0.0.0", "https://127.0.0.1", 1)
        context = await browser.new_context(ignore_https_errors=True, service_workers="block")
        try:
            screen = Screen(await context.new_page(), address)
            await screen.page.goto(f"{address}/?token={key}&q=low")
            assert await screen.page.evaluate("window.isSecureContext")
            await screen.page.get_by_label("Your name").fill("Tess")
            await screen.press("Join")
            await home(screen)
            await screen.page.keyboard.press("?")
            about = screen.page.get_by_role("dialog", name="About")
            invitation = about.get_by_role("region", name="How others join")
            shown = (await invitation.locator(".fingerprint code").inner_text()).replace(":", "")
            told = await _joining(screen)
            code = invitation.get_by_role("img")
            if told["addresses"]:  # this machine is on a network
                picture = cv2.imdecode(np.frombuffer(await code.screenshot(), np.uint8), cv2.IMREAD_COLOR)
                assert picture is not None
                read, _, _ = cv2.QRCodeDetector().detectAndDecode(picture)
                assert read == told["addresses"][0]
                assert read.startswith("https://")
            else:
                await invitation.get_by_text("Only this machine reaches the server").wait_for()
            assert await screen.faults() == []
            assert await screen.barriers() == []
            for name in ("tablet", "phone"):
                await screen.page.set_viewport_size(VIEWPORTS[name])  # type: ignore[arg-type]
                await screen.settle()
                assert await screen.faults() == [], name
                await screen.picture(f"invitation {name}")
            assert screen.unexpected() == []
        finally:
            await context.close()
        # The one that a browser shows of the certificate is the one that the server told.
        host, _, port = address.removeprefix("https://").rstrip("/").rpartition(":")
        seen = ssl.PEM_cert_to_DER_cert(await asyncio.to_thread(ssl.get_server_certificate, (host, int(port))))
        logged = re.sub(r"[^0-9A-F]", "", server.log.read_text().upper())
        assert hashlib.sha256(seen).hexdigest().upper() == shown
        assert shown in logged


async def _joining(screen: Screen) -> dict[str, list[str]]:
    """What the server says of how others join."""
    ask = "key => fetch('/api/joining', {headers: {Authorization: `Bearer ${key}`}}).then(found => found.json())"
    key = await screen.page.evaluate("localStorage.getItem('arcor2-hw.token')")
    found: dict[str, list[str]] = await screen.page.evaluate(ask, key)
    return found
