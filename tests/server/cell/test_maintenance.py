"""Device cards: detection of a replaced device, operating hours, cycles, and parameter backups."""

import contextlib
import json
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import msgspec
import pytest
from msgspec.structs import replace

from arcor2_hw.data.base import UNSET, new_id
from arcor2_hw.data.device import Identity
from arcor2_hw.data.geometry import Position
from arcor2_hw.data.maintenance import ParameterBackup
from arcor2_hw.data.project import Action, ActionPoint, Flow, Project
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc import RPCS
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import Arcor2Error, InvalidData
from arcor2_server.app.wiring import connect_devices
from arcor2_server.audit import changes as audit
from arcor2_server.errors import RequestRefused
from arcor2_server.maintenance.devices import Devices
from arcor2_server.maintenance.parameters import MAX_BACKUPS, Parameters
from arcor2_server.rpc.maintenance import MaintenanceRequests
from arcor2_server.rpc.registry import Handlers
from arcor2_server.settings import ServerSettings
from arcor2_server.storage import Storage
from arcor2_server.storage.maintenance import MaintenanceStore
from tests.runtime.conftest import scene_object
from tests.server.core.serving import until

from .conftest import Server, action, running_server

UNIT = """
import json
from arcor2_hw.data.device import Connection, Identity
from arcor2_hw.data.maintenance import DeviceParameter, ParameterFailure

@dataclass
class UnitSettings(Settings):
    file: str

class Unit(Generic):
    _ABSTRACT = False
    def __init__(self, obj_id: str, name: str, settings: UnitSettings) -> None:
        super().__init__(obj_id, name, settings)

    def state(self):
        with open(self.settings.file) as f:
            return json.load(f)

    @property
    def connection(self): return Connection.ONLINE
    def identify(self) -> Identity:
        return Identity(**self.state()["identity"])
    def counters(self):
        return {"gain adjusted": self.state()["parameters"]["gain"]}
    def parameters_dump(self):
        return [DeviceParameter(name, value) for name, value in self.state()["parameters"].items()]
    def parameters_restore(self, parameters):
        state, failures = self.state(), []
        for each in parameters:
            if each.name == "locked":
                failures.append(ParameterFailure(each.name, "it is locked"))
            elif each.name != "forgotten":
                state["parameters"][each.name] = each.value
        with open(self.settings.file, "w") as f:
            json.dump(state, f)
        return failures

    @action
    def act(self, *, an: str | None = None) -> bool: return True
"""
FIRST = {"vendor": "Maker", "model": "Unit 5", "serial": "A1", "firmware": "1.0"}
VALUES = {"gain": 5, "locked": 1, "forgotten": 1, "name": "left"}


class Workplace:
    """A server with one device, whose state is a file."""

    def __init__(self, server: Server, file: Path) -> None:
        self.server, self.file = server, file

    def device(self, parameters: dict[str, Any] | None = None, **identity: str) -> None:
        state = {"identity": FIRST | identity, "parameters": VALUES | (parameters or {})}
        self.file.write_text(json.dumps(state))

    def values(self) -> dict[str, Any]:
        found: dict[str, Any] = json.loads(self.file.read_text())["parameters"]
        return found

    async def ask(self, name: str, **args: Any) -> Any:
        return await self.server.ask(name, args or None)

    async def card(self) -> Any:
        (card,) = (await self.ask("ListDeviceCards")).devices
        return card

    async def restart(self) -> None:
        """Go offline and online again, and wait until the device is identified."""
        online = self.server.services.online
        if online.online:
            await online.begin_stop("alice")
            await online.settled()
        seen = len(self.server.services.identified)
        await self.server.start()
        await until(lambda: len(self.server.services.identified) > seen)

    async def act(self) -> None:
        await self.server.services.online.call("obj_unit", "act", control=True)


