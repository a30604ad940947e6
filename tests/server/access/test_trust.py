"""The local certificate authority, and the page from which devices install it."""

import asyncio
import datetime
import ipaddress
import plistlib
import ssl
import stat
from pathlib import Path
from typing import Any

import httpx
import pytest
from cryptography import x509
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus

from arcor2_hw.data.role import Role
from arcor2_server.access import authority as module
from arcor2_server.access.addresses import certified_hosts
from arcor2_server.access.authority import Authority
from arcor2_server.access.certificate import CertificateProblem, check, fingerprint
from arcor2_server.access.tokens import TokenFile
from arcor2_server.cli import certificates
from arcor2_server.settings import ServerSettings
from arcor2_server.web.trust_page import CERTIFICATE, PROFILE, preferred_language
from tests.server.core.serving import ServerProcess, running


def certificate(file: Path) -> x509.Certificate:
    return x509.load_pem_x509_certificate(file.read_bytes())


def names(file: Path) -> set[str]:
    named = certificate(file).extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    return {str(name.value) for name in named}


def test_the_authority_issues_a_certificate_with_all_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("socket.gethostname", lambda: "cell-7.plant.example")
    monkeypatch.setattr("arcor2_server.access.addresses._outgoing_address", lambda: "192.168.0.10")
    monkeypatch.setattr("arcor2_server.access.addresses._addresses_of_host_name", lambda: ["147.229.1.2"])
    made = Authority(tmp_path, lambda: certified_hosts("0.0.0.0"))
    assert made.renew()
    assert {"192.168.0.10", "147.229.1.2", "127.0.0.1", "cell-7.plant.example", "cell-7.local"} <= names(made.files[0])
    root, leaf = certificate(made.file), certificate(made.files[0])
    assert root.extensions.get_extension_for_class(x509.BasicConstraints).value.ca
    assert not leaf.extensions.get_extension_for_class(x509.BasicConstraints).value.ca
    assert leaf.not_valid_after_utc - leaf.not_valid_before_utc <= datetime.timedelta(days=398)
    for file in (tmp_path / module.AUTHORITY_KEY, tmp_path / module.KEY):
        assert stat.S_IMODE(file.stat().st_mode) == 0o600
    assert check(made.files) == fingerprint(made.files[0])
    assert not made.renew()


def test_the_authority_is_limited_to_local_names(tmp_path: Path) -> None:
    made = Authority(tmp_path, lambda: ["cell-7", "192.168.0.10"])
    made.renew()
    limits = certificate(made.file).extensions.get_extension_for_class(x509.NameConstraints).value.permitted_subtrees
    assert limits is not None
    networks = [limit.value for limit in limits if isinstance(limit, x509.IPAddress)]
    assert all(network.is_private or network == ipaddress.ip_network("100.64.0.0/10") for network in networks)
    assert {limit.value for limit in limits if isinstance(limit, x509.DNSName)} == {"cell-7", "local"}


def test_a_new_address_renews_only_the_certificate(tmp_path: Path) -> None:
    hosts = ["192.168.0.10"]
    made = Authority(tmp_path, lambda: hosts)
    made.renew()
    root = made.file.read_bytes()
    hosts.append("10.1.2.3")
    assert made.renew()
    assert "10.1.2.3" in names(made.files[0])
    assert made.file.read_bytes() == root
    hosts.append("147.229.1.2")  # the authority may not certify it
    assert made.renew()
    assert made.file.read_bytes() != root


def test_an_expiring_certificate_is_renewed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = Authority(tmp_path, lambda: ["192.168.0.10"])
    monkeypatch.setattr(module, "VALID_DAYS", module.RENEW_DAYS)
    made.renew()
    old, root = made.files[0].read_bytes(), made.file.read_bytes()
    monkeypatch.undo()
    assert made.renew()
    assert made.files[0].read_bytes() != old
    assert made.file.read_bytes() == root


