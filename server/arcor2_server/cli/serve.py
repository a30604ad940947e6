"""`arcor2-hw serve`: run the server until it is terminated."""

import asyncio
import contextlib
import errno
import fcntl
import gc
import importlib
import importlib.util
import os
import signal
import socket
import ssl
import sys
from collections.abc import Generator
from pathlib import Path
from typing import IO, Annotated, Literal, cast

import msgspec
import uvloop
from cyclopts import Parameter, validators

import arcor2_server.log  # before any import of structlog
from arcor2_hw.calibration.configuration import (
    CalibrationConfiguration,
    configuration_of,
    read_configuration,
    yaml_of,
)
from arcor2_hw.data.base import Unset
from arcor2_hw.data.cell import BROKER_URL, Cell, read_cell
from arcor2_hw.data.role import Role
from arcor2_hw.exceptions import Arcor2Error, DatabaseInUse, InvalidData, NotFound, StorageError
from arcor2_server.access.addresses import server_addresses
from arcor2_server.access.admission import PARAMETER, is_local
from arcor2_server.access.tokens import TokenFile
from arcor2_server.audit.command_line import note_command
from arcor2_server.cli.certificates import certificate_of, renew_certificate
from arcor2_server.cli.exit_status import CannotServe, ExitStatus, fail
from arcor2_server.deployment.service_manager import ServiceManager
from arcor2_server.log import setup as server_logging
from arcor2_server.settings import (
    DATABASE_URL,
    DEVICE_FILES_NAME,
    FLEET_BROKER,
    MQTT_URL,
    LegacyListener,
    MqttSettings,
    OpcUaListener,
    PlcListener,
    ServerSettings,
)
from arcor2_server.websocket.classic_ports import ports_from_environment

log = arcor2_server.log.get_logger(__name__)

LegacyRole = Literal["operator", "standard_user", "advanced_user", "technician"]
"""The roles of clients without a token; programmer is not allowed."""

PREPARE_AFTER = 0.5
"""Delay after the start before a spare cell host is started, s, so that waiting clients are served first."""

FIRST_DEVICE = "first device"
"""Name of the token that the first start on a network creates."""

GC_THRESHOLD = (700, 10, 10)
"""The default thresholds of the interpreter, which `main` raises for the imports."""


