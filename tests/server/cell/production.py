"""A server with a real cell host, a database, and the production parts."""

import contextlib
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from arcor2_hw.data.project import Project, ProjectParameter
from arcor2_hw.data.role import Role
from arcor2_server.app.adapters import request_handlers
from arcor2_server.app.wiring import connect_production
from arcor2_server.collaboration.persons import Persons
from arcor2_server.collaboration.pins import CardHashes
from arcor2_server.production.cell_time import CellTime, activity_of
from arcor2_server.production.recipes import Recipes
from arcor2_server.production.units import Units
from arcor2_server.settings import ServerSettings
from arcor2_server.storage import Storage
from arcor2_server.storage.calibrations import Calibrations
from arcor2_server.storage.persons import PersonStore
from arcor2_server.storage.recipes import RecipeStore
from arcor2_server.storage.shared_data import SharedData
from arcor2_server.storage.units import UnitStore
from tests.runtime.test_host_parts import BODY, PROJECT, write_package

from .conftest import Server, running_server

PIN = "2580"
SCRIPT = (
    BODY.replace("\narm =", "\narm: object =", 1)
    + 'serial = "A-1"\n'
    + 'arm.scan(serial, an="scan")\narm.pick(stop, an="pick")\narm.place(inside, an="insert")\n'
    + 'arm.test(True, an="test")\narm.pick(inside, an="take")\narm.place(box, an="into_box")\n'
)
"""Moves a part from the feeder through the nest into the box for good parts."""


def with_parameters(*parameters: ProjectParameter) -> Project:
    return replace(PROJECT, parameters=list(parameters))


PARAMETERS = [ProjectParameter("serial", "string", '"A-1"', id="prm_serial")]


class ProductionServer:
    """The server, and the ids of a technician and an operator who have the same PIN."""

    def __init__(self, server: Server, directory: Path, packages: Path) -> None:
        self.server, self.directory, self.packages = server, directory, packages
        self.ask, self.client = server.ask, server.client
        self.services: Any = server.services
        self.persons: dict[str, str] = {}

    def package(
        self, name: str = "pkg_1", script: str = SCRIPT, parameters: list[ProjectParameter] = PARAMETERS
    ) -> Path:
        path = self.packages / name
        return write_package(path, self.directory, script, with_parameters(*parameters))

    async def run(self, package: str = "pkg_1", **options: Any) -> None:
        await self.ask("RunPackage", {"id": package, **options})
        await self.client.state("stopped", "PackageState")

    async def sign(self, recipe: str, *states: str, person: str = "tess", pin: str = PIN) -> Any:
        for state in states:
            arguments = {"id": recipe, "state": state, "person": self.persons[person], "pin": pin}
            found = await self.ask("SignRecipe", arguments)
        return found

    async def released_recipe(self, product: str = "board", package: str = "pkg_1", **values: Any) -> Any:
        recipe = await self.ask("PutRecipe", {"product": product, "package_id": package, **values})
        return await self.sign(recipe.id, "tested", "released")


@contextlib.asynccontextmanager
async def production(tmp_path: Path, *, released_only: bool = False) -> AsyncIterator[ProductionServer]:
    data = tmp_path / "data"
    data.mkdir(exist_ok=True)
    storage = await Storage.open(ServerSettings(data_dir=data))
    async with contextlib.AsyncExitStack() as stack:
        stack.push_async_callback(storage.close)
        server = await stack.enter_async_context(running_server(data))
        parts = server.services
        persons = Persons(PersonStore(storage), CardHashes(data))
        packages = parts.execution.packages
        recipes = Recipes(parts.hub, RecipeStore(storage), packages, persons, released_only=released_only)
        await recipes.open()
        store = UnitStore(storage)
        units = Units(parts.hub, store, parts.runs, packages, Calibrations(storage))
        await parts.runs.open(SharedData(storage))
        stack.push_async_callback(parts.runs.close)
        await units.open(parts.execution.parts.all)
        stack.push_async_callback(units.close)
        times = CellTime(store, lambda: activity_of(parts.execution))
        stack.push_async_callback(times.close)
        connect_production(recipes, units, times, parts.execution)
        parts.recipes, parts.units, parts.cell_time = recipes, units, times
        server.handlers = request_handlers(parts).by_request
        made = ProductionServer(server, tmp_path, parts.settings.packages_dir)
        for person in await persons.all():
            made.persons[person.name] = person.id
        if not made.persons:
            for name, role in (("tess", Role.TECHNICIAN), ("olga", Role.OPERATOR)):
                made.persons[name] = (await persons.add(name, role, PIN)).id
        yield made
