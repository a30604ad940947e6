"""A scene is set up in the browser: things added, moved by hand, by steps and numbers, sized, and taken back."""

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
from tests.editor.screen import Screen, screen_of

pytestmark = [pytest.mark.asyncio(loop_scope="module"), pytest.mark.timeout(120)]


@dataclass
class Open:
    cell: Cell
    client: Client
    scene: Scene

    async def objects(self) -> list[SceneObject]:
        """The objects as the server has them now, saved or not: what somebody is told who comes in."""
        async with Client(self.cell.url, "observer", reconnect=False) as observer:
            opened = await observer.next_event("OpenScene", timeout=10)
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


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def made(cell: Cell) -> AsyncIterator[Open]:
    client = await cell.client("colleague")
    scene, _ = await cell.open(client)
    await client.call("CloseProject")
    yield Open(cell, client, scene)


@pytest_asyncio.fixture(loop_scope="module")
async def opened(made: Open) -> AsyncIterator[Open]:
    """The scene is open, with nothing changed; afterwards it is closed, whatever was done."""
    await made.client.call("OpenScene", rpc.IdArgs(made.scene.id))
    yield made
    closing = rpc.CloseSceneArgs(force=True)
    await until(lambda: _granted(made.client, "CloseScene", closing), "the scene is closed")


async def _granted(client: Client, request: str, args: Any) -> bool:
    try:
        await client.call(request, args)
    except Exception:
        return False
    return True


async def tool(screen: Screen, name: str) -> None:
    await screen.page.get_by_role("navigation").get_by_role("button").filter(has_text=name).click()


async def handle(screen: Screen, name: str) -> tuple[float, float]:
    """Move the pointer to a handle of the gizmo, and give where that is on the page.

    The panel that comes with a selection makes the view narrower, a frame later: it is there when the handle is lit
    below the pointer, twice.
    """
    lit = 0

    async def is_lit() -> bool:
        nonlocal lit
        at = await screen.until("name => window.__engine?.gizmo.places()[name]", name)
        box = await screen.page.locator(".view canvas").bounding_box()
        assert box is not None
        found.append((box["x"] + at["x"], box["y"] + at["y"]))
        await screen.page.mouse.move(found[-1][0] + 1, found[-1][1])
        await screen.page.mouse.move(*found[-1])
        await screen.settle()
        cursor = await screen.page.locator(".view canvas").evaluate("canvas => canvas.style.cursor")
        lit = lit + 1 if cursor == "grab" and found[-1] == found[max(0, len(found) - 2)] else 0
        return lit >= 2

    found: list[tuple[float, float]] = []
    await until(is_lit, f"the handle {name} is lit", 20)
    return found[-1]


async def chosen(screen: Screen, item: str) -> None:
    """Somebody taps an object, and its panel is there."""
    await screen.item(item)
    await screen.page.evaluate("id => window.__engine.focus(id)", item)
    await screen.tap(item)
    await screen.page.get_by_role("region", name="Place", exact=True).wait_for()


