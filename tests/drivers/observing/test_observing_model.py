"""The connection's state machine under random events: valid transitions, each announced once."""

import itertools
import logging
import threading
import time
from collections import Counter
from collections.abc import Callable

import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from arcor2_hw.data.device import Connection
from arcor2_hw.exceptions import ConnectionLost, DeviceError, NotConnected
from arcor2_hw.objects import observing
from arcor2_hw.objects.observing import Observing, listening
from tests.waiting import wait_for

C = Connection
MAY_FOLLOW = {
    C.OFFLINE: {C.CONNECTING},
    C.CONNECTING: {C.ONLINE, C.FAILED},
    C.FAILED: {C.CONNECTING, C.OFFLINE},
    C.ONLINE: {C.LOST, C.OFFLINE},
    C.LOST: {C.BACK, C.OFFLINE},
    C.BACK: {C.ONLINE, C.LOST, C.OFFLINE},
}
PAUSES = (0.004, 0.016)
"""First and longest pause between attempts in these tests, s."""


class Device:
    """The other end: reachable or not, with the configuration that the driver sends at each opening."""

    def __init__(self) -> None:
        self.reachable = True
        self.fails_with: Exception | None = None
        self.broken = threading.Event()
        self.is_open = False
        self.recipe = ""
        self.attempts: list[float] = []
        self.losses: list[DeviceError] = []
        self.path: list[Connection] = []
        with listening(lambda life: self.path.append(life.state)):
            self.life = Observing("line 7", self.open, self.watch, self.close, self.losses.append)

    def open(self, timeout: float) -> None:
        self.attempts.append(time.monotonic())
        assert not self.is_open, "opened while open"
        if self.fails_with is not None:
            raise self.fails_with
        if not self.reachable:
            raise NotConnected("line 7 does not answer")
        self.is_open = True
        self.broken.clear()
        self.recipe = "x, y at 100 Hz"

    def watch(self, stopping: threading.Event) -> None:
        while not stopping.wait(0.001):
            if self.broken.is_set():
                raise ConnectionLost("line 7 broke")

    def close(self) -> None:
        self.is_open = False
        self.recipe = ""

    def until(self, holds: Callable[[], bool]) -> None:
        wait_for(lambda: self.path, lambda _: holds())


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(observing, "FIRST_PAUSE", PAUSES[0])
    monkeypatch.setattr(observing, "MAX_PAUSE", PAUSES[1])


DAY = st.lists(st.sampled_from(["start", "stop", "break", "unplug", "plug", "settle", "call", "bug"]), max_size=14)


@given(day=DAY)
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_random_events_keep_the_state_machine_valid(day: list[str], quick: None) -> None:
    device = Device()
    life = device.life
    logged = LogCounter()
    with logged:
        try:
            for event in day:
                live(device, event)
                check(device)
        finally:
            life.stop()
    steps = [C.OFFLINE, *device.path]
    for before, after in itertools.pairwise(steps):
        assert after in MAY_FOLLOW[before], f"{before} -> {after} in {device.path}, day {day}"
    count = Counter(device.path)
    assert logged.count == {"lost": count[C.LOST], "back": count[C.BACK]}, "each loss and each return is logged once"
    assert len(device.losses) == count[C.LOST], "the driver is notified of a loss once"
    assert life.state is C.OFFLINE
    assert not device.is_open
    assert not [t for t in threading.enumerate() if t.name == "observing line 7"]


def live(device: Device, event: str) -> None:
    """Cause one event, and wait for its effect."""
    life = device.life
    reachable = device.reachable and device.fails_with is None
    match event:
        case "start" if life.state in (C.OFFLINE, C.FAILED) and not reachable:
            with pytest.raises((NotConnected, RuntimeError)):
                life.start(1.0)
            assert life.state is C.FAILED
        case "start" if life.state is C.LOST:
            with pytest.raises(ConnectionLost, match="line 7"):
                life.start(1.0)
        case "start":
            life.start(1.0)
        case "stop":
            life.stop()
            assert life.state is C.OFFLINE
        case "break" if life.online:
            before = len(device.losses)
            device.broken.set()
            device.until(lambda: len(device.losses) == before + 1)
            if reachable:
                device.until(lambda: life.state is C.BACK)
        case "unplug" | "bug":
            device.reachable, device.fails_with = False, RuntimeError("bug") if event == "bug" else None
            if life.online:
                device.broken.set()
                device.until(lambda: life.state is C.LOST)
        case "plug":
            device.reachable, device.fails_with = True, None
            if life.state is C.LOST:
                device.until(lambda: life.state is C.BACK)
        case "settle":
            device.until(lambda: not device.path or device.path[-1] is life.state)  # it notifies after the change
            was = life.state
            life.settled()
            assert life.state is (C.ONLINE if was is C.BACK else was)
        case "call":
            if life.online:
                life.check()
            else:
                with pytest.raises(ConnectionLost if life.state is C.LOST else NotConnected, match="line 7"):
                    life.check()


