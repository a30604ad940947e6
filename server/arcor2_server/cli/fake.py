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
from rich.markup import escape
from rich.table import Table

from arcor2_hw.exceptions import ConnectionLost, NotFound, Refused
from arcor2_server.cli.exit_status import ExitStatus, fail
from arcor2_server.cli.installed_fakes import InstalledFake, installed_fakes
from arcor2_server.cli.tables import console
from arcor2_server.demo.control import ask
from arcor2_server.settings import default_data_dir

app = App(name="fake", help="List and run simulated devices, and inject faults.")

END_TIMEOUT: Final = 5.0
"""Time limit for a fake to end before it is killed, s."""
COMMAND_TIMEOUT: Final = 30.0
"""Time limit for a command, s; switching some devices off and on takes that long."""


@app.command(name="list")
def list_fakes() -> int:
    """List the simulated devices that are installed on this machine. None of them is loaded."""
    found = installed_fakes()
    if not found:
        sys.stdout.write("No fakes are installed.\n")
        return ExitStatus.OK
    table = Table("name", "wire", "module", "description", box=None, pad_edge=False)
    for fake in found:
        table.add_row(fake.name, fake.wire, fake.module, f"[red]{fake.problem}" if fake.problem else fake.description)
    console().print(table)
    return ExitStatus.FAILED if any(fake.problem for fake in found) else ExitStatus.OK


@app.command
def run(
    name: Annotated[str, Parameter(help="Name of the fake, as `fake list` shows it.")],
    *arguments: Annotated[
        str, Parameter(allow_leading_hyphen=True, help="Options of the fake after --; list them with -- --help.")
    ],
) -> int:
    """Run a simulated device until Ctrl-C, and print the addresses of its interfaces and its control channel."""
    found = {fake.name: fake for fake in installed_fakes()}
    if name not in found:
        reason = f"fake {name} does not exist; installed: {', '.join(found) or 'none'}"
        return fail("fake run", reason, ExitStatus.NOT_FOUND)
    if found[name].problem:
        return fail("fake run", found[name].problem, ExitStatus.FAILED)
    return _run(found[name], arguments)


def _run(fake: InstalledFake, arguments: tuple[str, ...]) -> int:
    # In a new session: Ctrl-C reaches only this process, which stops the fake.
    process = subprocess.Popen(  # noqa: S603 - the module is one that an installed distribution names
        [sys.executable, "-m", fake.module, *arguments], stdout=subprocess.PIPE, text=True, start_new_session=True
    )
    terminated = threading.Event()

    def end(*_: object) -> None:
        terminated.set()
        process.terminate()

    before = {number: signal.signal(number, end) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        assert process.stdout is not None
        for line in process.stdout:
            sys.stdout.write(_addresses(fake.name, line) if line.startswith("ready ") else line)
            sys.stdout.flush()
        status = process.wait()
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if process.poll() is None:
            process.terminate()
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(END_TIMEOUT)
            process.kill()
            process.wait()
    if status == 0 or terminated.is_set():
        return ExitStatus.OK
    # The fake has explained the failure on standard error.
    return ExitStatus.USAGE if status == ExitStatus.USAGE else ExitStatus.FAILED


def _addresses(name: str, line: str) -> str:
    """Return the content of a ready line with each address on its own line."""
    ready: dict[str, Any] = msgspec.json.decode(line.removeprefix("ready "))
    addresses = "".join(f"  {key} {value}\n" for key, value in ready.items() if key != "name" and value is not None)
    return f"{name} is ready; press Ctrl-C to stop it\n{addresses}"


@app.command
def fault(
    target: Annotated[str, Parameter(help="HOST:PORT of a control channel, or a device of the running demo.")],
    kind: Annotated[str, Parameter(help="The command. Without it, all commands of the fake are listed.")] = "",
    *values: Annotated[str, Parameter(help="Arguments of the command as key=value, with JSON or plain text values.")],
    wire: Annotated[str | None, Parameter(help="Only this interface of the fake.")] = None,
    seconds: Annotated[float | None, Parameter(help="Duration of the fault, s.")] = None,
    data_dir: Annotated[Path | None, Parameter(help="Data directory of the demo.")] = None,
) -> int:
    """Inject a fault into a running simulated device, or end it with `heal`, and print the answer.

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
        answer = asyncio.run(ask(address, kind, within=COMMAND_TIMEOUT, **arguments))
    except NotFound as error:
        return fail("fake fault", error, ExitStatus.NOT_FOUND)
    except ValueError as error:
        return fail("fake fault", error, ExitStatus.USAGE)
    except ConnectionLost as error:
        return fail("fake fault", error, ExitStatus.NO_SERVER)
    except Refused as error:
        return fail("fake fault", error, ExitStatus.FAILED)
    if answer is None:
        sys.stdout.write(f"{target}: {kind} done\n")
    else:
        sys.stdout.write(f"{json.dumps(answer, indent=2, ensure_ascii=False)}\n")
    return ExitStatus.OK


def _address(target: str, directory: Path) -> str:
    """Return the address of a control channel. Raise NotFound if there is no such fake."""
    host, separator, port = target.rpartition(":")
    if separator and host and port.isdigit():
        return target
    file = directory / "demo.json"
    try:
        running = msgspec.json.decode(file.read_bytes(), type=dict[str, Any])
    except OSError:
        raise NotFound(
            "{target} is not HOST:PORT, and no demo is running in {directory} (see --data-dir)",
            target=target,
            directory=directory,
        ) from None
    except msgspec.DecodeError as error:
        raise NotFound("{file} cannot be read: {reason}", file=file, reason=error) from None
    fakes = {name: entry for name, entry in running.items() if isinstance(entry, dict) and "control" in entry}
    if target not in fakes:
        raise NotFound("the demo has no {target}; it has {fakes}", target=target, fakes=", ".join(fakes))
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
    table = Table("command", "arguments", "description", title=f"Commands of {target}", box=None, pad_edge=False)
    table.title_justify = "left"
    for command in commands:
        table.add_row(command["name"], escape(" ".join(command["takes"])), command["text"])
    console().print(table)
