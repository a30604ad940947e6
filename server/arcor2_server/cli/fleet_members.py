"""`arcor2-hw fleet broker`, `accept`, `pair`, `list`, `revoke`: credentials of cells, sites and the page."""

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from arcor2_hw.exceptions import InvalidData
from arcor2_server.cli import members
from arcor2_server.settings import ServerSettings, default_data_dir

GROUP = "fleet"

DataDir = Annotated[Path | None, Parameter(help="Data directory ($XDG_DATA_HOME/arcor2-hw-fleet).")]


def add_to(app: App) -> None:
    """Add the commands to a group."""
    app.command(broker)
    app.command(accept)
    app.command(pair)
    app.command(list_members, name="list")
    app.command(revoke)


def fleet_data_dir(data_dir: Path | None) -> Path:
    """Return the given data directory, or the default one of the server of the page."""
    return data_dir or default_data_dir().with_name("arcor2-hw-fleet")


def broker(
    address: str,
    *,
    domain: str = "hub",
    sites: str | None = None,
    certificate: str = "",
    key: str = "",
    ca: Path | None = None,
    folder: str = "/var/lib/nats/arcor2-hw-fleet",
    data_dir: DataDir = None,
) -> int:
    """At the broker: create credentials for the page, and print the configuration for the broker (nats-server).

    Repeat it to change an address or the certificate; accepted cells stay accepted, but must be paired again to learn
    another address. On a computer that was paired as a site, the broker connects to that of the hub.

    Parameters
    ----------
    address
        Address of the broker for the page and the cells: tls://HOST:PORT, or nats://127.0.0.1:PORT for trials on one
        computer.
    domain
        JetStream domain of the broker, which differs at each site. At a site, it is the name of the site.
    sites
        Address for the brokers of sites, such as tls://HOST:7422. Without it, they are not accepted.
    certificate
        File of the certificate of the broker. The user of the broker must be able to read it.
    key
        File of its key.
    ca
        Certificate that the page, cells and sites trust. The default is the authority of this server, if it has one.
    folder
        Folder for the accounts and results. The user of the broker must be able to write it. At a site, copy hub.creds
        and hub.pem into it.
    """

    def work() -> None:
        from arcor2_server.fleet.accounts import set_up

        settings = _settings(data_dir)
        for each in (address, sites or ""):
            members.check_certificate(each, certificate, key)
        authority = members.trusted_authority(settings, ca)
        configuration = set_up(
            settings,
            address,
            authority,
            domain=domain,
            certificate=certificate,
            key_file=key,
            folder=folder,
            sites=sites or "",
        )
        sys.stdout.write(configuration)
        members.note(settings, "fleet broker", address)

    return members.run(GROUP, work)


def accept(
    name: str,
    *,
    site: bool = False,
    page: bool = False,
    host: str | None = None,
    port: int | None = None,
    data_dir: DataDir = None,
) -> int:
    """At the broker: show a code with which a cell, site or page gets its credentials, and wait for it.

    The code is valid for 10 minutes, for one computer, and for three attempts.

    Parameters
    ----------
    name
        Name of the cell, site or page: lower-case letters, digits, - and _.
    site
        Accept the broker of a site instead of a cell.
    page
        Accept the server of the page on another computer instead of a cell. There can be one.
    host
        Address to listen on. The default is all addresses.
    port
        Port to listen on (4223).
    """

    def work() -> None:
        from arcor2_server.fleet.accounts import fleet_accounts
        from arcor2_server.nodes.credentials import MemberKind

        if site and page:
            raise InvalidData("Choose one of --site and --page.")
        kind, place = MemberKind.MEMBER, "on the cell"
        if site:
            kind, place = MemberKind.SITE, "at the site"
        elif page:
            kind, place = MemberKind.PAGE, "on the computer of the page"
        settings = _settings(data_dir)
        members.accept(settings, fleet_accounts(settings), GROUP, place, name, host, port, kind, same_version=False)

    return members.run(GROUP, work)


def pair(
    name: str,
    *,
    server: str,
    data_dir: Annotated[
        Path | None,
        Parameter(
            help="Data directory of the cell ($XDG_DATA_HOME/arcor2-hw), or of the site or page "
            "($XDG_DATA_HOME/arcor2-hw-fleet)."
        ),
    ] = None,
) -> int:
    """On the cell, at the site, or on the computer of the page: get credentials for the broker.

    First run `arcor2-hw fleet accept NAME` at the broker. It shows a code, for which this command asks (or reads it
    from standard input).

    Parameters
    ----------
    name
        Name of this cell, site or page.
    server
        Address of the computer with `fleet accept` as HOST or HOST:PORT.
    """

    def work() -> None:
        from arcor2_server.fleet.accounts import HUB_AUTHORITY, HUB_FILE, paired_page, save_hub
        from arcor2_server.nodes.credentials import MemberKind

        found, key = members.pair(GROUP, name, server, same_version=False)
        if found.kind is MemberKind.PAGE:
            found.save(paired_page(_settings(data_dir)))
            following = "Start the server of the page: arcor2-hw fleet serve"
        elif found.kind is MemberKind.SITE:
            settings = _settings(data_dir)
            save_hub(settings, name, found)
            files = HUB_FILE + (f" and {HUB_AUTHORITY}" if found.authority else "")
            following = (
                f"Write the configuration of the broker: arcor2-hw fleet broker tls://HOST:4222 --domain {name}\n"
                f"It needs {files} from {settings.broker_dir}."
            )
        else:
            settings = ServerSettings(data_dir=data_dir or default_data_dir(), cell_name=name)
            found.save(settings.fleet_credentials)
            following = f"Start its server with ARCOR2_HW_CELL_NAME={name}."
        sys.stdout.write(f"paired {name}, key {key}\n{following}\n")

    return members.run(GROUP, work)


def list_members(*, data_dir: DataDir = None) -> int:
    """At the broker: list the accepted cells, sites and page."""

    def work() -> None:
        from arcor2_server.fleet.accounts import fleet_accounts

        empty = "There are no cells. Accept one with `arcor2-hw fleet accept NAME`."
        members.show(fleet_accounts(_settings(data_dir)), empty, kinds=True)

    return members.run(GROUP, work)


def revoke(name: str, *, data_dir: DataDir = None) -> int:
    """At the broker: revoke the credentials of a cell, site or page.

    The broker disconnects it at once. Pair it again to use it again.

    Parameters
    ----------
    name
        Name of the cell, site or page.
    """

    def work() -> None:
        from arcor2_server.fleet.accounts import fleet_accounts

        settings = _settings(data_dir)
        members.revoke(settings, fleet_accounts(settings), GROUP, name)

    return members.run(GROUP, work)


def _settings(data_dir: Path | None) -> ServerSettings:
    return ServerSettings(data_dir=fleet_data_dir(data_dir))
