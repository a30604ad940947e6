"""Large projects: duration of an edit, and of opening, saving and listing projects."""

import asyncio
import itertools
import json
import time
from pathlib import Path
from typing import Any

from websockets.asyncio.client import ClientConnection

from benchmarks import server_process
from benchmarks.metrics import Metric, Report, median
from benchmarks.requests import fdatasync_time

IN_FLIGHT = 128
"""Number of pending requests while a project is filled."""
_ids = itertools.count(1)


def request(request_name: str, /, **args: Any) -> str:
    return json.dumps({"id": next(_ids), "request": request_name} | ({"args": args} if args else {}))


class Author:
    """Creates documents over a plain websocket."""

    def __init__(self, socket: ClientConnection) -> None:
        self.opened = ""
        """Id of the open project."""
        self.socket = socket
        self.object = ""

    async def ask(self, name: str, /, **args: Any) -> Any:
        answer = json.loads(await server_process.answer(self.socket, request(name, **args)))
        assert answer["result"], answer
        return answer.get("data")

    async def timed(self, name: str, /, **args: Any) -> float:
        """Return the time until the response, s."""
        text = request(name, **args)
        begin = time.perf_counter()
        answer = await server_process.answer(self.socket, text)
        spent = time.perf_counter() - begin
        assert json.loads(answer)["result"], answer
        return spent

    async def event_after(self, event: str, request_name: str, /, **args: Any) -> Any:
        """Send a request and return the data of the event that follows."""
        await self.socket.send(request(request_name, **args))
        while True:
            message = json.loads(await self.socket.recv())
            assert message.get("result", True), message
            if message.get("event") == event:
                return message["data"]

    async def many(self, requests: list[str], event: str) -> list[Any]:
        """Send many requests, `IN_FLIGHT` at a time; return the data of the events in order."""
        found: list[Any] = []
        for part in _parts(requests):
            for text in part:
                await self.socket.send(text)
            answers = events = 0
            while answers < len(part) or events < len(part):
                message = json.loads(await self.socket.recv())
                if "response" in message:
                    assert message["result"], message
                    answers += 1
                elif message["event"] == event:
                    events += 1
                    found.append(message["data"])
        return found

    async def scene(self) -> str:
        await self.ask("RegisterUser", user_name="bench")
        await self.ask("NewScene", name="bench")
        self.object = (
            await self.event_after("SceneObjectChanged", "AddObjectToScene", name="rnd", type="RandomActions")
        )["id"]
        await self.ask("SaveScene")
        return str((await self.ask("ListScenes"))[0]["id"])

    async def project(self, scene: str, name: str) -> tuple[str, str]:
        """Create and open a project with one action point; return the ids of both."""
        opened = await self.event_after("OpenProject", "NewProject", scene_id=scene, name=name)
        position = {"x": 0.0, "y": 0.0, "z": 0.0}
        point = await self.event_after("ActionPointChanged", "AddActionPoint", name="ap", position=position)
        return str(opened["project"]["id"]), str(point["id"])

    def dice(self, point: str, number: int) -> dict[str, Any]:
        """Return the arguments of AddAction for an action that stores a boolean result."""
        return {
            "action_point_id": point,
            "name": f"action {number}",
            "type": f"{self.object}/random_bool",
            "parameters": [{"name": "probability", "type": "double", "value": "0.5"}],
            "flows": [{"type": "default", "outputs": [f"result_{number}"]}],
        }

    async def actions(self, point: str, numbers: range) -> list[str]:
        """Add actions; return their ids."""
        added = await self.many([request("AddAction", **self.dice(point, n)) for n in numbers], "ActionChanged")
        by_name = {action["name"]: action["id"] for action in added}
        return [str(by_name[f"action {number}"]) for number in numbers]

    async def steps(self, steps: list[dict[str, Any]]) -> None:
        await self.many([request("AddLogicItem", **step) for step in steps], "LogicItemChanged")


def _parts(requests: list[str]) -> list[list[str]]:
    return [requests[at : at + IN_FLIGHT] for at in range(0, len(requests), IN_FLIGHT)]


class Floor:
    """Duration of an echo and an fdatasync at the same time, subtracted from requests that need both."""

    def __init__(self, echo: ClientConnection, directory: Path) -> None:
        self._echo, self._directory = echo, directory
        self._echoes: list[float] = []
        self._syncs: list[float] = []

    async def sample(self) -> None:
        self._echoes += await server_process.round_trips(self._echo, "x" * 300, 10)
        self._syncs.append(fdatasync_time(self._directory, 10))

    def metric(self, name: str, samples: list[float]) -> Metric:
        echo, sync = median(self._echoes), median(self._syncs)
        note = f"response {median(samples) * 1e3:.3f} ms, echo {echo * 1e3:.3f} ms, fdatasync {sync * 1e3:.3f} ms"
        return Metric(name, (median(samples) - echo - sync) * 1e3, len(samples), note)


