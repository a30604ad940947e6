"""Recorded sessions are replayed: the same answers and events in the same order, except for ids."""

import operator
import re
from collections.abc import Iterator
from typing import Any

import msgspec
import pytest

from arcor2_hw.data.events import SceneStateEnum
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Joint
from tests.protocol import session
from tests.server.session.session_server import Person, SessionServer

ID = re.compile(r"\b(?:scn|obj|pro|acp|ori|joi|act|lit|pco|pkg)_[0-9a-f]{32}\b")


class Mapping:
    """Recorded and actual ids, paired by the order in which they appear."""

    def __init__(self) -> None:
        self._ours: dict[str, str] = {}

    def to_ours(self, value: Any) -> Any:
        match value:
            case str():
                return ID.sub(lambda found: self._ours.get(found[0], found[0]), value)
            case dict():
                return {key: self.to_ours(item) for key, item in value.items()}
            case list():
                return [self.to_ours(item) for item in value]
        return value

    def learn(self, recorded: Any, actual: Any) -> None:
        """Pair ids that are at the same place."""
        match recorded, actual:
            case str(), str():
                for recorded_id, actual_id in zip(ID.findall(recorded), ID.findall(actual), strict=False):
                    self._ours.setdefault(recorded_id, actual_id)
            case dict(), dict():
                for key in recorded.keys() & actual.keys():
                    self.learn(recorded[key], actual[key])
            case list(), list():
                for one, other in zip(recorded, actual, strict=False):
                    self.learn(one, other)


def plain(value: Any, key: str = "") -> Any:
    """Remove what may differ: texts, times, and order where it has no meaning."""
    match value:
        case dict():
            compared = {
                k: plain(v, k) for k, v in value.items() if k not in ("created", "modified", "int_modified", "t")
            }
            if "description" in compared:
                compared["description"] = ""
            return compared
        case list() if key == "object_ids":
            return sorted(value)
        case list() if key == "data" and all("name" in item for item in value):
            return sorted((plain(item) for item in value), key=operator.itemgetter("name"))
        case list() if key == "messages":
            return ["<text>"]
        case list():
            return [plain(item) for item in value]
        case float():
            return round(value, 9)
        case bool():
            return value
        case int():
            return float(value) if key in "xyzw" and key else value
    return value


def exchanges(name: str) -> Iterator[tuple[str, dict[str, Any], dict[str, list[dict[str, Any]]]]]:
    """Return each request with the messages that every client received before the next one."""
    client, request = "", {}
    received: dict[str, list[dict[str, Any]]] = {"A": [], "B": []}
    for line in session(name):
        if line["who"].endswith(">"):
            if request:
                yield client, request, received
            client, request, received = line["who"][0], line["msg"], {"A": [], "B": []}
        elif line["who"][0] in received:
            received[line["who"][0]].append(line["msg"])
    yield client, request, received


async def play(
    name: str,
    people: dict[str, Person],
    mapping: Mapping,
    differs: dict[int, str] | None = None,
    only: range | None = None,
) -> int:
    """Send the recorded requests and compare; return how many answers and events were compared.

    `differs` states why a request is sent without comparing; `only` selects requests by their numbers.
    """
    compared = 0
    for client, request, recorded in exchanges(name):
        number = request["id"]
        if only is not None and number not in only:
            continue
        for person in people.values():
            person.take()
        await people[client].send(mapping.to_ours(request))
        for other, person in people.items():
            got, expected = person.take(), recorded[other]
            if request["request"] == "CopyActionPoint":
                # The recorded server sent copied actions in the order of a set.
                expected, got = (sorted(messages, key=_by_name) for messages in (expected, got))
            mapping.learn(expected, got)
            if number not in (differs or {}):
                assert plain(got) == plain(mapping.to_ours(expected)), f"{other} at {request}"
                compared += len(got)
    return compared


def _by_name(message: dict[str, Any]) -> tuple[int, str]:
    is_action = message.get("event") == "ActionChanged"
    return is_action, message["data"]["name"] if is_action else ""


@pytest.fixture
async def people(alice: Person, bob: Person) -> dict[str, Person]:
    return {"A": alice, "B": bob}


def recorded_answer(name: str, number: int) -> Any:
    return next(m["msg"]["data"] for m in session(name) if m["msg"].get("id") == number and "data" in m["msg"])


async def test_the_recorded_session_results_in_the_same_messages(
    server: SessionServer, people: dict[str, Person]
) -> None:
    """A scene is created, changed by a robot, gets a project that is edited offline and online; all is deleted."""
    mapping, robot = Mapping(), "03_scene_online_robot"
    assert await play("02_scene", people, mapping) == 78

    server.cell.pose = msgspec.convert(recorded_answer(robot, 53), Pose)
    server.cell.pose.position.z += 0.001  # the step made in between (request 66)
    server.cell.joints = msgspec.convert(recorded_answer(robot, 47), list[Joint])
    server.cell.state = SceneStateEnum.STARTED
    assert await play(robot, people, mapping, only=range(70, 73)) == 5
    server.cell.state = SceneStateEnum.STOPPED
    assert await play(robot, people, mapping, only=range(74, 75)) == 3

    differs = {
        103: "an integer literal is no double (Q11)",
        126: "copied results get names of their own (Q12)",
    }
    assert await play("04_project", people, mapping, differs) == 155

    server.cell.pose = msgspec.convert(recorded_answer(robot, 53), Pose)
    server.cell.state = SceneStateEnum.STARTED
    assert await play("05_project_online_execute_action", people, mapping, only=range(136, 144)) == 30
    server.cell.state = SceneStateEnum.STOPPED
    assert await play("05_project_online_execute_action", people, mapping, only=range(147, 148)) == 3
    await people["A"].ask("CloseProject")

    # Without the requests about object types (161 to 167, 170).
    assert await play("08_object_types_delete", people, mapping, only=range(168, 170)) == 2
    assert await play("08_object_types_delete", people, mapping, only=range(171, 182)) == 31
