"""The error raised if a calibration has no reliable result. Imports no numerics, so that the server can use it."""

import enum

from arcor2_hw.exceptions import Arcor2Error
from arcor2_hw.messages import Message


class Reason(enum.StrEnum):
    """Why a calibration has no result."""

    TOO_FEW_POINTS = "too_few_points"
    """Too little was measured, or too little of it is usable."""
    NO_OVERLAP = "no_overlap"
    """The measurement is nowhere near the expected object."""
    NOT_CONVERGED = "not_converged"
    """The search did not converge, or model and measurement disagree at its end."""
    AMBIGUOUS = "ambiguous"
    """Several results explain the measurement equally well."""
    UNOBSERVABLE = "unobservable"
    """A direction is undetermined: the view, or the set of points, is too symmetric."""
    DEGENERATE = "degenerate"
    """The points or orientations do not determine a result, such as points on one line."""
    NO_MARKER = "no_marker"
    """No configured marker or board is in the image, or none is configured."""
    BLURRED = "blurred"
    """The image is not sharp enough."""
    COVERED = "covered"
    """The image shows nothing: the lens is covered, or it is dark."""
    MIRRORED = "mirrored"
    """Markers are recognized in the mirror image only."""
    OVEREXPOSED = "overexposed"
    """No marker is recognized, and parts of the image are saturated by glare or too much light."""
    IMPLAUSIBLE = "implausible"
    """The measurement contradicts the configuration: a marker is elsewhere or appears twice, or the camera moved."""
    WRONG_LENS = "wrong_lens"
    """The measurement contradicts the intrinsics of the camera."""


class CalibrationRefused(Arcor2Error):
    """The measurement does not determine a reliable result.

    Attributes:
        reason: Reason for programs. `str(error)` says what a technician can change; `detail` contains the numbers.
    """

    code = "calibration_refused"

    def __init__(
        self, message: str | Message = "", detail: str = "", reason: Reason = Reason.NOT_CONVERGED, **values: object
    ) -> None:
        super().__init__(message, detail, **values)
        self.reason = reason
