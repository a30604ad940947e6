"""The pool of cell hosts: a spare host that failed does not make the next run fail."""

import asyncio
import os
import signal
from collections.abc import Mapping
from pathlib import Path
from typing import cast

import pytest
from msgspec import UNSET, UnsetType

from arcor2_hw.data.cell import BROKER_URL, Cell, CellDevice
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.exceptions import Arcor2Error
from arcor2_server import child_process
from arcor2_server.hosts import pool
from arcor2_server.hosts.process import CellHost, HostUser
from arcor2_server.nodes.credentials import Credentials
from tests import forked_children

USER = cast("HostUser", None)
"""The hosts of these tests load no object types, so they send no notifications."""


@pytest.fixture
def killed(monkeypatch: pytest.MonkeyPatch) -> list[bool]:
    """Return a list of flags for the next hosts. A host whose flag is true is killed before it is ready."""
    kills: list[bool] = []
    monkeypatch.setattr(child_process, "_start_python", forked_children.start_python)  # a forked host is ready at once

    class Host(CellHost):
        @classmethod
        async def start(cls, environment: Mapping[str, str] = os.environ, node: str = "") -> CellHost:
            host = await CellHost.start(environment, node)
            if kills and kills.pop(0):
                os.kill(host.pid, signal.SIGKILL)
            return host

    monkeypatch.setattr(pool, "CellHost", Host)
    return kills


@pytest.mark.parametrize("ended", [True, False], ids=["before", "meanwhile"])
async def test_spare_host_killed_while_starting_is_replaced(killed: list[bool], ended: bool) -> None:
    hosts = pool.CellHosts([])
    killed += [True]
    hosts.prepare()
    assert hosts._spare is not None
    if ended:
        await asyncio.wait({hosts._spare})
    try:
        assert (await hosts.take(USER)).alive
    finally:
        await hosts.close()


async def test_host_that_cannot_be_started_is_an_error(killed: list[bool]) -> None:
    hosts = pool.CellHosts([])
    killed += [True, True]
    hosts.prepare()
    try:
        with pytest.raises(Arcor2Error, match="No cell host can be started"):
            await hosts.take(USER)
    finally:
        await hosts.close()


def on_node(name: str, node: str | UnsetType = UNSET) -> CellDevice:
    return CellDevice(name, "Arm", node=node)


async def test_a_scene_with_a_device_on_a_node_needs_the_node(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ARCOR2_HW_NATS_URL", "nats://127.0.0.1:1")
    hosts = pool.CellHosts([], Cell([on_node("arm", "press"), on_node("belt"), on_node("lamp", "oven")]))
    arm, belt, lamp = (SceneObject(name, "Arm", id=f"obj_{name}") for name in ("arm", "belt", "lamp"))
    try:
        with pytest.raises(Arcor2Error, match=r"The broker at 127\.0\.0\.1:1 cannot be reached"):
            await hosts.take_all(USER, hosts.place([arm, belt, lamp]))
        assert (await hosts.take_all(USER, hosts.place([belt]))).placement.all == [""]
    finally:
        await hosts.close()


async def test_devices_do_not_see_the_password_of_the_broker(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(BROKER_URL, "nats://cell:secret@127.0.0.1:4222")
    hosts = pool.CellHosts([], broker=Path("/secret/server.json"))
    try:
        host = await hosts.take(USER)
        assert b"secret" not in Path(f"/proc/{host.pid}/environ").read_bytes()
    finally:
        await hosts.close()


async def test_the_server_uses_its_credentials_for_the_broker(tmp_path: Path) -> None:
    file = tmp_path / "server.json"
    Credentials("nats://127.0.0.1:1").save(file)
    hosts = pool.CellHosts([], Cell([on_node("arm", "press")]), file)
    try:
        with pytest.raises(Arcor2Error, match=r"The broker at 127\.0\.0\.1:1 cannot be reached"):
            await hosts.take(USER, hosts.node_of(SceneObject("arm", "Arm", id="obj_arm")))
    finally:
        await hosts.close()
