"""A simulated press, a driver that keeps all rules, and its bench. The other modules each break one rule."""

import math
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, ClassVar

from arcor2_hw.actions import action
from arcor2_hw.data.device import Connection, Identity, LossReaction
from arcor2_hw.exceptions import (
    Cancelled,
    ConnectionLost,
    DeviceTimeout,
    NotConnected,
    NotInControl,
    OutOfRange,
    Refused,
    Stale,
)
from arcor2_hw.objects import Generic, Machine, MachineCommand, MachineState
from arcor2_hw.testing.bench import Bench, Check

NOWHERE = "nowhere.cell:502"
WATCHDOG = 0.6  # s
STROKE = 20.0  # s
MAX_FORCE = 1000.0  # N
FRESH = 0.1
"""Age in s from which on a reading is stale."""
PATIENCE = 0.5
"""Time in s for which a call waits for a fresh reading: on a busy machine the observing thread runs late."""
ORPHAN = """
import sys, time
while True:
    open(sys.argv[1], "w").write(repr(time.time()))
    time.sleep(0.02)
"""


class Press:
    """The device. A stroke ends after its duration, by a stop, or by the watchdog when the press is unreachable.

    The watchdog counts from the moment at which the press falls silent, not from the last request, so a thread that
    runs late on a busy computer does not trip it.
    """

    def __init__(self) -> None:
        self.writes: list[str] = []
        self.wire: list[str] = []
        self.torn = False
        self.silent_since = math.inf
        self.owner: str | None = None
        self.until = 0.0
        self.link = 0
        self.force = 250.0  # N
        self.scrapped = False

    @property
    def silent(self) -> bool:
        return self.silent_since != math.inf

    def fall_silent(self) -> None:
        self.silent_since = time.monotonic()

    def heal(self) -> None:
        self.running()
        self.silent_since, self.torn = math.inf, False

    def scrap(self) -> None:
        """End the threads that a broken driver has left behind."""
        self.scrapped, self.until = True, 0.0

    def ask(self, write: str = "", link: int | None = None) -> None:
        if link is not None and link != self.link:
            raise ConnectionResetError
        if self.silent or self.scrapped:
            raise TimeoutError
        if write:
            self.writes.append(write)
            self.wire.append(write)
        if write == "stroke":
            self.until = time.monotonic() + STROKE
        if write == "halt":
            self.until = 0.0

    def running(self) -> bool:
        if time.monotonic() - self.silent_since > WATCHDOG:
            self.until = 0.0
        return time.monotonic() < self.until

    def answer(self) -> bytes:
        if self.torn:
            self.torn = False
            self.fall_silent()
            return b"\x00"
        return b"\x00\x2a"


PRESSES: dict[str, Press] = {}
"""The presses by address; each bench has its own, and each case a new one at the same address."""


