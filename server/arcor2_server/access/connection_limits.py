"""Limits on connections, so that clients without a token cannot exhaust the file descriptors."""

import ipaddress
import resource
from collections.abc import Callable, Iterable
from typing import Final

import structlog

from arcor2_server.settings import ServerSettings

log = structlog.get_logger(__name__)

CONNECTION: Final = "arcor2_hw.connection"
"""Key of the Connection in the extensions of an ASGI scope."""
OWN_FILES: Final = 256
"""Number of file descriptors reserved for databases, cell hosts, packages and uploads."""
MAX_CONNECTIONS: Final = 4000
"""Maximum number of connections, even if the system allows more files."""
FEWEST: Final = 64
"""Minimum number of connections, even if the system allows fewer files."""
RESERVE: Final = 4
"""Divisor of the total number of connections. One part is reserved for admitted clients."""


class Connection:
    """One accepted connection. Until its client is admitted, it may be dropped for a new connection."""

    __slots__ = ("_limits", "address", "admitted", "drop")

    def __init__(self, limits: "ConnectionLimits", address: str) -> None:
        self._limits = limits
        self.address = address
        self.admitted = False
        self.drop: Callable[[], object] = lambda: None
        """Function that closes the connection at once, set by the present owner of the connection."""

    def admit(self) -> None:
        """Count the connection among the admitted ones, which are never dropped."""
        self._limits.admit(self)

    def wait(self) -> None:
        """Count the connection as the newest waiting one."""
        self._limits.wait(self)

    def close(self) -> None:
        """Stop counting the connection. Does nothing if it is closed already."""
        self._limits.close(self)


class ConnectionLimits:
    """Counts connections. If there are too many, the unadmitted connection that has waited longest is dropped.

    Args:
        total: maximum number of connections; a quarter of them is reserved for admitted clients.
        per_address: maximum number of unadmitted connections from one address.
        proxies: addresses and networks of proxies. The limit per address does not apply to them, since they forward
            the connections of many clients.
    """

    def __init__(self, total: int, per_address: int, proxies: Iterable[str] = ()) -> None:
        self.total = total
        self._waiting_at_most = total - total // RESERVE
        self._per_address = per_address
        self._proxies = [ipaddress.ip_network(proxy) for proxy in proxies]
        self._waiting: dict[str, dict[Connection, None]] = {}
        self._open: set[Connection] = set()
        self._waiting_count = 0
        self.dropped = 0
        """Connections that were dropped or refused so far."""

    @classmethod
    def of(cls, settings: ServerSettings) -> "ConnectionLimits":
        """Return the limits for these settings and the number of files that this process may open."""
        allowed, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
        files = MAX_CONNECTIONS + OWN_FILES if allowed == resource.RLIM_INFINITY else allowed
        total = settings.connections or max(FEWEST, min(MAX_CONNECTIONS, files - OWN_FILES))
        return cls(total, settings.connections_per_address, settings.trusted_proxies)

    def __len__(self) -> int:
        return len(self._open)

    def open(self, address: str) -> Connection | None:
        """Return a new waiting connection, None if there are too many admitted clients."""
        from_address = self._waiting.get(address, {})
        if len(from_address) >= self._per_address and not self._is_proxy(address):
            self._drop(from_address)
        elif self._waiting_count >= self._waiting_at_most or len(self._open) >= self.total:
            if not self._waiting_count:
                self._note_drop("connection refused: too many clients", address)
                return None
            self._drop(max(self._waiting.values(), key=len))
        connection = Connection(self, address)
        self._open.add(connection)
        self._add(connection)
        return connection

    def admit(self, connection: Connection) -> None:
        """Count a connection among the admitted ones."""
        if connection in self._open and not connection.admitted:
            self._remove(connection)
            connection.admitted = True

    def wait(self, connection: Connection) -> None:
        """Count a connection as the newest waiting one."""
        if connection not in self._open:
            return
        if connection.admitted:
            connection.admitted = False
        else:
            self._remove(connection)
        self._add(connection)

    def close(self, connection: Connection) -> None:
        """Stop counting a connection. Does nothing if it is closed already."""
        if connection in self._open:
            self._open.remove(connection)
            if not connection.admitted:
                self._remove(connection)

    def make_room(self) -> None:
        """Drop the longest waiting connection of the address with the most waiting connections."""
        if self._waiting_count:
            self._drop(max(self._waiting.values(), key=len))

    def _drop(self, waiting: dict[Connection, None]) -> None:
        oldest = next(iter(waiting))
        self.close(oldest)
        self._note_drop("waiting connection dropped for a new one", oldest.address)
        oldest.drop()

    def _note_drop(self, reason: str, address: str) -> None:
        self.dropped += 1
        if self.dropped & (self.dropped - 1) == 0:  # 1, 2, 4, 8 ...: an attack must not fill the log
            log.warning(reason, address=address, so_far=self.dropped, connections=len(self._open))

    def _add(self, connection: Connection) -> None:
        self._waiting.setdefault(connection.address, {})[connection] = None
        self._waiting_count += 1

    def _remove(self, connection: Connection) -> None:
        waiting = self._waiting[connection.address]
        del waiting[connection]
        if not waiting:
            del self._waiting[connection.address]
        self._waiting_count -= 1

    def _is_proxy(self, address: str) -> bool:
        if not self._proxies:
            return False
        try:
            found = ipaddress.ip_address(address)
        except ValueError:
            return False
        return any(found in network for network in self._proxies)
