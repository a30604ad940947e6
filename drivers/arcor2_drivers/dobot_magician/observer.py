"""The observer: asks the arm where it is, some forty times a second, and carries the questions of others."""

import math
import struct
import threading
import time
from collections.abc import Callable
from typing import Any, Final

from arcor2_hw.data.base import Data, Timestamp, now
from arcor2_hw.exceptions import ConnectionLost, DeviceError, DeviceFault, DeviceTimeout, NotConnected, Stale
from arcor2_hw.keep_alive import BUSY_FOR, LONGEST_STEP, RunningTime, acquire_within, once_within
from arcor2_hw.objects.observing import Observing

from .alarms import RESET, codes
from .frames import QUEUED, WRITE, Command
from .kinematics import Joints, Tool
from .port import Port
from .settings import DobotMagicianSettings

PERIOD: Final = 0.025
"""Seconds between looks: three short questions, which take 10 ms at 115200 baud."""
STANDING: Final = 0.1
"""Seconds without a change after which the arm counts as standing."""
STILL: Final = math.radians(0.005)
"""rad a joint may seem to turn between two looks while it stands."""
MAX_AGE: Final = 0.5


class Sample(Data, frozen=True):
    """What one look gave; `monotonic` is when it began, `standing` for how long (s) the joints have not changed."""

    tool: Tool
    q: Joints
    alarms: frozenset[int]
    index: int
    monotonic: float
    standing: float

    @property
    def moving(self) -> bool:
        """Tell whether the arm moves."""
        return self.standing < STANDING


