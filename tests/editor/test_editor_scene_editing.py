"""Editing a scene: objects are added, dragged, placed by steps and numbers, resized and undone."""

import math
import re
import struct
from collections.abc import AsyncIterator
from dataclasses import dataclass
from typing import Any

import pytest
import pytest_asyncio
from playwright.async_api import Browser, expect

from arcor2_hw.client import Client
from arcor2_hw.data import rpc
from arcor2_hw.data.editor import ViewScope
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.scene import Scene, SceneObject
from tests.e2e.harness import Cell, until
from tests.editor import texts
from tests.editor.screen import Screen, screen_of

pytestmark = pytest.mark.asyncio(loop_scope="session")


@dataclass
class OpenedScene:
    """An open scene, and a second client."""

    cell: Cell
    client: Client
    scene: Scene

    async def objects(self) -> list[SceneObject]:
        """Return the objects as the server has them now, saved or not."""
        async with Client(self.cell.url, "observer", reconnect=False) as observer:
            opened = await observer.next_event("OpenScene")
            found: list[SceneObject] = opened.data.scene.objects
            return found

    async def object(self, name: str) -> SceneObject:
        return next(each for each in await self.objects() if each.name == name)

    async def pose(self, name: str) -> Pose:
        pose = (await self.object(name)).pose
        assert isinstance(pose, Pose)
        return pose

    async def has(self, name: str) -> bool:
        return any(each.name == name for each in await self.objects())


@pytest_asyncio.fixture(loop_scope="session")
async def opened(cell: Cell) -> AsyncIterator[OpenedScene]:
    """The scene is open and saved."""
    client = await cell.client("colleague")
    scene, _ = await cell.open(client)
    await client.call("CloseProject")
    await client.call("OpenScene", rpc.IdArgs(scene.id))
    yield OpenedScene(cell, client, scene)


async def _succeeds(client: Client, request: str, args: Any) -> bool:
    try:
        await client.call(request, args)
    except Exception:
        return False
    return True


async def tool(screen: Screen, name: str) -> None:
    await screen.page.get_by_role("navigation").get_by_role("button").filter(has_text=name).click()


async def handle(screen: Screen, name: str) -> tuple[float, float]:
    """Move the pointer to a handle of the gizmo, and return its position on the page.

    The panel of a selection makes the view narrower one frame later. So wait until the handle is highlighted under the
    pointer twice at the same position.
    """
    times = 0

    async def is_highlighted() -> bool:
        nonlocal times
        at = await screen.until("name => window.__engine?.gizmo.places()[name]", name)
        box = await screen.page.locator(".view canvas").bounding_box()
        assert box is not None
        found.append((box["x"] + at["x"], box["y"] + at["y"]))
        await screen.page.mouse.move(found[-1][0] + 1, found[-1][1])
        await screen.page.mouse.move(*found[-1])
        await screen.settle()
        cursor = await screen.page.locator(".view canvas").evaluate("canvas => canvas.style.cursor")
        times = times + 1 if cursor == "grab" and found[-1] == found[max(0, len(found) - 2)] else 0
        return times >= 2

    found: list[tuple[float, float]] = []
    await until(is_highlighted, f"the handle {name} is highlighted", 20)
    return found[-1]


async def select(screen: Screen, item: str) -> None:
    """Tap an object and wait for its panel."""
    await screen.item(item)
    await screen.page.evaluate("id => window.__engine.focus(id)", item)
    await screen.tap(item)
    await screen.page.get_by_role("region", name=texts.PLACE, exact=True).wait_for()


