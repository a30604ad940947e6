"""The keys of the server, and the members that it has accepted: nodes, or cells, sites and the page of the fleet.

The broker trusts one operator key. The operator signs two accounts: one in which the server, its members and other
services exchange messages, and one of the broker itself, over which the server revokes users.
"""

import contextlib
import fcntl
import os
import time
from collections.abc import Callable, Iterator
from typing import Final, NamedTuple

import msgspec
from nats.errors import Error as NatsError

from arcor2_hw.data.base import now
from arcor2_hw.exceptions import Conflict, ConnectionLost, NotFound, StorageError
from arcor2_server.files import DIRECTORY_MODE, FILE_MODE, write_private
from arcor2_server.nodes import claims
from arcor2_server.nodes.claims import Rights
from arcor2_server.nodes.connections import connect_client
from arcor2_server.nodes.credentials import Credentials, MemberKind, address_of, check_name, load, require_tls
from arcor2_server.nodes.lanes import PREFIX
from arcor2_server.nodes.nkeys import Kind, SigningKey
from arcor2_server.settings import ServerSettings, is_loopback

FILE: Final = "accounts.json"
ACCOUNT_NAME: Final = "ARCOR2-HW"
UPDATE_SUBJECT: Final = "$SYS.REQ.CLAIMS.UPDATE"
UPDATE_TIMEOUT: Final = 2.0
"""Time limit for the broker to accept a changed account, s."""


class Members(NamedTuple):
    """The rules for the members of an account.

    command: the group of commands that manage them. rights: returns the rights of a member by its name and kind.
    server: rights of the server; None for everything in the account.
    """

    command: str
    rights: Callable[[str, MemberKind], Rights]
    server: Rights | None = None


class AcceptedMember(msgspec.Struct, frozen=True):
    """A member that may connect.

    key: its public key. accepted: when (UTC). address: of its computer at that time. kind: kind of the member.
    """

    key: str
    accepted: str
    address: str = ""
    kind: MemberKind = MemberKind.MEMBER


class _State(msgspec.Struct):
    """The content of the file.

    operator, account, system: private keys. nodes: the members. issued: time of the last claim, s. sites: address for
    the brokers of sites; empty if they are not accepted.
    """

    url: str
    operator: str
    account: str
    system: str
    authority: str = ""
    nodes: dict[str, AcceptedMember] = {}
    revoked: list[str] = []
    issued: int = 0
    sites: str = ""


class _Answer(msgspec.Struct, frozen=True):
    """The answer of the broker to a changed account."""

    error: dict[str, object] | None = None


def node_rights(name: str, _kind: MemberKind) -> Rights:
    """Return the rights of a node.

    The server must not answer messages of nodes: the broker does not check the subject for an answer, which could be
    one of another node.
    """
    subjects = [f"{PREFIX}.{name}.>"]
    return Rights(subjects, subjects)


NODES: Final = Members("node", node_rights)


