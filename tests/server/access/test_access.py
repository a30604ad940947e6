"""Tokens, roles and ports: admission, roles, and how access is revoked."""

import asyncio
import contextlib
import io
import json
import ssl
import stat
import subprocess
import zipfile
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import httpx
import msgspec
import pytest
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosedError

from arcor2_hw.data.role import Role
from arcor2_hw.exceptions import InvalidData, NotFound
from arcor2_server.access import authority, certificate
from arcor2_server.access.admission import Access, AccessRefused
from arcor2_server.access.tokens import COPY, FILE, TokenFile
from arcor2_server.audit.chain import AuditFile
from arcor2_server.cli.exit_status import ExitStatus
from arcor2_server.cli.serve import welcome
from arcor2_server.settings import LegacyListener, ServerSettings
from tests import commands
from tests.server.core.serving import COMMAND, RawConnection, ServerProcess, running, talking


def bearer(secret: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {secret}"}


@pytest.fixture
async def server(tmp_path: Path) -> AsyncIterator[ServerProcess]:
    """Start a server that requires a token."""
    TokenFile(tmp_path / "data").add("first", Role.TECHNICIAN)
    async with running(tmp_path / "data") as process:
        yield process


def token(server: ServerProcess, name: str, role: Role, days: int | None = None) -> str:
    return TokenFile(server.data_dir).add(name, role, days)[1]


def rest(server: ServerProcess, **options: Any) -> httpx.AsyncClient:
    return httpx.AsyncClient(timeout=60, base_url=server.url.replace("ws", "http", 1), **options)


async def closed_with(socket: ClientConnection) -> int | None:
    """Return the code with which the server closes the connection."""
    async with asyncio.timeout(60):
        with contextlib.suppress(ConnectionClosedError):
            async for _ in socket:
                pass
    return socket.close_code


# ------------------------------------------------------------------------------------------------ the file
def test_tokens_are_stored_only_as_hashes(tmp_path: Path) -> None:
    made, secret = TokenFile(tmp_path).add("tablet 1", Role.OPERATOR, days=2)
    assert len(secret) >= 43
    assert secret not in (tmp_path / FILE).read_text()
    assert stat.S_IMODE((tmp_path / FILE).stat().st_mode) == 0o600
    other = TokenFile(tmp_path)
    assert other.find(secret) == made
    assert other.find(secret[:-1]) is None
    assert other.find("") is None


def test_revoked_and_expired_tokens_are_refused_and_free_their_names(tmp_path: Path) -> None:
    tokens = TokenFile(tmp_path)
    made, secret = tokens.add("tablet", Role.OPERATOR)
    with pytest.raises(Exception, match="already"):
        tokens.add("tablet", Role.OPERATOR)
    with pytest.raises(NotFound, match="nobody"):
        tokens.revoke("nobody")
    assert TokenFile(tmp_path).revoke("tablet") == [made]  # as another process would
    assert tokens.find(secret) is None
    _, secret = tokens.add("tablet", Role.OPERATOR, days=1)
    stored = json.loads((tmp_path / FILE).read_text())
    stored[0]["expires"] = "2020-01-01T00:00:00+00:00"
    (tmp_path / FILE).write_text(json.dumps(stored))
    assert tokens.find(secret) is None
    tokens.add("tablet", Role.OPERATOR)  # the expired token does not block the name


@pytest.mark.parametrize("name", ["", "  ", "x" * 101, "line\nbreak"])
def test_a_token_needs_a_name(tmp_path: Path, name: str) -> None:
    with pytest.raises(InvalidData):
        TokenFile(tmp_path).add(name, Role.OPERATOR)


def test_a_damaged_file_is_repaired_from_its_copy(tmp_path: Path) -> None:
    tokens = TokenFile(tmp_path)
    made, secret = tokens.add("tablet", Role.OPERATOR)
    (tmp_path / FILE).write_text("{")
    assert tokens.find(secret) == made  # a running server reads the copy
    assert TokenFile(tmp_path).find(secret) == made
    damage = TokenFile(tmp_path).repair()
    assert damage is not None
    assert FILE in damage.text
    assert json.loads((tmp_path / FILE).read_text())[0]["name"] == "tablet"
    assert [path.read_text() for path in tmp_path.glob("tokens.damaged-*.json")] == ["{"]
    assert TokenFile(tmp_path).repair() is None
    assert stat.S_IMODE((tmp_path / COPY).stat().st_mode) == 0o600


def test_a_revoked_token_does_not_come_back_from_the_copy(tmp_path: Path) -> None:
    _, secret = TokenFile(tmp_path).add("tablet", Role.OPERATOR)
    TokenFile(tmp_path).revoke("tablet")
    (tmp_path / FILE).write_text("{")
    assert TokenFile(tmp_path).find(secret) is None


def test_unreadable_tokens_admit_no_client(tmp_path: Path) -> None:
    for name in (FILE, COPY):
        (tmp_path / name).write_text("{")
    access = Access(ServerSettings(data_dir=tmp_path))
    assert not access.open_to_all
    assert "arcor2-hw token add" in str(access.repair())
    with pytest.raises(AccessRefused, match=r"tokens\.json is damaged.*arcor2-hw token add"):
        access.by_token("secret", "127.0.0.1")
    made, secret = TokenFile(tmp_path).add("new", Role.PROGRAMMER)
    assert access.by_token(secret, "127.0.0.1").token == made
    assert list(tmp_path.glob("tokens.damaged-*.json"))


async def test_the_server_starts_with_damaged_token_files(tmp_path: Path) -> None:
    data = tmp_path / "data"
    _, secret = TokenFile(data).add("tablet", Role.PROGRAMMER)
    damaged = [FILE, "markers.json", "arm-calibrations.json", "journal.sqlite"]
    for name in damaged:
        (data / name).write_text("{" * 10_000)
    missing = {name: str(data / name).removesuffix(Path(name).suffix) for name in damaged}
    async with running(data) as server:
        async with connect(server.url, additional_headers=bearer(secret)) as socket, asyncio.timeout(60):
            async for message in socket:
                event = json.loads(message)
                if event["event"] == "Notification":
                    assert event["data"]["level"] == "Error"
                    missing = {name: path for name, path in missing.items() if path not in event["data"]["message"]}
                    if not missing:
                        break
        assert not missing, f"no notification mentions {', '.join(missing)}"
        printed = (tmp_path / "data.log").read_text()
    for name in damaged:
        assert list(data.glob(name.replace(".", ".damaged-*."))), name
        assert [
            line for line in printed.splitlines() if line.startswith("arcor2-hw serve: ") and Path(name).stem in line
        ]


# ------------------------------------------------------------------------------------------------ the websocket
@pytest.mark.parametrize("sent_in", ["header", "query", "message"])
async def test_a_token_admits_with_its_role(server: ServerProcess, sent_in: str) -> None:
    secret = token(server, "Operator 1", Role.OPERATOR)
    url = f"{server.url}/?token={secret}" if sent_in == "query" else server.url
    headers = bearer(secret) if sent_in == "header" else {}
    async with connect(url, additional_headers=headers) as socket:
        talker = RawConnection(socket)
        if sent_in == "message":
            assert "Authenticate" in await talker.refused("ListScenes")
            assert await talker.granted("Authenticate", {"token": secret}) == {"name": "Operator 1", "role": "operator"}
        await talker.event("ShowMainScreen")
        await talker.granted("RegisterUser", {"user_name": "x"})
        await talker.granted("ListScenes")
        assert "technician" in await talker.refused("NewScene", {"name": "scene"})


async def test_refused_clients_receive_no_data(server: ServerProcess) -> None:
    async with (
        connect(server.url) as stranger,
        connect(server.url, additional_headers=bearer(token(server, "technician", Role.TECHNICIAN))) as known,
    ):
        talker, other = RawConnection(stranger), RawConnection(known)
        await other.event("ShowMainScreen")
        await other.granted("RegisterUser", {"user_name": "x"})
        await other.granted("NewScene", {"name": "secret scene"})
        for name in ("SystemInfo", "RegisterUser", "SubscribeEvents", "ListPackages"):
            assert "token" in await talker.refused(name)
        answer = await talker.raw(json.dumps({"id": 1, "request": "x" * 5000}))
        assert "token" in answer["messages"][0]
        assert talker.events == []


async def test_a_wrong_token_is_refused(server: ServerProcess) -> None:
    async with connect(f"{server.url}/?token=wrong") as socket:
        assert await closed_with(socket) == 4401
    async with connect(server.url) as socket:
        talker = RawConnection(socket)
        assert "not valid" in await talker.refused("Authenticate", {"token": "wrong"})
        secret = token(server, "late", Role.OPERATOR)
        await talker.granted("Authenticate", {"token": secret})


async def test_token_guessing_is_limited(server: ServerProcess) -> None:
    right = token(server, "right", Role.OPERATOR)
    async with rest(server) as http:
        statuses = [(await http.get("/api/devices", headers=bearer("wrong"))).status_code for _ in range(12)]
        assert statuses == [401] * 10 + [429] * 2
        assert (await http.get("/api/devices", headers=bearer(right))).status_code == 429
    async with connect(server.url) as socket:
        await socket.send(json.dumps({"id": 1, "request": "Authenticate", "args": {"token": right}}))
        assert await closed_with(socket) == 4401


async def test_a_revoked_token_ends_its_connections(server: ServerProcess) -> None:
    gone, stays = token(server, "gone", Role.OPERATOR), token(server, "stays", Role.OPERATOR)
    async with (
        connect(server.url, additional_headers=bearer(gone)) as first,
        connect(server.url, additional_headers=bearer(stays)) as second,
    ):
        TokenFile(server.data_dir).revoke("gone")
        assert await closed_with(first) == 4401
        talker = RawConnection(second)
        await talker.event("ShowMainScreen")
        await talker.granted("ListScenes")
    log = server.log.read_text()
    assert gone not in log
    assert stays not in log


# ------------------------------------------------------------------------------------------------ REST
async def test_rest_requires_token_and_role(server: ServerProcess) -> None:
    operator, programmer = token(server, "o", Role.OPERATOR), token(server, "p", Role.PROGRAMMER)
    async with rest(server) as http:
        assert (await http.get("/healthz/ready")).status_code == 200
        answer = await http.get("/api/devices")
        assert (answer.status_code, answer.headers["WWW-Authenticate"]) == (401, "Bearer")
        assert (await http.get("/api/devices", headers=bearer(operator))).json() == []
        body = {"id": "Crate", "name": "Crate", "source": "class Crate: ..."}
        refused = await http.put("/object-types", json=body, headers=bearer(operator))
        assert refused.status_code == 403
        assert "programmer" in refused.text
        assert (await http.put("/object-types", json=body, headers=bearer(programmer))).status_code != 403
        # Operators may register AR by the markers; only technicians may move them.
        advanced, technician = token(server, "a", Role.ADVANCED_USER), token(server, "t", Role.TECHNICIAN)
        markers, no_markers = "/api/calibration/markers", {"markers": []}
        assert (await http.get(markers, headers=bearer(operator))).json()["markers"] == []
        statuses = [
            (await http.put(markers, json=no_markers, headers=bearer(secret))).status_code
            for secret in (operator, advanced, technician)
        ]
        assert statuses[:2] == [403, 403]
        assert statuses[2] < 300


async def test_without_tokens_local_clients_have_all_rights(tmp_path: Path) -> None:
    async with running(tmp_path / "data") as server:
        async with talking(server.url, "anybody") as talker:
            await talker.granted("NewScene", {"name": "scene"})
        TokenFile(server.data_dir).add("operator", Role.OPERATOR)  # from now on a token is needed
        async with connect(server.url) as socket:
            assert "token" in await RawConnection(socket).refused("ListScenes")


# ------------------------------------------------------------------------------------------------ other machines
def start(tmp_path: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [*COMMAND, "serve", "--port", "0", "--data-dir", str(tmp_path / "data"), *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)


def test_the_first_start_on_a_network_prints_an_address_for_the_first_device(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    settings = ServerSettings(data_dir=tmp_path, host="192.0.2.7", port=0)
    for local in (msgspec.structs.replace(settings, host="::1"), msgspec.structs.replace(settings, insecure=True)):
        welcome(local, 1)
    assert (TokenFile(tmp_path).all(), capsys.readouterr().err) == ([], "")
    welcome(settings, 4711)
    address, _, secret = capsys.readouterr().err.strip().rpartition("?token=")
    assert address.endswith("http://192.0.2.7:4711/")
    found = TokenFile(tmp_path).find(secret)
    assert found is not None
    assert (found.role, found.shared) == (Role.PROGRAMMER, True)
    assert [entry.target for entry in AuditFile(settings.audit_file).all()] == [found.name]
    welcome(settings, 4711)  # only once
    assert capsys.readouterr().err == ""


async def test_a_trusted_proxy_admits_other_machines(tmp_path: Path) -> None:
    settings = ServerSettings(data_dir=tmp_path, trusted_proxies=("127.0.0.1",))
    assert not Access(settings).open_to_all
    assert Access(msgspec.structs.replace(settings, trusted_proxies=())).open_to_all
    async with running(tmp_path / "data", ARCOR2_HW_TRUSTED_PROXIES="127.0.0.1") as server:
        async with connect(server.url) as socket:
            assert "token" in await RawConnection(socket).refused("ListScenes")
        (line,) = [line for line in server.log.read_text().splitlines() if "first start" in line]
        async with connect(f"{server.url}/?token={line.rpartition('=')[2]}") as socket:
            talker = RawConnection(socket)
            assert (await talker.granted("ListPersons"))["needs_administrator"]
            assert "Log on" in await talker.refused("NewScene", {"name": "hall"})
            await talker.granted("StopAll")


async def test_only_a_trusted_proxy_can_forward_client_addresses(tmp_path: Path) -> None:
    TokenFile(tmp_path / "data").add("first", Role.OPERATOR)
    stated = bearer("wrong") | {"X-Forwarded-For": "198.51.100.7"}
    for proxies, address in (("10.0.0.2", "127.0.0.1"), ("10.0.0.0/8,127.0.0.1", "198.51.100.7")):
        async with (
            running(tmp_path / "data", ARCOR2_HW_TRUSTED_PROXIES=proxies, FORWARDED_ALLOW_IPS="*") as server,
            rest(server) as http,
        ):
            assert (await http.get("/api/devices", headers=stated)).status_code == 401
        (line,) = [json.loads(line) for line in server.log.read_text().splitlines() if "wrong token" in line]
        assert line["address"] == address


@pytest.mark.parametrize("address", ["nowhere", "127.0.0.1:", "127.0.0.1:99999"])
def test_an_invalid_address_is_a_usage_error(tmp_path: Path, address: str) -> None:
    ended = start(tmp_path, "--legacy-listen", address)
    assert ended.returncode == ExitStatus.USAGE
    assert len(ended.stderr.splitlines()) == 1


def test_clients_without_token_are_never_programmers(tmp_path: Path) -> None:
    assert start(tmp_path, "--legacy-listen", "127.0.0.1:0", "--legacy-role", "programmer").returncode == 2
    with pytest.raises(ValueError, match="programmer"):
        LegacyListener("127.0.0.1", 1, Role.PROGRAMMER)


def test_the_error_names_an_unusable_certificate(tmp_path: Path) -> None:
    file = tmp_path / "c.pem"
    file.write_text("nothing")
    ended = start(tmp_path, "--tls", str(file), str(file))
    assert ended.returncode == ExitStatus.CERTIFICATE_UNUSABLE
    assert str(file) in ended.stderr
    assert "Traceback" not in ended.stderr


def trusting(file: Path) -> ssl.SSLContext:
    return ssl.create_default_context(cafile=str(file))


async def test_a_generated_certificate_is_used_again_after_a_restart(tmp_path: Path) -> None:
    secret = TokenFile(tmp_path / "data").add("first", Role.OPERATOR)[1]
    async with running(tmp_path / "data", "--self-signed") as server:
        assert server.url.startswith("wss://")
        file = server.data_dir / authority.CERTIFICATE
        assert stat.S_IMODE((server.data_dir / authority.KEY).stat().st_mode) == 0o600
        assert certificate.fingerprint(file) in server.log.read_text()
        async with connect(server.url, additional_headers=bearer(secret), ssl=trusting(file)) as socket:
            talker = RawConnection(socket)
            await talker.event("ShowMainScreen")
            await talker.granted("ListScenes")
        async with rest(server, verify=trusting(file)) as http:
            assert (await http.get("/api/devices", headers=bearer(secret))).status_code == 200
        made = file.read_bytes()
    async with running(tmp_path / "data", "--self-signed"):
        assert file.read_bytes() == made  # clients that trust it can keep it


async def test_legacy_clients_have_a_separate_port(tmp_path: Path) -> None:
    TokenFile(tmp_path / "data").add("first", Role.PROGRAMMER)
    arguments = ("--self-signed", "--legacy-listen", "127.0.0.2:0", "--legacy-role", "standard_user")
    async with running(tmp_path / "data", *arguments) as server:
        (line,) = [line for line in server.log.read_text().splitlines() if "clients without a token" in line]
        assert "standard_user" in line
        port = json.loads(line)["port"]
        async with talking(f"ws://127.0.0.2:{port}", "old tablet") as talker:
            await talker.granted("ListScenes")
            assert "technician" in await talker.refused("NewScene", {"name": "scene"})
            assert "programmer" in await talker.refused("UploadPackage", {"id": "x", "data": ""})
        assert await server.stop() == 0


# ------------------------------------------------------------------------------------------------ the command line
def test_tokens_are_managed_by_the_command_line(tmp_path: Path) -> None:
    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        return commands.run(commands.CLI, "token", *arguments, "--data-dir", tmp_path)

    assert "no token" in run("list").stdout
    added = run("add", "line 3", "--role", "technician", "--days", "30")
    assert added.returncode == 0
    found = TokenFile(tmp_path).find(added.stdout.strip())
    assert found is not None
    assert (found.name, found.role) == ("line 3", Role.TECHNICIAN)
    listed = run("list").stdout
    assert found.id in listed
    assert "technician" in listed
    assert added.stdout.strip() not in listed
    again = run("add", "line 3", "--role", "operator")
    assert again.returncode == ExitStatus.USAGE
    assert len(again.stderr.splitlines()) == 1
    assert run("revoke", "line 3").returncode == 0
    assert run("revoke", "line 3").returncode == ExitStatus.NOT_FOUND
    assert TokenFile(tmp_path).all() == []


async def test_a_run_over_rest_is_recorded_under_the_token_name(server: ServerProcess) -> None:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("script.py", "import time\ntime.sleep(30)\n")
    programmer, operator = (
        bearer(token(server, name, role))
        for name, role in (("line control", Role.PROGRAMMER), ("panel", Role.OPERATOR))
    )
    async with rest(server, headers=operator) as http:
        package = {"executionPackage": ("package.zip", buffer.getvalue(), "application/zip")}
        (await http.post("/packages/pkg_1", files=package, headers=programmer)).raise_for_status()
        (await http.put("/packages/pkg_1/start")).raise_for_status()
        (run,) = (await http.get("/api/runs")).json()
        assert (run["started_by"], run["end"], "project_id" in run) == ("panel", "running", False)
