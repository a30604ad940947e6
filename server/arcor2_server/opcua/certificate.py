"""The certificate of the OPC UA server, issued by the local authority of the workplace."""

import socket

import structlog

from arcor2_hw.opcua.certificates import AUTHORITY, REVOCATIONS, own_certificate, write_authority
from arcor2_server.access.addresses import certified_hosts
from arcor2_server.access.authority import Authority
from arcor2_server.settings import ServerSettings

log = structlog.get_logger(__name__)


def issue_certificate(settings: ServerSettings) -> None:
    """Let the local authority issue the certificate of the OPC UA server if it is missing or from another authority.

    Without a permitted authority, the process of the OPC UA server signs its certificate with its own key.
    """
    if settings.opcua is None or settings.authority is None:
        return
    hosts = certified_hosts(settings.opcua.host)
    issuer = Authority(settings.data_dir, lambda: hosts).issuer()
    if issuer is None:
        return
    try:
        own_certificate(settings.data_dir, socket.gethostname(), hosts, issuer)
        write_authority(settings.data_dir, issuer)
    except OSError as error:
        log.error("certificate of the OPC UA server not written", reason=str(error))
    else:
        log.info("OPC UA clients trust this authority", certificate=AUTHORITY, revocations=REVOCATIONS)
