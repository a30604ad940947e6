"""Writes the audit trail in a thread, so that no request waits for it."""

import asyncio
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Final, NamedTuple

import msgspec
import structlog

from arcor2_hw.data.audit import AuditChange, AuditCheck, AuditEntry, AuditOutcome, AuditQuery
from arcor2_hw.data.base import now
from arcor2_hw.data.role import Role
from arcor2_hw.exceptions import StorageError
from arcor2_hw.messages import Message
from arcor2_server.audit.chain import AuditFile
from arcor2_server.audit.changes import Change
from arcor2_server.files import damaged_copy_path

log = structlog.get_logger(__name__)

COLLECTION_TIME: Final = 0.05
"""Time for which entries are collected before they are written together, s. The end of the process loses them."""
MAX_CHANGES: Final = 256 * 1024
"""Maximum size of the changes of an entry, bytes."""
MAX_REASON: Final = 1000
"""Maximum length of the reason of a refusal, characters."""
ENDED_EARLY: Final = "The request was cancelled after it had made these changes."
"""Reason of the entry of a cancelled request."""
MAX_WAITING: Final = 10_000
"""Maximum number of entries that wait for a file that cannot be written."""
RETRY_AFTER: Final = 5.0
"""Time after which writing is tried again, s."""


class WaitingEntry(NamedTuple):
    """A request that has ended."""

    time: str
    outcome: AuditOutcome
    request: str
    target: str
    user: str
    role: str
    address: str
    reason: str
    changes: Sequence[Change]


class AuditTrail:
    """The audit trail of a running server.

    Args:
        path: its file.
        redact: returns a text without secrets.
    """

    def __init__(self, path: Path, redact: Callable[[str], str]) -> None:
        self._file = AuditFile(path)
        self._redact = redact
        self._waiting: SimpleQueue[WaitingEntry | None] = SimpleQueue()
        self._writer: threading.Thread | None = None

    async def open(self) -> Message | None:
        """Check the file and start to write. Return its problem, None if it is intact.

        A file with a problem is renamed, and a new one is started. Its first entry states the problem.

        Raises:
            StorageError: the file can be neither used nor renamed.
        """
        problem = await asyncio.to_thread(self._open)
        self._writer = threading.Thread(target=self._write, name="audit trail", daemon=True)
        self._writer.start()
        if problem:
            self.note(AuditOutcome.REFUSED, "CheckAuditTrail", reason=problem.text)
        return problem

    def _open(self) -> Message | None:
        path = self._file.path
        if not path.exists():
            self._file.open()
            return None
        try:
            found = self._file.check()
            problem: str | Message = found.problem
            if not problem:
                self._file.open()
                log.info("audit trail", last=found.last, digest=found.digest)
                return None
        except StorageError as error:
            problem = error.message
        self._file.close()
        stored = damaged_copy_path(path, now())
        try:
            for ending in ("", "-wal", "-shm", ".head"):
                if (part := path.with_name(path.name + ending)).exists():
                    part.rename(stored.with_name(stored.name + ending))
        except OSError as error:
            raise StorageError("The audit trail {path} cannot be used: {reason}.", path=path, reason=error) from error
        self._file = AuditFile(path)
        self._file.open()
        return Message.of(
            "The audit trail was damaged or edited: {problem}. It is stored as {file}.",
            problem=problem,
            file=stored.name,
        )

    def close(self) -> None:
        """Write the waiting entries and close the file."""
        self._waiting.put(None)
        if self._writer is not None:
            self._writer.join()
        self._file.close()

    # ------------------------------------------------------------------------------------------ noting
    def note(
        self,
        outcome: AuditOutcome,
        request: str,
        *,
        target: str = "",
        user: str = "",
        role: Role | None = None,
        address: str = "",
        reason: str = "",
        changes: Sequence[Change] = (),
    ) -> None:
        """Add an entry, and write it to the log without its reason and changes."""
        name = "none" if role is None else role.name.lower()
        write = log.warning if outcome is AuditOutcome.FORBIDDEN else log.info
        write("command", outcome=outcome.value, request=request, target=target, user=user, role=name, address=address)
        reason = self._redact(reason)[:MAX_REASON]
        self._waiting.put(WaitingEntry(now(), outcome, request, target, user, name, address, reason, changes))

    def _write(self) -> None:
        """Write entries until the trail is closed."""
        noted: list[WaitingEntry] = []
        lost = 0
        while not self._collect(noted):
            lost += self._write_all(noted, lost)
        self._write_all(noted, lost)

    def _collect(self, noted: list[WaitingEntry]) -> bool:
        """Wait for entries and collect them. Return whether the trail is being closed."""
        try:
            each = self._waiting.get(timeout=RETRY_AFTER if noted else None)
            if each is not None:
                time.sleep(COLLECTION_TIME)
            while each is not None:
                noted.append(each)
                each = self._waiting.get_nowait()
        except Empty:
            return False
        return True

    def _write_all(self, noted: list[WaitingEntry], lost: int) -> int:
        """Write entries and remove them from the list. Return by how much the number of lost entries changes."""
        lines = [*noted, _losses(lost)] if lost else noted
        try:
            if lines:
                self._file.append([_entry(each) for each in lines])
        except StorageError as error:
            log.error("audit trail not written", waiting=len(noted), lost=lost, reason=str(error))
            dropped = max(len(noted) - MAX_WAITING, 0)
            del noted[:dropped]
            return dropped
        noted.clear()
        return -lost

    # ------------------------------------------------------------------------------------------ reading
    async def find(self, query: AuditQuery) -> list[AuditEntry]:
        """Return the selected entries, newest first. Raise StorageError."""
        return await asyncio.to_thread(self._file.find, query)

    def all(self) -> Iterator[AuditEntry]:
        """Return all entries, oldest first; the iterator reads the file and must not run in the event loop."""
        return self._file.all()

    async def check(self) -> AuditCheck:
        """Compare all entries with their digests. Raise StorageError."""
        return await asyncio.to_thread(self._file.check)


def _entry(noted: WaitingEntry) -> AuditEntry:
    """Return an entry, which the file numbers."""
    changes = [AuditChange(each.kind, each.id, each.before, each.after) for each in noted.changes]
    reason = noted.reason
    if changes and len(msgspec.json.encode(changes)) > MAX_CHANGES:
        reason = f"Changed items: {len(changes)}. Their values are too large for the audit trail."
        changes = []
    return AuditEntry(
        0, noted.time, noted.outcome, noted.request, noted.target, noted.user, noted.role, noted.address, reason,
        changes,
    )  # fmt: skip


def _losses(count: int) -> WaitingEntry:
    reason = f"Lost entries: {count}. The file could not be written."
    return WaitingEntry(now(), AuditOutcome.REFUSED, "WriteAuditTrail", "", "", "none", "", reason, ())
