"""`arcor2-hw device check --real`: the terminal of a person who uses a real device for the first time.

The session runs in a separate process, which loads the driver. Ctrl-C reaches only this process, which asks the other
one to stop the device; the end of this process does the same.
"""

import contextlib
import signal
import subprocess
import sys
import termios
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import IO, Final

import msgspec
from rich.console import Console
from rich.table import Table
from rich.text import Text

from arcor2_hw.data.first_day import Answer, Ask, Interrupt, Output, Say, Show
from arcor2_server.cli.exit_status import ExitStatus, fail
from arcor2_server.cli.tables import console

STYLES: Final = {"heading": "bold underline", "text": "", "good": "green", "bad": "bold red", "warning": "yellow"}
STATUSES: Final = {
    0: ExitStatus.OK,
    2: ExitStatus.CELL_UNUSABLE,
    3: ExitStatus.DEVICE_UNREACHABLE,
    130: ExitStatus.INTERRUPTED,
}
"""Exit status by status of the session. Others are FAILED."""


def first_day(file: Path, name: str, plan: bool, report: Path | None) -> int:
    """Lead a person through the first day with a device, or show what would be done."""
    if not plan and not (sys.stdin.isatty() and sys.stdout.isatty()):
        reason = (
            "--real needs a terminal, because a person at the device confirms what moves. Use --plan to see the steps."
        )
        return fail("device check", reason, ExitStatus.USAGE)
    folder = Path(f"first-day-{name}-{datetime.now():%Y%m%d-%H%M%S}") if report is None else report  # noqa: DTZ005
    if not plan:
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            return fail("device check", f"{folder} exists. Name a new folder with --report.", ExitStatus.CONFLICT)
        except OSError as error:
            return fail("device check", f"{folder} cannot be created: {error.strerror}", ExitStatus.FAILED)
    command = [sys.executable, "-P", "-m", "arcor2_hw.testing.first_day", str(file), name, str(folder)]
    process = subprocess.Popen(  # noqa: S603 - our own module
        [*command, *(["--plan"] if plan else [])],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        start_new_session=True,
    )
    assert process.stdin is not None
    assert process.stdout is not None
    with _interrupts():
        _converse(process.stdin, process.stdout)
        status = process.wait()
    with contextlib.suppress(OSError):
        folder.rmdir()  # only if nothing was written
    return STATUSES.get(status, ExitStatus.FAILED)


@contextlib.contextmanager
def _interrupts() -> Iterator[None]:
    """Raise KeyboardInterrupt also when this process is terminated or its terminal is closed."""
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = {number: signal.signal(number, signal.default_int_handler) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _converse(commands: IO[bytes], messages: IO[bytes]) -> None:
    """Show the messages and answer the questions, until the session ends. The first interrupt stops the device."""
    terminal = console()
    decoder = msgspec.json.Decoder(Output)
    try:
        for line in messages:
            message = decoder.decode(line)
            if isinstance(message, Ask):
                commands.write(msgspec.json.encode(Answer(_answer(terminal, message))) + b"\n")
                commands.flush()
            else:
                _show(terminal, message)
    except (KeyboardInterrupt, EOFError, OSError):
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, signal.SIG_IGN)
        with contextlib.suppress(OSError):
            commands.write(msgspec.json.encode(Interrupt()) + b"\n")
            commands.flush()
        for line in messages:
            message = decoder.decode(line)
            with contextlib.suppress(OSError):  # the terminal was closed
                if not isinstance(message, Ask):
                    _show(terminal, message)
    finally:
        with contextlib.suppress(OSError):
            commands.close()


def _show(terminal: Console, message: Say | Show) -> None:
    if isinstance(message, Say):
        if message.style == "heading":
            terminal.print()
        terminal.print(Text(message.text, STYLES[message.style]))
        return
    table = Table(*message.columns, box=None, pad_edge=False)
    for row in message.rows:
        table.add_row(*map(Text, row))
    terminal.print(table)


def _answer(terminal: Console, question: Ask) -> str:
    """Return the answer typed after the question. Earlier keys are ignored."""
    terminal.print()
    with contextlib.suppress(termios.error):
        termios.tcflush(sys.stdin, termios.TCIFLUSH)
    hint = {"yes_no": " [y/N] ", "done": " ", "text": " "}[question.answer]
    typed = terminal.input(Text(question.question + hint, "bold")).strip()
    while question.answer == "text" and not typed:
        typed = terminal.input(Text(question.question + hint, "bold")).strip()
    if question.answer == "yes_no":
        return "yes" if typed.lower() in ("y", "yes") else "no"
    return typed
