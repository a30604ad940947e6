"""Recipes: drafts, signatures, refusals, changeover, and the values with which a program runs."""

import sqlite3
from pathlib import Path

import msgspec
import pytest

from arcor2_hw.data.held import OnError
from arcor2_hw.data.project import ProjectParameter
from arcor2_hw.data.recipes import Recipe, RecipeState
from arcor2_hw.data.role import Role
from arcor2_hw.exceptions import InvalidData
from arcor2_server.collaboration.persons import LogOnRefused
from arcor2_server.errors import RequestRefused
from arcor2_server.execution.runs import RunStart

from .conftest import Recorder
from .production import PARAMETERS, SCRIPT, production

SPEED = ProjectParameter("speed", "double", "0.5", id="prm_speed")
LIMITED = {"name": "speed", "value": "0.25", "min": 0.1, "max": 0.4}
NOTES_SPEED = SCRIPT.replace('serial = "A-1"\n', 'speed = 0.5\nserial = "A-1"\n') + "arm.move(str(speed))\n"


def with_speed(cell) -> None:  # type: ignore[no-untyped-def]
    cell.package(script=NOTES_SPEED, parameters=[SPEED, *PARAMETERS])


async def test_a_recipe_is_tested_released_and_retired_by_signatures(tmp_path: Path) -> None:
    async with production(tmp_path) as cell:
        cell.package()
        recipe = await cell.ask("PutRecipe", {"product": "board", "package_id": "pkg_1", "note": "first"})
        assert (recipe.revision, recipe.state, recipe.signatures) == (1, RecipeState.DRAFT, [])
        with pytest.raises(RequestRefused, match="board 1 is a draft; it cannot become released"):
            await cell.sign(recipe.id, "released")
        with pytest.raises(LogOnRefused, match="PIN of tess is wrong"):
            await cell.sign(recipe.id, "tested", pin="9999")
        with pytest.raises(RequestRefused, match=r"olga may not sign this\. It needs the role advanced user"):
            await cell.sign(recipe.id, "tested", person="olga")
        released = await cell.sign(recipe.id, "tested", "released")
        first, second = released.signatures
        assert (first.name, first.meaning, second.meaning) == ("tess", "Tested on this cell", "Released for production")
        assert released.is_intact()
        assert first.digest != second.digest
        with pytest.raises(RequestRefused, match="board 1 is released and cannot be changed"):
            await cell.ask("PutRecipe", {"id": recipe.id, "product": "board", "package_id": "pkg_1"})
        again = await cell.ask("PutRecipe", {"product": "board", "package_id": "pkg_1"})
        assert again.revision == 2
        retired = await cell.sign(recipe.id, "retired")
        with pytest.raises(RequestRefused, match="board 1 is retired"):
            await cell.run(recipe_id=retired.id)

    async with production(tmp_path) as cell:  # after a restart
        listed = await cell.ask("ListRecipes")
        assert [(each.revision, each.state.value) for each in listed.recipes] == [(2, "draft"), (1, "retired")]


async def test_a_package_with_one_changed_byte_is_refused(tmp_path: Path) -> None:
    async with production(tmp_path) as cell:
        path = cell.package()
        recipe = await cell.released_recipe()
        (path / "package.json").write_text('{"name": "renamed", "built": "2026-01-01T00:00:00+00:00", "executed": "1"}')
        await cell.run(recipe_id=recipe.id)  # name and last run may change
        for file in ("script.py", "data/scene.json", "object_types/arm.py", "package.json"):
            content = (path / file).read_bytes()
            at = content.index(b"2026") if file == "package.json" else len(content) - 2
            (path / file).write_bytes(content[:at] + bytes([content[at] ^ 1]) + content[at + 1 :])
            for refused in (cell.run(recipe_id=recipe.id), cell.ask("ChangeOver", {"id": recipe.id})):
                with pytest.raises(RequestRefused, match="package of board 1 was changed"):
                    await refused
            (path / file).write_bytes(content)
        (path / "more.py").touch()
        with pytest.raises(RequestRefused, match="was changed"):
            await cell.run(recipe_id=recipe.id)
        (path / "more.py").unlink()
        await cell.run(recipe_id=recipe.id)


async def test_an_edited_recipe_is_refused(tmp_path: Path) -> None:
    async with production(tmp_path) as cell:
        with_speed(cell)
        recipe = await cell.released_recipe(values=[LIMITED])
    for before, after in ((b'"max":0.4', b'"max":9.4'), (b'"name":"tess"', b'"name":"olga"')):
        with sqlite3.connect(tmp_path / "data" / "documents.sqlite") as database:
            (document,) = database.execute("select document from recipe").fetchone()
            database.execute("update recipe set document = ?", (document.replace(before, after),))
        async with production(tmp_path) as cell:
            with pytest.raises(RequestRefused, match="board 1 is not as it was signed"):
                await cell.run(recipe_id=recipe.id)
        with sqlite3.connect(tmp_path / "data" / "documents.sqlite") as database:
            database.execute("update recipe set document = ?", (document,))


def test_a_released_recipe_without_signatures_is_not_intact() -> None:
    recipe = Recipe("r", "board", 1, "pkg", "hash", RecipeState.DRAFT, "2026-01-01T00:00:00+00:00")
    assert recipe.is_intact()
    assert not msgspec.structs.replace(recipe, state=RecipeState.RELEASED).is_intact()  # without a signature


