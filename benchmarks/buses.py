"""Field buses with simulated devices: read rates of drivers compared with the bare library, and lost frames."""

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
    """Return the mean duration of `n` calls, s."""
    began = time.perf_counter()
    for _ in range(n):
        call()
    return (time.perf_counter() - began) / n


def modbus_reads(address: str, rounds: int = 150, n: int = 100) -> Metric:
    """Measure reads of one point through the driver, and of the same registers through the library alone.

    Both use one simulated block with separate connections, in alternation; the driver also observes the block, as it
    always does. The order within a round is random, so that a machine that is getting slower favours neither.
    """
    host, _, port = address.rpartition(":")
    bare = ModbusTcpClient(host, port=int(port))
    block = RemoteIO("block", "block", RemoteIOSettings(host, int(port), points="part=DI0"))
    calls: list[Callable[[], object]] = [
        lambda: bare.read_input_registers(0, count=IMAGE_COUNT, device_id=1),
        lambda: block.read("part"),
    ]
    bare.connect()  # type: ignore[no-untyped-call]
    block.connect()
    try:
        samples: tuple[list[float], list[float]] = ([], [])
        for _ in range(rounds):
            for each in random.sample((0, 1), 2):
                samples[each].append(seconds_each(calls[each], n))
    finally:
        block.disconnect()
        bare.close()  # type: ignore[no-untyped-call]
    library, driver = (1.0 / median(each) for each in samples)
    note = f"driver {driver:.0f}/s, library {library:.0f}/s"
    return Metric("modbus_read_ratio", driver / library, 2 * rounds * n, note)


def dynamixel_reads(port: str, n: int = 1000) -> Metric:
    """Measure reads of the positions of six servos at once through the driver's bus; a pty has no bit rate."""
    bus = Bus("servos", port, 1_000_000)
    unanswered = 0

    def read(register: Register) -> None:
        """Read like the driver: retry once if a servo does not answer within the library's time limit."""
        nonlocal unanswered
        try:
            bus.again(lambda: bus.sync_read(SERVOS, register))
        except DeviceTimeout:  # the fake was delayed twice; counted with its duration
            unanswered += 1

    bus.open()
    try:
        samples = [seconds_each(lambda: read(PRESENT_POSITION), 1) for _ in range(n)]
        whole = [seconds_each(lambda: read(STATE), 1) for _ in range(n // 2)]
    finally:
        bus.close()
    note = (
        f"worst {max(samples) * 1e3:.2f} ms, {unanswered} unanswered; "
        f"the whole state ({STATE.size} bytes each) {median(whole) * 1e3:.2f} ms"
    )
    return Metric("dynamixel_sync_read_6_ms", median(samples) * 1e3, n, note)


def pdos(address: str, control: str) -> Metric:
    """Run the belt with two PDOs every 10 ms; compare the number of sent and received frames.

    Both counts start with the first PDO, which the drive sends only after control was taken.
    """
    belt = Conveyor("belt", "belt", ConveyorSettings(f"socket://{address}", pdo_period_ms=10))
    pdos = belt._observer.pdos
    with BlockingControlClient(control) as drive:
        belt.connect()
        try:
            belt.take_control()
            belt.run(0.1)
            began = pdos.received, time.monotonic()
            time.sleep(PDO_SECONDS)
            rate = (pdos.received - began[0]) / (time.monotonic() - began[1])
            sent = sum(drive.do("truth")["pdos_sent"])
            deadline = time.monotonic() + 2.0
            while pdos.received < sent and time.monotonic() < deadline:
                time.sleep(0.001)
            lost = max(0, sent - pdos.received)
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