async def test_drag_of_an_object_is_previewed_to_other_users_and_undone(opened: OpenedScene, browser: Browser) -> None:
    client, tester = opened.client, next(each for each in opened.scene.objects if each.name == "tester")
    await client.call("SubscribeEvents", rpc.SubscribeEventsArgs({"MovePreview"}))
    async with screen_of(browser, opened.cell.url) as screen:
        await screen.join("Eva")
        await select(screen, tester.id)
        before = await opened.pose("tester")
        x, y = await handle(screen, "axis z")
        mouse = screen.page.mouse
        await mouse.move(x, y)
        await mouse.down()
        await mouse.move(x, y - 60, steps=4)
        # Other users see the preview and who drags; the document is unchanged so far.
        preview = await client.next_event("MovePreview")
        assert (preview.data.id, preview.data.user) == (tester.id, "Eva")
        assert not await _succeeds(client, "WriteLock", rpc.WriteLockArgs(tester.id))
        assert await opened.pose("tester") == before
        shown = (await screen.item(tester.id))["pose"]["position"]
        assert shown["z"] > before.position.z + 0.005
        await screen.picture("drag")
        await mouse.up()
        await until(lambda: _has_moved(opened, before.position.z), "the server has the new pose")
        after = await opened.pose("tester")
        assert after.position.z == pytest.approx(shown["z"], abs=1e-9)
        assert (after.position.x, after.position.y, after.orientation) == (
            before.position.x,
            before.position.y,
            before.orientation,
        )
        await until(lambda: _succeeds(client, "WriteLock", rpc.WriteLockArgs(tester.id)), "the lock is released")
        await client.call("WriteUnlock", rpc.WriteUnlockArgs(tester.id))

        # It is one edit, named on the button, undone and redone by keys.
        await screen.page.get_by_role("button", name="Undo moving the object tester").wait_for()
        await screen.page.keyboard.press("Control+z")
        await until(lambda: _is_at(opened, before.position.z), "the move is undone")
        await screen.page.get_by_role("button", name="Redo moving the object tester").wait_for()
        await screen.page.keyboard.press("Control+Shift+Z")
        await until(lambda: _is_at(opened, after.position.z), "the move is redone")

        # Escape cancels a drag.
        x, y = await handle(screen, "axis x")
        await mouse.move(x, y)
        await mouse.down()
        await mouse.move(x + 50, y, steps=3)
        await screen.page.keyboard.press("Escape")
        await mouse.up()
        await screen.until(
            "([id, x]) => Math.abs(window.__engine.item(id).pose.position.x - x) < 1e-9", [tester.id, after.position.x]
        )
        assert await opened.pose("tester") == after

        # An edit of another user in between blocks Undo; the message names the user.
        await until(lambda: _succeeds(client, "WriteLock", rpc.WriteLockArgs(tester.id)), "the lock is released")
        await screen.sees("In use by colleague")
        assert await screen.page.evaluate("window.__engine.gizmo.shown") is False
        await client.call("UpdateObjectPose", rpc.UpdateObjectPoseArgs(tester.id, before))
        await client.call("WriteUnlock", rpc.WriteUnlockArgs(tester.id))
        await screen.page.keyboard.press("Control+z")
        await expect(screen.page.get_by_role("alert").filter(has_text="colleague")).to_be_visible()


async def _has_moved(opened: OpenedScene, z: float) -> bool:
    pose = await opened.pose("tester")
    return abs(pose.position.z - z) > 1e-4


async def _is_at(opened: OpenedScene, z: float) -> bool:
    pose = await opened.pose("tester")
    return abs(pose.position.z - z) < 1e-9


async def test_steps_and_typed_numbers_place_an_object_exactly(opened: OpenedScene, browser: Browser) -> None:
    feeder = next(each for each in opened.scene.objects if each.name == "feeder_box")
    async with screen_of(browser, opened.cell.url, touch=True) as screen:
        await screen.join("Eva")
        await select(screen, feeder.id)
        place = screen.page.get_by_role("region", name=texts.PLACE, exact=True)
        start = await opened.pose("feeder_box")
        before = await opened.client.call("History", rpc.HistoryArgs())
        # Two quick steps are one edit.
        await place.get_by_role("button", name="Increase Z by 1 cm").dblclick()
        await until(lambda: _has_coordinate(opened, "z", start.position.z + 0.02), "two steps up")
        edits = await opened.client.call("History", rpc.HistoryArgs())
        new = [edit for edit in edits.edits if edit not in before.edits]
        assert [edit.request for edit in new] == ["UpdateSceneObjectPose"]

        for typed, axis, value in (
            ("+12.5", "x", start.position.x + 0.0125),
            ("-=3mm", "x", start.position.x + 0.0095),
            ("1in/2", "y", 0.0127),
        ):
            await place.get_by_role("button", name=re.compile(f"^{axis.upper()} .*enter a value")).click()
            await place.get_by_role("textbox").fill(typed)
            await screen.page.keyboard.press("Enter")
            await until(lambda axis=axis, value=value: _has_coordinate(opened, axis, value), typed)  # type: ignore[misc]
        # The keys on the screen enter a relative change in another unit.
        await place.get_by_role("button", name=re.compile("^Z .*enter a value")).click()
        await place.get_by_role("button", name="Change by").click()
        for key in ("minus", "5", "in cm"):
            await place.get_by_role("button", name=key, exact=True).click()
        await screen.picture("number pad")
        await place.get_by_role("button", name="Set", exact=True).click()
        await until(lambda: _has_coordinate(opened, "z", start.position.z + 0.02 - 0.05), "5 cm down")

        # The object is rotated by a typed angle, then aligned to the axes.
        await place.get_by_role("radio", name="Turn").click()
        await place.get_by_role("button", name=re.compile("^Yaw .*enter a value")).click()
        await place.get_by_role("textbox").fill("80")
        await screen.page.keyboard.press("Enter")
        await until(lambda: _has_yaw(opened, math.radians(80)), "turned by 80°")
        await place.get_by_role("button", name="Align to axes").click()
        await until(lambda: _has_yaw(opened, math.pi / 2), "the object is aligned")
        await place.get_by_role("button", name="Reset").click()
        await until(lambda: _has_pose(opened, start), "the initial pose is restored")


