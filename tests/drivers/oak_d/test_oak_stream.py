"""The stream's codec: messages byte for byte as in docs/devices/oak-d.md, and invalid bytes."""

import socket
import threading
import time
import zlib
from typing import Any

import msgspec
import pytest
from hypothesis import given, strategies as st

from arcor2_drivers.oak_d import stream
from arcor2_drivers.oak_d.network import NetworkSource
from arcor2_drivers.oak_d.stream import BadStream, Clock, FrameHeader, Hello, Kind, Refusal, Status
from arcor2_fakes.oak_d.stream import Kind as SourceKind, Questions, encode

# magic, version, kind, length of the header, length of the payload, checksum; then the header and the payload
HELLO = (
    bytes.fromhex("4f414b53 01 01 0073 0000000d 523ba162")
    + b'{"vendor":"V","model":"M","serial":"S","firmware":"F","width":320,'
    + b'"height":180,"fps":30.0,"depth_range":[0.2,10.0]}'
    + b'{"version":7}'
)
START = bytes.fromhex("4f414b53 01 02 001c 00000000 4ca8d977") + b'{"client":"c","color":"bgr"}'
START_JPEG = bytes.fromhex("4f414b53 01 02 001d 00000000 ae365715") + b'{"client":"c","color":"jpeg"}'
FRAME = (
    bytes.fromhex("4f414b53 01 03 0056 00000005 0ae3e2c6")
    + b'{"number":5,"stamp":1.5,"exposure":0.01,"color":"bgr","color_bytes":3,'
    + b'"depth_bytes":2}'
    + b"\x01\x02\x03 \x03"
)
FRAME_NO_DEPTH = (
    bytes.fromhex("4f414b53 01 03 0048 00000004 fded9948")
    + b'{"number":6,"stamp":1.53,"color":"jpeg","color_bytes":4,'
    + b'"depth_bytes":0}'
    + b"\xff\xd8\xff\xd9"
)
ASK = bytes.fromhex("4f414b53 01 04 000e 00000000 fba2c5e2") + b'{"asked":12.5}'
CLOCK = bytes.fromhex("4f414b53 01 04 0018 00000000 da2a131b") + b'{"asked":12.5,"at":3.25}'
CONTROL = bytes.fromhex("4f414b53 01 05 0012 00000000 cb585d31") + b'{"exposure":0.004}'
AUTO = bytes.fromhex("4f414b53 01 05 0011 00000000 e87ba51a") + b'{"exposure":null}'
STATUS = bytes.fromhex("4f414b53 01 06 0024 00000000 f6354a75") + b'{"temperature":48.0,"exposure":null}'
REFUSED = bytes.fromhex("4f414b53 01 07 000f 00000000 a9cc30ef") + b'{"reason":"no"}'


@pytest.mark.parametrize(
    ("data", "kind", "header", "payload"),
    [
        (HELLO, Kind.HELLO, Hello("V", "M", "S", "F", 320, 180, 30.0, (0.2, 10.0)), b'{"version":7}'),
        (FRAME, Kind.FRAME, FrameHeader(5, 1.5, "bgr", 3, 2, 0.01), b"\x01\x02\x03\x20\x03"),
        (FRAME_NO_DEPTH, Kind.FRAME, FrameHeader(6, 1.53, "jpeg", 4, 0), b"\xff\xd8\xff\xd9"),
        (CLOCK, Kind.CLOCK, Clock(12.5, 3.25), b""),
        (STATUS, Kind.STATUS, Status(48.0, None), b""),
        (REFUSED, Kind.REFUSED, Refusal("no"), b""),
    ],
)
def test_messages_of_the_camera(data: bytes, kind: Kind, header: Any, payload: bytes) -> None:
    head = stream.read_prefix(data[:16])
    assert (head.kind, head.payload) == (kind, len(payload))
    text = data[16 : 16 + head.header]
    stream.verify(head, text)
    assert stream.read_header(text, type(header)) == header
    assert data[16 + head.header :] == payload


@pytest.mark.parametrize(
    ("data", "kind", "header"),
    [
        (START, Kind.START, {"client": "c", "color": "bgr"}),
        (START_JPEG, Kind.START, {"client": "c", "color": "jpeg"}),
        (ASK, Kind.CLOCK, {"asked": 12.5}),
        (CONTROL, Kind.CONTROL, {"exposure": 0.004}),
        (AUTO, Kind.CONTROL, {"exposure": None}),
    ],
)
def test_messages_of_the_driver(data: bytes, kind: Kind, header: dict[str, object]) -> None:
    assert stream.encode(kind, header) == data


