"""What a client raises: why a request was refused, and what is not known after the connection was lost."""

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
    """The server answered that it would not, or could not; the text is the server's.

    request: its name. reason: the server's code, empty from a server that sends none. data: what a refusal carries.
    """

    code = "request_failed"

    def __init__(self, request: str, messages: list[str], data: Any = None, reason: str = "") -> None:
        super().__init__(" ".join(messages) or f"{request} failed")
        self.request = request
        self.data = data
        self.reason = reason


class Forbidden(RequestFailed):
    """The role is too low, or a token is needed."""

    code = "forbidden"


class BadRequest(RequestFailed, InvalidData):
    """The arguments have a wrong form, or make no sense."""

    code = "bad_request"


class NothingThere(RequestFailed, NotFound):
    """What the request names does not exist."""

    code = "nothing_there"


class InTheWay(RequestFailed, Conflict):
    """The request stands against what is there."""

    code = "in_the_way"


class LockedByOther(RequestFailed):
    """Somebody else holds the lock that is needed."""

    code = "locked_by_other"


class NotOffered(RequestFailed):
    """The server does not know, or does not serve, this request."""

    code = "not_offered"


class DeviceFailed(RequestFailed, DeviceError):
    """A device could not, or would not."""

    code = "device_failed"


class ServerFault(RequestFailed):
    """Something went wrong inside the server, which its log tells."""

    code = "server_fault"


class NotAdmitted(Arcor2Error):
    """The server lets nobody in with this token: it is wrong, was revoked, or its time is over."""

    code = "not_admitted"


class AnswerUnknown(ConnectionLost):
    """The connection broke before the answer came: the request may or may not have been done. It is not repeated."""

    code = "answer_unknown"

    def __init__(self, request: str, url: str) -> None:
        super().__init__(f"The connection to {url} broke before {request} was answered: it may or may not be done.")
        self.request = request


class AnswerLate(DeviceTimeout):
    """No answer came in time: the request may or may not be done, and a late answer is thrown away."""

    code = "answer_late"

    def __init__(self, request: str, limit: float) -> None:
        super().__init__(f"The server did not answer {request} within {limit:g} s.")
        self.request = request


class EventsMissed(Arcor2Error):
    """Events are missing here, in the order of a stream; it can be read on behind the gap.

    dropped: how many were thrown away because nobody took them, or could not be read. rejoined: the connection was
    lost for `seconds`; whatever was told in that time is missing, and the server's greeting, which says what is open
    and what runs, comes next. not_resumed: streams of robots that the server would not give again.
    """

    code = "events_missed"

    def __init__(
        self, dropped: int = 0, *, rejoined: bool = False, seconds: float = 0.0, not_resumed: tuple[str, ...] = ()
    ) -> None:
        what = [f"{dropped} events were not taken in time or could not be read"] if dropped else []
        what += [f"the connection was lost for {seconds:.1f} s"] if rejoined else []
        super().__init__(f"Events are missing: {' and '.join(what)}.")
        self.dropped = dropped
        self.rejoined = rejoined
        self.seconds = seconds
        self.not_resumed = not_resumed

    def joined_with(self, later: "EventsMissed") -> "EventsMissed":
        """Give one gap for two that follow each other."""
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
    NothingThere: ("not_found",),
    InTheWay: ("conflict",),
    LockedByOther: ("locked",),
    NotOffered: ("unknown_request", "not_available", "not_implemented"),
    DeviceFailed: (
        *("device", "not_connected", "connection_lost", "device_timeout", "refused", "not_in_control", "out_of_range"),
        *("stale", "no_depth", "overexposed", "device_fault", "safety_stop", "cancelled", "kinematics", "cell"),
        "path_blocked",
    ),
    ServerFault: ("internal", "storage"),
}
REASONS: Final[dict[str, type[RequestFailed]]] = {code: kind for kind, codes in _KINDS.items() for code in codes}
"""Which error stands for which code of a refusal (docs/protocol.md); others are RequestFailed itself."""
STATUSES: Final[dict[int, type[RequestFailed]]] = {
    400: BadRequest,
    401: Forbidden,
    403: Forbidden,
    404: NothingThere,
    409: InTheWay,
    413: BadRequest,
    415: BadRequest,
    500: ServerFault,
}
"""Which error stands for which status of a REST answer."""


def refusal(request: str, messages: list[str], data: Any = None, reason: str = "") -> RequestFailed:
    """Make the error of a refused request."""
    return REASONS.get(reason, RequestFailed)(request, messages, data, reason)
