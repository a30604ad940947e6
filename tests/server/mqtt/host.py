"""A host application of Sparkplug B, and a subscriber to JSON, written only from the specification.

It has its own decoder of Protocol Buffers, so that a mistake in the encoder of the cell cannot cancel itself out.
`_check` asserts the requirements of the specification for each message of an edge node.
"""

import json
import struct
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import paho.mqtt.client as paho
from paho.mqtt.enums import CallbackAPIVersion

_FIELD_OF = {3: 10, 4: 11, 10: 13, 11: 14, 12: 15}
"""Number of the field with the value, by data type: Int32, Int64, Double, Boolean, String."""


def fields(data: bytes) -> Iterator[tuple[int, Any]]:
    """Yield number and content of the fields of a message of Protocol Buffers."""
    at = 0

    def varint() -> int:
        nonlocal at
        number = shift = 0
        while True:
            byte = data[at]
            at += 1
            number |= (byte & 0x7F) << shift
            shift += 7
            if byte < 0x80:
                return number

    while at < len(data):
        key = varint()
        match key & 7:
            case 0:
                yield key >> 3, varint()
            case 1:
                yield key >> 3, struct.unpack_from("<d", data, at)[0]
                at += 8
            case 2:
                size = varint()
                yield key >> 3, data[at : at + size]
                at += size
            case other:
                raise AssertionError(f"wire type {other}")


def _text(number: int, value: bytes) -> bytes:
    return bytes([number << 3 | 2, len(value)]) + value


REBIRTH = _text(2, _text(1, b"Node Control/Rebirth") + bytes([4 << 3, 11, 14 << 3, 1]))
"""A payload with the metric Node Control/Rebirth, Boolean, true."""


@dataclass
class Metric:
    name: str | None = None
    alias: int | None = None
    time: int = 0
    datatype: int | None = None
    historical: bool = False
    null: bool = False
    value: Any = None
    number: int = 0
    properties: dict[str, Any] = field(default_factory=dict)


def _property(data: bytes) -> Any:
    found = dict(fields(data))
    return found[3] if 3 in found else found[8].decode()


def _metric(data: bytes) -> Metric:
    metric = Metric()
    for number, content in fields(data):
        match number:
            case 1:
                metric.name = content.decode()
            case 2:
                metric.alias = content
            case 3:
                metric.time = content
            case 4:
                metric.datatype = content
            case 5:
                metric.historical = bool(content)
            case 7:
                metric.null = bool(content)
            case 9:
                keys = [each.decode() for number, each in fields(content) if number == 1]
                values = [_property(each) for number, each in fields(content) if number == 2]
                assert len(keys) == len(values)
                metric.properties = dict(zip(keys, values, strict=True))
            case _:
                metric.number = number
                metric.value = content.decode() if number == 15 else bool(content) if number == 14 else content
    return metric


@dataclass
class Message:
    topic: str
    kind: str
    device: str
    payload: bytes
    qos: int
    retain: bool
    seq: int | None = None
    time: int | None = None
    metrics: list[Metric] = field(default_factory=list)

    def value(self, name: str) -> Any:
        """Return the value of a metric by its name; the last one if it occurs several times."""
        return [each.value for each in self.metrics if each.name == name][-1]

    def has(self, name: str) -> bool:
        return any(each.name == name for each in self.metrics)

    @property
    def json(self) -> Any:
        return json.loads(self.payload)


