"""Checks of settings with a port, a URL or a file."""

import os
from pathlib import Path

import pytest

from arcor2_hw.data.device import DEVICE_FILES
from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects.asked_line import AskedLine
from arcor2_hw.objects.modbus_link import ModbusLink
from arcor2_hw.objects.settings import check_host, check_serial_port, check_url, device_file, secret_file


@pytest.mark.parametrize("port", ["/dev/does-not-exist", "/dev/null", "socket://10.0.0.7:4001", "socket://[::1]:4001"])
def test_serial_ports_are_accepted(port: str) -> None:
    check_serial_port("port", port)


@pytest.mark.parametrize(
    "port",
    [
        "",
        " ",
        "ttyUSB0",
        "spy:///dev/null?file=/tmp/x",
        "SPY:///dev/null?file=/tmp/x",
        "alt:///dev/null?class=x",
        "loop://",
        "hwgrep://x",
        "rfc2217://10.0.0.7:4001",
        "socket://10.0.0.7",
        "socket://10.0.0.7:0",
        "socket://10.0.0.7:99999",
        "socket://10.0.0.7:4001/path",
        "socket://10.0.0.7:4001?logging=debug",
        "/dev/null\0",
        __file__,
        str(Path(__file__).parent),
    ],
)
def test_other_texts_are_not_serial_ports(port: str) -> None:
    with pytest.raises(OutOfRange, match=r"^line must be "):
        check_serial_port("line", port)


def test_a_port_may_exclude_sockets() -> None:
    with pytest.raises(OutOfRange, match=r"^port must be the path of a serial device, not "):
        check_serial_port("port", "socket://10.0.0.7:4001", sockets=False)


def test_links_check_their_ports(tmp_path: Path) -> None:
    victim = tmp_path / "tokens.json"
    victim.write_text("[]")
    port = f"spy:///dev/null?file={victim}"
    with pytest.raises(OutOfRange, match=r"^serial_port must be "):
        ModbusLink("press", serial_port=port).open(0.1)
    with pytest.raises(OutOfRange, match=r"^port must be "):
        AskedLine("scale", port, 9600, 0.1, lambda _: None, lambda: None, 1.0)
    assert victim.read_text() == "[]"


def test_urls_are_accepted() -> None:
    assert check_url("url", "https://erp.example:8443/api/v1", "http", "https").port == 8443
    assert check_url("url", "opc.tcp://[::1]:4840", "opc.tcp").hostname == "::1"


@pytest.mark.parametrize(
    "url",
    [
        "",
        "erp",
        "file:///etc/passwd",
        "ftp://x",
        "http://",
        "http://x:0",
        "http://x:99999",
        "http://[::1",
        "http://x y/",
        "http://me@x",
        "http://me:secret@x",
        "http://x?a=1",
        "http://x#a",
        "http://x/\n",
        "http://x/\0",
    ],
)
def test_other_texts_are_not_urls(url: str) -> None:
    with pytest.raises(OutOfRange, match=r"^url must be http://host:port or https://host:port") as refusal:
        check_url("url", url, "http", "https")
    assert "secret" not in str(refusal.value)


@pytest.mark.parametrize("host", ["ur5e", "ur5e.cell.example", "192.168.0.7", "fe80::1%eth0", "[::1]"])
def test_hosts_are_accepted(host: str) -> None:
    check_host(host, 502)


@pytest.mark.parametrize("host", ["", " ", "a b", "http://x", "x/y", "me@x", "x:502", "x\n"])
def test_other_texts_are_not_hosts(host: str) -> None:
    with pytest.raises(OutOfRange, match=r"^host must be "):
        check_host(host, 502)


def test_files_must_be_in_permitted_directories(monkeypatch: pytest.MonkeyPatch) -> None:
    assert device_file("mesh", "anywhere/part.stl") == "anywhere/part.stl"
    monkeypatch.setenv(DEVICE_FILES, os.pathsep.join(["/data/device-files", "/etc/cell"]))
    assert device_file("mesh", "") == ""
    assert device_file("mesh", "part.stl") == "/data/device-files/part.stl"
    assert device_file("mesh", "/etc/cell/a/../part.stl") == "/etc/cell/part.stl"
    for path in ("/data/tokens.json", "../tokens.json", "/data/device-files/../tokens.json", "/data/device-files2/x"):
        with pytest.raises(OutOfRange, match=r"^mesh must be in /data/device-files or /etc/cell, not "):
            device_file("mesh", path)


def test_a_secret_file_is_sent_only_to_its_host(monkeypatch: pytest.MonkeyPatch) -> None:
    assert secret_file("token_file", "t", "erp.example") == "t"
    monkeypatch.setenv(DEVICE_FILES, "/data/device-files")
    assert secret_file("token_file", "", "erp.example") == ""
    assert secret_file("token_file", "erp.example/t", "ERP.example") == "/data/device-files/erp.example/t"
    for path, host in (
        ("erp.example/t", "evil.example"),
        ("erp.example/../t", "erp.example"),
        ("t", "erp.example"),
        ("t", ""),
        ("t", None),
        ("/data/tokens.json", "erp.example"),
    ):
        with pytest.raises(OutOfRange, match=r"^token_file must be in /data/device-files"):
            secret_file("token_file", path, host)
