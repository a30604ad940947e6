"""The field buses on their fakes: what a driver costs beside the bare library, and what a bus loses."""

import asyncio
import random
import time
from collections.abc import Callable
from pathlib import Path

from pymodbus.client import ModbusTcpClient

from arcor2_drivers.conveyor.conveyor import Conveyor
from arcor2_drivers.conveyor.settings import ConveyorSettings
from arcor2_drivers.remote_io.registers import IMAGE_COUNT
from arcor2_drivers.remote_io.remote_io import RemoteIO
from arcor2_drivers.remote_io.settings import RemoteIOSettings
from arcor2_drivers.two_axis_robot.bus import Bus
from arcor2_drivers.two_axis_robot.registers import PRESENT_POSITION, STATE, Register
from arcor2_fakes.control import BlockingControlClient
from arcor2_hw.exceptions import DeviceTimeout
from arcor2_server.demo.processes import Child, python_module
from benchmarks.metrics import Metric, Report, median

SERVOS = (1, 2, 3, 4, 5, 6)
PDO_SECONDS = 20.0


def seconds_each(call: Callable[[], object], n: int) -> float:
    """Give the mean time of a call over `n` of them."""
    began = time.perf_counter()
    for _ in range(n):
        call()
    return (time.perf_counter() - began) / n


def modbus_reads(address: str, rounds: int = 150, n: int = 100) -> Metric:
    """Read one point by the driver, and what it reads for that by the bare library, in turns on one fake.

    Each has its own connection; the driver observes the block meanwhile, as it always does. What a round measures
    first is left to chance, so that a machine that is getting slower favours neither.
    """
    host, _, port = address.rpartition(":")
    bare = ModbusTcpClient(host, port=int(port))
    block = RemoteIO("block", "block", RemoteIOSettings(host, int(port), points="part=DI0"))
    calls: list[Callable[[], object]] = [
        lambda: bare.read_input_registers(0, count=IMAGE_COUNT, device_id=1),
        lambda: block.read("part"),
    ]
    bare.connect()
    block.connect()
    try:
        samples: tuple[list[float], list[float]] = ([], [])
        for _ in range(rounds):
            for each in random.sample((0, 1), 2):
                samples[each].append(seconds_each(calls[each], n))
    finally:
        block.disconnect()
        bare.close()
    library, driver = (1.0 / median(each) for each in samples)
    note = f"driver {driver:.0f}/s, library {library:.0f}/s"
    return Metric("modbus_read_ratio", driver / library, 2 * rounds * n, note)


def dynamixel_reads(port: str, n: int = 1000) -> Metric:
    """Read the positions of six servos at once, through the driver's bus; the pty has no bit rate."""
    bus = Bus("servos", port, 1_000_000)
    unanswered = 0

    def read(register: Register) -> None:
        """Ask as the driver does: once more when a servo does not answer within the library's few ms."""
        nonlocal unanswered
        try:
            bus.again(lambda: bus.sync_read(SERVOS, register))
        except DeviceTimeout:  # the fake did not get a core twice; that counts with the time it took
            unanswered += 1

    bus.open()
    try:
        samples = [seconds_each(lambda: read(PRESENT_POSITION), 1) for _ in range(n)]
        whole = [seconds_each(lambda: read(STATE), 1) for _ in range(n // 2)]
    finally:
        bus.close()
    note = (
        f"worst {max(samples) * 1e3:.2f} ms, {unanswered} unanswered; "
        f"all that changes ({STATE.size} bytes each) {median(whole) * 1e3:.2f} ms"
    )
    return Metric("dynamixel_sync_read_6_ms", median(samples) * 1e3, n, note)


def pdos(address: str, control: str) -> Metric:
    """Let the belt run and the drive tell its state by two PDOs each 10 ms; compare what it sent with what came.

    Both count from the first one on, which is sent only when control was taken.
    """
    belt = Conveyor("belt", "belt", ConveyorSettings(f"socket://{address}", pdo_period_ms=10))
    came = belt._observer.pdos
    with BlockingControlClient(control) as drive:
        belt.connect()
        try:
            belt.take_control()
            belt.run(0.1)
            began = came.received, time.monotonic()
            time.sleep(PDO_SECONDS)
            rate = (came.received - began[0]) / (time.monotonic() - began[1])
            sent = sum(drive.do("truth")["pdos_sent"])
            deadline = time.monotonic() + 2.0
            while came.received < sent and time.monotonic() < deadline:
                time.sleep(0.001)
            lost = max(0, sent - came.received)
            belt.halt()
        finally:
            belt.disconnect()
    return Metric("can_pdo_lost", lost, sent, f"two PDOs, {rate / 2.0:.1f} Hz each; slcan over TCP")


async def run(report: Report, directory: Path) -> None:
    """Measure everything in this group."""

    async def on_fake(name: str, keys: tuple[str, ...], measure: Callable[..., Metric], *arguments: str) -> None:
        fake = Child(name, python_module(f"arcor2_fakes.{name}", *arguments), directory / f"{name}.log")
        try:
            addresses = await fake.start_json()
            report.add(await asyncio.to_thread(measure, *(addresses[key] for key in keys)))
        finally:
            await fake.stop()

    await on_fake("remote_io", ("modbus",), modbus_reads)
    await on_fake("conveyor", ("can", "control"), pdos)
    ids = [argument for number in SERVOS for argument in ("--ids", str(number))]
    await on_fake("two_axis_robot", ("port",), dynamixel_reads, *ids)
