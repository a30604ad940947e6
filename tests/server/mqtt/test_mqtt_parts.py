"""Options, sessions, queued values, host states and topics of the MQTT clients; repeated restarts of processes."""

import asyncio
import contextlib
import json
import ssl
import subprocess
import time
from collections.abc import AsyncIterator, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import msgspec
import pytest
from msgspec.structs import replace

from arcor2_hw.data.alarms import AlarmCategory, AlarmRecord, Priority
from arcor2_hw.data.device import Connection, Identity
from arcor2_hw.data.events import Event
from arcor2_hw.data.points import LivePoint, ObjectPointsData, PointQuality, PointUse
from arcor2_hw.data.units import Unit, UnitState
from arcor2_hw.exceptions import InvalidData
from arcor2_hw.mqtt import edge_node, link, messages as m, plain
from arcor2_hw.mqtt.cell import CellState, topic_level
from arcor2_hw.mqtt.edge_node import EdgeNode, ValueQueue
from arcor2_hw.mqtt.payload import Kind, Metric
from arcor2_hw.mqtt.plain import PlainJson, schema
from arcor2_hw.plant.messages import DeviceInfo, DeviceState, UnitData, Update
from arcor2_server.access.authority import Authority
from arcor2_server.cli.mqtt_options import mqtt_settings
from arcor2_server.mqtt.service import Mqtt
from arcor2_server.plant import process
from arcor2_server.plant.process import PlantProcess
from arcor2_server.settings import MqttSettings
from tests.server.mqtt.brokers import Broker, Mosquitto, Nats
from tests.server.mqtt.host import Host
from tests.server.mqtt.test_mqtt_server import until
from tests.server.opcua.plant_client import client_certificate

ROOT = Path(__file__).parents[3]
IO = DeviceInfo("obj_io", "io block", "RemoteIO", "", Identity("WAGO", "750", "17"))
PREFIX = "acme/line-1/cell"
ONLINE = DeviceState(Connection.ONLINE)


@pytest.fixture(scope="module")
def mosquitto(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Broker]:
    broker = Mosquitto(tmp_path_factory.mktemp("mosquitto"))
    yield broker
    broker.end()


@pytest.fixture(scope="module")
def nats(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Broker]:
    broker = Nats(tmp_path_factory.mktemp("nats"))
    yield broker
    broker.end()