def serve(
    *,
    host: str | None = None,
    port: Annotated[int | None, Parameter(validator=validators.Number(gte=0, lte=65535))] = None,
    data_dir: Path | None = None,
    cell: Path | None = None,
    markers: Annotated[Path | None, Parameter(env_var="ARCOR2_HW_MARKERS")] = None,
    tls: Annotated[tuple[Path, Path] | None, Parameter(negative="")] = None,
    self_signed: bool = False,
    insecure: bool = False,
    legacy_listen: str | None = None,
    legacy_role: LegacyRole = "operator",
    plc_modbus: str | None = None,
    opcua: str | None = None,
    opcua_anonymous: Annotated[bool, Parameter(negative="")] = False,
    opcua_unencrypted: Annotated[bool, Parameter(negative="")] = False,
    mqtt: str | None = None,
    mqtt_sparkplug: str | None = None,
    mqtt_primary_host: str | None = None,
    mqtt_json: str | None = None,
    mqtt_unencrypted: Annotated[bool, Parameter(negative="")] = False,
    history: Annotated[bool, Parameter(negative="")] = False,
    classic_ports: Annotated[bool, Parameter(negative="")] = False,
    openapi: Annotated[bool, Parameter(negative="")] = False,
    log_level: str = "info",
) -> int:
    """Run the server until Ctrl-C or SIGTERM.

    Parameters
    ----------
    host
        Address to listen on. The default 127.0.0.1 is only reachable from this machine.
    port
        Port to listen on (6789); 0 selects a free port, which `ready` shows.
    data_dir
        Data directory for scenes, projects and packages ($XDG_DATA_HOME/arcor2-hw). It is created if missing.
    cell
        A cell.yaml with settings of devices. They override the settings of objects with the same names.
    markers
        File with the poses of the markers for calibration. The default is the poses in cell.yaml or those set over
        REST.
    tls
        PEM files of a certificate chain and its key for TLS.
    self_signed
        Use TLS with a certificate of a local authority, which devices install once from the same address with http://.
        This is the default if other machines can connect.
    insecure
        Require no token, and use TLS only if requested. Use this only in an isolated network.
    legacy_listen
        A second HOST:PORT without TLS for clients that cannot send a token.
    legacy_role
        Role of these clients.
    plc_modbus
        HOST:PORT of a Modbus TCP block through which a PLC starts and stops programs. The PLC needs the authority,
        which a technician gives it.
    opcua
        HOST:PORT of an OPC UA server through which plant systems read the cell, and command it if they have the
        authority.
    opcua_anonymous
        Let OPC UA clients read without a user, also from other machines.
    opcua_unencrypted
        Let OPC UA clients connect without encryption, also from other machines.
    mqtt
        mqtts://HOST:PORT of an MQTT broker to which the cell is published. An address with a password belongs into the
        variable ARCOR2_HW_MQTT_URL.
    mqtt_sparkplug
        GROUP/NODE under which the cell is published as an edge node of Sparkplug B.
    mqtt_primary_host
        Id of the Sparkplug host application. While it is offline, values are stored and published later.
    mqtt_json
        Prefix of the topics under which the cell is published as plain JSON, such as enterprise/site/area/line/cell.
    mqtt_unencrypted
        Use a broker on another machine without TLS.
    history
        Record the values of all points and the runs. Settings: ARCOR2_HW_POINT_HISTORY_*.
    classic_ports
        Also listen on the ports of the services of the original ARCOR2, as set by its ARCOR2_* variables.
    openapi
        Print the OpenAPI document of the REST interface and exit.
    log_level
        Level of the log on standard error: debug, info, warning or error.
    """
    if openapi:
        return _print_openapi()
    # Only the user may read the files of the server and its processes.
    os.umask(0o077)
    # The start creates mostly permanent objects; collecting garbage would only take time.
    gc.disable()
    try:
        here = None if cell is None else read_cell(cell)
        seen = _markers(markers, cell, here)
    except Arcor2Error as error:
        status = ExitStatus.NOT_FOUND if isinstance(error, NotFound) else ExitStatus.CELL_UNUSABLE
        return fail("serve", " ".join(str(error).split()), status)
    try:
        legacy = (
            None
            if legacy_listen is None
            else LegacyListener(*_address("--legacy-listen", legacy_listen), Role[legacy_role.upper()])
        )
        settings = ServerSettings.from_environment(
            host=host,
            port=port,
            data_dir=data_dir,
            cell=here,
            markers=seen,
            insecure=insecure or None,
            legacy=legacy,
            plc=None if plc_modbus is None else PlcListener(*_address("--plc-modbus", plc_modbus)),
            opcua=None if opcua is None else _opcua(opcua, anonymous=opcua_anonymous, unencrypted=opcua_unencrypted),
            mqtt=_mqtt(mqtt, mqtt_sparkplug, mqtt_primary_host, mqtt_json, unencrypted=mqtt_unencrypted),
            point_history=_history() if history else None,
            classic_ports=ports_from_environment() if classic_ports else None,
        )
        if broker := os.environ.get(BROKER_URL):
            from arcor2_server.nodes.credentials import require_tls  # imported only if needed, because it takes time

            require_tls(broker)
        if settings.in_fleet and settings.fleet_broker:
            from arcor2_server.nodes.credentials import require_tls

            require_tls(settings.fleet_broker)
        server_logging.set_up(log_level)
        # These variables may contain a password, which devices and programs must not see.
        for variable in (DATABASE_URL, MQTT_URL, FLEET_BROKER):
            os.environ.pop(variable, None)
    except (InvalidData, KeyError) as error:
        return fail("serve", error, ExitStatus.USAGE)
    try:
        with (
            data_directory(settings.data_dir),
            contextlib.ExitStack() as sockets,
        ):
            _finish_restoration(settings.data_dir)
            listener = sockets.enter_context(contextlib.closing(listen(settings.host, settings.port)))
            settings, classic_listeners = _bind_classic(settings, sockets)
            settings, legacy_listener = _bind_legacy(settings, sockets)
            settings, certificate = certificate_of(settings, tls, self_signed)
            plc = None
            if settings.plc is not None:
                plc = sockets.enter_context(contextlib.closing(listen(settings.plc.host, settings.plc.port)))
            plant = None
            if settings.opcua is not None:
                from arcor2_server.opcua.certificate import issue_certificate  # slow to import, and rarely needed

                plant = sockets.enter_context(contextlib.closing(listen(settings.opcua.host, settings.opcua.port)))
                issue_certificate(settings)
            welcome(settings, listener.getsockname()[1])
            with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
                runner.run(run(settings, [listener, *classic_listeners], legacy_listener, certificate, plc, plant))
    except CannotServe as error:
        return fail("serve", error, error.status)
    except DatabaseInUse as error:
        return fail("serve", error, ExitStatus.DATA_IN_USE)
    except StorageError as error:
        return fail("serve", error, ExitStatus.DATABASE_UNUSABLE)
    return ExitStatus.OK


