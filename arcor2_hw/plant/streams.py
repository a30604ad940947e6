"""Decodes the streams of devices that the server passes on as it received them."""

import time
from datetime import UTC, datetime
from typing import Final

import msgspec

from arcor2_hw.data.events import RobotJointsData
from arcor2_hw.data.points import ObjectPointsData


class _Points(msgspec.Struct):
    data: ObjectPointsData


class _Joints(msgspec.Struct):
    data: RobotJointsData


class _Head(msgspec.Struct):
    event: str


_decode_head: Final = msgspec.json.Decoder(_Head).decode
_decode_points: Final = msgspec.json.Decoder(_Points).decode
_decode_joints: Final = msgspec.json.Decoder(_Joints).decode


def decode_stream(encoded: bytes) -> ObjectPointsData | RobotJointsData:
    """Return the data of an encoded event ObjectPoints or RobotJoints."""
    if _decode_head(encoded).event == "RobotJoints":
        return _decode_joints(encoded).data
    return _decode_points(encoded).data


def time_of(monotonic: float) -> datetime:
    """Return the time of a stamp of the monotonic clock, s."""
    return datetime.fromtimestamp(time.time() - time.monotonic() + monotonic, UTC)
