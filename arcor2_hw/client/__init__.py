"""The typed asynchronous client of the protocol: what scripts, tests and the command line use."""

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
from arcor2_hw.client.stream import EventStream, Told

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
    "Told",
]
