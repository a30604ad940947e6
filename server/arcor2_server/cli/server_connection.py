"""How commands connect to a server, and their exit status if that fails."""

import asyncio
import ssl
import sys
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final

from cyclopts import Parameter

from arcor2_hw.client import Client, Forbidden, NotAdmitted, Rest
from arcor2_hw.exceptions import (
    Arcor2Error,
    Conflict,
    ConnectionLost,
    DeviceTimeout,
    InvalidData,
    InvalidPackage,
    InvalidProject,
    NotConnected,
    NotFound,
)
from arcor2_server.cli.exit_status import ExitStatus

DEFAULT_URL: Final = "ws://127.0.0.1:6789"


class Failed(Exception):
    """A command that ends with a status of its own and one line."""

    def __init__(self, status: ExitStatus, line: str) -> None:
        super().__init__(line)
        self.status = status


@Parameter(name="*")
@dataclass(frozen=True)
class Server:
    """Where the server is, and how it lets us in."""

    url: Annotated[str, Parameter(help="Where the server listens.", env_var="ARCOR2_HW_URL")] = DEFAULT_URL
    token: Annotated[
        str | None, Parameter(help="What `arcor2-hw token add` gave; better in the variable ARCOR2_HW_TOKEN.")
    ] = None
    ca: Annotated[Path | None, Parameter(help="Certificate to trust, when the server made its own.")] = None

    def client(self) -> Client:
        """Create a client that gives up at the first loss. Raises Failed when the certificate cannot be used."""
        return Client(self.url, token=self.token, tls=self._tls(), reconnect=False)

    def rest(self) -> Rest:
        """Create a client for HTTP alone. Raises Failed when the certificate cannot be used."""
        return Rest(self.url, token=self.token, tls=self._tls())

    def _tls(self) -> ssl.SSLContext | None:
        if self.ca is None:
            return None
        try:
            return ssl.create_default_context(cafile=self.ca)
        except OSError as error:  # ssl.SSLError is one
            raise Failed(ExitStatus.CERTIFICATE_UNUSABLE, f"{self.ca} cannot be used: {error}") from error


HERE: Final = Server()

_STATUSES: Final[tuple[tuple[tuple[type[Arcor2Error], ...], ExitStatus], ...]] = (
    ((NotAdmitted, Forbidden), ExitStatus.NOT_PERMITTED),
    ((ConnectionLost, NotConnected, DeviceTimeout), ExitStatus.NO_SERVER),
    ((NotFound,), ExitStatus.NOT_FOUND),
    ((Conflict,), ExitStatus.CONFLICT),
    ((InvalidPackage, InvalidProject, InvalidData), ExitStatus.DOCUMENT_PROBLEMS),
)


def status_of(error: Arcor2Error) -> ExitStatus:
    """Return the status for an error."""
    return next((status for kinds, status in _STATUSES if isinstance(error, kinds)), ExitStatus.FAILED)


def printable(text: str) -> str:
    """Return a text on one line without what would command a terminal: it may come out of somebody else's file."""
    return "".join(each if each.isprintable() else "�" for each in " ".join(text.split()))


def run(command: str, work: Callable[[], Awaitable[Any]]) -> int:
    """Run a command to its end: what it returns as a status, else OK; for an error its status and one line."""

    def fail(error: Exception, status: ExitStatus) -> ExitStatus:
        sys.stderr.write(f"arcor2-hw {command}: {printable(str(error))}\n")
        return status

    async def working() -> Any:
        return await work()

    try:
        given = asyncio.run(working())
    except Failed as error:
        return fail(error, error.status)
    except Arcor2Error as error:
        return fail(error, status_of(error))
    return given if isinstance(given, ExitStatus) else ExitStatus.OK