def _editor_address(settings: ServerSettings, port: int) -> str:
    """Return the address of the editor for other computers, if there is one, otherwise that for this computer."""
    if addresses := server_addresses(settings, port).addresses:
        return addresses[0]
    return f"{'https' if settings.certificate else 'http'}://127.0.0.1:{port}"


def _markers(given: Path | None, path: Path | None, cell: Cell | None) -> CalibrationConfiguration | None:
    """Return the poses of the markers from their file, or without a file from cell.yaml.

    Raises:
        NotFound: the file does not exist.
        InvalidData: the file is damaged.
    """
    if given is not None:
        return read_configuration(given)
    if cell is None or path is None or isinstance(cell.calibration, Unset):
        return None
    # Read the file again to report duplicate keys, of which YAML uses the last.
    return configuration_of(yaml_of(path.read_bytes(), str(path))["calibration"], f"{path}: calibration")


def welcome(settings: ServerSettings, port: int) -> None:
    """At the first start on a network, create the token of the first device and print an address with it.

    The device asks for an administrator. Later, rights on this device require that a person logs on, so the address
    alone grants none. `port` is the bound port.

    Raises:
        StorageError: the tokens cannot be read or written.
    """
    tokens = TokenFile(settings.data_dir)
    if is_local(settings) or settings.insecure or tokens.all() or tokens.unusable:
        return
    _, secret = tokens.add(FIRST_DEVICE, Role.PROGRAMMER, shared=True)
    note_command(settings.audit_file, "serve", FIRST_DEVICE)
    here = server_addresses(settings, port).addresses or ["http://ADDRESS-OF-THE-PROXY"]
    sys.stderr.write(f"arcor2-hw serve: first start. Add an administrator at {here[0]}/?{PARAMETER}={secret}\n")


def _finish_restoration(data_dir: Path) -> None:
    """Complete a restoration of a backup that was interrupted. Raises StorageError."""
    if any(data_dir.glob(".restore-*")):
        from arcor2_server.deployment.backup import finish_restoration

        finish_restoration(data_dir)


def _address(option: str, address: str) -> tuple[str, int]:
    host, _, port = address.rpartition(":")
    if not host or not port.isdigit() or int(port) > 0xFFFF:
        raise InvalidData("{option} {address!r} is not HOST:PORT", option=option, address=address)
    return host.strip("[]"), int(port)


def _history() -> bool:
    """Return true. Raise InvalidData if the library for the history is not installed."""
    if importlib.util.find_spec("duckdb") is None:
        raise InvalidData("--history needs the library DuckDB: pip install 'arcor2-hw[history]'")
    return True


def _opcua(address: str, *, anonymous: bool, unencrypted: bool) -> OpcUaListener:
    """Return the settings of the OPC UA server.

    Raises:
        InvalidData: the address is invalid, or the library is not installed.
    """
    if importlib.util.find_spec("asyncua") is None:
        raise InvalidData("--opcua needs the library asyncua: pip install 'arcor2-hw[opcua]'")
    return OpcUaListener(*_address("--opcua", address), anonymous, unencrypted)


def _mqtt(
    address: str | None, sparkplug: str | None, primary_host: str | None, prefix: str | None, *, unencrypted: bool
) -> MqttSettings | None:
    """Return the settings of MQTT, None without a broker. Raise InvalidData if an option is invalid."""
    if not any((address, sparkplug, primary_host, prefix, os.environ.get(MQTT_URL))):
        return None
    from arcor2_server.cli.mqtt_options import mqtt_settings  # imported only if needed, because it takes time

    return mqtt_settings(address, sparkplug, primary_host, prefix, unencrypted=unencrypted)


def _print_openapi() -> int:
    from arcor2_server.rest.documents import document

    sys.stdout.buffer.write(msgspec.json.format(msgspec.json.encode(document()), indent=2) + b"\n")
    return ExitStatus.OK


def _bind_classic(
    settings: ServerSettings, sockets: contextlib.ExitStack
) -> tuple[ServerSettings, list[socket.socket]]:
    """Bind the classic ports; return the settings with the bound port numbers, and the sockets."""
    listeners, ports = [], {}
    for service, port in settings.classic_ports.items():
        ports[service] = port
        if port == settings.port and port:
            continue  # the main port
        listener = sockets.enter_context(contextlib.closing(listen(settings.host, port)))
        listeners.append(listener)
        ports[service] = listener.getsockname()[1]
        log.info("classic port", service=service, port=ports[service])
    return msgspec.structs.replace(settings, classic_ports=ports), listeners