class ToyPress(Machine, Generic):
    """A press."""

    _ABSTRACT = False
    states: ClassVar[frozenset[MachineState]] = frozenset({MachineState.STOPPED, MachineState.EXECUTE})
    loss_reaction: ClassVar[LossReaction] = LossReaction.stops_within(WATCHDOG)

    def __init__(self, obj_id: str, name: str, address: str = NOWHERE) -> None:
        super().__init__(obj_id, name)
        self.where = f"{name} at {address}"
        self._there = address in PRESSES
        self._press = PRESSES.get(address) or Press()
        self._state, self._ours, self._stops = Connection.OFFLINE, False, 0
        self._read_at = 0.0
        self._link = 0
        self._acting, self._stopping = threading.Lock(), threading.Lock()
        self._ending = threading.Event()
        self._thread: threading.Thread | None = None

    # -------------------------------------------------------------------------------- connection
    @property
    def connection(self) -> Connection:
        return self._state

    def connect(self, timeout: float = 5.0) -> None:
        if self._thread is not None:
            return
        if not self._there or self._press.silent:
            self._state = Connection.FAILED
            raise self._nobody(timeout)
        self._link = self._press.link
        self._greet()
        self._read_at = time.monotonic()
        self._state = Connection.ONLINE
        self._watch()

    def _nobody(self, timeout: float) -> Exception:
        return NotConnected(f"nobody answers at {self.where}")

    def _greet(self) -> None:
        self._press.ask()

    def _watch(self) -> None:
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._observe, args=(self._ending,), name="toy", daemon=True)
        self._thread.start()

    def _observe(self, ending: threading.Event) -> None:
        failed = 0
        while not ending.wait(0.02) and not self._press.scrapped:
            try:
                self._press.ask(link=self._link)
            except ConnectionResetError:
                self._reopen()
            except TimeoutError:
                failed += 1
                if failed > 5 and self._state in (Connection.ONLINE, Connection.BACK):
                    self._lost()
            else:
                failed, self._read_at = 0, time.monotonic()
                if self._state is Connection.LOST:
                    self._back()

    def _reopen(self) -> None:
        self._link = self._press.link

    def _lost(self) -> None:
        self._state, self._ours = Connection.LOST, False

    def _back(self) -> None:
        self._state = Connection.BACK

    def disconnect(self) -> None:
        self._stops += 1
        self._state, self._ours = Connection.OFFLINE, False
        thread, self._thread = self._thread, None
        self._end(thread)

    def _end(self, thread: threading.Thread | None) -> None:
        self._ending.set()
        if thread is not None:
            thread.join(1.0)

    def identify(self) -> Identity:
        self._check()
        return Identity("Toys", "Press", "1", "1.0")

    # -------------------------------------------------------------------------------- control
    def take_control(self) -> None:
        if self.control_owner() not in (None, "us"):
            raise NotInControl(f"{self.where}: {self._press.owner} has control")
        self._ours = True

    def control_owner(self) -> str | None:
        return self._press.owner or ("us" if self._ours else None)

    def _check(self) -> None:
        if self._state is Connection.LOST:
            raise ConnectionLost(f"{self.where} is lost")
        if self._state in (Connection.OFFLINE, Connection.FAILED):
            raise NotConnected(f"{self.where} is not connected")

    def _check_control(self) -> None:
        self._check()
        if not self._ours:
            raise NotInControl(f"{self.where}: a command without control")

    # -------------------------------------------------------------------------------- readings
    def reading(self) -> float:
        until = time.monotonic() + PATIENCE
        self._check()
        while time.monotonic() - self._read_at > FRESH:
            if time.monotonic() > until:
                raise Stale(f"{self.where}: the newest reading is old")
            time.sleep(0.005)
            self._check()
        return self._read_at

    def force(self) -> float:
        """Return the force, N."""
        self._check()
        return self._press.force

    def measure(self) -> int:
        """Read the force from the press."""
        try:
            self._press.ask()
        except TimeoutError:
            raise DeviceTimeout(f"{self.where} does not answer") from None
        return self._decoded(self._press.answer())

    def _decoded(self, answer: bytes) -> int:
        if len(answer) != 2:
            raise ConnectionLost(f"{self.where}: half an answer")
        return answer[1]

    # -------------------------------------------------------------------------------- machine
    def machine_state(self) -> MachineState:
        self._check()
        return MachineState.EXECUTE if self._press.running() else MachineState.STOPPED

    def command(self, command: MachineCommand) -> None:
        raise Refused(f"{self.where} knows no {command.name}")

    def wait_for(self, state: MachineState, timeout: float) -> None:
        if self.machine_state() is not state:
            raise DeviceTimeout(f"{self.where} is not {state.name}")

    # -------------------------------------------------------------------------------- acting
    @action
    def clamp(self, *, an: str | None = None) -> None:
        """Clamp the part."""
        self._check_control()
        self._press.ask("clamp")

    @action
    def press(self, force: float, *, an: str | None = None) -> None:
        """Press with a force.

        :param force: N
        """
        self._check_control()
        self._limit(force)
        self._press.ask(f"press {force}")

    def _limit(self, force: float) -> None:
        if not 0.0 <= force <= MAX_FORCE:
            raise OutOfRange(f"{self.where}: {force} N is not 0 to {MAX_FORCE} N")

    @action
    def stroke(self, *, an: str | None = None) -> None:
        """Press."""
        if not self._acting.acquire(blocking=False):
            raise Refused(f"{self.where} presses already")
        stops = self._stops
        try:
            self._check()
            self._press.ask("stroke")
            while self._press.running():
                time.sleep(0.005)
                if self._stopped_since(stops):
                    raise self._stopped()
            if self._stopped_since(stops):
                raise self._stopped()
            raise ConnectionLost(f"{self.where}: the stroke was cut off")
        finally:
            self._acting.release()

    def _stopped_since(self, stops: int) -> bool:
        with self._stopping:  # what is seen as stopped has been halted
            return self._stops != stops

    def _stopped(self) -> Exception:
        return Cancelled(f"{self.where}: the stroke was stopped")

    def stop(self) -> None:
        """Stop."""
        with self._stopping:
            self._stops += 1
            self._press.ask("halt")


