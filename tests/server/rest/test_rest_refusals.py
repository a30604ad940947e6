"""REST statuses of refusals by compute workers."""

from types import SimpleNamespace
from typing import Any

import msgspec
import pytest
from litestar.exceptions import HTTPException, MethodNotAllowedException, NotFoundException, ValidationException

from arcor2_hw.calibration.refusals import CalibrationRefused, Reason
from arcor2_hw.compute import messages as m
from arcor2_hw.compute.task import ComputeBusy, ComputeStopped, ComputeTimeout, NotInstalled
from arcor2_hw.compute.worker import failed
from arcor2_hw.exceptions import Arcor2Error, KinematicsError
from arcor2_server.compute.process import error_of
from arcor2_server.rest.responses import http_refusal, refusal


@pytest.mark.parametrize(
    ("error", "status", "kind"),
    [
        (NotInstalled("cv2 is not installed."), 503, "General"),
        (ComputeStopped("It ended."), 503, "General"),
        (ComputeTimeout("It took too long."), 503, "General"),
        (ComputeBusy("Too many."), 503, "General"),
        (CalibrationRefused("Two answers.", reason=Reason.AMBIGUOUS), 409, "Invalid"),
        (CalibrationRefused("No marker.", reason=Reason.NO_MARKER), 404, "NotFound"),
        (error_of(m.Failed(["calibration_refused", "error"], "No marker.", reason="no_marker")), 404, "NotFound"),
        (error_of(m.Failed(["bad_mesh", "robot_model", "invalid_data", "error"], "It is flat.")), 400, "Argument"),
        (error_of(m.Failed(["out_of_reach", "kinematics", "device", "error"], "Too far.")), 409, "General"),
    ],
)
def test_every_refusal_has_its_status(error: Arcor2Error, status: int, kind: str) -> None:
    answer = refusal("Calibration", error)
    assert answer.status_code == status
    body = msgspec.json.decode(answer.content)
    assert (body["type"], body["message"], body["service"]) == (kind, str(error), "Calibration")


def test_error_types_are_kept_across_processes() -> None:
    error = error_of(m.Failed(["out_of_reach", "kinematics", "device", "error"], "Too far.", "at 3 m"))
    assert isinstance(error, KinematicsError)
    assert (error.code, error.detail) == ("out_of_reach", "at 3 m")


def test_the_answer_contains_its_translation_data() -> None:
    inner = KinematicsError("{x:.1f} m is too far.", x=3)
    body = msgspec.json.decode(
        refusal("Calibration", Arcor2Error("{name}: {reason}", name="arm", reason=inner)).content
    )
    reason = {"text": "3.0 m is too far.", "key": "{x} m is too far.", "values": {"x": "3.0"}}
    assert (body["message"], body["key"]) == ("arm: 3.0 m is too far.", "{name}: {reason}")
    assert body["values"] == {"name": "arm", "reason": reason}
    assert "key" not in msgspec.json.decode(refusal("Calibration", Arcor2Error("No marker.")).content)


def test_translation_data_is_kept_across_processes() -> None:
    error = KinematicsError("{x:.1f} m is too far.", x=3)
    assert error_of(failed(error)).message == error.message


@pytest.mark.parametrize(
    ("error", "message", "values", "description"),
    [
        (NotFoundException(), "This address does not exist.", None, "Not Found"),
        (MethodNotAllowedException(), "This address does not support the method of the request.", None, None),
        (
            ValidationException("Validation failed for GET /x", extra=[{"message": "Expected `int`", "key": "limit"}]),
            "Invalid or missing in the request: limit.",
            {"names": "limit"},
            "Validation failed for GET /x",
        ),
        (NotFoundException("The editor has no such file."), "The editor has no such file.", None, ""),
    ],
)
def test_errors_of_the_framework_can_be_translated(
    error: HTTPException, message: str, values: dict[str, str] | None, description: str | None
) -> None:
    request: Any = SimpleNamespace(scope={})
    body = msgspec.json.decode(http_refusal(request, error).content)
    assert (body["message"], body.get("values")) == (message, values)
    if description is not None:
        assert body["description"] == description