@pytest.mark.parametrize(
    ("data", "problem"),
    [
        (b"HTTP" + FRAME[4:], "not this protocol: a message starts with b'HTTP'"),
        (FRAME[:4] + b"\x02" + FRAME[5:], "version 2 of the protocol, not 1"),
        (FRAME[:5] + b"\x08" + FRAME[6:], "a message of unknown kind 8"),
        (FRAME[:6] + b"\x10\x01" + FRAME[8:], "a message of 4097 and 5 bytes is too long"),
        (FRAME[:8] + b"\x04\x00\x00\x01" + FRAME[12:], "a message of 86 and 67108865 bytes is too long"),
    ],
)
def test_invalid_messages_are_refused(data: bytes, problem: str) -> None:
    with pytest.raises(BadStream, match=f"^{problem}"):
        stream.read_prefix(data[:16])


def test_every_bit_error_of_the_framing_is_detected() -> None:
    framing = FRAME[: 16 + stream.read_prefix(FRAME[:16]).header]
    for bit in range(8 * len(framing)):
        wrong = bytearray(framing)
        wrong[bit // 8] ^= 1 << bit % 8
        with pytest.raises(BadStream):
            stream.verify(stream.read_prefix(wrong[:16]), bytes(wrong[16:]))


@pytest.mark.parametrize(
    "text",
    [
        b"",
        b"{",
        b"[]",
        b'{"number":1}',
        b"\xff",
        FRAME[16:102].replace(b"1.5", b'"a"'),
        b'{"number":' + b"9" * 40 + b"}",
    ],
)
def test_invalid_headers_are_refused(text: bytes) -> None:
    with pytest.raises(BadStream, match=r"^an invalid header"):
        stream.read_header(text, FrameHeader)


def test_an_invalid_hello_is_refused() -> None:
    for wrong in ({"width": 0}, {"height": 10**6}, {"fps": 0.0}):
        text = msgspec.json.encode({**msgspec.json.decode(HELLO[16:-13]), **wrong})
        with pytest.raises(BadStream, match="is not a valid mode"):
            stream.read_header(text, Hello)


@given(st.binary(min_size=16, max_size=16))
def test_random_bytes_raise_only_protocol_errors(data: bytes) -> None:
    for each in (data, b"OAKS" + data[4:], b"OAKS\x01" + data[5:]):
        try:
            head = stream.read_prefix(each)
            stream.verify(head, data)
        except BadStream:
            continue
        assert zlib.crc32(each[:12] + data) == int.from_bytes(each[12:16], "big")


def test_an_image_is_not_older_than_stated_although_answers_are_late() -> None:
    """The source takes an image when it is asked for its clock. Its answer arrives 0.3 s later."""
    taken: list[float] = []

    def serve(listener: socket.socket) -> None:
        link = listener.accept()[0]

        def answer(kind: SourceKind, header: dict[str, Any]) -> None:
            if kind is SourceKind.CLOCK:
                taken.append(time.monotonic())
                time.sleep(0.3)
                stamp = taken[-1] - 100.0
                image = {"number": 0, "stamp": stamp, "color": "bgr", "color_bytes": 3 * 16 * 16, "depth_bytes": 0}
                link.sendall(encode(SourceKind.CLOCK, {**header, "at": stamp}))
                link.sendall(encode(SourceKind.FRAME, image, bytes(3 * 16 * 16)))

        hello = {"vendor": "V", "model": "M", "serial": "S", "firmware": "F", "width": 16, "height": 16, "fps": 30.0}
        questions = Questions(answer)
        with link:
            link.sendall(encode(SourceKind.HELLO, {**hello, "depth_range": [0.2, 10.0]}, b"{}"))
            while data := link.recv(4096):
                questions.feed(data)

    with socket.create_server(("127.0.0.1", 0)) as listener:
        source = NetworkSource("camera", "127.0.0.1", listener.getsockname()[1], "bgr", lambda status: None)
        serving = threading.Thread(target=serve, args=[listener])
        serving.start()
        source.open(time.monotonic() + 10.0)
        source.start("test")
        frame = source.next_frame(10.0)
        source.close()
        serving.join()
    assert frame.monotonic <= taken[0]
