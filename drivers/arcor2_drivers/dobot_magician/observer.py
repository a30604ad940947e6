"""Observation of the arm about forty times per second, and commands on the same serial port."""

import math
import struct
import threading
import time
from typing import Any, Final

from arcor2_hw.data.base import Data, Timestamp, now
from arcor2_hw.exceptions import ConnectionLost, DeviceError, DeviceFault, DeviceTimeout, NotConnected
from arcor2_hw.keep_alive import acquire_within
from arcor2_hw.messages import device_at
from arcor2_hw.objects.state_observer import Snapshot, StateObserver

from .alarms import RESET, codes
from .frames import QUEUED, WRITE, Command
from .kinematics import Joints, Tool
from .port import Port
from .settings import DobotMagicianSettings

PERIOD: Final = 0.025
"""Time between readings, s: three short exchanges, which take 10 ms at 115200 baud."""
STANDSTILL_AFTER: Final = 0.1
"""Time without a change after which the arm is at standstill, s."""
STANDSTILL_CHANGE: Final = math.radians(0.005)
"""Change of a joint between two readings at standstill, rad."""
MAX_AGE: Final = 0.5
"""Maximum age of a sample, s."""


class Sample(Data, frozen=True):
    """State of the arm; `unchanged` is how long the joints have not moved, s."""

    tool: Tool
    q: Joints
    alarms: frozenset[int]
    index: int
    unchanged: float

    @property
    def moving(self) -> bool:
        """Return whether the arm moves."""
        return self.unchanged < STANDSTILL_AFTER


class Observer(StateObserver[Sample]):
    """Owns the port: reads the state on its own thread, and sends the commands of other threads.

    When an answer is overdue, the port is closed and opened again, so that a late answer is not taken for that to
    another command.
    """

    period = busy_period = PERIOD
    fresh_for = answers_within = MAX_AGE

    def __init__(self, name: str, settings: DobotMagicianSettings) -> None:
        super().__init__(device_at(name, settings.port))
        self.since: dict[int, Timestamp] = {}
        """Time at which each active alarm was first seen."""
        self._settings = settings
        self._lock = threading.Lock()
        self._port: Port | None = None
        self._error: DeviceError | None = None
        self._before: Sample | None = None
        self._moved_at = -math.inf

    def sample(self) -> Sample:
        """Return the latest sample. Raise NotConnected, ConnectionLost or Stale."""
        return self.current().value

    # -------------------------------------------------------------------------------- commands
    def get(self, command: Command, layout: str) -> tuple[Any, ...]:
        """Read values. Raise DeviceFault if the answer does not have the layout."""
        return self._unpack(command, self._ask(command, 0, b""), layout)

    def text(self, command: Command) -> str:
        """Read a text."""
        return self._ask(command, 0, b"").split(b"\0")[0].decode("ascii", "replace").strip()

    def raw(self, command: Command) -> bytes:
        """Read bytes."""
        return self._ask(command, 0, b"")

    def set(self, command: Command, layout: str = "", *values: float) -> None:
        """Execute a command immediately, bypassing the queue."""
        self._ask(command, WRITE, struct.pack("<" + layout, *values))

    def queue(self, command: Command, layout: str, *values: float) -> int:
        """Append a command to the arm's queue, and return its index."""
        answer = self._ask(command, WRITE | QUEUED, struct.pack("<" + layout, *values))
        return int(self._unpack(command, answer, "Q")[0])

    def _ask(self, command: Command, control: int, parameters: bytes) -> bytes:
        self.observing.check()
        limit = self._settings.answer_timeout
        if not acquire_within(self._lock, 2.0 * limit):
            raise DeviceTimeout("{device} is busy with another command.", device=self.who)
        try:
            if self._port is None or self._error is not None:
                raise ConnectionLost("The connection to {device} is lost.", str(self._error or ""), device=self.who)
            try:
                return self._port.ask(command, control, parameters, limit)
            except DeviceError as e:
                self._error = e
                raise
        finally:
            self._lock.release()

    def _unpack(self, command: Command, answer: bytes, layout: str) -> tuple[Any, ...]:
        try:
            return struct.unpack("<" + layout, answer)
        except struct.error:
            raise DeviceFault(
                "{device} answered {name} with {size} bytes instead of {expected}.",
                answer.hex(" "),
                device=self.who,
                name=command.name.lower(),
                size=len(answer),
                expected=struct.calcsize("<" + layout),
            ) from None

    # -------------------------------------------------------------------------------- on the observing thread
    def open(self, timeout: float) -> Snapshot[Sample]:
        """Open the port, and read the state twice to detect whether the arm moves."""
        deadline = time.monotonic() + timeout
        with self._lock:
            port = self._port = Port(self.who, self._settings.port)
            # Three different commands detect an arm that still answers those of an earlier connection.
            for command in (Command.VERSION, Command.SERIAL_NUMBER, Command.NAME):
                left = min(self._settings.answer_timeout, deadline - time.monotonic())
                port.ask(command, 0, b"", max(left, 0.01), first=command is not Command.VERSION)
            self._error = self._before = None
            self._moved_at = -math.inf
            self._read(port)
            time.sleep(PERIOD)
            return Snapshot.by(lambda: self._read(port))

    def close(self) -> None:
        """Close the port."""
        with self._lock:
            port, self._port = self._port, None
            if port is not None:
                port.close()

    def read(self) -> Sample:
        """Read the state. Raise the error that a command has detected."""
        with self._lock:
            if self._error is not None:
                raise self._error
            if self._port is None:
                raise NotConnected("{device} is closed.", device=self.who)
            return self._read(self._port)

    def _read(self, port: Port) -> Sample:
        limit, started = self._settings.answer_timeout, time.monotonic()
        # The index first: the pose is then at least as new as the end of a motion that the index reports.
        index = self._unpack(Command.QUEUE_INDEX, port.ask(Command.QUEUE_INDEX, 0, b"", limit), "Q")[0]
        pose = self._unpack(Command.POSE, port.ask(Command.POSE, 0, b"", limit), "8f")
        alarms = codes(port.ask(Command.ALARMS, 0, b"", limit))
        if not all(map(math.isfinite, pose)):
            raise DeviceFault("{device} reports an invalid pose.", repr(pose), device=self.who)
        x, y, z, r, *angles = pose
        one, two, three, four = map(math.radians, angles)
        q = one, two, three, four
        before = self._before
        if before is not None and max(abs(a - b) for a, b in zip(before.q, q, strict=True)) > STANDSTILL_CHANGE:
            self._moved_at = started
        if before is not None and RESET in alarms and RESET not in before.alarms:
            raise ConnectionLost("{device} was switched off and on.", device=self.who)
        if before is None or before.alarms != alarms:
            stamp = now()
            self.since = {code: self.since.get(code, stamp) for code in alarms}
        tool = Tool(x / 1000.0, y / 1000.0, z / 1000.0, math.radians(r))
        self._before = Sample(tool, q, alarms, index, started - self._moved_at)
        return self._before
