"""Exit statuses of the commands."""

import enum
import sys


class ExitStatus(enum.IntEnum):
    """The exit status of a command. Scripts depend on the numbers. Each failure is explained on standard error."""

    OK = 0
    FAILED = 1
    """Any error without its own status."""
    USAGE = 2
    """The command line is invalid."""
    PORT_TAKEN = 3
    """Another program uses the port, or the address is not an address of this machine."""
    DATA_UNUSABLE = 4
    """The data directory cannot be created or written."""
    DATABASE_UNUSABLE = 5
    """The database is damaged, was written by a newer version, or cannot be reached."""
    DATA_IN_USE = 6
    """Another server uses the data directory or the database."""
    NO_SERVER = 7
    """No server answers at the address."""
    PROGRAM_FAILED = 8
    """The program failed, or its results are wrong."""
    NOT_FOUND = 9
    """The named file or item does not exist."""
    ANALYSIS_PROBLEMS = 10
    """An object type has problems."""
    CELL_UNUSABLE = 11
    """A cell file is damaged or contradictory."""
    DEVICE_UNREACHABLE = 12
    """A device did not connect, or is not ready for use."""
    CERTIFICATE_UNUSABLE = 14
    """The certificate or its key cannot be read, or they do not match."""
    DIFFERENT = 15
    """The compared items differ."""
    DOCUMENT_PROBLEMS = 16
    """A scene, project or export file is damaged or has errors."""
    CONFLICT = 17
    """Another item or file already exists, or is open."""
    NOT_PERMITTED = 18
    """The token is missing or invalid, or its role does not allow the command."""
    CALIBRATION_REFUSED = 19
    """The measurements do not determine a reliable result."""
    INTERRUPTED = 130
    """Ctrl-C (128 + SIGINT)."""


class CannotServe(Exception):
    """The server cannot start for a reason that the user can fix."""

    def __init__(self, status: ExitStatus, reason: str) -> None:
        super().__init__(reason)
        self.status = status


def fail(command: str, reason: object, status: ExitStatus) -> ExitStatus:
    """Print why a command failed on standard error; return the status."""
    sys.stderr.write(f"arcor2-hw {command}: {reason}\n")
    return status
