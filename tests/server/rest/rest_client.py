"""Shared helpers of the REST tests."""

import contextlib
from collections.abc import AsyncIterator
from typing import Any

import httpx

from arcor2_hw.collision.description import StoredFile
from arcor2_hw.compute.calibration_tasks import FrameByPoints
from arcor2_hw.compute.kinematics_tasks import ReadMesh
from arcor2_hw.exceptions import InvalidData
from arcor2_server.app import Server, create_app

TRANSLATION = {"key", "values"}
"""Fields for the translation of an error. The protocol does not contain them, and clients ignore them."""


@contextlib.asynccontextmanager
async def rest_client(services: Server) -> AsyncIterator[httpx.AsyncClient]:
    """Return a client that sends requests to the server's parts over REST, without a network."""
    transport = httpx.ASGITransport(create_app(services))  # type: ignore[arg-type]
    async with httpx.AsyncClient(timeout=60, transport=transport, base_url="http://127.0.0.1:6789") as client:
        yield client


async def start_workers(services: Server) -> None:
    """Start the compute workers now, so that no test pays for their start."""
    with contextlib.suppress(InvalidData):
        await services.compute.run(FrameByPoints([], []))
    with contextlib.suppress(InvalidData):
        await services.compute.run(ReadMesh(StoredFile("/nonexistent", "none.stl")))


def granted(answer: httpx.Response) -> Any:
    """Return the JSON of a successful answer."""
    assert answer.status_code == 200, answer.text
    assert answer.headers["content-type"] == "application/json"
    return answer.json()


def refused(answer: httpx.Response, status: int, kind: str, *words: str) -> str:
    """Return the message of a refusal in the protocol's form."""
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/json"
    error = answer.json()
    assert set(error) - TRANSLATION == {"service", "message", "type", "description"}
    assert error["type"] == kind, error
    for word in words:
        assert word in error["message"], error
    return str(error["message"])
