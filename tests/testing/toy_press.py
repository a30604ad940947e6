"""A press that lives in memory, its driver, which keeps all rules but the one it is told to break, and its bench."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, ClassVar

from arcor2_hw.actions import action
from arcor2_hw.data.device import Connection, LossReaction
from arcor2_hw.exceptions import (
    Cancelled,
    ConnectionLost,
    DeviceTimeout,
    NotConnected,
    NotInControl,
    Refused,
    Stale,
)
from arcor2_hw.objects import Generic
from arcor2_hw.testing.bench import Bench

ADDRESS, NOWHERE = "press.cell:502", "nowhere.cell:502"
WATCHDOG = 0.2  # s
STROKE = 20.0  # s


class Press:
    """The device. A stroke ends by its time, by stop, or by the watchdog when nobody has asked for long."""

    def __init__(self) -> None:
        self.writes: list[str] = []
        self.silent = False
        self.owner: str | None = None
        self.until = self.asked = 0.0

    def ask(self, write: str = "") -> None:
        if self.silent:
            raise TimeoutError
        self.running()
        self.asked = time.monotonic()
        if write:
            self.writes.append(write)
        if write == "stroke":
            self.until = time.monotonic() + STROKE
        if write == "halt":
            self.until = 0.0

    def running(self) -> bool:
        if time.monotonic() - self.asked > WATCHDOG:
            self.until = 0.0
        return time.monotonic() < self.until


PRESS = Press()


class ToyPress(Generic):
    """A press."""

    _ABSTRACT = False
    loss_reaction: ClassVar[LossReaction] = LossReaction.stops_within(WATCHDOG)
    breaks: ClassVar[str] = ""

    def __init__(self, obj_id: str, name: str, address: str = ADDRESS) -> None:
        super().__init__(obj_id, name)
        self.where = f"{name} at {address}"
        self._there = address == ADDRESS
        self._state, self._ours, self._stops = Connection.OFFLINE, False, 0
        self._read_at = 0.0
        self._acting = threading.Lock()
        self._ending = threading.Event()
        self._thread: threading.Thread | None = None
        if self.breaks == "constructor_opens_nothing":
            self._watch()

    @property
    def connection(self) -> Connection:
        return self._state

    def connect(self, timeout: float = 5.0) -> None:
        if self._thread is not None and self.breaks != "connect_is_idempotent":
            return
        if not self._there or PRESS.silent:
            self._state = Connection.FAILED
            where = "the press" if self.breaks == "absent_device" and not self._there else self.where
            if self.breaks == "connecting_to_a_silent_device" and self._there:
                time.sleep(timeout + 1.0)
            raise NotConnected(f"nobody answers at {where}")
        PRESS.ask("enable" if self.breaks == "connecting_observes" else "")
        self._read_at = time.monotonic()
        self._state = Connection.ONLINE
        self._watch()

    def _watch(self) -> None:
        if self._ending.is_set() or self._thread is None:
            self._ending = threading.Event()
        self._thread = threading.Thread(target=self._observe, args=(self._ending,), name="toy", daemon=True)
        self._thread.start()

    def _observe(self, ending: threading.Event) -> None:
        failed, ours = 0, False
        while not ending.wait(0.02):
            try:
                PRESS.ask()
            except TimeoutError:
                failed += 1
                ours = ours or self._ours
                if failed > 5 and self._state is not Connection.OFFLINE:
                    self._state, self._ours = Connection.LOST, False
                continue
            failed, self._read_at = 0, time.monotonic()
            if self._state is Connection.LOST and self.breaks != "observation_comes_back":
                self._state = Connection.BACK
                self._ours = ours and self.breaks == "control_does_not_come_back"
                if ours and self.breaks == "nothing_resumes":
                    PRESS.ask("stroke")

    def disconnect(self) -> None:
        if self.breaks == "disconnect_is_idempotent" and self._state is Connection.OFFLINE and self._read_at:
            time.sleep(2.0)
        self._stops += 1
        self._state, self._ours = Connection.OFFLINE, False
        thread, self._thread = self._thread, None
        if self.breaks != "nothing_is_left_behind":
            self._ending.set()
        if thread is not None and self.breaks != "nothing_is_left_behind":
            thread.join(1.0)

    def take_control(self) -> None:
        if self.control_owner() not in (None, "us") and self.breaks != "control_is_refused":
            raise NotInControl(f"{self.where}: {PRESS.owner} has control")
        self._ours = True

    def control_owner(self) -> str | None:
        return PRESS.owner or ("us" if self._ours else None)

    def reading(self) -> float:
        if self.breaks == "stale_is_an_error" and self._state is not Connection.OFFLINE:
            return self._read_at
        self._check()
        if time.monotonic() - self._read_at > 0.1:
            raise Stale(f"{self.where}: the newest reading is old")
        return self._read_at

    def _check(self) -> None:
        if self._state is Connection.LOST:
            raise ConnectionLost(f"{self.where} is lost")
        if self._state is Connection.OFFLINE:
            raise NotConnected(f"{self.where} is not connected")

    def measure(self) -> None:
        try:
            PRESS.ask()
        except TimeoutError:
            if self.breaks == "silence_in_a_call":
                raise
            raise DeviceTimeout(f"{self.where} does not answer") from None

    @action
    def clamp(self, *, an: str | None = None) -> None:
        """Clamp the part."""
        self._check()
        if not self._ours and self.breaks != "command_needs_control":
            raise NotInControl(f"{self.where}: clamp without control")
        PRESS.ask("clamp")

    @action
    def stroke(self, *, an: str | None = None) -> None:
        """Press."""
        if not self._acting.acquire(blocking=self.breaks == "one_act_at_a_time", timeout=-1):
            raise Refused(f"{self.where} presses already")
        stops = self._stops
        try:
            self._check()
            PRESS.ask("stroke")
            while PRESS.running():
                time.sleep(0.005)
                if self._stops != stops:
                    if self.breaks == "disconnecting_ends_an_act" and self._state is Connection.OFFLINE:
                        time.sleep(4.0)
                    raise Cancelled(f"{self.where}: the stroke was stopped")
            raise ConnectionLost(f"{self.where}: the stroke was cut off")
        finally:
            self._acting.release()

    def stop(self) -> None:
        """Stop."""
        self._stops += 1
        if self.breaks != "stop_passes":
            PRESS.ask("halt")


class ToyBench(Bench):
    object_type = ToyPress
    call_within = 1.0
    stale_after = 0.3

    @property
    def address(self) -> str:
        return ADDRESS

    def make(self) -> ToyPress:
        return self.object_type("id", "toy")  # type: ignore

    def reset(self) -> None:
        PRESS.silent, PRESS.owner, PRESS.until = False, None, 0.0

    def absent(self) -> tuple[Generic, str]:
        return type(self.make())("id", "toy", NOWHERE), NOWHERE

    def writes(self) -> Any:
        return list(PRESS.writes)

    def cut(self) -> None:
        PRESS.silent = True

    def heal(self) -> None:
        PRESS.silent = False

    def observe(self, device: Generic) -> object:
        assert isinstance(device, ToyPress)
        return device.reading()

    def command(self, device: Generic) -> object:
        assert isinstance(device, ToyPress)
        return device.clamp()

    def ask(self, device: Generic) -> object:
        assert isinstance(device, ToyPress)
        return device.measure()

    def run_long(self, device: Generic) -> object:
        assert isinstance(device, ToyPress)
        return device.stroke()

    def running(self) -> bool:
        return PRESS.running()

    @contextmanager
    def foreign(self) -> Iterator[None]:
        PRESS.owner = "the operator"
        yield
        PRESS.owner = None
