"""Credentials of nodes: pairing, rights, revocation, and TLS, with a real broker on this computer."""

import asyncio
import contextlib
import os
import ssl
import subprocess
import time
from collections.abc import AsyncIterator, Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from nats.aio.msg import Msg

from arcor2_hw.data.cell import BROKER_URL
from arcor2_hw.data.nodes import NodeState
from arcor2_hw.exceptions import Arcor2Error, Conflict, ConnectionLost, InvalidData, NotFound, OutcomeUnknown, Refused
from arcor2_server.audit.chain import AuditFile
from arcor2_server.cli import node as cli
from arcor2_server.cli.exit_status import ExitStatus
from arcor2_server.hosts.process import CellHost
from arcor2_server.nodes import opening, pairing
from arcor2_server.nodes.accounts import Accounts, listening_address
from arcor2_server.nodes.confirmation import confirm_sent
from arcor2_server.nodes.connections import answer_subject, connect_client
from arcor2_server.nodes.credentials import Credentials, load, node_file, require_tls
from arcor2_server.nodes.nkeys import Kind, SigningKey, is_user_key
from arcor2_server.nodes.presence import own_version
from arcor2_server.settings import ServerSettings
from tests import commands
from tests.server.nodes.conftest import NODE, PATIENCE, Connected, Node, Server, followed, paired_by_commands
from tests.server.nodes.test_node_hosts import moving, online
from tests.waiting import wait_for

pytestmark = pytest.mark.xdist_group("nodes")

CUT_WITHIN = 2.0  # s


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Server]:
    running = Server(tmp_path)
    yield running
    running.broker.end()


# ---------------------------------------------------------------------------------------------------- command line
def command(*words: str, code: str = "") -> "subprocess.CompletedProcess[str]":
    return commands.run(commands.CLI, "node", *words, given=code)


def pair_by_command(server: Server, folder: Path) -> str:
    """Pair a node as a technician does; return what the node prints."""
    run, printed = paired_by_commands("node", NODE, server.settings.data_dir, folder)
    assert run.startswith(f"Run on the node: arcor2-hw node pair {NODE} --server 127.0.0.1:")
    return printed


async def test_a_node_is_paired_works_is_revoked_and_paired_again(
    server: Server, start_host: Callable[..., Any], tmp_path: Path
) -> None:
    data = tmp_path / "arcor2-hw"
    await asyncio.to_thread(pair_by_command, server, data)
    assert node_file(data, NODE).stat().st_mode & 0o077 == 0
    node = Node("", tmp_path)
    try:
        host, _ = await start_host(environment=server.environment)
        await online(host)
        assert await host.call("obj_arm", "add", {"a": b"1", "b": b"2"}) == b"3"
        async with followed(server.environment) as until:
            await until(NodeState.CONNECTED, ["scene"])
        call = moving(host, tmp_path / "moving")
        await asyncio.to_thread(wait_for, (tmp_path / "moving").exists)

        begin = time.monotonic()
        assert await asyncio.to_thread(cli.revoke, NODE, data_dir=server.settings.data_dir) == ExitStatus.OK
        await asyncio.to_thread(wait_for, (tmp_path / "moving.stopped").exists)
        assert time.monotonic() - begin < CUT_WITHIN
        with pytest.raises(OutcomeUnknown, match=f"the connection to the node {NODE} was lost"):
            await call
        with pytest.raises(Arcor2Error, match=f"The node {NODE} is not connected"):
            await start_host(environment=server.environment)
        accepted(server, NODE).save(node_file(data, NODE))
        assert await asyncio.to_thread(node.process.stdout.readline) == f"ready {NODE}\n"  # type: ignore[union-attr]
        await start_host(environment=server.environment)
    finally:
        node.end()
    with contextlib.closing(AuditFile(server.settings.audit_file)) as file:
        audited = [(entry.request, entry.target.split(",")[0]) for entry in file.all()]
    assert audited == [("arcor2-hw node accept", NODE), ("arcor2-hw node revoke", NODE)]


@pytest.mark.parametrize(
    ("url", "address"),
    [
        ("tls://hub.local:4222", "0.0.0.0:4222"),
        ("tls://127.0.0.1:4222", "127.0.0.1:4222"),
        ("nats://127.0.0.1:4222", "127.0.0.1:4222"),
    ],
)
def test_a_broker_on_loopback_listens_only_there(url: str, address: str) -> None:
    assert listening_address(url) == address


