"""A process that adds actions and prints the name of each acknowledged one, until the test kills it."""

import asyncio
import os
import sys
from pathlib import Path

from tests.server.session.session_server import open_server

USERS = 8


async def main(directory: Path) -> None:
    async with open_server(directory, database_url=os.environ.get("ARCOR2_HW_DATABASE_URL", "")) as server:
        people = [await server.person(f"user{number}") for number in range(USERS)]
        first = people[0]
        await first.ask("NewScene", name="scene")
        await first.ask("AddObjectToScene", name="time", type="TimeActions")
        await first.ask("SaveScene")
        scene = server.session.require_scene()
        await first.ask("NewProject", scene_id=scene.id, name="project")
        for number in range(USERS):
            await first.ask("AddActionPoint", name=f"p{number}", position={"x": 0, "y": 0, "z": 0})
        points = [point.id for point in server.session.require_project().action_points]

        async def add(number: int) -> None:
            for count in range(1_000_000):
                name = f"u{number}_{count}"
                await people[number].ask(
                    "AddAction",
                    action_point_id=points[number],
                    name=name,
                    type=f"{scene.objects[0].id}/sleep",
                    parameters=[{"name": "seconds", "type": "double", "value": "0.5"}],
                    flows=[{"type": "default", "outputs": []}],
                )
                people[number].take()
                print("acknowledged", name, flush=True)  # noqa: T201

        await asyncio.gather(*(add(number) for number in range(USERS)))


asyncio.run(main(Path(sys.argv[1])))
