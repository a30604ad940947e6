"""Observation of the controller: one thread reads every sample of the RTDE stream into a ring."""

import collections
import threading
import time
from typing import Final, NamedTuple

from arcor2_hw.exceptions import ConnectionLost, DeviceError, DeviceTimeout, NotConnected, Stale
from arcor2_hw.keep_alive import RunningTime
from arcor2_hw.messages import Message, device_at
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
"""Variables of the recipe, in the order of the fields of `Sample`."""
SAMPLE_TIMEOUT: Final = 0.8
"""Time without a sample after which the connection is lost, s; the library itself needs 2.5 s to notice."""
MAX_SAMPLE_AGE: Final = 0.1
"""Maximum age of a sample by default, s: 50 samples of an e-series, 12 of a CB3."""
FRESH_SAMPLE_TIMEOUT: Final = 0.5
"""Time to wait for a fresh sample, s: a busy computer may delay the reading thread."""
MAX_SAMPLES: Final = 1024
"""Number of samples stored: two seconds."""
READ_TIMEOUT: Final = 0.1
"""Time to wait for a sample before checking whether to end, s."""
STANDSTILL_SPEED: Final = 1e-3
"""Joint speed below which a joint is at standstill, rad/s: the noise of a real arm's encoders."""


class Sample(NamedTuple):
    """One sample: the controller's time, ours (monotonic), and the state at that time (rad, m, rad/s, N, N m)."""

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
        """Return the time since the sample was received, s."""
        return time.monotonic() - self.monotonic

    @property
    def moving(self) -> bool:
        """Return whether a joint moves."""
        return max(map(abs, self.qd)) > STANDSTILL_SPEED

    def operation(self, upper: bool) -> tuple[int, bool]:
        """Return number and "running" of the control program's asynchronous operation, from its status register.

        Bit 15 is "running", bits 24 to 30 count the operations started.
        """
        status = self.asynchronous_upper if upper else self.asynchronous_lower
        return status >> 24 & 0x7F, bool(status & 1 << 15)

    def run(self, upper: bool) -> tuple[int, int]:
        """Return number and state of the latest run of a motion program."""
        return divmod(self.run_upper if upper else self.run_lower, STATES)


class Observer:
    """Observes the controller. It never writes."""

    def __init__(self, name: str, host: str) -> None:
        self.name = name
        self.host = host
        self.address = f"{host}:{PORT}"
        self.who = Message.of("{name} (UR controller {address})", name=name, address=self.address)
        self.version: Version = (0, 0, 0, 0)
        self.period = 0.002
        self.samples_received = 0
        self.samples_missed = 0
        self.ring: collections.deque[Sample] = collections.deque(maxlen=MAX_SAMPLES)
        self.unsafe: Sample | None = None
        """Latest sample in which the safety system prevented motion, so that a slow reader does not miss a short
        stop."""
        self._newest: Sample | None = None
        self._stream: RtdeStream | None = None
        self.observing = Observing(device_at(name, self.address), self._open, self._watch, self._close)

    def newest(self) -> Sample | None:
        """Return the latest sample, even if it is outdated; None before the first."""
        return self._newest

    def sample(self, max_age: float = MAX_SAMPLE_AGE) -> Sample:
        """Return the latest sample, waiting briefly for one that is fresh.

        Raises:
            NotConnected: The controller is not observed.
            ConnectionLost: The connection is lost.
            Stale: No sample of at most `max_age` s arrived in time.
        """
        newest = self.newest()
        if newest is not None and newest.age <= max_age and self.observing.online:
            return newest
        clock = RunningTime()
        while True:
            self.observing.check()
            newest = (
                self.newest()
            )  # since the first check, a sample may have arrived, or the connection may have been restored
            if newest is None:
                raise NotConnected("{device} has sent no sample yet.", device=self.who)
            if newest.age <= max_age:
                return newest
            if clock() > FRESH_SAMPLE_TIMEOUT:
                break
            time.sleep(self.period)
        raise Stale(
            "The latest sample of {device} is {age:.2f} s old; at most {max_age:g} s is allowed.",
            device=self.who,
            age=newest.age,
            max_age=max_age,
        )

    # -------------------------------------------------------------------------------- on the observing thread
    def _open(self, timeout: float) -> None:
        deadline = time.monotonic() + timeout
        try:
            self._stream = stream = RtdeStream.open(self.host, FIELDS, timeout)
        except DeviceError as e:
            raise e.with_message(Message.of("{name}: {reason}", name=self.name, reason=e)) from e
        self.version = stream.version
        self.period = 0.002 if self.version[0] >= 5 else 0.008
        self.ring = collections.deque(maxlen=MAX_SAMPLES)  # other threads may be reading the old one
        while not self.ring:
            left = deadline - time.monotonic()
            if left <= 0.0:
                raise DeviceTimeout("{device} sends no samples.", device=self.who)
            self._receive(stream, left)

    def _close(self) -> None:
        stream, self._stream = self._stream, None
        if stream is not None:
            stream.close()

    def _watch(self, stopping: threading.Event) -> None:
        stream = self._stream
        assert stream is not None
        empty = 0  # counts reads instead of seconds, because this process may not have been scheduled for some time
        while not stopping.is_set():
            empty = 0 if self._receive(stream, READ_TIMEOUT) else empty + 1
            if empty * READ_TIMEOUT >= SAMPLE_TIMEOUT:
                raise ConnectionLost(
                    "{device} has sent nothing for {stalled:g} s.", device=self.who, stalled=SAMPLE_TIMEOUT
                )

    def _receive(self, stream: RtdeStream, wait: float) -> bool:
        """Store the samples that have arrived; return False if there are none."""
        rows = stream.read(wait)
        now = time.monotonic()
        for row in rows:
            timestamp = row[0]
            last = self.ring[-1].timestamp if self.ring else timestamp - self.period
            vectors = row[1:7], row[7:13], row[13:19], row[19:25]
            self._newest = Sample(timestamp, now, *vectors, *row[25:])  # type: ignore[arg-type]
            if self._newest.safety_mode not in MAY_MOVE_MODES:
                self.unsafe = self._newest
            self.ring.append(self._newest)
            self.samples_received += 1
            if timestamp > last:
                self.samples_missed += max(round((timestamp - last) / self.period) - 1, 0)
        return bool(rows)
