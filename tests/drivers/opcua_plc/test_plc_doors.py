"""Authentication, and a server that lost a node."""

from collections.abc import Callable
from pathlib import Path

import pytest
from asyncua.crypto.cert_gen import setup_self_signed_certificate
from cryptography.x509.oid import ExtendedKeyUsageOID

from arcor2_drivers.opcua_plc.opcua_plc import OpcUaPlc
from arcor2_hw.exceptions import DeviceError, DeviceFault, NotConnected, Refused
from tests.fakes.conftest import FakeProcess


def test_a_node_removed_during_a_connection_is_named(
    start_fake: Callable[..., FakeProcess], make: Callable[..., OpcUaPlc]
) -> None:
    fake = start_fake("opcua_plc")
    plc = make(fake.ready["url"])
    plc.connect()
    fake.control.do("remove", name="Level")
    with pytest.raises(DeviceFault, match="level has no value: BadNodeIdUnknown"):
        plc.read("level")
    assert plc.read_digital("door") is True
    plc.disconnect()
    with pytest.raises(DeviceFault, match=r"level \(ns=2;s=Cell.Level\) does not exist"):
        plc.connect()


def test_user_and_password(
    start_fake: Callable[..., FakeProcess], make: Callable[..., OpcUaPlc], tmp_path: Path
) -> None:
    fake = start_fake("opcua_plc", "--user", "cell", "--password", "w0rd-1")
    good, wrong = tmp_path / "good", tmp_path / "wrong"
    good.write_text("w0rd-1\n")
    wrong.write_text("w0rd-2\n")
    with pytest.raises(Refused, match="rejected the credentials"):
        make(fake.ready["url"]).connect()
    with pytest.raises(Refused, match="rejected the credentials") as refusal:
        make(fake.ready["url"], user="cell", password_file=str(wrong)).connect()
    assert "w0rd" not in f"{refusal.value}{refusal.value.detail}"
    with pytest.raises(NotConnected, match="password_file"):
        make(fake.ready["url"], user="cell", password_file=str(tmp_path / "none")).connect()
    plc = make(fake.ready["url"], user="cell", password_file=str(good))
    plc.connect()
    assert plc.read_digital("door") is True


async def _certificate(folder: Path, name: str) -> tuple[str, str]:
    key, certificate = folder / f"{name}.key", folder / f"{name}.der"
    uses = [ExtendedKeyUsageOID.CLIENT_AUTH, ExtendedKeyUsageOID.SERVER_AUTH]
    await setup_self_signed_certificate(key, certificate, f"urn:{name}", "localhost", uses, {"commonName": name})
    return str(certificate), str(key)


async def test_certificates(
    start_fake: Callable[..., FakeProcess], make: Callable[..., OpcUaPlc], tmp_path: Path
) -> None:
    server, server_key = await _certificate(tmp_path, "server")
    client, client_key = await _certificate(tmp_path, "client")
    other, _ = await _certificate(tmp_path, "other")
    fake = start_fake("opcua_plc", "--certificate", server, "--key", server_key)
    url = fake.ready["url"]
    ours = {"client_certificate": client, "client_key": client_key}
    with pytest.raises(DeviceError, match=r"plc at opc.tcp"):
        make(url).connect(2.0)
    with pytest.raises(DeviceError, match=r"plc at opc.tcp"):
        make(url, security="basic256sha256_encrypt", server_certificate=other, **ours).connect(2.0)
    for security in ("basic256sha256_sign", "basic256sha256_encrypt"):
        plc = make(url, security=security, server_certificate=server, **ours)
        plc.connect()
        assert plc.read_digital("door") is True
        plc.take_control()
        plc.write_digital("valve", security.endswith("encrypt"))
        assert fake.truth()["points"]["Valve"] is security.endswith("encrypt")
        plc.disconnect()
