"""`arcor2-hw fake`: list the installed fakes, run one in the foreground, and inject faults while it runs."""

import asyncio
import contextlib
import json
import signal
import subprocess
import sys
import threading
from pathlib import Path
from typing import Annotated, Any, Final

import msgspec
from cyclopts import App, Parameter
from rich.console import Console
from rich.table import Table

from arcor2_hw.exceptions import ConnectionLost, Refused
from arcor2_server.cli.exit_status import ExitStatus
from arcor2_server.cli.installed_fakes import InstalledFake, installed_fakes
from arcor2_server.demo.control import ask
from arcor2_server.settings import default_data_dir

app = App(name="fake", help="Simulated devices: list them, run one, let one fail while it runs.")

PIPE_WIDTH: Final = 240
ENDS_WITHIN: Final = 5.0
FAULT_WITHIN: Final = 30.0
"""Seconds a fake may take for a command: switching some devices off and on takes that long."""


@app.command(name="list")
def list_fakes() -> int:
    """List the fakes that are installed on this machine; none is loaded for it."""
    found = installed_fakes()
    if not found:
        sys.stdout.write("No fakes are installed.\n")
        return ExitStatus.OK
    table = Table("name", "wire", "module", "description", box=None, pad_edge=False)
    for fake in found:
        table.add_row(fake.name, fake.wire, fake.module, f"[red]{fake.problem}" if fake.problem else fake.description)
    _console().print(table)
    return ExitStatus.FAILED if any(fake.problem for fake in found) else ExitStatus.OK


@app.command
def run(
    name: Annotated[str, Parameter(help="Name of the fake, as `fake list` shows it.")],
    *arguments: Annotated[str, Parameter(allow_leading_hyphen=True, help="Its own options, after --; try -- --help.")],
) -> int:
    """Run a fake in the foreground until Ctrl-C, saying where its wire and its control channel are."""
    found = {fake.name: fake for fake in installed_fakes()}
    if name not in found:
        sys.stderr.write(f"arcor2-hw fake run: there is no fake {name}; there are {', '.join(found) or 'none'}\n")
        return ExitStatus.NOT_FOUND
    if found[name].problem:
        sys.stderr.write(f"arcor2-hw fake run: {found[name].problem}\n")
        return ExitStatus.FAILED
    return _run(found[name], arguments)


def _run(fake: InstalledFake, arguments: tuple[str, ...]) -> int:
    # A session of its own: Ctrl-C reaches us alone, and we end it in order.
    process = subprocess.Popen(  # noqa: S603 - the module is one that an installed distribution names
        [sys.executable, "-m", fake.module, *arguments], stdout=subprocess.PIPE, text=True, start_new_session=True
    )
    told = threading.Event()

    def end(*_: object) -> None:
        told.set()
        process.terminate()

    before = {number: signal.signal(number, end) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        assert process.stdout is not None
        for line in process.stdout:
            sys.stdout.write(_places(fake.name, line) if line.startswith("ready ") else line)
            sys.stdout.flush()
        status = process.wait()
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if process.poll() is None:
            process.terminate()
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(ENDS_WITHIN)
            process.kill()
            process.wait()
    if status == 0 or told.is_set():
        return ExitStatus.OK
    # The fake has said on standard error what is wrong.
    return ExitStatus.USAGE if status == ExitStatus.USAGE else ExitStatus.FAILED


def _places(name: str, line: str) -> str:
    """Return the ready line for people: each address on a line of its own."""
    ready: dict[str, Any] = msgspec.json.decode(line.removeprefix("ready "))
    places = "".join(f"  {key} {value}\n" for key, value in ready.items() if key != "name" and value is not None)
    return f"{name} is ready; Ctrl-C ends it\n{places}"


@app.command
def fault(
    target: Annotated[str, Parameter(help="HOST:PORT of a control channel, or a device of the running demo.")],
    kind: Annotated[str, Parameter(help="What it is to do; not given, what it can do is listed.")] = "",
    *values: Annotated[str, Parameter(help="What the command takes, as key=value; values in JSON, or plain text.")],
    wire: Annotated[str | None, Parameter(help="Only this one of its wires.")] = None,
    seconds: Annotated[float | None, Parameter(help="How long, s.")] = None,
    data_dir: Annotated[Path | None, Parameter(help="Data directory of the demo.")] = None,
) -> int:
    """Let a running fake fail, or mend it (`heal`); its answer is printed.

    Examples: `fake fault tester silence`, `fake fault belt emergency code=9024`, `fake fault tester heal`.
    """
    directory = data_dir if data_dir is not None else default_data_dir() / "demo"
    try:
        address = _address(target, directory)
        if not kind:
            _list_commands(target, asyncio.run(ask(address, "describe")))
            return ExitStatus.OK
        arguments = _arguments(values)
        arguments |= {} if wire is None else {"wire": wire}
        arguments |= {} if seconds is None else {"seconds": seconds}
        answer = asyncio.run(ask(address, kind, within=FAULT_WITHIN, **arguments))
    except _Unknown as error:
        return _say(error, ExitStatus.NOT_FOUND)
    except ValueError as error:
        return _say(error, ExitStatus.USAGE)
    except ConnectionLost as error:
        return _say(error, ExitStatus.NO_SERVER)
    except Refused as error:
        return _say(error, ExitStatus.FAILED)
    if answer is None:
        sys.stdout.write(f"{target}: {kind} done\n")
    else:
        sys.stdout.write(f"{json.dumps(answer, indent=2, ensure_ascii=False)}\n")
    return ExitStatus.OK


class _Unknown(Exception):
    """What was named is no fake that runs."""


def _say(error: Exception, status: ExitStatus) -> int:
    sys.stderr.write(f"arcor2-hw fake fault: {error}\n")
    return status


def _address(target: str, directory: Path) -> str:
    host, separator, port = target.rpartition(":")
    if separator and host and port.isdigit():
        return target
    file = directory / "demo.json"
    try:
        running = msgspec.json.decode(file.read_bytes(), type=dict[str, Any])
    except OSError:
        raise _Unknown(f"{target} is no HOST:PORT, and no demo runs in {directory} (see --data-dir)") from None
    except msgspec.DecodeError as error:
        raise _Unknown(f"{file} cannot be read: {error}") from None
    fakes = {name: entry for name, entry in running.items() if isinstance(entry, dict) and "control" in entry}
    if target not in fakes:
        raise _Unknown(f"the demo has no {target}; it has {', '.join(fakes)}")
    return str(fakes[target]["control"])


def _arguments(values: tuple[str, ...]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for value in values:
        key, separator, text = value.partition("=")
        if not separator or not key.isidentifier():
            raise ValueError(f"{value!r} must be key=value")
        try:
            found[key] = msgspec.json.decode(text)
        except msgspec.DecodeError:
            found[key] = text
    return found


def _list_commands(target: str, commands: list[dict[str, Any]]) -> None:
    table = Table("command", "takes", "does", title=f"what {target} can do", box=None, pad_edge=False)
    table.title_justify = "left"
    for command in commands:
        # Square brackets are rich's markup.
        table.add_row(command["name"], " ".join(command["takes"]).replace("[", r"\["), command["text"])
    _console().print(table)


def _console() -> Console:
    # A pipe has no width: without one, rich would fold columns to 80 characters.
    console = Console(highlight=False)
    return console if console.is_terminal else Console(highlight=False, width=PIPE_WIDTH)
