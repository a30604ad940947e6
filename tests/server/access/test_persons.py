"""Persons log on at shared devices with a PIN or a card: rights, lock-out, log-off, and data never stored."""

import asyncio
import contextlib
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc import RPCS, WITHOUT_PERSON
from arcor2_hw.exceptions import InvalidData, StorageError
from arcor2_hw.messages import Message
from arcor2_server.access.admission import right
from arcor2_server.access.tokens import TokenFile
from arcor2_server.app import running_server
from arcor2_server.audit import commands
from arcor2_server.collaboration import persons
from arcor2_server.collaboration.pins import CARD_KEY, CardHashes, check_pin, hash_pin, matches
from arcor2_server.settings import ServerSettings
from tests.server.session.session_server import Person, Refused, SessionServer, open_server

PIN = "2580"
OTHER_PIN = "973164825091"
CARD = "0012345678"


class Cell:
    """A server with a shared device for technicians, a token of a program, and two persons."""

    def __init__(self, server: SessionServer, directory: Path) -> None:
        self.server = server
        self.tokens = TokenFile(directory)
        self.tablet = self.tokens.add("tablet", Role.TECHNICIAN, shared=True)[1]
        self.program = self.tokens.add("line control", Role.PROGRAMMER)[1]
        self.ids: dict[str, str] = {}
        self.stopped_by: list[str] = []
        server.services.execution.stop = self.stopped_by.append

    async def add_persons(self) -> None:
        administrator = await self.server.person("line", self.program)
        for name, role, secrets in (
            ("Eva", "programmer", {"pin": PIN}),
            ("Ivo", "operator", {"pin": OTHER_PIN, "card": CARD}),
        ):
            added = await administrator.ask("AddPerson", name=name, role=role, **secrets)
            self.ids[name] = added["id"]
        await administrator.leave()

    async def at_tablet(self, name: str = "", pin: str = "") -> Person:
        """Return a shared device, at which a person is logged on if a name is given."""
        device = await self.server.person("", self.tablet)
        await device.ask("SubscribeEvents", events=["LogOnChanged"])
        if name:
            await device.ask("LogOn", person=self.ids[name], pin=pin)
        device.take()
        return device


@contextlib.asynccontextmanager
async def open_cell(directory: Path, **settings: Any) -> AsyncIterator[Cell]:
    async with open_server(directory, **settings) as server:
        cell = Cell(server, directory)
        await cell.add_persons()
        yield cell


def audit_entries(server: SessionServer) -> list[Any]:
    """Return the entries of the audit trail, which the test server does not write."""
    waiting, entries = server.services.audit._waiting, []
    while not waiting.empty():
        entries.append(waiting.get())
    return entries


# ------------------------------------------------------------------------------------------------ rules
def test_the_right_is_the_lower_of_token_and_person() -> None:
    assert right(Role.TECHNICIAN, shared=True, person=Role.PROGRAMMER) is Role.TECHNICIAN
    assert right(Role.TECHNICIAN, shared=True, person=Role.STANDARD_USER) is Role.STANDARD_USER
    assert right(Role.TECHNICIAN, shared=True, person=None) is Role.OPERATOR
    assert right(Role.PROGRAMMER, shared=False, person=None) is Role.PROGRAMMER
    assert right(Role.PROGRAMMER, shared=False, person=Role.OPERATOR) is Role.OPERATOR


def test_without_a_person_a_shared_device_only_watches_and_stops() -> None:
    allowed = {name for name, rpc in RPCS.items() if not commands.needs_person(rpc) and commands.is_command(rpc)}
    assert allowed == WITHOUT_PERSON
    assert all(RPCS[name].role is Role.OPERATOR for name in WITHOUT_PERSON)
    assert not any(rpc.role > Role.OPERATOR for rpc in RPCS.values() if not commands.needs_person(rpc))


@pytest.mark.parametrize("pin", ["123", "0000", "1234", "98765", "9012", "12a4", "²³⁴⁵", "1357913579135"])
def test_pins_that_are_easy_to_guess_are_refused(pin: str) -> None:
    with pytest.raises(InvalidData, match="PIN"):
        check_pin(pin)


def test_only_the_pin_matches_its_hash() -> None:
    stored = hash_pin(PIN)
    assert stored != hash_pin(PIN)  # another salt
    assert matches(PIN, stored)
    assert not matches(OTHER_PIN, stored)


