"""The home screen: live lists, renaming in place, deletion with dependencies, packages as files."""

import asyncio
import io
import re
from collections.abc import AsyncIterator

import httpx
import pytest
import pytest_asyncio
from PIL import Image
from playwright.async_api import Browser, expect

from arcor2_hw.client import Client
from arcor2_hw.data import rpc
from arcor2_hw.data.editor import ViewScope
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.object_type import Box, Model3dType, ObjectModel
from arcor2_hw.data.project import Project
from arcor2_hw.data.rpc import ListScenesData
from arcor2_hw.data.scene import Scene
from tests.e2e.harness import Cell, until
from tests.editor import texts
from tests.editor.screen import VIEWPORTS, Screen, screen_of

pytestmark = pytest.mark.asyncio(loop_scope="session")


@pytest_asyncio.fixture(loop_scope="session")
async def documents(cell: Cell) -> AsyncIterator[tuple[Client, Scene, Project]]:
    """A scene and a project, both closed, and a second client."""
    client = await cell.client("colleague")
    scene, project = await cell.open(client)
    await client.call("CloseProject")
    yield client, scene, project


async def choose_from_menu(screen: Screen, name: str, choice: str) -> None:
    await screen.press(f"More about {name}")
    await screen.page.get_by_role("menuitem", name=choice).click()


async def tab(screen: Screen, name: str) -> None:
    await screen.page.get_by_role("radio", name=name).click()


async def names(screen: Screen) -> list[str]:
    return await screen.page.locator(".card h2").all_inner_texts()


async def test_scenes_are_created_renamed_described_copied_and_deleted(
    documents: tuple[Client, Scene, Project], cell: Cell, browser: Browser
) -> None:
    client, scene, project = documents
    async with screen_of(browser, cell.url) as screen:
        await screen.join("Eva")
        await tab(screen, texts.SCENES)
        await screen.press(texts.NEW_SCENE)
        await screen.page.get_by_label("Name").fill("Second cell")
        await screen.press(texts.CREATE)
        await screen.page.get_by_role("heading", name="Second cell").wait_for()
        await screen.press(texts.SAVE)
        await screen.sees("scene · saved")
        await screen.press(texts.CLOSE_DOCUMENT)
        await tab(screen, texts.SCENES)
        await screen.page.get_by_role("heading", name="Second cell").wait_for()

        # A name in use is reported in the field, before a request is sent.
        await choose_from_menu(screen, "Second cell", "Rename…")
        field = screen.page.get_by_label("New name of Second cell")
        await field.fill(scene.name)
        await screen.sees("This name is already in use.")
        await field.fill("Cell 2")
        await field.press("Enter")
        await screen.page.get_by_role("heading", name="Cell 2").wait_for()
        assert {each.name for each in await client.call("ListScenes")} == {scene.name, "Cell 2"}

        await choose_from_menu(screen, "Cell 2", "Describe…")
        await screen.page.get_by_label("Description of Cell 2").fill("For trials.")
        await screen.press("Save")
        await until(lambda: _described(client, "For trials."), "the description is stored")
        await expect(screen.page.locator(".card p.description").filter(has_text="For trials.")).to_be_visible()
        second = next(each for each in await client.call("ListScenes") if each.name == "Cell 2")

        await choose_from_menu(screen, "Cell 2", "Duplicate…")
        await screen.page.get_by_label("Name").fill("Cell 10")
        await screen.press(texts.DUPLICATE)
        await screen.page.get_by_role("heading", name="Cell 10").wait_for()

        # Natural sorting; search includes descriptions; favorites are stored per user.
        await screen.page.get_by_label("Sort by").select_option("name")
        await until(lambda: _listed_names_are(screen, ["Cell 2", "Cell 10", scene.name]), "sorted by name")
        await screen.page.get_by_label("Search").fill("trials")
        await until(lambda: _listed_names_are(screen, ["Cell 2", "Cell 10"]), "found by description")
        await screen.page.get_by_label("Search").fill("")
        await screen.press("Add Cell 2 to favorites")
        await screen.press("Favorites only")
        await until(lambda: _listed_names_are(screen, ["Cell 2"]), "only the favorite is listed")
        # The server stores favorites, so they survive a reload.
        await screen.page.reload()
        await tab(screen, texts.SCENES)
        await screen.page.get_by_role("button", name="Remove Cell 2 from favorites").wait_for()

        # Deletions by other users are shown.
        await client.call("DeleteScene", rpc.IdArgs(second.id))
        await expect(screen.page.get_by_role("heading", name="Cell 2")).to_have_count(0)
        await choose_from_menu(screen, "Cell 10", "Delete…")
        await screen.press("Delete")
        await until(lambda: _listed_names_are(screen, [scene.name]), "deleted")
        assert [each.name for each in await client.call("ListScenes")] == [scene.name]

        # The dialog for a scene in use lists its projects and opens them.
        await choose_from_menu(screen, scene.name, "Delete…")
        await screen.sees("Delete the projects of this scene first")
        await screen.picture("home deletion")
        await screen.press(texts.open_document(project.name))
        await screen.page.get_by_role("heading", name=project.name).wait_for()
        await screen.press(texts.CLOSE_DOCUMENT)
        await screen.page.get_by_role("radio", name=texts.PROJECTS).wait_for()


