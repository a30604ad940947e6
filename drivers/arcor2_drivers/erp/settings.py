"""Settings of a production planning service."""

import dataclasses
import ipaddress
import re
from typing import Annotated, Final

from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects import Settings
from arcor2_hw.objects.settings import Range, check_url, device_file, secret_file

_STATION: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")


def is_loopback(host: str) -> bool:
    """Return whether a host is this computer."""
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


@dataclasses.dataclass
class ErpSettings(Settings):
    """Address and credentials of the service, and the outbox for results that it has not accepted yet.

    :param url: address of the service, as https://erp.example:8443/api/v1
    :param station: name of this cell at the service; letters, digits, dot, dash and underscore
    :param outbox: directory of the stored outbox; empty for the user's data directory
    :param token_file: file with the bearer token; empty for none
    :param ca_file: PEM file of the certificate authority of the service; empty for those of the system
    :param client_certificate: PEM file of the client certificate; empty for none
    :param client_key: PEM file of its private key
    :param request_timeout: time the service has to answer one request, s
    :param longest_pause: longest time between two attempts to deliver a result, s
    :param waiting_alarm: time a result may wait before an alarm is raised, s
    :param poll: time between two requests for an order while there is none, s
    """

    url: str
    station: str = "cell"
    outbox: str = ""
    token_file: str = ""
    ca_file: str = ""
    client_certificate: str = ""
    client_key: str = ""
    request_timeout: Annotated[float, Range(0.1, 30.0, "s")] = 2.0
    longest_pause: Annotated[float, Range(0.5, 600.0, "s")] = 30.0
    waiting_alarm: Annotated[float, Range(0.1, 86400.0, "s")] = 60.0
    poll: Annotated[float, Range(0.1, 60.0, "s")] = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        parts = check_url("url", self.url, "http", "https")
        if self.token_file and parts.scheme == "http" and not is_loopback(parts.hostname or ""):
            raise OutOfRange("token_file needs a url that starts with https, because a token is not sent unencrypted")
        if parts.scheme == "http" and (self.ca_file or self.client_certificate):
            raise OutOfRange("ca_file and client_certificate need a url that starts with https")
        if bool(self.client_certificate) != bool(self.client_key):
            raise OutOfRange("client_certificate and client_key must be set together")
        self.token_file = secret_file("token_file", self.token_file, parts.hostname)
        for name in ("outbox", "ca_file", "client_certificate", "client_key"):
            setattr(self, name, device_file(name, getattr(self, name)))
        if not _STATION.fullmatch(self.station):
            raise OutOfRange(
                "station must be 1 to 64 letters, digits, '.', '-' or '_', not {station!r}", station=self.station
            )
