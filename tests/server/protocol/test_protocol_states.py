"""Answers of every request in six server states, as recorded, with arguments that name nothing that exists."""

import re
from pathlib import Path
from typing import Any

from arcor2_hw.data.rpc import RPCS
from tests.protocol import STATES
from tests.server.protocol.in_process_server import Actor, Stage, open_stage
from tests.server.session.test_session_states import example

CLASSES = {
    "needs a registered user": re.compile("You are not logged in"),
    "needs an open scene": re.compile("No scene is open"),
    "needs an open project": re.compile("No project is open"),
    "needs other scene state": re.compile("The scene is (offline|online|not online)"),
}
UNANSWERED = "no answer in the peer (ours must answer)"


def request(name: str, scene_id: str) -> dict[str, Any]:
    """Return a request as it was recorded: a dry run if possible, with ids that do not exist."""
    message: dict[str, Any] = {"id": 1, "request": name, "dry_run": RPCS[name].dry_run}
    if RPCS[name].args is None:
        return message
    args = example(RPCS[name].args)
    match name:
        case "AddVirtualCollisionObjectToScene" | "UpdateObjectModel":
            sphere = {"type": "Sphere", "sphere": {"id": "x", "radius": 1.0}}
            args["model" if "model" in args else "object_model"] = sphere
        case "DeleteObjectTypes":
            args = ["x"]
        case "NewProject":
            args["scene_id"] = scene_id
        case "GetCameraPose" | "MarkersCorners":
            args["camera_parameters"]["dist_coefs"] = [0.0] * 4
    return message | {"args": args}


def outcome(answer: dict[str, Any]) -> str:
    if answer["result"]:
        return "ok"
    (text,) = answer["messages"]
    assert "are wrong" not in text, answer
    assert "not available" not in text, answer
    assert "inside the server" not in text, answer
    return "refused: " + next((name for name, pattern in CLASSES.items() if pattern.match(text)), "other")


def differs(name: str, state: str, recorded: str, actual: str) -> bool:
    """Return whether our outcome differs from the recorded one.

    The peer's "other" includes its messages about robots and cameras. Where nothing is open, it names the project in
    some refusals and the scene in others. Our refusals name the scene.
    """
    if recorded == UNANSWERED:
        return actual == "ok"
    if recorded == "refused: needs an open project" and state.endswith("no_scene"):
        recorded = "refused: needs an open scene"
    if recorded == "refused: other":
        return actual not in ("refused: other", "refused: needs other scene state")
    return actual != recorded


async def enter(stage: Stage, alice: Actor, state: str) -> None:
    """Change from the previous state of the matrix to this one."""
    match state:
        case "no_scene":
            await stage.place(alice, time="TimeActions")
            await alice.ask("SaveScene")
            stage.ids["scene"] = stage.services.session.require_scene().id
            await alice.ask("CloseScene")
        case "scene_offline":
            await alice.ask("OpenScene", id=stage.ids["scene"])
        case "scene_online":
            await stage.start(alice)
        case "project_offline":
            await stage.stop(alice)
            await alice.ask("NewProject", scene_id=stage.ids["scene"], name="project")
        case "project_online":
            await stage.start(alice)
    alice.take()


async def test_every_answer_in_every_state_equals_the_recorded_one(tmp_path: Path) -> None:
    wrong: dict[str, str] = {}
    async with open_stage(tmp_path, lock_retries=1, lock_retry_wait=0.01) as stage:
        alice, stranger = await stage.person("alice"), await stage.person()
        compared = 0
        for state, rows in STATES.items():
            await enter(stage, alice, state)
            person = stranger if state.startswith("unregistered") else alice
            for name, recorded in rows.items():
                actual = outcome(await person.send(request(name, stage.ids.get("scene", "x"))))
                compared += 1
                if differs(name, state, recorded, actual):
                    wrong[f"{name} in {state}"] = f"{recorded}, not {actual}"
                for event in person.events():
                    assert event["event"] in ("ObjectsLocked", "ObjectsUnlocked"), (name, state, event)
        assert compared == 666
    assert wrong == DIFFERENT, "\n".join(f"{key}: {value}" for key, value in wrong.items())


DIFFERENT: dict[str, str] = {}
"""Deliberate differences. docs/protocol.md explains each."""


def test_the_matrix_excludes_requests_that_change_the_state() -> None:
    left_out = set(RPCS) - set(STATES["no_scene"])
    additional = {name for name, declared in RPCS.items() if declared.additional}
    assert left_out - additional == {
        "ListPackages",
        "PausePackage",
        "RegisterUser",
        "ResumePackage",
        "StepAction",
        "StopPackage",
        "TemporaryPackage",
    }
