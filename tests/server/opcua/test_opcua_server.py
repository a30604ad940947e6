"""The OPC UA server of a real server, read and commanded by a client that knows only the specifications."""

import asyncio
import contextlib
import json
import os
import signal
import socket
from collections.abc import AsyncIterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
import pytest_asyncio
from asyncua import Client, Node, ua
from asyncua.crypto.truststore import TrustStore
from asyncua.crypto.validator import CertificateValidator, CertificateValidatorOptions

from arcor2_hw.data.role import Role
from arcor2_server.access.tokens import TokenFile
from tests.fakes.conftest import FakeProcess
from tests.ports import free_port
from tests.runtime.conftest import Package, scene_object
from tests.server.cell.test_execution import LAMP, OBJ, PROJECT
from tests.server.core.serving import RawConnection, ServerProcess, running, talking
from tests.server.opcua import plant_client as plant

pytestmark = pytest.mark.asyncio(loop_scope="module")

PIN = "48151"
ARM = "from arcor2_drivers.two_axis_robot.two_axis_robot import TwoAxisRobot"
BODY = f"""
    import time
    lamp = res.objects["{OBJ}"]
    open({{starts!r}}, "a").write("started\\n")
    while True:
        lamp.blink(1, an="a")
        time.sleep(0.05)
"""


@dataclass
class Plant:
    """The server with its address, a client of its own protocol, the cell's robot, and a trusted client."""

    data: Path
    url: str
    hub: RawConnection
    robot: FakeProcess
    files: tuple[Path, Path]
    server: ServerProcess

    @contextlib.asynccontextmanager
    async def connected(self, user: str = "Line 7") -> AsyncIterator[Client]:
        """Connect with the right user."""
        client = await plant.connected(await plant.encrypted(self.url, self.files, user, PIN))
        try:
            yield client
        finally:
            await client.disconnect()

    @property
    def starts(self) -> int:
        file = self.data / "starts"
        return len(file.read_text().split()) if file.exists() else 0

    def process(self) -> int:
        """Return the id of the newest process of the OPC UA server."""
        lines = [json.loads(line) for line in self.server.log.read_text().splitlines() if line.startswith("{")]
        return [each["pid"] for each in lines if each["event"] == "OPC UA server starts"][-1]


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def cell(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Plant]:
    folder = tmp_path_factory.mktemp("plant")
    data, port = folder / "data", free_port()
    data.mkdir(0o700)
    _, secret = TokenFile(data).add("tablet", Role.PROGRAMMER)
    robot = FakeProcess("two_axis_robot", "--link", str(folder / "ttyDXL"))
    robot.control.do("truth")  # its connection stays as long as the fixture
    types = {"Lamp": LAMP, "TwoAxisRobot": ARM}
    objects = [
        scene_object("lamp", "Lamp"),
        scene_object("arm", "TwoAxisRobot", pose=True, port=str(folder / "ttyDXL"), watchdog=0.4),
    ]
    body = BODY.format(starts=str(data / "starts"))
    Package(data / "packages" / "pkg_1").write(types, objects, PROJECT, body)
    server = ServerProcess(data, "--opcua", f"127.0.0.1:{port}", ARCOR2_HW_DEVICE_FILES=str(folder))
    await server.start()
    try:
        async with talking(f"{server.url}/?token={secret}", "technician", max_queue=None) as hub:
            await hub.granted("AddPerson", {"name": "Line 7", "role": "operator", "pin": PIN})
            await hub.granted("AddPerson", {"name": "Shift lead", "role": "technician", "pin": PIN})
            await hub.granted("SetCellJobs", {"jobs": [{"number": 7, "package_id": "pkg_1"}]})
            files = plant.client_certificate(folder)
            yield Plant(data, f"opc.tcp://127.0.0.1:{port}/arcor2hw/", hub, robot, files, server)
    finally:
        await server.stop()
        robot.end()


