"""Pictures of alarms over REST (docs/protocol/alarms.md)."""

import asyncio
from dataclasses import dataclass

from arcor2_hw.data.role import Role
from arcor2_hw.exceptions import NotFound
from arcor2_server.alarms.service import Alarms
from arcor2_server.rest.general import SERVER
from arcor2_server.rest.operations import Binary, operation


@dataclass(frozen=True, slots=True)
class AlarmOperations:
    """Pictures of alarms over REST."""

    _alarms: Alarms

    @operation("GET", "/api/alarms/{number}/picture", SERVER, Role.OPERATOR, media_type="image/svg+xml")
    async def alarm_picture(self, number: str) -> Binary:
        """Return the picture that explains the remedy of an alarm (SVG)."""
        if not (number.isascii() and number.isdecimal() and len(number) < 10):
            raise NotFound("Alarm {number} does not exist.", number=number[:20])
        file = self._alarms.picture(int(number))
        return Binary(await asyncio.to_thread(file.read_bytes), "image/svg+xml", file.name)
