"""Requests of OPC UA clients: log on, commands of PackML, acknowledgement of alarms."""

from typing import Final

from arcor2_hw.data.audit import AuditOutcome
from arcor2_hw.data.packml import MachineCommand, UnitMode
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc import RPCS
from arcor2_hw.exceptions import Arcor2Error
from arcor2_hw.messages import Message
from arcor2_hw.opcua import messages as m
from arcor2_server.access.admission import Access, AccessRefused, right
from arcor2_server.access.tokens import Token
from arcor2_server.alarms.service import Alarms
from arcor2_server.audit.trail import AuditTrail
from arcor2_server.collaboration.persons import Persons
from arcor2_server.packml.plc import Plc
from arcor2_server.packml.record import RequestResult
from arcor2_server.packml.states import COMMANDS

MAX_REQUEST_ID: Final = 100
MAX_NOTE: Final = 500
SET_MODE: Final = RPCS["SetCellMode"].role
"""Minimum role for changing the mode, as on the screens."""


class PlantRequests:
    """Executes requests of clients.

    Args:
        access: checks tokens.
        persons: checks PINs.
        plc: executes commands.
        alarms: the alarms.
        audit: records the requests.
    """

    def __init__(self, access: Access, persons: Persons, plc: Plc, alarms: Alarms, audit: AuditTrail) -> None:
        self._access, self._persons, self._plc, self._alarms, self._audit = access, persons, plc, alarms, audit
        self._tokens: dict[str, Token] = {}
        """The tokens with which clients have logged on, by id."""

    @property
    def open_to_all(self) -> bool:
        """Whether clients of this machine need no user."""
        return self._access.open_to_all

    async def log_on(self, request: m.LogOn) -> m.LogOnAnswer:
        """Log on a person by PIN, or under any other name with a token as the password."""
        outcome, reason, role, user = AuditOutcome.DONE, "", None, None
        try:
            user = m.User(request.name, await self._key(request))
            role = await self._role(user)
        except Arcor2Error as error:
            outcome, reason = AuditOutcome.REFUSED, str(error)
        self._audit.note(outcome, "OpcUaLogOn", user=request.name, role=role, address=request.address, reason=reason)
        return m.LogOnAnswer(request.number, None if role is None else user)

    async def _key(self, request: m.LogOn) -> str:
        """Return the id of the person or token. Raise Arcor2Error if the secret is wrong."""
        for person in await self._persons.all():
            if person.name.casefold() == request.name.casefold():
                await self._persons.check_pin(person.id, request.secret, f"OPC UA {request.address}")
                return person.id
        token = self._access.by_token(request.secret, request.address).token
        assert token is not None
        self._tokens[token.id] = token
        return token.id

    async def _role(self, user: m.User) -> Role:
        """Return the present role of a user. Raise AccessRefused if the token was revoked or the person removed."""
        if (token := self._tokens.get(user.key)) is not None:
            if not self._access.valid(token):
                raise AccessRefused("The token is not valid: it is unknown, revoked or expired.")
            return right(token.role, shared=token.shared, person=None)
        return (await self._persons.get(user.key)).role

    async def command(self, request: m.Command) -> m.CallAnswer:
        """Execute a command. A request with an identifier is executed only once."""
        user, address, role = request.user, request.address, None
        text: Message | None
        try:
            role = await self._role(user)
        except Arcor2Error as error:
            result, text = RequestResult.NO_AUTHORITY, error.message
        else:
            result, text = await self._plc.execute_once(
                request.command, request.job, f"{user.name} (OPC UA)", request.request[:MAX_REQUEST_ID]
            )
        known = request.command in COMMANDS
        name = MachineCommand(request.command).name.capitalize() if known else str(request.command)
        self._audit.note(
            AuditOutcome.REFUSED if result else AuditOutcome.DONE,
            f"OPC UA {name}",
            target=f"job {request.job}" if request.command == MachineCommand.START else "",
            user=user.name,
            role=role,
            address=address,
            reason="" if text is None else text.text,
        )
        return m.CallAnswer(request.number, int(result), "" if text is None else text.text)

    async def set_mode(self, request: m.SetMode) -> m.CallAnswer:
        """Change the mode of the cell, for which a user needs the same role as on the screens."""
        user, role, mode = request.user, None, UnitMode(request.mode)
        text: Message | None
        try:
            role = await self._role(user)
            if role < SET_MODE:
                raise AccessRefused("Changing the mode needs the role {role} or a higher one.", role=SET_MODE.shown)
        except Arcor2Error as error:
            result, text = RequestResult.NO_AUTHORITY, error.message
        else:
            result, text = await self._plc.set_mode(mode, f"{user.name} (OPC UA)")
        self._audit.note(
            AuditOutcome.REFUSED if result else AuditOutcome.DONE,
            "OPC UA SetUnitMode",
            target=mode.name.lower(),
            user=user.name,
            role=role,
            address=request.address,
            reason="" if text is None else text.text,
        )
        return m.CallAnswer(request.number, int(result), "" if text is None else text.text)

    async def acknowledge(self, request: m.Acknowledge) -> m.CallAnswer:
        """Acknowledge an alarm with the role of the user."""
        user, role, text = request.user, None, ""
        try:
            role = await self._role(user)
            await self._alarms.acknowledge(request.alarm, user.name, role, request.note[:MAX_NOTE])
        except Arcor2Error as error:
            text = str(error)
        self._audit.note(
            AuditOutcome.REFUSED if text else AuditOutcome.DONE,
            "AcknowledgeAlarm",
            target=str(request.alarm),
            user=user.name,
            role=role,
            address=request.address,
            reason=text,
        )
        return m.CallAnswer(request.number, 1 if text else 0, text)
