"""Reads the controller's state, every sample of it, in one thread, into a ring; everybody else reads from there."""

import collections
import threading
import time
from typing import Final, NamedTuple

from arcor2_hw.exceptions import ConnectionLost, DeviceError, DeviceTimeout, NotConnected, Stale
from arcor2_hw.keep_alive import RunningTime
from arcor2_hw.objects.observing import Observing

from .program import STATES
from .rtde import PORT, RtdeStream, Version
from .states import MAY_MOVE_MODES

FIELDS: Final = [
    "timestamp",
    "actual_q",
    "actual_qd",
    "actual_TCP_pose",
    "actual_TCP_force",
    "robot_mode",
    "safety_mode",
    "runtime_state",
    "target_speed_fraction",
    "actual_digital_input_bits",
    "actual_digital_output_bits",
    "output_int_register_2",
    "output_int_register_26",
    "output_int_register_18",
    "output_int_register_42",
]
"""The handful that is used, in the order in which `Sample` has them."""
STALLED: Final = 0.8
"""Seconds without a new sample after which the connection is given up; the library itself needs 2.5 to notice."""
FRESH: Final = 0.1
"""Seconds: how old a sample may be by default; 50 samples of an e-series, 12 of a CB3."""
AWAITED: Final = 0.5
"""Seconds that a caller waits for a fresh sample: this process, or the observing thread, may not have had its turn."""
KEPT: Final = 1024
"""Samples in the ring: two seconds."""
_LOOK: Final = 0.1
"""Seconds the reader waits for a sample before it looks whether it should end."""


class Sample(NamedTuple):
    """One sample: the controller's time, ours (monotonic), and what is known then (rad, m, rad/s, N, N m)."""

    timestamp: float
    monotonic: float
    q: tuple[float, ...]
    qd: tuple[float, ...]
    tcp: tuple[float, ...]
    force: tuple[float, ...]
    robot_mode: int
    safety_mode: int
    runtime: int
    speed_fraction: float
    inputs: int
    outputs: int
    asynchronous_lower: int
    asynchronous_upper: int
    run_lower: int
    run_upper: int

    @property
    def age(self) -> float:
        """Give the seconds since it was taken."""
        return time.monotonic() - self.monotonic

    @property
    def moving(self) -> bool:
        """Tell whether a joint moves."""
        return max(map(abs, self.qd)) > AT_REST

    def operation(self, upper: bool) -> tuple[int, bool]:
        """Give number and "running" of the control program's asynchronous operation, from its status register.

        Bit 15 says running, bits 24 to 30 count the operations begun.
        """
        status = self.asynchronous_upper if upper else self.asynchronous_lower
        return status >> 24 & 0x7F, bool(status & 1 << 15)

    def run(self, upper: bool) -> tuple[int, int]:
        """Give number and state of the newest run of a program of our own."""
        return divmod(self.run_upper if upper else self.run_lower, STATES)


AT_REST: Final = 1e-3
"""rad/s below which a joint counts as standing: the noise of the encoders of a real arm at rest."""


class Observer:
    """The observed controller. It never writes."""

    def __init__(self, name: str, host: str) -> None:
        self.name = name
        self.host = host
        self.address = f"{host}:{PORT}"
        self.who = f"{name} (UR controller {self.address})"
        self.version: Version = (0, 0, 0, 0)
        self.period = 0.002
        self.samples_received = 0
        self.samples_missed = 0
        self.ring: collections.deque[Sample] = collections.deque(maxlen=KEPT)
        self.unsafe: Sample | None = None
        """The newest sample in which the safety system forbade motion; a short stop is not missed by a slow reader."""
        self._newest: Sample | None = None
        self._stream: RtdeStream | None = None
        self.observing = Observing(f"{name} at {self.address}", self._open, self._watch, self._close)

    def connect(self, timeout: float) -> None:
        """Begin to observe. Raises NotConnected, DeviceTimeout, ConnectionLost, each naming host and port."""
        self.observing.start(timeout)

    def disconnect(self) -> None:
        """Stop observing; harmless when it was not."""
        self.observing.stop()

    def newest(self) -> Sample | None:
        """Give the newest sample, however old."""
        return self._newest

    def sample(self, max_age: float = FRESH) -> Sample:
        """Give the newest sample, waiting a moment for one that is fresh.

        Raises NotConnected, ConnectionLost, or Stale when none comes that is as fresh as asked for.
        """
        newest = self.newest()
        if newest is not None and newest.age <= max_age and self.observing.online:
            return newest
        clock = RunningTime()
        while True:
            self.observing.check()
            newest = self.newest()  # it may have come, and the connection back with it, since the first look
            if newest is None:
                raise NotConnected(f"{self.who} has sent no sample yet")
            if newest.age <= max_age:
                return newest
            if clock() > AWAITED:
                break
            time.sleep(self.period)
        raise Stale(f"the newest sample of {self.who} is {newest.age:.2f} s old, {max_age:g} s asked for")

    # -------------------------------------------------------------------------------- on the observing thread
    def _open(self, timeout: float) -> None:
        deadline = time.monotonic() + timeout
        try:
            self._stream = stream = RtdeStream.open(self.host, FIELDS, timeout)
        except DeviceError as e:
            raise type(e)(f"{self.name}: {e}", e.detail) from e
        self.version = stream.version
        self.period = 0.002 if self.version[0] >= 5 else 0.008
        self.ring = collections.deque(maxlen=KEPT)  # others may be reading the old one
        while not self.ring:
            left = deadline - time.monotonic()
            if left <= 0.0:
                raise DeviceTimeout(f"{self.who} sends no samples")
            self._take(stream, left)

    def _close(self) -> None:
        stream, self._stream = self._stream, None
        if stream is not None:
            stream.close()

    def _watch(self, stopping: threading.Event) -> None:
        stream = self._stream
        assert stream is not None
        empty = 0  # looks, not seconds: while this process stands still nothing is missed
        while not stopping.is_set():
            empty = 0 if self._take(stream, _LOOK) else empty + 1
            if empty * _LOOK >= STALLED:
                raise ConnectionLost(f"{self.who} has sent nothing for {STALLED:g} s")

    def _take(self, stream: RtdeStream, wait: float) -> bool:
        """Put what has come into the ring; false when nothing has."""
        rows = stream.read(wait)
        now = time.monotonic()
        for row in rows:
            timestamp = row[0]
            last = self.ring[-1].timestamp if self.ring else timestamp - self.period
            parts = row[1:7], row[7:13], row[13:19], row[19:25]
            self._newest = Sample(timestamp, now, *parts, *row[25:])  # type: ignore[arg-type]
            if self._newest.safety_mode not in MAY_MOVE_MODES:
                self.unsafe = self._newest
            self.ring.append(self._newest)
            self.samples_received += 1
            if timestamp > last:
                self.samples_missed += max(round((timestamp - last) / self.period) - 1, 0)
        return bool(rows)

    def lost_by(self) -> DeviceError | None:
        """Give why the controller is not observed, None when it is."""
        try:
            self.observing.check()
        except DeviceError as e:
            return e
        return None
