"""A local certificate authority, which a device installs once, and the certificate that it issues to this server."""

import contextlib
import ipaddress
import socket
from collections.abc import Callable, Iterable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final

import structlog
from cryptography import x509
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from arcor2_server.access.certificate import CertificateProblem
from arcor2_server.files import replace_file

log = structlog.get_logger(__name__)

AUTHORITY: Final = "authority.pem"
AUTHORITY_KEY: Final = "authority-key.pem"
CERTIFICATE: Final = "certificate.pem"
KEY: Final = "key.pem"

AUTHORITY_DAYS: Final = 3650
"""Period of validity of the authority, days."""
VALID_DAYS: Final = 397
"""Period of validity of the server's certificate, days. Apple devices refuse more than 398."""
RENEW_DAYS: Final = 30
"""Remaining validity below which a certificate is renewed, days."""

_LOCAL_NETWORKS: Final = tuple(
    ipaddress.ip_network(network)
    for network in (
        "127.0.0.0/8", "10.0.0.0/8", "172.16.0.0/12", "192.168.0.0/16", "169.254.0.0/16", "100.64.0.0/10",
        "::1/128", "fc00::/7", "fe80::/10",
    )
)  # fmt: skip
"""Networks without a public owner. The authority may certify addresses in them."""


class Authority:
    """The local certificate authority in a data directory.

    Its constraints limit it to names of this machine, names in `.local`, and addresses of local networks. A stolen key
    can therefore not impersonate other web sites to the devices that trust the authority.

    Args:
        data_dir: directory of the four PEM files.
        hosts: returns the names and addresses that the certificate must contain.
    """

    def __init__(self, data_dir: Path, hosts: Callable[[], Iterable[str]]) -> None:
        self.file = data_dir / AUTHORITY
        self._key_file = data_dir / AUTHORITY_KEY
        self.files = (data_dir / CERTIFICATE, data_dir / KEY)
        """The server's certificate, followed by that of the authority, and its key."""
        self._hosts = hosts

    def renew(self) -> bool:
        """Create what is missing, expires soon or lacks a name. Return whether the server has a new certificate.

        Raises:
            CertificateProblem: the files cannot be written.
        """
        names = _names(self._hosts())
        try:
            known = self._load()
            if known is None or not _permits(known[0], names):
                known = self._create(names)
            if _serves(self.files[0], known[0], names):
                return False
            self._issue(known, names)
        except OSError as error:
            directory = self.file.parent
            raise CertificateProblem(
                "no certificate can be written to {data_dir}: {reason}", data_dir=directory, reason=error.strerror
            ) from error
        return True

    def issuer(self) -> "Issuer | None":
        """Return the certificate and the key of the authority for issuing another certificate for `hosts`.

        None if there is no authority, if it may not certify these names, or if it may not sign a revocation list, as
        those that were created before it was needed.
        """
        known = self._load()
        if known is None or not _permits(known[0], _names(self._hosts())):
            return None
        return known if known[0].extensions.get_extension_for_class(x509.KeyUsage).value.crl_sign else None

    def _load(self) -> "Issuer | None":
        """Return the certificate and the key of the authority; None if they are missing, damaged or expire soon."""
        try:
            certificate = x509.load_pem_x509_certificate(self.file.read_bytes())
            key = serialization.load_pem_private_key(self._key_file.read_bytes(), None)
        except (OSError, ValueError):
            return None
        if not isinstance(key, ec.EllipticCurvePrivateKey) or key.public_key() != certificate.public_key():
            return None
        # The certificate of the server must not outlive the authority.
        return (certificate, key) if _lasts(certificate, VALID_DAYS) else None

    def _create(self, names: list[x509.GeneralName]) -> "Issuer":
        key = ec.generate_private_key(ec.SECP256R1())
        name = _subject(f"ARCOR2-HW authority of {socket.gethostname()}")
        certificate = (
            _builder(name, name, key.public_key(), AUTHORITY_DAYS)
            .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
            .add_extension(_usage(authority=True), critical=True)
            # Not critical: a system that cannot check addresses would refuse the authority.
            .add_extension(x509.NameConstraints(_permitted(names), None), critical=False)
            .sign(key, hashes.SHA256())
        )
        if self.file.exists():
            log.warning("new certificate authority: install it on every device again", file=str(self.file))
        replace_file(self._key_file, _private_bytes(key))
        replace_file(self.file, certificate.public_bytes(serialization.Encoding.PEM), mode=0o644)
        return certificate, key

    def _issue(self, authority: "Issuer", names: list[x509.GeneralName]) -> None:
        issuer, issuer_key = authority
        key = ec.generate_private_key(ec.SECP256R1())
        certificate = (
            _builder(_subject(f"ARCOR2-HW on {socket.gethostname()}"), issuer.subject, key.public_key(), VALID_DAYS)
            .add_extension(x509.SubjectAlternativeName(names), critical=False)
            .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
            .add_extension(_usage(digital_signature=True), critical=True)
            .add_extension(x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH]), critical=False)
            .add_extension(_key_id(issuer_key), critical=False)
            .sign(issuer_key, hashes.SHA256())
        )
        pem = serialization.Encoding.PEM
        replace_file(self.files[1], _private_bytes(key))
        replace_file(self.files[0], certificate.public_bytes(pem) + issuer.public_bytes(pem), mode=0o644)