async def edits(report: Report, author: Author, scene: str, echo: ClientConnection, directory: Path) -> None:
    """Measure AddAction in a project of 10,000 actions."""
    _, point = await author.project(scene, "many actions")
    await author.actions(point, range(10_000))
    await asyncio.sleep(3)  # wait until the disk has written the preceding edits
    floor, samples = Floor(echo, directory), []
    for number in range(10_000, 10_100):
        samples.append(await author.timed("AddAction", **author.dice(point, number)))
        if number % 10 == 0:
            await floor.sample()
    report.add(floor.metric("add_action_10000_ms", samples))
    await author.ask("CloseProject", force=True)


async def logic(report: Report, author: Author, scene: str, echo: ClientConnection, directory: Path) -> None:
    """Measure AddLogicItem in front of a chain of 1,000 actions and of 18 if/else blocks, including the cycle check."""
    _, point = await author.project(scene, "chain")
    chain = await author.actions(point, range(1_001))
    links = zip(chain[1:], [*chain[2:], "END"], strict=True)
    await author.steps([{"start": start, "end": end} for start, end in links])
    await _add_repeatedly(report, author, "add_logic_item_chain_ms", chain[0], chain[1], Floor(echo, directory))
    await author.ask("CloseProject", force=True)

    _, point = await author.project(scene, "branches")
    ids = await author.actions(point, range(3 * 18 + 2))
    first, last, blocks = ids[0], ids[1], [ids[at : at + 3] for at in range(2, len(ids), 3)]
    steps: list[dict[str, object]] = [{"start": last, "end": "END"}]
    for (dice, *branches), following in zip(blocks, [*(block[0] for block in blocks[1:]), last], strict=True):
        for branch, value in zip(branches, ("true", "false"), strict=True):
            condition = {"what": f"{dice}/default/0", "value": value}
            steps += [{"start": dice, "end": branch, "condition": condition}, {"start": branch, "end": following}]
    await author.steps(steps)
    await _add_repeatedly(report, author, "add_logic_item_branches_ms", first, blocks[0][0], Floor(echo, directory))
    await author.ask("CloseProject", force=True)


async def _add_repeatedly(report: Report, author: Author, metric: str, start: str, end: str, floor: Floor) -> None:
    """Measure AddLogicItem between two actions; the item is removed after each measurement."""
    samples = []
    for number in range(50):
        text = request("AddLogicItem", start=start, end=end)
        begin = time.perf_counter()
        await author.socket.send(text)
        item = ""
        while not item:
            message = json.loads(await author.socket.recv())
            if "response" in message:
                samples.append(time.perf_counter() - begin)
                assert message["result"], message
            elif (message["event"], message.get("change_type")) == ("LogicItemChanged", "add"):
                item = message["data"]["id"]
        await author.ask("RemoveLogicItem", logic_item_id=item)
        if number % 10 == 0:
            await floor.sample()
    report.add(floor.metric(metric, samples))


async def opening(report: Report, author: Author, scene: str, directory: Path) -> None:
    """Measure OpenProject and SaveProject of 1,000 actions that store results."""
    project, point = await author.project(scene, "large")
    await author.actions(point, range(1_000))
    await author.ask("SaveProject")
    size = len(json.dumps(await author.ask("GetProject", id=project)))
    opened, saved, syncs = [], [], []
    for number in range(10):
        await author.ask("UpdateProjectDescription", project_id=project, new_description=str(number))
        saved.append(await author.timed("SaveProject"))
        syncs.append(fdatasync_time(directory, 5, size))
        await author.ask("CloseProject")
        opened.append(await author.timed("OpenProject", id=project))
    report.add(Metric("open_project_1000_ms", median(opened) * 1e3, len(opened), "until the response"))
    note = f"including fdatasync; writing {size} bytes and fdatasync alone take {median(syncs) * 1e3:.1f} ms"
    report.add(Metric("save_project_1000_ms", median(saved) * 1e3, len(saved), note))
    await author.ask("CloseProject")


async def listing(report: Report, author: Author, scene: str) -> None:
    """Measure ListProjects of 200 projects, repeatedly and after one of them was saved."""
    project, point = await author.project(scene, "small")
    await author.actions(point, range(10))
    await author.ask("SaveProject")
    await author.ask("CloseProject")
    for number in range(200 - len(await author.ask("ListProjects"))):
        await author.ask("CopyProject", source_id=project, target_name=f"copy {number}")
    assert len(await author.ask("ListProjects")) == 200
    unchanged = [await author.timed("ListProjects") for _ in range(50)]
    report.add(Metric("list_projects_200_ms", median(unchanged) * 1e3, len(unchanged)))
    changed = []
    for number in range(10):
        await author.ask("UpdateProjectDescription", project_id=project, new_description=str(number))
        changed.append(await author.timed("ListProjects"))
    report.add(Metric("list_projects_200_changed_ms", median(changed) * 1e3, len(changed), "one of them saved before"))


async def run(report: Report, directory: Path) -> None:
    """Measure everything in this group."""
    async with (
        server_process.server(directory / "documents") as (url, _),
        server_process.echo(directory, 60) as echo_url,
        server_process.socket(url) as socket,
        server_process.socket(echo_url) as echo,
    ):
        author = Author(socket)
        scene = await author.scene()
        await author.ask("CloseScene")
        await logic(report, author, scene, echo, directory)
        await opening(report, author, scene, directory)
        await listing(report, author, scene)
        await edits(report, author, scene, echo, directory)
