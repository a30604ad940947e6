"""The options of `serve` about MQTT."""

import importlib.util
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Final
from urllib.parse import SplitResult, unquote, urlsplit

from msgspec.structs import replace

from arcor2_hw.exceptions import InvalidData
from arcor2_server.settings import MQTT_URL, MqttSettings, is_loopback

AUTHORITY: Final = "ARCOR2_HW_MQTT_CA"
CERTIFICATE: Final = "ARCOR2_HW_MQTT_CERTIFICATE"
KEY: Final = "ARCOR2_HW_MQTT_KEY"
"""Variables with the files of the trusted certificate, of the client certificate and of its key."""
_PORTS: Final = {"mqtt": 1883, "mqtts": 8883}
_LONGEST: Final = 100
"""Maximum length of a level of a topic."""


def mqtt_settings(
    address: str | None,
    sparkplug: str | None,
    primary_host: str | None,
    prefix: str | None,
    *,
    unencrypted: bool,
    environment: Mapping[str, str] = os.environ,
) -> MqttSettings | None:
    """Return the settings of MQTT, None without a broker.

    Args:
        address: the option `--mqtt`; None: the variable ARCOR2_HW_MQTT_URL.
        sparkplug: group and edge node, separated by `/`.
        primary_host: id of the host application to wait for.
        prefix: prefix of the topics with plain JSON.
        unencrypted: whether a broker on another machine may be used without TLS.
        environment: the environment variables.

    Raises:
        InvalidData: an option is invalid, or the library is not installed.
    """
    url = address or environment.get(MQTT_URL, "")
    if not url:
        if sparkplug or primary_host or prefix:
            raise InvalidData("The options of MQTT need a broker: --mqtt or {variable}.", variable=MQTT_URL)
        return None
    if any(importlib.util.find_spec(name) is None for name in ("aiomqtt", "google")):
        raise InvalidData("--mqtt needs the libraries aiomqtt and protobuf: pip install 'arcor2-hw[mqtt]'")
    if not sparkplug and not prefix:
        raise InvalidData("--mqtt needs --mqtt-sparkplug GROUP/NODE, --mqtt-json PREFIX, or both.")
    if primary_host and not sparkplug:
        raise InvalidData("--mqtt-primary-host needs --mqtt-sparkplug GROUP/NODE.")
    group, _, node = (sparkplug or "").partition("/")
    if sparkplug and not (_is_level(group) and _is_level(node) and (not primary_host or _is_level(primary_host))):
        raise InvalidData(
            "--mqtt-sparkplug {names!r} is not GROUP/NODE, or a name contains one of / + # or a space.",
            names=f"{sparkplug} {primary_host or ''}".strip(),
        )
    if prefix and not all(map(_is_level, prefix.split("/"))):
        raise InvalidData(
            "--mqtt-json {prefix!r} is not a topic such as enterprise/site/area/line/cell, without + # and spaces.",
            prefix=prefix,
        )
    broker = _broker(url, given=address is not None, unencrypted=unencrypted, environment=environment)
    names = {"group": group, "node": node, "primary_host": primary_host or "", "prefix": prefix or ""}
    return replace(broker, **names)


def _is_level(text: str) -> bool:
    return 0 < len(text) <= _LONGEST and not any(each in "/+#\0" or each.isspace() for each in text)


def _broker(url: str, *, given: bool, unencrypted: bool, environment: Mapping[str, str]) -> MqttSettings:
    """Return the settings of the broker, without names."""
    try:
        parts: SplitResult = urlsplit(url)
        host, port = parts.hostname, parts.port
    except ValueError:
        host = port = None
        parts = SplitResult("", "", "", "", "")
    if parts.scheme not in _PORTS or not host or parts.path not in ("", "/") or parts.query:
        # The address may contain a password, so the message does not contain it.
        raise InvalidData("The address of the MQTT broker is not mqtt://HOST:PORT or mqtts://HOST:PORT.")
    if given and parts.password is not None:
        raise InvalidData(
            "--mqtt contains a password, which all users of this machine can see. Set {variable} instead.",
            variable=MQTT_URL,
        )
    tls = parts.scheme == "mqtts"
    if not tls and not unencrypted and not is_loopback(host):
        raise InvalidData(
            "The MQTT broker {host} is on another machine. Use mqtts://, or --mqtt-unencrypted in an isolated network.",
            host=host,
        )
    files = {name: environment.get(name, "") for name in (AUTHORITY, CERTIFICATE, KEY)}
    if bool(files[CERTIFICATE]) != bool(files[KEY]):
        raise InvalidData("{certificate} and {key} have to be set both.", certificate=CERTIFICATE, key=KEY)
    for name, file in files.items():
        if file and not tls:
            raise InvalidData("{variable} needs a broker with mqtts://.", variable=name)
        if file and not os.access(file, os.R_OK):
            raise InvalidData("{variable}: the file {file} cannot be read.", variable=name, file=file)
    paths = {name: str(Path(file).absolute()) if file else "" for name, file in files.items()}
    return MqttSettings(
        host=host,
        port=port or _PORTS[parts.scheme],
        tls=tls,
        user=unquote(parts.username or ""),
        password=unquote(parts.password or ""),
        authority=paths[AUTHORITY],
        certificate=paths[CERTIFICATE],
        key=paths[KEY],
    )
