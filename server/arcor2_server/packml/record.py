"""Stored state of the cell: mode, authority, jobs, and the last request of the PLC."""

import asyncio
import enum
from pathlib import Path
from typing import Any, Final, NamedTuple

import msgspec
from msgspec.structs import replace

from arcor2_hw.data.cell_state import CellAuthority, CellJob, CellMode
from arcor2_hw.exceptions import StorageError
from arcor2_hw.messages import Message
from arcor2_server.audit import changes as audit
from arcor2_server.files import write_private
from arcor2_server.storage.damage_notices import DataDamage

_SETTINGS: Final = ("mode", "authority", "jobs")
"""Fields of CellRecord that people change."""


class RequestResult(enum.IntEnum):
    """Result of a request of the PLC."""

    ACCEPTED = 0
    NO_AUTHORITY = 1
    WRONG_MODE = 2
    WRONG_STATE = 3
    UNKNOWN_COMMAND = 4
    UNKNOWN_JOB = 5
    LIFE_COUNTER_FROZEN = 6
    PERSON_NEEDED = 7
    REFUSED = 8
    INTERRUPTED = 9
    """The server ended while it executed the request, which it does not repeat."""


class JobEnd(enum.IntEnum):
    """Outcome of the last job of the PLC."""

    NONE = 0
    RUNNING = 1
    COMPLETED = 2
    STOPPED = 3
    FAILED = 4
    LOST = 5
    """The server or the process of the program ended."""


class PlantRequest(msgspec.Struct, frozen=True):
    """A request of a plant system over OPC UA, identified by the client, and its result."""

    id: str
    result: RequestResult
    text: str = ""


class CellRecord(msgspec.Struct, frozen=True):
    """The stored values.

    request, result: the last request of the PLC that was accepted for execution. job, job_end: its last job.
    plant_requests: the last requests of plant systems, oldest first.
    """

    mode: CellMode = CellMode.PRODUCE
    authority: CellAuthority = CellAuthority.HUB
    jobs: list[CellJob] = []
    request: int = 0
    result: RequestResult = RequestResult.ACCEPTED
    job: int = 0
    job_end: JobEnd = JobEnd.NONE
    plant_requests: list[PlantRequest] = []


class SettingChange(NamedTuple):
    """A changed setting of the cell, for the audit trail."""

    id: str
    before: Any
    after: Any
    kind: str = "cell"


class CellFile:
    """The file of the cell. Each change is durable before it takes effect."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._changing = asyncio.Lock()
        self.record = CellRecord()

    def load(self, damage: DataDamage) -> None:
        """Read the file. If the file is damaged, nobody has the authority. The PLC always loses it.

        Raises:
            StorageError: the file cannot be read.
        """
        exists = self._path.exists()
        loss = Message.of("The mode of the cell and the jobs of the PLC are lost: set them again.")
        found = damage.read_json(self._path, CellRecord, loss)
        if found is None:
            found = CellRecord(authority=CellAuthority.NOBODY if exists else CellAuthority.HUB)
        if found.authority is CellAuthority.PLC:
            found = replace(found, authority=CellAuthority.NOBODY)
        if found.job_end is JobEnd.RUNNING:
            found = replace(found, job_end=JobEnd.LOST)
        self.record = found

    async def put(self, **changes: Any) -> None:
        """Store changed values.

        Raises:
            StorageError: the file cannot be written. Nothing has changed.
        """
        async with self._changing:
            changed = replace(self.record, **changes)
            if changed == self.record:
                return
            try:
                await asyncio.to_thread(write_private, self._path, msgspec.json.encode(changed))
            except OSError as error:
                raise StorageError(
                    "The state of the cell cannot be stored in {path}: {reason}.",
                    path=self._path,
                    reason=error.strerror,
                ) from error
            before, self.record = self.record, changed
        audit.record(
            SettingChange(name, getattr(before, name), getattr(changed, name)) for name in _SETTINGS if name in changes
        )
