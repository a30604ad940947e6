"""The bundle for diagnosis over REST."""

import asyncio

import msgspec

from arcor2_hw.data.role import Role
from arcor2_hw.exceptions import InvalidData
from arcor2_server.rest.diagnosis_bundle import LARGEST_NOTES, ClientNotes, packed, parts
from arcor2_server.rest.general import SERVER
from arcor2_server.rest.operations import Binary, operation
from arcor2_server.services import Services

ZIP = "application/zip"
FILE = "diagnosis.zip"


@operation("GET", "/api/diagnosis", SERVER, Role.TECHNICIAN, media_type=ZIP)
async def diagnosis(services: Services) -> Binary:
    """Give a zip for whoever has to find out what is wrong: documents, types, devices, log; without secrets."""
    return Binary(await asyncio.to_thread(packed, parts(services), None, stored(services)), ZIP, FILE)


def stored(services: Services) -> frozenset[str]:
    """Return the secrets of settings."""
    return services.secrets.store.values


@operation("POST", "/api/diagnosis", SERVER, Role.TECHNICIAN, media_type=ZIP, plain=True)
async def diagnosis_with_notes(services: Services, body: ClientNotes) -> Binary:
    """Give the same with what a client says of itself in it, at most 256 KiB of JSON."""
    if len(msgspec.json.encode(body.client)) > LARGEST_NOTES:
        raise InvalidData(f"A client may add {LARGEST_NOTES} bytes of JSON, not more.")
    return Binary(await asyncio.to_thread(packed, parts(services), body.client, stored(services)), ZIP, FILE)
