"""Errors of a client: refused requests, and unknown results after a connection loss."""

from typing import Any, Final

from arcor2_hw.exceptions import (
    Arcor2Error,
    Conflict,
    ConnectionLost,
    DeviceError,
    DeviceTimeout,
    InvalidData,
    NotFound,
)


class RequestFailed(Arcor2Error):
    """The server refused a request, or failed; the text is that of the server.

    Attributes:
        request: Name of the request.
        reason: Code of the refusal, empty from a server that sends none.
        data: Data of the refusal.
    """

    code = "request_failed"

    def __init__(self, request: str, messages: list[str], data: Any = None, reason: str = "") -> None:
        super().__init__(" ".join(messages) or f"{request} failed")
        self.request = request
        self.data = data
        self.reason = reason


class Forbidden(RequestFailed):
    """The role is too low, or a token is required."""

    code = "forbidden"


class BadRequest(RequestFailed, InvalidData):
    """The arguments are invalid."""

    code = "bad_request"


class ResourceNotFound(RequestFailed, NotFound):
    """An item named in the request does not exist."""

    code = "nothing_there"


class StateConflict(RequestFailed, Conflict):
    """The request conflicts with the present state."""

    code = "in_the_way"


class LockedByOther(RequestFailed):
    """Another user holds the required lock."""

    code = "locked_by_other"


class NotOffered(RequestFailed):
    """The server does not know, or does not serve, this request."""

    code = "not_offered"


class DeviceFailed(RequestFailed, DeviceError):
    """A device failed or refused."""

    code = "device_failed"


class ServerFault(RequestFailed):
    """An internal error of the server; see its log."""

    code = "server_fault"


class NotAdmitted(Arcor2Error):
    """The server does not admit this token: it is wrong, revoked or expired."""

    code = "not_admitted"


class AnswerLost(ConnectionLost):
    """The connection broke before the answer. The request may or may not have been executed; it is not repeated."""

    code = "answer_unknown"

    def __init__(self, request: str, url: str) -> None:
        super().__init__(
            f"The connection to {url} broke before {request} was answered: it may or may not have been executed."
        )
        self.request = request


class AnswerTimeout(DeviceTimeout):
    """No answer came in time. The request may or may not have been executed; a late answer is discarded."""

    code = "answer_late"

    def __init__(self, request: str, limit: float) -> None:
        super().__init__(f"The server did not answer {request} within {limit:g} s.")
        self.request = request


class EventsMissed(Arcor2Error):
    """Events are missing at this place of a stream. The stream remains usable.

    Attributes:
        dropped: Number of events dropped because they were not read in time, or were invalid.
        rejoined: Whether the connection was lost and restored. Events of that time are missing; the initial events
            of the server follow, which describe the open document and the running program.
        seconds: Duration of the connection loss, s.
        not_resumed: Streams of robots that the server refused to resume.
    """

    code = "events_missed"

    def __init__(
        self, dropped: int = 0, *, rejoined: bool = False, seconds: float = 0.0, not_resumed: tuple[str, ...] = ()
    ) -> None:
        what = [f"{dropped} events were not read in time or were invalid"] if dropped else []
        what += [f"the connection was lost for {seconds:.1f} s"] if rejoined else []
        super().__init__(f"Events are missing: {' and '.join(what)}.")
        self.dropped = dropped
        self.rejoined = rejoined
        self.seconds = seconds
        self.not_resumed = not_resumed

    def joined_with(self, later: "EventsMissed") -> "EventsMissed":
        """Return one gap for two consecutive ones."""
        return EventsMissed(
            self.dropped + later.dropped,
            rejoined=self.rejoined or later.rejoined,
            seconds=self.seconds + later.seconds,
            not_resumed=later.not_resumed if later.rejoined else self.not_resumed,
        )


_KINDS: Final[dict[type[RequestFailed], tuple[str, ...]]] = {
    Forbidden: ("forbidden", "token_needed", "not_registered"),
    BadRequest: (
        *("invalid_arguments", "invalid_data", "invalid_project", "invalid_package", "unsound", "too_long"),
        "address_changed",
    ),
    ResourceNotFound: ("not_found",),
    StateConflict: ("conflict",),
    LockedByOther: ("locked",),
    NotOffered: ("unknown_request", "not_available", "not_implemented"),
    DeviceFailed: (
        *("device", "not_connected", "connection_lost", "device_timeout", "refused", "not_in_control", "out_of_range"),
        *("stale", "no_depth", "overexposed", "device_fault", "safety_stop", "cancelled", "kinematics", "cell"),
        *("path_blocked", "outcome_unknown", "arrived_late"),
    ),
    ServerFault: ("internal", "storage", "database_unreachable", "database_in_use"),
}
REASONS: Final[dict[str, type[RequestFailed]]] = {code: kind for kind, codes in _KINDS.items() for code in codes}
"""Error class by code of a refusal; other codes are RequestFailed."""
STATUSES: Final[dict[int, type[RequestFailed]]] = {
    400: BadRequest,
    401: Forbidden,
    403: Forbidden,
    404: ResourceNotFound,
    409: StateConflict,
    413: BadRequest,
    415: BadRequest,
    500: ServerFault,
}
"""Error class by status of a REST answer."""


def refusal(request: str, messages: list[str], data: Any = None, reason: str = "") -> RequestFailed:
    """Return the error of a refused request."""
    return REASONS.get(reason, RequestFailed)(request, messages, data, reason)


# Names before version 0.2, which scripts import.
AnswerLate, AnswerUnknown, InTheWay, NothingThere = AnswerTimeout, AnswerLost, StateConflict, ResourceNotFound
