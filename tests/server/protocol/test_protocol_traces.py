"""The recorded sessions of the spec, all of them in order, played to a whole server with devices and programs.

Every request is sent as it was; each client must get the same answers and events in the same order, ids mapped and
texts, times and the numbers of a random generator apart. What a program and a robot tell continually is compared by
itself: how often it comes depends on the clock.
"""

import asyncio
import itertools
import operator
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tests.protocol import session
from tests.server.protocol.recorded import ROBOT, uploads
from tests.server.protocol.stage import Actor, Stage, open_stage, until
from tests.server.session.test_session_traces import Mapping, plain

SESSIONS = (
    "01_connect_register",
    "02_scene",
    "03_scene_online_robot",
    "04_project",
    "05_project_online_execute_action",
    "06_temporary_package",
    "07_build_run",
    "08_object_types_delete",
)
CONTINUAL = {"RobotJoints", "RobotEef", "ActionStateBefore", "ActionStateAfter"}
DIFFERENT = {
    3: "SystemInfo lists our own requests too",
    4: "GetObjectTypes: other types are installed here",
    5: "GetActions: the robot's other actions are the driver's business",
    6: "GetRobotMeta: other robots are installed here",
    10: "ListMeshes was never answered",
    63: "MoveToJoints always failed (Q9)",
    64: "the lock that 63 never gave back is missing (Q9)",
    65: "that lock is told now (Q9)",
    103: "an integer literal is no double (Q11)",
}
"""Deliberate differences by the number of the request; docs/protocol.md has them."""

ADDED = ("category", "display_name", "icon")
"""Fields that we add to what is recorded; clients pass over what they do not know."""

Messages = dict[str, list[dict[str, Any]]]


class Exchange:
    """A request with all that every client got until the next one."""

    def __init__(self, who: str, request: dict[str, Any]) -> None:
        self.who = who
        self.request = request
        self.received: Messages = {"A": [], "B": [], "C": []}

    def told(self, who: str) -> list[dict[str, Any]]:
        return [message for message in self.received[who] if message.get("event") not in CONTINUAL]


NOTHING = "NO RESPONSE TO"
"""What stands in a recorded session where nothing was sent."""
REFUSED = ("b3", "b3_copy")
"""The action that request 103 adds to the recorded project and not to ours, and its copy."""


def without_refused(value: Any) -> Any:
    """Leave out of a recorded message what the refused action brought with it."""
    match value:
        case {"event": _, "data": {"name": name}} if name in REFUSED:
            return {NOTHING: name}
        case dict():
            return {key: without_refused(item) for key, item in value.items()}
        case list():
            kept = (item for item in value if not (isinstance(item, dict) and item.get("name") in REFUSED))
            return [without_refused(item) for item in kept]
    return value


def exchanges(name: str) -> Iterator[Exchange]:
    found: list[Exchange] = []
    for line in session(name):
        who, message = line["who"][0], without_refused(line["msg"])
        if line["who"].endswith(">"):
            found.append(Exchange(who, message))
        elif found and NOTHING not in message:
            found[-1].received[who].append(message)
    for before, after in itertools.pairwise(found):
        # What A had got before it sent its next request, B sometimes got just after that.
        while (
            (late := after.told("B")[:1])
            and len(before.told("B")) < len(before.told("A"))
            and late[0] in before.told("A")
        ):
            before.received["B"].append(late[0])
            after.received["B"].remove(late[0])
    return iter(found)


def comparable(value: Any, key: str = "") -> Any:
    """Drop what may differ beside texts: when a package was built, and what a random generator gave."""
    match value:
        case str() if key == "error":
            return "<text>"
        case dict():
            return {k: comparable(v, k) for k, v in value.items() if k not in ("built", "executed", *ADDED)}
        case list() if key == "outputs":
            return [name.removesuffix("_copy") for name in value]  # copied results get names of their own (Q12)
        case list() if key == "results":
            return ["<random>" if item in ("true", "false") else item for item in value]
        case list() if key in ("boxes", "spheres", "cylinders", "meshes"):
            return sorted(value, key=operator.itemgetter("id"))  # told in the order of a directory
        case list() if key == "data" and all(isinstance(item, str) for item in value):
            return sorted(value)
        case list():
            return [comparable(item) for item in value]
    return value


