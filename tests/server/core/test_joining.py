"""Addresses for invitations of other devices."""

from pathlib import Path

import msgspec
import pytest

from arcor2_server.access import addresses as module
from arcor2_server.access.addresses import server_addresses
from arcor2_server.access.authority import Authority
from arcor2_server.access.certificate import fingerprint
from arcor2_server.settings import ServerSettings


@pytest.fixture(autouse=True)
def machine(monkeypatch: pytest.MonkeyPatch) -> None:
    """Simulate a machine with two network addresses, whose host name resolves to loopback, too."""
    monkeypatch.setattr(module, "_outgoing_address", lambda: "192.0.2.7")
    monkeypatch.setattr(module, "_addresses_of_host_name", lambda: ["127.0.1.1", "192.0.2.7", "198.51.100.4"])


@pytest.mark.parametrize(
    ("host", "addresses"),
    [
        ("127.0.0.1", []),
        ("localhost", []),
        ("::1", []),
        ("0.0.0.0", ["http://192.0.2.7:6789", "http://198.51.100.4:6789"]),
        ("::", ["http://192.0.2.7:6789", "http://198.51.100.4:6789"]),
        ("192.0.2.9", ["http://192.0.2.9:6789"]),
        ("2001:db8::1", ["http://[2001:db8::1]:6789"]),
        ("cell-7.example", ["http://cell-7.example:6789"]),
    ],
)
def test_invitations_list_reachable_addresses(tmp_path: Path, host: str, addresses: list[str]) -> None:
    assert server_addresses(ServerSettings(data_dir=tmp_path, host=host), 1).addresses == addresses


def test_invitations_use_the_port_of_the_request(tmp_path: Path) -> None:
    authority = Authority(tmp_path, lambda: ["192.0.2.9"])
    authority.renew()
    settings = ServerSettings(data_dir=tmp_path, host="192.0.2.9", port=0, certificate=authority.files[0])
    found = server_addresses(settings, 41234)
    assert (found.addresses, found.authority) == (["https://192.0.2.9:41234"], "")
    assert found.fingerprint == fingerprint(authority.files[0])
    own = server_addresses(msgspec.structs.replace(settings, authority=authority.file), 41234)
    assert own.authority == fingerprint(authority.file) != own.fingerprint


def test_without_a_network_there_is_no_invitation(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_outgoing_address", str)
    monkeypatch.setattr(module, "_addresses_of_host_name", list)
    assert server_addresses(ServerSettings(data_dir=tmp_path, host="0.0.0.0"), 1).addresses == []
