"""The observer of the drive: reads its state by PDO or SDO, and sends our heartbeat."""

import time
from collections.abc import Callable
from typing import Final

from arcor2_hw.data.base import Timestamp, now
from arcor2_hw.exceptions import ConnectionLost, DeviceError, DeviceFault
from arcor2_hw.messages import Phrase
from arcor2_hw.objects.state_observer import Snapshot, StateObserver

from . import cia402, pdo
from .cia402 import State
from .link import EMCY, HEARTBEAT, OPERATIONAL, CanLink
from .settings import ConveyorSettings

PDO_MISSED: Final = 0.1
"""Time beyond its period after which a missing PDO is replaced by reading by SDO, s."""


class Observer(StateObserver[State]):
    """Keeps the newest state. It sends only our heartbeat, while `guarded`.

    Args:
        name: Name of the conveyor.
        settings: The settings.
        lost: Called with the reason when control ends.
    """

    period = 0.05
    busy_period = 0.01

    def __init__(self, name: str, settings: ConveyorSettings, lost: Callable[[str], None]) -> None:
        self._settings = settings
        self.link = CanLink(name, settings, self._hear)
        self.answers_within = 6.0 * settings.sdo_timeout
        super().__init__(self.link.who)
        self.guarded = False
        """Whether the drive monitors our heartbeat."""
        self.emergency = 0
        """Code of the newest EMCY that was not cancelled."""
        self.emergency_since: Timestamp = now()
        self.consumer = 0
        """Object 1016h:01 as last read: node and ms of the heartbeat that the drive monitors."""
        self.nmt: int | None = None
        """NMT state in the heartbeat of the drive: 5 Operational, 127 Pre-operational, 4 Stopped; None before the first
        one."""
        self.pdos = pdo.PdoState(settings.node_id)
        self._by_pdo = False
        self._drop_control = lost
        self._beat = 0.0
        self._masters: dict[int, float] = {}
        self._opened = False

    def disconnect(self) -> None:
        """Stop observing; does nothing when stopped."""
        self.guarded = False
        super().disconnect()

    def received_heartbeat(self, master: int, within: float) -> bool:
        """Return whether a heartbeat of node `master` came within the last `within` s; we do not receive our own."""
        return time.monotonic() - self._masters.get(master, -1e9) <= within

    def listen(self) -> None:
        """Make the drive send its state by PDO if the settings require it. Raises Refused if it cannot."""
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
                self.link.lose(
                    ConnectionLost("{device} was reset or switched off and on: it has booted", device=self.who)
                )
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
            self.link.lose(DeviceFault("{device} sent invalid values: {reason}", device=self.who, reason=error))
            return None

    def _hear_nmt(self, state: int) -> None:
        before, self.nmt = self.nmt, state
        if self.guarded and before == OPERATIONAL[0] != state:
            # Another host commands the node; the drive has reacted as configured in 6007h.
            self._drop_control(Phrase.of("another host has changed the NMT state of the drive"))
            self.wake()

    # -------------------------------------------------------------------------------- on the observing thread
    def open(self, timeout: float) -> Snapshot[State]:
        """Open the bus and check that a drive answers."""
        deadline = time.monotonic() + timeout
        self._opened = self._by_pdo = False
        self.nmt = None
        self.link.open(timeout)
        left = deadline - time.monotonic()
        profile = self.link.read_first(cia402.DEVICE_TYPE, left, lambda: self.ending) & 0xFFFF
        if profile != cia402.PROFILE:
            raise DeviceFault(
                "{device} is not a drive: its device profile is {profile}, not {expected}",
                device=self.who,
                profile=profile,
                expected=cia402.PROFILE,
            )
        self.link.read(cia402.VENDOR)  # drains late answers, see CanLink
        self.emergency = 0
        self._opened = True  # from now on a boot counts as a loss
        return Snapshot.by(self._ask)

    def read(self) -> State | None:
        """Read the state by SDO. Return None while the drive sends it by PDO."""
        if self.link.loss is not None:
            self.link.check()
        missed = PDO_MISSED + self._settings.pdo_period_ms / 1000.0
        if self._by_pdo and time.monotonic() - self.pdos.newest <= missed:
            return None
        return self._ask()

    def close(self) -> None:
        """Close the bus."""
        self.link.close()

    def after_reading(self) -> None:
        """Send our heartbeat when it is due: the drive has just answered."""
        clock = time.monotonic()
        if self.guarded and clock - self._beat >= self._settings.heartbeat_ms / 6000.0:
            self.link.heartbeat()
            self._beat = clock

    def _ask(self) -> State:
        read = self.link.read
        self.consumer = read(cia402.CONSUMER_HEARTBEAT)
        values = [
            read(entry)
            for entry in (cia402.STATUSWORD, cia402.MODE_DISPLAY, cia402.POSITION, cia402.VELOCITY, cia402.ERROR_CODE)
        ]
        try:
            return State.of(*values)
        except ValueError as error:
            raise DeviceFault("{device} sent invalid values: {reason}", device=self.who, reason=error) from error

    def on_state(self, snapshot: Snapshot[State]) -> None:
        """Record the time of a new fault."""
        code, before = snapshot.value.error_code, self.newest()
        if code and (before is None or before.error_code != code):
            self.emergency_since = now()

    def on_lost(self, error: DeviceError) -> None:
        """End control: without our heartbeat the drive stops by itself."""
        self._drop_control(Phrase.of("control ended when the connection was lost"))
