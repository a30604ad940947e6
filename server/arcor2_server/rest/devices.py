"""`GET /api/devices`: what the devices of the scene or program in operation say of themselves."""

from typing import Any

from litestar import Request, Response, get

from arcor2_hw.data.role import Role
from arcor2_server.rest.answers import ROLE, answer, services_of


@get("/api/devices", opt={ROLE: Role.OPERATOR}, status_code=200)
async def devices(request: Request[Any, Any, Any]) -> Response[bytes]:
    """Give connection, health, alarms and owner of control of each device; empty when nothing is in operation."""
    services = services_of(request)
    return answer(services.execution.devices() or services.cell.devices())
