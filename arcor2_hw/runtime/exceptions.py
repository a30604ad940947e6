"""Reporting of an exception that ends the script of a package."""

import sys

import msgspec

from arcor2_hw.data.events import Event, ProjectExceptionData
from arcor2_hw.exceptions import Arcor2Error
from arcor2_hw.runtime.program import current


def print_exception(error: BaseException) -> None:
    """Report the exception that ended the script to the server, or on standard output."""
    program = current()
    if program is not None:
        program.exception(error)
        return
    data = ProjectExceptionData(
        str(error) or type(error).__name__, type(error).__name__, isinstance(error, Arcor2Error)
    )
    sys.stdout.write(msgspec.json.encode(Event("ProjectException", data=data)).decode() + "\n")
    sys.stdout.flush()
