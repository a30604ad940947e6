"""Test cases of connecting: no side effects, nothing left behind, missing devices."""

from typing import Final

from arcor2_hw.data.device import Connection
from arcor2_hw.exceptions import DeviceTimeout, NotConnected
from arcor2_hw.testing.bench import Bench, knows_control, needs
from arcor2_hw.testing.life import leaked_resources, named, open_resources, require_error, require_in_time
from arcor2_hw.testing.steps import LOSS_ERRORS

DISCONNECT_TIMEOUT: Final = 1.0
"""Time limit of disconnect, s, in any state of the wire."""


class ConnectingCases:
    """Cases from the constructor to disconnect."""

    def test_constructor_opens_nothing(self, arcor2_bench: Bench) -> None:
        """The constructor only stores: it creates no thread, socket or connection."""
        before = open_resources()
        device = require_in_time(arcor2_bench.new, 0.5, "the constructor")
        assert not (new := open_resources() - before), f"the constructor opened {', '.join(sorted(new))}"
        assert device.connection is Connection.OFFLINE, f"it is {device.connection} before it was connected"

    def test_connect_is_idempotent(self, arcor2_bench: Bench) -> None:
        """Connecting twice is the same as once, within the time limit."""
        device = arcor2_bench.new()
        for what in ("connect", "a second connect"):
            require_in_time(lambda: device.connect(arcor2_bench.connect_timeout), arcor2_bench.connect_timeout, what)
            assert device.connection is Connection.ONLINE, f"after {what} it is {device.connection}"
            now = open_resources()
            if what == "connect":
                before = now
        assert not (new := now - before), f"a second connect opened {', '.join(sorted(new))}"

    def test_disconnect_is_idempotent(self, arcor2_bench: Bench) -> None:
        """Disconnecting is possible at any time, takes at most 1 s, and the object can be connected again."""
        device = arcor2_bench.new()
        device.disconnect()
        for _ in range(2):
            device.connect(arcor2_bench.connect_timeout)
            for what in ("disconnect", "a second disconnect"):
                require_in_time(device.disconnect, DISCONNECT_TIMEOUT, what)
                assert device.connection is Connection.OFFLINE, f"after {what} it is {device.connection}"

    def test_nothing_is_left_behind(self, arcor2_bench: Bench) -> None:
        """After three connections no thread, socket or port is left."""
        before = open_resources()
        for _ in range(3):
            device = arcor2_bench.controlled()
            device.disconnect()
        left = leaked_resources(before)
        assert not left, f"after disconnect there is still {', '.join(sorted(left))}"

    @needs("writes")
    def test_connecting_observes(self, arcor2_bench: Bench) -> None:
        """Connecting, reading and disconnecting write, switch and move nothing (rule 1)."""
        before = arcor2_bench.writes()
        device = arcor2_bench.connected()
        if arcor2_bench.has("observe"):
            arcor2_bench.observe(device)
        assert arcor2_bench.writes() == before, "connecting acted on the device"
        if knows_control(type(device)):
            assert device.control_owner() != "us", "connecting took control"
        device.disconnect()
        assert arcor2_bench.writes() == before, "disconnecting acted on a device that was only observed"
        if arcor2_bench.has("actuating"):
            acted = list(arcor2_bench.actuating())
            assert not acted, f"only to observe, the driver sent {'; '.join(acted[:5])}"

    @needs("absent")
    def test_absent_device(self, arcor2_bench: Bench) -> None:
        """For a missing device, connect fails within the time limit with an error that names object and address."""
        device, address = arcor2_bench.absent()
        arcor2_bench.keep(device)
        before = open_resources()
        error = require_error(
            lambda: device.connect(1.0), NotConnected, DeviceTimeout, within=1.0, what="connecting to nothing"
        )
        named(error, device.name, address, "connecting to nothing")
        assert device.connection is Connection.FAILED, f"it is {device.connection} after that"
        device.disconnect()
        left = leaked_resources(before)
        assert not left, f"an attempt that failed left {', '.join(sorted(left))}"

    @needs("cut", "heal")
    def test_connecting_to_a_silent_device(self, arcor2_bench: Bench) -> None:
        """For a silent device, connect fails with a typed error in time; when it answers again, connect works."""
        device = arcor2_bench.new()
        arcor2_bench.cut()
        error = require_error(
            lambda: device.connect(1.0), *LOSS_ERRORS, within=1.0, what="connecting to a silent device"
        )
        named(error, device.name, arcor2_bench.address, "connecting to a silent device")
        arcor2_bench.heal()
        device.connect(arcor2_bench.connect_timeout)
        assert device.connection is Connection.ONLINE
