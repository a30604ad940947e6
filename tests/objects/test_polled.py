"""Polled: current states, and all reasons that end waiting."""

import threading
import time
from collections.abc import Callable, Iterator

import pytest

from arcor2_hw.data.device import Connection
from arcor2_hw.exceptions import Cancelled, ConnectionLost, DeviceTimeout, NotConnected, Stale
from arcor2_hw.objects.polled import Polled, Snapshot
from tests.waiting import WITHIN, wait_for


class Device:
    """Count the readings. It can delay its answer and fail."""

    def __init__(self) -> None:
        self.count = 0
        self.broken = False
        self.reading = False
        self.answers = threading.Event()
        self.answers.set()
        self.losses: list[str] = []

    def open(self, timeout: float) -> Snapshot[int]:
        if self.broken:
            raise NotConnected("still broken")
        return Snapshot.by(self.read)

    def read(self) -> int:
        self.reading = True
        self.answers.wait(WITHIN)
        self.reading = False
        if self.broken:
            raise ConnectionLost("it broke")
        self.count += 1
        return self.count


@pytest.fixture
def device() -> Device:
    return Device()


@pytest.fixture
def polled(device: Device) -> Iterator[Polled[int]]:
    polled = Polled(
        "thing at home",
        device.open,
        device.read,
        lambda: None,
        quiet=0.05,
        busy=0.002,
        fresh=0.3,
        lost=lambda error: device.losses.append(str(error)),
        interrupt=device.answers.set,
    )
    polled.connect(WITHIN)
    yield polled
    device.answers.set()
    polled.disconnect()


def run_in_thread(call: Callable[[], object]) -> tuple[threading.Thread, list[BaseException]]:
    errors: list[BaseException] = []

    def run() -> None:
        try:
            call()
        except BaseException as error:
            errors.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    return thread, errors


def test_fresh_returns_a_state_requested_after_the_call(polled: Polled[int], device: Device) -> None:
    for _ in range(20):
        began = time.monotonic()
        assert polled.fresh().asked >= began


def test_wait_ignores_a_reading_in_progress(polled: Polled[int], device: Device) -> None:
    device.answers.clear()
    polled.hurry()
    wait_for(lambda: device.reading)
    count = device.count
    seen: list[int] = []
    thread, errors = run_in_thread(lambda: seen.append(polled.fresh().value))
    time.sleep(0.05)
    device.answers.set()
    thread.join()
    assert not errors
    assert seen[0] >= count + 2


def test_reading_is_faster_while_a_thread_waits(device: Device) -> None:
    polled = Polled("thing at home", device.open, device.read, lambda: None, quiet=3600.0, busy=0.002)
    polled.connect(WITHIN)
    try:
        polled.wait(lambda value: value > 15, WITHIN, "many readings")
        with pytest.raises(DeviceTimeout, match=r"^thing at home: nothing ever took longer than 0\.05 s$"):
            polled.wait(lambda _: False, 0.05, "nothing ever")
    finally:
        polled.disconnect()


def test_an_old_state_is_stale(polled: Polled[int], device: Device) -> None:
    assert polled.fresh().value >= 1
    device.answers.clear()
    time.sleep(0.5)
    with pytest.raises(Stale, match=r"^thing at home: the newest state is \d\.\d+ s old; at most 0\.3 s are allowed"):
        polled.current()
    assert polled.newest() is not None


def test_a_stop_cancels_only_work_that_has_started(polled: Polled[int], device: Device) -> None:
    go_on = polled.begin("pressing")
    thread, errors = run_in_thread(lambda: polled.wait(lambda _: False, WITHIN, "pressing", go_on))
    time.sleep(0.05)
    polled.stop_waiting()
    thread.join(WITHIN)
    assert isinstance(errors[0], Cancelled)
    assert str(errors[0]) == "thing at home: pressing was stopped"
    with pytest.raises(Cancelled):
        go_on()
    polled.begin("pressing again")()


def test_a_short_connection_loss_ends_waiting(polled: Polled[int], device: Device) -> None:
    go_on = polled.begin("pressing")
    thread, errors = run_in_thread(lambda: polled.wait(lambda _: False, WITHIN, "pressing"))
    time.sleep(0.05)
    device.broken = True
    thread.join(WITHIN)
    device.broken = False
    assert isinstance(errors[0], ConnectionLost)
    assert device.losses == ["it broke"]
    wait_for(lambda: polled.observing.state is Connection.BACK)
    with pytest.raises(ConnectionLost):
        go_on()
    polled.begin("pressing again")()
    assert polled.fresh().value


def test_disconnecting_ends_waiting_without_reporting_a_loss(polled: Polled[int], device: Device) -> None:
    thread, errors = run_in_thread(lambda: polled.wait(lambda _: False, WITHIN, "pressing"))
    time.sleep(0.05)
    device.answers.clear()
    polled.disconnect()
    thread.join(WITHIN)
    assert isinstance(errors[0], NotConnected)
    assert device.losses == []
    assert polled.newest() is None


def test_no_state_is_stored_while_the_lock_is_held(device: Device) -> None:
    """The hook and other threads see the same state."""
    taken: list[int] = []

    def note(snapshot: Snapshot[int]) -> None:
        taken.append(snapshot.value)

    polled = Polled("thing", device.open, device.read, lambda: None, quiet=0.002, taken=note)
    polled.connect(WITHIN)
    try:
        for _ in range(20):
            with polled.taking:
                assert taken[-1] == polled.newest()
                held = len(taken)
                time.sleep(0.005)
                assert len(taken) == held
            polled.fresh()
    finally:
        polled.disconnect()


def test_an_unsolicited_state_is_stored(device: Device) -> None:
    """`read` may return None; a state from `put` is valid since the given time."""
    polled: Polled[int] = Polled("thing", device.open, lambda: None, lambda: None, busy=0.002)
    polled.connect(WITHIN)
    try:
        first = polled.current()
        asked: list[float] = []
        thread, errors = run_in_thread(
            lambda: asked.append(polled.wait(lambda value: value > 6, WITHIN, "seven").asked)
        )
        polled.put(6, time.monotonic())
        polled.put(7, began := time.monotonic() + 1e-3)
        thread.join(WITHIN)
        assert not errors
        assert asked == [began]
        assert (first.value, polled.newest()) == (1, 7)
        polled.put(8, time.monotonic() - 1.0)
        with pytest.raises(Stale):
            polled.current()
    finally:
        polled.disconnect()
