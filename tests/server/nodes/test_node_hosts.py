"""Cell hosts on a node: the unchanged host and driver, over a broker on this computer."""

import asyncio
import os
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import pytest

from arcor2_hw.data.nodes import NodeState
from arcor2_hw.data.operation import HoldKind
from arcor2_hw.data.project import Project
from arcor2_hw.exceptions import Arcor2Error, OutcomeUnknown
from arcor2_hw.runtime import messages as m
from arcor2_server.hosts.process import CellError, CellHost
from tests.runtime.conftest import Package, open_scene, scene_object, type_code
from tests.runtime.test_host_holding import ARM
from tests.runtime.test_host_program import Run
from tests.server.nodes.conftest import NODE, PATIENCE, Broker, Node, followed, tls_configuration
from tests.waiting import wait_for

pytestmark = pytest.mark.xdist_group("nodes")  # its tests share a broker and a node

DEVICE = type_code(
    "Device",
    """
    class Device(Generic):
        _ABSTRACT = False

        def add(self, a: int, b: int) -> int:
            return a + b

        def picture(self, size: int) -> str:
            return "x" * size

        def pid(self) -> int:
            return os.getpid()

        def say(self, text: str) -> None:
            print(text)

        def move(self, file: str) -> None:
            self.file, self.moving = file, True
            Path(file).touch()
            while self.moving:
                time.sleep(0.002)
            raise Cancelled("stopped")

        def stop(self) -> None:
            if self.moving:
                Path(self.file + ".stopped").touch()
            self.moving = False

        moving = False
""",
)

LEASE = 20.0  # s
AN_HOUR_AHEAD = ("unshare", "--time", "--fork", "--kill-child", "--monotonic", "3600", "--boottime", "3600")
SCENE = open_scene([DEVICE], scene_object("arm", "Device"))


async def online(host: CellHost, opening: m.OpenScene = SCENE) -> None:
    host.send(opening)
    opened = await host.expect(m.SceneOpened | m.SceneFailed, PATIENCE)  # type: ignore[arg-type]
    assert isinstance(opened, m.SceneOpened), opened


def moving(host: CellHost, file: Path) -> "asyncio.Task[bytes]":
    return asyncio.create_task(host.call("obj_arm", "move", {"file": msgspec.json.encode(str(file))}, control=True))


async def test_a_host_on_a_node_returns_small_and_large_results(node: Node, start_host: Callable[..., Any]) -> None:
    host, _ = await start_host()
    await online(host)
    assert await host.call("obj_arm", "add", {"a": b"2", "b": b"3"}) == b"5"
    large = host.call("obj_arm", "picture", {"size": b"3000000"})
    small = [host.call("obj_arm", "add", {"a": b"1", "b": str(n).encode()}) for n in range(50)]
    found, *sums = await asyncio.gather(large, *small)
    assert found == b'"' + b"x" * 3_000_000 + b'"'
    assert sums == [str(1 + n).encode() for n in range(50)]
    with pytest.raises(CellError, match="fly"):
        await host.call("obj_arm", "fly")


async def test_a_stop_reaches_the_device_during_a_call(
    node: Node, start_host: Callable[..., Any], tmp_path: Path
) -> None:
    host, _ = await start_host()
    await online(host)
    call = moving(host, tmp_path / "moving")
    await asyncio.to_thread(wait_for, (tmp_path / "moving").exists)
    await host.stop_motion("obj_arm")
    with pytest.raises(CellError, match="stopped"):
        await call
    assert [stop.object_id for stop in await host.stop_all()] == ["obj_arm"]


async def test_motion_stops_when_the_broker_is_cut_off_and_does_not_resume(
    broker: Broker, node: Node, start_host: Callable[..., Any], tmp_path: Path
) -> None:
    """A suspended broker delivers everything late, like a cable that is cut and repaired."""
    host, listener = await start_host()
    await online(host)
    call = moving(host, tmp_path / "first")
    await asyncio.to_thread(wait_for, (tmp_path / "first").exists)
    os.kill(broker.process.pid, signal.SIGSTOP)
    late = moving(host, tmp_path / "second")
    await asyncio.to_thread(wait_for, (tmp_path / "first.stopped").exists)
    for task in (call, late):
        with pytest.raises(OutcomeUnknown, match=f"the connection to the node {NODE} was lost: nothing was received"):
            await task
    assert len(listener.reasons) == 1
    os.kill(broker.process.pid, signal.SIGCONT)
    with pytest.raises(Arcor2Error):  # the host has ended, so the scene must be started again
        await host.call("obj_arm", "add", {"a": b"1", "b": b"1"})
    again, _ = await start_host()
    await online(again)
    assert not (tmp_path / "second").exists()


