"""Settings of a PLC over OPC UA, checked when they are given."""

import dataclasses
import math
from typing import Final

from arcor2_hw.actions import StrEnum
from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects import Settings
from arcor2_hw.objects.settings import check_url, device_file, secret_file

from .points import parse_handshake, parse_points

LONGEST_PATIENCE: Final = 2.0
"""s: what the type declares as its reaction to a loss holds up to here."""


class Security(StrEnum):
    """How messages are protected."""

    NONE = "none"
    BASIC256SHA256_SIGN = "basic256sha256_sign"
    BASIC256SHA256_ENCRYPT = "basic256sha256_encrypt"
    AES128_SHA256_SIGN = "aes128_sha256_sign"
    AES128_SHA256_ENCRYPT = "aes128_sha256_encrypt"
    AES256_SHA256_SIGN = "aes256_sha256_sign"
    AES256_SHA256_ENCRYPT = "aes256_sha256_encrypt"


def within(name: str, value: float, low: float, high: float) -> None:
    """Raise OutOfRange, naming the parameter, unless the value lies in the range."""
    if not (math.isfinite(value) and low <= value <= high):
        raise OutOfRange(f"{name} must be {low:g} to {high:g}, not {value!r}")


@dataclasses.dataclass
class OpcUaPlcSettings(Settings):
    """Where the PLC is, and what its nodes mean.

    :param url: address of the OPC UA server, as opc.tcp://host:4840
    :param points: name=kind node and options, parted by |: "part=DI ns=2;s=Cell.Part | lamp=DO ns=2;s=Cell.Lamp
        on_loss=off | level=AI ns=2;i=7 scale=0.001 unit=m"; on_loss says what the PLC's program does with it
    :param handshake: nodes of the handshake: "owner=ns=2;s=H.Owner | host_life=... | plc_life=... | number=... |
        request=... | busy=... | done=... | error=... | code=..."; empty for a PLC without
    :param host_number: our number in owner; each program that may have control takes another
    :param plc_patience: seconds after which the PLC's program takes us for gone when our life sign stands still
    :param life_timeout: seconds after which we take the PLC's program for stopped when its life sign stands still
    :param request_timeout: seconds the server has to answer one request
    :param user: name of the user; empty for anonymous
    :param password_file: file with the user's password
    :param security: how messages are protected
    :param client_certificate: our certificate, PEM or DER file
    :param client_key: its private key, PEM file
    :param server_certificate: the certificate the server must have, PEM or DER file
    """

    url: str
    points: str
    handshake: str = ""
    host_number: int = 1
    plc_patience: float = 1.0
    life_timeout: float = 1.0
    request_timeout: float = 0.5
    user: str = ""
    password_file: str = ""
    security: Security = Security.NONE
    client_certificate: str = ""
    client_key: str = ""
    server_certificate: str = ""

    def __post_init__(self) -> None:
        host = check_url("url", self.url, "opc.tcp").hostname
        parse_points(self.points)
        parse_handshake(self.handshake)
        within("host_number", self.host_number, 1, 65535)
        within("plc_patience", self.plc_patience, 0.3, LONGEST_PATIENCE)
        within("life_timeout", self.life_timeout, 0.3, 10.0)
        # A request that is late by all its time must not let our own life sign stand still.
        within("request_timeout", self.request_timeout, 0.1, min(2.0, self.plc_patience))
        if bool(self.user) != bool(self.password_file):
            raise OutOfRange("password_file must be given with user, and only with it")
        certificates = ("client_certificate", "client_key", "server_certificate")
        self.password_file = secret_file("password_file", self.password_file, host)
        for name in certificates:
            setattr(self, name, device_file(name, getattr(self, name)))
            if bool(getattr(self, name)) != (self.security is not Security.NONE):
                raise OutOfRange(f"{name} must be given with a security other than none, and only with it")
