"""Foreign web pages are refused; programs and our own pages are accepted."""

import json
import socket
from pathlib import Path

import httpx
import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus

from arcor2_hw.exceptions import InvalidData
from arcor2_server.access import origin as module
from arcor2_server.access.origin import HostNames, machine_names, may_connect
from arcor2_server.settings import ServerSettings
from tests.server.core.serving import ServerProcess

REBOUND = {"Host": "rebound.example:6789"}


def rebound(server: ServerProcess, headers: dict[str, str]) -> connect:
    """Connect to the server by a host name that resolves to this machine."""
    port = int(server.url.rpartition(":")[2])
    return connect(f"ws://{REBOUND['Host']}", host="127.0.0.1", port=port, additional_headers=headers)


@pytest.mark.parametrize(
    ("origin", "host", "may"),
    [
        (None, "robots.example:6789", True),
        ("http://127.0.0.1:6789", "127.0.0.1:6789", True),
        ("http://localhost:6789", "localhost:6789", True),
        ("http://[::1]:6789", "[::1]:6789", True),
        ("https://192.168.1.5", "192.168.1.5", True),
        ("http://cell.example:6789", "cell.example:6789", True),
        ("http://evil.example", "127.0.0.1:6789", False),
        ("http://127.0.0.1:8000", "127.0.0.1:6789", False),
        ("http://rebound.example:6789", "rebound.example:6789", False),
        ("null", "127.0.0.1:6789", False),
        ("http://127.0.0.1:6789", None, False),
        ("http://[::1", "127.0.0.1:6789", False),
        ("http://127.0.0.1:99999", "127.0.0.1:99999", False),
    ],
)
def test_origins_are_accepted_or_refused(origin: str | None, host: str | None, may: bool) -> None:
    assert may_connect(origin, host, HostNames(["cell.example"])) is may


def test_host_names_are_read_from_the_environment(tmp_path: Path) -> None:
    environment = {"ARCOR2_HW_ALLOWED_HOSTS": "cell.example, Cell"}
    settings = ServerSettings.from_environment(environment, data_dir=tmp_path, host="listen.example")
    names = HostNames.of(settings)
    for name in ("cell.example", "cell.example.", "CELL", "listen.example", "localhost", "10.0.0.7", "::1"):
        assert name in names
    for name in ("rebound.example", "localhost.example", "", None, "10.0.0.7.example"):
        assert name not in names


def test_this_machine_has_known_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    hosts, resolver = tmp_path / "hosts", tmp_path / "resolv.conf"
    hosts.write_text("127.0.0.1 localhost\n127.0.1.1 pc7.plant.example pc7 # us\n10.0.0.9 other.example\n")
    resolver.write_text("# made by a tool\nnameserver 10.0.0.1\nsearch cells.example\n")
    monkeypatch.setattr(module, "HOSTS", hosts)
    monkeypatch.setattr(module, "RESOLVER", resolver)
    monkeypatch.setattr(socket, "gethostname", lambda: "pc7")
    assert machine_names() == {"pc7", "pc7.local", "pc7.plant.example", "pc7.cells.example"}
    hosts.unlink()
    resolver.unlink()
    assert machine_names() == {"pc7", "pc7.local"}


async def test_a_foreign_page_gets_neither_the_websocket_nor_a_route(server: ServerProcess) -> None:
    foreign = {"Origin": "http://evil.example"}
    with pytest.raises(InvalidStatus) as refused:
        await connect(server.url, additional_headers=foreign)
    assert refused.value.response.status_code == 403
    url = server.url.replace("ws://", "http://")
    async with httpx.AsyncClient(timeout=60, base_url=url) as http:
        body = {"id": "Evil", "name": "Evil", "source": "class Evil: ..."}
        assert (await http.put("/object-types", json=body, headers=foreign)).status_code == 403
        assert (await http.get("/object-types", headers={"Origin": url})).json() == []
    async with connect(server.url, additional_headers={"Origin": url}) as own:
        assert "ShowMainScreen" in str(await own.recv())


async def test_dns_rebinding_is_refused(server: ServerProcess) -> None:
    async with httpx.AsyncClient(timeout=60, base_url=server.url.replace("ws://", "http://")) as http:
        for path in ("/", "/editor/x", "/swagger", "/api/diagnosis", "/api/devices", "/scenes", "/projects"):
            answer = await http.get(path, headers=REBOUND)
            assert answer.status_code == 403, path
        assert "rebound.example" in (await http.get("/object-types", headers=REBOUND)).text
        for host in ("localhost:6789", "10.0.0.7", "[::1]:80", socket.gethostname()):
            assert (await http.get("/object-types", headers={"Host": host})).status_code == 200, host
    with pytest.raises(InvalidStatus):
        await rebound(server, {"Origin": f"http://{REBOUND['Host']}"})


async def test_clients_without_origin_may_use_any_host_name(server: ServerProcess) -> None:
    async with rebound(server, {}) as client:
        assert "ShowMainScreen" in str(await client.recv())


# ------------------------------------------------------------------------------------------------ proxies, headers
def test_proxies_are_addresses_or_networks(tmp_path: Path) -> None:
    def of(text: str) -> tuple[str, ...]:
        return ServerSettings.from_environment({"ARCOR2_HW_TRUSTED_PROXIES": text}, data_dir=tmp_path).trusted_proxies

    assert of("10.0.0.2, 10.1.0.0/16") == ("10.0.0.2", "10.1.0.0/16")
    for wrong in ("*", "proxy.example"):
        with pytest.raises(InvalidData, match="ARCOR2_HW_TRUSTED_PROXIES"):
            of(wrong)


async def test_forwarded_addresses_of_untrusted_clients_are_ignored(server: ServerProcess) -> None:
    stated = {"X-Forwarded-For": "198.51.100.7"}
    async with connect(server.url, additional_headers=stated) as client:
        await client.recv()
    lines = [json.loads(line) for line in server.log.read_text().splitlines() if "client connected" in line]
    assert lines[-1]["address"] == "127.0.0.1"


async def test_every_response_has_the_security_headers(server: ServerProcess) -> None:
    async with httpx.AsyncClient(timeout=60, base_url=server.url.replace("ws://", "http://")) as http:
        for path in ("/", "/swagger", "/object-types", "/nothing", "/healthz/ready"):
            headers = (await http.get(path)).headers
            assert headers["X-Content-Type-Options"] == "nosniff", path
            assert headers["X-Frame-Options"] == "DENY"
            assert headers["Referrer-Policy"] == "no-referrer"
            assert headers["Cross-Origin-Resource-Policy"] == "same-origin"
            assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]
        for path in ("/", "/object-types", "/editor/index.html"):
            assert (await http.get(path, params={"token": "x"})).headers["Cache-Control"] == "no-store", path
        assert "no-store" not in (await http.get("/", params={"view": "x"})).headers["Cache-Control"]
