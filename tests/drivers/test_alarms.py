"""Every injected fault of a fake gives exactly one alarm, of the right device and with its declaration."""

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator, Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from arcor2_hw.data.alarms import AlarmFilter, AlarmRecord
from arcor2_hw.data.device import Health
from arcor2_hw.data.rpc import ListAlarmsArgs
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.exceptions import DeviceError, DeviceTimeout
from arcor2_hw.objects import Generic
from arcor2_hw.runtime import messages as m
from arcor2_hw.runtime.calls import error_data
from arcor2_hw.testing import declarations
from arcor2_hw.testing.bench import Bench
from arcor2_server.alarms.kinds import AlarmKinds
from arcor2_server.alarms.service import Alarms
from arcor2_server.cli.installed_fakes import InstalledFake
from arcor2_server.hosts.devices import DeviceBoard
from arcor2_server.websocket.hub import Hub
from tests import leaks
from tests.drivers.benches.label_printer_bench import ZplPrinterBench
from tests.drivers.benches.oak_d_bench import OakDBench
from tests.drivers.benches.opcua_plc_bench import OpcUaPlcBench
from tests.drivers.fault_table import CONNECTION, FAULTS, LOST, NO_ALARM, Fault, fake_of
from tests.fakes.conftest import FakeProcess
from tests.fakes.test_every_fake import ARGUMENTS, FOUND

PATIENCE = 15.0
"""Time until a fault is reported, s."""
EVERY = 0.02
"""Time between two reports of a device, s."""
FOLDERS = {each.name: Path(each.folder) for each in declarations.drivers()}


class NoStore:
    """A store that forgets."""

    async def all(self) -> list[AlarmRecord]:
        return []

    async def put(self, records: object, deleted: object) -> None:
        pass


def report(device: Generic) -> m.DeviceChanged:
    """Return the state of a device as reported by the host."""
    alarms = []
    with contextlib.suppress(DeviceError):
        alarms = device.alarms()
    health = Health.FAILURE
    with contextlib.suppress(DeviceError):
        health = device.health
    raised = {alarm.code: device.conditions.raised(alarm.code) or time.monotonic() for alarm in alarms}
    return m.DeviceChanged(device.id, device.connection, health, alarms, stamp=time.monotonic(), raised=raised)


@contextlib.asynccontextmanager
async def recording(device: Generic) -> AsyncIterator[tuple[Alarms, DeviceBoard]]:
    hub = Hub()
    store: Any = NoStore()
    alarms, board = Alarms(hub, store, AlarmKinds(FOLDERS.get), lambda: 1), DeviceBoard(hub)
    alarms.watch(board, "program")
    board.show([SceneObject(device.name, type(device).__name__, id=device.id)], {})
    yield alarms, board
    await alarms.close()


SHARED = (OakDBench, OpcUaPlcBench)
"""Benches whose fake needs a second of processor time to start, and whose reset ends all of its faults."""


class Running:
    """The bench of the last test. The next one has the same bench, if it is about the same driver and may share it."""

    def __init__(self) -> None:
        self._bench: Any = None

    def of(self, kind: type[Bench]) -> Any:
        """Return the bench of a driver; end the previous one if it is another."""
        if type(self._bench) is not kind or kind not in SHARED:
            self.end()
            with leaks.outliving_the_test():
                bench = kind()
                bench.start()
                self._bench = bench
        return self._bench

    def end(self) -> None:
        if self._bench is not None:
            self._bench.end()
        self._bench = None


@pytest.fixture(scope="module")
def running() -> Iterator[Running]:
    shared = Running()
    yield shared
    shared.end()


@pytest.fixture
def bench(running: Running, request: pytest.FixtureRequest) -> Iterator[Any]:
    bench = running.of(request.param)
    bench.reset()
    yield bench
    bench.release()
    bench.reset()


def failing(action: Callable[[Any], object], device: Generic) -> DeviceError:
    """Return the error of an action that meets a fault."""
    with pytest.raises(DeviceError) as error:
        action(device)
    return error.value


async def found_after(fault: Fault, bench: Any, device: Generic) -> list[AlarmRecord]:
    """Return all records after a fault was injected and the action that met it has failed."""
    async with recording(device) as (alarms, board):

        async def report_once() -> list[AlarmRecord]:
            board.changed(await asyncio.to_thread(report, device))
            return await alarms.find(ListAlarmsArgs(AlarmFilter.ALL))

        if fault.before is not None:
            await asyncio.to_thread(fault.before, device)
        assert await report_once() == [], "an alarm before the fault"
        if fault.command:
            await asyncio.to_thread(bench.fake.control.do, fault.command, **fault.arguments)
        if fault.trigger is not None:
            await asyncio.to_thread(fault.trigger, device)
        error: DeviceError
        if fault.action is not None:
            error = await asyncio.to_thread(failing, fault.action, device)
        else:
            async with asyncio.timeout(PATIENCE):
                while not await report_once():
                    await asyncio.sleep(EVERY)
            error = DeviceTimeout("{device} did not answer", device=device.name)
        failed = replace(error_data(error, device.id), object_name=device.name, object_type=type(device).__name__)
        alarms.failed(failed, 1, "step")
        for _ in range(2):
            await report_once()
        return await report_once()


@pytest.mark.parametrize(
    ("bench", "fault"),
    [(bench, fault) for bench, faults in FAULTS.items() for fault in faults],
    indirect=["bench"],
    ids=lambda each: each.__name__ if isinstance(each, type) else str(each),
)
async def test_fault_is_exactly_one_alarm(bench: Any, fault: Fault) -> None:
    acts = fault.action or fault.before or fault.trigger
    device = await asyncio.to_thread(bench.controlled if acts else bench.connected)
    records = await found_after(fault, bench, device)
    kinds = [record.kind for record in records]
    assert kinds in [[kind] for kind in fault.kind.split()], [record.text for record in records]
    [record] = records
    assert (record.object_name, record.action) == (device.name, "step")
    assert record.text
    assert record.cause
    assert record.remedy


@pytest.mark.parametrize("bench", [bench for bench in FAULTS if fake_of(bench)], indirect=True)
async def test_lost_connection_is_exactly_one_alarm(bench: Any) -> None:
    device = await asyncio.to_thread(bench.connected)
    async with recording(device) as (alarms, board):
        bench.cut()
        async with asyncio.timeout(PATIENCE):
            while not await alarms.find(ListAlarmsArgs(AlarmFilter.ALL)):
                board.changed(await asyncio.to_thread(report, device))
                await asyncio.sleep(EVERY)
        board.changed(await asyncio.to_thread(report, device))
        [record] = await alarms.find(ListAlarmsArgs(AlarmFilter.ALL))
    kind = "label_printer-8" if isinstance(bench, ZplPrinterBench) else LOST  # its alarm also names missing labels
    assert (record.kind, record.object_name) == (kind, device.name)


@pytest.mark.parametrize("fake", FOUND, ids=lambda fake: fake.name)
def test_every_command_of_a_fake_has_an_alarm_or_needs_none(fake: InstalledFake) -> None:
    process = FakeProcess(fake.name, *ARGUMENTS.get(fake.name, ()))
    try:
        commands = {each["name"] for each in process.control.do("describe")} - {"truth"}
    finally:
        process.end()
    name = fake.name
    with_alarm = {fault.command for bench, faults in FAULTS.items() if fake_of(bench) == name for fault in faults}
    assert commands - CONNECTION == with_alarm - CONNECTION - {""} | NO_ALARM[name].keys()
    assert not with_alarm & NO_ALARM[name].keys()
