"""Requests of OPC UA clients: log on, commands of PackML, acknowledgement of alarms."""

from typing import Final

from arcor2_hw.data.audit import AuditOutcome
from arcor2_hw.data.packml import MachineCommand
from arcor2_hw.data.role import Role
from arcor2_hw.exceptions import Arcor2Error
from arcor2_hw.opcua import messages as m
from arcor2_server.access.admission import Access, right
from arcor2_server.alarms.service import Alarms
from arcor2_server.audit.trail import AuditTrail
from arcor2_server.collaboration.persons import Persons
from arcor2_server.packml.plc import Plc
from arcor2_server.packml.states import COMMANDS

LONGEST_REQUEST_ID: Final = 100
LONGEST_NOTE: Final = 500


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

    @property
    def open_to_all(self) -> bool:
        """Whether clients of this machine need no user."""
        return self._access.open_to_all

    async def log_on(self, request: m.LogOn) -> m.LogOnAnswer:
        """Check a person with a PIN, or a token as the password of any other name."""
        outcome, reason, role = AuditOutcome.DONE, "", None
        try:
            role = await self._role(request)
        except Arcor2Error as error:
            outcome, reason = AuditOutcome.REFUSED, str(error)
        name = request.name
        self._audit.note(outcome, "OpcUaLogOn", user=name, role=role, address=request.address, reason=reason)
        return m.LogOnAnswer(request.number, None if role is None else m.User(name, role))

    async def _role(self, request: m.LogOn) -> Role:
        for person in await self._persons.all():
            if person.name.casefold() == request.name.casefold():
                await self._persons.check_pin(person.id, request.secret, f"OPC UA {request.address}")
                return person.role
        admission = self._access.by_token(request.secret, request.address)
        assert admission.role is not None
        shared = admission.token is not None and admission.token.shared
        return right(admission.role, shared=shared, person=None)

    async def command(self, request: m.Command) -> m.CallAnswer:
        """Execute a command. A request with an identifier is executed once."""
        user, address = request.user, request.address
        by = f"{user.name} (OPC UA)"
        result, text = await self._plc.execute_once(
            request.command, request.job, by, request.request[:LONGEST_REQUEST_ID]
        )
        known = request.command in COMMANDS
        name = MachineCommand(request.command).name.capitalize() if known else str(request.command)
        self._audit.note(
            AuditOutcome.REFUSED if result else AuditOutcome.DONE,
            f"OPC UA {name}",
            target=f"job {request.job}" if request.command == MachineCommand.START else "",
            user=user.name,
            role=Role(user.role),
            address=address,
            reason="" if text is None else text.text,
        )
        return m.CallAnswer(request.number, int(result), "" if text is None else text.text)

    async def acknowledge(self, request: m.Acknowledge) -> m.CallAnswer:
        """Acknowledge an alarm with the role of the user."""
        user, text = request.user, ""
        try:
            await self._alarms.acknowledge(request.alarm, user.name, Role(user.role), request.note[:LONGEST_NOTE])
        except Arcor2Error as error:
            text = str(error)
        self._audit.note(
            AuditOutcome.REFUSED if text else AuditOutcome.DONE,
            "AcknowledgeAlarm",
            target=str(request.alarm),
            user=user.name,
            role=Role(user.role),
            address=request.address,
            reason=text,
        )
        return m.CallAnswer(request.number, 1 if text else 0, text)