@pytest.fixture(autouse=True)
def short_pauses(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(link, "FIRST_PAUSE", 0.05)


def points(*values: Any, quality: PointQuality = PointQuality.GOOD) -> bytes:
    """Return an encoded event with the points of the I/O block, named DI1 and so on."""
    found = [LivePoint(f"DI{at}", PointUse.INPUT, value, "V" if isinstance(value, float) else "", quality)
             for at, value in enumerate(values, 1)]  # fmt: skip
    data = ObjectPointsData("obj_io", time.monotonic() * 1e3, found)
    return msgspec.json.encode(Event("ObjectPoints", data=data))


class Publishing:
    """A publisher in this process, with the state that it publishes."""

    def __init__(self, publisher: EdgeNode | PlainJson, cell: CellState, reports: list[Any]) -> None:
        self.publisher, self.cell, self.reports = publisher, cell, reports

    def update(self, **changes: Any) -> None:
        self.publisher.changed(self.cell.apply(Update(**changes)))


@contextlib.asynccontextmanager
async def publishing(
    kind: type[EdgeNode] | type[PlainJson], port: int, folder: Path, node: str = "", host: str = ""
) -> AsyncIterator[Publishing]:
    """Publish a cell with an online I/O block."""
    names = m.Sparkplug("plant", node, host) if node else None
    setup = m.Setup(m.Broker("127.0.0.1", port), names, PREFIX, str(folder), "0.1")
    cell, reports = CellState(), []  # type: ignore[var-annotated]
    publisher = kind(setup, cell, reports.append)
    running = Publishing(publisher, cell, reports)
    running.update(devices=[IO], states={"obj_io": ONLINE}, unit=UnitData(state=4), streams=[points(True, 1.5, None)])
    task = asyncio.create_task(publisher.run())
    try:
        yield running
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


# ------------------------------------------------------------------------------------ Sparkplug B
async def test_changes_are_data_and_a_new_type_is_a_new_birth(mosquitto: Broker, tmp_path: Path) -> None:
    host = Host(mosquitto.port, "spBv1.0/plant/+/types/#")
    async with publishing(EdgeNode, mosquitto.port, tmp_path, "types") as cell:
        (birth,) = await until(lambda: host.of("DBIRTH", "io_block"))
        assert [birth.value(f"Points/DI{number}") for number in (1, 2, 3)] == [True, 1.5, None]
        assert birth.metrics[-2].properties == {"Quality": 192, "engUnit": "V"}
        cell.update(streams=[points(True, 2.5, None)])
        (data,) = await until(lambda: host.of("DDATA", "io_block"))
        assert [(each.name, each.value) for each in data.metrics] == [("Points/DI2", 2.5)]
        cell.update(streams=[points(True, 2.5, None, quality=PointQuality.BAD)])
        await until(lambda: host.values("Points/DI1", "io_block")[-1].properties["Quality"] == 0)
        cell.update(streams=[points(True, 2.5, 7.0)])
        await until(lambda: len(host.of("DBIRTH", "io_block")) == 2)
        await until(lambda: host.values("Points/DI3", "io_block")[-1].value == 7.0)
        cell.publisher.changed(cell.cell.expire(silent=True))
        await until(lambda: host.values("Points/DI3", "io_block")[-1].properties["Quality"] == 500)
        cell.update(left=[Unit(7, "S1", "scn", 3, UnitState.GOOD, "2026-01-02T03:04:05Z", "2026-01-02T03:05:00Z")])
        await until(lambda: host.values("Units/Last")[-1].value)
        assert json.loads(host.values("Units/Last")[-1].value)["serial"] == "S1"
        cell.update(devices=[])
        await until(lambda: host.of("DDEATH", "io_block"))
    await until(lambda: host.of("NDEATH"))
    assert not any(each.historical for message in host.messages for each in message.metrics)
    assert host.faults == []
    host.end()


async def test_values_are_queued_for_the_primary_host_and_sent_once_as_history(
    mosquitto: Broker, tmp_path: Path
) -> None:
    host = Host(mosquitto.port, "spBv1.0/plant/+/waiting/#")
    async with publishing(EdgeNode, mosquitto.port, tmp_path, "waiting", "scada") as cell:
        await until(lambda: cell.reports)
        for number in range(300):
            cell.update(unit=UnitData(state=6, good=number))
        host.client.publish("spBv1.0/STATE/scada", b"ONLINE", qos=1).wait_for_publish(30)  # of version 2
        assert host.messages == []
        host.state("scada", True, 1000)
        (birth,) = await until(lambda: host.of("NBIRTH"))
        assert birth.value("Counts/Good") == 299
        await until(lambda: len(host.values("Counts/Good")) == 300)
        history = host.values("Counts/Good")[1:]
        assert [each.value for each in history] == list(range(299))
        assert all(each.historical for each in history)

        host.state("scada", False, 999)  # the late will of an older connection
        cell.update(unit=UnitData(state=6, good=300))
        await until(lambda: host.values("Counts/Good")[-1].value == 300)
        assert not host.values("Counts/Good")[-1].historical
        host.state("scada", False, 1001)
        await until(lambda: host.of("NDEATH"))
        cell.update(unit=UnitData(state=6, good=301))
        cell.update(unit=UnitData(state=6, good=302))
        host.state("scada", True, 1002)
        again = (await until(lambda: host.of("NBIRTH")[1:]))[0]
        assert again.value("bdSeq") == birth.value("bdSeq") + 1
        await until(lambda: host.values("Counts/Good")[-1].historical)
        assert [(each.value, each.historical) for each in host.values("Counts/Good")[-2:]] == [
            (302, False),
            (301, True),
        ]
    assert host.faults == []
    host.end()


def test_the_oldest_values_of_the_longest_queue_are_dropped() -> None:
    queue = ValueQueue(4)
    for number in range(4):
        queue.put("arm", Metric(None, 1, Kind.INT32, number, number))
    queue.put("", Metric(None, 2, Kind.INT32, 9, 9))
    assert [each.value for each in queue.take("arm")] == [1, 2, 3]
    assert [each.value for each in queue.take("")] == [9]
    assert queue.dropped == 1
    for number in range(3):
        queue.put("arm", Metric(None, 1, Kind.INT32, number, number))
    queue.mark_historical("arm", [Metric("n", 1, Kind.INT32, 2, 2)])
    assert [(each.value, each.historical) for each in queue.take("arm")] == [(0, True), (1, True)]
    assert queue._count == 0


async def test_a_restarted_broker_gets_a_new_birth_and_the_queued_values(tmp_path: Path) -> None:
    broker = Mosquitto(tmp_path)
    host = Host(broker.port, "spBv1.0/plant/#")
    async with publishing(EdgeNode, broker.port, tmp_path, "again", "scada") as cell:
        host.state("scada", True)
        await until(lambda: host.of("NBIRTH"))
        host.subscribed.clear()
        broker.end()
        await until(lambda: len(cell.reports) == 2)
        for number in (1, 2):
            cell.update(unit=UnitData(state=4, bad=number))
        broker.start()
        await until(host.subscribed.is_set)
        host.state("scada", True)
        again = (await until(lambda: host.of("NBIRTH")[1:]))[0]
        assert (again.value("bdSeq"), again.value("Counts/Bad")) == (1, 2)
        await until(lambda: [each.value for each in host.values("Counts/Bad") if each.historical] == [1])
        assert [each.connected for each in cell.reports] == [True, False, True]
    assert host.faults == []
    host.end()
    broker.end()


async def test_the_session_number_continues_after_a_restart(mosquitto: Broker, tmp_path: Path) -> None:
    (tmp_path / edge_node.SESSION_FILE).write_text("255")
    host = Host(mosquitto.port, "spBv1.0/plant/+/numbers/#")
    for number in (0, 1):
        async with publishing(EdgeNode, mosquitto.port, tmp_path, "numbers"):
            await until(lambda number=number: host.of("NBIRTH")[number:])  # type: ignore[misc]
    assert [each.value("bdSeq") for each in host.of("NBIRTH")] == [0, 1]
    await until(lambda: [each.value("bdSeq") for each in host.of("NDEATH")] == [0, 1])
    assert host.faults == []
    host.end()


async def test_sparkplug_works_with_the_broker_of_nats(nats: Broker, tmp_path: Path) -> None:
    host = Host(nats.port, "spBv1.0/plant/#")
    async with publishing(EdgeNode, nats.port, tmp_path, "nats", "scada") as cell:
        host.state("scada", True)
        await until(lambda: host.of("DBIRTH", "io_block"))
        cell.update(streams=[points(False, 1.5, None)])
        await until(lambda: host.of("DDATA", "io_block"))
        host.rebirth("plant/nats")
        await until(lambda: len(host.of("NBIRTH")) == 2)
        host.state("scada", False)
        await until(lambda: host.of("NDEATH"))
    assert host.faults == []
    host.end()


# paho-mqtt leaves the socket of a failed handshake to the garbage collector.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
async def test_tls_needs_a_trusted_broker_the_right_password_and_the_client_certificate(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    authority = Authority(tmp_path, lambda: ["127.0.0.1"])
    authority.renew()
    der, key = client_certificate(tmp_path)
    certificate = tmp_path / "client-certificate.pem"
    certificate.write_text(ssl.DER_cert_to_PEM_cert(der.read_bytes()))
    passwords = tmp_path / "passwords"
    subprocess.run(["mosquitto_passwd", "-b", "-c", str(passwords), "cell", "right"], check=True)
    (tmp_path / "certificate.pem").chmod(0o644)
    lines = f"""allow_anonymous false
password_file {passwords}
certfile {authority.files[0]}
keyfile {authority.files[1]}
cafile {certificate}
require_certificate true"""
    broker = Mosquitto(tmp_path, lines)
    files = {"authority": str(authority.file), "certificate": str(certificate), "key": str(key)}
    good = m.Broker("127.0.0.1", broker.port, True, "cell", "right", **files)
    other = Authority(tmp_path / "other", lambda: ["127.0.0.1"])
    other.file.parent.mkdir()
    other.renew()
    refused = {
        "verify failed": replace(good, authority=str(other.file)),
        "Not authorized": replace(good, password="wrong"),
        "timed out": replace(good, certificate="", key=""),
        "No such file": replace(good, authority="/nowhere"),
    }
    monkeypatch.setattr(link, "TIMEOUT", 2.0)
    for reason, settings in {**refused, "connected": good}.items():
        reports: list[m.LinkChanged] = []
        setup = m.Setup(settings, m.Sparkplug("plant", "tls"), "", str(tmp_path), "0.1")
        node = EdgeNode(setup, CellState(), reports.append)
        task = asyncio.create_task(node.run())
        await until(lambda reports=reports: reports)  # type: ignore[misc]
        assert reports[0].connected is (settings is good), reports
        assert reason in reports[0].reason or settings is good
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
    broker.end()


# ------------------------------------------------------------------------------------ plain JSON
@pytest.mark.parametrize("kind", ["mosquitto", "nats"])
async def test_json_is_published_and_topics_of_removed_devices_disappear(
    kind: str, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    broker: Broker = request.getfixturevalue(kind)
    host = Host(broker.port, f"{PREFIX}/#")
    lost = AlarmRecord(1, "io-1", "lost", Priority.HIGH, AlarmCategory.CONNECTION, "Lost.", "2026-01-02T03:04:05Z", 1)
    left = Unit(7, "S1", "scn", 3, UnitState.BAD, "2026-01-02T03:04:05Z", "2026-01-02T03:05:00Z", verdict=False)
    host.client.publish(f"{PREFIX}/devices/old/state", b"{}", qos=1, retain=True).wait_for_publish(30)
    async with publishing(PlainJson, broker.port, tmp_path) as cell:
        await until(lambda: host.of(f"{PREFIX}/status"))
        assert host.of(f"{PREFIX}/state")[-1].json["state"] == "idle"
        found = host.of(f"{PREFIX}/devices/io_block/points")[-1].json["points"]["DI2"]
        assert (found["value"], found["unit"], found["quality"]) == (1.5, "V", "good")
        cell.update(alarms=[lost], left=[left])
        await until(lambda: host.of(f"{PREFIX}/results"))
        assert host.of(f"{PREFIX}/results")[0].json["verdict"] is False
        await until(lambda: host.of(f"{PREFIX}/alarms")[-1].json["alarms"])
        assert host.of(f"{PREFIX}/alarms/changed")[0].json["text"] == "Lost."
        await until(lambda: host.of(f"{PREFIX}/devices/old/state")[-1].payload == b"")
        cell.update(devices=[])
        await until(lambda: host.of(f"{PREFIX}/devices/io_block/state")[-1].payload == b"")
    await until(lambda: host.of(f"{PREFIX}/status")[-1].payload == b"offline")
    host.end()


async def test_a_broker_that_does_not_answer_leaves_no_sockets(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(link, "TIMEOUT", 0.05)
    monkeypatch.setattr(link, "MAX_PAUSE", 0.05)
    attempts: set[asyncio.StreamWriter] = set()
    ended = 0

    async def accept(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        nonlocal ended
        attempts.add(writer)
        while await reader.read(1000):
            pass
        writer.close()
        ended += 1

    async with await asyncio.start_server(accept, "127.0.0.1", 0) as server:
        async with publishing(PlainJson, server.sockets[0].getsockname()[1], tmp_path) as cell:
            await until(lambda: ended >= 3)
            assert [each.reason for each in cell.reports] == ["Operation timed out"]
        await until(lambda: ended == len(attempts))


async def test_results_are_queued_until_the_broker_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plain, "MAX_EVENTS", 3)
    broker = Mosquitto(tmp_path)
    broker.end()
    async with publishing(PlainJson, broker.port, tmp_path) as cell:
        await until(lambda: cell.reports)
        assert "refused" in cell.reports[0].reason
        for number in range(5):
            cell.update(left=[Unit(number, "", "scn", number, UnitState.GOOD, "2026-01-02T03:04:05Z")])
        broker.start()
        host = Host(broker.port, f"{PREFIX}/#")
        await until(lambda: len(cell.reports) == 3)
        assert cell.reports[1:] == [m.LinkChanged("JSON", True), m.ValuesDropped(2)]
        host.end()
    broker.end()


def test_the_schema_is_the_documented_one() -> None:
    assert json.loads((ROOT / "docs" / "reference" / "mqtt-schema.json").read_text()) == schema()


def test_devices_have_different_levels_without_forbidden_characters() -> None:
    assert topic_level("arm +#/ž.*1") == "arm____ž__1"
    cell = CellState()
    infos = [DeviceInfo("obj_1", "a/b", "T"), DeviceInfo("obj_2", "a b", "T"), DeviceInfo("obj_3", "ramž", "T")]
    cell.apply(Update(devices=infos))
    assert [each.level for each in cell.devices.values()] == ["a_b", "a_b_obj_2", "ramž"]


# ------------------------------------------------------------------------------------ options and the server
def settings(
    url: str | None = None, names: str | None = "g/n", *, unencrypted: bool = False, **environment: str
) -> Any:
    return mqtt_settings(url, names, None, None, unencrypted=unencrypted, environment=environment)


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        ({"url": "mqtt://192.0.2.1"}, "another machine"),
        ({"url": "mqtts://u:p@broker"}, "password"),
        ({"url": "http://broker"}, "not mqtt://"),
        ({"url": "mqtts://broker:port"}, "not mqtt://"),
        ({"url": "mqtts://broker/topic"}, "not mqtt://"),
        ({}, "need a broker"),
        ({"url": "mqtt://localhost", "names": "group"}, "GROUP/NODE"),
        ({"url": "mqtt://localhost", "names": "g/n/x"}, "GROUP/NODE"),
        ({"url": "mqtt://localhost", "names": "g/#"}, "GROUP/NODE"),
        ({"url": "mqtt://localhost", "names": None}, "--mqtt-sparkplug"),
        ({"url": "mqtt://localhost", "ARCOR2_HW_MQTT_CA": "/nowhere"}, "mqtts"),
        ({"url": "mqtts://broker", "ARCOR2_HW_MQTT_CA": "/nowhere"}, "cannot be read"),
        ({"url": "mqtts://broker", "ARCOR2_HW_MQTT_KEY": "/nowhere"}, "both"),
    ],
)
def test_invalid_options_are_refused(arguments: dict[str, Any], reason: str) -> None:
    with pytest.raises(InvalidData, match=reason):
        settings(**arguments)


def test_the_address_of_the_broker_is_read() -> None:
    names = {"group": "g", "node": "n"}
    given = {"host": "broker.plant", "port": 8883, "tls": True, "user": "cell", "password": "p@ss"}
    assert settings(ARCOR2_HW_MQTT_URL="mqtts://cell:p%40ss@broker.plant") == MqttSettings(**given, **names)
    unencrypted = settings("mqtt://192.0.2.1:1884", unencrypted=True)
    assert unencrypted == MqttSettings(host="192.0.2.1", port=1884, **names)
    assert settings(names=None) is None


async def test_a_process_that_ends_repeatedly_raises_an_alarm(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(process, "FIRST_PAUSE", 0.0)
    monkeypatch.setattr(process, "MAX_PAUSE", 1.0)
    alarms: Any = SimpleNamespace(raised=[])
    alarms.system = lambda *alarm: alarms.raised.append(alarm)
    unused: Any = None
    ends = 0

    async def run(_self: PlantProcess, _inherited: Any) -> None:
        nonlocal ends
        ends += 1
        if ends == 5:  # the fifth process keeps running
            await asyncio.sleep(60)
        raise OSError("no memory")

    monkeypatch.setattr(PlantProcess, "_run", run)
    running = PlantProcess("MQTT process", "arcor2_hw.mqtt", unused, alarms, "mqtt_ended", unused, unused)
    running.start()
    await until(lambda: len(alarms.raised) == 2)
    assert alarms.raised == [("mqtt_ended", True), ("mqtt_ended", False)]
    assert ends == 5
    await running.close()


async def test_a_lost_broker_raises_an_alarm_until_all_links_are_restored(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("arcor2_server.mqtt.service.ALARM_AFTER", 0.0)
    alarms: Any = SimpleNamespace(raised=[])
    alarms.system = lambda code, active, *text: alarms.raised.append((code, active))
    mqtt = Mqtt(SimpleNamespace(mqtt=settings("mqtt://localhost")), SimpleNamespace(), alarms)  # type: ignore[arg-type]
    encode = msgspec.msgpack.encode
    for name in ("JSON", "Sparkplug"):
        await mqtt._received(encode(m.LinkChanged(name, False, "refused")))
    await until(lambda: alarms.raised)
    await mqtt._received(encode(m.LinkChanged("JSON", True)))
    assert alarms.raised[-1] == ("mqtt_broker_lost", True)
    await mqtt._received(encode(m.LinkChanged("Sparkplug", True)))
    assert alarms.raised[-1] == ("mqtt_broker_lost", False)
    await mqtt.close()
