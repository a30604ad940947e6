"""A secret setting in the browser is never shown or sent again, and is preserved when other settings are saved."""

import hashlib
import re

import httpx
import pytest
from playwright.async_api import Browser, WebSocket, expect

from arcor2_hw.client import Client, LockedByOther
from arcor2_hw.data import rpc
from arcor2_hw.data.events import SceneStateEnum
from tests.e2e.harness import Cell, scene_state, until
from tests.editor import texts
from tests.editor.screen import Screen, screen_of

pytestmark = pytest.mark.asyncio(loop_scope="session")

CODE = "swordfish-4711"
VAULT = '''
"""A device that connects only with the right secret."""
import dataclasses
import hashlib

from arcor2_hw.exceptions import NotConnected
from arcor2_hw.objects import Generic, Settings


@dataclasses.dataclass
class VaultSettings(Settings):
    digest: str
    label: str = ""
    code: str = dataclasses.field(default="", repr=False, metadata={"secret": True})


class Vault(Generic):
    """A vault with a code."""

    _ABSTRACT = False

    def __init__(self, obj_id: str, name: str, settings: VaultSettings) -> None:
        super().__init__(obj_id, name, settings)
        if hashlib.sha256(settings.code.encode()).hexdigest() != settings.digest:
            raise NotConnected("The code is wrong.")
'''
TYPE = {"id": "Vault", "name": "Vault", "source": VAULT, "description": ""}


async def upload(cell: Cell, source: dict[str, str]) -> None:
    async with httpx.AsyncClient(timeout=60, base_url=cell.url.replace("ws", "http", 1)) as rest:
        answer = await rest.put("/object-types", json=source)
        assert answer.status_code == 200, answer.text


async def open_add_panel(screen: Screen, search: str) -> None:
    await screen.page.get_by_role("navigation").get_by_role("button", name=texts.ADD, exact=True).click()
    await screen.page.get_by_role("complementary").get_by_label("Search").fill(search)


async def test_a_secret_is_write_only_and_preserved_when_other_settings_are_saved(cell: Cell, browser: Browser) -> None:
    await upload(cell, TYPE)
    client = await cell.client("colleague")
    await client.call("NewScene", rpc.NewSceneArgs("safe"))
    async with screen_of(browser, cell.url) as screen:
        page = screen.page
        panel = page.get_by_role("complementary")
        received: list[str] = []

        def listen(socket: WebSocket) -> None:
            socket.on("framereceived", lambda frame: received.append(str(frame)))

        page.on("websocket", listen)
        await screen.join("Eva")
        await open_add_panel(screen, "vault")
        await panel.get_by_role("button", name="Vault").click()
        await panel.get_by_label("digest", exact=True).fill(hashlib.sha256(CODE.encode()).hexdigest())
        await panel.locator("details.more-settings > summary").click()
        code = panel.get_by_label("code", exact=True)
        await expect(code).to_have_attribute("type", "password")
        await code.fill(CODE)
        await panel.locator("form button[type=submit]").click()
        await panel.get_by_role("heading", name="vault", exact=True).wait_for()

        # Only a placeholder is shown, also to a user who comes later, and the code is not sent back.
        settings = panel.get_by_role("region", name=texts.SETTINGS)
        await panel.locator("details.more-settings > summary").click()
        code = settings.get_by_label("code", exact=True)
        await expect(code).to_have_value("")
        await expect(code).to_have_attribute("placeholder", texts.SECRET_IS_STORED)
        await expect(code).to_have_attribute("type", "password")

        # Saving another setting neither requests nor loses the secret.
        label = settings.get_by_label("label", exact=True)
        await label.fill("north wall")
        await label.press("Enter")
        await screen.press(texts.SAVE_SETTINGS)
        await until(lambda: _is_saved(client, "north wall"), "the setting is saved")
        await expect(code).to_have_attribute("placeholder", texts.SECRET_IS_STORED)
        await client.call("StartScene")
        await scene_state(client, SceneStateEnum.STARTED, 30)  # the device received the code
        await client.call("StopScene")
        await scene_state(client, SceneStateEnum.STOPPED, 30)

        # A new code replaces the stored one.
        await code.fill("halibut-0815")
        await code.press("Enter")
        await screen.press(texts.SAVE_SETTINGS)
        await expect(code).to_have_value("")
        await expect(page.get_by_role("button", name=texts.SAVE_SETTINGS)).to_have_count(0)
        await client.call("StartScene")
        await screen.sees("The code is wrong.")
        assert received, "the page is connected"
        assert not [frame for frame in received if re.search(f"{CODE}|halibut-0815", frame)]
        assert CODE not in await page.content()


async def _is_saved(client: Client, value: str) -> bool:
    try:
        await client.call("SaveScene")
    except LockedByOther:  # the page holds the lock of the device until its settings are stored
        return False
    (scene,) = await client.list_scenes()
    (vault,) = (await client.get_scene(scene.id)).objects
    return any(value in each.value for each in vault.parameters)


async def test_an_uploaded_type_names_the_installed_type_that_it_replaces(cell: Cell, browser: Browser) -> None:
    source = TYPE | {"id": "Conveyor", "name": "Conveyor", "source": VAULT.replace("class Vault(", "class Conveyor(")}
    await upload(cell, source)
    client = await cell.client("colleague")
    await client.call("NewScene", rpc.NewSceneArgs("replaced"))
    async with screen_of(browser, cell.url) as screen:
        await screen.join("Eva")
        await open_add_panel(screen, "conveyor")
        kind = screen.page.get_by_role("complementary").get_by_role("button", name=re.compile("^Conveyor"))
        await expect(kind).to_contain_text("replaces the installed type Conveyor (arcor2-hw ")