async def _described(client: Client, text: str) -> bool:
    return any(each.description == text for each in await client.call("ListScenes"))


async def _listed_names_are(screen: Screen, wanted: list[str]) -> bool:
    return await names(screen) == wanted


async def test_project_pictures_and_templates_are_shared(
    documents: tuple[Client, Scene, Project], cell: Cell, browser: Browser
) -> None:
    client, scene, project = documents
    async with screen_of(browser, cell.url, drawn=True) as screen:
        await screen.join("Eva")
        await tab(screen, texts.SCENES)
        await screen.press(f"Projects on {scene.name}")
        await screen.sees(f"on {scene.name}")
        assert await names(screen) == [project.name]
        await screen.press(texts.open_document(project.name))
        await screen.item(scene.objects[0].id)
        await client.call("AddActionPoint", rpc.AddActionPointArgs("here", project.action_points[0].position))
        await screen.sees(texts.NOT_SAVED)
        await screen.press(texts.SAVE)
        await expect(screen.page.get_by_text(texts.NOT_SAVED)).to_have_count(0)
        await screen.press(texts.CLOSE_DOCUMENT)
        picture = screen.page.locator(f".card[data-id='{project.id}'] img")
        await picture.wait_for()
        assert await picture.evaluate(
            "image => image.decode().then(() => [image.naturalWidth, image.naturalHeight])"
        ) == [320, 180]
        # Other users see it, too.
        view_state = await client.call("GetViewState", rpc.GetViewStateArgs(ViewScope.SHARED, project.id))
        assert view_state.values["thumbnail"].startswith("data:image/")

        # An uploaded picture replaces it for all users, also after the next save, until it is removed.
        red = Image.new("RGB", (640, 480), (200, 30, 30))
        with io.BytesIO() as content:
            red.save(content, "PNG")
            png = content.getvalue()
        picture_field = screen.page.get_by_label(f"Picture of {project.name}")
        await picture_field.set_input_files({"name": "cell.png", "mimeType": "image/png", "buffer": png})
        shown = "id => document.querySelector(`.card[data-id='${id}'] img`)?.src"
        await until(
            lambda: _uploaded_picture_is_shown(client, screen, project.id, shown), "the uploaded picture is shown"
        )
        view_state = await client.call("GetViewState", rpc.GetViewStateArgs(ViewScope.SHARED, project.id))
        assert await screen.page.evaluate(_COLOUR, view_state.values["picture"]) == pytest.approx([200, 30, 30], abs=6)
        await picture_field.set_input_files({"name": "letter.png", "mimeType": "image/png", "buffer": b"no picture"})
        await screen.sees("The browser cannot read this picture file.")
        await choose_from_menu(screen, project.name, "Use the 3D view as picture")
        await screen.until(f"([id, taken]) => ({shown})(id) === taken", [project.id, view_state.values["thumbnail"]])

        # Templates are offered for new projects.
        await choose_from_menu(screen, project.name, "Use as a template")
        await screen.page.locator(f".card[data-id='{project.id}']").get_by_text("template", exact=True).wait_for()
        await screen.press(texts.NEW_PROJECT)
        await screen.page.get_by_label("Start from").select_option(label=f"a copy of {project.name}")
        await screen.page.get_by_label("Name").fill("From a template")
        await screen.picture("home template")
        await screen.press(texts.CREATE)
        await screen.page.get_by_role("heading", name="From a template").wait_for()
        created = next(each for each in await client.call("ListProjects") if each.name == "From a template")
        copy = await client.call("GetProject", rpc.IdArgs(created.id))
        source = await client.call("GetProject", rpc.IdArgs(project.id))
        assert [each.name for each in copy.action_points] == [each.name for each in source.action_points]
        await screen.press(texts.CLOSE_DOCUMENT)
        await screen.page.get_by_label("Sort by").select_option("recent")
        await until(
            lambda: _listed_names_are(screen, ["From a template", project.name]),
            "the project that was opened last is first",
        )
        await client.call("DeleteProject", rpc.IdArgs(created.id))
        await until(lambda: _listed_names_are(screen, [project.name]), "deleted")

        await screen.press(f"Scene of {project.name}")
        await screen.page.get_by_role("button", name=texts.open_document(scene.name)).wait_for()
        await choose_from_menu(screen, scene.name, "New project…")
        await screen.page.get_by_label("Name").fill("From the scene")
        await screen.press(texts.CREATE)
        await screen.sees(f"on {scene.name} ·")
        await screen.press(texts.CLOSE_DOCUMENT)
        await screen.press(texts.DISCARD_CHANGES)
        await screen.page.get_by_role("radio", name=texts.PROJECTS).wait_for()


