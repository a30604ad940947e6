"""Detection of settings with the address of a device, and of its host."""

import pytest

from arcor2_hw.data.address import host_of, is_address_name


@pytest.mark.parametrize(
    ("address", "host"),
    [
        ("PLC1", "plc1"),
        ("plc1:502", "plc1"),
        ("10.0.0.1", "10.0.0.1"),
        ("::1", "::1"),
        ("opc.tcp://plc1:4840/path", "plc1"),
        ("https://[::1]:80", "::1"),
        ("socket://plc1:4001", "plc1"),
        ("http://plc1.evil?x=1", "plc1.evil"),
        # Texts without a valid host are returned unchanged.
        ("/dev/ttyUSB0", "/dev/ttyUSB0"),
        ("http://plc1@evil/", "http://plc1@evil/"),
        ("http://plc1:80@evil/", "http://plc1:80@evil/"),
        ("http://evil\\@plc1/", "http://evil\\@plc1/"),
        ("http://plc1\n.evil/", "http://plc1\n.evil/"),
    ],
)
def test_the_host_of_an_address_is_found(address: str, host: str) -> None:
    assert host_of(address) == host


@pytest.mark.parametrize("name", ["host", "url", "address", "port", "serial_port", "robot_ip", "baseUrl", "host2"])
def test_names_of_address_settings_are_recognised(name: str) -> None:
    assert is_address_name(name)


@pytest.mark.parametrize("name", ["name", "report", "ghost", "password", "port_count", "user"])
def test_names_of_other_settings_are_not_addresses(name: str) -> None:
    assert not is_address_name(name)
