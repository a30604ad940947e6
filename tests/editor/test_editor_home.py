"""The home screen: lists that follow the server, names where they stand, what a deletion needs, packages as files."""

from collections.abc import AsyncIterator

import pytest
import pytest_asyncio
from playwright.async_api import Browser, expect

from arcor2_hw.client import Client
from arcor2_hw.data import rpc
from arcor2_hw.data.editor import ViewScope
from arcor2_hw.data.project import Project
from arcor2_hw.data.scene import Scene
from tests.e2e.harness import Cell, until
from tests.editor.screen import Screen, screen_of

pytestmark = [pytest.mark.asyncio(loop_scope="module"), pytest.mark.timeout(120)]


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def made(cell: Cell) -> AsyncIterator[tuple[Client, Scene, Project]]:
    """A scene and a project on it, both closed, and a second person."""
    client = await cell.client("colleague")
    scene, project = await cell.open(client)
    await client.call("CloseProject")
    yield client, scene, project


async def more(screen: Screen, name: str, choice: str) -> None:
    await screen.press(f"More about {name}")
    await screen.page.get_by_role("menuitem", name=choice).click()


async def tab(screen: Screen, name: str) -> None:
    await screen.page.get_by_role("radio", name=name).click()


async def names(screen: Screen) -> list[str]:
    return await screen.page.locator(".card h2").all_inner_texts()


async def test_scenes_are_made_named_described_copied_and_deleted(
    made: tuple[Client, Scene, Project], cell: Cell, browser: Browser
) -> None:
    client, scene, project = made
    async with screen_of(browser, cell.url) as screen:
        await screen.join("Eva")
        await tab(screen, "Scenes")
        await screen.press("New scene")
        await screen.page.get_by_label("Name").fill("Second cell")
        await screen.press("Make and open")
        await screen.page.get_by_role("heading", name="Second cell").wait_for()
        await screen.press("Save")
        await screen.sees("scene · saved")
        await screen.press("Close, and go to the lists")
        await tab(screen, "Scenes")
        await screen.page.get_by_role("heading", name="Second cell").wait_for()

        # A name that is taken is told where it is typed, before anything is asked.
        await more(screen, "Second cell", "Rename…")
        field = screen.page.get_by_label("New name of Second cell")
        await field.fill(scene.name)
        await screen.sees("There is one of that name.")
        await field.fill("Cell 2")
        await field.press("Enter")
        await screen.page.get_by_role("heading", name="Cell 2").wait_for()
        assert {each.name for each in await client.call("ListScenes")} == {scene.name, "Cell 2"}

        await more(screen, "Cell 2", "Describe…")
        await screen.page.get_by_label("Description of Cell 2").fill("For tries.")
        await screen.press("Keep")
        await until(lambda: _described(client, "For tries."), "described")
        await expect(screen.page.locator(".card p.description").filter(has_text="For tries.")).to_be_visible()
        second = next(each for each in await client.call("ListScenes") if each.name == "Cell 2")

        await more(screen, "Cell 2", "Duplicate…")
        await screen.page.get_by_label("Name").fill("Cell 10")
        await screen.press("Duplicate")
        await screen.page.get_by_role("heading", name="Cell 10").wait_for()

        # Sorted as people sort; searched also by description; the star is the user's on every screen.
        await screen.page.get_by_label("Sort by").select_option("name")
        await until(lambda: _are(screen, ["Cell 2", "Cell 10", scene.name]), "sorted by name")
        await screen.page.get_by_label("Search").fill("tries")
        await until(lambda: _are(screen, ["Cell 2", "Cell 10"]), "found by description")
        await screen.page.get_by_label("Search").fill("")
        await screen.press("Give Cell 2 a star")
        await screen.press("Only what has a star")
        await until(lambda: _are(screen, ["Cell 2"]), "the star alone")
        # The server keeps it: the page has forgotten everything.
        await screen.page.reload()
        await tab(screen, "Scenes")
        await screen.page.get_by_role("button", name="Take the star of Cell 2 away").wait_for()

        # What is deleted elsewhere goes here by itself.
        await client.call("DeleteScene", rpc.IdArgs(second.id))
        await expect(screen.page.get_by_role("heading", name="Cell 2")).to_have_count(0)
        await more(screen, "Cell 10", "Delete…")
        await screen.press("Delete")
        await until(lambda: _are(screen, [scene.name]), "deleted")
        assert [each.name for each in await client.call("ListScenes")] == [scene.name]

        # A scene that is needed says by what, and leads there.
        await more(screen, scene.name, "Delete…")
        await screen.sees("have to be deleted first")
        await screen.picture("home deletion")
        await screen.press(f"Open {project.name}")
        await screen.page.get_by_role("heading", name=project.name).wait_for()
        await screen.press("Close, and go to the lists")
        await screen.page.get_by_role("radio", name="Projects").wait_for()