def test_cards_are_hashed_with_a_key_of_the_server(tmp_path: Path) -> None:
    hashes = CardHashes(tmp_path)
    digest = hashes.of(f" {CARD}\n")
    assert digest == hashes.of(CARD)
    (tmp_path / CARD_KEY).unlink()
    assert hashes.of(CARD) != digest
    (tmp_path / CARD_KEY).write_bytes(b"short")
    with pytest.raises(StorageError, match="damaged"):
        hashes.of(CARD)


# ------------------------------------------------------------------------------------------------ log on
async def test_a_person_logs_on_with_pin_or_card(tmp_path: Path) -> None:
    async with open_cell(tmp_path) as cell:
        device = await cell.at_tablet()
        listed = await device.ask("ListPersons")
        assert [(each["name"], each["pin"], each["card"]) for each in listed["persons"]] == [
            ("Eva", True, False),
            ("Ivo", True, True),
        ]
        assert (listed["shared"], listed["needs_administrator"], "logged_on" in listed) == (True, False, False)
        with pytest.raises(Refused, match="Log on"):
            await device.ask("NewScene", name="hall")
        with pytest.raises(Refused, match="Log on"):
            await device.ask("RegisterUser", user_name="somebody")
        with pytest.raises(Refused, match="Log on"):
            await device.ask("ResumePackage")
        await device.ask("StopPackage")
        assert cell.stopped_by == ["tablet"]

        answer = await device.ask("LogOn", person=cell.ids["Eva"], pin=PIN)
        assert (answer["person"]["name"], answer["role"]) == ("Eva", "technician")  # the ceiling of the tablet
        await device.ask("NewScene", name="hall")
        with pytest.raises(Refused, match="programmer"):
            await device.ask("RemovePerson", id=cell.ids["Ivo"])

        answer = await device.ask("LogOn", card=CARD)  # the next person does not need to log off the previous one
        assert (answer["person"]["name"], answer["role"]) == ("Ivo", "operator")
        with pytest.raises(Refused, match="technician"):
            await device.ask("SaveScene")
        await device.ask("LogOff")
        with pytest.raises(Refused, match="Log on"):
            await device.ask("SaveScene")

        entries = [(each.request, each.user, each.outcome.value) for each in audit_entries(cell.server)]
        assert ("NewScene", "Eva", "done") in entries
        assert ("SaveScene", "Ivo", "forbidden") in entries
        assert [user for request, user, _ in entries if request == "LogOff"] == ["Eva", "Ivo"]


async def test_clients_with_their_own_token_need_no_person(tmp_path: Path) -> None:
    async with open_cell(tmp_path) as cell:
        program = await cell.server.person("line", cell.program)
        await program.ask("NewScene", name="hall")
        with pytest.raises(Refused, match="PIN"):
            await program.ask("RegisterUser", user_name="eva")


async def test_a_person_is_logged_on_at_one_device(tmp_path: Path) -> None:
    async with open_cell(tmp_path) as cell:
        first, second = await cell.at_tablet("Eva", PIN), await cell.at_tablet()
        await first.ask("NewScene", name="hall")
        await second.ask("LogOn", person=cell.ids["Eva"], pin=PIN)
        (event,) = [each["data"] for each in first.events() if each["event"] == "LogOnChanged"]
        assert event["reason"] == "Eva logged on at another device."
        assert "person" not in event
        with pytest.raises(Refused, match="Log on"):
            await first.ask("SaveScene")
        await second.ask("SaveScene")