def test_accepted_nodes_are_listed(server: Server, capsys: pytest.CaptureFixture[str]) -> None:
    data = server.settings.data_dir
    assert cli.list_nodes(data_dir=data) == ExitStatus.OK
    assert "There are no nodes" in capsys.readouterr().out
    accepted(server, NODE)
    cli.list_nodes(data_dir=data)
    name, key, *_ = capsys.readouterr().out.splitlines()[1].split()
    assert (name, key) == (NODE, pairing.short_key(server.accounts.members()[NODE].key))
    assert cli.revoke("oven", data_dir=data) == ExitStatus.NOT_FOUND


# ---------------------------------------------------------------------------------------------------- rights
def accepted(server: Server, name: str) -> Credentials:
    key = SigningKey.create(Kind.USER)
    found = server.accounts.accept(name, key.public, "127.0.0.1")
    return Credentials(found.url, found.authority, found.claim, key.seed)


FORBIDDEN = (
    "arcor2.oven.open", "arcor2.oven.session.node.calls", "arcor2.fleet.cell", "fleet.cell", "_INBOX.any.1",
    "$JS.API.INFO", "$SYS.REQ.CLAIMS.UPDATE",
)  # fmt: skip


async def test_a_node_reaches_only_its_own_subjects(server: Server) -> None:
    press, oven = await Connected().connect(accepted(server, NODE)), await Connected().connect(accepted(server, "oven"))
    hub = await Connected().connect(load(server.settings.broker_credentials))
    received: list[str] = []

    async def receive(message: Msg) -> None:
        received.append(message.subject)

    async def answer(message: Msg) -> None:
        await message.respond(b"answer")

    try:
        for client in (hub.client, oven.client):
            await client.subscribe("arcor2.oven.>" if client is oven.client else ">", cb=receive)
            await confirm_sent(client)
        for subject in FORBIDDEN:
            await press.client.publish(subject, b"x")
        for subject in (*FORBIDDEN, "arcor2.oven.>", "arcor2.*.open", "arcor2.>", ">", "_INBOX.>"):
            await press.client.subscribe(subject, cb=receive)
        await press.client.subscribe(f"arcor2.{NODE}.open", cb=answer)
        await press.client.publish(f"arcor2.{NODE}.session.node.calls", b"x")
        await confirm_sent(press.client)
        await confirm_sent(hub.client)
        await confirm_sent(oven.client)
        assert [each for each in received if not each.startswith("$SYS")] == [f"arcor2.{NODE}.session.node.calls"]
        assert len(press.errors) == 2 * len(FORBIDDEN) + 5, press.errors
        assert all("permissions violation" in each for each in press.errors)
        # A node cannot reach another one by a request to itself with a subject of the other one for the answer.
        received.clear()
        await press.client.publish(f"arcor2.{NODE}.open", b"x", reply="arcor2.oven.open")
        relay = await connect_client(load(server.settings.broker_credentials), "relay", answers=answer_subject(NODE))
        assert (await relay.request(f"arcor2.{NODE}.open", b"x", 5.0)).data == b"answer"
        await relay.close()
        await confirm_sent(oven.client)
        assert 'permissions violation for publish to "arcor2.oven.open"' in press.errors[-1]
        assert "arcor2.oven.open" not in received
    finally:
        for each in (press, oven, hub):
            await each.client.close()


async def test_only_the_revoked_node_is_cut_and_stays_out(server: Server) -> None:
    lost, other = accepted(server, NODE), accepted(server, "oven")
    press, oven = await Connected().connect(lost), await Connected().connect(other)
    await server.accounts.revoke(NODE)
    async with asyncio.timeout(CUT_WITHIN):
        await press.closed.wait()
    assert oven.client.is_connected
    await oven.client.close()
    await asyncio.to_thread(server.restart_broker)
    for credentials in (lost, Credentials(lost.url)):
        with pytest.raises(ConnectionLost, match="refuses the credentials"):
            await connect_client(credentials, "test")
    again = [await Connected().connect(each) for each in (other, accepted(server, NODE))]
    for each in again:
        await each.client.close()


async def test_a_revocation_that_does_not_reach_the_broker_can_be_repeated(server: Server) -> None:
    credentials = accepted(server, NODE)
    server.broker.process.kill()
    with pytest.raises(
        ConnectionLost, match=r"press may still have access, revoke it again: The broker at .* cannot be reached"
    ):
        await server.accounts.revoke(NODE)
    assert NODE in server.accounts.members()
    await asyncio.to_thread(server.restart_broker)
    await server.accounts.revoke(NODE)
    assert NODE not in server.accounts.members()
    with pytest.raises(ConnectionLost, match="refuses the credentials"):
        await connect_client(credentials, "test")


