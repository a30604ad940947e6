"""`arcor2-hw fleet`: the page that shows many cells."""

import asyncio
import contextlib
import os
import signal
import socket
import ssl
import sys
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, cast

import uvloop
from cyclopts import App, Parameter, validators

from arcor2_hw.data.role import Role
from arcor2_hw.exceptions import InvalidData, StorageError
from arcor2_server.access.addresses import server_addresses
from arcor2_server.access.admission import PARAMETER, Access, is_local
from arcor2_server.access.tokens import TokenFile
from arcor2_server.audit.command_line import note_command
from arcor2_server.cli import fleet_members, members
from arcor2_server.cli.certificates import certificate_of, renew_certificate
from arcor2_server.cli.exit_status import CannotServe, ExitStatus, fail
from arcor2_server.cli.serve import data_directory, listen
from arcor2_server.deployment.service_manager import ServiceManager
from arcor2_server.log import setup as server_logging
from arcor2_server.settings import FLEET_AUTHORITY, FLEET_BROKER, ServerSettings

if TYPE_CHECKING:
    from collections.abc import Callable

    from arcor2_server.nodes.credentials import Credentials

FIRST_SCREEN: Final = "first screen"
"""Name of the token that the first start on a network creates."""

app = App(name="fleet")
fleet_members.add_to(app)


@app.command
def serve(
    *,
    broker: Annotated[str | None, Parameter(env_var=FLEET_BROKER)] = None,
    ca: Annotated[Path | None, Parameter(env_var=FLEET_AUTHORITY)] = None,
    host: str = "127.0.0.1",
    port: Annotated[int, Parameter(validator=validators.Number(gte=0, lte=65535))] = 6780,
    data_dir: Path | None = None,
    tls: Annotated[tuple[Path, Path] | None, Parameter(negative="")] = None,
    self_signed: bool = False,
    insecure: bool = False,
    log_level: str = "info",
) -> int:
    """Show all cells of a broker on one page, until Ctrl-C or SIGTERM.

    Prints `ready URL` on standard output when the page is served. The page cannot command a cell.

    Parameters
    ----------
    broker
        Address of a broker (nats-server) without `fleet broker`, with tls:// if it is on another computer. It
        contains user and password; set the variable instead of the option to hide them from other users.
    ca
        Certificate to trust for such a broker.
    host
        Address to listen on. The default 127.0.0.1 is only reachable from this machine.
    port
        Port to listen on; 0 selects a free port, which `ready` shows.
    data_dir
        Data directory for results, tokens and known cells ($XDG_DATA_HOME/arcor2-hw-fleet). It is created if missing.
    tls
        PEM files of a certificate chain and its key for TLS.
    self_signed
        Use TLS with a certificate of a local authority. This is the default if other machines can connect.
    insecure
        Require no token, and use TLS only if requested. Use this only in an isolated network.
    log_level
        Level of the log on standard error: debug, info, warning or error.
    """
    if find_spec("nats") is None:
        return fail("fleet", "install the extra `nodes` of arcor2-hw", ExitStatus.FAILED)
    os.umask(0o077)  # only the user may read the files of the server
    try:
        settings = ServerSettings.from_environment(
            host=host,
            port=port,
            data_dir=fleet_members.fleet_data_dir(data_dir),
            insecure=insecure,
            default_role=Role.TECHNICIAN,
        )
        credentials = partial(_credentials, settings, broker, ca)
        credentials()  # report errors before the start
        server_logging.set_up(log_level)
    except (InvalidData, KeyError, StorageError) as error:
        return fail("fleet", error, ExitStatus.USAGE)
    try:
        with data_directory(settings.data_dir), contextlib.closing(listen(host, port)) as listener:
            settings, certificate = certificate_of(settings, tls, self_signed)
            _welcome(settings, listener.getsockname()[1])
            with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
                runner.run(_run(settings, listener, certificate, credentials))
    except CannotServe as error:
        return fail("fleet", error, error.status)
    except StorageError as error:
        return fail("fleet", error, ExitStatus.DATA_UNUSABLE)
    return ExitStatus.OK


def _credentials(settings: ServerSettings, broker: str | None, ca: Path | None) -> "Credentials":
    """Return the credentials for the broker: of another computer if it was paired with it, else of the own one."""
    from arcor2_server.fleet.accounts import paired_page

    paired = paired_page(settings)
    return members.credentials_for(paired if paired.exists() else settings.broker_credentials, broker, ca)


def _welcome(settings: ServerSettings, port: int) -> None:
    """At the first start on a network, create a token for viewing and print an address with it."""
    tokens = TokenFile(settings.data_dir)
    if is_local(settings) or settings.insecure or tokens.all() or tokens.unusable:
        return
    _, secret = tokens.add(FIRST_SCREEN, Role.OPERATOR)
    note_command(settings.audit_file, "fleet serve", FIRST_SCREEN)
    here = server_addresses(settings, port).addresses or ["http://ADDRESS-OF-THE-PROXY"]
    sys.stderr.write(f"arcor2-hw fleet: first start. Open the page at {here[0]}/?{PARAMETER}={secret}\n")


async def _run(
    settings: ServerSettings,
    listener: socket.socket,
    certificate: tuple[Path, Path] | None,
    credentials: "Callable[[], Credentials]",
) -> None:
    from arcor2_server.access.connection_limits import ConnectionLimits
    from arcor2_server.audit.trail import AuditTrail
    from arcor2_server.fleet.application import create_fleet_app
    from arcor2_server.fleet.collector import Collector  # needs the extra `nodes`
    from arcor2_server.fleet.file import FILE, FleetFile
    from arcor2_server.log.redaction import REDACTION
    from arcor2_server.web.http_server import Server, configuration

    manager = ServiceManager.from_environment()
    access = Access(settings)
    if problem := access.repair():
        sys.stderr.write(f"arcor2-hw fleet: {problem}\n")
    audit = AuditTrail(settings.audit_file, REDACTION.in_text)
    await audit.open()
    collector = Collector(credentials, FleetFile(settings.data_dir / FILE))
    loop = asyncio.get_running_loop()
    config = configuration(create_fleet_app(settings, collector, access, audit), settings, certificate)
    renewal = None
    if settings.authority is not None:
        config.load()
        renewal = loop.create_task(renew_certificate(settings, cast("ssl.SSLContext", config.ssl)))
    server = Server(config, settings, ConnectionLimits.of(settings), None, manager.ready)
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, server.end)
    collector.start()
    try:
        await server.serve(sockets=[listener])
    finally:
        manager.stopping()
        if renewal is not None:
            renewal.cancel()
        await collector.close()
        audit.close()
