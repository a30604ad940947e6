"""Backups of the settings of the printer by SGD."""

from collections.abc import Callable

from arcor2_drivers.label_printer.zpl_printer import ZplPrinter
from arcor2_hw.data.maintenance import DeviceParameter
from tests.fakes.conftest import FakeProcess


def test_settings_are_written_and_failures_are_named(fake: FakeProcess, make: Callable[..., ZplPrinter]) -> None:
    printer = make(fake.ready["port"])
    printer.connect()
    assert DeviceParameter("print.tone", "10.0") in printer.parameters_dump()
    wanted = [
        DeviceParameter("print.tone", "12.5"),
        DeviceParameter("media.speed", "99"),
        DeviceParameter("ezpl.tear_off", '"; do'),
    ]
    failures = {each.name: each.reason for each in printer.parameters_restore(wanted)}
    assert failures == {
        "media.speed": "The printer did not accept 99 and keeps 4.0.",
        "ezpl.tear_off": '"; do cannot be sent to the printer.',
    }
    assert DeviceParameter("print.tone", "12.5") in printer.parameters_dump()
    printer.parameters_restore([DeviceParameter("print.tone", "10.0")])
