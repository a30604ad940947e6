"""Uploaded meshes and robots in the 3D view, and the reason why a model cannot be shown."""

import io
import zipfile
from collections.abc import AsyncIterator
from dataclasses import dataclass

import httpx
import numpy as np
import pytest
import pytest_asyncio
import trimesh
from playwright.async_api import Browser

from arcor2_hw.data import rpc
from arcor2_hw.data.geometry import Pose, Position
from tests.e2e.harness import Cell
from tests.editor import texts
from tests.editor.screen import screen_of

pytestmark = pytest.mark.asyncio(loop_scope="session")

OBJECT = '''
from arcor2_hw.objects import CollisionObject


class {name}(CollisionObject):
    """An object with a shape."""

    _ABSTRACT = False
'''
ROBOT = '''
from arcor2_hw.objects import Robot


class {name}(Robot):
    """An arm of one joint."""

    _ABSTRACT = False
    urdf_package_name = "{asset}"

    def get_end_effectors_ids(self): return set()
    def get_end_effector_pose(self, end_effector): ...
    def robot_joints(self, include_gripper=False): return []
    def grippers(self): return set()
    def suctions(self): return set()
'''
URDF = """<robot name="turner">
  <link name="base"><visual><geometry><mesh filename="package://turner/meshes/base.stl"/></geometry></visual></link>
  <link name="arm">
    <visual><origin xyz="0.2 0 0.1"/><geometry><mesh filename="meshes/arm.dae" scale="1 1 2"/></geometry></visual>
    <visual><geometry><mesh filename="meshes/cover.stl"/></geometry></visual>
  </link>
  <joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><origin xyz="0 0 0.2"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
</robot>"""
VISE_TRIANGLES = 13_856
"""Triangles shown of the 20,480 that are uploaded: the limit for an object of 0.17 m."""


def exported(mesh: trimesh.Trimesh, kind: str) -> bytes:
    content = mesh.export(file_type=kind)
    return content if isinstance(content, bytes) else str(content).encode()


def vise() -> bytes:
    """Return a PLY ball whose upper half is blue."""
    ball = trimesh.creation.icosphere(subdivisions=5, radius=0.05)
    above = ball.triangles_center[:, 2:] > 0
    colours = np.where(above, [[30, 60, 200, 255]], [[230, 230, 230, 255]]).astype(np.uint8)
    ball.visual = trimesh.visual.ColorVisuals(ball, face_colors=colours)
    return exported(ball, "ply")


def turner() -> bytes:
    arm = exported(trimesh.creation.box((400.0, 60.0, 30.0)), "dae").decode()
    arm = arm.replace("<up_axis>", '<unit meter="0.001"/><up_axis>')
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("turner/turner.urdf", URDF)
        archive.writestr("turner/meshes/base.stl", exported(trimesh.creation.cylinder(0.08, 0.2, sections=48), "stl"))
        archive.writestr("turner/meshes/arm.dae", arm)
        archive.writestr("turner/meshes/cover.stl", b"solid but not really")
    return out.getvalue()


@dataclass
class MeshScene:
    cell: Cell
    ids: dict[str, str]