async def test_motion_stops_when_the_broker_is_killed(start_host: Callable[..., Any], tmp_path: Path) -> None:
    broker = Broker(tmp_path)
    node = Node(broker.url, tmp_path)
    try:
        host, listener = await start_host(broker.url)
        await online(host)
        call = moving(host, tmp_path / "moving")
        await asyncio.to_thread(wait_for, (tmp_path / "moving").exists)
        broker.end()
        await asyncio.to_thread(wait_for, (tmp_path / "moving.stopped").exists)
        with pytest.raises(OutcomeUnknown):
            await call
        (reason,) = listener.reasons
        assert f"the node {NODE}" in reason
    finally:
        node.end()
        broker.end()


async def test_motion_stops_when_the_relay_of_the_server_is_killed(
    node: Node, start_host: Callable[..., Any], tmp_path: Path
) -> None:
    host, _ = await start_host()
    await online(host)
    call = moving(host, tmp_path / "moving")
    await asyncio.to_thread(wait_for, (tmp_path / "moving").exists)
    host.kill()
    await asyncio.to_thread(wait_for, (tmp_path / "moving.stopped").exists)
    with pytest.raises(OutcomeUnknown):
        await call


async def test_motion_stops_when_the_service_of_the_node_hangs(
    node: Node, start_host: Callable[..., Any], tmp_path: Path
) -> None:
    """A suspended service keeps the socket of the host open."""
    host, listener = await start_host()
    await online(host)
    call = moving(host, tmp_path / "moving")
    await asyncio.to_thread(wait_for, (tmp_path / "moving").exists)
    os.kill(node.process.pid, signal.SIGSTOP)
    try:
        await asyncio.to_thread(wait_for, (tmp_path / "moving.stopped").exists)
        with pytest.raises(OutcomeUnknown):
            await call
    finally:
        os.kill(node.process.pid, signal.SIGCONT)
    assert f"the node {NODE}" in listener.reasons[0]
    again, _ = await start_host()
    await online(again)


async def test_a_node_announces_itself_and_its_sessions(
    broker: Broker, node: Node, start_host: Callable[..., Any]
) -> None:
    async with followed(os.environ | {"ARCOR2_HW_NATS_URL": broker.url}) as until:
        host, _ = await start_host()
        await online(host)
        await until(NodeState.CONNECTED, ["scene"])
        await host.close()
        await until(NodeState.CONNECTED, [])


async def test_a_package_runs_with_its_files(node: Node, start_host: Callable[..., Any], tmp_path: Path) -> None:
    host, listener = await start_host()
    directory = tmp_path / "package"
    directory.mkdir()
    run = Run(None, Package(directory), tmp_path)  # type: ignore[arg-type]
    run.write('arm.slow(0.0, an="a1")')
    host.send(m.RunPackage("pkg_1", str(directory)))
    async with asyncio.timeout(PATIENCE):
        await asyncio.shield(host.ended)
    end = [each for each in listener.messages if isinstance(each, m.ProgramChanged)][-1]
    assert (end.state, end.finished, end.error) == ("stopped", True, None)
    assert run.notes() == ["control", "slow", "disconnected"]
    assert [each.event for each in listener.messages if isinstance(each, m.ProgramEvent)] == [
        "PackageInfo",
        "ActionStateBefore",
        "ActionStateAfter",
    ]


async def test_a_host_that_dies_on_the_node_is_reported(node: Node, start_host: Callable[..., Any]) -> None:
    host, listener = await start_host()
    await online(host)
    pid = int(await host.call("obj_arm", "pid"))
    os.kill(pid, signal.SIGKILL)
    async with asyncio.timeout(PATIENCE):
        await asyncio.shield(host.ended)
    assert listener.reasons == ["the cell host was killed by SIGKILL"]


