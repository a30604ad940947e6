"""The reason for which each editing request is refused, in the recorded server states."""

from typing import Any

import msgspec
import pytest

from arcor2_hw.data.rpc import RPCS
from arcor2_server.rpc import (
    action_points,
    actions,
    copying,
    joints,
    logic,
    orientations,
    parameters,
    project,
    scene,
    scene_objects,
)
from arcor2_server.rpc.registry import DECLARED
from tests.protocol import STATES
from tests.server.session.session_server import Person, SessionServer

MODULES = {
    module.__name__
    for module in (
        action_points,
        actions,
        copying,
        joints,
        logic,
        orientations,
        parameters,
        project,
        scene,
        scene_objects,
    )
}
EDITING_REQUESTS = sorted(name for name, module in DECLARED.items() if module in MODULES and not RPCS[name].additional)
REASONS = {
    "needs a registered user": "not logged in",
    "needs an open scene": "is open: open one first",
    "needs an open project": "is open: open one first",
}


def example(of: Any) -> Any:
    """Return an example of a type as JSON, with only the required fields."""
    info = msgspec.inspect.type_info(of) if not isinstance(of, msgspec.inspect.Type) else of
    match info:
        case msgspec.inspect.StructType():
            return {f.encode_name: example(f.type) for f in info.fields if f.required or f.name in ("x", "w")}
        case msgspec.inspect.EnumType():
            return next(iter(info.cls)).value
        case msgspec.inspect.UnionType():
            return example(info.types[0])
        case msgspec.inspect.ListType() | msgspec.inspect.SetType():
            return []
        case msgspec.inspect.FloatType():
            return 1.0
        case msgspec.inspect.BoolType():
            return True
        case msgspec.inspect.IntType():
            return 0
        case msgspec.inspect.StrType():
            return "x"
    raise TypeError(info)


def request(name: str) -> dict[str, Any]:
    message = {"id": 1, "request": name, "dry_run": RPCS[name].dry_run}
    if RPCS[name].args is None:
        return message
    args = example(RPCS[name].args)
    if name in ("AddVirtualCollisionObjectToScene", "UpdateObjectModel"):
        args["model" if "model" in args else "object_model"] = {
            "type": "Sphere",
            "sphere": {"id": "x", "radius": 1.0},
        }
    if name == "RenameScene":
        args["new_name"] = "free"
    return message | {"args": args}


def test_every_request_is_in_the_matrix() -> None:
    assert len(EDITING_REQUESTS) >= 55
    assert set(EDITING_REQUESTS) <= STATES["no_scene"].keys()


@pytest.mark.parametrize("state", ["unregistered_no_scene", "no_scene", "scene_offline"])
async def test_requests_are_refused_for_the_recorded_reason(
    server: SessionServer, alice: Person, stranger: Person, state: str
) -> None:
    if state == "scene_offline":
        await alice.ask("NewScene", name="scene")
    person = stranger if state.startswith("unregistered") else alice
    wrong, compared = {}, 0
    for name in EDITING_REQUESTS:
        recorded = STATES[state][name].removeprefix("refused: ")
        answer = await person.send(request(name))
        text = "ok" if answer["result"] else answer["messages"][0]
        assert "are wrong:" not in text, text
        if recorded in REASONS:
            compared += 1
            if REASONS[recorded] not in text:
                wrong[name] = f"{recorded}: {text}"
    assert wrong == {}
    assert compared == {"unregistered_no_scene": 55, "no_scene": 44, "scene_offline": 34}[state]