@pytest_asyncio.fixture(scope="module", loop_scope="session")
async def mesh_scene(module_cell: Cell) -> AsyncIterator[MeshScene]:
    """A scene of uploaded meshes and robots, of which two cannot be shown and one only in part."""
    cell = module_cell
    client = await cell.client("maker")
    async with httpx.AsyncClient(timeout=60, base_url=cell.url.replace("ws", "http", 1)) as http:
        stl = exported(trimesh.creation.box((0.2, 0.1, 0.05)), "stl")
        for key, content in {
            "vise.ply": vise(), "block.stl": stl, "broken.stl": b"solid nothing",
            "turner.zip": turner(), "ruin.zip": b"PK\3\4 but no archive",
        }.items():  # fmt: skip
            sent = await http.post("/assets", params={"id": key}, files={"assetData": (key, content)})
            assert sent.status_code == 200, sent.text
        for name, asset in {"Vise": "vise.ply", "Block": "block.stl", "Broken": "broken.stl"}.items():
            sent = await http.put("/models/mesh", json={"id": name, "assetId": asset})
            assert sent.status_code == 200, sent.text
            model = {"id": name, "type": "Mesh"}
            source = {"id": name, "name": name, "source": OBJECT.format(name=name), "model": model}
            sent = await http.put("/object-types", json=source)
            assert sent.status_code == 200, sent.text
        for name, asset in {"Turner": "turner.zip", "Ruin": "ruin.zip"}.items():
            source = {"id": name, "name": name, "source": ROBOT.format(name=name, asset=asset)}
            sent = await http.put("/object-types", json=source)
            assert sent.status_code == 200, sent.text
    await client.call("NewScene", rpc.NewSceneArgs("meshes"))
    ids = {}
    for number, kind in enumerate(("Vise", "Block", "Broken", "Turner", "Ruin")):
        pose = Pose(Position(0.45 * number - 0.9, 0.0, 0.1 if number < 3 else 0.0))
        await client.call("AddObjectToScene", rpc.AddObjectToSceneArgs(kind.lower(), kind, pose))
        ids[kind] = (await client.next_event("SceneObjectChanged")).data.id
    yield MeshScene(cell, ids)


async def test_uploaded_meshes_are_shown(browser: Browser, mesh_scene: MeshScene) -> None:
    async with screen_of(browser, mesh_scene.cell.url, drawn=True) as screen:
        # The browser's message for the two refused requests.
        screen.expected_errors = ("the server responded with a status of 400",)
        await screen.join("Eva")
        shown = "([id, count]) => window.__engine?.item(id)?.triangles === count"
        await screen.until(shown, [mesh_scene.ids["Vise"], VISE_TRIANGLES])
        await screen.until(shown, [mesh_scene.ids["Block"], 12])
        # A cylinder and a box; the third mesh is broken, the others are shown.
        turner_mesh = (
            "id => window.__engine.item(id).problem.includes('cover.stl') && window.__engine.item(id).triangles"
        )
        assert await screen.until(turner_mesh, mesh_scene.ids["Turner"]) == 4 * 48 + 12
        assert (await screen.item(mesh_scene.ids["Turner"]))["joints"] == {"turn": 0}
        for name in ("Vise", "Block"):
            item = await screen.item(mesh_scene.ids[name])
            assert (item["problem"], item["visible"]) == ("", True)
        await screen.settle()
        await screen.picture("meshes")


async def test_broken_meshes_have_a_placeholder_and_the_reason(browser: Browser, mesh_scene: MeshScene) -> None:
    async with screen_of(browser, mesh_scene.cell.url, drawn=True) as screen:
        screen.expected_errors = ("the server responded with a status of 400",)
        await screen.join("Eva")
        for name, words, badge in (
            ("Broken", "The mesh broken.stl has no triangles", "model cannot be shown"),
            ("Ruin", "ruin.zip is not a zip archive", "model cannot be shown"),
        ):
            await screen.until("id => window.__engine?.item(id)?.problem", mesh_scene.ids[name])
            item = await screen.item(mesh_scene.ids[name])
            assert words in item["problem"]
            assert item["badge"] == badge
            assert item["triangles"] > 0, "no placeholder is shown"
        # The screen shows the newest message; a tap on it lists all.
        newest = screen.page.get_by_role("region", name=texts.MESSAGE_BAR).get_by_role("alert")
        await newest.get_by_text("+2", exact=True).wait_for()
        await newest.get_by_title("Show all messages").click()
        messages = screen.page.get_by_role("dialog", name="Messages").get_by_role("listitem")
        for text in (
            "The model of broken cannot be shown. The mesh broken.stl has no triangles",
            "The model of ruin cannot be shown.",
            "Part of turner cannot be shown.",
        ):
            await messages.filter(has_text=text).wait_for()