def test_credentials_are_private(tmp_path: Path) -> None:
    accounts = Accounts(settings := ServerSettings(data_dir=tmp_path))
    with pytest.raises(NotFound, match="arcor2-hw node broker"):
        accounts.check_new(NODE)
    accounts.set_up("nats://127.0.0.1:4222", "", folder="/unused")
    server = settings.broker_credentials.read_bytes()
    configuration = accounts.set_up("tls://hub.local:4222", "PEM", certificate="/c", key_file="/k", folder="/unused")
    assert {each.stat().st_mode & 0o777 for each in settings.broker_dir.iterdir()} == {0o600}
    assert settings.broker_dir.stat().st_mode & 0o777 == 0o700
    seeds = [
        part for part in (server + (settings.broker_dir / "accounts.json").read_bytes()).split(b'"') if part[:1] == b"S"
    ]
    assert len(seeds) == 4
    assert not any(seed.decode() in configuration for seed in seeds)
    assert settings.broker_credentials.read_bytes() != server, "the address did not change"


# ---------------------------------------------------------------------------------------------------- codes
class Offer:
    """An invitation that listens, and the keys that it has accepted."""

    def __init__(self, valid: float) -> None:
        self.accepted: list[str] = []
        self.invitation = pairing.Invitation(NODE, self._accept, valid)
        self.port = 0

    def _accept(self, key: str, address: str) -> Credentials:
        self.accepted.append(key)
        return Credentials("nats://127.0.0.1:4222", claim="claim")

    async def pair(self, code: str, port: int = 0, name: str = NODE) -> Credentials:
        return await pairing.pair(name, "127.0.0.1", port or self.port, code)


@pytest.fixture
def cheap_keys(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pairing, "_COST", 1 << 10)


@contextlib.asynccontextmanager
async def offered(valid: float = PATIENCE) -> AsyncIterator[Offer]:
    offer = Offer(valid)
    async with offer.invitation.listening("127.0.0.1", 0) as offer.port:
        yield offer


@pytest.mark.usefixtures("cheap_keys")
async def test_a_code_is_valid_once() -> None:
    async with offered() as offer:
        with pytest.raises(Refused, match="The code is wrong"):
            await offer.pair("WRNG-CDEE")
        with pytest.raises(Refused, match=f"This code is for {NODE}"):
            await offer.pair(offer.invitation.code, name="oven")
        found = await offer.pair(offer.invitation.code)
        key = await offer.invitation.wait_accepted()
        assert (found.claim, SigningKey.from_seed(found.seed).public) == ("claim", key)
        with pytest.raises(ConnectionLost):
            await offer.pair(offer.invitation.code)
        assert offer.accepted == [key]


@pytest.mark.usefixtures("cheap_keys")
async def test_a_code_is_void_after_wrong_ones_and_when_it_expires() -> None:
    async with offered() as offer:
        for _ in range(pairing.MAX_ATTEMPTS):
            with pytest.raises(Refused):
                await offer.pair("WRNG-CDEE")
        with pytest.raises(Refused, match="3 times"):
            await offer.invitation.wait_accepted()
        with pytest.raises(ConnectionLost):
            await offer.pair(offer.invitation.code)
    async with offered(valid=0.01) as late:
        with pytest.raises(Refused, match="expired"):
            await late.invitation.wait_accepted()
        with pytest.raises(ConnectionLost):
            await late.pair(late.invitation.code)
    assert offer.accepted == late.accepted == []


@pytest.mark.usefixtures("cheap_keys")
async def test_another_version_is_refused_and_does_not_use_up_the_code(monkeypatch: pytest.MonkeyPatch) -> None:
    async with offered() as offer:
        versions = iter(["9.9.9", own_version(), own_version()])
        with monkeypatch.context() as patch:
            patch.setattr(pairing, "own_version", versions.__next__)
            patch.setattr(opening, "own_version", lambda: "9.9.9")
            with pytest.raises(Refused, match=r"press runs version 9\.9\.9 .* install the same one"):
                await offer.pair(offer.invitation.code)
        await offer.pair(offer.invitation.code)


