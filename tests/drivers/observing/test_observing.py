"""The life cycle of an observed connection: opened once, lost, restored, stopped at any moment."""

import logging
import threading
import time

import pytest

from arcor2_hw.data.device import Connection
from arcor2_hw.exceptions import ConnectionLost, DeviceError, DeviceTimeout, NotConnected
from arcor2_hw.objects import observing
from arcor2_hw.objects.observing import Observing
from tests.waiting import wait_for


class Line:
    """A connection that the test breaks and restores."""

    def __init__(self) -> None:
        self.refuses = False
        self.broken = threading.Event()
        self.opened = self.closed = 0
        self.open = False
        self.losses: list[DeviceError] = []
        self.life = Observing("line 1", self.do_open, self.watch, self.close, self.losses.append)

    def do_open(self, timeout: float) -> None:
        if self.refuses:
            raise NotConnected("line 1 refuses")
        self.opened += 1
        self.open = True
        self.broken.clear()

    def watch(self, stopping: threading.Event) -> None:
        while not stopping.is_set():
            if self.broken.wait(0.005):
                raise ConnectionLost("line 1 broke")

    def close(self) -> None:
        self.closed += self.open
        self.open = False


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(observing, "FIRST_PAUSE", 0.01)
    monkeypatch.setattr(observing, "MAX_PAUSE", 0.02)


def test_start_and_stop_are_idempotent() -> None:
    line = Line()
    line.life.stop()
    line.life.start(1.0)
    line.life.start(1.0)
    assert (line.opened, line.life.state, line.life.online) == (1, Connection.ONLINE, True)
    line.life.stop()
    line.life.stop()
    assert (line.life.state, line.closed) == (Connection.OFFLINE, 1)
    with pytest.raises(NotConnected, match="line 1"):
        line.life.check()
    line.life.start(1.0)
    assert line.opened == 2
    line.life.stop()


def test_a_failed_first_connection_is_raised_and_not_repeated() -> None:
    line = Line()
    line.refuses = True
    with pytest.raises(NotConnected, match="refuses"):
        line.life.start(1.0)
    assert line.life.state is Connection.FAILED
    line.refuses = False
    time.sleep(0.05)
    assert line.opened == 0
    line.life.start(1.0)
    line.life.stop()


def test_loss_and_return_are_announced_once(caplog: pytest.LogCaptureFixture) -> None:
    line = Line()
    caplog.set_level(logging.INFO)
    line.life.start(1.0)
    line.refuses = True
    line.broken.set()
    wait_for(lambda: line.life.state is Connection.LOST)
    with pytest.raises(ConnectionLost, match="line 1"):
        line.life.check()
    with pytest.raises(ConnectionLost):
        line.life.start(1.0)
    time.sleep(0.1)  # some attempts
    line.refuses = False
    wait_for(lambda: line.life.state is Connection.BACK)
    line.life.check()
    line.life.settled()
    assert line.life.state is Connection.ONLINE
    assert [str(loss) for loss in line.losses] == ["line 1 broke"]
    assert (line.opened, line.closed) == (2, 1)
    wait_for(lambda: len(caplog.records) == 2)
    line.life.stop()


def test_stopping_while_lost_ends_reconnecting() -> None:
    line = Line()
    line.life.start(1.0)
    line.refuses = True
    line.broken.set()
    wait_for(lambda: line.life.state is Connection.LOST)
    line.life.stop()
    line.refuses = False
    time.sleep(0.1)
    assert (line.opened, line.open, line.life.state) == (1, False, Connection.OFFLINE)


def test_a_hung_thread_does_not_block_stopping(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(observing, "STOP_TIMEOUT", 0.05)
    line = Line()
    hold = threading.Event()
    line.life = Observing("line 1", line.do_open, lambda _: (hold.wait(60.0), None)[1], line.close)
    line.life.start(1.0)
    line.life.stop()
    assert line.life.state is Connection.OFFLINE
    with pytest.raises(DeviceTimeout, match="line 1"):
        line.life.start(0.05)  # at its end the old thread would close the new connection
    hold.set()
    line.life.start(1.0)
    assert (line.open, line.life.online) == (True, True)
    line.life.stop()
