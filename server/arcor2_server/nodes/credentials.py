"""Credentials of a computer at the broker, and the file in which they are stored."""

import base64
import re
import ssl
from collections.abc import Mapping
from enum import StrEnum, auto
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import msgspec

from arcor2_hw.data.cell import BROKER_AUTHORITY, BROKER_CREDENTIALS, BROKER_URL, LOCAL_BROKER
from arcor2_hw.data.nodes import NAME
from arcor2_hw.exceptions import InvalidData, NotFound, StorageError
from arcor2_server.files import DIRECTORY_MODE, write_private
from arcor2_server.nodes.nkeys import SigningKey
from arcor2_server.settings import is_loopback


class MemberKind(StrEnum):
    """The kind of a member of the account of a broker."""

    MEMBER = auto()
    """A node, or a cell of the fleet."""
    SITE = auto()
    """The broker of a site of the fleet."""
    PAGE = auto()
    """The server of the page of the fleet."""


class Credentials(msgspec.Struct, frozen=True):
    """Address and credentials of the broker.

    url: address, with tls:// unless the broker is on this computer. authority: certificates to trust (PEM); empty for
    those that the system trusts. claim: signed by the server; empty without. seed: private key of this computer.
    kind: kind of member that this computer is; the broker of a site connects as a leaf node.
    """

    url: str
    authority: str = ""
    claim: str = ""
    seed: str = ""
    kind: MemberKind = MemberKind.MEMBER

    def __repr__(self) -> str:
        return f"Credentials({address_of(self.url)})"

    def options(self) -> dict[str, Any]:
        """Return the options of the client of NATS.

        Raises:
            InvalidData: the broker is on another computer and the address is without TLS, or a value is damaged.
        """
        require_tls(self.url)
        found: dict[str, Any] = {}
        if self.url.startswith("tls://"):  # without a context, the client would also accept a broker without TLS
            try:
                found["tls"] = ssl.create_default_context(cadata=self.authority or None)
            except ssl.SSLError as error:
                raise InvalidData("The certificate to trust cannot be used: {reason}", reason=error) from error
        if self.claim:
            key = SigningKey.from_seed(self.seed)
            found["user_jwt_cb"] = lambda: bytearray(self.claim.encode())
            found["signature_cb"] = lambda nonce: base64.b64encode(key.sign(nonce.encode()))
        return found

    def save(self, file: Path) -> None:
        """Write a file that only its owner may read.

        Raises:
            StorageError: it cannot be written.
        """
        try:
            file.parent.mkdir(mode=DIRECTORY_MODE, parents=True, exist_ok=True)
            write_private(file, msgspec.json.encode(self))
        except OSError as error:
            raise StorageError("{file} cannot be written: {reason}.", file=file, reason=error.strerror) from error


def load(file: Path) -> Credentials:
    """Read a file of credentials.

    Raises:
        NotFound: it does not exist.
        StorageError: it cannot be read, or is damaged.
    """
    try:
        return msgspec.json.decode(file.read_bytes(), type=Credentials)
    except FileNotFoundError as error:
        raise NotFound("{file} does not exist.", file=file) from error
    except (OSError, msgspec.MsgspecError) as error:
        raise StorageError("{file} cannot be used: {reason}.", file=file, reason=error) from error


def of_environment(environment: Mapping[str, str]) -> Credentials:
    """Return the credentials that the environment names: an address of the broker, or else a file.

    Raises:
        StorageError: a file cannot be read.
    """
    file = Path(environment.get(BROKER_CREDENTIALS, ""))
    if not environment.get(BROKER_URL) and file.is_file():
        return load(file)
    return of_address(environment.get(BROKER_URL) or LOCAL_BROKER, environment.get(BROKER_AUTHORITY, ""))


def of_address(url: str, authority: str = "") -> Credentials:
    """Return credentials that consist of an address, which may contain a user and a password.

    Args:
        url: the address.
        authority: file of the certificate to trust; empty for those that the system trusts.

    Raises:
        StorageError: the file cannot be read.
    """
    try:
        return Credentials(url, Path(authority).read_text() if authority else "")
    except (OSError, ValueError) as error:
        raise StorageError("{file} cannot be used: {reason}.", file=authority, reason=error) from error


def require_tls(url: str) -> None:
    """Check the address of a broker.

    Raises:
        InvalidData: it is invalid, or the broker is on another computer and the address is without TLS.
    """
    try:
        parts = urlsplit(url)
        host, _ = parts.hostname, parts.port
    except ValueError as error:
        raise InvalidData("The address of the broker is invalid: {reason}", reason=error) from error
    if parts.scheme not in ("nats", "tls") or not host:
        raise InvalidData("The address of the broker must be tls://HOST:PORT, or nats://127.0.0.1:PORT.")
    if parts.scheme != "tls" and not is_loopback(host):
        raise InvalidData(
            "The broker at {host} is on another computer. Configure TLS there, and use an address with tls://.",
            host=host,
        )


def address_of(url: str) -> str:
    """Return an address without user and password."""
    parts = urlsplit(url)
    return f"{parts.hostname or url}:{parts.port or 4222}"


def check_name(name: str) -> None:
    """Check a name of a node, or of a cell or site of the fleet. Raise InvalidData if it is invalid."""
    if not re.fullmatch(NAME, name):
        raise InvalidData("{name!r} is not a valid name: use lower-case letters, digits, - and _.", name=name)


def node_file(data_dir: Path, node: str) -> Path:
    """Return the file with the credentials of a node, on the node."""
    return data_dir / "node" / f"{node}.json"


def environment_without(environment: Mapping[str, str]) -> dict[str, str]:
    """Return an environment for processes of devices, without the address of the broker and its password."""
    return {key: value for key, value in environment.items() if key not in (BROKER_URL, BROKER_CREDENTIALS)}
