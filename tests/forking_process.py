"""The process from which `tests.forking` forks programs. It imports only what they import."""

import atexit
import contextlib
import fcntl
import gc
import importlib
import io
import json
import os
import runpy
import selectors
import signal
import socket
import sys
import threading
import time
import traceback
from pathlib import Path
from typing import NoReturn

LONGEST = 1 << 20
"""Maximum size of a request, bytes."""
MAX_FDS = 8
"""Maximum number of files that are passed on."""
_FIRST_KEPT = 512
"""Above the numbers of all files of this process, and below the usual limit."""


def main(connection: socket.socket) -> None:
    """Fork a program for each request, and report how it ends, until the connection is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the programs end as the test says
    with selectors.DefaultSelector() as selector:
        selector.register(connection, selectors.EVENT_READ)
        while True:
            for key, _ in selector.select():
                if key.fileobj is not connection:
                    selector.unregister(key.fileobj)
                    pid, report = key.data
                    status = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
                    os.write(report, str(status).encode())
                    os.close(report)
                    os.close(key.fd)
                    continue
                message, fds, _, _ = socket.recv_fds(connection, LONGEST, MAX_FDS)
                if not message:
                    return
                module, arguments, imports, environment, directory, inherited = json.loads(message)
                with contextlib.suppress(ImportError):  # the program itself reports a missing module
                    for name in imports:
                        importlib.import_module(name)
                gc.collect()
                gc.freeze()
                assert len(list(Path("/proc/self/task").iterdir())) == 1, f"{imports} start threads when imported"
                if (pid := os.fork()) == 0:
                    become(module, arguments, environment, directory, fds, inherited)
                connection.send(str(pid).encode())
                for fd in (*fds[:2], *fds[3:]):
                    os.close(fd)
                selector.register(os.pidfd_open(pid), selectors.EVENT_READ, (pid, fds[2]))


def become(
    module: str, arguments: list[str], environment: dict[str, str], directory: str, fds: list[int], inherited: list[int]
) -> NoReturn:
    """Run a program in this forked process as `python -m` does, and end with its exit status.

    Args:
        module: to run.
        arguments: of the program.
        environment: of the program.
        directory: to run it in.
        fds: standard output and error, the pipe for the exit status, and the inherited files.
        inherited: the numbers that the inherited files have in the program.
    """
    os.dup2(fds[0], 1)
    os.dup2(fds[1], 2)
    kept = [fcntl.fcntl(fd, fcntl.F_DUPFD, _FIRST_KEPT) for fd in fds[3:]]
    os.closerange(3, _FIRST_KEPT)
    for fd, number in zip(kept, inherited, strict=True):
        os.dup2(fd, number)
        os.close(fd)
    if inherited:  # as a child of the server, see arcor2_server.child_process
        os.setsid()
    sys.stdout = sys.__stdout__ = io.TextIOWrapper(io.FileIO(1, "w", closefd=False))  # type: ignore[misc,assignment]
    sys.stderr = sys.__stderr__ = io.TextIOWrapper(  # type: ignore[misc]
        io.FileIO(2, "w", closefd=False), errors="backslashreplace", line_buffering=True
    )
    signal.signal(signal.SIGINT, signal.default_int_handler)
    os.environ.clear()
    os.environ.update(environment)
    time.tzset()
    os.chdir(directory)
    sys.path[0] = directory
    sys.argv[:] = ["-m", *arguments]
    for name in (module, f"{module}.__main__"):  # it runs as __main__
        if not hasattr(sys.modules.get(name), "__path__"):
            sys.modules.pop(name, None)
    if "arcor2_fakes.process" in sys.modules:  # fakes end with the process that was their parent when this was loaded
        sys.modules["arcor2_fakes.process"]._PARENT = os.getppid()  # type: ignore[attr-defined]
    status: object = 0
    try:
        runpy.run_module(module, run_name="__main__", alter_sys=True)
    except SystemExit as end:
        status = end.code
    except BaseException:  # shown as by the interpreter
        traceback.print_exc()
        status = 1
    # End the interpreter without cleaning up the imported modules.
    threading._shutdown()  # type: ignore[attr-defined]
    atexit._run_exitfuncs()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status if isinstance(status, int) else bool(status))


if __name__ == "__main__":
    main(socket.socket(fileno=int(sys.argv[1])))