async def test_a_restarted_node_deletes_the_files_of_killed_sessions(
    broker: Broker, start_host: Callable[..., Any], tmp_path: Path
) -> None:
    sessions = tmp_path / "arcor2-hw" / "node" / "sessions"
    package = Package(tmp_path / "package").write({}, [], Project("p", "scn_1", id="pro_1"), "time.sleep(60)")
    node = Node(broker.url, tmp_path, name="lathe")
    try:
        host, _ = await start_host(broker.url, "lathe")
        host.send(m.RunPackage("pkg_1", str(package)))
        await asyncio.to_thread(wait_for, lambda: list(sessions.rglob("script.py")))
        node.end()
        assert list(sessions.rglob("script.py"))
        async with asyncio.timeout(PATIENCE):
            await asyncio.shield(host.ended)

        node = Node(broker.url, tmp_path, name="lathe")
        host, _ = await start_host(broker.url, "lathe")  # also removes files that a host was using
        await asyncio.to_thread(wait_for, lambda: len(list(sessions.iterdir())) <= 1)
        await host.close()
        await asyncio.to_thread(wait_for, lambda: not list(sessions.iterdir()))
    finally:
        node.end()


async def test_a_closed_scene_ends_the_host(node: Node, start_host: Callable[..., Any], tmp_path: Path) -> None:
    host, listener = await start_host()
    await online(host)
    await host.call("obj_arm", "say", {"text": b'"a line"'})
    host.send(m.CloseScene())
    assert (await host.expect(m.SceneClosed, PATIENCE)).error is None
    async with asyncio.timeout(PATIENCE):
        await asyncio.shield(host.ended)
    assert listener.reasons == ["the cell host ended"]
    assert "a line" in [each.text for each in listener.messages if isinstance(each, m.LogLine)]


async def test_the_error_names_a_node_that_is_not_connected(start_host: Callable[..., Any]) -> None:
    with pytest.raises(Arcor2Error, match="The node oven is not connected"):
        await start_host(name="oven")


async def test_the_error_names_a_broker_that_does_not_run(start_host: Callable[..., Any]) -> None:
    with pytest.raises(Arcor2Error, match=r"The broker at 127\.0\.0\.1:1 cannot be reached"):
        await start_host(url="nats://secret:word@127.0.0.1:1")


async def test_hosts_connect_over_tls_with_a_password(
    start_host: Callable[..., Any], tmp_path: Path, monkeypatch: Any
) -> None:
    config, authority = tls_configuration(tmp_path, "localhost")
    with config.open("a") as file:
        file.write("authorization {user: cell, password: secret}\n")
    broker = Broker(tmp_path, options=("--config", str(config)))
    monkeypatch.setenv("ARCOR2_HW_NATS_CA", str(authority))
    url = f"tls://{{}}@localhost:{broker.url.rpartition(':')[2]}"
    try:
        node = Node(url.format("cell:secret"), tmp_path)
        try:
            host, _ = await start_host(url.format("cell:secret"))
            await online(host)
            with pytest.raises(Arcor2Error, match="refuses the credentials"):
                await start_host(url.format("cell:wrong"))
            monkeypatch.delenv("ARCOR2_HW_NATS_CA")
            with pytest.raises(Arcor2Error, match="cannot be reached"):
                await start_host(url.format("cell:secret"))
        finally:
            node.end()
    finally:
        broker.end()


async def test_leases_are_valid_although_the_clocks_differ_by_an_hour(
    broker: Broker, start_host: Callable[..., Any], tmp_path: Path
) -> None:
    """The expiry of a lease is a time of the server's monotonic clock."""
    if subprocess.run([*AN_HOUR_AHEAD, "true"], capture_output=True, check=False).returncode:
        pytest.skip("this user may not create a time namespace (needs root and Linux 5.6)")
    node = Node(broker.url, tmp_path, name="ahead", wrapper=AN_HOUR_AHEAD)
    try:
        host, listener = await start_host(name="ahead")
        await online(host, open_scene([type_code("Arm", ARM)], scene_object("arm", "Arm", pose=True)))
        for _ in range(5):
            until = time.monotonic() + LEASE
            scale = await host.lease("obj_arm", 1, HoldKind.JOG, until, twist=(0.1, 0.0, 0.0, 0.0, 0.0, 0.0))
            assert msgspec.json.decode(scale)["scale"] > 0.0
        notes = msgspec.json.decode(await host.call("obj_arm", "report"))
        left = [note[5] for note in notes if note[0] == "jog"]
        assert left
        assert all(0.0 < each <= LEASE for each in left), left
        assert notes[0][1] > time.monotonic() + 3000.0, "the clocks of this test are not apart"
        with pytest.raises(CellError, match="had expired"):
            await host.lease("obj_arm", 1, HoldKind.JOG, time.monotonic() - 0.5, twist=(0.1,) + 5 * (0.0,))
        changed = [each for each in listener.messages if isinstance(each, m.DeviceChanged)]
        assert changed
        assert all(abs(each.stamp - time.monotonic()) < PATIENCE for each in changed)
    finally:
        node.end()
