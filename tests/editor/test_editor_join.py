"""Joining: unique names, tokens and roles."""

import asyncio
import hashlib
import json
import re
import ssl
import zipfile
from collections.abc import AsyncIterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import numpy as np
import pytest
import pytest_asyncio
from playwright.async_api import Browser, Route, expect

from arcor2_hw.data.role import Role
from arcor2_server.access.authority import AUTHORITY
from arcor2_server.access.certificate import fingerprint
from arcor2_server.access.tokens import TokenFile
from tests.editor import texts
from tests.editor.screen import VIEWPORTS, Screen, screen_of
from tests.server.core.serving import ServerProcess, running

pytestmark = pytest.mark.asyncio(loop_scope="session")


@pytest_asyncio.fixture(scope="module", loop_scope="session")
async def server(tmp_path_factory: pytest.TempPathFactory, built_editor: Path) -> AsyncIterator[ServerProcess]:
    """A server that requires tokens."""
    data_dir = tmp_path_factory.mktemp("join") / "data"
    TokenFile(data_dir).add("first", Role.TECHNICIAN)
    async with running(data_dir) as process:
        yield process


def secret(server: ServerProcess, role: Role) -> str:
    tokens = TokenFile(server.data_dir)
    return tokens.add(f"{role.name.lower()} {len(tokens.all())}", role)[1]


async def wait_for_home(screen: Screen) -> None:
    await screen.page.get_by_role("radio", name=texts.PROJECTS).wait_for()


async def test_token_is_requested_remembered_and_revoked(server: ServerProcess, browser: Browser) -> None:
    async with screen_of(browser, server.url) as screen:
        await screen.join("Eva")
        field = screen.page.get_by_label("Token")
        await field.fill("not-a-token")
        await screen.press(texts.JOIN)
        await screen.sees("The token is not valid")
        token, key = TokenFile(server.data_dir).add("Eva's tablet", Role.TECHNICIAN)
        await field.fill(key)
        await screen.press(texts.JOIN)
        await wait_for_home(screen)
        await screen.page.reload()
        await wait_for_home(screen)
        TokenFile(server.data_dir).revoke(token.name)
        await screen.sees("no longer valid")
        await field.wait_for()


async def test_token_in_the_address_is_used_and_removed(server: ServerProcess, browser: Browser) -> None:
    async with screen_of(browser, server.url) as screen:
        await screen.join("Operator", f"/?token={secret(server, Role.OPERATOR)}&q=low#/")
        await wait_for_home(screen)
        assert "token" not in screen.page.url
        # An operator cannot create scenes; the button is disabled.
        await screen.page.get_by_role("radio", name=texts.SCENES).click()
        await expect(screen.page.get_by_role("button", name=texts.NEW_SCENE)).to_be_disabled()


async def test_a_refused_websocket_is_distinguished_from_a_stopped_server(
    server: ServerProcess, browser: Browser
) -> None:
    """A browser may trust the page, but not its websocket, if the certificate is not installed."""
    async with screen_of(browser, server.url) as screen:
        await screen.page.add_init_script(
            "window.WebSocket = function () { setTimeout(() => this.onclose({code: 1006, reason: ''})); }"
        )
        await screen.join("Eva")
        await screen.sees("The server answers, but the live connection fails.")
        await screen.page.route("**/healthz/ready", lambda route: route.abort())
        screen.expected_errors = ("net::ERR_FAILED",)
        await screen.sees("The server cannot be reached.")


async def test_name_in_use_is_refused_and_returning_users_join_by_one_tap(
    server: ServerProcess, browser: Browser
) -> None:
    key = secret(server, Role.TECHNICIAN)
    async with screen_of(browser, server.url) as one, screen_of(browser, server.url) as two:
        for screen in (one, two):
            await screen.join("Adam", f"/?token={key}&q=low")
            if screen is one:
                await wait_for_home(one)
        await two.sees("The user name 'Adam' is already in use.")
        loading = asyncio.Event()

        async def load(route: Route) -> None:
            await loading.wait()
            await route.continue_()

        await two.page.route("**/assets/menu-*.js", load)
        await two.page.get_by_label(texts.YOUR_NAME).fill("Berta")
        await two.press(texts.JOIN)
        await wait_for_home(two)
        await one.page.get_by_role("img", name="Berta").wait_for()
        assert await one.page.get_by_role("img", name="Adam (you)").is_visible()
        # On a shared tablet, returning users join with one tap.
        await two.press(texts.SETTINGS)
        loading.set()  # a menu opens even if it is pressed before its code is loaded
        await two.page.get_by_role("menuitem", name="Leave (you are Berta)").click()
        people = two.page.get_by_role("group", name="Recent users")
        assert await people.get_by_role("button").all_inner_texts() == ["Berta"]  # not the refused name
        assert await two.faults() == []
        await two.picture("recent users")
        await two.press("Join as Berta")
        await wait_for_home(two)


