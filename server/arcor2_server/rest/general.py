"""REST operations that belong to no ARCOR2 service: readiness, addresses, devices."""

import asyncio
from dataclasses import dataclass

from arcor2_hw.data.role import Role
from arcor2_server.access.addresses import ServerAddresses, server_addresses
from arcor2_server.execution.service import Execution
from arcor2_server.hosts.devices import DeviceStatus
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.rest.operations import operation
from arcor2_server.settings import ServerSettings

SERVER = "ARCOR2-HW"


@dataclass(frozen=True, slots=True)
class GeneralOperations:
    """REST operations that belong to no ARCOR2 service: readiness, addresses, devices."""

    _settings: ServerSettings
    _online: OnlineScene
    _execution: Execution

    @operation("GET", "/healthz/ready", SERVER, Role.OPERATOR, open=True, media_type="text/plain")
    async def ready(self) -> str:
        """Return 200 as soon as the server serves requests."""
        return ""

    @operation("GET", "/api/joining", SERVER, Role.OPERATOR, plain=True)
    async def how_to_join(self, port: int) -> ServerAddresses:
        """Return the addresses at which other machines reach this server, and the fingerprint of its certificate."""
        # In a thread, since looking up names may take long.
        return await asyncio.to_thread(server_addresses, self._settings, port)

    @operation("GET", "/api/devices", SERVER, Role.OPERATOR, plain=True)
    async def devices(self) -> list[DeviceStatus]:
        """Return connection, health, alarms and control owner of each device of the running program or online scene."""
        return self._execution.board.statuses() or self._online.board.statuses()
