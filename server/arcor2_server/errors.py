"""Errors with which the server refuses a request."""

from typing import Any

from arcor2_hw.data.base import UNSET
from arcor2_hw.exceptions import Arcor2Error
from arcor2_hw.messages import Message


class RequestRefused(Arcor2Error):
    """The server refuses a request. The text becomes the message of the answer.

    Args:
        message: the problem and its remedy; a template if there are values.
        data: the data of the answer. Only DeleteScene and DeleteObjectTypes return data with result=false.
    """

    code = "request_refused"

    def __init__(self, message: str | Message, data: Any = UNSET, **values: object) -> None:
        super().__init__(message, "", **values)
        self.data = data


class NotRegistered(RequestRefused):
    """The request needs a registered user."""

    code = "not_registered"


class LogOnNeeded(RequestRefused):
    """The request needs a person who is logged on."""

    code = "log_on_needed"
