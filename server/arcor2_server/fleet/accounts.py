"""Who may connect to the broker of the fleet, and the broker's configuration. It needs the extra `nodes`.

Cells, brokers of sites, and the server of the page on another computer are members of the fleet's account, as nodes are
members of a server's account.
"""

from pathlib import Path
from typing import Final

import msgspec

from arcor2_hw.exceptions import Conflict, StorageError
from arcor2_server.files import DIRECTORY_MODE, write_private
from arcor2_server.fleet.records import PREFIX, STATES, answer_subject, stream_name
from arcor2_server.nodes.accounts import Accounts, Members, listening_address
from arcor2_server.nodes.claims import Rights
from arcor2_server.nodes.credentials import Credentials, MemberKind, check_name, require_tls
from arcor2_server.settings import ServerSettings

HUB_FILE: Final = "hub.creds"
"""File with which the broker of a site connects to that of the hub, in the directory of the broker."""
HUB_AUTHORITY: Final = "hub.pem"
"""File of the certificate to trust for the broker of the hub."""
_HUB: Final = "hub.json"
_CREDENTIALS: Final = """-----BEGIN NATS USER JWT-----
{}
------END NATS USER JWT------
-----BEGIN USER NKEY SEED-----
{}
------END USER NKEY SEED------
"""
"""Content of a file of credentials, as nats-server reads it."""
_ANSWERS: Final = "_INBOX.>"
"""Subjects of answers to the server of the page, which no cell may publish."""
SERVER_RIGHTS: Final = Rights(
    [f"$JS.{api}.{what}" for api in ("API", "*.API") for what in ("CONSUMER.>", "STREAM.CREATE.>", "STREAM.INFO.>")]
    + ["$JS.ACK.>"],
    [STATES, _ANSWERS],
)
"""Rights of the server of the page. It can create the streams of cells and read them, and publish nothing to cells."""


def member_rights(name: str, kind: MemberKind) -> Rights:
    """Return the rights of a cell, of the broker of a site, or of the server of the page on another computer.

    A cell may ask JetStream only for the domain and for its own stream. It may not create the stream: the configuration
    of a stream can name subjects of other cells. A site may publish states of any cell, and is asked for its results.
    """
    if kind is MemberKind.PAGE:
        return SERVER_RIGHTS
    if kind is MemberKind.SITE:
        return Rights([STATES, _ANSWERS], [f"$JS.{name}.API.>", f"$JS.ACK.{name}.>"], leaf=True)
    own = f"{PREFIX}.{name}"
    return Rights(
        [f"{own}.>", "$JS.API.INFO", f"$JS.API.STREAM.INFO.{stream_name(name)}"], [f"{answer_subject(name)}.>"]
    )


FLEET: Final = Members("fleet", member_rights, SERVER_RIGHTS)


def fleet_accounts(settings: ServerSettings) -> Accounts:
    """Return the accounts in the data directory of the computer of the broker."""
    return Accounts(settings, FLEET)


def paired_page(settings: ServerSettings) -> Path:
    """Return the file with the credentials of a page's server that was paired with a broker on another computer."""
    return settings.broker_dir / "page.json"


def set_up(
    settings: ServerSettings,
    url: str,
    authority: str,
    *,
    domain: str,
    certificate: str,
    key_file: str,
    folder: str,
    sites: str = "",
) -> str:
    """Create keys unless they exist; return the configuration for the broker.

    If this computer was paired with a hub, the broker connects to it as that of a site.

    Args:
        settings: name the data directory.
        url: address of the broker, for the server of the page and for cells.
        authority: certificates to trust (PEM); empty for those that the system trusts.
        domain: JetStream domain of the broker. It differs at each site.
        certificate: file of the certificate of the broker, on the broker's computer.
        key_file: file of its key.
        folder: for the files of the broker: accounts and results. It also contains the files for the hub.
        sites: address for the brokers of sites; empty: they are not accepted.

    Raises:
        InvalidData: an address or the domain is invalid, or an address is without TLS on another computer.
        Conflict: the broker of a site has another domain than its name.
        StorageError, NotFound: see `Accounts.set_up`.
    """
    check_name(domain)
    if sites:
        require_tls(sites)
    hub = _hub(settings)
    if hub is not None and hub.name != domain:
        raise Conflict("This site was paired as {name}. Use --domain {name}.", name=hub.name)
    accounts = fleet_accounts(settings)
    configuration = accounts.set_up(
        url, authority, certificate=certificate, key_file=key_file, folder=f"{folder}/accounts", sites=sites
    )
    leafnodes = []
    if sites:
        leafnodes.append(f"  listen: {listening_address(sites)}")
        if sites.startswith("tls://"):
            leafnodes.append(f'  tls {{ cert_file: "{certificate}", key_file: "{key_file}" }}')
    if hub is not None:
        remote = [f'url: "{hub.url}"', f"account: {accounts.account_key()}", f'credentials: "{folder}/{HUB_FILE}"']
        if hub.trusted:
            remote.append(f'tls {{ ca_file: "{folder}/{HUB_AUTHORITY}" }}')
        leafnodes.append(f"  remotes: [ {{ {', '.join(remote)} }} ]")
    lines = [f"server_name: {domain}", f'jetstream {{ store_dir: "{folder}/results", domain: {domain} }}']
    if leafnodes:
        lines += ["leafnodes {", *leafnodes, "}"]
    return configuration + "\n".join(lines) + "\n"


class _Hub(msgspec.Struct, frozen=True):
    """The hub of a site. name: of the site. trusted: whether there is a file with the certificate to trust."""

    name: str
    url: str
    trusted: bool


def save_hub(settings: ServerSettings, name: str, credentials: Credentials) -> None:
    """Store the credentials with which the broker of this site connects to the hub.

    Raises:
        StorageError: the files cannot be written.
    """
    url = credentials.url.replace("nats://", "nats-leaf://")
    directory = settings.broker_dir
    try:
        directory.mkdir(mode=DIRECTORY_MODE, parents=True, exist_ok=True)
        write_private(directory / HUB_FILE, _CREDENTIALS.format(credentials.claim, credentials.seed).encode())
        if credentials.authority:
            write_private(directory / HUB_AUTHORITY, credentials.authority.encode())
        hub = _Hub(name, url, bool(credentials.authority))
        write_private(directory / _HUB, msgspec.json.encode(hub))
    except OSError as error:
        raise StorageError("{file} cannot be written: {reason}.", file=directory, reason=error.strerror) from error


def _hub(settings: ServerSettings) -> _Hub | None:
    file = settings.broker_dir / _HUB
    try:
        return msgspec.json.decode(file.read_bytes(), type=_Hub)
    except FileNotFoundError:
        return None
    except (OSError, msgspec.MsgspecError) as error:
        raise StorageError("{file} cannot be used: {reason}.", file=file, reason=error) from error
