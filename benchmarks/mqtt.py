"""MQTT: processor time of the server and of the MQTT process with 100 changing points at 10 Hz."""

import asyncio
import contextlib
import shutil
import socket
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import aiomqtt
import psutil

from arcor2_hw.runtime.messages import StreamEvent
from arcor2_server.mqtt.service import Mqtt
from arcor2_server.settings import MqttSettings, ServerSettings
from benchmarks.metrics import Metric, Report
from benchmarks.opcua import COUNT, DEVICE, RATE, SECONDS, Feed, events

PREFIX: Final = "acme/brno/line-1/cell-7"


@contextlib.contextmanager
def mosquitto(directory: Path) -> Iterator[int]:
    """Run a broker and yield its port."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    file = directory / "mosquitto.conf"
    file.write_text(f"listener {port} 127.0.0.1\nallow_anonymous true\n")
    command = shutil.which("mosquitto") or "/usr/sbin/mosquitto"  # not on the PATH of users other than root
    broker = subprocess.Popen([command, "-c", str(file)], stderr=subprocess.DEVNULL)
    try:
        while not _accepts(port):
            time.sleep(0.01)
        yield port
    finally:
        broker.kill()
        broker.wait()


def _accepts(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


class Counter:
    """Counts the data messages of a device, and their values by their size."""

    def __init__(self) -> None:
        self.messages = self.size = 0
        self.connected = asyncio.Event()

    async def count(self, port: int) -> None:
        async with aiomqtt.Client("127.0.0.1", port) as client:
            await client.subscribe("#", qos=0)
            self.connected.set()
            async for message in client.messages:
                if "/DDATA/" in message.topic.value and isinstance(message.payload, bytes):
                    self.messages += 1
                    self.size += len(message.payload)


async def measure(directory: Path) -> list[Metric]:
    feed: Any = Feed()
    alarms: Any = type("Alarms", (), {"system": lambda *_: None})()
    with mosquitto(directory) as port:
        broker = MqttSettings(host="127.0.0.1", port=port, group="brno", node="cell-7", prefix=PREFIX)
        mqtt = Mqtt(ServerSettings(data_dir=directory, mqtt=broker), feed, alarms)
        mqtt.start()
        counter = Counter()
        counting = asyncio.create_task(counter.count(port))
        try:
            async with asyncio.timeout(30.0):
                await counter.connected.wait()
            encoded, index = events(), 0

            async def stream() -> None:
                nonlocal index
                index += 1
                feed.streams.publish(StreamEvent("ObjectPoints", DEVICE, encoded[index % 50], RATE))
                await asyncio.sleep(1.0 / RATE)

            while not counter.messages:
                await stream()
            (process,) = [each for each in psutil.Process().children() if "arcor2_hw.mqtt" in each.cmdline()]
            child_before, before, began = sum(process.cpu_times()[:2]), time.process_time(), time.monotonic()
            counter.messages = counter.size = 0
            while time.monotonic() - began < SECONDS:
                await stream()
            elapsed = time.monotonic() - began
            own, child = time.process_time() - before, sum(process.cpu_times()[:2]) - child_before
        finally:
            counting.cancel()
            await asyncio.gather(counting, return_exceptions=True)
            await mqtt.close()
    values = round(RATE * elapsed * COUNT)
    note = f"{counter.messages} messages with {counter.size / max(1, counter.messages) / COUNT:.0f} bytes per value"
    return [
        Metric("mqtt_server_core_percent", 100.0 * own / elapsed, values),
        Metric("mqtt_process_core_percent", 100.0 * child / elapsed, values, note),
    ]


async def run(report: Report, directory: Path) -> None:
    """Measure everything in this group."""
    for metric in await measure(directory):
        report.add(metric)
