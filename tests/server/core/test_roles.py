"""Every request, event and route declares its minimum role, which is enforced."""

from pathlib import Path
from typing import Any, cast

import pytest
from litestar import Litestar

from arcor2_hw.data.events import EVENTS
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc import RPCS
from arcor2_server.access.route_options import ROLE
from arcor2_server.app import create_app, running_server
from arcor2_server.cli.role_table import page
from arcor2_server.events import make_event
from arcor2_server.rpc.registry import DECLARED
from arcor2_server.settings import ServerSettings
from arcor2_server.websocket.client import Client, Wire
from arcor2_server.websocket.hub import Hub
from tests.server.core.serving import running, talking
from tests.server.core.test_every_message_answered import meaningless


async def test_every_route_declares_its_least_role(tmp_path: Path) -> None:
    async with running_server(ServerSettings(data_dir=tmp_path)) as services:
        app: Litestar = create_app(services)
    handlers: dict[str, Any] = {}
    for route in app.routes:
        for handler in getattr(route, "route_handlers", None) or [cast("Any", route).route_handler]:
            handlers[f"{route.path} {handler.handler_name}"] = handler
    assert len(handlers) >= 4
    # Litestar itself answers OPTIONS, only with the names of the methods.
    undeclared = [
        name
        for name, handler in handlers.items()
        if not isinstance(handler.opt.get(ROLE), Role) and getattr(handler, "http_methods", None) != {"OPTIONS"}
    ]
    assert undeclared == []


def test_every_handler_has_a_declared_request() -> None:
    assert set(DECLARED) <= set(RPCS)
    assert all(isinstance(RPCS[name].role, Role) for name in DECLARED)
    assert all(isinstance(event.role, Role) for event in EVENTS.values())


async def test_request_needs_its_role(tmp_path: Path) -> None:
    async with (
        running(tmp_path / "data", ARCOR2_HW_DEFAULT_ROLE="1") as server,
        talking(server.url, "operator") as operator,
    ):
        for name, declared in RPCS.items():
            if declared.role is Role.OPERATOR:
                continue
            args = None if declared.args is None else meaningless(declared.args)
            assert declared.role.shown.text in await operator.refused(name, args)
        await operator.granted("ListScenes")
        await operator.granted("ListPackages")


class NoWire(Wire):
    def __init__(self) -> None:
        self.sent: list[bytes] = []

    def send_now(self, message: bytes) -> bool:
        self.sent.append(message)
        return True


async def test_event_needs_its_role(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    settings = ServerSettings(data_dir=tmp_path)
    monkeypatch.setitem(EVENTS, "SceneSaved", EVENTS["SceneSaved"].__class__("SceneSaved", None, Role.TECHNICIAN))
    hub, wires = Hub(), [NoWire(), NoWire()]
    for wire, role in zip(wires, (Role.OPERATOR, Role.TECHNICIAN), strict=True):
        client = Client(wire, settings)
        client.ceiling = role
        hub.add(client)
        hub.send(client, make_event("SceneSaved"))
    hub.broadcast(make_event("SceneSaved"))
    hub.stream("SceneSaved", "x", b"{}")
    assert [len(wire.sent) for wire in wires] == [0, 3]


async def test_the_documented_roles_match_the_declarations(tmp_path: Path) -> None:
    async with running_server(ServerSettings(data_dir=tmp_path)) as services:
        made = page(create_app(services))
    text = (Path(__file__).resolve().parents[3] / "docs/reference/roles.md").read_text()
    assert text == made, "run: python -m arcor2_server.cli.role_table > docs/reference/roles.md"