def _bind_legacy(
    settings: ServerSettings, sockets: contextlib.ExitStack
) -> tuple[ServerSettings, socket.socket | None]:
    """Bind the legacy port; return the settings with the bound port number, and the socket."""
    if settings.legacy is None:
        return settings, None
    listener = sockets.enter_context(contextlib.closing(listen(settings.legacy.host, settings.legacy.port)))
    legacy = msgspec.structs.replace(settings.legacy, port=listener.getsockname()[1])
    role = legacy.role.name.lower()
    log.warning("clients without a token are admitted", host=legacy.host, port=legacy.port, role=role)
    return msgspec.structs.replace(settings, legacy=legacy), listener


async def run(
    settings: ServerSettings,
    listeners: list[socket.socket],
    legacy: socket.socket | None = None,
    certificate: tuple[Path, Path] | None = None,
    plc: socket.socket | None = None,
    plant: socket.socket | None = None,
) -> None:
    """Run the server on bound sockets. With a certificate it uses TLS on all except `legacy`, `plc` and `plant`.

    Raises:
        CannotServe: another program has taken the port.
        StorageError: the data cannot be used.
    """
    from arcor2_server.access.connection_limits import ConnectionLimits
    from arcor2_server.app import create_app, running_server
    from arcor2_server.web.http_server import Server, configuration

    manager = ServiceManager.from_environment()
    async with running_server(settings) as running:
        preparing: asyncio.TimerHandle | None = None
        for notice in running.damage.notices:
            sys.stderr.write(f"arcor2-hw serve: {notice}\n")

        def when_ready() -> None:
            manager.ready()
            gc.freeze()
            gc.set_threshold(*GC_THRESHOLD)
            gc.enable()
            nonlocal preparing
            preparing = loop.call_later(PREPARE_AFTER, prepare)

        def prepare() -> None:
            running.hosts.prepare()
            loop.run_in_executor(None, importlib.import_module, "transforms3d.quaternions")

        if plc is not None:
            await running.plc.serve(plc)
        if plant is not None:
            running.opcua.serve(plant)
        if running.mqtt is not None:
            running.mqtt.start()
        running.fleet.serve(_editor_address(settings, listeners[0].getsockname()[1]))
        loop = asyncio.get_running_loop()
        config = configuration(create_app(running), settings, certificate)
        renewal = trust_page = None
        if settings.authority is not None:
            from arcor2_server.web.trust_page import TrustPage

            config.load()
            renewal = loop.create_task(renew_certificate(settings, cast("ssl.SSLContext", config.ssl)))
            trust_page = TrustPage(settings.authority, settings)
        server = Server(config, settings, ConnectionLimits.of(settings), legacy, when_ready, trust_page)
        for number in (signal.SIGTERM, signal.SIGINT):
            loop.add_signal_handler(number, server.end)
        try:
            await server.serve(sockets=listeners)
        except OSError as error:
            # Another program has taken the port after it was bound.
            if error.errno != errno.EADDRINUSE:
                raise
            raise _no_port(settings.host, listeners[0].getsockname()[1], error) from error
        finally:
            manager.stopping()
            for pending in (renewal, preparing):
                if pending is not None:
                    pending.cancel()


@contextlib.contextmanager
def data_directory(directory: Path) -> Generator[IO[bytes], None, None]:
    """Create the data directory if it is missing, and lock it.

    Raises:
        CannotServe: the directory cannot be written, or another server uses it.
    """
    try:
        directory.mkdir(parents=True, exist_ok=True)
        (directory / DEVICE_FILES_NAME).mkdir(mode=0o700, exist_ok=True)
        lock = (directory / "lock").open("ab")
    except OSError as error:
        reason = f"the data directory {directory} cannot be used: {error.strerror}"
        raise CannotServe(ExitStatus.DATA_UNUSABLE, reason) from error
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            reason = f"the data directory {directory} is in use by another server"
            raise CannotServe(ExitStatus.DATA_IN_USE, reason) from error
        yield lock


def listen(host: str, port: int) -> socket.socket:
    """Return a bound socket. Uvicorn listens on it when the server is ready.

    Raises:
        CannotServe: the address cannot be used.
    """
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        listener = socket.socket(family, kind, protocol)
    except OSError as error:
        raise CannotServe(ExitStatus.PORT_TAKEN, f"cannot listen on {host}: {error.strerror}") from error
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(address)
        listener.set_inheritable(False)
        listener.setblocking(False)
    except OSError as error:
        listener.close()
        raise _no_port(host, port, error) from error
    return listener


def _no_port(host: str, port: int, error: OSError) -> CannotServe:
    if error.errno == errno.EADDRINUSE:
        return CannotServe(ExitStatus.PORT_TAKEN, f"port {port} of {host} is used by another program")
    return CannotServe(ExitStatus.PORT_TAKEN, f"cannot listen on port {port} of {host}: {error.strerror}")