async def _has_coordinate(opened: OpenedScene, axis: str, value: float) -> bool:
    pose = await opened.pose("feeder_box")
    return bool(abs(getattr(pose.position, axis) - value) < 1e-9)


async def _has_yaw(opened: OpenedScene, angle: float) -> bool:
    pose = await opened.pose("feeder_box")
    return abs(abs(pose.orientation.z) - math.sin(angle / 2)) < 1e-9


async def _has_pose(opened: OpenedScene, start: Pose) -> bool:
    pose = await opened.pose("feeder_box")
    return (
        math.dist(tuple(pose.position), tuple(start.position)) < 1e-9
        and abs(abs(pose.orientation.w) - abs(start.orientation.w)) < 1e-9
    )


async def test_shapes_are_added_resized_copied_and_removed(opened: OpenedScene, browser: Browser) -> None:
    client = opened.client
    async with screen_of(browser, opened.cell.url) as screen:
        await screen.join("Ida")  # a user without stored settings
        await screen.item(opened.scene.objects[0].id)
        await tool(screen, texts.ADD)
        await screen.press("Cylinder")
        panel = screen.page.get_by_role("complementary")
        await panel.get_by_role("heading", name="cylinder", exact=True).wait_for()
        added = await opened.object("cylinder")
        # It is on top of the object in the middle of the view.
        assert added.pose
        place = screen.page.get_by_role("region", name=texts.PLACE, exact=True)
        await place.get_by_role("radio", name="Size").click()
        await place.get_by_role("button", name=re.compile("^Height .*enter a value")).click()
        await place.get_by_role("textbox").fill("25cm")
        await screen.page.keyboard.press("Enter")
        await until(lambda: _has_size(client, "cylinder", 0.05, 0.25), "25 cm high")
        # Dragging the upper face resizes the object. The lower face stays.
        low = (await opened.pose("cylinder")).position.z - 0.125
        x, y = await handle(screen, "face +z")
        await screen.page.mouse.move(x, y)
        await screen.page.mouse.down()
        await screen.page.mouse.move(x, y - 30, steps=3)
        await screen.page.mouse.up()
        await until(lambda: _taller(client, "cylinder", 0.25), "the cylinder is taller")
        height = await _height(client, "cylinder")
        await until(lambda: _is_centred_at(opened, low + height / 2), "the lower face has not moved")

        await screen.press(texts.DUPLICATE)
        await panel.get_by_role("heading", name="cylinder_2", exact=True).wait_for()
        assert await _height(client, "cylinder_2") == height
        await screen.press(texts.REMOVE)
        await until(lambda: _is_missing(opened, "cylinder_2"), "removed")
        await screen.page.get_by_role("button", name="Undo removing the object cylinder_2").click()
        await until(lambda: opened.has("cylinder_2"), "the removed object is restored")

        # Removing an object in use lists the projects that use it.
        await tool(screen, texts.OBJECTS)
        await screen.page.get_by_role("row", name="tester").click()
        await screen.press(texts.REMOVE)
        await screen.sees("These projects lose the actions")
        await screen.press(texts.CANCEL)
        assert await opened.has("tester")
        # An invalid name is refused with the server's message at the field.
        name = panel.get_by_label("Object name")
        await name.fill("2nd tester")
        await name.press("Enter")
        await expect(panel.get_by_role("alert")).to_contain_text("cannot name an object")
        await name.fill("tester_b")
        await name.press("Enter")
        await until(lambda: opened.has("tester_b"), "renamed")

        # Hidden objects are neither drawn nor selectable. They are stored per user.
        await panel.get_by_text(texts.HIDE).click()
        tester = await opened.object("tester_b")
        await screen.until("id => window.__engine.item(id)?.visible === false", tester.id)
        state = await client.call("GetViewState", rpc.GetViewStateArgs(ViewScope.USER, opened.scene.id, "Ida"))
        assert state.values["blocklist"] == [tester.id]


