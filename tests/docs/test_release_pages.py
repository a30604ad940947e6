"""The pages about releases and units: their programs run against a server, and their driver is understood."""

import re
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from arcor2_hw.actions.decorator import part_flow_of
from arcor2_hw.analysis import Library, SourceFile
from arcor2_hw.client import Client
from arcor2_hw.data.project import ProjectParameter
from arcor2_hw.data.recipes import RecipeState
from tests.runtime.test_host_parts import PROJECT, write_package
from tests.server.core.serving import running

HOW_TO = Path(__file__).parents[2] / "docs" / "how-to"
RELEASE = (HOW_TO / "release.md").read_text()
UNITS = (HOW_TO / "units.md").read_text()


def code(page: str) -> str:
    (found,) = re.findall(r"^```python\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    return str(found)


async def test_the_program_of_the_page_releases_a_package(tmp_path: Path) -> None:
    names: dict[str, Any] = {}
    exec(code(RELEASE), names)
    project = replace(PROJECT, parameters=[ProjectParameter("speed", "double", "0.5", id="prm_speed")])
    write_package(tmp_path / "data" / "packages" / "pkg_1", tmp_path, "speed = 0.5\n", project)
    async with (
        running(tmp_path / "data", ARCOR2_HW_RELEASED_ONLY="1") as server,
        Client(server.url.replace("http", "ws", 1), "Eva", reconnect=False) as client,
    ):
        person = await client.add_person(name="Eva", role="technician", pin="2580")
        recipe_id = await names["release"](client, "pkg_1", person.id, "2580")
        found = await client.list_recipes()
        assert (found.changeover.recipe_id, found.changeover.released_only) == (recipe_id, True)
        (recipe,) = found.recipes
        assert (recipe.state, recipe.planned_rate) == (RecipeState.RELEASED, 120.0)
        assert [each.name for each in recipe.signatures] == ["Eva", "Eva"]


def test_the_driver_of_the_page_names_serial_number_and_order() -> None:
    analysis = Library([SourceFile("Laser", "laser", code(UNITS))]).analyse("Laser")
    assert analysis.problem is None
    names: dict[str, Any] = {}
    exec(code(UNITS), names)
    flow = part_flow_of(names["Laser"].mark)
    assert (flow.serial, flow.order) == ("code", "order_id")
