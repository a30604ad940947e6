"""The observed drive: its state by PDO while it sends that, else by SDO; and our heartbeat while it is heard."""

import time
from collections.abc import Callable
from typing import Final

from arcor2_hw.data.base import Timestamp, now
from arcor2_hw.exceptions import ConnectionLost, DeviceError, DeviceFault
from arcor2_hw.objects.polled import Polled, Snapshot

from . import cia402, pdo
from .cia402 import State
from .link import EMCY, HEARTBEAT, OPERATIONAL, CanLink
from .settings import ConveyorSettings

QUIET_PERIOD: Final = 0.05
"""s between readings while nobody waits."""
BUSY_PERIOD: Final = 0.01
"""s between readings while somebody waits for a change."""
FRESH: Final = 0.5
"""s: how old a state may be that is told."""
PDO_MISSED: Final = 0.1
"""s, beyond its period, after which a PDO that does not come is asked after by SDO."""


class Observer(Polled[State]):
    """Keeps the newest state. It writes nothing but our heartbeat, while `guarded`."""

    def __init__(self, name: str, settings: ConveyorSettings, lost: Callable[[], None]) -> None:
        self._settings = settings
        self.link = CanLink(name, settings, self._hear)
        super().__init__(
            self.link.who,
            self._open_drive,
            self._read_state,
            self.link.close,
            quiet=QUIET_PERIOD,
            busy=BUSY_PERIOD,
            fresh=FRESH,
            answers_within=6.0 * settings.sdo_timeout,
            taken=self._note,
            after=self.keep_alive,
            lost=self._end_control,
        )
        self.guarded = False
        """Whether the drive listens for our heartbeat."""
        self.emergency = 0
        """Code of the newest EMCY that was not taken back."""
        self.emergency_since: Timestamp = now()
        self.consumer = 0
        """1016h:01 as last read: node and ms of the heartbeat that the drive listens for."""
        self.nmt: int | None = None
        """NMT state of the drive by its heartbeat: 5 Operational, 127 Pre-operational, 4 Stopped; None: never heard."""
        self.pdos = pdo.PdoState(settings.node_id)
        self._by_pdo = False
        self._drop_control = lost
        self._beat = 0.0
        self._masters: dict[int, float] = {}
        self._opened = False

    def disconnect(self) -> None:
        """Stop observing; harmless when it was not."""
        self.guarded = False
        super().disconnect()

    def heard(self, master: int, within: float) -> bool:
        """Tell whether a heartbeat of node `master` came in the last `within` s; ours does not come back to us."""
        return time.monotonic() - self._masters.get(master, -1e9) <= within

    def listen(self) -> None:
        """Have the drive send its state by PDO, when the settings say so. Raises Refused when it cannot."""
        if self._settings.pdo_period_ms:
            pdo.set_up(self.link, self._settings.node_id, self._settings.pdo_period_ms)
            self._by_pdo = True

    # -------------------------------------------------------------------------------- on the receiving thread
    def _hear(self, identifier: int, data: bytes) -> None:
        node = self._settings.node_id
        if self._by_pdo and (came := self._unpack(identifier, data)) is not None:
            self.put(*came)
        elif identifier == HEARTBEAT + node and data == b"\x00":
            if self._opened:
                self.link.lose(ConnectionLost(f"{self.who} was reset or switched off and on: it has booted"))
        elif identifier == HEARTBEAT + node and len(data) == 1:
            self._hear_nmt(data[0] & 0x7F)
        elif HEARTBEAT < identifier <= HEARTBEAT + 127:
            self._masters[identifier - HEARTBEAT] = time.monotonic()
        elif identifier == EMCY + node and len(data) == 8:
            self.emergency = int.from_bytes(data[:2], "little")
            self.emergency_since = now()
            self.hurry()

    def _unpack(self, identifier: int, data: bytes) -> tuple[State, float] | None:
        try:
            return self.pdos.take(identifier, data)
        except ValueError as error:
            self.link.lose(DeviceFault(f"{self.who} tells what no drive tells: {error}"))
            return None

    def _hear_nmt(self, state: int) -> None:
        before, self.nmt = self.nmt, state
        if self.guarded and before == OPERATIONAL[0] != state:
            # Somebody else commands the node; what 6007h says has happened in the drive.
            self.guarded = False
            self._drop_control()
            self.wake()

    # -------------------------------------------------------------------------------- on the observing thread
    def _open_drive(self, timeout: float) -> Snapshot[State]:
        deadline = time.monotonic() + timeout
        self._opened = self._by_pdo = False
        self.nmt = None
        self.link.open(timeout)
        left = deadline - time.monotonic()
        profile = self.link.read_first(cia402.DEVICE_TYPE, left, lambda: self.ending) & 0xFFFF
        if profile != cia402.PROFILE:
            raise DeviceFault(f"{self.who} is no drive: it has the device profile {profile}, not {cia402.PROFILE}")
        self.link.read(cia402.VENDOR)  # drains what is late, see CanLink
        self.emergency = 0
        self._opened = True  # from now on a boot is a loss
        return Snapshot.by(self._ask)

    def _read_state(self) -> State | None:
        if self.link.loss is not None:
            self.link.check()
        missed = PDO_MISSED + self._settings.pdo_period_ms / 1000.0
        if self._by_pdo and time.monotonic() - self.pdos.newest <= missed:
            return None
        return self._ask()

    def keep_alive(self) -> None:
        """Send our heartbeat when it is due. Called only when the drive was just heard."""
        clock = time.monotonic()
        if self.guarded and clock - self._beat >= self._settings.heartbeat_ms / 6000.0:
            self.link.heartbeat()
            self._beat = clock

    def _ask(self) -> State:
        read = self.link.read
        self.consumer = read(cia402.CONSUMER_HEARTBEAT)
        values = [
            read(entry)
            for entry in (
                cia402.STATUSWORD,
                cia402.MODE_DISPLAY,
                cia402.POSITION,
                cia402.VELOCITY,
                cia402.ERROR_CODE,
            )
        ]
        try:
            return State.of(*values)
        except ValueError as error:
            raise DeviceFault(f"{self.who} tells what no drive tells: {error}") from error

    def _note(self, snapshot: Snapshot[State]) -> None:
        code, before = snapshot.value.error_code, self.newest()
        if code and (before is None or before.error_code != code):
            self.emergency_since = now()

    def _end_control(self, _: DeviceError) -> None:
        self.guarded = False  # no heartbeat: the drive stops by itself
        self._drop_control()