class Host:
    """Receives everything below some topics, with the names of metrics resolved."""

    def __init__(self, port: int, *topics: str) -> None:
        self.messages: list[Message] = []
        self.faults: list[str] = []
        self._aliases: dict[int, tuple[str, str, int]] = {}
        self._seq: int | None = None
        self._session: int | None = None
        self._alive: set[str] = set()
        self.subscribed = threading.Event()
        self.client = paho.Client(CallbackAPIVersion.VERSION2)
        self.client.on_message = lambda _client, _data, message: self._receive(message)
        self.client.on_subscribe = lambda *_: self.subscribed.set()
        self.client.on_connect = lambda client, *_: client.subscribe([(topic, 1) for topic in topics])
        self.client.reconnect_delay_set(1, 1)
        self.client.connect("127.0.0.1", port)
        self.client.loop_start()
        assert self.subscribed.wait(30)

    def end(self) -> None:
        self.client.disconnect()
        self.client.loop_stop()

    def state(self, host: str, online: bool, stamp: int | None = None) -> None:
        """Publish the state of a host application."""
        content = json.dumps({"online": online, "timestamp": stamp or time.time_ns() // 1_000_000})
        self.client.publish(f"spBv1.0/STATE/{host}", content, qos=1, retain=True).wait_for_publish(30)

    def rebirth(self, node: str) -> None:
        """Request a rebirth of an edge node, GROUP/NODE."""
        group, _, name = node.partition("/")
        self.client.publish(f"spBv1.0/{group}/NCMD/{name}", REBIRTH, qos=0)

    def of(self, kind: str, device: str | None = None) -> list[Message]:
        """Return the messages of a kind, such as DBIRTH, or of a topic."""
        return [
            each for each in list(self.messages) if kind in (each.kind, each.topic) and device in (None, each.device)
        ]

    def values(self, name: str, device: str = "") -> list[Metric]:
        """Return the received metrics of a name, in order."""
        messages = [each for each in list(self.messages) if each.device == device]
        return [metric for each in messages for metric in each.metrics if metric.name == name]

    def _receive(self, received: paho.MQTTMessage) -> None:
        topic = received.topic.split("/")
        message = Message(received.topic, "", "", received.payload, received.qos, received.retain)
        if topic[0] == "spBv1.0" and topic[1] != "STATE" and topic[2] not in ("NCMD", "DCMD"):
            message.kind, message.device = topic[2], topic[4] if len(topic) > 4 else ""
            for number, content in fields(received.payload):
                match number:
                    case 1:
                        message.time = content
                    case 2:
                        message.metrics.append(_metric(content))
                    case 3:
                        message.seq = content
            try:
                self._check(message)
            except AssertionError as error:
                self.faults.append(f"{message.kind} {message.device}: {error}")
        self.messages.append(message)

    def _check(self, message: Message) -> None:
        """Check the requirements of the specification, whose numbers are in the comments."""
        kind, metrics = message.kind, message.metrics
        assert not message.retain, "retained"
        assert message.time, "no timestamp"
        if kind == "NDEATH":
            assert message.seq is None, "payloads-ndeath-seq"
            assert [each.name for each in metrics] == ["bdSeq"], "topics-ndeath-payload"
            if metrics[0].value == self._session:
                self._alive.clear()
            return
        if kind == "NBIRTH":
            assert message.seq == 0, "payloads-sequence-num-zero-nbirth"
            by_name = {each.name: each for each in metrics}
            assert by_name["bdSeq"].datatype == 4, "payloads-nbirth-bdseq: Int64"
            rebirth = by_name["Node Control/Rebirth"]
            assert (rebirth.value, rebirth.alias, rebirth.datatype) == (False, None, 11), "payloads-nbirth-rebirth"
            self._session = by_name["bdSeq"].value
            self._alive, self._aliases = {""}, {}
        else:
            assert self._seq is not None
            assert message.seq == (self._seq + 1) % 256, f"sequence: {self._seq}, then {message.seq}"
        self._seq = message.seq
        if kind == "DDEATH":
            assert message.device in self._alive, "death of a device that was not born"
            self._alive.discard(message.device)
        if kind == "DBIRTH":
            assert "" in self._alive, "DBIRTH before NBIRTH"
            self._alive.add(message.device)
        for metric in metrics:
            assert metric.time, "payloads-name-timestamp"
            if kind in ("NBIRTH", "DBIRTH"):
                assert metric.name, "payloads-alias-birth-requirement"
                assert metric.datatype, "payloads-metric-datatype-req"
                if metric.alias is not None:
                    owner = self._aliases.setdefault(metric.alias, (message.device, metric.name, metric.datatype))
                    assert owner[:2] == (message.device, metric.name), "payloads-alias-uniqueness"
                    self._aliases[metric.alias] = (message.device, metric.name, metric.datatype)
            else:
                assert message.device in self._alive, "data of a device that was not born"
                assert metric.name is None, "payloads-alias-data-cmd-requirement"
                assert metric.alias in self._aliases, f"unknown alias {metric.alias}"
                device, metric.name, metric.datatype = self._aliases[metric.alias]
                assert device == message.device
            assert metric.null or _FIELD_OF[metric.datatype] == metric.number, "value of another type"
            assert metric.properties.get("Quality", 192) in (0, 192, 500), "payloads-propertyset-quality-value-value"