async def test_wrong_pins_lock_the_person_out_longer_each_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = 1_800_000_000.0
    monkeypatch.setattr(persons.time, "time", lambda: clock)

    async def wrong(device: Person, person_id: str) -> str:
        with pytest.raises(Refused) as refused:
            await device.ask("LogOn", person=person_id, pin="4444")
        return str(refused.value)

    async with open_cell(tmp_path) as cell:
        eva = cell.ids["Eva"]
        device = await cell.at_tablet()
        assert [await wrong(device, eva) for _ in range(4)] == ["The PIN of Eva is wrong."] * 4
        assert "Try again in 60 s" in await wrong(device, eva)
        with pytest.raises(Refused, match="60 s"):  # the correct PIN is not checked either
            await device.ask("LogOn", person=eva, pin=PIN)
        await device.ask("LogOn", card=CARD)  # other persons can log on
        clock += 61
        assert "Try again in 120 s" in await wrong(device, eva)
        other = await cell.server.person("", cell.tokens.add("other tablet", Role.OPERATOR, shared=True)[1])
        await other.ask("LogOn", person=eva, pin=PIN)  # the lock-out applies to one device only
    async with open_server(tmp_path) as server:  # it survives a restart
        cell.server = server
        device = await cell.at_tablet()
        with pytest.raises(Refused, match="120 s"):
            await device.ask("LogOn", person=eva, pin=PIN)
        administrator = await server.person("line", cell.program)
        listed = (await administrator.ask("ListPersons"))["persons"]
        assert [(each["device"], each["wrong"]) for each in listed[0]["lock_outs"]] == [("tablet", 6)]
        assert (await device.ask("ListPersons"))["persons"][0]["lock_outs"] == []
        await administrator.ask("ChangePerson", id=eva, unlock=True)
        await device.ask("LogOn", person=eva, pin=PIN)


async def test_unknown_cards_lock_the_device_out(tmp_path: Path) -> None:
    async with open_cell(tmp_path) as cell:
        device = await cell.at_tablet()
        messages = []
        for number in range(6):
            with pytest.raises(Refused) as refused:
                await device.ask("LogOn", card=f"99999{number}")
            messages.append(str(refused.value))
        assert messages[0] == "No person has this card. An administrator can add it."
        assert "Too many unknown cards" in messages[5]


# ------------------------------------------------------------------------------------------------ log off
async def test_an_idle_person_is_logged_off(tmp_path: Path) -> None:
    async with open_cell(tmp_path, log_off_after=0.3) as cell:
        ended: asyncio.Queue[Message] = asyncio.Queue()
        cell.server.services.log_ons.on_end.append(lambda _, reason: ended.put_nowait(reason))
        device = await cell.at_tablet("Eva", PIN)
        await device.ask("NewScene", name="hall")
        reason = str(await ended.get())  # ends hold-to-run motions
        assert "without use" in reason
        (event,) = [each["data"] for each in device.events() if each["event"] == "LogOnChanged"]
        assert (event["role"], event["reason"]) == ("operator", reason)
        assert event["key"] == "{name} was logged off after {seconds} s without use."
        with pytest.raises(Refused, match="Log on"):
            await device.ask("SaveScene")
        assert cell.stopped_by == []  # a running program continues
        await device.ask("StopPackage")
        assert cell.stopped_by == ["tablet"]
        assert cell.server.services.users.names() == []


async def test_logging_off_ends_hold_to_run_motions(tmp_path: Path) -> None:
    async with running_server(ServerSettings(data_dir=tmp_path)) as services:
        assert services.online.held.logged_off in services.log_ons.on_end


async def test_a_device_resumes_after_a_lost_connection(tmp_path: Path) -> None:
    async with open_cell(tmp_path) as cell:
        device = await cell.at_tablet()
        session = (await device.ask("LogOn", person=cell.ids["Eva"], pin=PIN))["session"]
        await device.leave()
        stranger = await cell.server.person("", cell.tokens.add("other", Role.PROGRAMMER, shared=True)[1])
        with pytest.raises(Refused, match="logged off"):
            await stranger.ask("LogOn", session=session)
        device = await cell.at_tablet()
        assert (await device.ask("LogOn", session=session))["person"]["name"] == "Eva"
        await device.ask("LogOff")
        with pytest.raises(Refused, match="logged off"):
            await device.ask("LogOn", session=session)


async def test_changes_of_a_person_apply_at_once(tmp_path: Path) -> None:
    async with open_cell(tmp_path) as cell:
        device = await cell.at_tablet("Ivo", OTHER_PIN)
        administrator = await cell.server.person("line", cell.program)
        await administrator.ask("SubscribeEvents", events=["PersonChanged"])
        administrator.take()
        await administrator.ask("ChangePerson", id=cell.ids["Ivo"], role="technician")
        await device.ask("NewScene", name="hall")
        await administrator.ask("RemovePerson", id=cell.ids["Ivo"])
        with pytest.raises(Refused, match="Log on"):
            await device.ask("SaveScene")
        assert [name for name in administrator.names() if name.startswith("Person")] == [
            "PersonChanged/update",
            "PersonChanged/remove",
        ]


