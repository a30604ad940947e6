"""Settings of a production planning service, checked when they are given."""

import dataclasses
import ipaddress
import math
import re
from typing import Final

from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects import Settings
from arcor2_hw.objects.settings import check_url, device_file, secret_file

_STATION: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")


def _within(name: str, value: float, low: float, high: float) -> None:
    if not (math.isfinite(value) and low <= value <= high):
        raise OutOfRange(f"{name} must be {low:g} to {high:g} s, not {value!r}")


def is_loopback(host: str) -> bool:
    """Tell whether a host is this machine."""
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


@dataclasses.dataclass
class ErpSettings(Settings):
    """Where the service is, who we are to it, and where what it has not taken yet is kept.

    :param url: address of the service, as https://erp.example:8443/api/v1
    :param station: our name at the service; letters, digits, dot, dash and underscore
    :param outbox: directory of the stored outbox; empty for the user's data directory
    :param token_file: file with the bearer token; empty for none
    :param ca_file: PEM file of the authority that the service's certificate is checked by; empty for the system's
    :param client_certificate: PEM file of our own certificate; empty for none
    :param client_key: PEM file of its private key
    :param request_timeout: seconds the service has to answer one request
    :param longest_pause: seconds between two attempts to deliver, at most
    :param waiting_alarm: seconds a result may wait before an alarm tells of it
    :param poll: seconds between two questions for an order while there is none
    """

    url: str
    station: str = "cell"
    outbox: str = ""
    token_file: str = ""
    ca_file: str = ""
    client_certificate: str = ""
    client_key: str = ""
    request_timeout: float = 2.0
    longest_pause: float = 30.0
    waiting_alarm: float = 60.0
    poll: float = 1.0

    def __post_init__(self) -> None:
        parts = check_url("url", self.url, "http", "https")
        if self.token_file and parts.scheme == "http" and not is_loopback(parts.hostname or ""):
            raise OutOfRange("token_file needs a url that begins with https: a token is not sent in clear")
        if parts.scheme == "http" and (self.ca_file or self.client_certificate):
            raise OutOfRange("ca_file and client_certificate need a url that begins with https")
        if bool(self.client_certificate) != bool(self.client_key):
            raise OutOfRange("client_key must be given with client_certificate, and only with it")
        self.token_file = secret_file("token_file", self.token_file, parts.hostname)
        for name in ("outbox", "ca_file", "client_certificate", "client_key"):
            setattr(self, name, device_file(name, getattr(self, name)))
        if not _STATION.fullmatch(self.station):
            raise OutOfRange(f"station must be 1 to 64 letters, digits, '.', '-' or '_', not {self.station!r}")
        _within("request_timeout", self.request_timeout, 0.1, 30.0)
        _within("longest_pause", self.longest_pause, 0.5, 600.0)
        _within("waiting_alarm", self.waiting_alarm, 0.1, 86400.0)
        _within("poll", self.poll, 0.1, 60.0)