async def test_a_thing_is_dragged_seen_by_others_and_taken_back(opened: Open, browser: Browser) -> None:
    client, tester = opened.client, next(each for each in opened.scene.objects if each.name == "tester")
    await client.call("SubscribeEvents", rpc.SubscribeEventsArgs({"MovePreview"}))
    async with screen_of(browser, opened.cell.url) as screen:
        await screen.join("Eva")
        await chosen(screen, tester.id)
        before = await opened.pose("tester")
        x, y = await handle(screen, "axis z")
        mouse = screen.page.mouse
        await mouse.move(x, y)
        await mouse.down()
        await mouse.move(x, y - 60, steps=4)
        # The others see it on its way, and who has it in hand; the server has not been asked yet.
        preview = await client.next_event("MovePreview", timeout=10)
        assert (preview.data.id, preview.data.user) == (tester.id, "Eva")
        assert not await _granted(client, "WriteLock", rpc.WriteLockArgs(tester.id))
        assert await opened.pose("tester") == before
        shown = (await screen.item(tester.id))["pose"]["position"]
        assert shown["z"] > before.position.z + 0.005
        await screen.picture("drag")
        await mouse.up()
        await until(lambda: _moved(opened, before.position.z), "the server has it")
        after = await opened.pose("tester")
        assert after.position.z == pytest.approx(shown["z"], abs=1e-9)
        assert (after.position.x, after.position.y, after.orientation) == (
            before.position.x,
            before.position.y,
            before.orientation,
        )
        await until(lambda: _granted(client, "WriteLock", rpc.WriteLockArgs(tester.id)), "the lock is given back")
        await client.call("WriteUnlock", rpc.WriteUnlockArgs(tester.id))

        # One edit, which the button names and the keys take back and do again.
        await screen.page.get_by_role("button", name="Undo moving the object tester").wait_for()
        await screen.page.keyboard.press("Control+z")
        await until(lambda: _is_at(opened, before.position.z), "it is taken back")
        await screen.page.get_by_role("button", name="Redo moving the object tester").wait_for()
        await screen.page.keyboard.press("Control+Shift+Z")
        await until(lambda: _is_at(opened, after.position.z), "it is done again")

        # Escape in mid-drag leaves all as it was.
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

        # What another has changed since is not undone, and says by whom.
        await client.call("WriteLock", rpc.WriteLockArgs(tester.id))
        await screen.sees("colleague works on it")
        assert await screen.page.evaluate("window.__engine.gizmo.shown") is False
        await client.call("UpdateObjectPose", rpc.UpdateObjectPoseArgs(tester.id, before))
        await client.call("WriteUnlock", rpc.WriteUnlockArgs(tester.id))
        await screen.page.keyboard.press("Control+z")
        await expect(screen.page.get_by_role("alert").filter(has_text="colleague")).to_be_visible()


async def _moved(opened: Open, z: float) -> bool:
    pose = await opened.pose("tester")
    return abs(pose.position.z - z) > 1e-4


async def _is_at(opened: Open, z: float) -> bool:
    pose = await opened.pose("tester")
    return abs(pose.position.z - z) < 1e-9


async def test_steps_and_typed_amounts_put_it_exactly(opened: Open, browser: Browser) -> None:
    feeder = next(each for each in opened.scene.objects if each.name == "feeder_box")
    async with screen_of(browser, opened.cell.url, touch=True) as screen:
        await screen.join("Eva")
        await chosen(screen, feeder.id)
        place = screen.page.get_by_role("region", name="Place", exact=True)
        start = await opened.pose("feeder_box")
        before = await opened.client.call("History", rpc.HistoryArgs())
        # Two steps that come quickly are one edit: three taps from nothing selected to 20 mm up.
        await place.get_by_role("button", name="Z 1 cm more").dblclick()
        await until(lambda: _at(opened, "z", start.position.z + 0.02), "two steps up")
        edits = await opened.client.call("History", rpc.HistoryArgs())
        new = [edit for edit in edits.edits if edit not in before.edits]
        assert [edit.request for edit in new] == ["UpdateObjectPose"]

        for typed, axis, value in (
            ("+12.5", "x", start.position.x + 0.0125),
            ("-=3mm", "x", start.position.x + 0.0095),
            ("1in/2", "y", 0.0127),
        ):
            await place.get_by_role("button", name=re.compile(f"^{axis.upper()} .*type it")).click()
            await place.get_by_role("textbox").fill(typed)
            await screen.page.keyboard.press("Enter")
            await until(lambda axis=axis, value=value: _at(opened, axis, value), typed)  # type: ignore[misc]
        # By the keys on the screen alone, in another unit, as a change.
        await place.get_by_role("button", name=re.compile("^Z .*type it")).click()
        await place.get_by_role("button", name="Change by").click()
        for key in ("minus", "5", "in cm"):
            await place.get_by_role("button", name=key, exact=True).click()
        await screen.picture("number pad")
        await place.get_by_role("button", name="Set", exact=True).click()
        await until(lambda: _at(opened, "z", start.position.z + 0.02 - 0.05), "5 cm down")

        # Turned by a typed angle, about its own axes, to the raster of quarter turns.
        await place.get_by_role("radio", name="Turn").click()
        await place.get_by_role("button", name=re.compile("^Yaw .*type it")).click()
        await place.get_by_role("textbox").fill("80")
        await screen.page.keyboard.press("Enter")
        await until(lambda: _yaw(opened, math.radians(80)), "turned by 80°")
        await place.get_by_role("button", name="Square up").click()
        await until(lambda: _yaw(opened, math.pi / 2), "squared")
        await place.get_by_role("button", name="Put back").click()
        await until(lambda: _same(opened, start), "as it was at first")


