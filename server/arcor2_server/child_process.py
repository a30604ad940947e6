"""Starts Python child processes of the server, connected by a socket, and reads their output line by line."""

import asyncio
import contextlib
import fcntl
import functools
import os
import shutil
import signal
import socket
import sys
import tempfile
from collections.abc import AsyncIterator, Mapping, Sequence
from pathlib import Path
from typing import Final

from arcor2_hw.messages import Message

MAX_LINE: Final = 64 * 1024
"""Maximum length of a line of output, bytes; the rest of a longer line is dropped."""
_CHUNK: Final = 65536
_PREFIX: Final = "arcor2-hw-child-"


class LockedFolder:
    """A temporary directory, locked by this process and by those that inherit `lock`, until all of them have ended.

    If they are killed, `remove_leftovers` removes the directory as soon as nobody has locked it.

    Args:
        directory: parent directory of the new one.
        prefix: prefix of its name.

    Raises:
        OSError: it cannot be created.
    """

    def __init__(self, directory: Path, prefix: str) -> None:
        while True:
            self.path = Path(tempfile.mkdtemp(prefix=prefix, dir=directory))
            try:
                self.lock = os.open(self.path, os.O_RDONLY)
            except FileNotFoundError:
                continue  # another process has removed it already
            fcntl.flock(self.lock, fcntl.LOCK_EX)
            if self.path.exists():
                return
            os.close(self.lock)

    def remove(self) -> None:
        """Remove it."""
        shutil.rmtree(self.path, ignore_errors=True)
        if self.lock >= 0:
            os.close(self.lock)
            self.lock = -1


def remove_leftovers(directory: Path, prefix: str) -> None:
    """Remove the locked folders of processes that were killed. Arguments as of LockedFolder."""
    for path in directory.glob(f"{prefix}*"):
        with contextlib.suppress(OSError):  # the folder is in use, or belongs to another user
            lock = os.open(path, os.O_RDONLY)
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(path, ignore_errors=True)
            finally:
                os.close(lock)


@functools.cache
def _remove_leftovers_once() -> None:
    remove_leftovers(Path(tempfile.gettempdir()), _PREFIX)


async def _start_python(
    command: Sequence[str], inherited: Sequence[int], environment: Mapping[str, str]
) -> asyncio.subprocess.Process:
    return await asyncio.create_subprocess_exec(
        *(sys.executable, *command),
        pass_fds=inherited,
        stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.STDOUT,
        env=environment,
        start_new_session=True,  # Ctrl-C reaches only the server, which stops its processes in order
    )


class ChildProcess:
    """A running process.

    Args:
        process: the process; its standard output and error are one pipe.
        folder: the directory for its temporary files. It is removed after the end of the process, even a killed one.
    """

    def __init__(self, process: asyncio.subprocess.Process, folder: LockedFolder) -> None:
        self._process, self._folder = process, folder

    @classmethod
    async def start(
        cls,
        command: Sequence[str],
        connection: socket.socket,
        environment: Mapping[str, str] = os.environ,
        *,
        inherited: Sequence[int] = (),
    ) -> "ChildProcess":
        """Start `python COMMAND --fd N`, where N is the file descriptor of the process's end of a socket.

        Args:
            command: the arguments of Python, such as `-m` and a module.
            connection: the end of the socket for the process. It is closed in this process.
            environment: the environment of the process.
            inherited: other file descriptors for the process.

        Raises:
            OSError: the process cannot be started.
        """
        try:
            await asyncio.to_thread(_remove_leftovers_once)
            folder = LockedFolder(Path(tempfile.gettempdir()), _PREFIX)
            try:
                process = await _start_python(
                    [*command, "--fd", str(connection.fileno())],
                    [connection.fileno(), folder.lock, *inherited],
                    # The processes use their own threads; a thread pool of OpenBLAS would only cost memory.
                    {"OPENBLAS_NUM_THREADS": "1", **environment, "TMPDIR": str(folder.path)},
                )
            except BaseException:
                folder.remove()
                raise
        finally:
            connection.close()
        return cls(process, folder)

    @property
    def pid(self) -> int:
        """The process id."""
        return self._process.pid

    @property
    def returncode(self) -> int | None:
        """The exit status, negative for a signal; None while the process runs."""
        return self._process.returncode

    def kill(self) -> None:
        """Kill the process if it runs."""
        if self._process.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                self._process.kill()

    async def wait(self) -> int:
        """Wait for the end of the process and return its exit status."""
        status = await self._process.wait()
        self._folder.remove()
        return status

    async def wait_or_kill(self, within: float) -> int:
        """Wait for the end of the process, kill it after `within` seconds, and return its exit status.

        The process is killed at once if the caller is cancelled.
        """
        try:
            async with asyncio.timeout(within):
                return await self.wait()
        except TimeoutError:
            self.kill()
            return await self.wait()
        except BaseException:
            self.kill()
            await self.wait()
            raise

    async def output(self, longest: int = MAX_LINE) -> AsyncIterator[str]:
        """Yield the lines that the process prints, each cut at `longest` bytes, until it closes its output."""
        stream = self._process.stdout
        assert stream is not None
        line = bytearray()
        while chunk := await stream.read(_CHUNK):
            *whole, rest = chunk.split(b"\n")
            for part in whole:
                line += part[: longest - len(line)]
                yield line.decode(errors="backslashreplace")
                line.clear()
            line += rest[: longest - len(line)]
        if line:
            yield line.decode(errors="backslashreplace")


def describe_exit(status: int) -> Message:
    """Describe an exit status: "was killed by SIGKILL", "ended with status 3" or "ended"."""
    if status < 0:
        try:
            name: str | Message = signal.Signals(-status).name
        except ValueError:
            name = Message.of("signal {number}", number=-status)
        return Message.of("was killed by {signal}", signal=name)
    return Message.of("ended with status {status}", status=status) if status else Message.of("ended")