@pytest_asyncio.fixture(autouse=True, loop_scope="module")
async def closed_sockets() -> AsyncIterator[None]:
    """Let the event loop close the sockets of disconnected clients: it does not run between tests."""
    yield
    for _ in range(5):
        await asyncio.sleep(0)


async def machine_of(client: Client) -> Node:
    """Return the only machine in the folder Machines."""
    machines = await plant.child(client.nodes.objects, (plant.MACHINERY, "Machines"))
    (machine,) = [each for each in await machines.get_children() if await each.read_node_class() == ua.NodeClass.Object]
    return machine


async def unit_of(client: Client) -> Node:
    """Return the only unit in the folder PackMLObjects."""
    folder = await plant.child(client.nodes.objects, (plant.PACKML, "PackMLObjects"))
    (unit,) = await plant.typed(folder, plant.PACKML, "PackMLBaseObjectType")
    return unit


async def robot_of(client: Client) -> Node:
    """Return the only motion device system in the device set."""
    device_set = await plant.child(client.nodes.objects, (plant.DI, "DeviceSet"))
    (system,) = await plant.eventually(
        lambda: plant.typed(device_set, plant.ROBOTICS, "MotionDeviceSystemType"), lambda found: len(found) == 1
    )
    assert isinstance(system, Node)
    return system


async def positions(system: Node, browses: int = 1000) -> list[Node]:
    """Return the variables ActualPosition of the two axes, which exist after at most this number of browses."""
    devices = await plant.child(system, (plant.ROBOTICS, "MotionDevices"))
    (device,) = await plant.typed(devices, plant.ROBOTICS, "MotionDeviceType")
    axes = await plant.child(device, (plant.ROBOTICS, "Axes"))
    names = (plant.DI, "ParameterSet"), (plant.ROBOTICS, "ActualPosition")
    found: list[Node] = []
    while len(found) < 2:
        assert browses > 0
        found, browses = await plant.typed(axes, plant.ROBOTICS, "AxisType"), browses - 1
    return [await plant.child(axis, *names) for axis in found]


async def execute_state(client: Client) -> Node:
    """Return the state machine in which the unit produces."""
    names = [(plant.PACKML, name) for name in ("BaseStateMachine", "MachineState", "ExecuteState")]
    return await plant.child(await unit_of(client), *names)


async def until_state(client: Client, machine: Node, state: str) -> None:
    current = await machine.get_child("0:CurrentState")
    async with asyncio.timeout(plant.WITHIN):
        while True:
            found = await current.read_data_value(raise_on_bad_status=False)
            if found.StatusCode.is_good() and found.Value.Value.Text == state:
                return
            await asyncio.sleep(0.1)


async def command(machine: Node, name: str, *arguments: Any) -> None:
    index = (await plant.namespaces(machine)).index(plant.PACKML)
    await machine.call_method(ua.QualifiedName(name, index), *arguments)


async def test_only_trusted_clients_with_a_valid_user_can_read(cell: Plant) -> None:
    client = await plant.encrypted(cell.url, cell.files, "Line 7", PIN)
    with pytest.raises(ua.UaStatusCodeError, match="BadSecurityChecksFailed"):
        await plant.connected(client)
    (rejected,) = (cell.data / "opcua-rejected").iterdir()
    rejected.rename(cell.data / "opcua-trusted" / rejected.name)  # as an administrator does
    for user, secret in (("Line 7", "99999"), ("nobody", "wrong"), ("", "")):
        client = await plant.encrypted(cell.url, cell.files, user, secret)
        with pytest.raises(ua.UaStatusCodeError, match=r"BadUserAccessDenied|BadIdentityTokenRejected"):
            await plant.connected(client)
    async with cell.connected() as client:
        uris = {each.Server.ApplicationUri for each in await client.get_endpoints()}
        assert uris == {f"urn:{socket.gethostname()}:arcor2-hw:opcua"}
        assert len(await plant.typed(await machine_of(client), plant.MACHINERY, "MachineIdentificationType")) == 1
        with pytest.raises(ua.UaStatusCodeError):  # the address space is read-only
            await (await client.nodes.server.get_child("0:ServiceLevel")).write_value(
                ua.Variant(1, ua.VariantType.Byte)
            )


