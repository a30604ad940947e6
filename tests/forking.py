"""Start fakes and servers by forking a process that has already imported them: imports are most of a start.

The program runs as after `python -m`, with its own arguments, environment, directory, output and signals. Tests of the
command line itself start the real command.
"""

import asyncio
import atexit
import contextlib
import json
import os
import select
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO, Any

from tests import forking_process, leaks

BOUND_TO_THE_INTERPRETER = ("PYTHON", "LD_", "MALLOC_", "OPENBLAS_")
"""Prefixes of environment variables that take effect only when an interpreter starts."""
_ENVIRONMENT = {"OPENBLAS_NUM_THREADS": "1"}
"""Additional environment of the forking process. A thread pool does not survive a fork."""


class Forked:
    """A started program, with the part of `subprocess.Popen` that tests use."""

    def __init__(self, pid: int, status: int, stdout: int) -> None:
        self.pid = pid
        self.returncode: int | None = None
        self.stdout: IO[bytes] = os.fdopen(stdout, "rb")
        self._status = os.fdopen(status, "rb")

    def poll(self) -> int | None:
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.wait(0)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        if self.returncode is None:
            if not select.select([self._status], [], [], timeout)[0]:
                raise subprocess.TimeoutExpired(f"process {self.pid}", timeout or 0)
            self.returncode = int(self._status.read())
            self._status.close()
        return self.returncode

    def send_signal(self, number: int) -> None:
        if self.poll() is None:
            with contextlib.suppress(ProcessLookupError):  # it has ended, and its status has not arrived yet
                os.kill(self.pid, number)

    def terminate(self) -> None:
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)


class Forker:
    """Forks programs from one process, which starts with the first of them and ends with this one.

    Args:
        address: Address of the forking process, if another process has started it.
    """

    def __init__(self, address: str = "") -> None:
        self._connection: socket.socket | None = None
        self._address = address
        self._lock = threading.Lock()

    @property
    def address(self) -> str:
        """The address at which other processes reach the forking process. Start it if it does not run."""
        with self._lock:
            self._connect()
        return self._address

    def start(
        self,
        module: str,
        arguments: Sequence[str],
        imports: Sequence[str],
        stderr: IO[Any] | int,
        environment: Mapping[str, str] | None = None,
        inherited: Sequence[int] = (),
        name: str = "",
        directory: Path | None = None,
        stdin: int | None = None,
    ) -> "Forked | subprocess.Popen[bytes]":
        """Start `python -m MODULE ARGUMENTS` from a process that has imported some modules; standard output is a pipe.

        The real command is started if the environment has variables that only a new interpreter reads.

        Args:
            module: Module to run.
            arguments: Arguments of the program.
            imports: Modules that the program imports.
            stderr: File for errors. With subprocess.STDOUT, errors are written to standard output.
            environment: Environment of the program, by default that of this process.
            inherited: Files for the program. With files, it has a separate session, as children of the server have.
            name: Name in the list of processes. With a name, the program runs as with `python -P`.
            directory: Working directory, by default that of this process.
            stdin: File to read as standard input, by default an empty one.
        """
        own = os.environ if environment is None else environment
        fixed = {key: value for key, value in own.items() if key.startswith(BOUND_TO_THE_INTERPRETER)}
        if any(value not in (os.environ.get(key), _ENVIRONMENT.get(key)) for key, value in fixed.items()):
            command = [sys.executable, "-m", module, *arguments]
            return subprocess.Popen(
                command, stdout=subprocess.PIPE, stderr=stderr, env=own,
                pass_fds=inherited, start_new_session=bool(inherited), cwd=directory, stdin=stdin,
            )  # fmt: skip
        request = {
            "module": module,
            "arguments": list(arguments),
            "imports": list(imports),
            "environment": dict(own),
            "directory": str(directory or Path.cwd()),
            "umask": _umask(),
            "inherited": list(inherited),
            "name": name,
            "stdin": stdin is not None,
        }
        files = [*inherited, *([] if stdin is None else [stdin])]
        out, theirs = os.pipe()
        status, reported = os.pipe()
        errors = theirs if stderr == subprocess.STDOUT else stderr if isinstance(stderr, int) else stderr.fileno()
        try:
            with self._lock:
                connection = self._connect()
                socket.send_fds(connection, [json.dumps(request).encode()], [theirs, errors, reported, *files])
                pid = connection.recv(20)
        finally:
            os.close(theirs)
            os.close(reported)
        assert pid, "the forking process has ended"
        return Forked(int(pid), status, out)

    def _connect(self) -> socket.socket:
        if self._connection is None:
            if self._address:
                self._connection = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
                self._connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, forking_process.MAX_REQUEST_SIZE)
                self._connection.connect(f"\0{self._address}")
            else:
                with leaks.outliving_the_test():
                    self._start()
            assert self._connection is not None
        return self._connection

    def _start(self) -> None:
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        for end in (ours, theirs):
            end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, forking_process.MAX_REQUEST_SIZE)
        with theirs, socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listener:
            listener.bind("")  # the kernel chooses an abstract address
            listener.listen()
            self._address = listener.getsockname()[1:].decode()
            process = subprocess.Popen(
                [sys.executable, "-m", forking_process.__name__, str(theirs.fileno()), str(listener.fileno())],
                pass_fds=[theirs.fileno(), listener.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                env=os.environ | _ENVIRONMENT,
            )
        leaks.forking.add(process.pid)
        atexit.register(lambda: (ours.close(), process.wait()))
        self._connection = ours


def _umask() -> int:
    (line,) = [line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("Umask:")]
    return int(line.split()[1], 8)


class AwaitedProcess:
    """A started program, with the part of `asyncio.subprocess.Process` that tests use."""

    def __init__(self, process: "Forked | subprocess.Popen[bytes]", stdout: asyncio.StreamReader) -> None:
        self.pid = process.pid
        self.stdout = stdout
        self.send_signal, self.kill = process.send_signal, process.kill
        self._process = process

    @property
    def returncode(self) -> int | None:
        return self._process.poll()

    async def wait(self) -> int:
        return await ended(self._process)


async def awaited(process: "Forked | subprocess.Popen[bytes]") -> AwaitedProcess:
    """Return a program whose output and end the running event loop waits for."""
    reader = asyncio.StreamReader()
    await asyncio.get_running_loop().connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), process.stdout)
    return AwaitedProcess(process, reader)


async def ended(process: "Forked | subprocess.Popen[bytes]") -> int:
    """Wait for the end of a process without blocking the event loop; return its exit status."""
    with contextlib.suppress(ProcessLookupError):
        fd = os.pidfd_open(process.pid)
        try:
            await readable(fd)
        finally:
            os.close(fd)
    return process.wait()


async def readable(fd: int) -> None:
    """Wait until a file can be read."""
    loop, arrived = asyncio.get_running_loop(), asyncio.Event()
    loop.add_reader(fd, arrived.set)
    try:
        await arrived.wait()
    finally:
        loop.remove_reader(fd)
