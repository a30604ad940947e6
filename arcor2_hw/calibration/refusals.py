"""The error of a calibration that would have given nonsense. Imports no numerics: the server knows it too."""

import enum

from arcor2_hw.exceptions import Arcor2Error


class Reason(enum.StrEnum):
    """Why a calibration gave no result."""

    TOO_FEW_POINTS = "too_few_points"
    """Hardly anything was measured, or hardly anything of it can be used."""
    NO_OVERLAP = "no_overlap"
    """What was measured lies nowhere near what was looked for."""
    NOT_CONVERGED = "not_converged"
    """The search came to no end, or ended where measurement and model disagree."""
    AMBIGUOUS = "ambiguous"
    """Several results explain the measurement equally well."""
    UNOBSERVABLE = "unobservable"
    """A direction is left free: the view, or the set of points, is too symmetric."""
    DEGENERATE = "degenerate"
    """The points or orientations given do not determine a result: on one line, or all alike."""
    NO_MARKER = "no_marker"
    """None of the configured markers and boards is in the picture, or none is configured."""
    BLURRED = "blurred"
    """The picture is not sharp enough to measure in."""
    IMPLAUSIBLE = "implausible"
    """What is seen contradicts what was said: a marker stands elsewhere, or is there twice, or the camera moved."""


class CalibrationRefused(Arcor2Error):
    """The measurement determines no result that could be trusted.

    reason: for programs. `str(error)` says what a technician may change; detail has the figures.
    """

    code = "calibration_refused"

    def __init__(self, message: str = "", detail: str = "", reason: Reason = Reason.NOT_CONVERGED) -> None:
        super().__init__(message, detail)
        self.reason = reason
