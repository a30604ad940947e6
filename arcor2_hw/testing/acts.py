"""Steps that several cases take: an act under way, a device lost, back, observed and asked again."""

import time
from collections.abc import Callable
from typing import Final

from arcor2_hw.data.device import Connection
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.exceptions import ConnectionLost, DeviceTimeout, NotConnected, Stale
from arcor2_hw.objects import Axis, Generic
from arcor2_hw.runtime.creation import Recipe
from arcor2_hw.runtime.device import Device
from arcor2_hw.testing.bench import Bench
from arcor2_hw.testing.life import POLL, Beside, wait_until

WATCHED: Final = 0.5
"""s for which nothing may begin to move again."""
STARTS_WITHIN: Final = 15.0
"""s until a long act is seen to be under way; a process that imports a vendor's library needs some."""
GONE: Final = (NotConnected, ConnectionLost, DeviceTimeout, Stale)
"""What a call on a device that does not answer may raise."""
UP: Final = (Connection.ONLINE, Connection.BACK)


def under_way(bench: Bench, device: Generic) -> Beside:
    """Begin the long act and wait until it is seen at the device."""
    act = Beside(lambda: bench.run_long(device))
    wait_until(lambda: bench.running() or act.over, STARTS_WITHIN, "the act of run_long")
    assert not act.over, f"the act of run_long ended at once: {act.error!r}"
    return act


def lose(bench: Bench, device: Generic) -> None:
    """Cut the cable and wait until the driver says so."""
    bench.cut()
    wait_until(lambda: device.connection is Connection.LOST, bench.lost_within, "telling that the connection is lost")


def back(bench: Bench, device: Generic) -> None:
    """Wait until the device is observed again."""
    wait_until(lambda: device.connection in UP, bench.back_within, "being connected again")


def observed(bench: Bench, device: Generic) -> bool:
    """Tell whether a reading can be had."""
    try:
        bench.observe(device)
    except (Stale, ConnectionLost):  # the first reading is still to come
        time.sleep(POLL)
        return False
    return True


def seen_again(bench: Bench, device: Generic) -> None:
    """Wait until a reading can be had after a loss, whether or not the loss was long enough to be told."""

    def holds() -> bool:
        try:
            return device.connection in UP and observed(bench, device)
        except GONE:
            time.sleep(POLL)
            return False

    wait_until(holds, bench.back_within, "reading again after the loss")


def on_lanes(device: Generic) -> Device:
    """Put an object on the lanes that the cell host would give it; `release_lanes` ends them."""
    held = Device(Recipe(SceneObject(device.name, type(device).__name__, id=device.id), type(device), (), {}, ""))
    held.instance = device
    return held


def stop_of(device: Generic) -> Callable[[], object]:
    """Give what stops a device."""
    stop = device.halt if isinstance(device, Axis) else getattr(device, "stop", None)
    assert callable(stop), "what runs for long needs a stop()"
    return stop