@contextlib.asynccontextmanager
async def workplace(tmp_path: Path) -> AsyncIterator[Workplace]:
    async with running_server(tmp_path / new_id("data")) as server:
        s = server.services
        storage = await Storage.open(ServerSettings(data_dir=tmp_path))
        store = MaintenanceStore(storage)
        devices = s.devices = Devices(s.hub, store, s.online.host.send)
        await devices.open()
        s.identities, s.identified = devices.identities, []
        connect_devices(devices, s.online.host, s.online.host, s.online, s.execution)
        s.online.board.on_identified.append(s.identified.append)
        handlers = Handlers(MaintenanceRequests(devices, Parameters(devices, store, s.online, s.execution)))
        server.handlers |= handlers.by_request
        place = Workplace(server, tmp_path / "unit.json")
        place.device()
        server.types.add("Unit", UNIT, [action("act", "boolean")])
        point = ActionPoint(
            "top", Position(), id="acp_1", actions=[Action("act", "obj_unit/act", "act_1", [], [Flow()])]
        )
        await server.open(
            Scene("scene", id="scn_1", objects=[scene_object("unit", "Unit", file=str(place.file))]),
            Project("project", "scn_1", id="pro_1", action_points=[point]),
        )
        try:
            yield place
        finally:
            await devices.close()
            await storage.close()


async def test_another_device_is_refused_until_a_technician_confirms_it(tmp_path: Path) -> None:
    async with workplace(tmp_path) as place:
        await place.restart()
        await place.act()
        first = await place.card()
        assert first.identity == Identity(**FIRST)
        assert first.found is UNSET

        place.device(serial="B2")
        await place.restart()
        card = await place.card()
        assert (card.found.serial, card.differing) == ("B2", ["serial"])
        with pytest.raises(Arcor2Error, match="serial number B2 instead of A1") as refused:
            await place.act()
        assert refused.value.code == "different_device"

        with pytest.raises(RequestRefused, match="A different device is now connected"):
            await place.ask("ConfirmDevice", object_id="obj_unit", identity=FIRST)
        with audit.collecting() as changes:
            await place.ask("ConfirmDevice", object_id="obj_unit", identity=FIRST | {"serial": "B2"})
        assert [(each.kind, each.before.serial, each.after.serial) for each in changes] == [
            ("device_identity", "A1", "B2")
        ]
        await place.act()
        assert RPCS["ConfirmDevice"].role is RPCS["RestoreParameters"].role is Role.TECHNICIAN
        assert (await place.card()).confirmed_by == "alice"
        with pytest.raises(RequestRefused, match="confirmed device already"):
            await place.ask("ConfirmDevice", object_id="obj_unit", identity=FIRST | {"serial": "B2"})
        await place.restart()
        await place.act()


async def test_hours_and_cycles_belong_to_the_serial_number(tmp_path: Path) -> None:
    async with workplace(tmp_path) as place:
        await place.restart()
        await place.server.ask("ExecuteAction", {"action_id": "act_1"})
        await place.server.client.event("ActionResult")
        card = await place.card()
        assert card.cycles == 1
        assert card.hours > 0.0
        place.device(firmware="1.1")
        await place.restart()
        updated = await place.ask("ConfirmDevice", object_id="obj_unit", identity=FIRST | {"firmware": "1.1"})
        assert updated.cycles == 1, "it is the same device"
        place.device(serial="B2", firmware="1.1")
        await place.restart()
        swapped = await place.ask(
            "ConfirmDevice", object_id="obj_unit", identity=FIRST | {"serial": "B2", "firmware": "1.1"}
        )
        assert (swapped.cycles, swapped.hours) == (0, 0.0)
        assert swapped.counted_since > card.counted_since


async def test_device_cards_survive_a_restart_of_the_server(tmp_path: Path) -> None:
    async with workplace(tmp_path) as place:
        await place.restart()
        info = await place.ask("BackUpParameters", object_id="obj_unit")
    async with workplace(tmp_path) as place:
        card = await place.card()
        assert card.identity.serial == "A1"
        assert card.backups == [info]
        place.device(serial="B2")
        await place.restart()
        with pytest.raises(Arcor2Error, match="B2 instead of A1"):
            await place.act()