async def test_recipe_values_replace_package_values_within_their_limits(tmp_path: Path) -> None:
    async with production(tmp_path) as cell:
        with_speed(cell)
        for value, message in (
            ({"name": "other", "value": "1"}, "no constant or variable other"),
            ({"name": "speed", "value": '"fast"'}, "speed is of the type double"),
            ({"name": "speed", "value": "0.9", "min": 0.1, "max": 0.4}, "speed is 0.9; it must be 0.1 to 0.4"),
            ({"name": "serial", "value": '"B"', "max": 2.0}, "serial is not a number"),
        ):
            with pytest.raises(InvalidData, match=message):
                await cell.ask("PutRecipe", {"product": "board", "package_id": "pkg_1", "values": [value]})
        recipe = await cell.released_recipe(values=[LIMITED, {"name": "serial", "value": '"B-7"'}])
        await cell.run()  # without a recipe
        await cell.run(recipe_id=recipe.id)
        await cell.run(recipe_id=recipe.id, recipe_values={"speed": "0.4"}, order="O-1")
        notes = [note for note in (tmp_path / "notes").read_text().split() if note[0].isdigit()]
        assert notes == ["0.5", "0.25", "0.4"]
        for values, message in (
            ({"speed": "0.41"}, "speed is 0.41; it must be 0.1 to 0.4"),
            ({"serial": '"C"'}, 'recipe fixes serial at "B-7"'),
            ({"place": "1"}, "board 1 has no value place"),
        ):
            with pytest.raises(InvalidData, match=message):
                await cell.run(recipe_id=recipe.id, recipe_values=values)
        run = (await cell.ask("ListRuns", {})).runs[0]
        assert (run.recipe.product, run.recipe.revision, run.order) == ("board", 1, "O-1")
        assert run.recipe.values == {"speed": "0.4", "serial": '"B-7"'}


async def test_operators_run_only_released_recipes_if_configured(tmp_path: Path) -> None:
    async with production(tmp_path, released_only=True) as cell:
        cell.package()
        operator = Recorder("olga")
        operator.role = Role.OPERATOR
        recipe = await cell.ask("PutRecipe", {"product": "board", "package_id": "pkg_1"})
        for options, message in (({}, "Choose a recipe"), ({"recipe_id": recipe.id}, "board 1 is a draft")):
            with pytest.raises(RequestRefused, match=message):
                await cell.ask("RunPackage", {"id": "pkg_1", **options}, operator)
        with pytest.raises(RequestRefused, match=r"board 1 is a draft\. Only released"):
            await cell.ask("ChangeOver", {"id": recipe.id}, operator)
        await cell.run(recipe_id=recipe.id)  # a programmer tests it
        await cell.sign(recipe.id, "tested", "released")
        await cell.ask("RunPackage", {"id": "pkg_1", "recipe_id": recipe.id}, operator)
        await cell.client.state("stopped", "PackageState")
        with pytest.raises(RequestRefused, match="package belongs to board 1, which is released"):
            await cell.ask("DeletePackage", {"id": "pkg_1"})


async def test_a_plc_starts_only_released_packages_if_configured(tmp_path: Path) -> None:
    async with production(tmp_path, released_only=True) as cell:
        cell.package()
        by_plc = RunStart(by="PLC", on_error=OnError.HOLD, by_plc=True)
        recipe = await cell.ask("PutRecipe", {"product": "board", "package_id": "pkg_1"})
        with pytest.raises(RequestRefused, match="only released recipes"):
            await cell.services.execution.run("pkg_1", by_plc)
        await cell.sign(recipe.id, "tested", "released")
        await cell.services.execution.run("pkg_1", by_plc)
        await cell.client.state("stopped", "PackageState")
        (run,) = (await cell.ask("ListRuns", {})).runs
        assert run.recipe.id == recipe.id


async def test_the_cell_is_changed_over_and_rolled_back(tmp_path: Path) -> None:
    async with production(tmp_path) as cell:
        with_speed(cell)
        cell.package("pkg_2", script=NOTES_SPEED.replace("0.5", "0.6"),
                     parameters=[msgspec.structs.replace(SPEED, value="0.6"), *PARAMETERS])  # fmt: skip
        one = await cell.released_recipe(values=[LIMITED])
        two = await cell.released_recipe(package="pkg_2")
        compared = await cell.ask("CompareRecipes", {"before": one.id, "after": two.id})
        assert [(each.name, each.before) for each in compared.values] == [("speed", "0.25")]
        assert [(each.path, each.change.value) for each in compared.files] == [
            ("data/project.json", "changed"),
            ("script.py", "changed"),
        ]
        assert "-    speed = 0.5\n+    speed = 0.6\n" in compared.script
        await cell.ask("ChangeOver", {"id": one.id})
        found = await cell.ask("ChangeOver", {"id": two.id})
        assert (found.recipe_id, found.previous_id, found.by) == (two.id, one.id, "alice")
        back = await cell.ask("ChangeOver", {"id": found.previous_id})
        assert (back.recipe_id, back.previous_id) == (one.id, two.id)
        (tmp_path / "hang").touch()
        await cell.ask("RunPackage", {"id": "pkg_1", "recipe_id": one.id})
        with pytest.raises(RequestRefused, match="program is running"):
            await cell.ask("ChangeOver", {"id": two.id})
        (tmp_path / "hang").unlink()
        await cell.client.state("stopped", "PackageState")
    async with production(tmp_path) as cell:
        assert (await cell.ask("ListRecipes")).changeover.recipe_id == one.id
