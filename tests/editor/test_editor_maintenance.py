"""A replaced device executes no commands until a technician has confirmed it in the wizard."""

import pytest
from playwright.async_api import Browser, expect

from arcor2_hw.client import Client
from arcor2_hw.data.events import SceneStateEnum
from tests.e2e.harness import Cell, scene_state
from tests.editor import texts
from tests.editor.screen import screen_of

pytestmark = pytest.mark.asyncio(loop_scope="session")

OTHER_SERIAL_NUMBER = "20245500777"


async def go_online(client: Client) -> None:
    await client.call("StartScene")
    await scene_state(client, SceneStateEnum.STARTED)


async def test_a_replaced_device_is_confirmed_by_a_technician(cell: Cell, browser: Browser) -> None:
    client = await cell.client("colleague")
    scene, _ = await cell.open(client)
    robot = next(each.id for each in scene.objects if each.name == "robot")
    await go_online(client)
    await client.call("StopScene")
    await scene_state(client, SceneStateEnum.STOPPED)
    try:
        await cell.renew_robot("--serial-number", OTHER_SERIAL_NUMBER)
        await go_online(client)
        async with screen_of(browser, cell.url, touch=True) as screen:
            page = screen.page
            await screen.join("Eva")
            await page.get_by_role("button", name=texts.DEVICES).click()
            await screen.press("Open the device card")
            card = page.get_by_role("dialog")
            await expect(card).to_contain_text(f"serial number {OTHER_SERIAL_NUMBER} instead of 20235500042")
            await screen.settle()
            assert await screen.faults() == []
            await screen.picture("device-card-different")
            await screen.press("Check and confirm…")
            for _ in range(3):
                await screen.settle()
                assert await screen.faults() == []
                assert await screen.barriers() == []
                await screen.press("Next")
            await screen.press("Confirm this device")
            await screen.sees("is confirmed and executes commands again")
            (found,) = (each for each in (await client.call("ListDeviceCards")).devices if each.object_id == robot)
            assert (found.identity.serial, found.confirmed_by) == (OTHER_SERIAL_NUMBER, "Eva")
    finally:
        await cell.close_clients()
        await cell.renew_robot()
        await cell.renew_server()
