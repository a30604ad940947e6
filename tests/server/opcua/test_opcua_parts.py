"""Certificates, channels, repeated requests, streams and a slow process of the OPC UA server."""

import asyncio
import socket
import subprocess
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import msgspec
import pytest
from asyncua import ua
from asyncua.common.utils import ServiceError
from cryptography import x509
from cryptography.hazmat.primitives import serialization
from msgspec.structs import replace

from arcor2_hw.data.alarms import AlarmCategory, AlarmRecord, Priority
from arcor2_hw.data.cell_state import CellAuthority, CellJob
from arcor2_hw.data.device import Connection, Health, Identity
from arcor2_hw.data.maintenance import DeviceCard
from arcor2_hw.data.packml import MachineCommand, MachineState, UnitMode
from arcor2_hw.data.points import LivePoint, PointUse
from arcor2_hw.data.robot import RobotMeta, RobotType
from arcor2_hw.data.units import Unit, UnitState
from arcor2_hw.opcua import access, monitored_devices, unit
from arcor2_hw.opcua.certificates import TrustedClients, application_uri, own_certificate
from arcor2_hw.opcua.conditions import Conditions
from arcor2_hw.opcua.devices import Device
from arcor2_hw.opcua.space import Tag
from arcor2_hw.plant import messages as m
from arcor2_hw.runtime.messages import DeviceChanged, Stream, StreamEvent
from arcor2_server.access.addresses import certified_hosts
from arcor2_server.access.authority import Authority
from arcor2_server.hosts.streams import POINTS, RobotStreams
from arcor2_server.opcua.certificate import issue_certificate
from arcor2_server.packml.plc import Plc
from arcor2_server.packml.record import CellFile, JobEnd, RequestResult as R
from arcor2_server.plant import process
from arcor2_server.plant.feed import CellFeed
from arcor2_server.plant.process import PlantProcess
from arcor2_server.settings import OpcUaListener, ServerSettings
from tests.server.opcua.plant_client import client_certificate
from tests.server.packml.test_rules import new_cell


def test_the_certificate_names_the_machine_and_is_renewed_only_for_another_name(tmp_path: Path) -> None:
    first = own_certificate(tmp_path, "cell-7", ["cell-7", "192.0.2.7"])
    before = first[0].read_bytes()
    names = x509.load_pem_x509_certificate(before).extensions.get_extension_for_class(x509.SubjectAlternativeName)
    assert names.value.get_values_for_type(x509.UniformResourceIdentifier) == [application_uri("cell-7")]
    assert first[1].stat().st_mode & 0o77 == 0
    assert own_certificate(tmp_path, "cell-7", [])[0].read_bytes() == before
    assert own_certificate(tmp_path, "cell-8", [])[0].read_bytes() != before


def test_a_client_that_trusts_the_authority_trusts_the_endpoint(tmp_path: Path) -> None:
    hosts = certified_hosts("127.0.0.1")
    authority = Authority(tmp_path, lambda: hosts)
    authority.renew()
    settings = ServerSettings(data_dir=tmp_path, opcua=OpcUaListener("127.0.0.1", 4840), authority=authority.file)
    issue_certificate(settings)
    file, key = tmp_path / "opcua-certificate.pem", tmp_path / "opcua-key.pem"
    leaf = x509.load_pem_x509_certificate(file.read_bytes())
    issuer = x509.load_der_x509_certificate((tmp_path / "opcua-authority.der").read_bytes())
    assert leaf.issuer == issuer.subject
    assert leaf.not_valid_after_utc <= issuer.not_valid_after_utc
    crl = x509.load_der_x509_crl((tmp_path / "opcua-authority.crl").read_bytes())
    (tmp_path / "crl.pem").write_bytes(crl.public_bytes(serialization.Encoding.PEM))
    check = ["openssl", "verify", "-x509_strict", "-check_ss_sig", "-crl_check", "-purpose", "sslserver"]
    check += ["-verify_ip", "127.0.0.1", "-CAfile", str(authority.file), "-CRLfile", str(tmp_path / "crl.pem")]
    assert subprocess.run([*check, str(file)], capture_output=True, text=True).stdout == f"{file}: OK\n"
    # A restart, with or without the authority, keeps the certificate. Another authority or name replaces it.
    before = file.read_bytes()
    issue_certificate(settings)
    assert own_certificate(tmp_path, socket.gethostname(), hosts)[0].read_bytes() == before
    hosts.append("cell-7.local")
    assert own_certificate(tmp_path, socket.gethostname(), hosts, authority.issuer())[0].read_bytes() != before
    authority.file.unlink()
    authority.renew()
    before, crl_before = file.read_bytes(), (tmp_path / "opcua-authority.crl").read_bytes()
    issue_certificate(settings)
    assert file.read_bytes() != before
    assert (tmp_path / "opcua-authority.crl").read_bytes() != crl_before
    assert key.stat().st_mode & 0o77 == 0


