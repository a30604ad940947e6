"""Calibration records: storage, and later checks against a record."""

import hashlib
import math

import msgspec
import pytest

from arcor2_hw.calibration.records import (
    CalibrationInput,
    CalibrationKind,
    CalibrationRecord,
    check_against,
)
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.exceptions import InvalidData

BEFORE, AFTER = Pose(Position(0.1, 0.2, 0.8)), Pose(Position(0.11, 0.2, 0.81), Orientation(1, 0, 0, 0))


def record(after: Pose | None = AFTER) -> CalibrationRecord:
    made = CalibrationRecord(
        CalibrationKind.CAMERA_POSE,
        "technician",
        "obj_1",
        "camera",
        "world",
        "Good.",
        residual=0.3,
        residual_unit="px",
        inputs=[CalibrationInput.of("picture.png", b"picture", "2026/picture.png")],
        parameters={"markers": [1, 2]},
        before=BEFORE,
    )
    return made if after is None else msgspec.structs.replace(made, after=after)


def test_a_record_survives_storage_and_two_have_different_ids() -> None:
    first, second = record(), record()
    assert msgspec.json.decode(msgspec.json.encode(first), type=CalibrationRecord) == first
    assert first.id != second.id
    assert first.inputs[0].sha256 == hashlib.sha256(b"picture").hexdigest()
    assert first.inputs[0].size == 7


def test_an_unset_pose_is_omitted_instead_of_null() -> None:
    assert b'"after"' not in msgspec.json.encode(record(after=None))


@pytest.mark.parametrize(
    ("move", "turn", "passed"),
    [(0.0, 0.0, True), (0.0019, 0.0, True), (0.0021, 0.0, False), (0.0, 0.19, True), (0.0, 0.21, False)],
)
def test_a_check_passes_only_within_both_limits(move: float, turn: float, passed: bool) -> None:
    turned = AFTER.orientation * Orientation.from_rotation_vector(0.0, math.radians(turn), 0.0)
    check = check_against(record(), Pose(AFTER.position + Position(0, move, 0), turned))
    assert check.passed is passed
    assert check.distance == pytest.approx(move, abs=1e-12)
    assert check.angle == pytest.approx(math.radians(turn), abs=1e-9)
    assert ("calibrate it again" in check.verdict) is not passed


def test_a_check_needs_a_pose_and_limits() -> None:
    with pytest.raises(InvalidData, match="no pose"):
        check_against(record(after=None), AFTER)
    with pytest.raises(InvalidData, match="distance_limit"):
        check_against(record(), AFTER, distance_limit=0.0)
    with pytest.raises(InvalidData, match="angle_limit"):
        check_against(record(), AFTER, angle_limit=math.nan)
    with pytest.raises(InvalidData, match="finite"):
        check_against(record(), Pose(Position(math.inf, 0, 0)))
