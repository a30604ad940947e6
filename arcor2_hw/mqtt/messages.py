"""The messages between the server and the process of its MQTT clients. This module imports no MQTT library."""

from typing import Any

import msgspec
from msgspec import Struct

from arcor2_hw.plant.messages import Update


class Broker(Struct, frozen=True):
    """Connection to the broker.

    tls: whether to use TLS. user, password: empty if it needs none. authority: file of the certificate to trust; empty
    for those that the system trusts. certificate, key: files of the client certificate; empty for none.
    """

    host: str
    port: int
    tls: bool = False
    user: str = ""
    password: str = ""
    authority: str = ""
    certificate: str = ""
    key: str = ""


class Sparkplug(Struct, frozen=True):
    """Sparkplug B: names of the group and of the edge node. primary_host: id of the host to wait for; empty: none."""

    group: str
    node: str
    primary_host: str = ""


class Setup(Struct, frozen=True, tag=True):
    """The first message.

    sparkplug: None to publish no Sparkplug B. prefix: of the topics with plain JSON; empty for none. folder: for the
    number of the session. version: of the product.
    """

    broker: Broker
    sparkplug: Sparkplug | None
    prefix: str
    folder: str
    version: str


class LinkChanged(Struct, frozen=True, tag=True):
    """A client is connected, or not because of a reason. link: "Sparkplug" or "JSON"."""

    link: str
    connected: bool
    reason: str = ""


class ValuesDropped(Struct, frozen=True, tag=True):
    """Number of values that were dropped because too many waited for the broker or the host."""

    count: int


ToProcess = Setup | Update
FromProcess = LinkChanged | ValuesDropped

decode_to_process: Any = msgspec.msgpack.Decoder(ToProcess).decode
decode_from_process: Any = msgspec.msgpack.Decoder(FromProcess).decode
