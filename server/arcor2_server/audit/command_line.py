"""Notes changes that the command line makes to the files of a server, which may be running."""

import getpass
import os
from contextlib import closing
from pathlib import Path

from arcor2_hw.data.audit import AuditEntry, AuditOutcome
from arcor2_hw.data.base import now
from arcor2_server.audit.chain import AuditFile


def note_command(audit_file: Path, command: str, target: str) -> None:
    """Add an entry for a command of the account that runs it.

    Args:
        audit_file: the file of the audit trail.
        command: words of the command, such as `token add`.
        target: what it changed.

    Raises:
        StorageError: the file cannot be written, or was edited.
    """
    user = os.environ.get("SUDO_USER") or getpass.getuser()
    with closing(AuditFile(audit_file)) as file:
        file.open()
        file.require_head()
        file.append([AuditEntry(0, now(), AuditOutcome.DONE, f"arcor2-hw {command}", target, user, "none")])
