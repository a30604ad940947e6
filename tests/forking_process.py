"""The process from which `tests.forking` forks programs. It imports only what they import."""

import atexit
import contextlib
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
                message, fds, _, _ = socket.recv_fds(connection, LONGEST, 3)
                if not message:
                    return
                module, arguments, imports, environment, directory = json.loads(message)
                with contextlib.suppress(ImportError):  # the program itself reports a missing module
                    for name in imports:
                        importlib.import_module(name)
                gc.collect()
                gc.freeze()
                assert len(list(Path("/proc/self/task").iterdir())) == 1, f"{imports} start threads when imported"
                if (pid := os.fork()) == 0:
                    become(module, arguments, environment, directory, fds)
                connection.send(str(pid).encode())
                os.close(fds[0])
                os.close(fds[1])
                selector.register(os.pidfd_open(pid), selectors.EVENT_READ, (pid, fds[2]))


def become(module: str, arguments: list[str], environment: dict[str, str], directory: str, fds: list[int]) -> NoReturn:
    """Run a program in this forked process as `python -m` does, and end with its exit status."""
    os.dup2(fds[0], 1)
    os.dup2(fds[1], 2)
    os.closerange(3, 1024)
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
    sys.modules.pop(f"{module}.__main__", None)  # it runs as __main__
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
