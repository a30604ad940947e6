"""Requests about persons who log on at shared devices (docs/protocol/persons.md)."""

from dataclasses import dataclass

from arcor2_hw.data.base import UNSET, Unset
from arcor2_hw.data.events import ChangeType
from arcor2_hw.data.persons import Person
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc import (
    AddPersonArgs,
    ChangeOwnPinArgs,
    ChangePersonArgs,
    CreateAdministratorArgs,
    ListPersonsData,
    LogOnArgs,
    LogOnData,
    RemovePersonArgs,
)
from arcor2_server.access.admission import Access
from arcor2_server.collaboration.log_ons import LogOns
from arcor2_server.collaboration.persons import Persons, shown
from arcor2_server.errors import RequestRefused
from arcor2_server.rpc.registry import Context, rpc
from arcor2_server.websocket.client import Client


@dataclass(frozen=True, slots=True)
class PersonRequests:
    """Requests about persons who log on at shared devices (docs/protocol/persons.md)."""

    _access: Access
    _persons: Persons
    _log_ons: LogOns

    # ------------------------------------------------------------------------------------------------ log on and off
    @rpc("LogOn")
    async def log_on(self, context: Context, args: LogOnArgs) -> LogOnData:
        """Log a person on at this device."""
        client = context.client
        given = (args.session, args.card, args.pin)
        if sum(not isinstance(each, Unset) for each in given) != 1 or isinstance(args.pin, Unset) is not isinstance(
            args.person, Unset
        ):
            raise RequestRefused("Give either a person and a PIN, or a card, or a session.")
        if not isinstance(args.session, Unset):
            data, events = await self._log_ons.resume(client, args.session)
        else:
            if not isinstance(args.card, Unset):
                person = await self._persons.check_card(args.card, client.device)
            else:
                assert not isinstance(args.person, Unset)
                assert not isinstance(args.pin, Unset)
                person = await self._persons.check_pin(args.person, args.pin, client.device)
            data, events = await self._log_ons.log_on(client, person)
        context.events_to_caller += events
        return data

    @rpc("LogOff")
    async def log_off(self, context: Context, args: None) -> None:
        """Log the person off at this device. A running program continues."""
        self._log_ons.log_off(context.client)

    @rpc("KeepLoggedOn")
    async def keep_logged_on(self, context: Context, args: None) -> None:
        """Report that the person uses the device."""
        self._log_ons.touch(context.client)

    # ------------------------------------------------------------------------------------------------ persons
    @rpc("ListPersons")
    async def list_persons(self, context: Context, args: None) -> ListPersonsData:
        """Return all persons. Administrators also receive the lock-outs."""
        client = context.client
        persons = await self._persons.all()
        names = self._access.device_names() if client.role >= Role.PROGRAMMER else None
        found = [shown(each, None if names is None else await self._persons.lock_outs(each, names)) for each in persons]
        logged_on = UNSET if client.person is None else client.person.id
        return ListPersonsData(found, client.shared, await self._may_create_administrator(client), logged_on)

    async def _may_create_administrator(self, client: Client) -> bool:
        may = client.logged_off and client.ceiling >= Role.PROGRAMMER
        return may and not await self._persons.has_administrator()

    @rpc("CreateAdministrator")
    async def create_administrator(self, context: Context, args: CreateAdministratorArgs) -> Person:
        """Add the first person with the role programmer, at a shared device where nobody can log on yet."""
        if not await self._may_create_administrator(context.client):
            raise RequestRefused(
                "The first administrator is added at a shared device whose token has the role programmer. Later ones "
                "are added by an administrator, or on the server with `arcor2-hw person add`."
            )
        return self._added(context, shown(await self._persons.add(args.name, Role.PROGRAMMER, args.pin)))

    @rpc("AddPerson")
    async def add_person(self, context: Context, args: AddPersonArgs) -> Person:
        """Add a person."""
        return self._added(
            context, shown(await self._persons.add(args.name, Role[args.role.upper()], args.pin, args.card))
        )

    def _added(self, context: Context, person: Person) -> Person:
        context.emit("PersonChanged", person, ChangeType.ADD)
        return person

    @rpc("ChangePerson")
    async def change_person(self, context: Context, args: ChangePersonArgs) -> Person:
        """Change a person, or end the lock-outs of a person."""
        person = shown(await self._persons.change(args))
        context.emit("PersonChanged", person, ChangeType.UPDATE)
        await self._log_ons.refresh(args.id)
        return person

    @rpc("ChangeOwnPin")
    async def change_own_pin(self, context: Context, args: ChangeOwnPinArgs) -> None:
        """Change the PIN of the person who is logged on at this connection."""
        client = context.client
        if client.person is None:
            raise RequestRefused("Nobody is logged on here. Log on first.")
        person = await self._persons.change_own_pin(client.person.id, args.pin, args.new_pin, client.device)
        self._log_ons.pin_changed(person)
        context.emit("PersonChanged", shown(person), ChangeType.UPDATE)

    @rpc("RemovePerson")
    async def remove_person(self, context: Context, args: RemovePersonArgs) -> None:
        """Remove a person, and log them off."""
        person = shown(await self._persons.remove(args.id))
        context.emit("PersonChanged", person, ChangeType.REMOVE)
        await self._log_ons.refresh(args.id)