_COLOUR = """async (address) => {
  const image = Object.assign(new Image(), { src: address });
  await image.decode();
  const canvas = Object.assign(document.createElement("canvas"), { width: 1, height: 1 });
  const context = canvas.getContext("2d");
  context.drawImage(image, 0, 0, 1, 1);
  return [...context.getImageData(0, 0, 1, 1).data].slice(0, 3);
}"""
"""Average colour of a picture."""


async def _uploaded_picture_is_shown(client: Client, screen: Screen, document: str, shown: str) -> bool:
    view_state = await client.call("GetViewState", rpc.GetViewStateArgs(ViewScope.SHARED, document))
    uploaded: str | None = view_state.values.get("picture")
    return uploaded is not None and await screen.page.evaluate(shown, document) == uploaded


async def test_packages_are_listed_live_downloaded_uploaded_and_run(
    documents: tuple[Client, Scene, Project], cell: Cell, browser: Browser
) -> None:
    client, _, project = documents
    async with screen_of(browser, cell.url) as screen:
        await screen.join("Eva")
        await tab(screen, texts.PACKAGES)
        await screen.sees("No packages yet")
        await client.call("OpenProject", rpc.IdArgs(project.id))
        # Builds of other users are shown in the message bar on every screen.
        bar = screen.page.get_by_role("region", name=texts.MESSAGE_BAR)
        await asyncio.gather(
            client.call("BuildProject", rpc.BuildProjectArgs(project.id, "sorting 1"), timeout=60),
            bar.locator(".task").filter(has_text="Building the package sorting 1 · colleague").wait_for(),
        )
        await client.call("CloseProject")
        await tab(screen, texts.PACKAGES)
        await screen.page.get_by_role("heading", name="sorting 1").wait_for()
        await screen.sees("not run yet")
        async with screen.page.expect_download() as downloading:
            await choose_from_menu(screen, "sorting 1", "Download")
        file = await (await downloading.value).path()
        content = file.read_bytes()
        assert content[:2] == b"PK"

        await screen.page.locator("input[type=file]").set_input_files(
            {"name": "copy.zip", "mimeType": "application/zip", "buffer": content}
        )
        await bar.locator(".task").filter(has_text="Uploading the package copy").wait_for()
        await screen.sees("Uploaded copy.zip.")
        await until(lambda: _packages(client, 2), "both packages are listed")
        await expect(screen.page.locator(".card")).to_have_count(2)
        copy = next(each for each in await client.call("ListPackages") if each.id == "copy")
        await client.call("RenamePackage", rpc.RenamePackageArgs(copy.id, "from a file"))
        await screen.page.get_by_role("heading", name="from a file").wait_for()
        await choose_from_menu(screen, "from a file", "Delete…")
        await screen.press("Delete")
        await until(lambda: _packages(client, 1), "the copy is deleted")
        await expect(screen.page.locator(".card")).to_have_count(1)

        # The package is started paused from its tile. Afterwards the tile shows the last run.
        await choose_from_menu(screen, "sorting 1", texts.START_PAUSED)
        program = screen.page.get_by_role("group", name=texts.PROGRAM_STATE)
        await program.get_by_text("Paused").wait_for()
        await screen.picture("home package paused")
        await program.get_by_role("button", name=texts.STOP).click()
        await screen.page.get_by_role("radio", name=texts.PACKAGES).wait_for()
        await tab(screen, texts.PACKAGES)
        await screen.sees(re.compile(rf"last run {texts.AGO}: stopped"))
        (run,) = (await client.call("ListRuns")).runs
        assert (run.package_name, run.started_by, run.stopped_by) == ("sorting 1", "Eva", "Eva")

        # A file that is not a package is refused with the server's message, which stays.
        screen.expected_errors = ("Failed to load resource",)
        await screen.page.locator("input[type=file]").set_input_files(
            {"name": "letter.zip", "mimeType": "application/zip", "buffer": b"no zip at all"}
        )
        await screen.page.get_by_role("alert").wait_for()


LAMP = """from arcor2_hw.objects import GenericWithPose


class %s(GenericWithPose):
    \"\"\"A lamp.\"\"\"

    _ABSTRACT = False
"""


