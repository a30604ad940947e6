"""The typed asynchronous client of the protocol, for scripts, tests and the command line."""

from arcor2_hw.client.connection import Client
from arcor2_hw.client.errors import (
    AnswerLate,
    AnswerUnknown,
    BadRequest,
    DeviceFailed,
    EventsMissed,
    Forbidden,
    InTheWay,
    LockedByOther,
    NotAdmitted,
    NothingThere,
    NotOffered,
    RequestFailed,
    ServerFault,
)
from arcor2_hw.client.rest import Rest
from arcor2_hw.client.stream import EventStream, TypedEvent

__all__ = [
    "AnswerLate",
    "AnswerUnknown",
    "BadRequest",
    "Client",
    "DeviceFailed",
    "EventStream",
    "EventsMissed",
    "Forbidden",
    "InTheWay",
    "LockedByOther",
    "NotAdmitted",
    "NotOffered",
    "NothingThere",
    "RequestFailed",
    "Rest",
    "ServerFault",
    "TypedEvent",
]
