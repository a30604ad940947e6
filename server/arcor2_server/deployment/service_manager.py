"""Notifications to the service manager, see sd_notify(3): ready, stopping, and that the event loop is running."""

import asyncio
import os
import socket
from collections.abc import MutableMapping
from typing import Final, Self

import structlog

log = structlog.get_logger(__name__)

SOCKET: Final = "NOTIFY_SOCKET"
TIMEOUT: Final = "WATCHDOG_USEC"
PROCESS: Final = "WATCHDOG_PID"


class ServiceManager:
    """Reports the state of this process to systemd. Without systemd it does nothing.

    Args:
        address: the datagram socket of the service manager; empty: none.
        watchdog: time after which the service manager restarts a process that does not report, s; 0: never.
    """

    def __init__(self, address: str, watchdog: float) -> None:
        # A name that starts with @ is in the abstract namespace.
        self._address = f"\0{address[1:]}" if address.startswith("@") else address
        self._period = watchdog / 3

    @classmethod
    def from_environment(cls, environment: MutableMapping[str, str] = os.environ) -> Self:
        """Return the service manager of this process. Removes its variables, so that children do not report to it."""
        address, timeout, process = (environment.pop(name, "") for name in (SOCKET, TIMEOUT, PROCESS))
        watched = timeout.isdigit() and process in ("", str(os.getpid()))
        return cls(address, int(timeout) / 1e6 if watched else 0.0)

    def ready(self) -> None:
        """Report that requests are accepted. From now on, report regularly that the event loop is running."""
        self._send("READY=1")
        if self._address and self._period:
            self._report()

    def stopping(self) -> None:
        """Report that the process ends."""
        self._send("STOPPING=1")

    def _report(self) -> None:
        self._send("WATCHDOG=1")
        asyncio.get_running_loop().call_later(self._period, self._report)

    def _send(self, state: str) -> None:
        if not self._address:
            return
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK) as sender:
                sender.sendto(state.encode(), self._address)
        except OSError as error:
            log.warning("the service manager cannot be notified", state=state, reason=error.strerror)
