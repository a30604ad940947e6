"""Every injected fault of a fake gives exactly one alarm, of the right device and with its declaration."""

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from arcor2_hw.data.alarms import AlarmFilter, AlarmRecord
from arcor2_hw.data.device import Health
from arcor2_hw.data.rpc import ListAlarmsArgs
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.exceptions import ConnectionLost, DeviceError, DeviceTimeout
from arcor2_hw.objects import Generic
from arcor2_hw.runtime import messages as m
from arcor2_hw.runtime.calls import error_data
from arcor2_hw.testing import declarations
from arcor2_hw.testing.bench import Bench
from arcor2_server.alarms.kinds import AlarmKinds
from arcor2_server.alarms.service import Alarms
from arcor2_server.hosts.devices import DeviceBoard
from arcor2_server.websocket.hub import Hub
from tests.drivers.benches.barcode_reader_bench import BarcodeReaderBench
from tests.drivers.benches.conveyor_bench import ConveyorBench
from tests.drivers.benches.dobot_magician_bench import DobotMagicianBench
from tests.drivers.benches.functional_tester_bench import FunctionalTesterBench
from tests.drivers.benches.label_printer_bench import ZplPrinterBench
from tests.drivers.benches.remote_io_bench import RemoteIOBench
from tests.drivers.benches.robotiq_2f_bench import Robotiq2FBench
from tests.drivers.benches.scale_bench import MtSicsScaleBench
from tests.drivers.benches.screwdriver_bench import OpenProtocolScrewdriverBench
from tests.drivers.benches.two_axis_robot_bench import TwoAxisRobotBench

PATIENCE = 15.0
"""Time until a fault is reported, s."""
FOLDERS = {each.name: Path(each.folder) for each in declarations.drivers()}
FAULTS: dict[type[Bench], list[tuple[str, dict[str, Any], str]]] = {
    BarcodeReaderBench: [
        ("health", {"value": "DIRTY"}, "barcode_reader-1"),
        ("health", {"value": "HOT"}, "barcode_reader-2"),
    ],
    ConveyorBench: [("emergency", {"code": 0x8130}, "conveyor-1"), ("emergency", {"code": 0x2310}, "conveyor-2")],
    DobotMagicianBench: [("alarm", {"code": 0x22}, "dobot_magician-1")],
    FunctionalTesterBench: [
        ("fault", {"code": 103}, "functional_tester-3"),
        ("emergency_stop", {"pressed": True}, "functional_tester-6"),
    ],
    ZplPrinterBench: [("pause", {"on": True}, "label_printer-4")],
    RemoteIOBench: [
        ("diagnosis", {"supply_missing": True}, "remote_io-1"),
        ("diagnosis", {"overload": True}, "remote_io-2"),
    ],
    Robotiq2FBench: [("fault", {"code": 14}, "robotiq_2f-1")],
    MtSicsScaleBench: [("put", {"kg": 9.0}, "scale-1")],
    OpenProtocolScrewdriverBench: [("alarm", {}, "screwdriver-1")],
    TwoAxisRobotBench: [("hardware_error", {"servo": 1}, "two_axis_robot-1")],
}
CASES = [(bench, fault) for bench, faults in FAULTS.items() for fault in faults] + [
    (MtSicsScaleBench, None),
    (FunctionalTesterBench, None),
]


class NoStore:
    """A store that forgets."""

    async def all(self) -> list[AlarmRecord]:
        return []

    async def put(self, records: object, deleted: object) -> None:
        pass


def report(device: Generic) -> m.DeviceChanged:
    """Return what the host reports of a device."""
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


@pytest.mark.parametrize(
    ("kind", "fault"), CASES, ids=lambda each: each.__name__ if isinstance(each, type) else each[2] if each else "cut"
)
async def test_fault_is_exactly_one_alarm(kind: type[Bench], fault: tuple[str, dict[str, Any], str] | None) -> None:
    bench: Any = kind()
    bench.start()
    device = bench.make()
    await asyncio.to_thread(device.connect)
    try:
        async with recording(device) as (alarms, board):
            board.changed(await asyncio.to_thread(report, device))
            assert await alarms.find(ListAlarmsArgs(AlarmFilter.ALL)) == [], "an alarm before the fault"
            if fault is None:
                bench.cut()
                wanted, error = "device-1", ConnectionLost("{device}: lost", device=device.name)
            else:
                command, arguments, wanted = fault
                bench.do(command, **arguments)
                error = DeviceTimeout("{device} did not answer", device=device.name)
            found: list[AlarmRecord] = []
            deadline = time.monotonic() + PATIENCE
            while not found and time.monotonic() < deadline:
                board.changed(await asyncio.to_thread(report, device))
                found = await alarms.find(ListAlarmsArgs(AlarmFilter.ALL))
            # The action that was running fails, too, and more reports follow.
            failed = error_data(error, device.id)
            alarms.failed(failed, 1, "step")
            for _ in range(2):
                board.changed(await asyncio.to_thread(report, device))
            [record] = await alarms.find(ListAlarmsArgs(AlarmFilter.ALL))
            assert (record.kind, record.object_name, record.action) == (wanted, device.name, "step")
            assert record.text
            assert record.cause
            assert record.remedy
    finally:
        await asyncio.to_thread(device.disconnect)
        bench.end()
