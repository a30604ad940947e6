"""The OPC UA server: processor time of the server and of its process with 100 changing points at 10 Hz."""

import asyncio
import random
import socket
import sys
import time
from pathlib import Path
from typing import Any, Final, Self

import msgspec
import psutil

from arcor2_hw.data.device import Connection
from arcor2_hw.data.events import Event
from arcor2_hw.data.points import LivePoint, ObjectPointsData, PointUse
from arcor2_hw.plant import messages as m
from arcor2_hw.runtime.messages import StreamEvent
from arcor2_server.hosts.streams import POINTS, RobotStreams
from arcor2_server.opcua.service import OpcUa
from arcor2_server.settings import OpcUaListener, ServerSettings
from arcor2_server.websocket.hub import Hub
from benchmarks.metrics import Metric, Report

SECONDS: Final = 10.0
RATE: Final = 10.0
COUNT: Final = 100
DEVICE: Final = "obj_1"


class Feed:
    """Passes the newest event of one device, as the feed of the server does."""

    def __init__(self) -> None:
        self.streams = RobotStreams(Hub(), lambda _: None)
        self.streams.observe(DEVICE, POINTS, RATE, self._put, owner="feed")
        self._newest: list[bytes] = []

    def reader(self) -> Self:
        return self

    def _put(self, encoded: bytes) -> None:
        self._newest = [encoded]

    async def everything(self) -> m.Update:
        states = {DEVICE: m.DeviceState(Connection.ONLINE)}
        return m.Update([m.DeviceInfo(DEVICE, "block", "RemoteIO")], states)

    async def changes(self) -> m.Update:
        newest, self._newest = self._newest, []
        return m.Update(streams=newest)


def events() -> list[bytes]:
    """Return encoded events with other values each, as a cell host sends them."""
    return [
        msgspec.json.encode(
            Event(
                "ObjectPoints",
                data=ObjectPointsData(
                    DEVICE,
                    time.monotonic() * 1e3,
                    [LivePoint(f"AI{number}", PointUse.INPUT, random.random(), "V") for number in range(COUNT)],
                ),
            )
        )
        for _ in range(50)
    ]


async def measure(directory: Path) -> list[Metric]:
    listener = socket.socket()
    listener.bind(("127.0.0.1", 0))
    port = listener.getsockname()[1]
    settings = ServerSettings(data_dir=directory, opcua=OpcUaListener("127.0.0.1", port, anonymous=True))
    feed: Any = Feed()
    others: Any = type("Others", (), {"has_opcua": False, "open_to_all": True, "system": lambda *_: None})()
    opcua = OpcUa(settings, feed, others, others, others)
    opcua.serve(listener)
    client = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "benchmarks.opcua_client", f"opc.tcp://127.0.0.1:{port}/arcor2hw/", str(COUNT),
        stdout=asyncio.subprocess.PIPE,
    )  # fmt: skip
    assert client.stdout is not None
    try:
        encoded, index, subscribed = events(), 0, asyncio.create_task(client.stdout.readline())
        while not subscribed.done():
            index += 1
            feed.streams.publish(StreamEvent("ObjectPoints", DEVICE, encoded[index % 50], RATE))
            await asyncio.sleep(1.0 / RATE)
        assert subscribed.result() == b"subscribed\n"
        (process,) = [each for each in psutil.Process().children() if "arcor2_hw.opcua" in each.cmdline()]
        child_before, before, began = sum(process.cpu_times()[:2]), time.process_time(), time.monotonic()
        while time.monotonic() - began < SECONDS:
            index += 1
            feed.streams.publish(StreamEvent("ObjectPoints", DEVICE, encoded[index % 50], RATE))
            await asyncio.sleep(1.0 / RATE)
        elapsed = time.monotonic() - began
        own, child = time.process_time() - before, sum(process.cpu_times()[:2]) - child_before
        client.terminate()
        received = int((await client.stdout.read()).decode() or 0)
    finally:
        if client.returncode is None:
            client.kill()
        await client.wait()
        await opcua.close()
        listener.close()
    values = round(RATE * elapsed * COUNT)
    note = f"{received} of about {values} changed values reached a subscribed client"
    return [
        Metric("opcua_server_core_percent", 100.0 * own / elapsed, values),
        Metric("opcua_process_core_percent", 100.0 * child / elapsed, values, note),
    ]


async def run(report: Report, directory: Path) -> None:
    """Measure everything in this group."""
    for metric in await measure(directory):
        report.add(metric)
