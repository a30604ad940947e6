"""Settings of a PLC over OPC UA."""

import dataclasses
from typing import Annotated, Final

from arcor2_hw.actions import StrEnum
from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects import Settings
from arcor2_hw.objects.settings import Range, check_url, device_file, secret_file, within

from .points import parse_handshake, parse_points

MAX_PATIENCE: Final = 2.0
"""Maximum of plc_patience, s; declared in `loss_reaction`."""


class Security(StrEnum):
    """How messages are protected."""

    NONE = "none"
    BASIC256SHA256_SIGN = "basic256sha256_sign"
    BASIC256SHA256_ENCRYPT = "basic256sha256_encrypt"
    AES128_SHA256_SIGN = "aes128_sha256_sign"
    AES128_SHA256_ENCRYPT = "aes128_sha256_encrypt"
    AES256_SHA256_SIGN = "aes256_sha256_sign"
    AES256_SHA256_ENCRYPT = "aes256_sha256_encrypt"


@dataclasses.dataclass
class OpcUaPlcSettings(Settings):
    """Address and credentials of the PLC, and its points.

    :param url: address of the OPC UA server, as opc.tcp://host:4840
    :param points: name=kind node and options, separated by |: "part=DI ns=2;s=Cell.Part | lamp=DO ns=2;s=Cell.Lamp
        on_loss=off | level=AI ns=2;i=7 scale=0.001 unit=m"; on_loss describes the reaction of the PLC program
    :param handshake: nodes of the handshake: "owner=ns=2;s=H.Owner | host_life=... | plc_life=... | number=... |
        request=... | busy=... | done=... | error=... | code=..."; empty for a PLC without a handshake
    :param host_number: our number in owner; unique among the programs that may have control
    :param plc_patience: time without a change of our life sign after which the PLC stops, s
    :param life_timeout: time without a change of its life sign after which the PLC program counts as stopped, s
    :param request_timeout: time the server has to answer one request, s
    :param user: name of the user; empty for anonymous
    :param password_file: file with the user's password
    :param security: how messages are protected
    :param client_certificate: client certificate, PEM or DER file
    :param client_key: its private key, PEM file
    :param server_certificate: certificate of the server, PEM or DER file
    """

    url: str
    points: str
    handshake: str = ""
    host_number: Annotated[int, Range(1, 65535)] = 1
    plc_patience: Annotated[float, Range(0.3, MAX_PATIENCE, "s")] = 1.0
    life_timeout: Annotated[float, Range(0.3, 10.0, "s")] = 1.0
    request_timeout: float = 0.5
    user: str = ""
    password_file: str = ""
    security: Security = Security.NONE
    client_certificate: str = ""
    client_key: str = ""
    server_certificate: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        host = check_url("url", self.url, "opc.tcp").hostname
        parse_points(self.points)
        parse_handshake(self.handshake)
        # The longest request must not delay our life sign too long.
        within("request_timeout", self.request_timeout, 0.1, min(2.0, self.plc_patience))
        if bool(self.user) != bool(self.password_file):
            raise OutOfRange("password_file must be given with user, and only with it")
        certificates = ("client_certificate", "client_key", "server_certificate")
        self.password_file = secret_file("password_file", self.password_file, host)
        for name in certificates:
            setattr(self, name, device_file(name, getattr(self, name)))
            if bool(getattr(self, name)) != (self.security is not Security.NONE):
                raise OutOfRange("{name} must be given with a security other than none, and only with it", name=name)
