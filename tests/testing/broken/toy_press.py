"""A driver of a simulated press that obeys all rules, and its bench. Each other module breaks one rule."""

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
from arcor2_hw.keep_alive import once_within
from arcor2_hw.objects import Generic, Machine, MachineCommand, MachineState
from arcor2_hw.testing.bench import Bench, Check
from arcor2_hw.testing.own_time import own_time

from .toy_device import PRESSES, WATCHDOG, Press

NOWHERE = "nowhere.cell:502"
MAX_FORCE = 1000.0  # N
FRESH = 0.5
"""Age in s from which on a reading is stale."""
PATIENCE = 0.5
"""Running time in s for which a call waits for a fresh reading: the observing thread may be late."""
ORPHAN = """
import sys, time
while True:
    open(sys.argv[1], "w").write(repr(time.time()))
    time.sleep(0.02)
"""


def dawdle(seconds: float) -> None:
    """Do nothing for some seconds of the suite's clock, which runs slower on a busy machine."""
    began = own_time()
    while not began.is_past(seconds):
        time.sleep(0.05)


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
        if not once_within(self._is_fresh, PATIENCE, 0.005):
            raise Stale(f"{self.where}: the newest reading is old")
        return self._read_at

    def _is_fresh(self) -> bool:
        self._check()
        return time.monotonic() - self._read_at <= FRESH

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

    @action(quick=True)
    def weigh(self, *, an: str | None = None) -> float:
        """Return the weight of the part, kg."""
        self._check()
        self._press.ask()
        return self._press.weight

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
        with self._stopping:  # a press that is reported as stopped has been halted
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
    stale_after = FRESH + 0.2
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
        return self.press.running() or time.time() - self.heard_last() < self.watchdog

    def heard_last(self) -> float:
        """Return when the process of `orphan` last gave a sign of life, s; if never, a time far in the past."""
        try:
            return float(self.sign_of_life.read_text())
        except (FileNotFoundError, ValueError):
            return -math.inf

    @contextmanager
    def foreign(self) -> Iterator[None]:
        self.press.owner = "the operator"
        yield
        self.press.owner = None

    def orphan(self) -> list[str]:
        return [sys.executable, "-c", ORPHAN, str(self.sign_of_life)]

    def readings(self, device: Any) -> list[Check]:
        return [Check("force, N", device.force(), self.press.force, 0.1)]

    def results(self, device: Any) -> Iterator[Check]:
        for weight in (0.5, 0.7, 0.6):
            self.press.weight = weight
            yield Check("weigh", device.weigh(), weight, 0.001)

    def beyond_limits(self, device: Any) -> dict[str, Any]:
        return {"too much force": lambda: device.press(MAX_FORCE * 1.01), "a pull": lambda: device.press(-1.0)}

    def works(self, device: Any) -> dict[str, Any]:
        return {"wait_for": lambda: device.wait_for(MachineState.STOPPED, 1.0)}