async def set_mode(client: Client, *arguments: ua.Variant) -> None:
    await command(await unit_of(client), "SetUnitMode", *arguments)


async def test_setting_the_mode_needs_the_authority_and_a_technician(cell: Plant) -> None:
    maintenance, produce = (ua.Variant(number, ua.VariantType.Int32) for number in (2, 1))
    async with cell.connected() as operator, cell.connected("Shift lead") as technician:
        unit = await unit_of(technician)
        mode = await plant.child(unit, (plant.PACKML, "Status"), (plant.PACKML, "UnitModeCurrent"))
        method = await plant.child(unit, (plant.PACKML, "SetUnitMode"))
        assert (await method.read_attribute(ua.AttributeIds.Executable)).Value.Value
        (argument,) = await (await method.get_child("0:InputArguments")).read_value()
        assert (argument.Name, argument.DataType) == ("RequestedMode", ua.NodeId(ua.ObjectIds.Int32))
        with pytest.raises(ua.UaStatusCodeError, match="BadUserAccessDenied"):
            await set_mode(technician, maintenance)  # the plant has no authority
        await cell.hub.granted("SetCellAuthority", {"authority": "plc"})
        with pytest.raises(ua.UaStatusCodeError, match="BadUserAccessDenied"):
            await set_mode(operator, maintenance)
        await set_mode(technician, maintenance)
        await plant.eventually(mode.read_value, lambda number: number == 2)
        assert (await cell.hub.granted("GetCell"))["mode"] == "maintenance"
        for wrong in (
            ua.Variant(5, ua.VariantType.Int32),
            ua.Variant("produce"),
            ua.Variant([1], ua.VariantType.Int32),
        ):
            with pytest.raises(ua.UaStatusCodeError, match="BadInvalidArgument"):
                await set_mode(technician, wrong)
        with pytest.raises(ua.UaStatusCodeError, match="BadArgumentsMissing"):
            await set_mode(technician)
        await set_mode(technician, produce)
        await plant.eventually(mode.read_value, lambda number: number == 1)
    await cell.hub.granted("SetCellAuthority", {"authority": "hub"})


async def test_a_command_needs_the_authority_and_is_executed_once(cell: Plant) -> None:
    async with cell.connected() as client:
        await client.load_data_type_definitions()
        base = await plant.child(await unit_of(client), (plant.PACKML, "BaseStateMachine"))
        machine = await plant.child(base, (plant.PACKML, "MachineState"))
        execute = await execute_state(client)
        parameter = ua.PackMLDescriptorDataType()  # type: ignore[attr-defined]
        parameter.Name, parameter.Value = "Job", 7.0
        with pytest.raises(ua.UaStatusCodeError, match="BadUserAccessDenied"):
            await command(machine, "Reset")
        await cell.hub.granted("SetCellAuthority", {"authority": "plc"})
        with pytest.raises(ua.UaStatusCodeError, match="BadInvalidState"):
            await command(execute, "Start", [parameter])  # the unit is stopped
        await command(machine, "Reset")
        await until_state(client, execute, "Idle")
        request = (await request_method(client), "order 1", 2, 7)
        assert (await call_request(client, *request))[0] == 0
        assert (await call_request(client, *request))[0] == 0  # the first answer was lost
        await until_state(client, execute, "Execute")
        with pytest.raises(ua.UaStatusCodeError, match="BadInvalidState"):
            await command(execute, "Start", [parameter])
        assert cell.starts == 1
        async with cell.connected("Shift lead") as technician:
            with pytest.raises(ua.UaStatusCodeError, match="BadInvalidState"):  # a program is running
                await set_mode(technician, ua.Variant(2, ua.VariantType.Int32))
        mode = await plant.child(await unit_of(client), (plant.PACKML, "Status"), (plant.PACKML, "UnitModeCurrent"))
        assert await mode.read_value() == 1


