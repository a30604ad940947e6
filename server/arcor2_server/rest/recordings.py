"""Recordings of alarms and failed runs over REST (docs/protocol/recordings.md)."""

import asyncio
from dataclasses import dataclass

from arcor2_hw.data.recordings import Recording, RecordingInfo, RecordingQuery
from arcor2_hw.data.role import Role
from arcor2_server.recordings.service import Recordings
from arcor2_server.rest.general import SERVER
from arcor2_server.rest.operations import Binary, operation
from arcor2_server.storage.recordings import not_found


@dataclass(frozen=True, slots=True)
class RecordingOperations:
    """Recordings of alarms and failed runs over REST."""

    _recordings: Recordings

    @operation("GET", "/api/recordings", SERVER, Role.OPERATOR, plain=True)
    async def recordings(self, query: RecordingQuery) -> list[RecordingInfo]:
        """Return the stored recordings without their values, newest first."""
        return self._recordings.find(query)

    @operation("GET", "/api/recordings/{number}", SERVER, Role.OPERATOR, plain=True)
    async def recording(self, number: str) -> Recording:
        """Return a recording: points, joints and actions before and after the event."""
        return await self._recordings.get(_number(number))

    @operation("GET", "/api/recordings/{number}/export", SERVER, Role.OPERATOR, media_type="text/csv")
    async def export_recording(self, number: str) -> Binary:
        """Return a recording as CSV: one row for each time at which something changed."""
        from arcor2_server.recordings.export import (
            as_csv,
        )  # with a module that is not needed at the start of the server

        recording = await self._recordings.get(_number(number))
        content = await asyncio.to_thread(as_csv, recording)
        return Binary(content, "text/csv", f"recording-{recording.number}.csv")


def _number(text: str) -> int:
    """Return the number of a recording. Raise NotFound if the text is not a number."""
    if not (text.isascii() and text.isdecimal() and len(text) < 10):
        raise not_found(text[:20])
    return int(text)
