"""Requests about persons who log on at shared devices (docs/protocol/persons.md)."""

from typing import Annotated, Final

from msgspec import Meta

from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.data.persons import Person
from arcor2_hw.data.role import Role, RoleName
from arcor2_hw.data.rpc.envelope import Rpc

PersonName = Annotated[str, Meta(min_length=1, max_length=60)]
Secret = Annotated[str, Meta(max_length=128)]
"""A PIN, the number of a card, or a session. It must not be logged."""


class LogOnArgs(Data, frozen=True):
    """Arguments of LogOn: `person` (an id) and `pin`, or `card`, or `session` of an earlier answer."""

    person: str | Unset = UNSET
    pin: Secret | Unset = UNSET
    card: Secret | Unset = UNSET
    session: Secret | Unset = UNSET

    def __repr__(self) -> str:
        """Return the arguments without secrets."""
        return f"LogOnArgs(person={self.person!r})"


class LogOnData(Data, frozen=True):
    """Answer to LogOn.

    Args:
        person: the person who is logged on.
        role: the role of this connection, the lower one of the person and of the token.
        session: a secret by which this device logs the person on again after a lost connection, and for REST.
        log_off_after: time without activity after which the person is logged off, s; 0: never.
    """

    person: Person
    role: RoleName
    session: str
    log_off_after: float


class ListPersonsData(Data, frozen=True):
    """Answer to ListPersons.

    Args:
        persons: all persons, by name.
        shared: whether this connection needs a person who logs on.
        needs_administrator: whether this connection may send CreateAdministrator.
        logged_on: id of the person who is logged on at this connection.
    """

    persons: list[Person]
    shared: bool
    needs_administrator: bool
    logged_on: str | Unset = UNSET


class CreateAdministratorArgs(Data, frozen=True):
    """Arguments of CreateAdministrator: name and PIN of the first person."""

    name: PersonName
    pin: Secret

    def __repr__(self) -> str:
        """Return the arguments without secrets."""
        return f"CreateAdministratorArgs(name={self.name!r})"


class AddPersonArgs(Data, frozen=True):
    """Arguments of AddPerson: name, role, and PIN, card or both."""

    name: PersonName
    role: RoleName
    pin: Secret = ""
    card: Secret = ""

    def __repr__(self) -> str:
        """Return the arguments without secrets."""
        return f"AddPersonArgs(name={self.name!r}, role={self.role!r})"


class ChangePersonArgs(Data, frozen=True):
    """Arguments of ChangePerson: the changes. An empty `pin` or `card` is removed; `unlock` ends all lock-outs."""

    id: str
    name: PersonName | Unset = UNSET
    role: RoleName | Unset = UNSET
    pin: Secret | Unset = UNSET
    card: Secret | Unset = UNSET
    unlock: bool = False

    def __repr__(self) -> str:
        """Return the arguments without secrets."""
        return f"ChangePersonArgs(id={self.id!r}, name={self.name!r}, role={self.role!r}, unlock={self.unlock!r})"


class ChangeOwnPinArgs(Data, frozen=True):
    """Arguments of ChangeOwnPin: the present PIN of the person who is logged on, and the new one."""

    pin: Secret
    new_pin: Secret

    def __repr__(self) -> str:
        """Return the arguments without secrets."""
        return "ChangeOwnPinArgs()"


class RemovePersonArgs(Data, frozen=True):
    """Arguments of RemovePerson."""

    id: str


PERSON_RPCS: Final = (
    Rpc("AddPerson", AddPersonArgs, Person, Role.PROGRAMMER, additional=True),
    Rpc("ChangeOwnPin", ChangeOwnPinArgs, None, Role.OPERATOR, additional=True),
    Rpc("ChangePerson", ChangePersonArgs, Person, Role.PROGRAMMER, additional=True),
    Rpc("CreateAdministrator", CreateAdministratorArgs, Person, Role.OPERATOR, additional=True),
    Rpc("KeepLoggedOn", None, None, Role.OPERATOR, additional=True),
    Rpc("ListPersons", None, ListPersonsData, Role.OPERATOR, additional=True),
    Rpc("LogOff", None, None, Role.OPERATOR, additional=True),
    Rpc("LogOn", LogOnArgs, LogOnData, Role.OPERATOR, additional=True),
    Rpc("RemovePerson", RemovePersonArgs, None, Role.PROGRAMMER, additional=True),
)
"""Requests about persons."""
WITHOUT_PERSON: Final = frozenset(
    {"CancelAction", "CreateAdministrator", "LogOn", "StopAll", "StopPackage", "StopRobot"}
)
"""Commands that a shared device may send while nobody is logged on."""
