"""`arcor2-hw alarms`: list, acknowledge and shelve the alarms of a running server, and show statistics."""

import getpass
from typing import Annotated

from cyclopts import App, Parameter
from rich.markup import escape
from rich.table import Table

from arcor2_hw.data.alarms import AlarmFilter, AlarmFrequency, AlarmRecord
from arcor2_hw.data.base import UNSET, Unset
from arcor2_hw.messages import Message
from arcor2_server.cli.server_connection import HERE, Server, run
from arcor2_server.cli.tables import console

app = App(name="alarms", help="List, acknowledge and shelve alarms. None of this is a safety function.")

Number = Annotated[int, Parameter(help="Number of the alarm, see `arcor2-hw alarms list`.")]
Note = Annotated[str, Parameter(help="A note that is stored with the alarm, at most 500 characters.")]
User = Annotated[str | None, Parameter(help="Your name, which is stored. The default is that of your account.")]


@app.command(name="list")
def list_alarms(
    *,
    show: Annotated[AlarmFilter, Parameter(help="Which alarms: those that need attention, shelved ones, or all.")] = (
        AlarmFilter.RETAINED
    ),
    limit: Annotated[int, Parameter(help="Maximum number of alarms, newest first.")] = 100,
    run_number: Annotated[int | None, Parameter(name="--run", help="Only alarms of this run.")] = None,
    server: Server = HERE,
) -> int:
    """List alarms, newest first."""

    async def work() -> None:
        async with server.client() as client:
            found = await client.list_alarms(show=show, limit=limit, run=UNSET if run_number is None else run_number)
        _show(found.alarms)

    return run("alarms list", work)


@app.command
def acknowledge(number: Number, /, *, note: Note = "", user: User = None, server: Server = HERE) -> int:
    """Record that a person has recognised an alarm. It neither starts nor stops a machine."""

    async def work() -> None:
        async with server.client() as client:
            await client.register_user(user_name=user or getpass.getuser())
            await client.acknowledge_alarm(number, note=note)

    return run("alarms acknowledge", work)


@app.command
def shelve(
    number: Number,
    /,
    *,
    hours: Annotated[float, Parameter(help="Time after which the alarm returns, h, at most 8; 0: now.")] = 1.0,
    note: Note = "",
    user: User = None,
    server: Server = HERE,
) -> int:
    """Hide an alarm for some time. It then returns by itself. Safety stops cannot be shelved."""

    async def work() -> None:
        async with server.client() as client:
            await client.register_user(user_name=user or getpass.getuser())
            await client.shelve_alarm(number=number, seconds=hours * 3600.0, note=note)

    return run("alarms shelve", work)


@app.command
def statistics(
    *,
    days: Annotated[float, Parameter(help="Number of past days.")] = 7.0,
    limit: Annotated[int, Parameter(help="Maximum number of alarms in each list.")] = 10,
    server: Server = HERE,
) -> int:
    """Show which alarms occurred most often, and which were active longest."""

    async def work() -> None:
        async with server.client() as client:
            found = await client.alarm_statistics(days=days, limit=limit)
        for title, frequencies in (("most frequent", found.by_count), ("longest", found.by_duration)):
            _show_frequencies(title, frequencies)

    return run("alarms statistics", work)


def _show(records: list[AlarmRecord]) -> None:
    table = Table("number", "raised", "priority", "device", "alarm", "state", "count", box=None, pad_edge=False)
    for record in records:
        table.add_row(
            str(record.number),
            record.raised,
            record.priority,
            escape("" if isinstance(record.object_name, Unset) else record.object_name),
            escape(_text(record.text, record.text_message)),
            escape(_state(record)),
            str(record.count),
        )
    console().print(table if records else "There are no alarms.")


def _state(record: AlarmRecord) -> str:
    words = ["active" if record.active else "ended"]
    if record.acknowledged:
        words.append(f"acknowledged by {record.acknowledged_by}")
    if not isinstance(record.shelved_until, Unset):
        words.append(f"shelved until {record.shelved_until}")
    return ", ".join(words)


def _show_frequencies(title: str, frequencies: list[AlarmFrequency]) -> None:
    table = Table("count", "seconds", "device", "alarm", title=title, title_justify="left", box=None, pad_edge=False)
    for each in frequencies:
        device = "" if isinstance(each.object_name, Unset) else each.object_name
        table.add_row(
            str(each.count), f"{each.duration:.0f}", escape(device), escape(_text(each.text, each.text_message))
        )
    console().print(table if frequencies else f"{title}: none")


def _text(text: str, message: Message | Unset) -> str:
    return text if isinstance(message, Unset) else str(message)
