"""Reporting of an exception that ends the script of a package."""

import sys

import msgspec

from arcor2_hw.data.events import Event, ProjectExceptionData
from arcor2_hw.exceptions import Arcor2Error, message_of
from arcor2_hw.runtime.program import current


def print_exception(error: BaseException) -> None:
    """Report the exception that ended the script to the server, or on standard output."""
    program = current()
    if program is not None:
        program.exception(error)
        return
    message = message_of(error)
    data = ProjectExceptionData(
        message.text, type(error).__name__, isinstance(error, Arcor2Error), **message.translation()
    )
    sys.stdout.write(msgspec.json.encode(Event("ProjectException", data=data)).decode() + "\n")
    sys.stdout.flush()
