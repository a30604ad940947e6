"""Several users edit at once: all of them end with the same state as the server."""

import asyncio
import math
import random
from typing import Any

import pytest
from playwright.async_api import Browser

from arcor2_hw.client import Client
from arcor2_hw.data import rpc
from arcor2_hw.data.base import Unset
from arcor2_hw.data.events import ChangeType
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.project import Project
from arcor2_hw.data.scene import Scene
from tests.e2e.harness import Cell, until
from tests.editor import texts
from tests.editor.screen import Screen, screen_of

pytestmark = pytest.mark.asyncio(loop_scope="session")

EDITS = 10
"""Number of edits of each user."""
SEED = 20

DRAWN = """() => Object.fromEntries(__engine.ids().map((id) => [id, __engine.item(id)])
  .filter(([, item]) => item.kind === "point").map(([id, { name, pose }]) => [id, [name, pose.position]]))"""


async def edit_on_screen(screen: Screen, seed: int) -> None:
    """Move the selected point and undo, as fast as the page allows."""
    chance = random.Random(seed)
    panel = screen.page.get_by_role("complementary")
    for _ in range(EDITS):
        axis, change = chance.choice("XYZ"), chance.choice(("Increase", "Decrease"))
        await panel.get_by_role("button", name=f"{change} {axis} by 1 cm").click()
        back = screen.page.get_by_role("button", name="Undo ")
        if chance.random() < 0.3 and await back.is_enabled():
            await back.click()


async def _added(client: Client, name: str) -> str:
    while True:
        event = await client.next_event("ActionPointChanged")
        if event.change_type is ChangeType.ADD and event.data.name == name:
            found: str = event.data.id
            return found


async def edit_by_requests(client: Client, seed: int) -> None:
    """Add, rename and remove points through the protocol."""
    chance = random.Random(seed)
    own: list[str] = []
    for number in range(EDITS):
        edit = chance.choice(("add", "add", "rename", "remove")) if own else "add"
        if edit == "add":
            place = Position(chance.random() / 2, chance.random() / 2, 0.2)
            await client.call("AddActionPoint", rpc.AddActionPointArgs(f"third_{number}", place))
            own.append(await _added(client, f"third_{number}"))
            continue
        point = chance.choice(own)
        # Only this user edits these points: each request succeeds and releases its lock.
        await client.call("WriteLock", rpc.WriteLockArgs(point))
        if edit == "rename":
            await client.call("RenameActionPoint", rpc.RenameActionPointArgs(point, f"renamed_{number}"))
        else:
            await client.call("RemoveActionPoint", rpc.IdArgs(point))
            own.remove(point)


def world_positions(scene: Scene, project: Project) -> dict[str, tuple[str, tuple[float, float, float]]]:
    """Return names and world positions of all points of the documents."""
    frames = {each.id: each.pose for each in scene.objects if isinstance(each.pose, Pose)}
    points = {each.id: each for each in project.action_points}

    def world(parent: str | Unset | None) -> Pose:
        if not parent:
            return Pose()
        if parent in points:
            return world(points[parent].parent) * Pose(points[parent].position)
        return frames[parent]

    found = {}
    for each in project.action_points:
        at = (world(each.parent) * Pose(each.position)).position
        found[each.id] = (each.name, (at.x, at.y, at.z))
    return found


def is_same(drawn: dict[str, Any], wanted: dict[str, tuple[str, tuple[float, float, float]]]) -> bool:
    return drawn.keys() == wanted.keys() and all(
        drawn[point][0] == name and math.dist(drawn[point][1].values(), at) < 1e-6
        for point, (name, at) in wanted.items()
    )


async def test_concurrent_edits_converge(cell: Cell, browser: Browser) -> None:
    client = await cell.client("third")
    scene, project = await cell.open(client)
    point = project.action_points[0]
    async with screen_of(browser, cell.url) as one, screen_of(browser, cell.url, "small tablet") as two:
        for screen, name in ((one, "Eva"), (two, "Adam")):
            await screen.join(name)
            await screen.item(point.id)
            await screen.press(texts.OBJECTS)
            await screen.page.get_by_role("row", name=f"{point.name} Action point").click()
        await one.page.get_by_role("img", name=f"Adam, at {point.name}").wait_for()
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(edit_on_screen(one, SEED))
            tasks.create_task(edit_on_screen(two, SEED + 1))
            tasks.create_task(edit_by_requests(client, SEED + 2))

        async def opened() -> Project:
            """Return the open project as a new client receives it."""
            async with Client(cell.url, "late", reconnect=False) as late:
                shown = (await late.next_event("OpenProject")).data.project
                assert isinstance(shown, Project)
                return shown

        async def agree() -> bool:
            now = world_positions(scene, await opened())
            return all([is_same(await screen.page.evaluate(DRAWN), now) for screen in (one, two)])

        await until(agree, "both screens show the state of the server", 15)
        # Points were added, and all locks are released.
        assert len((await opened()).action_points) > len(project.action_points)
        await client.call("WriteLock", rpc.WriteLockArgs(point.id))
        await one.until("id => __engine.item(id).badge === 'in use by third'", point.id)
        # The panel names the user who holds the lock.
        await one.page.get_by_role("complementary").get_by_text("third").first.wait_for()
        await client.call("WriteUnlock", rpc.WriteUnlockArgs(point.id))