async def test_diagnosis_file_is_saved(server: ServerProcess, browser: Browser) -> None:
    async with screen_of(browser, server.url) as screen:
        key = secret(server, Role.TECHNICIAN)
        await screen.join("Dora", f"/?token={key}&q=low")
        await wait_for_home(screen)
        await screen.page.get_by_role("radio", name=texts.SCENES).click()
        await screen.page.keyboard.press("?")
        await screen.sees("accepts connections from this computer only")
        async with screen.page.expect_download() as downloading:
            await screen.press("Save diagnosis file")
        saved = await downloading.value
        assert re.fullmatch(r"diagnosis-[\dT-]+\.zip", saved.suggested_filename)
        with zipfile.ZipFile(await saved.path()) as files:
            client = json.loads(files.read("client.json"))
            assert {"README.txt", "about.json", "types.json", "log.jsonl"} <= set(files.namelist())
            assert all(key.encode() not in files.read(name) for name in files.namelist())
        assert (client["user"], client["status"]) == ("Dora", "ready")
        # The log of the page: the connection and the first event.
        assert {"event ShowMainScreen", "connection open"} <= {
            f"{e['kind']} {e['text'].split()[0]}" for e in client["seen"]
        }
        assert await screen.barriers() == []


async def test_invitation_shows_the_fingerprint_of_the_tls_certificate(
    tmp_path: Path, built_editor: Path, browser: Browser
) -> None:
    """The server listens on the network, as for a tablet. The test uses its loopback address."""
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
            await screen.page.get_by_label(texts.YOUR_NAME).fill("Tess")
            await screen.press(texts.JOIN)
            await wait_for_home(screen)
            await screen.page.keyboard.press("?")
            about = screen.page.get_by_role("dialog", name="About")
            invitation = about.get_by_role("region", name="Invite others")
            shown = (await invitation.locator(".fingerprint code").inner_text()).replace(":", "")
            trust = invitation.locator(".trust")
            invited = await _join_options(screen)
            code = invitation.get_by_role("img")
            if invited["addresses"]:  # the machine is on a network
                picture = cv2.imdecode(np.frombuffer(await code.screenshot(), np.uint8), cv2.IMREAD_COLOR)
                assert picture is not None
                read, _, _ = cv2.QRCodeDetector().detectAndDecode(picture)
                assert read == invited["addresses"][0]
                assert read.startswith("https://")
                assert read.replace("https://", "http://", 1) in await trust.inner_text()
                assert fingerprint(data_dir / AUTHORITY) in await trust.inner_text()
            else:
                await invitation.get_by_text("accepts connections from this computer only").wait_for()
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
        # The fingerprint is that of the served certificate, and the server has logged it.
        host, _, port = address.removeprefix("https://").rstrip("/").rpartition(":")
        with ThreadPoolExecutor(1) as threads:
            ask = asyncio.get_running_loop().run_in_executor(threads, ssl.get_server_certificate, (host, int(port)))
            seen = ssl.PEM_cert_to_DER_cert(await ask)
        logged = re.sub(r"[^0-9A-F]", "", server.log.read_text().upper())
        assert hashlib.sha256(seen).hexdigest().upper() == shown
        assert shown in logged


async def _join_options(screen: Screen) -> dict[str, list[str]]:
    """Return the ways to join that the server offers."""
    ask = "key => fetch('/api/joining', {headers: {Authorization: `Bearer ${key}`}}).then(found => found.json())"
    key = await screen.page.evaluate("localStorage.getItem('arcor2-hw.token')")
    found: dict[str, list[str]] = await screen.page.evaluate(ask, key)
    return found
