"""The certificate of a server that other machines reach."""

import asyncio
import ssl
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

import arcor2_server.log
from arcor2_hw.exceptions import Arcor2Error
from arcor2_server.access.addresses import certified_hosts
from arcor2_server.cli.exit_status import CannotServe, ExitStatus
from arcor2_server.settings import ServerSettings, is_loopback

if TYPE_CHECKING:
    from arcor2_server.access.authority import Authority

log = arcor2_server.log.get_logger(__name__)

RENEW_PERIOD = 600.0
"""Time between two checks of the certificate, s."""


def certificate_of(
    settings: ServerSettings, given: tuple[Path, Path] | None, self_signed: bool
) -> tuple[ServerSettings, tuple[Path, Path] | None]:
    """Return the settings with the certificate, and the files of certificate and key; None without TLS.

    Raises:
        CannotServe: the certificate cannot be used.
    """
    if given is None and not self_signed and (settings.insecure or is_loopback(settings.host)):
        return settings, None
    from arcor2_server.access import certificate  # slow to import, and not needed without TLS

    authority = None
    try:
        if given is None:
            issuer = _authority(settings)
            issuer.renew()
            given, authority = issuer.files, issuer.file
            log.info("certificate authority", sha256=certificate.fingerprint(authority), file=str(authority))
        log.info("certificate", sha256=certificate.check(given), file=str(given[0]))
    except certificate.CertificateProblem as error:
        raise CannotServe(ExitStatus.CERTIFICATE_UNUSABLE, str(error)) from error
    return msgspec.structs.replace(settings, certificate=given[0], authority=authority), given


def _authority(settings: ServerSettings) -> "Authority":
    from arcor2_server.access.authority import Authority

    return Authority(settings.data_dir, lambda: certified_hosts(settings.host))


async def renew_certificate(settings: ServerSettings, used: ssl.SSLContext) -> None:
    """Renew the certificate before it expires, and when the machine has a new address. Clients stay connected."""
    authority = _authority(settings)
    while True:
        await asyncio.sleep(RENEW_PERIOD)
        try:
            if await asyncio.to_thread(authority.renew):
                used.load_cert_chain(*authority.files)
                log.info("certificate renewed", file=str(authority.files[0]))
        except (Arcor2Error, OSError) as error:
            log.error("the certificate cannot be renewed", reason=str(error))
