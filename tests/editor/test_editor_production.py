"""A recipe is added, signed and chosen; the operator produces it, and the record of the unit is found by its number."""

import re
from pathlib import Path

import pytest
from msgspec.structs import replace
from playwright.async_api import Browser, Page, expect

from arcor2_hw.client import Client
from arcor2_hw.data.project import ProjectParameter
from arcor2_hw.data.recipes import RecipeState
from tests.editor.screen import VIEWPORTS, Screen, screen_of
from tests.runtime.test_host_parts import BODY, PROJECT, write_package
from tests.server.core.serving import running

pytestmark = pytest.mark.asyncio(loop_scope="session")

PIN = "2580"
SCRIPT = (
    BODY.replace("\narm =", "\narm: object =", 1)
    + 'serial = "A-1"\nlabels: int = 2\n'
    + 'arm.scan(serial, an="scan")\narm.pick(stop, an="pick")\narm.place(inside, an="insert")\n'
    + 'arm.test(True, an="test")\narm.pick(inside, an="take")\narm.place(box, an="into_box")\n'
)
"""Moves a part from the feeder through the nest into the box for good parts."""


async def sign(page: Page, screen: Screen, button: str) -> None:
    await screen.press(button)
    await page.get_by_label("PIN").fill(PIN)
    await screen.press("Sign")


async def open_production(page: Page, screen: Screen) -> None:
    await screen.press("Settings")
    await page.get_by_role("menuitem", name="Recipes and units").click()


async def check_page(screen: Screen, name: str) -> None:
    """Check that a page fits, and take a picture."""
    await screen.settle()
    await screen.picture(name)
    assert await screen.faults() == []
    assert await screen.barriers() == []


async def test_a_recipe_is_released_and_the_unit_it_produces_is_found(
    tmp_path: Path, built_editor: Path, browser: Browser
) -> None:
    data = tmp_path / "data"
    constant = ProjectParameter("serial", "string", '"A-1"', id="prm_serial")
    project = replace(PROJECT, parameters=[constant, ProjectParameter("labels", "integer", "2", id="prm_labels")])
    write_package(data / "packages" / "pkg_1", tmp_path, SCRIPT, project)
    async with (
        running(data) as server,
        Client(server.url.replace("http", "ws", 1), "setup", reconnect=False) as client,
        screen_of(browser, server.url, touch=True) as screen,
    ):
        await client.add_person(name="Eva", role="technician", pin=PIN)
        first = await client.put_recipe(product="Board", package_id="pkg_1")
        person = (await client.list_persons()).persons[0].id
        for state in (RecipeState.TESTED, RecipeState.RELEASED):
            await client.sign_recipe(id=first.id, state=state, person=person, pin=PIN)
        await client.change_over(first.id)
        page = screen.page
        await screen.join("Eva at the desk")
        await open_production(page, screen)
        await screen.press("Add recipe")
        await page.get_by_label("Product", exact=True).fill("Board")
        await page.get_by_label("Planned parts per hour").fill("60")
        await page.get_by_label("serial, This recipe").fill("B-7")
        for field, text in (("This recipe", "3"), ("Lowest", "1"), ("Highest", "4")):
            await page.get_by_label(f"labels, {field}").fill(text)
        await check_page(screen, "recipe-form")
        await screen.press("Save")
        await screen.press("Sign as tested")
        await check_page(screen, "recipe-sign")
        await screen.press("Cancel")
        await sign(page, screen, "Sign as tested")
        await sign(page, screen, "Release")
        await check_page(screen, "recipes")
        await screen.press("Change over")
        await expect(page.get_by_role("row", name="serial")).to_contain_text('"B-7"')
        await screen.sees("The packages have the same content.")
        await check_page(screen, "recipe-comparison")
        await screen.press("Change over")
        await expect(page.get_by_role("status").filter(has_text="In production")).to_contain_text("Board, revision 2")
        await screen.press("Roll back to Board, revision 1")  # the first tap
        await expect(page.get_by_role("alertdialog")).to_contain_text("Roll back to Board, revision 1?")
        await page.get_by_role("alertdialog").get_by_role("button", name="Cancel").click()
        await screen.press("Close")
        await page.goto(f"{screen.url}/?q=low#/operator")
        await expect(page.get_by_role("radio", name="Board, revision 2")).to_be_checked()
        await page.get_by_label("Order").fill("O-17")
        await screen.sees("B-7")  # fixed by the recipe
        labels = page.get_by_label("labels")
        await expect(labels).to_have_attribute("placeholder", "3")
        await labels.fill("5")
        await screen.sees("labels must be a number: 1 to 4.")
        await expect(page.get_by_role("button", name=re.compile("^Start"))).to_have_attribute("aria-disabled", "true")
        await labels.fill("4")
        for size in VIEWPORTS.values():
            await page.set_viewport_size(size)  # type: ignore[arg-type]
            await check_page(screen, f"operator-product {size['width']}")
        await screen.press("Start")
        await screen.sees("Finished")
        (run,) = (await client.call("ListRuns")).runs
        assert run.recipe.values == {"serial": '"B-7"', "labels": "4"}
        await open_production(page, screen)
        await page.get_by_text("Units", exact=True).click()
        await page.get_by_placeholder("Serial number").fill("b-7")
        row = page.get_by_role("listitem").filter(has_text="B-7")
        await expect(row).to_contain_text("Good")
        await check_page(screen, "units")
        await row.get_by_role("button").click()
        await screen.sees("O-17")
        await screen.sees("into_box")
        await check_page(screen, "unit-record")