async def test_a_backup_is_restored_to_a_new_device(tmp_path: Path) -> None:
    async with workplace(tmp_path) as place:
        await place.restart()
        info = await place.ask("BackUpParameters", object_id="obj_unit")
        backup = {"object_id": "obj_unit", "backup_id": info.id}
        place.device({"gain": 1, "locked": 0, "forgotten": 0}, serial="B2")
        await place.restart()
        compared = await place.ask("CompareParameters", **backup)
        assert [(each.name, each.backup, each.device) for each in compared.differences] == [
            ("forgotten", 1, 0),
            ("gain", 5, 1),
            ("locked", 1, 0),
        ]
        assert compared.equal == 1
        assert place.values()["gain"] == 1, "comparing writes nothing"
        with audit.collecting() as changes:
            restored = await place.ask("RestoreParameters", **backup)
        assert restored.written == 1
        assert {each.name: each.reason for each in restored.failures} == {
            "locked": "it is locked",
            "forgotten": "The device has not stored the value.",
        }
        assert place.values()["gain"] == 5
        assert [(each.kind, each.before, each.after) for each in changes] == [
            ("device_parameters", {"gain": 1}, {"gain": 5})
        ]
        with pytest.raises(Arcor2Error, match="A technician has to confirm it"):
            await place.act()


async def test_a_restore_is_refused_for_another_model_and_while_a_program_runs(tmp_path: Path) -> None:
    async with workplace(tmp_path) as place:
        await place.restart()
        info = await place.ask("BackUpParameters", object_id="obj_unit")
        backup = {"object_id": "obj_unit", "backup_id": info.id}
        place.device({"gain": 1}, model="Unit 6")
        await place.restart()
        for request in ("CompareParameters", "RestoreParameters"):
            with pytest.raises(RequestRefused, match="of Unit 5 and cannot be restored to Unit 6"):
                await place.ask(request, **backup)
        place.device({"gain": 1})
        await place.restart()

        def require_no_program() -> None:
            raise RequestRefused("A program is running.")

        execution = place.server.services.execution
        execution.require_no_program = require_no_program
        with pytest.raises(RequestRefused, match="program is running"):
            await place.ask("RestoreParameters", **backup)
        assert place.values()["gain"] == 1


async def test_an_uploaded_backup_is_checked_and_the_oldest_backups_are_deleted(tmp_path: Path) -> None:
    async with workplace(tmp_path) as place:
        await place.restart()
        info = await place.ask("BackUpParameters", object_id="obj_unit")
        file = await place.ask("GetParameterBackup", object_id="obj_unit", backup_id=info.id)

        async def upload(backup: ParameterBackup) -> Any:
            return await place.ask("PutParameterBackup", object_id="obj_unit", backup=msgspec.to_builtins(backup))

        changed = replace(file, parameters=[replace(file.parameters[0], value=9), *file.parameters[1:]])
        with pytest.raises(InvalidData, match="digest"):
            await upload(changed)
        other = replace(file, identity=replace(file.identity, model="Unit 6"))
        other = replace(other, digest=other.computed_digest())
        with pytest.raises(RequestRefused, match="of Unit 6"):
            await upload(other)
        again = await upload(file)
        assert (again.digest, again.uploaded) == (info.digest, True)
        await place.ask("DeleteParameterBackup", object_id="obj_unit", backup_id=again.id)
        for _ in range(MAX_BACKUPS):
            newest = await place.ask("BackUpParameters", object_id="obj_unit")
        backups = (await place.card()).backups
        assert len(backups) == MAX_BACKUPS
        assert backups[0] == newest
        with pytest.raises(Arcor2Error, match="does not exist"):
            await place.ask("GetParameterBackup", object_id="obj_unit", backup_id=info.id)


async def test_the_card_shows_the_counters_of_the_confirmed_device(tmp_path: Path) -> None:
    async with workplace(tmp_path) as place:
        await place.restart()
        assert (await place.card()).counters == {"gain adjusted": 5}
        place.device({"gain": 6})
        await place.restart()
        assert (await place.card()).counters == {"gain adjusted": 6}
        place.device({"gain": 700}, serial="B2")
        await place.restart()
        card = await place.card()
        assert card.counters == {"gain adjusted": 6}  # the counters of the other device are not counted
        await place.ask("ConfirmDevice", object_id=card.object_id, identity=card.found)
        assert (await place.card()).counters == {}
        await place.restart()
        assert (await place.card()).counters == {"gain adjusted": 700}