def test_a_certificate_that_clients_already_trust_is_not_replaced(tmp_path: Path) -> None:
    hosts = ["localhost", "127.0.0.1"]
    before = own_certificate(tmp_path, socket.gethostname(), hosts)[0].read_bytes()
    authority = Authority(tmp_path, lambda: hosts)
    authority.renew()
    assert own_certificate(tmp_path, socket.gethostname(), hosts, authority.issuer())[0].read_bytes() == before
    foreign = Authority(tmp_path, lambda: ["cell.example.com"])
    assert foreign.issuer() is None  # its constraints do not permit the name


def test_only_certificates_in_the_folder_are_trusted(tmp_path: Path) -> None:
    trusted = TrustedClients(tmp_path)
    certificate = client_certificate(tmp_path)[0].read_bytes()
    assert not trusted.admits(b"no certificate")
    assert not trusted.admits(certificate)
    (rejected,) = (tmp_path / "opcua-rejected").iterdir()
    (tmp_path / "opcua-trusted" / "damaged.pem").write_text("-----BEGIN CERTIFICATE-----")
    rejected.rename(tmp_path / "opcua-trusted" / "scada.der")
    assert trusted.admits(certificate)


@pytest.mark.parametrize(("unencrypted", "refused"), [(True, False), (False, True)])
def test_a_channel_without_encryption_finds_endpoints_but_has_no_session(unencrypted: bool, refused: bool) -> None:
    server: Any = SimpleNamespace(unencrypted=unencrypted)
    transport: Any = SimpleNamespace(get_extra_info=lambda _: ("192.0.2.9", 50000))
    processor = access.Processor(server, transport, access.LIMITS)
    if refused:
        with pytest.raises(ServiceError) as raised:
            processor.check_channel()
        assert raised.value.code == ua.StatusCodes.BadSecurityPolicyRejected
    else:
        processor.check_channel()


class Runs:
    """Counts the started packages."""

    started = 0

    async def run_package(self, package_id: str, how: Any) -> None:
        self.started += 1


READING: Any = SimpleNamespace(read_json=lambda path, kind, loss: msgspec.json.decode(path.read_bytes(), type=kind))
"""Reads the file of the cell, which is not damaged."""


async def new_plc(tmp_path: Path) -> tuple[Plc, Runs]:
    """Return a PLC with the authority and one job, and the runs that it starts. The cell is idle."""
    cell, parts = new_cell(tmp_path)
    parts.active = parts.running = False
    file = cell._file
    runs: Any = Runs()
    unused: Any = SimpleNamespace(system=lambda *_: None, note=lambda *_, **__: None)
    await file.put(authority=CellAuthority.PLC, jobs=[CellJob(1, "pkg_1")])
    plc = Plc(cell, file, runs, unused, unused, 2.0)
    await plc.execute_once(MachineCommand.RESET, 0, "mes", "")
    return plc, runs


async def test_a_request_is_executed_once_and_not_repeated_after_a_lost_answer(tmp_path: Path) -> None:
    plc, runs = await new_plc(tmp_path)
    start = MachineCommand.START, 1, "mes"
    answers = await asyncio.gather(*(plc.execute_once(*start, "order 1") for _ in range(3)))
    assert [result for result, _ in answers] == [R.ACCEPTED] * 3
    assert runs.started == 1
    await plc.execute_once(*start, "order 2")
    assert runs.started == 2


