"""The relay stores what a run on a node records, as the cell host would store it on the server's computer.

Checkpoints and the records of the ring arrive as messages. The ring is the memory that the server has created.
"""

import asyncio
import contextlib
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Final

import msgspec
from msgspec import Struct

from arcor2_hw.data.parts import PartInventory
from arcor2_hw.exceptions import Arcor2Error, Conflict
from arcor2_hw.runtime import messages as m
from arcor2_hw.runtime.checkpoints import CheckpointFile
from arcor2_hw.runtime.ring import Ring, records, save
from arcor2_hw.runtime.ring_records import shifted
from arcor2_server.background import BackgroundTasks

_encode = msgspec.msgpack.encode


class RingRecords(Struct, frozen=True, tag=True):
    """Records that the host has appended to its ring. generation: of their segment."""

    generation: int
    records: bytes


_decode_records = msgspec.msgpack.Decoder(RingRecords).decode
INTERCEPTED: Final = frozenset({"ReadCheckpoint", "StoreCheckpoint", "RingRecords"})
"""Messages from the node that the relay does not pass on to the server."""


class RingSender:
    """At the node: sends the records of a host's ring.

    Args:
        ring: the ring, which the host writes.
        send: sends a message to the relay.
    """

    def __init__(self, ring: Ring, send: Callable[[bytes], None]) -> None:
        self._ring, self._send = ring, send
        self._at = (0, 0)

    def flush(self) -> None:
        """Send what was recorded since the last call."""
        for generation, content in list(self._ring.appended(*self._at)):
            before = self._at[1] if generation == self._at[0] else 0
            self._at = generation, before + len(content)
            self._send(_encode(RingRecords(generation, content)))


class _Project(Struct, frozen=True):
    scene_id: str


class RunRecords:
    """At the relay: stores the checkpoints and the ring of a run.

    Args:
        ring: the ring of the server; None if nothing is recorded.
        answer: sends a message to the host.
        local_time: converts a time of the node's clock.
    """

    def __init__(
        self, ring: Ring | None, answer: Callable[[bytes], None], local_time: Callable[[float], float]
    ) -> None:
        self._ring, self._answer, self._local_time = ring, answer, local_time
        self._generation, self._offset = 0, 0.0
        self._run: m.RunPackage | None = None
        self._file: CheckpointFile | None = None
        self._scene_id = ""
        self._disk = ThreadPoolExecutor(1, "checkpoints")
        self._background = BackgroundTasks()

    def begin(self, run: m.RunPackage) -> None:
        """Open the checkpoints of the scene of a run. This blocks. A damaged package has none; its host reports it."""
        self._run = run
        with contextlib.suppress(OSError, msgspec.MsgspecError):
            content = (Path(run.directory) / "data" / "project.json").read_bytes()
            self._scene_id = msgspec.json.decode(content, type=_Project).scene_id
            if run.records:
                self._file = CheckpointFile(Path(run.records), self._scene_id)

    def handle(self, kind: str, body: bytes) -> None:
        """Handle a message of INTERCEPTED."""
        if kind == "RingRecords":
            self._record(_decode_records(body))
        else:
            self._background.spawn(self._execute(m.decode_server_bound(body)), "checkpoint")

    def program_changed(self, change: m.ProgramChanged) -> None:
        """Note that the program has ended: nothing can interrupt it any more."""
        if change.state == "stopped":
            self._run = None

    def _record(self, message: RingRecords) -> None:
        if self._ring is None:
            return
        if message.generation != self._generation:
            self._generation = message.generation
            self._offset = self._local_time(0.0)  # one for a segment, so that the order of its records does not change
            self._ring.begin_segment()
        for record in records(message.records):
            self._ring.append(shifted(record, self._offset))

    async def _execute(self, request: m.ReadCheckpoint | m.StoreCheckpoint) -> None:
        try:
            inventory = await asyncio.get_running_loop().run_in_executor(self._disk, self._checkpoint, request)
            answer = m.CheckpointAnswer(request.number, inventory)
        except Arcor2Error as error:
            answer = m.CheckpointAnswer(request.number, problem=error.message)
        self._answer(_encode(answer))

    def _checkpoint(self, request: m.ReadCheckpoint | m.StoreCheckpoint) -> PartInventory | None:
        """Read or store a checkpoint. A node can change only that of the scene that it runs."""
        if self._file is None:
            raise Conflict("The program has no part inventory.")
        if isinstance(request, m.ReadCheckpoint):
            return self._file.read()
        if request.inventory.scene_id != self._scene_id:
            raise Conflict("The program has no part inventory.")
        self._file.write(request.inventory)
        return None

    async def server_ended(self) -> None:
        """Store the ring of the run that the end of the server interrupts. The next server makes a recording of it."""
        run, self._run = self._run, None
        if run is not None and run.recordings and self._ring is not None:
            with contextlib.suppress(OSError):  # such as a full disk
                await asyncio.to_thread(save, self._ring.segments(), Path(run.recordings), run.run, main=run.main)

    async def close(self) -> None:
        """Wait until everything is stored."""
        await self._background.settled()
        self._disk.shutdown()
        if self._file is not None:
            self._file.close()
