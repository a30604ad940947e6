"""Exit statuses of the commands."""

import enum


class ExitStatus(enum.IntEnum):
    """Kept stable: scripts test it. Every status but OK comes with a line on standard error."""

    OK = 0
    FAILED = 1
    """Something went wrong that has no status of its own."""
    USAGE = 2
    """The command line makes no sense."""
    PORT_TAKEN = 3
    """Another program listens there, or the address is none of this machine."""
    DATA_UNUSABLE = 4
    """The data directory cannot be created or written."""
    DATABASE_UNUSABLE = 5
    """The database is damaged, or was written by a newer version."""
    DATA_IN_USE = 6
    """Another server uses the data directory."""
    NO_SERVER = 7
    """There is no server at the address, or it does not answer."""
    PROGRAM_FAILED = 8
    """The program did not run to its end, or not to the right one."""
    NOT_FOUND = 9
    """What was named does not exist."""
    ANALYSIS_PROBLEMS = 10
    """An object type has problems."""
    CELL_UNUSABLE = 11
    """A cell file is damaged or contradictory."""
    DEVICE_UNREACHABLE = 12
    """A device did not connect, or is not fit for work."""
    NO_TOKENS = 13
    """Other machines could reach a server that requires no token."""
    CERTIFICATE_UNUSABLE = 14
    """The certificate or its key cannot be read, or do not belong together."""
    DIFFERENT = 15
    """What was compared is not the same."""
    DOCUMENT_PROBLEMS = 16
    """A scene, a project or an export file is damaged, or not sound."""
    CONFLICT = 17
    """Something else is there already, or is open."""
    NOT_PERMITTED = 18
    """The token is missing or not valid, or its role is too low."""
    CALIBRATION_REFUSED = 19
    """What was measured determines no result that could be trusted."""
    INTERRUPTED = 130
    """Ctrl-C (128 + SIGINT)."""