def same(messages: list[dict[str, Any]]) -> Any:
    return plain(comparable(messages))


def first_difference(ours: Any, theirs: Any, where: str = "") -> str:
    """Name the first place where two documents differ; empty when they are the same."""
    match ours, theirs:
        case dict(), dict():
            if only := sorted(ours.keys() ^ theirs.keys()):
                return f"{where}: only one has {', '.join(only)}"
            pairs = [(key, ours[key], theirs[key]) for key in ours]
        case list(), list():
            if len(ours) != len(theirs):
                return f"{where}: {ours} instead of {theirs}"
            pairs = [(str(index), *both) for index, both in enumerate(zip(ours, theirs, strict=True))]
        case _:
            return "" if ours == theirs else f"{where}: {ours!r} instead of {theirs!r}"
    return next(filter(None, (first_difference(a, b, f"{where}/{key}") for key, a, b in pairs)), "")


def in_order(exchange: Exchange, messages: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Give messages as they are compared: the recorded server sent copied actions in the order of a set."""
    if exchange.request["request"] != "CopyActionPoint":
        return messages
    return sorted(messages, key=lambda m: (m.get("event") == "ActionChanged", _name(m)))


def _name(message: dict[str, Any]) -> str:
    return str(message["data"]["name"]) if message.get("event") == "ActionChanged" else ""


class Replay:
    """Plays sessions one after the other."""

    def __init__(self, stage: Stage, people: dict[str, Actor]) -> None:
        self.stage = stage
        self.people = people
        self.mapping = Mapping()
        self.compared = 0
        self.continual: dict[int, Messages] = {}
        self.answers: dict[int, dict[str, Any]] = {}

    async def play(self, name: str) -> None:
        for exchange in exchanges(name):
            number = exchange.request["id"]
            self.answers[number] = await self.people[exchange.who].send(self.mapping.to_ours(exchange.request))
            for who, person in self.people.items():
                await self._compare(exchange, who, person)
            if exchange.received["C"]:
                late = Actor(self.stage)  # type: ignore[arg-type]
                try:
                    await self._compare(exchange, "C", late)
                finally:
                    await late.leave()

    async def _compare(self, exchange: Exchange, who: str, person: Actor) -> None:
        number, expected = exchange.request["id"], exchange.told(who)

        def got() -> list[dict[str, Any]]:
            return [message for message in person.waiting if message.get("event") not in CONTINUAL]

        def steady() -> bool:
            wanted = {message["event"] for message in exchange.received[who] if message.get("event") in CONTINUAL}
            return wanted <= {message.get("event") for message in person.waiting}

        try:
            async with asyncio.timeout(0.5 if number in DIFFERENT else None):
                await until(lambda: len(got()) >= len(expected) and (who == "C" or steady()))
        except TimeoutError:
            if number not in DIFFERENT:
                raise AssertionError(f"{who} at {exchange.request}: {got()} instead of {expected}") from None
        self.continual.setdefault(number, {})[who] = [m for m in person.waiting if m.get("event") in CONTINUAL]
        ours = in_order(exchange, [message for message in person.take() if message.get("event") not in CONTINUAL])
        expected = in_order(exchange, expected)
        self.mapping.learn(expected, ours)
        if number not in DIFFERENT:
            difference = first_difference(same(ours), same(self.mapping.to_ours(expected)))
            assert not difference, f"{who} at {exchange.request}: {difference}"
            self.compared += len(ours)


async def test_all_recorded_sessions_give_the_same_messages(tmp_path: Path) -> None:
    async with open_stage(tmp_path, streaming_period=0.02) as stage:
        for upload in uploads():
            meta = await stage.services.types.add(upload)
            assert not meta.disabled, meta.problem
        people = {who: await stage.newcomer() for who in "AB"}
        await until(lambda: all(person.waiting for person in people.values()))
        first = session("01_connect_register")[0]
        assert people["A"].take() == [first["msg"]]
        replay = Replay(stage, people)
        for name in SESSIONS:
            await replay.play(name)
        assert replay.compared == 472
        check_what_differs(replay)
        check_streams(replay)
        check_programs(replay)


def _recorded(name: str, number: int) -> dict[str, Any]:
    return next(line["msg"] for line in session(name) if line["msg"].get("id") == number and "response" in line["msg"])


def check_what_differs(replay: Replay) -> None:
    """Check of answers that differ on purpose what has to be the same, or ours to be better."""
    first = SESSIONS[0]
    ours, theirs = replay.answers[3]["data"], _recorded(first, 3)["data"]
    assert set(theirs["supported_rpc_requests"]) <= set(ours["supported_rpc_requests"])
    assert sorted(theirs["supported_parameter_types"]) == sorted(ours["supported_parameter_types"])
    assert (theirs["version"], theirs["api_version"]) == (ours["version"], ours["api_version"])
    metas = {meta["type"]: meta for meta in replay.answers[4]["data"]}
    for meta in _recorded(first, 4)["data"]:
        if meta["built_in"] or meta["type"] == "WeighingMachine":
            assert same([metas[meta["type"]]]) == same([meta])
    moves = {action["name"]: action for action in replay.answers[5]["data"]}
    for action in _recorded(first, 5)["data"]:
        if action["name"] in ("move", "update_pose"):
            ours = moves[action["name"]] | {"origins": action["origins"]}  # the recorded one inherits it
            assert without_texts(comparable(ours)) == without_texts(action)
    robots = {meta["type"]: meta for meta in replay.answers[6]["data"]}
    recorded = next(meta for meta in _recorded(first, 6)["data"] if meta["type"] == ROBOT)
    assert robots[ROBOT]["features"] == recorded["features"]
    assert replay.answers[10]["result"] is False
    assert replay.answers[63]["result"] is True
    assert replay.answers[103]["result"] is False


def without_texts(value: Any) -> Any:
    match value:
        case dict():
            return {key: without_texts(item) for key, item in value.items() if key != "description"}
        case list():
            return [without_texts(item) for item in value]
    return value


def check_streams(replay: Replay) -> None:
    """A robot's state goes to who subscribed alone, with the recorded joints."""
    for number, event in ((57, "RobotJoints"), (58, "RobotEef")):
        told = replay.continual[number]
        recorded = next(
            line["msg"] for line in session(SESSIONS[2]) if line["msg"].get("event") == event and line["who"] == "A<"
        )
        ours = [message for message in told["A"] if message["event"] == event]
        assert same([ours[0]]) == same([replay.mapping.to_ours(recorded)])
        assert told["B"] == []
    assert replay.continual[70]["A"] == [], "nothing is sent to who does not want it any more"


def check_programs(replay: Replay) -> None:
    """Both programs tell each action's begin and end, with the recorded parameters, to everybody."""
    for name, numbers in ((SESSIONS[5], range(148, 150)), (SESSIONS[6], range(154, 159))):
        recorded = {
            (data["action_id"], tuple(data["parameters"]))
            for line in replay.mapping.to_ours(session(name))
            if line["msg"].get("event") == "ActionStateBefore"
            for data in [line["msg"]["data"]]
        }
        for who in "AB":
            told = [message for number in numbers for message in replay.continual[number][who]]
            actions = [m for m in told if m["event"].startswith("ActionState")]
            assert actions, who
            for before, after in zip(actions[::2], actions[1::2], strict=False):
                assert (before["event"], after["event"]) == ("ActionStateBefore", "ActionStateAfter")
                assert before["data"]["action_id"] == after["data"]["action_id"]
                assert (before["data"]["action_id"], tuple(before["data"]["parameters"])) in recorded
            assert {m["event"] for m in told} == CONTINUAL
