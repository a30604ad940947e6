"""The audit trail over REST."""

import asyncio
from collections.abc import AsyncIterator
from dataclasses import dataclass

from arcor2_hw.data.audit import AuditCheck, AuditEntry, AuditQuery
from arcor2_hw.data.role import Role
from arcor2_server.audit.trail import AuditTrail
from arcor2_server.rest.general import SERVER
from arcor2_server.rest.operations import Binary, operation


@dataclass(frozen=True, slots=True)
class AuditOperations:
    """The audit trail over REST."""

    _audit: AuditTrail

    @operation("GET", "/api/audit", SERVER, Role.TECHNICIAN, plain=True)
    async def audit_entries(self, query: AuditQuery) -> list[AuditEntry]:
        """Return the selected entries of the audit trail, newest first."""
        return await self._audit.find(query)

    @operation("GET", "/api/audit/check", SERVER, Role.TECHNICIAN, plain=True)
    async def check_audit(self) -> AuditCheck:
        """Check whether entries of the audit trail were edited or removed."""
        return await self._audit.check()

    @operation("GET", "/api/audit/export", SERVER, Role.TECHNICIAN, media_type="text/csv")
    async def export_audit(self) -> Binary:
        """Return all entries of the audit trail as CSV, oldest first."""
        from arcor2_server.audit.export import csv_chunks  # imports csv, which the start does not need

        chunks = csv_chunks(self._audit.all())

        async def content() -> AsyncIterator[bytes]:
            while (chunk := await asyncio.to_thread(next, chunks, None)) is not None:
                yield chunk

        return Binary(content(), "text/csv", "audit.csv")
