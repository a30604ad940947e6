"""Routes of no service: readiness, devices."""

import asyncio

from arcor2_hw.data.role import Role
from arcor2_server.access.addresses import Joining, joining
from arcor2_server.hosts.devices import DeviceStatus
from arcor2_server.rest.operations import operation
from arcor2_server.services import Services

SERVER = "ARCOR2-HW"


@operation("GET", "/healthz/ready", SERVER, Role.OPERATOR, open=True, media_type="text/plain")
async def ready() -> str:
    """Answer 200 as soon as requests are served."""
    return ""


@operation("GET", "/api/joining", SERVER, Role.OPERATOR, plain=True)
async def how_to_join(services: Services, port: int) -> Joining:
    """Give the addresses at which others reach this server, and the fingerprint of its certificate."""
    # Names are looked up, which may take its time.
    return await asyncio.to_thread(joining, services.settings, port)


@operation("GET", "/api/devices", SERVER, Role.OPERATOR, plain=True)
async def devices(services: Services) -> list[DeviceStatus]:
    """Give connection, health, alarms and owner of control of each device; empty when nothing is in operation."""
    return services.execution.board.statuses() or services.cell.board.statuses()
