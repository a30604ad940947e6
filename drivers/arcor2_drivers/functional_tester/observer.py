"""The observed tester: one thread reads its state over and over, which also keeps its host watchdog quiet."""

import time
from collections.abc import Callable
from typing import Final

from arcor2_hw.data.base import Timestamp, now
from arcor2_hw.exceptions import DeviceError, DeviceFault, NotConnected, Stale
from arcor2_hw.objects.modbus_link import ModbusLink
from arcor2_hw.objects.polled import Polled, Snapshot

from .registers import DISCRETE_COUNT, HOLDING_COUNT, INPUT_COUNT, RUNNING, Inputs, decode
from .settings import FunctionalTesterSettings

QUIET_PERIOD: Final = 0.1
"""s between readings while nobody waits."""
BUSY_PERIOD: Final = 0.02
"""s between readings while somebody waits for a change."""
FRESH: Final = 0.5
"""s: how old a state may be that is told."""
LIFE_STANDS: Final = 1.0
"""s: the life counter counts ten times a second; when it stands that long, somebody else than the tester answers."""
NOTICED: Final = 0.2
"""s beyond the watchdog after which the tester has surely noticed that we were gone."""


class Observer(Polled[Inputs]):
    """Keeps the newest state. It never writes."""

    def __init__(self, name: str, settings: FunctionalTesterSettings, lost: Callable[[], None]) -> None:
        self._settings = settings
        self.link = ModbusLink(name, settings.host, settings.port, settings.unit_id, settings.request_timeout)
        super().__init__(
            self.link.who,
            self._open_tester,
            self._read_inputs,
            self.link.close,
            quiet=QUIET_PERIOD,
            busy=BUSY_PERIOD,
            fresh=FRESH,
            # Two readings, each asked for twice, and a connection opened anew in between.
            answers_within=6.0 * settings.request_timeout,
            taken=self._note,
            lost=self._leave_alone,
            interrupt=self.link.close,
        )
        self.guarded = False
        """Whether the tester's host watchdog guards a test: then it must be able to notice a loss."""
        self.fault_since: Timestamp = now()
        self._drop_control = lost
        self._leave_alone_until = 0.0
        self._life = (-1, 0.0)

    def connect(self, timeout: float) -> None:
        """Begin to observe. Raises NotConnected, DeviceTimeout, DeviceFault, ConnectionLost."""
        self._leave_alone_until = 0.0
        super().connect(timeout)

    def current(self) -> Snapshot[Inputs]:
        """Give the newest state. Raises NotConnected, ConnectionLost, or Stale when it is too old to count."""
        newest = super().current()
        value, since = self._life
        if (stands := time.monotonic() - since) > LIFE_STANDS:
            raise Stale(f"{self.who} answers, but its life counter has stood at {value} for {stands:.1f} s")
        return newest

    def read_holding(self) -> list[int]:
        """Read all holding registers."""
        return self.link.read_holding_registers(0, HOLDING_COUNT)

    # -------------------------------------------------------------------------------- on the observing thread
    def _open_tester(self, timeout: float) -> Snapshot[Inputs]:
        left_alone = self._leave_alone_until - time.monotonic()
        if left_alone > 0.0:
            raise NotConnected(f"{self.who} is left alone for {left_alone:.1f} s, so that it notices that we were gone")
        deadline = time.monotonic() + timeout
        self.link.open(timeout)
        self._life = (-1, 0.0)
        # Each of the two readings may be asked for twice.
        first = min(self._settings.request_timeout, max(0.05, (deadline - time.monotonic()) / 4.0))
        return Snapshot.by(lambda: self._read_inputs(first))

    def _read_inputs(self, timeout: float | None = None) -> Inputs:
        registers = self.link.read_input_registers(0, INPUT_COUNT, timeout)
        bits = self.link.read_discrete_inputs(0, DISCRETE_COUNT, timeout)
        try:
            return decode(registers, bits)
        except ValueError as error:
            raise DeviceFault(f"{self.who} tells what no tester of this kind tells: {error}") from error

    def _note(self, snapshot: Snapshot[Inputs]) -> None:
        inputs, before = snapshot.value, self.newest()
        if inputs.life != self._life[0]:
            self._life = (inputs.life, time.monotonic())
        if inputs.fault_code and (before is None or before.fault_code != inputs.fault_code):
            self.fault_since = now()

    def _leave_alone(self, _: DeviceError) -> None:
        newest = self.newest()
        if self.guarded and newest is not None and newest.state in RUNNING:
            # Asking again would keep a test alive that nobody waits for any more: the station ends it by itself.
            self._leave_alone_until = self.link.sent + self._settings.watchdog_ms / 1000.0 + NOTICED
        self._drop_control()
