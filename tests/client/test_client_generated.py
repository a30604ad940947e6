"""The methods of requests: one for each request, with the defaults of the Structs, and a current stub file."""

import inspect
from typing import Any

import msgspec
import pytest
from msgspec import UNSET

from arcor2_hw.client import generating, signatures
from arcor2_hw.client.connection import READING
from arcor2_hw.client.requests import Requests
from arcor2_hw.data.events import EVENTS
from arcor2_hw.data.geometry import Position
from arcor2_hw.data.project import Action, Project
from arcor2_hw.data.rpc import RPCS


class Recorder(Requests):
    """Record the requests instead of sending them."""

    def __init__(self) -> None:
        self.sent: list[tuple[str, Any, bool]] = []

    async def call(self, name: str, args: Any = None, *, dry_run: bool = False, timeout: float | None = None) -> Any:
        self.sent.append((name, args, dry_run))
        return None

    def _follow(self, names: frozenset[str], limit: int) -> Any:
        return names, limit


def test_the_generated_file_is_current() -> None:
    assert generating.FILE.read_text() == generating.source(), "run python -m arcor2_hw.client.generating"


def test_every_request_has_a_method() -> None:
    methods = {name for name, _ in inspect.getmembers(Requests, inspect.iscoroutinefunction)} - {"call"}
    assert methods == {signatures.method_name(name) for name in RPCS}
    assert signatures.method_name("AddApUsingRobot") == "add_ap_using_robot"


@pytest.mark.parametrize("rpc", RPCS.values(), ids=lambda rpc: rpc.name)
async def test_omitted_arguments_have_the_defaults_of_the_struct(rpc: Any) -> None:
    client = Recorder()
    method = getattr(client, signatures.method_name(rpc.name))
    given: dict[str, Any] = {}
    is_struct = isinstance(rpc.args, type) and issubclass(rpc.args, msgspec.Struct)
    if is_struct:
        required = [f.name for f in msgspec.structs.fields(rpc.args) if f.required]
        given = {name: object() for name in required}
        expected: Any = rpc.args(**given)
    elif rpc.args is not None:
        given, expected = {"items": {"a"}}, {"a"}
    else:
        expected = None
    await method(**given)
    assert client.sent == [(rpc.name, expected, False)]
    assert ("dry_run" in inspect.signature(method).parameters) == rpc.dry_run


async def test_every_argument_reaches_the_field_of_its_name() -> None:
    client = Recorder()
    for rpc in RPCS.values():
        if not (isinstance(rpc.args, type) and issubclass(rpc.args, msgspec.Struct)):
            continue
        fields = msgspec.structs.fields(rpc.args)
        given: dict[str, Any] = {
            f.name: [object()] if f.default_factory is list else {object()} if f.default_factory is set else object()
            for f in fields
        }
        await getattr(client, signatures.method_name(rpc.name))(**given)
        assert client.sent[-1][1] == rpc.args(**given), rpc.name
    assert "AddAction" in {name for name, *_ in client.sent}


def test_unknown_event_names_are_refused() -> None:
    client: Any = Recorder()
    assert client.follow("SceneState", limit=5) == ({"SceneState"}, 5)
    with pytest.raises(ValueError, match=r"SceneStat$"):
        client.follow("SceneState", "SceneStat")
    text = generating.FILE.read_text()
    assert all(f'Literal["{name}"]' in text for name in EVENTS)


def test_repeated_requests_only_read() -> None:
    assert RPCS.keys() >= READING
    assert not any(RPCS[name].dry_run for name in READING)
    harmless = ("Get", "List", "History", "SystemInfo", "ObjectTypeUsage", "SceneObjectUsage", "ProjectsWith")
    assert all(name.startswith(harmless) for name in READING)


def test_an_unsupported_default_is_refused() -> None:
    names = generating._Names()

    class Odd(msgspec.Struct):
        field: dict[str, str] = msgspec.field(default_factory=dict)

    with pytest.raises(TypeError, match=r"Odd\.field"):
        signatures._fields(Odd)
    assert names.of(list[Action] | None) == "list[Action] | None"
    assert names.of(dict[str, Project | Any]) == "dict[str, Project | Any]"
    assert generating._default(names, UNSET) == "UNSET"
    with pytest.raises(TypeError):
        generating._default(names, Position(0.0, 0.0, 0.0))