async def test_a_running_server_uses_the_renewed_certificate(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    hosts = ["192.168.0.10"]
    monkeypatch.setattr(certificates, "RENEW_PERIOD", 0.01)
    monkeypatch.setattr(certificates, "certified_hosts", lambda _: tuple(hosts))
    Authority(tmp_path, lambda: hosts).renew()
    loaded: asyncio.Future[Path] = asyncio.get_running_loop().create_future()

    class Context(ssl.SSLContext):
        def load_cert_chain(self, certfile: Any, *_: Any) -> None:
            loaded.set_result(certfile)

    context = Context(ssl.PROTOCOL_TLS_SERVER)
    renewal = asyncio.create_task(certificates.renew_certificate(ServerSettings(data_dir=tmp_path), context))
    hosts.append("10.1.2.3")
    try:
        async with asyncio.timeout(60):
            assert "10.1.2.3" in names(await loaded)
    finally:
        renewal.cancel()


@pytest.mark.parametrize("name", [module.AUTHORITY, module.AUTHORITY_KEY, module.CERTIFICATE])
def test_damaged_files_are_replaced(tmp_path: Path, name: str) -> None:
    made = Authority(tmp_path, lambda: ["192.168.0.10"])
    made.renew()
    (tmp_path / name).write_text("damaged")
    assert made.renew()
    check(made.files)


def test_the_error_names_an_unwritable_directory(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(CertificateProblem, match="file"):
        Authority(tmp_path / "file", lambda: ["192.168.0.10"]).renew()


def test_the_page_is_in_the_preferred_language() -> None:
    assert [preferred_language(given) for given in ("", "fr, de-AT;q=0.8", "cs-CZ,cs;q=0.9", "*")] == [
        "en", "de", "cs", "en",
    ]  # fmt: skip


def plain_http(server: ServerProcess) -> httpx.AsyncClient:
    return httpx.AsyncClient(base_url=server.url.replace("wss", "http", 1), timeout=60)


async def test_a_device_installs_the_authority_over_http_and_then_trusts_the_server(tmp_path: Path) -> None:
    secret = TokenFile(tmp_path / "data").add("first", Role.OPERATOR)[1]
    async with running(tmp_path / "data", "--self-signed") as server, plain_http(server) as http:
        page = await http.get("/", headers={"Accept-Language": "de"})
        assert "Diesem ARCOR2-HW-Server vertrauen" in page.text
        file = server.data_dir / module.AUTHORITY
        assert fingerprint(file) in page.text
        assert fingerprint(file) in server.log.read_text()
        assert str(http.base_url).replace("http", "https", 1) in page.text
        der = (await http.get(CERTIFICATE)).content
        assert der == ssl.PEM_cert_to_DER_cert(file.read_text())
        profile = plistlib.loads((await http.get(PROFILE)).content)
        assert profile["PayloadContent"][0]["PayloadContent"] == der
        # Nothing else is served, and a websocket cannot send its token in plain text.
        for path in ("/api/devices", "/healthz/ready", "/editor/assets/index.js"):
            answer = await http.get(path, headers={"Authorization": f"Bearer {secret}"})
            assert (answer.status_code, "Trust this" in answer.text) == (404, True)
        assert (await http.put("/object-types", json={})).status_code == 405
        assert (await http.get("/", headers={"Host": "evil.example"})).status_code == 403
        with pytest.raises(InvalidStatus, match="403"):
            await connect(server.url.replace("wss", "ws", 1))
        trusting = ssl.create_default_context(cadata=der)
        async with httpx.AsyncClient(base_url=str(http.base_url).replace("http", "https", 1), verify=trusting) as https:
            assert (await https.get("/healthz/ready")).status_code == 200
            joining = (await https.get("/api/joining?port=1", headers={"Authorization": f"Bearer {secret}"})).json()
        assert joining["authority"] == fingerprint(file)


async def test_a_server_with_custom_certificates_has_no_trust_page(tmp_path: Path) -> None:
    own = Authority(tmp_path, lambda: ["127.0.0.1"])
    own.renew()
    async with running(tmp_path / "data", "--tls", *map(str, own.files)) as server, plain_http(server) as http:
        with pytest.raises(httpx.TransportError):
            await http.get("/")
        assert not (server.data_dir / module.AUTHORITY).exists()