async def _described(client: Client, text: str) -> bool:
    return any(each.description == text for each in await client.call("ListScenes"))


async def _are(screen: Screen, wanted: list[str]) -> bool:
    return await names(screen) == wanted


async def test_what_belongs_together_is_found_and_a_saved_workplace_has_a_picture(
    made: tuple[Client, Scene, Project], cell: Cell, browser: Browser
) -> None:
    client, scene, project = made
    async with screen_of(browser, cell.url) as screen:
        await screen.join("Eva")
        await tab(screen, "Scenes")
        await screen.press(f"Projects on {scene.name}")
        await screen.sees(f"on {scene.name}")
        assert await names(screen) == [project.name]
        await screen.press(f"Open {project.name}")
        await screen.item(scene.objects[0].id)
        await client.call("AddActionPoint", rpc.AddActionPointArgs("here", project.action_points[0].position))
        await screen.sees("not saved")
        await screen.press("Save")
        await screen.press("Close, and go to the lists")
        picture = screen.page.locator(f".card[data-id='{project.id}'] img")
        await picture.wait_for()
        assert await picture.evaluate(
            "image => image.decode().then(() => [image.naturalWidth, image.naturalHeight])"
        ) == [320, 180]
        # Others have it, too.
        kept = await client.call("GetViewState", rpc.GetViewStateArgs(ViewScope.SHARED, project.id))
        assert kept.values["thumbnail"].startswith("data:image/")

        await screen.press(f"Scene of {project.name}")
        await screen.page.get_by_role("button", name=f"Open {scene.name}").wait_for()
        await more(screen, scene.name, "New project on it…")
        await screen.page.get_by_label("Name").fill("From the scene")
        await screen.press("Make and open")
        await screen.sees(f"on {scene.name} ·")
        await screen.press("Close, and go to the lists")
        await screen.press("Throw the changes away")
        await screen.page.get_by_role("radio", name="Projects").wait_for()


async def test_packages_come_live_and_go_as_files(
    made: tuple[Client, Scene, Project], cell: Cell, browser: Browser
) -> None:
    client, _, project = made
    async with screen_of(browser, cell.url) as screen:
        await screen.join("Eva")
        await tab(screen, "Packages")
        await screen.sees("No package yet")
        await client.call("OpenProject", rpc.IdArgs(project.id))
        await client.call("BuildProject", rpc.BuildProjectArgs(project.id, "sorting 1"), timeout=60)
        await client.call("CloseProject")
        await tab(screen, "Packages")
        await screen.page.get_by_role("heading", name="sorting 1").wait_for()
        await screen.sees("has not run yet")
        async with screen.page.expect_download() as downloading:
            await more(screen, "sorting 1", "Download")
        file = await (await downloading.value).path()
        content = file.read_bytes()
        assert content[:2] == b"PK"

        await screen.page.locator("input[type=file]").set_input_files(
            {"name": "brought.zip", "mimeType": "application/zip", "buffer": content}
        )
        await screen.sees("brought.zip is taken in.")
        await until(lambda: _packages(client, 2), "the package is there twice")
        await expect(screen.page.locator(".card")).to_have_count(2)
        brought = next(each for each in await client.call("ListPackages") if each.id == "brought")
        await client.call("RenamePackage", rpc.RenamePackageArgs(brought.id, "from a file"))
        await screen.page.get_by_role("heading", name="from a file").wait_for()
        await more(screen, "from a file", "Delete…")
        await screen.press("Delete")
        await until(lambda: _packages(client, 1), "it is deleted")
        await expect(screen.page.locator(".card")).to_have_count(1)

        # What is no package is refused with the server's sentence, and stays told.
        screen.expected_errors = ("Failed to load resource",)
        await screen.page.locator("input[type=file]").set_input_files(
            {"name": "letter.zip", "mimeType": "application/zip", "buffer": b"no zip at all"}
        )
        await screen.page.get_by_role("alert").wait_for()


async def _packages(client: Client, count: int) -> bool:
    return len(await client.call("ListPackages")) == count