class Observer:
    """Has the port; looks at the arm by a thread of its own, and asks for whoever wants to.

    When an answer is overdue the port is given up and opened anew: what comes late answers nothing.
    """

    def __init__(self, name: str, settings: DobotMagicianSettings, lost: Callable[[], None]) -> None:
        self.who = f"{name} at {settings.port}"
        self.observing = Observing(self.who, self._open, self._watch, self._close, self._lost)
        self.came = threading.Condition()
        self.since: dict[int, Timestamp] = {}
        """When each alarm that stands was first seen."""
        self._settings, self._tell_lost = settings, lost
        self._turn = threading.Lock()
        self._port: Port | None = None
        self._newest: Sample | None = None
        self._changed = 0.0
        self._loss: DeviceError | None = None

    # -------------------------------------------------------------------------------- what was seen
    def newest(self) -> Sample | None:
        """Give the last sample, however old."""
        return self._newest

    def sample(self, max_age: float = MAX_AGE) -> Sample:
        """Give the last sample. Raises NotConnected, ConnectionLost, Stale when it is older than `max_age` s."""
        self.check()
        once_within(lambda: self._age() <= max_age or not self.observing.online, BUSY_FOR, PERIOD)
        self.check()
        sample = self._newest
        if sample is None or self._age() > max_age:
            raise Stale(f"{self.who} has told nothing for {max_age:g} s")
        return sample

    def _age(self) -> float:
        return math.inf if self._newest is None else time.monotonic() - self._newest.monotonic

    def after(self, moment: float, timeout: float = MAX_AGE) -> Sample:
        """Give a sample begun after a moment of the monotonic clock. Raises as `sample`."""
        clock = RunningTime()
        with self.came:
            while True:
                sample = self.sample(math.inf) if self._newest is not None else None
                if sample is not None and sample.monotonic > moment:
                    return sample
                if clock() >= timeout:
                    raise Stale(f"{self.who} has told nothing for {timeout:g} s")
                self.check()
                self.came.wait(LONGEST_STEP)

    def check(self) -> None:
        """Return when the arm is observed. Raises NotConnected or ConnectionLost."""
        self.observing.check()

    # -------------------------------------------------------------------------------- asking
    def get(self, command: Command, layout: str) -> tuple[Any, ...]:
        """Ask for values. Raises DeviceFault when the answer has another form than `layout`."""
        return self._unpack(command, self._ask(command, 0, b""), layout)

    def text(self, command: Command) -> str:
        """Ask for a text."""
        return self._ask(command, 0, b"").split(b"\0")[0].decode("ascii", "replace").strip()

    def raw(self, command: Command) -> bytes:
        """Ask for bytes."""
        return self._ask(command, 0, b"")

    def set(self, command: Command, layout: str = "", *values: float) -> None:
        """Set values at once, past the queue."""
        self._ask(command, WRITE, struct.pack("<" + layout, *values))

    def queue(self, command: Command, layout: str, *values: float) -> int:
        """Put a command into the queue; give its index."""
        answer = self._ask(command, WRITE | QUEUED, struct.pack("<" + layout, *values))
        return int(self._unpack(command, answer, "Q")[0])

    def _ask(self, command: Command, control: int, parameters: bytes) -> bytes:
        self.check()
        limit = self._settings.answer_timeout
        if not acquire_within(self._turn, 2.0 * limit):
            raise DeviceTimeout(f"{self.who} is busy with another question")
        try:
            port = self._port
            if port is None or self._loss is not None:
                raise ConnectionLost(f"the connection to {self.who} is lost", str(self._loss or ""))
            try:
                return port.ask(command, control, parameters, limit)
            except DeviceError as e:
                self._loss = e
                raise
        finally:
            self._turn.release()

    def _unpack(self, command: Command, answer: bytes, layout: str) -> tuple[Any, ...]:
        try:
            return struct.unpack("<" + layout, answer)
        except struct.error:
            name = command.name.lower()
            raise DeviceFault(
                f"{self.who} answered {name} with {len(answer)} bytes, not {struct.calcsize('<' + layout)}",
                answer.hex(" "),
            ) from None

    # -------------------------------------------------------------------------------- on the observing thread
    def _open(self, timeout: float) -> None:
        deadline = time.monotonic() + timeout
        with self._turn:
            port = self._port = Port(self.who, self._settings.port)
            # Three different questions: one that lags behind with answers to an earlier opening is found out.
            for command in (Command.VERSION, Command.SERIAL_NUMBER, Command.NAME):
                left = min(self._settings.answer_timeout, deadline - time.monotonic())
                port.ask(command, 0, b"", max(left, 0.01), first=command is not Command.VERSION)
            self._loss = None
            self._changed = -math.inf
            self._newest = None
            self._look(port)
            time.sleep(PERIOD)
            self._look(port)  # whether it moves is known from the first moment on

    def _close(self) -> None:
        with self._turn:
            port, self._port = self._port, None
            if port is not None:
                port.close()
        with self.came:
            self.came.notify_all()

    def _lost(self, _: DeviceError) -> None:
        self._tell_lost()
        with self.came:
            self.came.notify_all()

    def _watch(self, stopping: threading.Event) -> None:
        while not stopping.is_set():
            began = time.monotonic()
            with self._turn:
                if self._loss is not None:
                    raise self._loss
                port = self._port
                if port is None:
                    raise NotConnected(f"{self.who} is closed")
                self._look(port)
            with self.came:
                self.came.notify_all()
            stopping.wait(max(PERIOD - (time.monotonic() - began), 0.002))

    def _look(self, port: Port) -> None:
        limit, began = self._settings.answer_timeout, time.monotonic()
        # The index first: a motion that it tells to be done has its end in the pose.
        index = self._unpack(Command.QUEUE_INDEX, port.ask(Command.QUEUE_INDEX, 0, b"", limit), "Q")[0]
        pose = self._unpack(Command.POSE, port.ask(Command.POSE, 0, b"", limit), "8f")
        alarms = codes(port.ask(Command.ALARMS, 0, b"", limit))
        if not all(map(math.isfinite, pose)):
            raise DeviceFault(f"{self.who} tells a pose that is none", repr(pose))
        x, y, z, r, *angles = pose
        one, two, three, four = map(math.radians, angles)
        q = one, two, three, four
        before = self._newest
        if before is not None and max(abs(a - b) for a, b in zip(before.q, q, strict=True)) > STILL:
            self._changed = began
        if before is not None and RESET in alarms and RESET not in before.alarms:
            raise ConnectionLost(f"{self.who} was switched off and on")
        tool = Tool(x / 1000.0, y / 1000.0, z / 1000.0, math.radians(r))
        if before is None or before.alarms != alarms:
            stamp = now()
            self.since = {code: self.since.get(code, stamp) for code in alarms}
        self._newest = Sample(tool, q, alarms, index, began, began - self._changed)