Issuer = tuple[x509.Certificate, ec.EllipticCurvePrivateKey]
"""An authority: its certificate and its key."""


def _names(hosts: Iterable[str]) -> list[x509.GeneralName]:
    names: list[x509.GeneralName] = []
    for host in dict.fromkeys(hosts):
        with contextlib.suppress(ValueError):
            address = ipaddress.ip_address(host.strip("[]"))
            if not address.is_unspecified:
                names.append(x509.IPAddress(address))
            continue
        with contextlib.suppress(ValueError):  # not a valid DNS name
            names.append(x509.DNSName(host))
    return names


def _permitted(names: list[x509.GeneralName]) -> list[x509.GeneralName]:
    """Return the names for the constraints of the authority: those given, `.local`, and all local addresses."""
    permitted = dict.fromkeys(name for name in names if isinstance(name, x509.DNSName))
    permitted[x509.DNSName("local")] = None
    networks = [x509.IPAddress(network) for network in _LOCAL_NETWORKS]
    public = [
        x509.IPAddress(ipaddress.ip_network(name.value))
        for name in names
        if isinstance(name, x509.IPAddress) and not any(name.value in network for network in _LOCAL_NETWORKS)
    ]
    return [*permitted, *networks, *public]


def _permits(authority: x509.Certificate, names: list[x509.GeneralName]) -> bool:
    try:
        limits = authority.extensions.get_extension_for_class(x509.NameConstraints).value.permitted_subtrees or []
    except x509.ExtensionNotFound:
        return True
    suffixes = [limit.value for limit in limits if isinstance(limit, x509.DNSName)]
    networks = [
        limit.value for limit in limits if isinstance(limit.value, ipaddress.IPv4Network | ipaddress.IPv6Network)
    ]
    return all(
        any(name.value in network for network in networks)
        if isinstance(name, x509.IPAddress)
        else any(f".{name.value}".endswith(f".{suffix}") for suffix in suffixes)
        for name in names
    )


def _serves(file: Path, authority: x509.Certificate, names: list[x509.GeneralName]) -> bool:
    """Return whether a certificate was issued by the authority, contains the names and does not expire soon."""
    try:
        found = x509.load_pem_x509_certificate(file.read_bytes())
        named = found.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
        found.verify_directly_issued_by(authority)
    except (OSError, ValueError, TypeError, x509.ExtensionNotFound, InvalidSignature):
        return False
    return _lasts(found, RENEW_DAYS) and set(names) <= set(named)


def _lasts(certificate: x509.Certificate, days: int) -> bool:
    return certificate.not_valid_after_utc - datetime.now(UTC) > timedelta(days=days)


def _builder(
    subject: x509.Name, issuer: x509.Name, key: ec.EllipticCurvePublicKey, days: int
) -> x509.CertificateBuilder:
    begin = datetime.now(UTC) - timedelta(days=1)  # the clock of a tablet may be behind
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(key)
        .serial_number(x509.random_serial_number())
        .not_valid_before(begin)
        .not_valid_after(begin + timedelta(days=days))
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key), critical=False)
    )


def _subject(name: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name[:64])])


def _usage(*, authority: bool = False, digital_signature: bool = False) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=digital_signature,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        key_cert_sign=authority,
        crl_sign=authority,
        encipher_only=False,
        decipher_only=False,
    )


def _key_id(key: ec.EllipticCurvePrivateKey) -> x509.AuthorityKeyIdentifier:
    return x509.AuthorityKeyIdentifier.from_issuer_public_key(key.public_key())


def _private_bytes(key: ec.EllipticCurvePrivateKey) -> bytes:
    formats = serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    return key.private_bytes(serialization.Encoding.PEM, *formats)