@pytest.mark.usefixtures("cheap_keys")
async def test_a_man_in_the_middle_gets_no_credentials() -> None:
    """It terminates TLS on both sides, with its own certificate, and passes everything on."""
    async with offered() as offer:

        async def forward(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            server_reader, server_writer = await asyncio.open_connection("127.0.0.1", offer.port, ssl=insecure)
            server_writer.write(await reader.readline())
            writer.write(await server_reader.readline())
            server_writer.close()
            writer.close()

        insecure = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        insecure.check_hostname, insecure.verify_mode = False, ssl.CERT_NONE
        own, _ = pairing._server_context()
        middle = await asyncio.start_server(forward, "127.0.0.1", 0, ssl=own)
        async with middle:
            with pytest.raises(Refused, match="is not the server"):
                await offer.pair(offer.invitation.code, middle.sockets[0].getsockname()[1])
        assert not offer.accepted
        await offer.pair(offer.invitation.code)


@pytest.mark.usefixtures("cheap_keys")
async def test_invalid_messages_do_not_use_up_the_code() -> None:
    insecure = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    insecure.check_hostname, insecure.verify_mode = False, ssl.CERT_NONE
    async with offered() as offer:
        for sent in (b"\n", b"zz {}\n", b"00 {}\n", b"00 \xff\n", b"x" * 100_000 + b"\n"):
            reader, writer = await asyncio.open_connection("127.0.0.1", offer.port, ssl=insecure)
            writer.write(sent)
            with contextlib.suppress(ConnectionError):
                assert await reader.read() == b""
            writer.close()
        await offer.pair(offer.invitation.code)


def test_a_name_is_used_once_and_has_no_wildcards(tmp_path: Path) -> None:
    accounts = Accounts(ServerSettings(data_dir=tmp_path))
    accounts.set_up("nats://127.0.0.1:4222", "", folder="/unused")
    accounts.accept(NODE, SigningKey.create(Kind.USER).public, "")
    with pytest.raises(Conflict, match="Revoke it first"):
        accounts.check_new(NODE)
    for name in ("*", ">", "a.b", "", "../x", "A"):
        with pytest.raises(InvalidData, match="is not a valid name"):
            accounts.check_new(name)


def test_keys_have_the_format_of_nats() -> None:
    """The seed and its public key are those of the tests of NATS's own libraries."""
    key = SigningKey.from_seed(seed := "SUAMLK2ZNL35WSMW37E7UD4VZ7ELPKW7DHC3BWBSD2GCZ7IUQQXZIORRBU")
    assert (key.public, key.seed) == ("UCK5N7N66OBOINFXAYC2ACJQYFSOD4VYNU6APEJTAVFZB2SVHLKGEW7L", seed)
    assert is_user_key(key.public)
    assert not is_user_key(SigningKey.create(Kind.ACCOUNT).public)
    damaged = key.public[:-1] + ("A" if key.public[-1] != "A" else "B")
    assert not is_user_key(damaged)
    with pytest.raises(InvalidData, match="damaged"):
        SigningKey.from_seed(key.public)


# ---------------------------------------------------------------------------------------------------- TLS
@pytest.mark.parametrize(
    ("url", "permitted"),
    [
        ("nats://127.0.0.1:4222", True),
        ("nats://user:word@localhost:4222", True),
        ("nats://[::1]:4222", True),
        ("tls://10.0.0.1:4222", True),
        ("nats://10.0.0.1:4222", False),
        ("nats://hub.local:4222", False),
        ("nats://127.0.0.1.example.com:4222", False),
        ("ws://127.0.0.1:4222", False),
        ("10.0.0.1", False),
        ("nats://127.0.0.1:port", False),
    ],
)
def test_another_computer_needs_tls(url: str, permitted: bool) -> None:
    with contextlib.nullcontext() if permitted else pytest.raises(InvalidData):
        require_tls(url)


async def test_relay_node_and_server_refuse_a_remote_broker_without_tls(tmp_path: Path) -> None:
    url = "nats://192.0.2.1:4222"
    host = await CellHost.start(os.environ | {BROKER_URL: url}, NODE)
    try:
        with pytest.raises(Arcor2Error, match=r"192\.0\.2\.1 is on another computer\. Configure TLS"):
            async with asyncio.timeout(PATIENCE):
                await asyncio.shield(host.ready)
    finally:
        await host.close()
    environment = os.environ | {BROKER_URL: url}
    for words in (("node", "run", NODE), ("serve", "--data-dir", str(tmp_path)), ("node", "broker", url)):
        done = commands.run(commands.CLI, *words, env=environment)
        assert (done.returncode, "on another computer" in done.stderr) == (ExitStatus.USAGE, True), done.stderr
