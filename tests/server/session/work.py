"""Scenes and projects made by requests."""

from typing import Any

from tests.server.session.session_server import Person

POSE = {"position": {"x": 0.5, "y": 0.0, "z": 0.1}, "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}
ORIGIN = {"x": 0.0, "y": 0.0, "z": 0.0}
UPRIGHT = POSE["orientation"]
URL = {"name": "url", "type": "string", "value": '"http://127.0.0.1:5018"'}
SECONDS = {"name": "seconds", "type": "double", "value": "0.5"}
NO_RESULTS = [{"type": "default", "outputs": []}]


class Work:
    """Makes a scene and a project by requests, and finds ids by names."""

    def __init__(self, person: Person) -> None:
        self.person = person
        self.services = person.server.services
        self.session = person.server.session

    def object(self, name: str) -> str:
        return next(obj.id for obj in self.session.require_scene().objects if obj.name == name)

    def point(self, name: str) -> str:
        return next(point.id for point in self.session.require_project().action_points if point.name == name)

    def action(self, name: str) -> Any:
        points = self.session.require_project().action_points
        return next(action for point in points for action in point.actions if action.name == name)

    async def scene(self) -> str:
        ask = self.person.ask
        await ask("NewScene", name="scene")
        await ask("AddObjectToScene", name="time", type="TimeActions")
        await ask("AddObjectToScene", name="rnd", type="RandomActions")
        await ask("AddObjectToScene", name="robot", type="DobotMagician", pose=POSE, parameters=[URL])
        await ask("AddObjectToScene", name="scale", type="WeighingMachine", pose=POSE)
        await ask("SaveScene")
        self.person.take()
        return self.session.require_scene().id

    async def project(self, *points: str) -> str:
        scene = await self.scene()
        await self.person.ask("NewProject", scene_id=scene, name="project")
        for point in points:
            await self.add_point(point)
        self.person.take()
        return self.session.require_project().id

    async def add_point(self, name: str, parent: str = "") -> str:
        await self.person.ask("AddActionPoint", name=name, position=ORIGIN, **({"parent": parent} if parent else {}))
        return self.point(name)

    async def add_orientation(self, point: str, name: str = "o") -> str:
        await self.person.lock(point)
        await self.person.ask("AddActionPointOrientation", action_point_id=point, orientation=UPRIGHT, name=name)
        await self.person.ask("WriteUnlock", object_id=point)
        return str(self.session.document.named("orientation", name, point))

    async def add_action(self, point: str, name: str, method: str = "time/sleep", *given: Any, **fields: Any) -> str:
        obj, _, action = method.partition("/")
        arguments = {
            "action_point_id": point,
            "name": name,
            "type": f"{self.object(obj)}/{action}",
            "parameters": list(given) or ([SECONDS] if action == "sleep" else []),
            "flows": NO_RESULTS,
        }
        await self.person.ask("AddAction", **(arguments | fields))
        return str(self.action(name).id)