async def test_a_request_during_which_the_server_ended_is_not_repeated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plc, runs = await new_plc(tmp_path)

    async def end(*_: Any) -> None:
        raise asyncio.CancelledError

    monkeypatch.setattr(runs, "run_package", end)
    with pytest.raises(asyncio.CancelledError):
        await plc.execute_once(MachineCommand.START, 1, "mes", "order 1")
    monkeypatch.undo()
    result, text = await plc.execute_once(MachineCommand.START, 1, "mes", "order 1")
    assert (result, runs.started) == (R.INTERRUPTED, 0)
    assert text is not None
    restarted = CellFile(tmp_path / "cell-state.json")
    restarted.load(READING)
    assert [each.id for each in restarted.record.plant_requests] == ["order 1"]


def test_a_stream_is_observed_next_to_clients_until_the_host_ends() -> None:
    sent: list[Any] = []
    hub: Any = SimpleNamespace(clients=set(), stream=lambda *_: None)
    streams, seen = RobotStreams(hub, sent.append), []
    client: Any = object()
    streams.at_rate(client, "obj", POINTS, 2.0, True)
    streams.observe("obj", POINTS, 5.0, seen.append, owner="one")
    streams.observe("obj", POINTS, 5.0, lambda encoded: seen.append(encoded + b"!"), owner="two")
    assert sent[-1] == Stream("obj", [], [], [], [2.0, 5.0])
    streams.publish(StreamEvent("ObjectPoints", "obj", b"5", 5.0))
    streams.publish(StreamEvent("ObjectPoints", "obj", b"2", 2.0))
    streams.publish(StreamEvent("ObjectPoints", "other", b"x", 5.0))
    streams.forget(client)
    assert sent[-1] == Stream("obj", [], [], [], [5.0])
    streams.clear()
    streams.publish(StreamEvent("ObjectPoints", "obj", b"5", 5.0))
    assert seen == [b"5", b"5!"]


class Feed:
    """A feed that always has changes."""

    calls = 0

    async def everything(self) -> m.Update:
        return m.Update()

    async def changes(self) -> m.Update:
        self.calls += 1
        return m.Update(streams=[bytes(100_000)])


async def test_updates_are_not_queued_for_a_process_that_does_not_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(process, "PERIOD", 0.0)
    feed: Any = Feed()
    unused: Any = None
    running = PlantProcess("OPC UA server", "", feed, unused, "", unused, unused)
    ours, theirs = socket.socketpair()
    _, writer = await asyncio.open_unix_connection(sock=ours)
    sending = asyncio.create_task(running._send(writer))
    try:
        while writer.transport.get_write_buffer_size() <= process.MAX_UNSENT:
            await asyncio.sleep(0)
        calls = feed.calls
        for _ in range(100):
            await asyncio.sleep(0)
        assert feed.calls <= calls + 1
        assert writer.transport.get_write_buffer_size() < process.MAX_UNSENT + 200_000
    finally:
        sending.cancel()
        writer.transport.abort()
        theirs.close()
        await asyncio.gather(sending, return_exceptions=True)


@pytest.mark.parametrize("state", MachineState)
def test_each_state_of_packml_is_in_one_state_machine(state: MachineState) -> None:
    machines = unit._BASE, unit._MACHINE, unit._EXECUTE
    assert sum(state.name.capitalize() in machine for machine in machines) == 1


LEFT = Unit(1, "S1", "scn", 1, UnitState.GOOD, "2026-01-02T03:04:05+00:00")