async def _at(opened: Open, axis: str, value: float) -> bool:
    pose = await opened.pose("feeder_box")
    return bool(abs(getattr(pose.position, axis) - value) < 1e-9)


async def _yaw(opened: Open, angle: float) -> bool:
    pose = await opened.pose("feeder_box")
    return abs(abs(pose.orientation.z) - math.sin(angle / 2)) < 1e-9


async def _same(opened: Open, start: Pose) -> bool:
    pose = await opened.pose("feeder_box")
    return (
        math.dist(tuple(pose.position), tuple(start.position)) < 1e-9
        and abs(abs(pose.orientation.w) - abs(start.orientation.w)) < 1e-9
    )


async def test_shapes_are_added_by_one_tap_sized_copied_and_removed(opened: Open, browser: Browser) -> None:
    client = opened.client
    async with screen_of(browser, opened.cell.url) as screen:
        await screen.join("Ida")  # whose number pad is as it comes
        await screen.item(opened.scene.objects[0].id)
        await tool(screen, "Add")
        await screen.press("Cylinder")
        panel = screen.page.get_by_role("complementary")
        await panel.get_by_role("heading", name="cylinder", exact=True).wait_for()
        added = await opened.object("cylinder")
        # It stands on what is in the middle of the view, not in it.
        assert added.pose
        place = screen.page.get_by_role("region", name="Place", exact=True)
        await place.get_by_role("radio", name="Size").click()
        await place.get_by_role("button", name=re.compile("^Height .*type it")).click()
        await place.get_by_role("textbox").fill("25cm")
        await screen.page.keyboard.press("Enter")
        await until(lambda: _measures(client, "cylinder", 0.05, 0.25), "25 cm high")
        # Pulled by its upper face: the lower one stays.
        low = (await opened.pose("cylinder")).position.z - 0.125
        x, y = await handle(screen, "face +z")
        await screen.page.mouse.move(x, y)
        await screen.page.mouse.down()
        await screen.page.mouse.move(x, y - 30, steps=3)
        await screen.page.mouse.up()
        await until(lambda: _taller(client, "cylinder", 0.25), "pulled")
        height = await _height(client, "cylinder")
        await until(lambda: _stands(opened, low + height / 2), "its lower face has stayed")

        await screen.press("Duplicate")
        await panel.get_by_role("heading", name="cylinder_2", exact=True).wait_for()
        assert await _height(client, "cylinder_2") == height
        await screen.press("Remove")
        await until(lambda: _gone(opened, "cylinder_2"), "removed")
        await screen.page.get_by_role("button", name="Undo removing the object cylinder_2").click()
        await until(lambda: opened.has("cylinder_2"), "it is back")

        # What is needed says by what.
        await tool(screen, "Things")
        await screen.page.get_by_role("row", name="tester").click()
        await screen.press("Remove")
        await screen.sees("These projects use it")
        await screen.press("Cancel")
        assert await opened.has("tester")
        # A name that cannot be is refused in the server's words, where it was typed.
        name = panel.get_by_label("Name of the object")
        await name.fill("2nd tester")
        await name.press("Enter")
        await expect(panel.get_by_role("alert")).to_contain_text("cannot name an object")
        await name.fill("tester_b")
        await name.press("Enter")
        await until(lambda: opened.has("tester_b"), "renamed")

        # Put aside: not seen, not aimed at, and so on the user's next tablet.
        await panel.get_by_text("Hide it, and aim through it").click()
        tester = await opened.object("tester_b")
        await screen.until("id => window.__engine.item(id)?.visible === false", tester.id)
        kept = await client.call("GetViewState", rpc.GetViewStateArgs(ViewScope.USER, opened.scene.id, "Ida"))
        assert kept.values["blocklist"] == [tester.id]


