"""Certificates for TLS: the fingerprint of a certificate, and whether it fits its key."""

import ssl
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes

from arcor2_hw.exceptions import Arcor2Error


class CertificateProblem(Arcor2Error):
    """A certificate or key cannot be used."""

    code = "certificate"


def check(files: tuple[Path, Path]) -> str:
    """Return the SHA-256 fingerprint of a certificate after checking that it belongs to the key.

    Raises:
        CertificateProblem: a file cannot be read, or the certificate does not belong to the key.
    """
    certificate, key = files
    try:
        ssl.create_default_context(ssl.Purpose.CLIENT_AUTH).load_cert_chain(certificate, key)
        return fingerprint(certificate)
    except (OSError, ValueError) as error:  # ssl.SSLError is an OSError
        reason = getattr(error, "strerror", None) or str(error)
        raise CertificateProblem(
            "the certificate {certificate} with the key {key} cannot be used: {reason}",
            certificate=certificate,
            key=key,
            reason=reason,
        ) from error


def fingerprint(file: Path) -> str:
    """Return the SHA-256 of the first certificate of a PEM file as browsers show it.

    Raises:
        OSError: the file cannot be read.
        ValueError: the file contains no certificate.
    """
    found = x509.load_pem_x509_certificate(file.read_bytes())
    return found.fingerprint(hashes.SHA256()).hex(":").upper()
