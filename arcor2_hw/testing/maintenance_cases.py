"""Test cases of maintenance: the identity of a device, and backups of its parameters."""

import msgspec

from arcor2_hw.actions.json_values import encode
from arcor2_hw.data.device import Identity
from arcor2_hw.data.maintenance import DeviceParameter, ParameterFailure
from arcor2_hw.testing import capabilities
from arcor2_hw.testing.bench import Bench
from arcor2_hw.testing.life import require_in_time

DUMP_TIMEOUT = 60.0
"""Time limit for reading or writing all parameters, s."""
_UNKNOWN = DeviceParameter("a parameter that no device has", 1)


class MaintenanceCases:
    """Cases of `identify`, `parameters_dump` and `parameters_restore`, for the types that declare them."""

    def test_identity(self, arcor2_bench: Bench) -> None:
        """A type with `identify` recognises its device: the same identity after each connection, without acting."""
        if "identify" not in capabilities.declared(arcor2_bench.object_type):
            return
        found = []
        for _ in range(2):
            device = arcor2_bench.connected()
            before = _writes(arcor2_bench)
            identity = require_in_time(device.identify, arcor2_bench.call_within, "identify")
            assert isinstance(identity, Identity), f"identify() returned {identity!r}"
            assert identity.vendor or identity.model, "identify() returned neither vendor nor model"
            assert _writes(arcor2_bench) == before, "identify() acted on the device"
            found.append(identity)
            device.disconnect()
        assert found[0] == found[1], f"the identity changes between connections: {found[0]}, then {found[1]}"
        assert msgspec.json.decode(encode(found[0]), type=Identity) == found[0]

    def test_parameters(self, arcor2_bench: Bench) -> None:
        """Parameters are read without acting. Restoring them changes nothing, and reports an unknown one.

        Nothing is written to a real device.
        """
        said = capabilities.declared(arcor2_bench.object_type)
        assert "parameters_restore" not in said or "parameters_dump" in said, (
            "parameters_restore is declared without parameters_dump"
        )
        if "parameters_dump" not in said:
            return
        device = arcor2_bench.connected()
        before = _writes(arcor2_bench)
        dumped = require_in_time(device.parameters_dump, DUMP_TIMEOUT, "parameters_dump")
        assert _writes(arcor2_bench) == before, "parameters_dump() acted on the device"
        names = [each.name for each in dumped]
        assert dumped, "parameters_dump() returned nothing"
        assert len(set(names)) == len(names), "parameters_dump() returned a name twice"
        assert msgspec.json.decode(encode(dumped), type=list[DeviceParameter]) == dumped
        assert device.parameters_dump() == dumped, "parameters change without being written"
        if "parameters_restore" not in said or arcor2_bench.real:
            return
        failures = require_in_time(
            lambda: device.parameters_restore([_UNKNOWN, *dumped]), DUMP_TIMEOUT, "parameters_restore"
        )
        assert all(isinstance(each, ParameterFailure) and each.reason for each in failures), "a failure has no reason"
        assert [each.name for each in failures] == [_UNKNOWN.name], (
            f"parameters_restore() reported {[each.name for each in failures]}, not only the unknown parameter"
        )
        assert device.parameters_dump() == dumped, "restoring the present parameters changed them"


def _writes(bench: Bench) -> object:
    return bench.writes() if bench.has("writes") else None