async def test_problems_are_shown_on_tiles_and_fixed_from_there(
    documents: tuple[Client, Scene, Project], cell: Cell, browser: Browser
) -> None:
    client, _, _ = documents
    async with httpx.AsyncClient(timeout=60, base_url=cell.url.replace("ws", "http", 1)) as rest:
        for kind in ("Lamp", "Torch", "Spare"):
            source = {"id": kind, "name": kind, "source": LAMP % kind, "description": ""}
            assert (await rest.put("/object-types", json=source)).status_code == 200
        await client.call("NewScene", rpc.NewSceneArgs("lamps"))
        for kind in ("Lamp", "Torch"):
            await client.call("AddObjectToScene", rpc.AddObjectToSceneArgs(kind.lower(), kind, Pose()))
        model = ObjectModel(Model3dType.BOX, box=Box("sill", 1.0, 0.2, 0.02))
        await client.call(
            "AddVirtualCollisionObjectToScene", rpc.AddVirtualCollisionObjectToSceneArgs("sill", Pose(), model)
        )
        await client.call("SaveScene")
        await until(lambda: _listed(client, "lamps"), "saved")
        async with screen_of(browser, cell.url) as screen:
            # An unused type can be deleted; others name the scenes that use them.
            await screen.join("Eva")
            panel = screen.page.get_by_role("complementary")
            await screen.page.get_by_role("navigation").get_by_role("button", name=texts.ADD).click()
            await panel.get_by_role("button", name="Torch").click()
            await screen.sees("Used in lamps.")
            delete = panel.get_by_role("button", name="Delete type")
            await expect(delete).to_have_attribute("aria-disabled", "true")
            await screen.press("← All types")
            await panel.get_by_role("button", name="Spare").click()
            await screen.sees("Not used in any saved scene.")
            await delete.click()
            await screen.press("Delete")
            await until(lambda: _type_exists(client, "Spare", expected=False), "the type is deleted")
            await expect(panel.get_by_role("button", name="Spare")).to_have_count(0)

            scene = await _listed(client, "lamps")
            assert scene is not None
            await client.call("NewProject", rpc.NewProjectArgs(scene.id, "lighting"))
            await client.call("SaveProject")
            await client.call("CloseProject")
            await tab(screen, texts.PROJECTS)
            await screen.page.get_by_role("heading", name="lighting").wait_for()
            for kind in ("Lamp", "Torch"):
                assert (await rest.delete(f"/object-types/{kind}")).status_code == 200
            # All problems are listed without a reload; the project refers to its scene.
            card = screen.page.locator(".card").filter(has=screen.page.get_by_role("heading", name="lighting"))
            await card.get_by_text("2 problems").click()
            await card.get_by_text("lamp: the object type Lamp does not exist.").wait_for()
            await card.get_by_text("torch: the object type Torch does not exist.").wait_for()
            await expect(card.get_by_role("button", name="Open lighting")).to_have_attribute("aria-disabled", "true")
            assert await screen.faults() == []
            await screen.picture("home problems")
            await screen.page.emulate_media(color_scheme="dark")
            await screen.page.set_viewport_size(VIEWPORTS["phone"])  # type: ignore[arg-type]
            await screen.settle()
            assert await screen.faults() == []
            assert await screen.barriers() == []
            await screen.picture("home problems phone")
            await screen.press("Show the scene of lighting")
            card = screen.page.locator(".card").filter(has=screen.page.get_by_role("heading", name="lamps"))
            await card.get_by_text("2 problems").click()
            await screen.press("Repair lamps")
            await screen.sees("are removed from the scene: lamp, torch.")
            await screen.picture("home repair")
            await screen.press("Remove objects")
            await screen.sees("lamps can be opened again.")
            await screen.page.get_by_role("heading", name="lamps backup").wait_for()
            stored = {each.name: each for each in await client.call("ListScenes")}
            assert not stored["lamps"].problems
            assert len(stored["lamps backup"].problems) == 2
            await tab(screen, texts.PROJECTS)
            await screen.page.get_by_label("Search").fill("")
            await screen.press("Open lighting")
            await screen.page.get_by_role("heading", name="lighting").wait_for()
            await screen.press(texts.CLOSE_DOCUMENT)
            await screen.page.get_by_role("radio", name=texts.PROJECTS).wait_for()


async def _listed(client: Client, name: str) -> ListScenesData | None:
    return next((each for each in await client.call("ListScenes") if each.name == name), None)


async def _type_exists(client: Client, kind: str, *, expected: bool) -> bool:
    return (kind in {each.type for each in await client.call("GetObjectTypes")}) is expected


async def _packages(client: Client, count: int) -> bool:
    return len(await client.call("ListPackages")) == count
