"""The diagnosis bundle over REST."""

import asyncio
from dataclasses import dataclass
from typing import Any

import msgspec

from arcor2_hw.data.role import Role
from arcor2_hw.exceptions import InvalidData
from arcor2_server.rest.build import ZIP
from arcor2_server.rest.diagnosis_bundle import MAX_NOTES, ClientNotes, Diagnosis, packed
from arcor2_server.rest.general import SERVER
from arcor2_server.rest.operations import Binary, operation
from arcor2_server.storage.setting_secrets import SettingSecrets


@dataclass(frozen=True, slots=True)
class DiagnosisOperations:
    """The diagnosis bundle over REST."""

    _secrets: SettingSecrets
    _diagnosis: Diagnosis

    @operation("GET", "/api/diagnosis", SERVER, Role.TECHNICIAN, media_type=ZIP)
    async def diagnosis(self) -> Binary:
        """Return the diagnosis bundle: a zip with documents, types, device states and log, without secrets."""
        return await self._bundle(None)

    @operation("POST", "/api/diagnosis", SERVER, Role.TECHNICIAN, media_type=ZIP, plain=True)
    async def diagnosis_with_notes(self, body: ClientNotes) -> Binary:
        """Return the diagnosis bundle with notes of the client, at most 256 KiB of JSON."""
        if len(msgspec.json.encode(body.client)) > MAX_NOTES:
            raise InvalidData(
                "The notes of a client may have at most {largest_notes} bytes of JSON.", largest_notes=MAX_NOTES
            )
        return await self._bundle(body.client)

    async def _bundle(self, notes: dict[str, Any] | None) -> Binary:
        content = await asyncio.to_thread(packed, self._diagnosis.parts(), notes, self._secrets.store.values)
        return Binary(content, ZIP, "diagnosis.zip")
