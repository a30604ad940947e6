"""Settings of the server, from the command line and the environment."""

import ipaddress
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple, Self

import msgspec

from arcor2_hw.calibration.configuration import CalibrationConfiguration
from arcor2_hw.data.cell import Cell
from arcor2_hw.data.device import DEVICE_FILES
from arcor2_hw.data.role import Role
from arcor2_hw.exceptions import InvalidData

VERSION: Final = "1.4.0"
"""Version of the ARServer that this server is compatible with; its own version: `arcor2-hw --version`."""
API_VERSION: Final = "1.1.0"
"""Version of the protocol. Existing clients refuse another major version."""
MIB: Final = 1024 * 1024
CELL_NAME: Final = re.compile(r"[a-z0-9][a-z0-9_-]{0,62}")
"""A name of a cell. It is part of subjects of the broker, in which dots, spaces and wildcards have a meaning."""
MAX_LIFE_TIMEOUT: Final = 60.0
"""Longest time limit of the PLC's life counter, s."""
DATABASE_URL: Final = "ARCOR2_HW_DATABASE_URL"
"""The variable with the address of the database."""
MQTT_URL: Final = "ARCOR2_HW_MQTT_URL"
"""The variable with the address of the MQTT broker, which may contain a password."""
FLEET_BROKER: Final = "ARCOR2_HW_FLEET_NATS_URL"
"""The variable with the address of the broker of the fleet. It may contain a password."""
FLEET_AUTHORITY: Final = "ARCOR2_HW_FLEET_NATS_CA"
"""The variable with the file of the certificate to trust for this broker."""
DEVICE_FILES_NAME: Final = "device-files"
"""Folder of the data directory with the files that settings of devices may name."""


class LegacyListener(msgspec.Struct, frozen=True):
    """A second port for clients without tokens and TLS. They have this role, which cannot be programmer."""

    host: str
    port: int
    role: Role = Role.OPERATOR

    def __post_init__(self) -> None:
        if self.role >= Role.PROGRAMMER:
            raise ValueError("clients without a token cannot have the role programmer")


class PlcListener(msgspec.Struct, frozen=True):
    """The address of the Modbus block for a PLC."""

    host: str
    port: int


class OpcUaListener(msgspec.Struct, frozen=True):
    """The address of the OPC UA server.

    anonymous: whether clients without a user may read. unencrypted: whether clients may connect without encryption. On
    loopback both are also permitted while the server requires no token.
    """

    host: str
    port: int
    anonymous: bool = False
    unencrypted: bool = False


class MqttSettings(msgspec.Struct, frozen=True, kw_only=True):
    """How the cell is published over MQTT.

    tls: whether to use TLS. user, password: empty if the broker needs none. authority: file of the certificate to
    trust; empty for those that the system trusts. certificate, key: files of the client certificate; empty for none.
    group, node: names of Sparkplug B; empty to publish none. primary_host: id of the host to wait for; empty for none.
    prefix: of the topics with plain JSON; empty for none.
    """

    host: str
    port: int
    tls: bool = False
    user: str = ""
    password: str = ""
    authority: str = ""
    certificate: str = ""
    key: str = ""
    group: str = ""
    node: str = ""
    primary_host: str = ""
    prefix: str = ""


class DeadBand(NamedTuple):
    """The dead band of the points whose `DEVICE.POINT` matches a pattern, in their unit."""

    pattern: str
    band: float

    @classmethod
    def parse(cls, text: str) -> "DeadBand":
        """Parse `PATTERN=NUMBER`. Raise ValueError if the text has another form."""
        pattern, _, number = text.rpartition("=")
        band = float(number)
        if not pattern or not 0 <= band < float("inf"):
            raise ValueError(f"{text!r} is not PATTERN=NUMBER")
        return cls(pattern, band)