class Cell:
    """The parts that the feed reads: a cell with one known device, and a board with the values that a scene reports."""

    def __init__(self) -> None:
        self.board = SimpleNamespace(
            on_report=[],
            on_clear=[],
            on_connection=[],
            on_identified=[],
            reports={},
            answering=True,
            object=self.object,
        )
        self.observed: dict[tuple[str, str], Any] = {}
        self.streams = SimpleNamespace(observe=self.observe, end_observing=self.end_observing)
        self.parts, self.program = SimpleNamespace(on_change=[]), SimpleNamespace(number=1)
        self.on_changed: list[Any] = []
        self.on_left: list[Any] = []
        self.on_state: list[Any] = []
        self.running = self.active = False
        self.last_job = 7, JobEnd.COMPLETED
        self.state, self.mode, self.authority, self.job = MachineState.IDLE, UnitMode.PRODUCE, CellAuthority.HUB, 0
        self.left = {UnitState.GOOD: 0, UnitState.BAD: 0, UnitState.REJECTED: 0}

    def observe(self, object_id: str, what: str, rate: float, receive: Any, owner: str) -> None:
        self.observed[object_id, what] = receive

    def end_observing(self, object_id: str, what: str, owner: str) -> None:
        self.observed.pop((object_id, what), None)

    def object(self, object_id: str) -> Any:
        return SimpleNamespace(name=object_id, type={"obj_table": "Table", "obj_arm": "UR5e"}.get(object_id, "Block"))

    def identities(self) -> dict[str, Identity]:
        return {"obj_io": Identity("WAGO", "750", "17")}

    def all(self) -> list[DeviceCard]:
        return [DeviceCard("obj_io", "io", "Block", self.identities()["obj_io"], "", "", "")]

    def derives_from(self, name: str, base: str) -> bool:
        return (name, base) in {("UR5e", "Robot"), ("Table", "VirtualCollisionObject")}

    def robot_meta(self, name: str) -> Any:
        return RobotMeta(name, RobotType.ARTICULATED)

    def get(self, number: int) -> None:
        return None

    async def find(self, args: Any) -> list[Any]:
        return []

    async def left_between(self, since: str, until: str) -> dict[UnitState, int]:
        return dict(self.left)


async def test_the_feed_shows_devices_and_sends_only_changes() -> None:
    cell: Any = Cell()
    feed = CellFeed([cell], cell, cell, cell, cell, cell, cell, cell)
    reader, other = feed.reader(with_streams=False), feed.reader(with_streams=False)
    first = await reader.everything()
    assert first.devices == [m.DeviceInfo("obj_io", "io", "Block", "", Identity("WAGO", "750", "17"))]
    assert first.states == {"obj_io": m.DeviceState(Connection.OFFLINE)}
    assert await reader.changes() == m.Update()

    for key in ("obj_io", "obj_arm", "obj_table"):
        cell.board.reports[key] = report = DeviceChanged(key, Connection.ONLINE, Health.NORMAL)
        for notify in cell.board.on_report:
            notify(report)
    cell.left[UnitState.GOOD], cell.state = 3, MachineState.EXECUTE
    for notify in cell.parts.on_change:
        notify(None)
    for notify in cell.on_left:
        notify(LEFT)
    changed = await reader.changes()
    assert changed.left == [LEFT]
    assert (await other.changes()).unit == changed.unit
    assert (await other.changes()) == m.Update()
    assert changed.devices is not None
    assert {each.id: each.robot_type for each in changed.devices} == {"obj_io": "", "obj_arm": "articulated"}
    assert changed.states["obj_arm"].connection is Connection.ONLINE
    assert changed.unit is not None
    assert (changed.unit.good, changed.unit.state) == (3, MachineState.EXECUTE)
    assert (changed.unit.last_job, changed.unit.job_end) == (7, "completed")

    assert cell.observed == {}
    reader.watch(["obj_arm"])
    assert len(cell.observed) == 2  # points and joints
    other.watch(["obj_io", "obj_unknown"])
    cell.observed["obj_io", POINTS](b"only for the other one")
    assert ((await reader.changes()).streams, (await other.changes()).streams) == ([], [b"only for the other one"])
    reader.watch([])
    assert list(cell.observed) == [("obj_io", POINTS)]
    other.watch([])
    assert cell.observed == {}
    streamed = feed.reader()
    assert len(cell.observed) == 4  # the points of three objects, and the joints of the robot
    cell.observed["obj_io", POINTS](b"values")
    assert (await streamed.changes()).streams == [b"values"]
    assert (await reader.changes()).streams == []

    cell.board.reports.clear()
    for forget in cell.board.on_clear:
        forget([])
    ended = await reader.changes()
    assert ended.devices is None
    assert {state.connection for state in ended.states.values()} == {Connection.OFFLINE}


class Written:
    """Stores values written to variables."""

    def __init__(self) -> None:
        self.values: list[ua.DataValue] = []

    async def write_attribute_value(self, node: ua.NodeId, value: ua.DataValue) -> None:
        self.values.append(value)