class ToyBench(Bench):
    object_type = ToyPress
    call_within = 1.0
    stale_after = 0.3
    back_within = 3.0
    watchdog: ClassVar[float] = WATCHDOG

    def start(self) -> None:
        self.folder = tempfile.TemporaryDirectory()
        self.sign_of_life = Path(self.folder.name) / "alive"
        self.press = PRESSES[self.address] = Press()

    def end(self) -> None:
        PRESSES.pop(self.address).scrap()
        self.folder.cleanup()

    @property
    def address(self) -> str:
        return f"{self.name()}.cell:502"

    def make(self) -> ToyPress:
        return self.object_type("id", "toy", self.address)  # type: ignore

    def reset(self) -> None:
        self.press.scrap()
        self.press = PRESSES[self.address] = Press()
        self.sign_of_life.unlink(missing_ok=True)

    def absent(self) -> tuple[Generic, str]:
        return type(self.make())("id", "toy", NOWHERE), NOWHERE

    def writes(self) -> Any:
        return list(self.press.writes)

    def actuating(self) -> list[str]:
        return list(self.press.wire)

    def cut(self) -> None:
        self.press.fall_silent()

    def heal(self) -> None:
        self.press.heal()

    def reset_link(self) -> None:
        self.press.link += 1

    def half_frame(self) -> None:
        self.press.torn = True

    def observe(self, device: Any) -> object:
        return device.reading()

    def command(self, device: Any) -> object:
        return device.clamp()

    def ask(self, device: Any) -> object:
        return device.measure()

    def run_long(self, device: Any) -> object:
        return device.stroke()

    def running(self) -> bool:
        return self.press.running() or self._run_by_another()

    def _run_by_another(self) -> bool:
        try:
            return time.time() - float(self.sign_of_life.read_text()) < self.watchdog
        except (FileNotFoundError, ValueError):
            return False

    @contextmanager
    def foreign(self) -> Iterator[None]:
        self.press.owner = "the operator"
        yield
        self.press.owner = None

    def orphan(self) -> list[str]:
        return [sys.executable, "-c", ORPHAN, str(self.sign_of_life)]

    def readings(self, device: Any) -> list[Check]:
        return [Check("force, N", device.force(), self.press.force, 0.1)]

    def beyond_limits(self, device: Any) -> dict[str, Any]:
        return {"too much force": lambda: device.press(MAX_FORCE * 1.01), "a pull": lambda: device.press(-1.0)}

    def works(self, device: Any) -> dict[str, Any]:
        return {"wait_for": lambda: device.wait_for(MachineState.STOPPED, 1.0)}