async def test_persons_change_their_own_pin(tmp_path: Path) -> None:
    new = "48151623"
    async with open_cell(tmp_path) as cell:
        device = await cell.at_tablet()
        with pytest.raises(Refused, match="Log on"):
            await device.ask("ChangeOwnPin", pin=OTHER_PIN, new_pin=new)
        await device.ask("LogOn", person=cell.ids["Ivo"], pin=OTHER_PIN)
        audit_entries(cell.server)
        for old, wanted, reason in (
            (PIN, new, "The PIN of Ivo is wrong"),
            (OTHER_PIN, "1234", "digits"),
            (OTHER_PIN, OTHER_PIN, "present one"),
        ):
            with pytest.raises(Refused, match=reason):
                await device.ask("ChangeOwnPin", pin=old, new_pin=wanted)
        await device.ask("ChangeOwnPin", pin=OTHER_PIN, new_pin=new)
        entries = [each for each in audit_entries(cell.server) if each.request == "ChangeOwnPin"]
        assert [(each.user, each.outcome) for each in entries] == [("Ivo", "refused")] * 3 + [("Ivo", "done")]
        assert not any(secret in str(entries) for secret in (OTHER_PIN, new))
        await cell.server.services.log_ons.refresh()
        assert (await device.ask("ListPersons"))["logged_on"] == cell.ids["Ivo"]  # remains logged on
        for _ in range(5):
            with pytest.raises(Refused, match="wrong"):
                await device.ask("ChangeOwnPin", pin=OTHER_PIN, new_pin=PIN)
        with pytest.raises(Refused, match="too many wrong PINs"):
            await device.ask("ChangeOwnPin", pin=new, new_pin=PIN)
        await device.ask("LogOff")
        with pytest.raises(Refused, match="too many wrong PINs"):
            await device.ask("LogOn", person=cell.ids["Ivo"], pin=new)


# ------------------------------------------------------------------------------------------------ administrators
async def test_the_first_administrator_is_created_at_a_shared_device(tmp_path: Path) -> None:
    async with open_server(tmp_path) as server:
        tokens = TokenFile(tmp_path)
        first = await server.person("", tokens.add("first device", Role.PROGRAMMER, shared=True)[1])
        other = await server.person("", tokens.add("tablet", Role.TECHNICIAN, shared=True)[1])
        assert (await first.ask("ListPersons"))["needs_administrator"]
        with pytest.raises(Refused, match="programmer"):
            await other.ask("CreateAdministrator", name="Eva", pin=PIN)
        with pytest.raises(Refused, match="digits"):
            await first.ask("CreateAdministrator", name="Eva", pin="12")
        eva = await first.ask("CreateAdministrator", name="Eva", pin=PIN)
        with pytest.raises(Refused, match="administrator"):
            await first.ask("CreateAdministrator", name="Ivo", pin=PIN)
        await first.ask("LogOn", person=eva["id"], pin=PIN)
        with pytest.raises(Refused, match="already"):
            await first.ask("AddPerson", name="EVA", role="operator", pin=PIN)
        await first.ask("AddPerson", name="Ivo", role="operator", pin=PIN)
        for request in ("RemovePerson", "ChangePerson"):
            with pytest.raises(Refused, match="only person"):
                await first.ask(request, id=eva["id"], **({"role": "operator"} if request == "ChangePerson" else {}))


async def test_secrets_are_neither_stored_nor_logged(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("DEBUG")
    async with open_cell(tmp_path) as cell:
        device = await cell.at_tablet("Ivo", OTHER_PIN)
        with pytest.raises(Refused):
            await device.ask("LogOn", card="77777777")
        entries = str(audit_entries(cell.server))
    stored = b"".join(path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()).decode(errors="replace")
    for secret in (OTHER_PIN, CARD, "77777777"):
        assert secret not in stored
        assert secret not in entries
        assert secret not in caplog.text


@pytest.fixture(autouse=True)
def cheap_hashes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Use cheap hashes, because their cost is not tested here."""
    monkeypatch.setattr("arcor2_server.collaboration.pins._N", 2**8)
