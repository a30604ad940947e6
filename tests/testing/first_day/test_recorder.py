"""Recordings contain no secrets and stay small."""

import base64
import gzip
import hashlib
import json
from pathlib import Path

from arcor2_hw.testing.first_day.recorder import FILE, PER_SIDE, Recorder, forms, masked, redacted
from arcor2_hw.testing.wire import Piece, Side

SECRET = "s3cret/word"


def piece(data: bytes, by: Side = "driver", link: int = 1, at: float = 7.0) -> Piece:
    return Piece(at, by, link, data)


def test_secrets_are_masked_in_all_forms_and_across_pieces() -> None:
    secrets = forms([SECRET, "abc"], ["robot"])
    basic = base64.b64encode(f"robot:{SECRET}".encode())
    given = [
        piece(b"GET /?key=s3cret%2Fword HTTP/1.1\r\nAuthorization: Basic " + basic),
        piece(b"PASS s3cr"),
        piece(b"no", by="device"),
        piece(b"other", link=2),
        piece(b"et/word\r\nabc"),
    ]
    found = masked(given, secrets)
    assert [len(each.data) for each in found] == [len(each.data) for each in given]
    driver = b"".join(each.data for each in found if each.link == 1 and each.by == "driver")
    assert b"/?key=************* HTTP" in driver
    assert b"Basic " + b"*" * len(basic) + b"PASS ***********\r\nabc" in driver, "a short secret would be everywhere"
    assert [each.data for each in found if each.link == 2] == [b"other"]


def test_secrets_are_masked_in_texts() -> None:
    assert redacted(f"the login with {SECRET!r} failed", forms([SECRET])) == "the login with '***' failed"


def test_a_recording_keeps_beginning_and_end_of_each_case(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path, [])
    assert recorder.recording() is None
    chunk = 1024
    pieces = [piece(bytes([number % 256]) * chunk, "device", at=float(number)) for number in range(100)]
    recorder.add("stop_passes", [piece(b"stop"), *pieces])
    recorder.add("nothing", [])
    lines = [json.loads(line) for line in gzip.decompress((tmp_path / FILE).read_bytes()).splitlines()]
    device = [line for line in lines if line.get("by") == "device"]
    assert [line["hex"][:2] for line in device] == [f"{n:02x}" for n in (*range(16), *range(84, 100))]
    assert sum(len(line["hex"]) // 2 for line in device) <= PER_SIDE
    assert lines[0] == {"case": "stop_passes", "at": 0.0, "by": "driver", "link": 1, "hex": b"stop".hex()}
    assert lines[-1] == {"case": "stop_passes", "left_off": {"driver": 0, "device": 68 * chunk}}
    recording = recorder.recording()
    assert recording is not None
    assert recording.sha256 == hashlib.sha256((tmp_path / FILE).read_bytes()).hexdigest()
