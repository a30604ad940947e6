"""Forced outputs as clients see them: leases, ends, refusals, the audit trail, and no program during forcing."""

from typing import Any

import pytest

from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc import RPCS
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import Arcor2Error, NotFound
from arcor2_hw.messages import Message
from arcor2_server.audit import commands
from arcor2_server.audit.changes import collecting
from arcor2_server.errors import RequestRefused
from arcor2_server.online.forces import Force
from tests.runtime.conftest import scene_object
from tests.server.cell.conftest import Recorder, Server, serving
from tests.server.core.serving import until

VALVES = """
import time
from arcor2_hw.data.points import ForceKind, LivePoint, PointUse

class Valves(Generic):
    _ABSTRACT = False
    def __init__(self, obj_id, name):
        super().__init__(obj_id, name)
        self.values = {"valve": False, "clamp": True}
    def live_points(self):
        shown = {"use": PointUse.OUTPUT, "age": 0.0, "force": ForceKind.DIGITAL}
        return [LivePoint(name, value=on, **shown) for name, on in self.values.items()]
    def force_point(self, name, value): self.values[name] = value
    def release_point(self, name, value): self.values[name] = value
    def state(self): return self.values
    @observation
    def pressure(self) -> float:
        return 6.5
    def observations(self):
        from arcor2_hw.data.device import Observation
        return [Observation("Pressure", 6.5, "bar"), Observation("Flow", 2.0, "l/min")]
"""
VALVE = {"object_id": "obj_valves", "point": "valve", "value": True}
LEASE_MS = 10_000


async def with_valves(server: Server) -> None:
    server.types.add("Valves", VALVES)
    await server.open(Scene("scene", id="scn_1", objects=[scene_object("valves", "Valves")]))
    await server.start()
    server.services.hub.subscribe(server.client, {"ForcesChanged"}, True)


async def force(server: Server, valid_ms: int = LEASE_MS, **changed: Any) -> str:
    return str((await server.ask("ForcePoint", VALVE | {"valid_ms": valid_ms} | changed)).id)


async def values(server: Server) -> Any:
    return await server.services.online.ask(dict[str, bool], "obj_valves", "state")


async def until_none(server: Server) -> None:
    await server.client.event("ForcesChanged", lambda data: data["forces"] == [])


@serving(with_valves)
async def test_every_client_sees_a_force_and_may_end_it(server: Server) -> None:
    other = Recorder("bob")
    server.services.hub.add(other)
    with collecting() as changes:
        force_id = await force(server)
    (change,) = changes
    assert (change.before["value"], change.after) == (False, {"name": "valves: valve", "value": True})
    (forced,) = (await server.client.event("ForcesChanged"))["forces"]
    assert forced.pop("since")
    assert forced == {
        "id": force_id, "object_id": "obj_valves", "object": "valves", "point": "valve", "value": True, "unit": "",
        "user": "alice",
    }  # fmt: skip
    notice = await other.event("Notification")  # a client that did not subscribe
    assert notice["message"] == "alice has forced valves: valve to on."
    assert await values(server) == {"valve": True, "clamp": True}
    with pytest.raises(Arcor2Error, match="valve is forced already"):
        await force(server)

    with pytest.raises(RequestRefused, match="Another device has forced valves: valve"):
        await server.ask("RenewForces", {"ids": [force_id], "valid_ms": LEASE_MS}, other)
    await server.ask("EndForce", {"id": force_id}, other)
    await until_none(server)
    assert await values(server) == {"valve": False, "clamp": True}
    with pytest.raises(NotFound, match="ended"):
        await server.ask("EndForce", {"id": force_id})


@serving(with_valves)
async def test_a_force_ends_with_its_client(server: Server) -> None:
    ended_forces: list[tuple[Force, Message]] = []
    server.services.online.forces.on_end.append(lambda *end: ended_forces.append(end))
    tablet = Recorder("eva")
    hub = server.services.hub
    hub.add(tablet)

    async def by_tablet(point: str, valid_ms: int = LEASE_MS) -> None:
        await server.ask(
            "ForcePoint", VALVE | {"point": point, "value": point == "valve", "valid_ms": valid_ms}, tablet
        )

    await by_tablet("valve", 500)
    await until_none(server)
    await by_tablet("valve")
    server.services.online.forces.logged_off(tablet, Message.of("eva logged off."))
    await until_none(server)
    await by_tablet("valve")
    await by_tablet("clamp")
    hub.remove(tablet)
    await until_none(server)
    assert await values(server) == {"valve": False, "clamp": True}
    await until(lambda: len(ended_forces) == 4)
    assert [reason.text for _, reason in ended_forces] == [
        "valves: the force of valve was not renewed in time",
        "eva logged off.",
        "eva is no longer connected",
        "eva is no longer connected",
    ]
    assert {end.output for end, _ in ended_forces} == {"valves: valve", "valves: clamp"}


@serving(with_valves)
async def test_no_program_starts_while_an_output_is_forced(server: Server) -> None:
    forces = server.services.online.forces
    forces.require_none()
    await force(server)
    with pytest.raises(RequestRefused) as refused:
        forces.require_none()
    assert str(refused.value) == (
        "No program starts while an output is forced: valves: valve is forced to on by alice. End the force first."
    )
    server.services.execution.reserve()
    with pytest.raises(RequestRefused, match="A program is running"):
        await force(server, point="clamp")
    server.services.execution.release()

    # Offline, all forces have ended.
    await server.ask("StopScene")
    await until_none(server)
    await server.client.state("stopped")
    forces.require_none()
    with pytest.raises(RequestRefused, match="offline"):
        await force(server)


@serving(with_valves)
async def test_a_force_ends_with_the_host(server: Server) -> None:
    await force(server)
    server.services.online.host.host.kill()
    await until_none(server)
    server.services.online.forces.require_none()


@serving(with_valves)
async def test_points_and_signals_are_streamed(server: Server) -> None:
    await server.ask("StreamPoints", {"object_id": "obj_valves", "rate": 5})
    data = await server.client.event("ObjectPoints")
    assert {each["name"]: (each["use"], each["value"]) for each in data["points"]} == {
        "valve": ("output", False),
        "clamp": ("output", True),
        "pressure": ("signal", 6.5),
        "Flow": ("signal", 2.0),
    }, "a value that is also in observations() is sent once"
    with pytest.raises(RequestRefused, match=r"0\.2 to 5 Hz"):
        await server.ask("StreamPoints", {"object_id": "obj_valves", "rate": 6})
    await server.ask("StreamPoints", {"object_id": "obj_valves", "send": False})


def test_forcing_requires_a_technician_and_is_audited() -> None:
    assert (RPCS["ForcePoint"].role, RPCS["EndForce"].role) == (Role.TECHNICIAN, Role.OPERATOR)
    assert commands.is_command(RPCS["ForcePoint"])
    assert commands.is_command(RPCS["EndForce"])
    assert not commands.is_command(RPCS["RenewForces"]), "renewals neither fill the audit trail nor keep a log-on"
    assert all(commands.needs_person(RPCS[name]) for name in ("ForcePoint", "EndForce", "RenewForces"))
