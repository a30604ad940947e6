"""The connection of commands to a server, and their exit status for errors."""

import asyncio
import ssl
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
from arcor2_server.cli.exit_status import ExitStatus, fail

DEFAULT_URL: Final = "ws://127.0.0.1:6789"


class Failed(Exception):
    """The command failed with an exit status and a message of one line."""

    def __init__(self, status: ExitStatus, line: str) -> None:
        super().__init__(line)
        self.status = status


@Parameter(name="*")
@dataclass(frozen=True)
class Server:
    """The address of the server and the credentials."""

    url: Annotated[str, Parameter(help="URL of the server.", env_var="ARCOR2_HW_URL")] = DEFAULT_URL
    token: Annotated[
        str | None,
        Parameter(help="Token from `arcor2-hw token add`. Prefer the variable ARCOR2_HW_TOKEN, which `ps` hides."),
    ] = None
    ca: Annotated[Path | None, Parameter(help="Certificate to trust, for a self-signed server certificate.")] = None

    def client(self) -> Client:
        """Create a client that does not reconnect. Raise Failed if the certificate cannot be used."""
        return Client(self.url, token=self.token, tls=self._tls(), reconnect=False)

    def rest(self) -> Rest:
        """Create a client for REST requests. Raise Failed if the certificate cannot be used."""
        return Rest(self.url, token=self.token, tls=self._tls())

    def _tls(self) -> ssl.SSLContext | None:
        if self.ca is None:
            return None
        try:
            return ssl.create_default_context(cafile=self.ca)
        except OSError as error:  # ssl.SSLError is an OSError
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
    """Return the exit status for an error."""
    return next((status for kinds, status in _STATUSES if isinstance(error, kinds)), ExitStatus.FAILED)


def printable(text: str) -> str:
    """Return a text on one line without control characters, which a file from another user could contain."""
    return "".join(each if each.isprintable() else "�" for each in " ".join(text.split()))


def run(command: str, work: Callable[[], Awaitable[Any]]) -> int:
    """Run a command and print errors. Return its status: the returned one, otherwise OK or that of the error."""

    async def working() -> Any:
        return await work()

    try:
        status = asyncio.run(working())
    except Failed as error:
        return fail(command, printable(str(error)), error.status)
    except Arcor2Error as error:
        return fail(command, printable(str(error)), status_of(error))
    return status if isinstance(status, ExitStatus) else ExitStatus.OK