async def _height(client: Client, name: str) -> float:
    model = next(each for each in await client.call("GetObjectTypes") if each.type == name).object_model
    return float(model.cylinder.height)


async def _measures(client: Client, name: str, radius: float, height: float) -> bool:
    model = next(each for each in await client.call("GetObjectTypes") if each.type == name).object_model
    return (model.cylinder.radius, model.cylinder.height) == (radius, height)


async def _taller(client: Client, name: str, than: float) -> bool:
    return await _height(client, name) > than + 0.001


async def _stands(opened: Open, z: float) -> bool:
    pose = await opened.pose("cylinder")
    return abs(pose.position.z - z) < 1e-9


async def _gone(opened: Open, name: str) -> bool:
    return not await opened.has(name)


def wedge() -> bytes:
    """A binary STL of a wedge, 200 × 100 × 150 mm, in mm."""
    a, b, c, d = (0, 0, 0), (200, 0, 0), (0, 100, 0), (0, 0, 150)
    faces = ((a, c, b), (a, b, d), (a, d, c), (b, c, d))
    body = b"".join(struct.pack("<12fH", 0, 0, 0, *(v for corner in face for v in corner), 0) for face in faces)
    return bytes(80) + struct.pack("<I", len(faces)) + body


async def test_devices_by_a_form_and_meshes_with_their_unit(opened: Open, browser: Browser) -> None:
    async with screen_of(browser, opened.cell.url) as screen:
        await screen.join("Eva")
        await screen.item(opened.scene.objects[0].id)
        await tool(screen, "Add")
        panel = screen.page.get_by_role("complementary")
        await panel.get_by_label("Search").fill("scale")
        await panel.get_by_role("button", name="MtSicsScale").click()
        submit = panel.locator("form button[type=submit]")
        await submit.click()
        await expect(panel.get_by_role("alert")).to_contain_text("Still to be said")
        needed = await panel.locator(".add-form > .value-field > .value-head > label").all_inner_texts()
        for label in needed:
            await panel.get_by_label(label, exact=True).fill("127.0.0.9")
        await panel.get_by_label("Name", exact=True).fill("kitchen_scale")
        await submit.click()
        await panel.get_by_role("heading", name="kitchen_scale").wait_for()
        scale = await opened.object("kitchen_scale")
        assert not scale.pose  # it has no place
        assert "127.0.0.9" in {parameter.value.strip('"') for parameter in scale.parameters}

        # Settings are changed together, checked where they are typed, and saved by one request.
        settings = panel.get_by_role("region", name="Settings")
        field = settings.get_by_label(needed[0], exact=True)
        await field.fill("127.0.0.10")
        await field.press("Enter")
        await settings.get_by_role("button", name="Save the settings").click()
        await until(lambda: _setting(opened, "kitchen_scale", "127.0.0.10"), "saved")

        await tool(screen, "Add")
        await screen.press("Mesh…")
        file = panel.locator("input[type=file]")
        await file.set_input_files({"name": "letter.stl", "mimeType": "model/stl", "buffer": b"no mesh"})
        await expect(panel.get_by_role("alert")).to_contain_text("letter.stl")
        await file.set_input_files({"name": "wedge.stl", "mimeType": "model/stl", "buffer": wedge()})
        # Nothing in a workplace is 200 m wide: it is in mm.
        await screen.sees("200 × 100 × 150 mm")
        await screen.picture("mesh")
        await screen.press("Upload and add")
        await panel.get_by_role("heading", name="wedge").wait_for()
        added = await opened.object("wedge")
        model = next(each for each in await opened.client.call("GetObjectTypes") if each.type == "wedge").object_model
        assert model.mesh.asset_id
        assert (await screen.item(added.id))["kind"] == "object"


async def _setting(opened: Open, name: str, value: str) -> bool:
    return value in {parameter.value.strip('"') for parameter in (await opened.object(name)).parameters}