async def test_a_client_that_only_reads_gets_current_values(cell: Plant) -> None:
    async with cell.connected() as client:
        device = await plant.child(await machine_of(client), (plant.MACHINERY, "Components"), (plant.OWN, "arm"))
        await plant.eventually(
            (await plant.child(device, (plant.OWN, "Connection"))).read_value, lambda state: state == "online"
        )
        values = await positions(await robot_of(client), browses=1)
        for value in [await values[0].read_data_value(), await values[1].read_data_value()]:
            assert value.StatusCode.is_good()
            assert abs((datetime.now(UTC) - value.SourceTimestamp).total_seconds()) < 30.0


async def request_method(client: Client) -> Node:
    """Return the method for identified requests, which the how-to documents."""
    machine = await machine_of(client)
    (method,) = await machine.get_methods()
    return method


async def call_request(client: Client, method: Node, identifier: str, number: int, job: int) -> list[Any]:
    machine = await machine_of(client)
    arguments = (
        ua.Variant(identifier, ua.VariantType.String),
        ua.Variant(number, ua.VariantType.Int32),
        ua.Variant(job, ua.VariantType.UInt16),
    )
    return list(await machine.call_method(method, *arguments))


async def test_all_objects_have_the_mandatory_members_of_their_types(cell: Plant) -> None:
    async with cell.connected() as client:
        mandatory = plant.Mandatory(client)
        system = await robot_of(client)
        await positions(system)
        controllers = await plant.child(system, (plant.ROBOTICS, "Controllers"))
        (controller,) = await plant.typed(controllers, plant.ROBOTICS, "ControllerType")
        tasks = await plant.child(controller, (plant.ROBOTICS, "TaskControls"))
        (task,) = await plant.typed(tasks, plant.ROBOTICS, "TaskControlType")
        names = (plant.DI, "ParameterSet"), (plant.ROBOTICS, "TaskProgramName")
        await plant.eventually((await plant.child(task, *names)).read_value, lambda name: name == "demo")
        roots = await machine_of(client), await unit_of(client), system
        assert [each for root in roots for each in await mandatory.missing(root)] == []


async def test_a_pulled_cable_causes_a_bad_status_and_an_alarm(cell: Plant) -> None:
    async with cell.connected() as client:
        watch = plant.Watch()
        subscription = await client.create_subscription(100, watch)
        position = (await positions(await robot_of(client)))[0]
        await subscription.subscribe_data_change(position)
        await subscription.subscribe_alarms_and_conditions(ua.ObjectIds.Server, ua.ObjectIds.AlarmConditionType)
        good = await watch.value(position, lambda value: value.StatusCode.is_good())
        assert abs((datetime.now(UTC) - good.SourceTimestamp).total_seconds()) < 30.0

        cell.robot.control.do("unplug")
        bad = await watch.value(position, lambda value: value.StatusCode.name == "BadNoCommunication")
        assert bad.SourceTimestamp < datetime.now(UTC)
        alarm = await watch.event(lambda event: event.SourceName == "arm" and event.ActiveState.Text == "Active")
        assert alarm.Severity > 0
        assert not getattr(alarm, "AckedState/Id")
        late = plant.Watch()
        second = await client.create_subscription(100, late)
        await second.subscribe_alarms_and_conditions(ua.ObjectIds.Server, ua.ObjectIds.AlarmConditionType)
        await client.get_node(ua.ObjectIds.ConditionType).call_method(
            ua.NodeId(ua.ObjectIds.ConditionType_ConditionRefresh),
            ua.Variant(second.subscription_id, ua.VariantType.UInt32),
        )
        assert (await late.event(lambda event: event.SourceName == "arm")).NodeId == alarm.NodeId

        condition = client.get_node(alarm.NodeId)
        acknowledge = ua.NodeId(ua.ObjectIds.AcknowledgeableConditionType_Acknowledge)
        arguments = ua.Variant(alarm.EventId), ua.Variant(ua.LocalizedText("seen by the line"))
        await condition.call_method(acknowledge, *arguments)
        acked = await watch.event(lambda event: event.NodeId == alarm.NodeId and getattr(event, "AckedState/Id"))
        assert acked.Comment.Text == "seen by the line"
        with pytest.raises(ua.UaStatusCodeError):
            await condition.call_method(acknowledge, *arguments)

        watch.values.clear()
        cell.robot.control.do("heal")
        await watch.value(position, lambda value: value.StatusCode.is_good())
        await watch.event(lambda event: event.NodeId == alarm.NodeId and event.ActiveState.Text == "Inactive")


