"""Common steps of the cases: start an action, lose the device, wait until it is back, observe it."""

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
from arcor2_hw.testing.life import POLL, TIME_TOLERANCE, BackgroundCall, wait_until
from arcor2_hw.testing.own_time import own_time

WATCH_TIME: Final = 0.5
"""Time in which nothing may start to move again, s."""
START_TIMEOUT: Final = 40.0
"""Time limit until a long action runs at the device, s. A process that imports a vendor library needs some time."""
LOSS_ERRORS: Final = (NotConnected, ConnectionLost, DeviceTimeout, Stale)
"""Errors that a call of a silent device may raise."""
CONNECTED_STATES: Final = (Connection.ONLINE, Connection.BACK)


def start_action(bench: Bench, device: Generic) -> BackgroundCall:
    """Start `run_long` and wait until the action runs at the device."""
    act = BackgroundCall(lambda: bench.run_long(device))
    wait_until(lambda: bench.running() or act.over, START_TIMEOUT, "run_long")
    assert not act.over, f"run_long ended at once: {act.error!r}"
    return act


def cut_and_await_loss(bench: Bench, device: Generic) -> None:
    """Cut the cable and wait until the driver reports it."""
    bench.cut()
    wait_until(lambda: device.connection is Connection.LOST, bench.lost_within, "reporting the connection as lost")


def await_connection(bench: Bench, device: Generic) -> None:
    """Wait until the device is observed again."""
    wait_until(
        lambda: device.connection in CONNECTED_STATES, bench.back_within, "reporting the connection as online again"
    )


def observed(bench: Bench, device: Generic) -> bool:
    """Return whether a reading is available."""
    try:
        bench.observe(device)
    except (Stale, ConnectionLost):  # the first reading has not arrived yet
        time.sleep(POLL)
        return False
    return True


def await_reading(bench: Bench, device: Generic) -> None:
    """Wait until a reading is available after a connection loss, even if the loss was too short to be reported."""

    def is_observed() -> bool:
        try:
            return device.connection in CONNECTED_STATES and observed(bench, device)
        except LOSS_ERRORS:
            time.sleep(POLL)
            return False

    wait_until(is_observed, bench.back_within, "a reading after the loss")


def require_continuation(bench: Bench) -> None:
    """Fail unless the action continues after its process was killed, until it is done or was watched long enough."""
    killed = changed = own_time()
    done = bench.progress()
    while (now := own_time()) - killed < max(bench.loss_watched, bench.progress_within + TIME_TOLERANCE) and done < 1.0:
        if (present := bench.progress()) != done:
            done, changed = present, now
        assert now - changed <= bench.progress_within, (
            f"the device is declared to continue, but its action stopped at {done:.0%}, {changed - killed:.1f} s after "
            "the process was killed"
        )
        time.sleep(POLL)


def on_lanes(device: Generic) -> Device:
    """Run an object on lanes like those of the cell host; `release_lanes` ends them."""
    held = Device(Recipe(SceneObject(device.name, type(device).__name__, id=device.id), type(device), (), {}, ""))
    held.instance = device
    return held


def stop_of(device: Generic) -> Callable[[], object]:
    """Return the method that stops a device."""
    stop = device.halt if isinstance(device, Axis) else getattr(device, "stop", None)
    assert callable(stop), "a device with run_long must have a stop()"
    return stop


# Names before version 0.2.
GONE, UP, WATCHED, back, goes_on, lose, seen_again = (
    LOSS_ERRORS,
    CONNECTED_STATES,
    WATCH_TIME,
    await_connection,
    require_continuation,
    cut_and_await_loss,
    await_reading,
)
