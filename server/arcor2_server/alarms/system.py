"""Alarms of the system: disk, clock, overload, certificate, and tablets that were lost during a run."""

import asyncio
import shutil
import time
from collections import deque
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

import structlog

from arcor2_hw.messages import Message
from arcor2_server.alarms.service import Alarms
from arcor2_server.background import BackgroundTasks
from arcor2_server.events import Connection, EventHub

log = structlog.get_logger(__name__)

PERIOD: Final = 1.0
"""Period of the checks of clock and load, s."""
SLOW_PERIOD: Final = 60.0
"""Period of the checks of disk and certificate, s."""
MIN_FREE_SPACE: Final = 512 * 1024 * 1024
"""Free space of the disk below which it counts as nearly full, bytes."""
MAX_CLOCK_JUMP: Final = 5.0
"""Change of the difference between the clock and the monotonic clock that counts as a jump, s."""
MAX_CHECK_DELAY: Final = 3.0
"""Delay of a check that shows that the server is overloaded, s."""
RECOVERED_AFTER: Final = 30.0
"""Time without such a delay after which the overload counts as ended, s."""
LAG_OF: Final = 60
"""Number of recent checks, of which the largest delay is shown as the lag of the event loop."""
CERTIFICATE_EXPIRES: Final = 14.0
"""Time before the certificate expires at which it is reported, days."""


class SystemAlarms:
    """Checks the computer periodically, and raises and ends its alarms.

    Args:
        alarms: records the alarms.
        hub: the connected clients.
        data_dir: the directory whose disk is checked.
        certificate: the certificate of the server, None without TLS.
        starter: returns the user who started the running program; empty if none runs.
        lost_nodes: returns the nodes that the open scene needs and that cannot be used, each with its objects.
    """

    def __init__(
        self,
        alarms: Alarms,
        hub: EventHub,
        data_dir: Path,
        certificate: Path | None,
        starter: Callable[[], str],
        lost_nodes: Callable[[], Mapping[str, list[str]]] = dict,
    ) -> None:
        self._alarms = alarms
        self._hub = hub
        self._data_dir = data_dir
        self._certificate = certificate
        self._starter = starter
        self._lost_nodes = lost_nodes
        self._lost: frozenset[str] = frozenset()
        self._lost_user = ""
        self._slow_until: float | None = None
        self._offset = time.time() - time.monotonic()
        self._late: deque[float] = deque([0.0], maxlen=LAG_OF)
        self._background = BackgroundTasks()
        hub.on_leave.append(self._left)

    @property
    def lag(self) -> float:
        """The largest delay of the event loop in the last minute, s."""
        return max(self._late)

    def start(self) -> None:
        """Start the checks."""
        self._background.spawn(self._watch(), "alarms of the system")

    async def close(self) -> None:
        """End the checks."""
        await self._background.cancel()

    async def _watch(self) -> None:
        checked_at = -SLOW_PERIOD
        while True:
            if time.monotonic() - checked_at >= SLOW_PERIOD:
                checked_at = time.monotonic()
                free, expires = await asyncio.to_thread(self._slow_values)
                self.check_disk(free)
                self.check_certificate(expires)
            due = time.monotonic() + PERIOD
            await asyncio.sleep(PERIOD)
            self.check_load(time.monotonic() - due)
            self.check_clock(time.time() - time.monotonic())
            self._check_tablet()
            self.check_nodes(self._lost_nodes())

    def _slow_values(self) -> tuple[int, datetime | None]:
        try:
            free = shutil.disk_usage(self._data_dir).free
        except OSError as error:
            log.warning("free space not read", directory=str(self._data_dir), reason=str(error))
            free = MIN_FREE_SPACE
        return free, None if self._certificate is None else _expires(self._certificate)

    def check_disk(self, free: int) -> None:
        """Check the free space of the disk, bytes."""
        text = Message.of("The disk of the server has only {free} MB left.", free=free // 1_000_000)
        self._alarms.system("disk_nearly_full", free < MIN_FREE_SPACE, text)

    def check_certificate(self, expires: datetime | None) -> None:
        """Check the time at which the certificate expires, None without one."""
        days = CERTIFICATE_EXPIRES if expires is None else (expires - datetime.now(UTC)).total_seconds() / 86400.0
        text = Message.of("The certificate of the server expires in {days:.0f} days.", days=max(0.0, days))
        self._alarms.system("certificate_expires", days < CERTIFICATE_EXPIRES, text)

    def check_load(self, late: float) -> None:
        """Check by how much a check was late, s."""
        self._late.append(max(0.0, late))
        moment = time.monotonic()
        if late > MAX_CHECK_DELAY:
            self._slow_until = moment + RECOVERED_AFTER
            self._alarms.system("server_overloaded", True, with_devices=True)
        elif self._slow_until is not None and moment > self._slow_until:
            self._slow_until = None
            self._alarms.system("server_overloaded", False)

    def check_clock(self, offset: float) -> None:
        """Check the difference between the clock and the monotonic clock, s."""
        jump, self._offset = offset - self._offset, offset
        if abs(jump) > MAX_CLOCK_JUMP:
            self._alarms.system(
                "clock_jumped", None, Message.of("The clock of the server jumped by {jump:.0f} s.", jump=jump)
            )

    def check_nodes(self, lost: Mapping[str, list[str]]) -> None:
        """Check the required nodes of the open scene. Each node that cannot be used has an alarm of its own."""
        for node in self._lost - lost.keys():
            self._alarms.system(f"node_lost:{node}", False)
        for node in sorted(lost.keys() - self._lost):
            names = ", ".join(lost[node])
            text = Message.of("The node {node} is not connected. Needed for: {objects}.", node=node, objects=names)
            self._alarms.system(f"node_lost:{node}", True, text)
        self._lost = frozenset(lost)

    def _left(self, client: Connection) -> None:
        """Raise an alarm if a user who started the running program has no other connection."""
        user = client.user
        if user and user == self._starter() and not self._connected(user, besides=client):
            self._lost_user = user
            text = Message.of("The screen of {user}, who started the program, is disconnected.", user=user)
            self._alarms.system("tablet_lost", True, text)

    def _check_tablet(self) -> None:
        if self._lost_user and (self._connected(self._lost_user) or self._starter() != self._lost_user):
            self._lost_user = ""
            self._alarms.system("tablet_lost", False)

    def _connected(self, user: str, besides: Connection | None = None) -> bool:
        return any(client.user == user for client in self._hub.clients if client is not besides)


def _expires(certificate: Path) -> datetime | None:
    from cryptography import x509  # slow to import, and not needed without TLS

    try:
        return x509.load_pem_x509_certificate(certificate.read_bytes()).not_valid_after_utc
    except (OSError, ValueError) as error:
        log.warning("certificate not read", file=str(certificate), reason=str(error))
        return None
