"""The TLS certificate of the server: a configured one, or a self-signed one created here."""

import contextlib
import ipaddress
import socket
import ssl
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from arcor2_hw.exceptions import Arcor2Error
from arcor2_server.files import replace_file

VALID_DAYS: Final = 825
"""Period of validity, days. Some browsers refuse certificates with a longer one."""
RENEW_DAYS: Final = 30
"""Remaining validity below which the certificate is renewed, days."""
CERTIFICATE: Final = "certificate.pem"
KEY: Final = "key.pem"


class CertificateProblem(Arcor2Error):
    """A certificate or key cannot be used."""

    code = "certificate"


def fingerprint(files: tuple[Path, Path]) -> str:
    """Return the SHA-256 of a certificate as browsers show it.

    Raises:
        CertificateProblem: a file cannot be read, or the certificate does not belong to the key.
    """
    certificate, key = files
    try:
        ssl.create_default_context(ssl.Purpose.CLIENT_AUTH).load_cert_chain(certificate, key)
        found = x509.load_pem_x509_certificate(certificate.read_bytes())
    except (OSError, ValueError) as error:  # ssl.SSLError is an OSError
        reason = getattr(error, "strerror", None) or str(error)
        raise CertificateProblem(
            "the certificate {certificate} with the key {key} cannot be used: {reason}",
            certificate=certificate,
            key=key,
            reason=reason,
        ) from error
    return found.fingerprint(hashes.SHA256()).hex(":").upper()


def self_signed(data_dir: Path, host: str) -> tuple[Path, Path]:
    """Return the self-signed certificate and its key. Create them if missing, expiring, or made for another host."""
    files = (data_dir / CERTIFICATE, data_dir / KEY)
    if not _serves(files[0], host):
        try:
            _make(files, host)
        except OSError as error:
            raise CertificateProblem(
                "no certificate can be written to {data_dir}: {reason}", data_dir=data_dir, reason=error.strerror
            ) from error
    return files


def _serves(certificate: Path, host: str) -> bool:
    try:
        found = x509.load_pem_x509_certificate(certificate.read_bytes())
        named = found.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    except (OSError, ValueError, x509.ExtensionNotFound):
        return False
    lasts = found.not_valid_after_utc - datetime.now(UTC) > timedelta(days=RENEW_DAYS)
    return lasts and set(_names(host)) <= set(named)


def _names(host: str) -> list[x509.GeneralName]:
    """Return the names and addresses of this machine for the certificate."""
    texts = dict.fromkeys((host, socket.gethostname(), "localhost", "127.0.0.1", "::1"))
    names: list[x509.GeneralName] = []
    for text in texts:
        with contextlib.suppress(ValueError):
            address = ipaddress.ip_address(text)
            if not address.is_unspecified:
                names.append(x509.IPAddress(address))
            continue
        with contextlib.suppress(ValueError):  # not a valid DNS name
            names.append(x509.DNSName(text))
    return names


def _make(files: tuple[Path, Path], host: str) -> None:
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, f"ARCOR2-HW on {socket.gethostname()}"[:64])])
    begin = datetime.now(UTC)
    certificate = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(begin - timedelta(days=1))  # the clock of a tablet may be behind
        .not_valid_after(begin + timedelta(days=VALID_DAYS - 1))
        .add_extension(x509.SubjectAlternativeName(_names(host)), critical=False)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH]), critical=False)
        .sign(key, hashes.SHA256())
    )
    pem = serialization.Encoding.PEM
    secret = key.private_bytes(pem, serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
    replace_file(files[1], secret)
    replace_file(files[0], certificate.public_bytes(pem), mode=0o644)