async def test_a_killed_process_is_restarted_and_clients_return(cell: Plant) -> None:
    async with cell.connected():
        before = cell.process()
        os.kill(before, signal.SIGKILL)
    async with cell.connected() as client:
        assert cell.process() != before
        await client.load_data_type_definitions()
        execute = await execute_state(client)
        await until_state(client, execute, "Held")  # since the cable was pulled: the program has not noticed
        with pytest.raises(ua.UaStatusCodeError, match="BadInvalidState"):
            await command(execute, "Unhold")  # a person decides about the lost robot
        assert (await call_request(client, await request_method(client), "order 1", 2, 7))[0] == 0
        assert cell.starts == 1
        names = [(plant.PACKML, name) for name in ("BaseStateMachine", "MachineState")]
        machine = await plant.child(await unit_of(client), *names)
        await command(machine, "Stop")
        await until_state(client, machine, "Stopped")
        production = [each for each in await (await machine_of(client)).get_children() if "Production" in str(each)]
        values = {(await each.read_browse_name()).Name: each for each in await production[0].get_variables()}
        await plant.eventually(values["JobEnd"].read_value, lambda end: end == "stopped")
        assert await values["LastJob"].read_value() == 7


async def test_the_client_of_the_how_to_reads_the_state(cell: Plant) -> None:
    page = (Path(__file__).parents[3] / "docs" / "how-to" / "opcua.md").read_text()
    code: dict[str, Any] = {}
    exec(page.partition("```python\n")[2].partition("```")[0], code)
    assert await code["read_state"](cell.url, *map(str, cell.files), "Line 7", PIN) == "BadStateNotActive"


async def test_a_request_of_a_removed_person_is_refused(cell: Plant) -> None:
    async with cell.connected() as client:
        method = await request_method(client)
        assert (await call_request(client, method, "reset 1", 1, 0))[0] == 0
        await cell.hub.granted("AddPerson", {"name": "Eva", "role": "programmer", "pin": "77123"})
        (line,) = [each for each in (await cell.hub.granted("ListPersons"))["persons"] if each["name"] == "Line 7"]
        await cell.hub.granted("RemovePerson", {"id": line["id"]})
        result, text = await call_request(client, method, "stop 1", 3, 0)
        assert result == 1
        assert text


async def test_a_client_that_trusts_the_authority_connects(tmp_path: Path) -> None:
    data, port = tmp_path / "data", free_port()
    async with running(data, "--self-signed", "--opcua", f"127.0.0.1:{port}"):
        for name, ending in (("trusted", "der"), ("revocations", "crl")):
            (tmp_path / name).mkdir()
            (tmp_path / name / f"authority.{ending}").write_bytes((data / f"opcua-authority.{ending}").read_bytes())
        store = TrustStore([tmp_path / "trusted"], [tmp_path / "revocations"])
        await store.load()
        files = plant.client_certificate(tmp_path)
        (data / "opcua-trusted").mkdir(exist_ok=True)
        (data / "opcua-trusted" / "scada.der").write_bytes(files[0].read_bytes())
        client = await plant.encrypted(f"opc.tcp://127.0.0.1:{port}/arcor2hw/", files)
        checks = CertificateValidatorOptions.EXT_VALIDATION | CertificateValidatorOptions.PEER_SERVER
        client.certificate_validator = CertificateValidator(checks, store)
        async with client:
            assert (await machine_of(client)).nodeid.Identifier == "cell"
