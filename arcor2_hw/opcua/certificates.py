"""The certificate of the OPC UA server, and the certificates of clients that it trusts, as files."""

import ipaddress
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final

from cryptography import x509
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec, rsa
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from arcor2_hw.files import replace_file

CERTIFICATE: Final = "opcua-certificate.pem"
KEY: Final = "opcua-key.pem"
AUTHORITY: Final = "opcua-authority.der"
REVOCATIONS: Final = "opcua-authority.crl"
"""The authority that issued the certificate, and its revocation list, for clients."""
TRUSTED: Final = "opcua-trusted"
REJECTED: Final = "opcua-rejected"
VALID_DAYS: Final = 3650
RENEW_DAYS: Final = 30
"""Remaining validity below which the certificate is renewed at the start, days."""
MAX_REJECTED: Final = 50
"""Maximum number of stored certificates that were rejected."""
Issuer = tuple[x509.Certificate, ec.EllipticCurvePrivateKey]
"""An authority: its certificate and its key."""
_ENDINGS: Final = (".der", ".pem", ".crt", ".cer")


def application_uri(machine: str) -> str:
    """Return the application URI of the server on a machine."""
    return f"urn:{machine}:arcor2-hw:opcua"


def own_certificate(folder: Path, machine: str, hosts: list[str], issuer: Issuer | None = None) -> tuple[Path, Path]:
    """Return the files of the certificate and its key. They are created if they are missing or expire soon.

    Args:
        folder: contains the files.
        machine: name of the machine.
        hosts: names and addresses of the server.
        issuer: signs a new certificate. None: the certificate is self-signed. A certificate that an issuer has
            signed is replaced if it was another one, or if the names have changed; one that is signed by its own key
            stays valid, because clients trust it by itself.
    """
    certificate, key = folder / CERTIFICATE, folder / KEY
    names: list[x509.GeneralName] = [x509.UniformResourceIdentifier(application_uri(machine)), *map(_name, hosts)]
    if not key.exists() or not _usable(certificate, list(dict.fromkeys(names)), issuer):
        _create(certificate, key, machine, list(dict.fromkeys(names)), issuer)
    return certificate, key


def _name(host: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(host))
    except ValueError:
        return x509.DNSName(host)


def _usable(file: Path, names: list[x509.GeneralName], issuer: Issuer | None) -> bool:
    try:
        found = x509.load_pem_x509_certificate(file.read_bytes())
        named = list(found.extensions.get_extension_for_class(x509.SubjectAlternativeName).value)
        if issuer is not None and found.issuer != found.subject:
            found.verify_directly_issued_by(issuer[0])
        else:
            names = names[:1]
    except (OSError, ValueError, TypeError, InvalidSignature, x509.ExtensionNotFound):
        return False
    lasts = found.not_valid_after_utc - datetime.now(UTC) > timedelta(days=RENEW_DAYS)
    return lasts and set(names) <= set(named)


def _create(
    certificate: Path, key_file: Path, machine: str, names: list[x509.GeneralName], issuer: Issuer | None
) -> None:
    """Create the certificate as OPC 10000-6 (6.2.2) requires. The RSA key is required by Basic256Sha256."""
    key = rsa.generate_private_key(65537, 2048)
    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, f"ARCOR2-HW OPC UA on {machine}"[:64])])
    start = datetime.now(UTC) - timedelta(days=1)
    end = start + timedelta(days=VALID_DAYS)
    signer: rsa.RSAPrivateKey | ec.EllipticCurvePrivateKey = key
    if issuer is not None:
        signer, end = issuer[1], min(end, issuer[0].not_valid_after_utc)
    built = (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(subject if issuer is None else issuer[0].subject)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(start)
        .not_valid_after(end)
        .add_extension(x509.SubjectAlternativeName(names), critical=False)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(
            x509.KeyUsage(
                digital_signature=True, content_commitment=True, key_encipherment=True, data_encipherment=True,
                key_agreement=False, key_cert_sign=issuer is None, crl_sign=False, encipher_only=False,
                decipher_only=False,
            ),
            critical=True,
        )
        .add_extension(x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH]), critical=False)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
        .add_extension(x509.AuthorityKeyIdentifier.from_issuer_public_key(signer.public_key()), critical=False)
        .sign(signer, hashes.SHA256())
    )  # fmt: skip
    pem = serialization.Encoding.PEM
    formats = serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    replace_file(key_file, key.private_bytes(pem, *formats))
    replace_file(certificate, built.public_bytes(pem), mode=0o644)


def write_authority(folder: Path, issuer: Issuer) -> None:
    """Write the files by which clients trust an authority: its certificate, and its empty revocation list."""
    certificate, key = issuer
    der = serialization.Encoding.DER
    content, list_file = certificate.public_bytes(der), folder / REVOCATIONS
    if list_file.exists() and _content(folder / AUTHORITY) == content:
        return
    revocations = (
        x509.CertificateRevocationListBuilder()
        .issuer_name(certificate.subject)
        .last_update(certificate.not_valid_before_utc)
        .next_update(certificate.not_valid_after_utc)
        .add_extension(x509.CRLNumber(1), critical=False)
        .add_extension(x509.AuthorityKeyIdentifier.from_issuer_public_key(key.public_key()), critical=False)
        .sign(key, hashes.SHA256())
    )
    replace_file(list_file, revocations.public_bytes(der), mode=0o644)
    replace_file(folder / AUTHORITY, content, mode=0o644)


def _content(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError:
        return b""


class TrustedClients:
    """The certificates of clients in a folder. Changes of its files take effect at the next connection.

    Args:
        folder: the folder that contains the folders of trusted and rejected certificates.
    """

    def __init__(self, folder: Path) -> None:
        self._trusted, self._rejected = folder / TRUSTED, folder / REJECTED
        for each in (self._trusted, self._rejected):
            each.mkdir(mode=0o700, exist_ok=True)

    def admits(self, certificate: bytes) -> bool:
        """Return whether a DER certificate is valid now and trusted; otherwise store it in the rejected folder."""
        try:
            client = x509.load_der_x509_certificate(certificate)
        except ValueError:
            return False
        if not client.not_valid_before_utc <= datetime.now(UTC) <= client.not_valid_after_utc:
            return False
        if any(_der(file) == certificate for file in self._trusted.iterdir() if file.suffix in _ENDINGS):
            return True
        self._store(certificate, client)
        return False

    def _store(self, certificate: bytes, client: x509.Certificate) -> None:
        file = self._rejected / f"{client.fingerprint(hashes.SHA256()).hex()}.der"
        if not file.exists() and sum(1 for _ in self._rejected.iterdir()) < MAX_REJECTED:
            file.write_bytes(certificate)


def _der(file: Path) -> bytes | None:
    try:
        content = file.read_bytes()
        loaded = (
            x509.load_pem_x509_certificate(content)
            if content.startswith(b"-----")
            else x509.load_der_x509_certificate(content)
        )
    except (OSError, ValueError):
        return None
    return loaded.public_bytes(serialization.Encoding.DER)