class ServerSettings(msgspec.Struct, frozen=True, kw_only=True):
    """The settings of the server. Times are in s, sizes in bytes."""

    data_dir: Path
    host: str = "127.0.0.1"
    port: int = 6789
    insecure: bool = False
    """Require no token, also from other machines."""
    certificate: Path | None = None
    """The certificate of the server; None without TLS."""
    authority: Path | None = None
    """The local authority that issued the certificate; None without TLS, or if the user provides the certificate."""
    classic_ports: dict[str, int] = {}
    """Additional ports by the name of the ARCOR2 service; empty: everything is on one port."""
    legacy: "LegacyListener | None" = None
    """Port for clients without tokens and TLS."""
    plc: PlcListener | None = None
    """Address of the Modbus block for a PLC; None: no block."""
    opcua: OpcUaListener | None = None
    """Address of the OPC UA server; None: none."""
    mqtt: MqttSettings | None = None
    """The broker to which the cell is published; None: none."""
    cell_name: str = ""
    """Name of the cell in the editor and in the fleet; empty: none."""
    cell_address: str = ""
    """Address of the editor for other computers; empty: the first one that this machine has."""
    fleet_address: str = ""
    """Address of the page with all cells, to which the editor links; empty: none."""
    fleet_broker: str = ""
    """Address of the broker (NATS) of the fleet; empty: that of the pairing, if there was one."""
    fleet_authority: str = ""
    """File of the certificate to trust for this broker; empty: those that the system trusts."""
    plc_life_timeout: float = 2.0
    """Time after which a life counter of the PLC that does not change holds its program, s."""
    device_files: tuple[str, ...] = ()
    """Directories with files that settings of devices may name, in addition to those in the data directory."""
    database_url: str = ""
    """SQLAlchemy URL with an asynchronous driver; empty: SQLite in the data directory."""
    cell: Cell | None = None
    """Settings of devices that override those of scenes and packages, by name of the object."""
    lock_timeout: float = 300.0
    """Time after which the locks of a disconnected user are released."""
    lock_retries: int = 13
    lock_retry_wait: float = 0.15
    streaming_period: float = 0.1
    scene_inflation: float = 0.01
    """Inflation of body sizes for safe line checks, m."""
    compute_idle: float = 120.0
    """Time after which an idle compute worker is stopped to free its memory, s."""
    markers: CalibrationConfiguration | None = None
    """Poses of the markers; None: those set over REST."""
    history_limit: int = 1000
    """Number of undo steps in the journal."""
    allowed_hosts: frozenset[str] = frozenset()
    """Host names of the server, in addition to addresses, localhost and the names of this machine."""
    trusted_proxies: tuple[str, ...] = ()
    """Addresses and networks of reverse proxies whose X-Forwarded-For and X-Forwarded-Proto are trusted."""
    default_role: Role = Role.PROGRAMMER
    """Role of clients if no token is required."""
    served_size: int = 16 * MIB
    drained_size: int = 32 * MIB
    log_off_after: float = 300.0
    """Time without activity after which a person is logged off at a shared device; 0: never."""
    point_history: bool = False
    """Whether the history of points and runs is recorded."""
    point_history_days: int = 90
    """Time for which the history is stored, days."""
    point_history_megabytes: int = 1000
    """Maximum size of the history, MB."""
    point_history_interval: float = 1.0
    """Least time between two recorded values of a point."""
    point_history_dead_bands: tuple[str, ...] = ()
    """`DEVICE.POINT=BAND`, where DEVICE.POINT may contain wildcards: smaller changes are not recorded."""
    released_only: bool = False
    """Whether operators may run only released recipes."""
    requests_in_flight: int = 256
    """Maximum number of concurrent requests of a client; more are not read from its connection."""
    outgoing_bytes: int = 40 * MIB
    outgoing_messages: int = 20_000
    outgoing_age: float = 10.0
    """Maximum age of queued messages. A client that exceeds it or one of the two limits above is disconnected."""
    ping_interval: float = 20.0
    connections: int = 0
    """Maximum number of connections; 0: as many as the limit of open files allows, at most 4000."""
    connections_per_address: int = 200
    """Maximum number of connections from one address whose client is not admitted."""
    request_timeout: float = 10.0
    """Time limit for a TLS handshake, for the head of a request, and for a body or answer without progress."""

    def __post_init__(self) -> None:
        for proxy in self.trusted_proxies:
            ipaddress.ip_network(proxy)

    @property
    def in_fleet(self) -> bool:
        """Whether the cell publishes its state and results."""
        return bool(self.cell_name and (self.fleet_broker or self.fleet_credentials.exists()))

    @property
    def fleet_credentials(self) -> Path:
        """The file with the credentials of a paired cell for the broker of the fleet."""
        return self.data_dir / "fleet" / f"{self.cell_name}.json"

    @property
    def documents_database(self) -> Path:
        """The SQLite file of the documents, if no other database is used."""
        return self.data_dir / "documents.sqlite"

    @property
    def journal_database(self) -> Path:
        """The file of the journal of the open document."""
        return self.data_dir / "journal.sqlite"

    @property
    def checkpoints_dir(self) -> Path:
        """The part inventory and the checkpoints of runs."""
        return self.data_dir / "checkpoints"

    @property
    def recordings_dir(self) -> Path:
        """The recordings of alarms and failed runs."""
        return self.data_dir / "recordings"

    @property
    def analysis_file(self) -> Path:
        """The cached analysis of object types. It may be deleted."""
        return self.data_dir / "analysis.msgpack"

    @property
    def audit_file(self) -> Path:
        """The file of the audit trail."""
        return self.data_dir / "audit.sqlite"

    @property
    def alarms_file(self) -> Path:
        """The file of the records of alarms."""
        return self.data_dir / "alarms.sqlite"

    @property
    def cell_state_file(self) -> Path:
        """The file of mode, authority and jobs of the cell."""
        return self.data_dir / "cell-state.json"

    @property
    def broker_dir(self) -> Path:
        """The directory of the keys and nodes of the broker."""
        return self.data_dir / "broker"

    @property
    def broker_credentials(self) -> Path:
        """The file with the credentials of the server for the broker."""
        return self.broker_dir / "server.json"

    @property
    def history_dir(self) -> Path:
        """The directory of the histories of closed documents."""
        return self.data_dir / "history"

    @property
    def point_history_dir(self) -> Path:
        """The directory of the history of points and runs."""
        return self.data_dir / "point-history"

    @property
    def problems_file(self) -> Path:
        """The cached problems of saved documents. It may be deleted."""
        return self.data_dir / "problems.msgpack"

    @property
    def markers_file(self) -> Path:
        """The file of the markers that were set over REST."""
        return self.data_dir / "markers.json"

    @property
    def secrets_file(self) -> Path:
        """The file of the secrets of devices."""
        return self.data_dir / "secrets.json"

    @property
    def assets_dir(self) -> Path:
        """The directory of assets."""
        return self.data_dir / "assets"

    @property
    def arm_calibrations_file(self) -> Path:
        """The file of the per-robot kinematic calibrations read from controllers."""
        return self.data_dir / "arm-calibrations.json"

    @property
    def device_files_dirs(self) -> tuple[Path, ...]:
        """The directories with files that settings of devices may name. The outbox contains unsent results."""
        data = self.data_dir.absolute()
        return (data / DEVICE_FILES_NAME, data / "outbox", *map(Path, self.device_files))

    @property
    def prepared_dir(self) -> Path:
        """The directory of meshes converted for display. It may be emptied."""
        return self.data_dir / "prepared"

    @property
    def packages_dir(self) -> Path:
        """The directory of execution packages."""
        return self.data_dir / "packages"

    @classmethod
    def from_environment(cls, environment: Mapping[str, str] = os.environ, **given: Any) -> Self:
        """Return settings from arguments and, for missing ones, from environment variables.

        docs/reference/command-line.md lists the variables.

        Args:
            environment: the environment variables.
            given: settings by name; None is ignored.

        Raises:
            InvalidData: the value of a variable is invalid.
        """
        values: dict[str, Any] = {}
        types = {field.name: field.type for field in msgspec.structs.fields(cls)}
        for variable, name in _VARIABLES.items():
            if (text := environment.get(variable)) is None or name in given:
                continue
            separator = _LISTS.get(name)
            given_value: Any = text
            if separator:
                given_value = [part.strip() for part in text.split(separator) if part.strip()]
            try:
                values[name] = msgspec.convert(given_value, types[name], strict=False)
            except msgspec.ValidationError as error:
                raise InvalidData("{variable}={text!r}: {reason}", variable=variable, text=text, reason=error) from None
        values.update((name, value) for name, value in given.items() if value is not None)
        if not 0 < values.get("plc_life_timeout", 1) <= MAX_LIFE_TIMEOUT:
            raise InvalidData(
                "ARCOR2_HW_PLC_LIFE_TIMEOUT is not in the range above 0 to {longest} s.", longest=MAX_LIFE_TIMEOUT
            )
        for name, least in _LEAST.items():
            if values.get(name, least) < least:
                variable = next(variable for variable, field in _VARIABLES.items() if field == name)
                raise InvalidData("{variable} is less than {least}.", variable=variable, least=least)
        try:
            for band in values.get("point_history_dead_bands", ()):
                DeadBand.parse(band)
        except ValueError as error:
            raise InvalidData("ARCOR2_HW_POINT_HISTORY_DEAD_BANDS: {reason}", reason=error) from None
        if (cell := values.get("cell_name")) and not CELL_NAME.fullmatch(cell):
            raise InvalidData(
                "ARCOR2_HW_CELL_NAME={name!r} is not a name of a cell: use lower-case letters, digits, - and _.",
                name=cell,
            )
        for variable in ("cell_address", "fleet_address"):
            if (address := values.get(variable)) and not address.startswith(("http://", "https://")):
                raise InvalidData(
                    "ARCOR2_HW_{variable}={address!r} is not an address: it starts with http:// or https://.",
                    variable=variable.upper(),
                    address=address,
                )
        if values.get("streaming_period", 1) <= 0:
            values["streaming_period"] = 0.1
        if "data_dir" not in values:
            values["data_dir"] = default_data_dir(environment)
        try:
            return cls(**values)
        except ValueError as error:
            raise InvalidData("ARCOR2_HW_TRUSTED_PROXIES: {reason}", reason=error) from None


