"""Invalid settings are named; token and certificates come from files, and the token is never shown."""

import datetime
import ipaddress
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID

from arcor2_drivers.erp.erp_service import ErpService
from arcor2_drivers.erp.outbox import file_of
from arcor2_drivers.erp.service import parse_retry_after
from arcor2_drivers.erp.settings import ErpSettings
from arcor2_hw.data.device import Connection
from arcor2_hw.exceptions import NotConnected, OutOfRange, Refused
from tests.fakes.conftest import FakeProcess

URL = "https://erp.example/api"


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        ({"url": ""}, "url"),
        ({"url": "erp.example"}, "url"),
        ({"url": "ftp://erp.example"}, "url"),
        ({"url": "https://me:secret@erp.example"}, "url"),
        ({"url": "https://erp.example:99999"}, "url"),
        ({"url": "http://erp.example", "token_file": "t"}, "token_file"),
        ({"url": "http://erp.example", "ca_file": "c"}, "ca_file"),
        ({"client_certificate": "c"}, "client_key"),
        ({"client_key": "k"}, "client_key"),
        ({"station": ""}, "station"),
        ({"station": "../up"}, "station"),
        ({"request_timeout": 0.0}, "request_timeout"),
        ({"request_timeout": float("nan")}, "request_timeout"),
        ({"longest_pause": 0.0}, "longest_pause"),
        ({"waiting_alarm": -1.0}, "waiting_alarm"),
        ({"poll": 0.0}, "poll"),
    ],
)
def test_an_invalid_setting_is_named(settings: dict[str, Any], named: str) -> None:
    with pytest.raises(OutOfRange, match=named) as raised:
        ErpSettings(**{"url": URL, **settings})
    assert "secret" not in str(raised.value)


def test_the_outbox_has_a_default_path(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    assert file_of("", "cell", URL).parent == tmp_path / "arcor2-hw" / "outbox"
    files = {file_of("/o", "cell", URL), file_of("/o", "cell", URL + "2"), file_of("/o", "other", URL)}
    assert len(files) == 3


@pytest.mark.parametrize(
    ("text", "seconds"),
    [("", 0.0), ("7", 7.0), ("-3", 0.0), ("soon", 0.0), ("99999", 600.0), ("Wed, 21 Oct 2015 07:28:00 GMT", 0.0)],
)
def test_retry_after_is_parsed(text: str, seconds: float) -> None:
    assert parse_retry_after(text) == seconds


class Authority:
    """A certificate authority for tests."""

    def __init__(self, folder: Path, name: str) -> None:
        self.folder = folder
        self._key = ec.generate_private_key(ec.SECP256R1())
        self._name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])
        self.file = folder / f"{name}.pem"
        builder = self._builder(self._name, self._key.public_key())
        usage = x509.KeyUsage(False, False, False, False, False, True, True, False, False)
        builder = builder.add_extension(x509.BasicConstraints(True, None), True).add_extension(usage, True)
        self.file.write_bytes(builder.sign(self._key, hashes.SHA256()).public_bytes(serialization.Encoding.PEM))

    def _builder(self, name: x509.Name, key: ec.EllipticCurvePublicKey) -> x509.CertificateBuilder:
        day = datetime.timedelta(days=1)
        start = datetime.datetime.now(datetime.UTC)
        identifier = x509.SubjectKeyIdentifier.from_public_key(key)
        authority = x509.AuthorityKeyIdentifier.from_issuer_public_key(self._key.public_key())
        return (
            x509.CertificateBuilder(self._name, name, key, x509.random_serial_number(), start - day, start + day)
            .add_extension(identifier, False)
            .add_extension(authority, False)
        )

    def server(self) -> tuple[Path, Path]:
        """Return certificate and key of a server on 127.0.0.1."""
        key = ec.generate_private_key(ec.SECP256R1())
        name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "planning")])
        place = x509.SubjectAlternativeName([x509.IPAddress(ipaddress.ip_address("127.0.0.1"))])
        certificate = self._builder(name, key.public_key()).add_extension(place, False).sign(self._key, hashes.SHA256())
        files = self.folder / "server.pem", self.folder / "server.key"
        files[0].write_bytes(certificate.public_bytes(serialization.Encoding.PEM))
        files[1].write_bytes(
            key.private_bytes(
                serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
            )
        )
        return files


def test_token_and_certificates_are_read_from_files(
    start_fake: Callable[..., FakeProcess], make: Callable[..., ErpService], tmp_path: Path
) -> None:
    good, other = Authority(tmp_path, "good"), Authority(tmp_path, "other")
    certificate, key = good.server()
    service = start_fake(
        "erp", "--order", "A-1=PCB:1", "--certificate", str(certificate), "--key", str(key), "--token", "s3cret-1"
    )
    url = service.ready["url"]
    assert url.startswith("https://")
    token = tmp_path / "token"
    token.write_text("s3cret-1\n")

    with pytest.raises(NotConnected, match="planning at https") as refusal:
        make(url, ca_file=str(other.file), token_file=str(token)).connect()
    assert "certificate" in refusal.value.detail.lower()
    wrong = tmp_path / "wrong"
    wrong.write_text("s3cret-2")
    with pytest.raises(Refused, match="token_file") as refusal2:
        make(url, ca_file=str(good.file), token_file=str(wrong)).connect()
    assert "s3cret" not in f"{refusal2.value}{refusal2.value.detail}"
    with pytest.raises(NotConnected, match="ca_file cannot be used"):
        make(url, ca_file=str(tmp_path / "none"), token_file=str(token)).connect()
    with pytest.raises(NotConnected, match="token_file cannot be used"):
        make(url, ca_file=str(good.file), token_file=str(tmp_path / "none")).connect()

    erp = make(url, ca_file=str(good.file), token_file=str(token))
    erp.connect()
    assert erp.connection is Connection.ONLINE
    assert erp.next_order()[1] == "A-1"
    erp.report_result("A-1", "S-1", True)
    erp.wait_until_sent(5.0)
    assert [result["serial"] for result in service.truth()["results"]] == ["S-1"]


def test_a_revoked_token_holds_all_results_and_raises_an_alarm(
    fake: FakeProcess, make: Callable[..., ErpService]
) -> None:
    fake.control.do("add_order", order="A-1", product="PCB", quantity=9)
    erp = make(fake.ready["url"])
    erp.connect()
    fake.control.do("fail", status=401, count=2, path="/results")
    erp.report_result("A-1", "S-1", True)
    fake.control.wait_until(lambda t: t["requests"] > 0)
    found: set[str] = set()
    for _ in range(200):
        found |= {alarm.code for alarm in erp.alarms()}
        if not erp.results_waiting():
            break
        erp._sender.wait_change(0.02) if erp._sender else None
    assert found == {"not_let_in"}
    erp.wait_until_sent(5.0)
    assert [result["serial"] for result in fake.truth()["results"]] == ["S-1"]
    assert erp.refused() == []
    assert erp.alarms() == []