async def test_values_that_are_not_renewed_become_stale_and_keep_value_and_time() -> None:
    written: Any = Written()
    space: Any = SimpleNamespace(own=lambda *path: ua.NodeId("/".join(path), 1))
    device = Device(space, m.DeviceInfo("obj_io", "io", "Block"))
    device._connection = Connection.ONLINE
    device._points["DI1"] = Tag(written, ua.NodeId("DI1", 1), ua.VariantType.Boolean)
    point, at = LivePoint("DI1", PointUse.INPUT, True), time.monotonic() * 1e3
    for _ in range(3):  # unchanged values are not written again at once
        await device.set_points([point], at)
    (good,) = written.values
    await device.expire(3.0)
    assert len(written.values) == 1
    for _ in range(2):
        await device.expire(-1.0)
    _, stale = written.values
    assert stale.StatusCode.name == "UncertainLastUsableValue"
    assert stale.Value.Value is True
    assert abs((stale.SourceTimestamp - good.SourceTimestamp).total_seconds()) < 0.001
    await device.set_points([point], at)
    assert written.values[-1].StatusCode.is_good()


async def test_only_devices_that_clients_monitor_or_have_just_read_are_observed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    names = {key: (ua.NodeId(f"devices/{key}", 9), ua.NodeId(f"robots/{key}", 9)) for key in ("io", "arm", "off")}
    devices: Any = {
        key: SimpleNamespace(nodes=list(nodes), monitored=False, connected=key != "off") for key, nodes in names.items()
    }
    watched: list[list[str]] = []
    monitored = monitored_devices.MonitoredDevices(devices, watched.append)
    monitored.update()
    assert watched == [[]]
    await monitored.need([ua.NodeId(2258), ua.NodeId("cell/Production", 9), ua.NodeId("devices/off/Points/DI1", 9)])
    assert watched == [[]]

    reading = asyncio.create_task(monitored.need([ua.NodeId("robots/arm/Axes/j1", 9)]))
    await asyncio.sleep(0)
    assert watched[-1] == ["arm"]
    monitored.arrived(names["arm"][0])
    await asyncio.sleep(0)
    assert not reading.done()  # the points have arrived, but not the joints
    monitored.arrived(names["arm"][1])
    await reading
    await monitored.need([ua.NodeId("robots/arm/Axes/j2", 9)])  # current already

    monkeypatch.setattr(monitored_devices, "FIRST_VALUES", 0.0)
    await monitored.need(
        [ua.NodeId("devices/io/Points/DI1", 9)]
    )  # a device that does not answer delays the client no longer
    assert watched[-1] == ["arm", "io"]
    devices["io"].monitored = True
    later = time.monotonic() + monitored_devices.LEASE
    monkeypatch.setattr(monitored_devices, "time", SimpleNamespace(monotonic=lambda: later))
    monitored.update()
    assert watched[-1] == ["io"]
    devices["io"].monitored = False
    monitored.update()
    assert watched[-1] == []


async def test_a_momentary_alarm_is_one_event_and_a_retained_one_ends_with_an_event() -> None:
    events: list[Any] = []

    async def trigger_event(event: Any) -> None:
        events.append((event.ConditionName, event.Retain, getattr(event, "ActiveState/Id")))

    server = SimpleNamespace(iserver=SimpleNamespace(subscription_service=SimpleNamespace(trigger_event=trigger_event)))
    space: Any = SimpleNamespace(server=server, own=lambda *path: ua.NodeId("/".join(path), 1))
    unused: Any = None
    conditions = Conditions(space, lambda alarm: (ua.NodeId("cell", 1), "Cell"), unused)
    at = "2026-01-02T03:04:05+00:00"
    lost = AlarmRecord(1, "io-1", "connection_lost", Priority.HIGH, AlarmCategory.CONNECTION, "Lost.", at, 1)
    refused = replace(lost, number=2, kind="plc-4", active=False, retain=False)
    for alarm in (lost, refused, replace(refused, note="seen"), replace(lost, active=False, retain=False, cleared=at)):
        await conditions.change(alarm)
    assert events == [("io-1", True, True), ("plc-4", False, False), ("io-1", False, False)]
    assert conditions.retained == {}