_VARIABLES: Final = {
    "ARCOR2_ARSERVER_PORT": "port",
    "ARCOR2_ARSERVER_LOCK_TIMEOUT": "lock_timeout",
    "ARCOR2_ARSERVER_LOCK_RETRIES": "lock_retries",
    "ARCOR2_ARSERVER_LOCK_RETRY_WAIT": "lock_retry_wait",
    "ARCOR2_STREAMING_PERIOD": "streaming_period",
    "ARCOR2_SCENE_INFLATION": "scene_inflation",
    "ARCOR2_HW_COMPUTE_IDLE": "compute_idle",
    "ARCOR2_HW_HOST": "host",
    DATABASE_URL: "database_url",
    "ARCOR2_HW_ALLOWED_HOSTS": "allowed_hosts",
    "ARCOR2_HW_TRUSTED_PROXIES": "trusted_proxies",
    DEVICE_FILES: "device_files",
    "ARCOR2_HW_HISTORY_LIMIT": "history_limit",
    "ARCOR2_HW_POINT_HISTORY_DAYS": "point_history_days",
    "ARCOR2_HW_POINT_HISTORY_MEGABYTES": "point_history_megabytes",
    "ARCOR2_HW_POINT_HISTORY_INTERVAL": "point_history_interval",
    "ARCOR2_HW_POINT_HISTORY_DEAD_BANDS": "point_history_dead_bands",
    "ARCOR2_HW_DEFAULT_ROLE": "default_role",
    "ARCOR2_HW_LOG_OFF_AFTER": "log_off_after",
    "ARCOR2_HW_RELEASED_ONLY": "released_only",
    "ARCOR2_HW_PLC_LIFE_TIMEOUT": "plc_life_timeout",
    "ARCOR2_HW_OUTGOING_BYTES": "outgoing_bytes",
    "ARCOR2_HW_OUTGOING_AGE": "outgoing_age",
    "ARCOR2_HW_PING_INTERVAL": "ping_interval",
    "ARCOR2_HW_CELL_NAME": "cell_name",
    "ARCOR2_HW_CELL_ADDRESS": "cell_address",
    "ARCOR2_HW_FLEET_ADDRESS": "fleet_address",
    FLEET_BROKER: "fleet_broker",
    FLEET_AUTHORITY: "fleet_authority",
    "ARCOR2_HW_CONNECTIONS": "connections",
    "ARCOR2_HW_CONNECTIONS_PER_ADDRESS": "connections_per_address",
    "ARCOR2_HW_REQUEST_TIMEOUT": "request_timeout",
}
_LEAST: Final = {"point_history_interval": 0.1, "point_history_days": 1, "point_history_megabytes": 10}
"""Least values of settings."""
_LISTS: Final = {
    "allowed_hosts": ",",
    "point_history_dead_bands": ",",
    "trusted_proxies": ",",
    "device_files": os.pathsep,
}
"""Separators of the settings that are lists."""


def is_loopback(host: str) -> bool:
    """Return whether only this machine can reach an address."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


def default_data_dir(environment: Mapping[str, str] = os.environ) -> Path:
    """Return the folder `arcor2-hw` in the user's data directory (XDG base directory specification)."""
    base = environment.get("XDG_DATA_HOME") or ""
    root = Path(base) if base.startswith("/") else Path.home() / ".local" / "share"
    return root / "arcor2-hw"
