"""Connection losses of every kind, and a stopped PLC program."""

import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

import psutil
import pytest
from asyncua.client.ua_client import UaClient, UaClientState

from arcor2_drivers.opcua_plc.opcua_plc import OpcUaPlc
from arcor2_hw.data.device import Connection, Health
from arcor2_hw.exceptions import (
    Cancelled,
    ConnectionLost,
    DeviceError,
    DeviceTimeout,
    NotConnected,
    NotInControl,
    Stale,
)
from arcor2_hw.objects.edges import Edge
from tests.drivers.benches.opcua_plc_bench import ORPHAN
from tests.drivers.opcua_plc.conftest import HANDSHAKE, POINTS, BackgroundCall
from tests.fakes.conftest import FakeProcess

UP = (Connection.ONLINE, Connection.BACK)


@pytest.mark.parametrize("fault", ["silence", "reset", "half_frame", "garbage", "power_cycle"])
def test_a_loss_during_a_job(
    fake: FakeProcess, plc: OpcUaPlc, wait_for: Any, fault: str, caplog: pytest.LogCaptureFixture
) -> None:
    edges: list[Edge] = []
    plc.subscribe("part", edges.append)
    running = BackgroundCall(lambda: plc.run_job(3))
    fake.control.wait_until(lambda t: t["moving"])
    fake.control.do(fault)
    assert isinstance(running.outcome(), DeviceError)
    wait_for(lambda: plc.connection, lambda state: state not in (Connection.ONLINE,))
    fake.control.wait_until(lambda t: not t["moving"])
    fake.control.do("heal")
    wait_for(lambda: plc.connection, lambda state: state is Connection.BACK)
    assert plc.control_owner() != "us"
    with pytest.raises(NotInControl, match="control ended when the connection was lost"):
        plc.write_digital("lamp", True)
    time.sleep(0.3)
    assert not fake.truth()["moving"], "it continued by itself"
    fake.control.do("set", name="PartPresent", value=True)
    wait_for(lambda: [edge.value for edge in edges], lambda values: values == [True])
    fake.control.wait_until(lambda t: t["owner"] == 0)
    plc.take_control()
    plc.run_job(1)
    assert sum(" lost: " in record.message for record in caplog.records) == 1
    assert sum(" restored after " in record.message for record in caplog.records) == 1


def test_a_socket_that_is_connected_too_late_is_closed(
    fake: FakeProcess, make: Callable[..., OpcUaPlc], monkeypatch: pytest.MonkeyPatch
) -> None:
    """asyncua leaves such a socket open when the time limit, or a disconnect, and the connection coincide."""
    connect = UaClient.connect_socket

    async def too_late(client: UaClient, host: str, port: int) -> None:
        await connect(client, host, port)
        client._set_state(UaClientState.DISCONNECTED)
        client.protocol = None
        raise TimeoutError

    def sockets() -> list[Any]:
        port = int(fake.ready["url"].rpartition(":")[2])
        return [each for each in psutil.Process().net_connections() if each.raddr and each.raddr.port == port]

    before = len(sockets())
    plc = make(fake.ready["url"])
    with monkeypatch.context() as patched:
        patched.setattr(UaClient, "connect_socket", too_late)
        with pytest.raises(DeviceTimeout):
            plc.connect()
    assert len(sockets()) == before
    plc.connect()


def test_outputs_and_job_end_with_the_life_sign(fake: FakeProcess) -> None:
    process = subprocess.Popen([sys.executable, "-c", ORPHAN, fake.ready["url"], POINTS, HANDSHAKE])
    try:
        fake.control.wait_until(lambda t: t["moving"])
        fake.control.do("set", name="Lamp", value=True)
        fake.control.do("set", name="Valve", value=True)
    finally:
        process.kill()
        process.wait()
    truth = fake.control.wait_until(lambda t: not t["moving"])
    truth = fake.control.wait_until(lambda t: t["owner"] == 0)
    assert (truth["points"]["Lamp"], truth["points"]["Valve"]) == (False, True), "off and hold, as declared"
    assert truth["code"] == 91


def test_the_life_sign_continues_during_a_long_job(fake: FakeProcess, plc: OpcUaPlc) -> None:
    running = BackgroundCall(lambda: plc.run_job(3))
    fake.control.wait_until(lambda t: t["moving"])
    time.sleep(2.2)  # twice the PLC's time limit
    assert fake.truth()["moving"]
    assert plc.control_owner() == "us"
    plc.stop()
    assert isinstance(running.outcome(), Cancelled)


def test_a_stopped_plc_program_makes_values_stale(fake: FakeProcess, plc: OpcUaPlc, wait_for: Any) -> None:
    running = BackgroundCall(lambda: plc.run_job(3))
    fake.control.wait_until(lambda t: t["moving"])
    fake.control.do("live", on=False)
    assert isinstance(running.outcome(), DeviceError)
    with pytest.raises(Stale, match=r"plc at opc.tcp.*program of the PLC is stopped"):
        plc.read("level")
    assert plc.connection in UP, "the server answers"
    assert [alarm.code for alarm in plc.alarms()] == ["program_stands"]
    assert plc.health is Health.FAILURE
    with pytest.raises(NotInControl, match="program of the PLC was stopped"):
        plc.write_digital("lamp", True)
    fake.control.do("live", on=True)
    wait_for(plc.alarms, lambda alarms: alarms == [])
    assert plc.read_analog("level") == pytest.approx(0.5)
    with pytest.raises(NotInControl):
        plc.write_digital("lamp", True)
    fake.control.wait_until(lambda t: t["owner"] == 0 and not t["moving"])
    plc.take_control()
    plc.write_digital("lamp", True)


def test_a_power_cycle_ends_control(fake: FakeProcess, plc: OpcUaPlc, wait_for: Any) -> None:
    fake.control.do("restart")  # faster than the driver notices the loss
    wait_for(plc.control_owner, lambda owner: owner is None)
    with pytest.raises(NotInControl, match="taken control away"):
        plc.write_digital("lamp", True)


def test_a_slow_server_times_out(fake: FakeProcess, plc: OpcUaPlc, wait_for: Any) -> None:
    fake.control.do("slow", seconds=1.0)
    with pytest.raises((DeviceTimeout, ConnectionLost), match=r"plc at opc.tcp"):
        plc.read("level")
    fake.control.do("heal")
    wait_for(lambda: plc.connection, lambda state: state in UP)
    fake.control.do("set", name="Level", value=42)
    wait_for(lambda: _level(plc), lambda level: level == pytest.approx(0.042))


def _level(plc: OpcUaPlc) -> float:
    try:
        return plc.read_analog("level")
    except (ConnectionLost, DeviceTimeout):
        return -1.0


def test_an_unreachable_device_is_named(make: Callable[..., OpcUaPlc]) -> None:
    plc = make("opc.tcp://127.0.0.1:1")
    with pytest.raises(NotConnected, match=r"plc at opc.tcp://127.0.0.1:1"):
        plc.connect(1.0)