def check(device: Device) -> None:
    if device.life.online:
        assert device.is_open
        assert device.recipe == "x, y at 100 Hz", "the configuration is complete whenever the connection is up"
    assert bool(device.life.reason) <= (device.life.state in (C.LOST, C.FAILED))


class LogCounter(logging.Handler):
    """Counts the losses and returns that the state machine logs."""

    def __init__(self) -> None:
        super().__init__()
        self.count = {"lost": 0, "back": 0}

    def __enter__(self) -> None:
        observing.log.addHandler(self)

    def __exit__(self, *_: object) -> None:
        observing.log.removeHandler(self)

    def emit(self, record: logging.LogRecord) -> None:
        for word, text in (("lost", " is lost:"), ("back", " is restored after")):
            self.count[word] += text in record.getMessage()


def test_reconnection_attempts_back_off_up_to_a_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(observing, "FIRST_PAUSE", 0.02)
    monkeypatch.setattr(observing, "MAX_PAUSE", 0.16)
    device = Device()
    device.life.start(1.0)
    device.reachable = False
    device.broken.set()
    device.until(lambda: len(device.attempts) >= 8)
    device.life.stop()
    gaps = [b - a for a, b in itertools.pairwise(device.attempts[1:])]
    for gap, pause in zip(gaps, (0.04, 0.08, 0.16, 0.16, 0.16, 0.16), strict=False):
        assert gap >= pause - 1e-3, gaps


def test_a_connection_that_breaks_at_once_keeps_the_back_off(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(observing, "FIRST_PAUSE", 0.01)
    monkeypatch.setattr(observing, "MAX_PAUSE", 0.1)
    device = Device()
    device.watch = lambda stopping: device.until(lambda: True) or _break()  # type: ignore[method-assign]
    with listening(lambda life: device.path.append(life.state)):
        device.life = Observing("line 7", device.open, device.watch, device.close)
    device.life.start(1.0)
    wait_for(lambda: len(device.attempts) >= 7)
    device.life.stop()
    pauses = [later - earlier for earlier, later in itertools.pairwise(device.attempts[1:])]
    assert all(pause >= least for pause, least in zip(pauses, (0.02, 0.04, 0.08, 0.1), strict=False)), pauses


def _break() -> None:
    raise ConnectionLost("line 7 broke")


def test_a_watch_that_returns_does_not_spin() -> None:
    calls: list[float] = []
    life = Observing("line 7", lambda _: None, lambda _: calls.append(0.0), lambda: None)
    life.start(1.0)
    began = time.monotonic()
    wait_for(lambda: len(calls) >= 3)
    life.stop()
    assert len(calls) <= 2 + (time.monotonic() - began) / observing.WATCH_PAUSE


def test_an_error_in_the_drivers_watch_is_a_loss(quick: None, caplog: pytest.LogCaptureFixture) -> None:
    device = Device()
    mistakes = [ZeroDivisionError("a mistake")]

    def watch(stopping: threading.Event) -> None:
        if mistakes:
            raise mistakes.pop()
        stopping.wait()

    with listening(lambda life: device.path.append(life.state)):
        device.life = Observing("line 7", device.open, watch, device.close)
    device.life.start(1.0)
    device.until(lambda: device.life.state is C.BACK)
    device.life.stop()
    assert device.path == [C.CONNECTING, C.ONLINE, C.LOST, C.BACK, C.OFFLINE]
    assert any(record.exc_info for record in caplog.records), "the mistake is in the log with its traceback"
