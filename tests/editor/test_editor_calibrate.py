"""Where things stand, told by the robot: one touch, and three points of a frame; in Chromium on the fake arm."""

import math
import re

import pytest
from playwright.async_api import Browser, expect

from arcor2_hw.client import Client
from arcor2_hw.data import rpc
from arcor2_hw.data.events import SceneStateEnum
from arcor2_hw.data.geometry import Position
from arcor2_hw.data.scene import Scene, SceneObject
from tests.e2e.harness import Cell, scene_state, until
from tests.editor.screen import Screen, screen_of

pytestmark = [pytest.mark.asyncio(loop_scope="module"), pytest.mark.timeout(180)]


async def _saved(client: Client, scene: str, name: str) -> SceneObject:
    await client.call("SaveScene")
    found: Scene = await client.call("GetScene", rpc.IdArgs(scene))
    return next(each for each in found.objects if each.name == name)


async def _tool(screen: Screen, robot: str) -> Position:
    return Position(**(await screen.item(robot))["endEffectors"][0]["position"])


async def test_an_object_is_put_where_the_robot_touches_it(cell: Cell, browser: Browser) -> None:
    client = await cell.client("colleague")
    scene, _ = await cell.open(client)
    await client.call("CloseProject")
    await client.call("OpenScene", rpc.IdArgs(scene.id))
    robot = next(each.id for each in scene.objects if each.name == "robot")
    async with screen_of(browser, cell.url) as screen:
        page = screen.page
        screen.expected_errors = ("409 (Conflict)",)  # what a browser says of a refusal over REST
        await screen.join("Eva")
        await screen.item(robot)
        await client.call("StartSceneKeepGoing")
        await scene_state(client, SceneStateEnum.STARTED, 60)
        await screen.until("id => window.__engine?.item(id)?.endEffectors?.length > 0", robot)
        await page.get_by_role("navigation").get_by_role("button").filter(has_text="Things").click()
        await page.get_by_role("option").filter(has=page.get_by_text("tester", exact=True)).first.click()
        await page.get_by_role("radio", name="Its middle").click()
        await page.get_by_role("button", name="It stands where the tool is", exact=True).click()
        touched = await _tool(screen, robot)
        tester = next(each for each in scene.objects if each.name == "tester")

        async def there() -> bool:
            at = (await screen.item(tester.id))["pose"]["position"]
            return math.dist(tuple(at.values()), tuple(touched)) < 1e-3

        await until(there, "the tester stands where the tool is", 15)
        saved = await _saved(client, scene.id, "tester")
        assert math.dist(tuple(saved.pose.position), tuple(touched)) < 1e-3  # type: ignore[union-attr]

        # Three points at one place are no frame: refused with the reason, and nothing is moved.
        await page.get_by_text("By three points of its frame").click()
        for name in ("Origin", "On its x axis", "In its xy plane"):
            await page.get_by_role("button", name=re.compile(name)).click()
        await page.get_by_role("button", name="Put it there", exact=True).click()
        await expect(page.get_by_role("complementary").get_by_role("alert")).to_be_visible(timeout=15_000)
        assert await there()
        await client.call("StopScene")
        await scene_state(client, SceneStateEnum.STOPPED, 30)
