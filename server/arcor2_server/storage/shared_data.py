"""Stores view values, shared breakpoints and the history of runs in the database."""

import asyncio
import zlib
from collections.abc import Iterable, Mapping
from typing import Any

import msgspec
from sqlalchemy import delete, func, select

from arcor2_hw.data.editor import Run
from arcor2_hw.data.run_trace import RunTrace
from arcor2_hw.exceptions import StorageError
from arcor2_server.storage.models import RunRow, RunTraceRow, SharedBreakpointsRow, ViewValueRow
from arcor2_server.storage.store import Storage


class SharedData:
    """Data shared by clients. All methods may raise StorageError. Cached lists of documents stay valid."""

    def __init__(self, storage: Storage) -> None:
        self._storage = storage

    # ------------------------------------------------------------------------------------------------ view state
    async def newest_revision(self) -> int:
        """Return the highest revision of a view value, 0 if there is none."""
        async with self._storage.reading() as session:
            return await session.scalar(select(func.max(ViewValueRow.revision))) or 0

    async def view(self, user: str, document: str) -> dict[str, bytes]:
        """Return the values of a view by key, as JSON."""
        where = (ViewValueRow.user == user, ViewValueRow.document == document)
        async with self._storage.reading() as session:
            rows = await session.execute(select(ViewValueRow.key, ViewValueRow.value).where(*where))
            return {row.key: row.value for row in rows}

    async def put_view(self, user: str, document: str, values: Mapping[str, bytes | None], revision: int) -> None:
        """Write values; None deletes a value."""
        deleted = [key for key, value in values.items() if value is None]
        async with self._storage.writing(documents=False) as session:
            for key, value in values.items():
                if value is not None:
                    row = ViewValueRow(user=user, document=document, key=key, value=value, revision=revision)
                    await self._storage.upsert(session, row)
            if deleted:
                where = (ViewValueRow.user == user, ViewValueRow.document == document, ViewValueRow.key.in_(deleted))
                await session.execute(delete(ViewValueRow).where(*where))

    async def oldest_views(self, user: str, beyond: int) -> list[str]:
        """Return the documents of a user's views, latest first, without the `beyond` ones that were written last."""
        written = func.max(ViewValueRow.revision)
        query = select(ViewValueRow.document).where(ViewValueRow.user == user)
        async with self._storage.reading() as session:
            rows = await session.scalars(query.group_by(ViewValueRow.document).order_by(written.desc()).offset(beyond))
            return list(rows)

    async def delete_views(self, user: str, documents: Iterable[str]) -> None:
        """Delete a user's views of documents."""
        where = (ViewValueRow.user == user, ViewValueRow.document.in_(list(documents)))
        async with self._storage.writing(documents=False) as session:
            await session.execute(delete(ViewValueRow).where(*where))

    async def delete_document(self, document: str) -> None:
        """Delete all views of a deleted document, and its breakpoints."""
        async with self._storage.writing(documents=False) as session:
            await session.execute(delete(ViewValueRow).where(ViewValueRow.document == document))
            await session.execute(delete(SharedBreakpointsRow).where(SharedBreakpointsRow.project_id == document))

    # ------------------------------------------------------------------------------------------ shared breakpoints
    async def breakpoints(self, project_id: str) -> tuple[set[str], str]:
        """Return the breakpoints of a project, and the user who set them last."""
        async with self._storage.reading() as session:
            row = await session.get(SharedBreakpointsRow, project_id)
            return (set(), "") if row is None else (msgspec.json.decode(row.ids, type=set[str]), row.user)

    async def put_breakpoints(self, project_id: str, ids: set[str], user: str) -> None:
        """Replace the breakpoints of a project."""
        async with self._storage.writing(documents=False) as session:
            await self._storage.upsert(
                session, SharedBreakpointsRow(project_id=project_id, ids=msgspec.json.encode(sorted(ids)), user=user)
            )

    # ------------------------------------------------------------------------------------------------ runs
    async def runs(self, limit: int) -> list[Run]:
        """Return the newest runs, oldest first, without unreadable ones."""
        async with self._storage.reading() as session:
            rows = await session.scalars(select(RunRow.document).order_by(RunRow.number.desc()).limit(limit))
            found = [_run(document) for document in rows]
        return [run for run in reversed(found) if run is not None]

    async def put_run(self, run: Run, oldest: int) -> None:
        """Store a run, and delete those with a number below `oldest`."""
        async with self._storage.writing(documents=False) as session:
            await self._storage.upsert(session, RunRow(number=run.number, document=msgspec.json.encode(run)))
            await session.execute(delete(RunRow).where(RunRow.number < oldest))
            await session.execute(delete(RunTraceRow).where(RunTraceRow.run < oldest))

    async def run_trace(self, run: int) -> RunTrace | None:
        """Return the trace of a run, None if there is none."""
        async with self._storage.reading() as session:
            row = await session.get(RunTraceRow, run)
            document = None if row is None else row.document
        return None if document is None else await asyncio.to_thread(_trace, document)

    async def put_run_trace(self, trace: RunTrace) -> None:
        """Store the trace of a run."""
        document = await asyncio.to_thread(lambda: zlib.compress(msgspec.json.encode(trace)))
        async with self._storage.writing(documents=False) as session:
            await self._storage.upsert(session, RunTraceRow(run=trace.run, document=document))


def _trace(document: bytes) -> RunTrace:
    try:
        return msgspec.json.decode(zlib.decompress(document), type=RunTrace)
    except (msgspec.MsgspecError, zlib.error) as error:
        raise StorageError("The trace of the run cannot be read: {reason}.", reason=error) from error


def _run(document: Any) -> Run | None:
    try:
        return msgspec.json.decode(document, type=Run)
    except msgspec.MsgspecError:
        return None