async def _height(client: Client, name: str) -> float:
    model = next(each for each in await client.call("GetObjectTypes") if each.type == name).object_model
    return float(model.cylinder.height)


async def _has_size(client: Client, name: str, radius: float, height: float) -> bool:
    model = next(each for each in await client.call("GetObjectTypes") if each.type == name).object_model
    return (model.cylinder.radius, model.cylinder.height) == (radius, height)


async def _taller(client: Client, name: str, than: float) -> bool:
    return await _height(client, name) > than + 0.001


async def _is_centred_at(opened: OpenedScene, z: float) -> bool:
    pose = await opened.pose("cylinder")
    return abs(pose.position.z - z) < 1e-9


async def _is_missing(opened: OpenedScene, name: str) -> bool:
    return not await opened.has(name)


def wedge() -> bytes:
    """Return a binary STL of a wedge, 200 × 100 × 150 mm, in mm."""
    a, b, c, d = (0, 0, 0), (200, 0, 0), (0, 100, 0), (0, 0, 150)
    faces = ((a, c, b), (a, b, d), (a, d, c), (b, c, d))
    body = b"".join(struct.pack("<12fH", 0, 0, 0, *(v for corner in face for v in corner), 0) for face in faces)
    return bytes(80) + struct.pack("<I", len(faces)) + body


async def test_devices_are_added_by_a_form_and_meshes_with_their_unit(opened: OpenedScene, browser: Browser) -> None:
    async with screen_of(browser, opened.cell.url) as screen:
        await screen.join("Eva")
        await screen.item(opened.scene.objects[0].id)
        await tool(screen, texts.ADD)
        panel = screen.page.get_by_role("complementary")
        await panel.get_by_label("Search").fill("scale")
        await panel.get_by_role("button", name="Mettler Toledo scale").click()
        submit = panel.locator("form button[type=submit]")
        await expect(panel.get_by_label("Runs on")).to_have_count(0)  # a server without nodes
        await submit.click()
        await expect(panel.get_by_role("alert")).to_contain_text("Required: ")
        needed = await panel.locator(".add-form > .value-field > .value-head > label").all_inner_texts()
        for label in needed:
            await panel.get_by_label(label, exact=True).fill("127.0.0.9")
        await panel.get_by_label("Name", exact=True).fill("kitchen_scale")
        await submit.click()
        await panel.get_by_role("heading", name="kitchen_scale").wait_for()
        scale = await opened.object("kitchen_scale")
        assert not scale.pose  # it has no pose
        assert "127.0.0.9" in {parameter.value.strip('"') for parameter in scale.parameters}

        # Settings are validated in the fields and saved by one request.
        settings = panel.get_by_role("region", name="Settings")
        field = settings.get_by_label(needed[0], exact=True)
        await field.fill("127.0.0.10")
        await field.press("Enter")
        await settings.get_by_role("button", name=texts.SAVE_SETTINGS).click()
        await until(lambda: _setting(opened, "kitchen_scale", "127.0.0.10"), "saved")

        await tool(screen, texts.ADD)
        await screen.press("Mesh…")
        file = panel.locator("input[type=file]")
        await file.set_input_files({"name": "letter.stl", "mimeType": "model/stl", "buffer": b"no mesh"})
        await expect(panel.get_by_role("alert")).to_contain_text("letter.stl")
        await file.set_input_files({"name": "wedge.stl", "mimeType": "model/stl", "buffer": wedge()})
        # An object of 200 m is implausible: the unit is mm.
        await screen.sees("200 × 100 × 150 mm")
        await screen.picture("mesh")
        await screen.press("Upload and add")
        await panel.get_by_role("heading", name="wedge").wait_for()
        added = await opened.object("wedge")
        model = next(each for each in await opened.client.call("GetObjectTypes") if each.type == "wedge").object_model
        assert model.mesh.asset_id
        assert (await screen.item(added.id))["kind"] == "object"


async def _setting(opened: OpenedScene, name: str, value: str) -> bool:
    return value in {parameter.value.strip('"') for parameter in (await opened.object(name)).parameters}
