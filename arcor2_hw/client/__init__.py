"""The typed asynchronous client of the protocol, for scripts, tests and the command line."""

from arcor2_hw.client.connection import Client
from arcor2_hw.client.errors import (
    AnswerLost,
    AnswerTimeout,
    BadRequest,
    DeviceFailed,
    EventsMissed,
    Forbidden,
    LockedByOther,
    NotAdmitted,
    NotOffered,
    RequestFailed,
    ResourceNotFound,
    ServerFault,
    StateConflict,
)
from arcor2_hw.client.rest import Rest
from arcor2_hw.client.stream import EventStream, TypedEvent

__all__ = [
    "AnswerLate",
    "AnswerLost",
    "AnswerTimeout",
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
    "ResourceNotFound",
    "Rest",
    "ServerFault",
    "StateConflict",
    "TypedEvent",
]

# Names before version 0.2, which scripts import.
from arcor2_hw.client.errors import (
    AnswerLate as AnswerLate,
    AnswerUnknown as AnswerUnknown,
    InTheWay as InTheWay,
    NothingThere as NothingThere,
)