class Accounts:
    """The accounts of a broker. Other processes may change the file at any time.

    Args:
        settings: name the files, which are created when they are needed.
        members: the rules for its members.
    """

    def __init__(self, settings: ServerSettings, members: Members = NODES) -> None:
        self._members = members
        self._directory, self._server_file = settings.broker_dir, settings.broker_credentials
        self._file = self._directory / FILE

    # -------------------------------------------------------------------------------- broker
    def set_up(
        self, url: str, authority: str, *, certificate: str = "", key_file: str = "", folder: str, sites: str = ""
    ) -> str:
        """Create keys unless they exist, and the credentials of the server; return the configuration for the broker.

        Args:
            url: address of the broker, for the server and the members.
            authority: certificates to trust (PEM); empty for those that the system trusts.
            certificate: file of the certificate of the broker, on the broker's computer.
            key_file: file of its key.
            folder: in which the broker stores the accounts.
            sites: address of the broker for the brokers of sites; empty: they are not accepted.

        Raises:
            InvalidData: the address is invalid, or without TLS on another computer.
            StorageError: the files cannot be used.
            NotFound: the file of the server's credentials is missing, but not that of the keys.
        """
        require_tls(url)
        with self._locked():
            if self._file.exists():
                state = self._load()
                state.url, state.authority, state.sites = url, authority, sites
                # Its key stays the same, because the claim of an earlier key would stay valid.
                server = msgspec.structs.replace(load(self._server_file), url=url, authority=authority)
            else:
                state = _new_state(url, authority, sites)
                key = SigningKey.create(Kind.USER)
                claim = claims.user(SigningKey.from_seed(state.account), key.public, "server", self._members.server)
                server = Credentials(url, authority, claim, key.seed)
            claim = self._account_claim(state)
            server.save(self._server_file)
            self._save(state)
        operator = SigningKey.from_seed(state.operator)
        system = SigningKey.from_seed(state.system).public
        lines = [f"listen: {listening_address(url)}"]
        if url.startswith("tls://"):
            lines.append(f'tls {{ cert_file: "{certificate}", key_file: "{key_file}" }}')
        lines += [
            f"operator: {claims.operator(operator, system)}",
            f"system_account: {system}",
            f'resolver {{ type: full, dir: "{folder}", allow_delete: false }}',
            "resolver_preload {",
            f"  {SigningKey.from_seed(state.account).public}: {claim}",
            f"  {system}: {claims.account(operator, system, 'SYS', storage=False)}",
            "}",
        ]
        return "\n".join(lines) + "\n"

    # -------------------------------------------------------------------------------- members
    def account_key(self) -> str:
        """Return the public key of the account. Raise NotFound if there is none."""
        return SigningKey.from_seed(self._load().account).public

    def url(self) -> str:
        """Return the address of the broker. Raise NotFound if there is none."""
        return self._load().url

    def members(self) -> dict[str, AcceptedMember]:
        """Return the accepted members by name. Raise StorageError if the file cannot be used."""
        return self._load().nodes if self._file.exists() else {}

    def check_new(self, name: str, kind: MemberKind = MemberKind.MEMBER) -> None:
        """Check that a member can be accepted.

        Raises:
            InvalidData: the text is not a name.
            NotFound: the broker has not been set up.
            Conflict: the name is used, the broker does not accept sites, or it has accepted a server of the page.
        """
        self._check(name, self._load(), kind)

    def accept(self, name: str, key: str, address: str, kind: MemberKind = MemberKind.MEMBER) -> Credentials:
        """Accept a member; return its credentials without its private key.

        Args:
            name: its name.
            key: its public key.
            address: where it is, for the list.
            kind: kind of the member.

        Raises:
            InvalidData, NotFound, Conflict: see `check_new`.
            StorageError: the file cannot be written.
        """
        with self._locked():
            state = self._load()
            self._check(name, state, kind)
            state.nodes[name] = AcceptedMember(key, now(), address, kind)
            self._save(state)
        claim = claims.user(SigningKey.from_seed(state.account), key, name, self._members.rights(name, kind))
        return Credentials(state.sites if kind is MemberKind.SITE else state.url, state.authority, claim, kind=kind)

    async def revoke(self, name: str) -> None:
        """Revoke a member. The broker ends its connections at once.

        Raises:
            NotFound: there is no such member.
            ConnectionLost: the broker cannot be reached. The member is still in the list, so that this can be repeated.
            StorageError: the file cannot be used.
        """
        with self._locked():
            state = self._load()
            member = state.nodes.get(name)
            if member is None:
                raise NotFound("{name} has not been accepted.", name=name)
            if member.key not in state.revoked:
                state.revoked.append(member.key)
            claim = self._account_claim(state)
            self._save(state)
            try:
                await self._send(state, claim)
            except ConnectionLost as error:
                raise ConnectionLost(
                    "{name} may still have access, revoke it again: {reason}",
                    error.detail,
                    name=name,
                    reason=error,
                ) from error
            del state.nodes[name]
            self._save(state)

    async def _send(self, state: _State, claim: str) -> None:
        """Send the changed account to the broker, as a user of its system account."""
        key = SigningKey.create(Kind.USER)
        own = claims.user(SigningKey.from_seed(state.system), key.public, "revocation")
        client = await connect_client(Credentials(state.url, state.authority, own, key.seed), "arcor2-hw revocation")
        try:
            answer = await client.request(UPDATE_SUBJECT, claim.encode(), UPDATE_TIMEOUT)
            found = msgspec.json.decode(answer.data, type=_Answer)
        except (NatsError, OSError, msgspec.MsgspecError) as error:
            raise ConnectionLost("The broker did not confirm the change.", str(error)) from error
        finally:
            await client.close()
        if found.error is not None:
            raise ConnectionLost("The broker does not accept the change.", str(found.error))

    def _check(self, name: str, state: _State, kind: MemberKind) -> None:
        check_name(name)
        command = self._members.command
        if name in state.nodes:
            raise Conflict(
                "{name} is accepted already. Revoke it first: arcor2-hw {command} revoke {name}",
                name=name,
                command=command,
            )
        pages = [each for each, member in state.nodes.items() if member.kind is MemberKind.PAGE]
        if kind is MemberKind.PAGE and pages:
            raise Conflict(
                "{name} is the server of the page already. There can be one only, because each result is delivered "
                "once. Revoke it first: arcor2-hw {command} revoke {name}",
                name=pages[0],
                command=command,
            )
        if kind is MemberKind.SITE and not state.sites:
            raise Conflict(
                "The broker accepts no sites. Run `arcor2-hw {command} broker` with --sites first.", command=command
            )

    # -------------------------------------------------------------------------------- file
    def _account_claim(self, state: _State) -> str:
        """Return the claim of the account, newer than all earlier ones even if the clock was set back."""
        state.issued = max(int(time.time()), state.issued + 1)
        key = SigningKey.from_seed(state.account).public
        operator = SigningKey.from_seed(state.operator)
        return claims.account(operator, key, ACCOUNT_NAME, state.revoked, issued=state.issued)

    def _load(self) -> _State:
        try:
            return msgspec.json.decode(self._file.read_bytes(), type=_State)
        except FileNotFoundError as error:
            raise NotFound(
                "The broker is not set up. Run `arcor2-hw {command} broker` first.", command=self._members.command
            ) from error
        except (OSError, msgspec.MsgspecError) as error:
            raise StorageError("{file} cannot be used: {reason}.", file=self._file, reason=error) from error

    def _save(self, state: _State) -> None:
        try:
            write_private(self._file, msgspec.json.encode(state))
        except OSError as error:
            raise StorageError("{file} cannot be written: {reason}.", file=self._file, reason=error.strerror) from error

    @contextlib.contextmanager
    def _locked(self) -> Iterator[None]:
        """Exclude other processes that change the file."""
        try:
            self._directory.mkdir(mode=DIRECTORY_MODE, parents=True, exist_ok=True)
            lock = os.open(self._directory / ".lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, FILE_MODE)
        except OSError as error:
            raise StorageError(
                "{file} cannot be written: {reason}.", file=self._directory, reason=error.strerror
            ) from error
        try:
            fcntl.flock(lock, fcntl.LOCK_EX)
            yield
        finally:
            os.close(lock)


def _new_state(url: str, authority: str, sites: str) -> _State:
    operator, account, system = (SigningKey.create(kind) for kind in (Kind.OPERATOR, Kind.ACCOUNT, Kind.ACCOUNT))
    return _State(url, operator.seed, account.seed, system.seed, authority, sites=sites)


def listening_address(url: str) -> str:
    """Return the address on which a broker listens."""
    host, _, port = address_of(url).rpartition(":")
    return f"{host}:{port}" if is_loopback(host) else f"0.0.0.0:{port}"
