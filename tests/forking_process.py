"""The process from which `tests.forking` forks programs. It imports only modules that they import."""

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
import tempfile
import threading
import time
import traceback
from pathlib import Path
from typing import Any, NoReturn

MAX_REQUEST_SIZE = 1 << 20
"""Maximum size of a request, bytes."""
MAX_FDS = 8
"""Maximum number of files that are passed on."""
_LARGEST_FILE = 512
"""Above the numbers of all files of this process."""


def main(connection: socket.socket, listener: socket.socket) -> None:
    """Fork a program for each request, and report how it ends, until the connection is closed.

    Args:
        connection: Connection to the process that started this one.
        listener: Listener for connections of other processes.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # tests decide when the programs end
    with selectors.DefaultSelector() as selector:
        selector.register(connection, selectors.EVENT_READ)
        selector.register(listener, selectors.EVENT_READ)
        while True:
            for key, _ in selector.select():
                if key.fileobj is listener:
                    selector.register(listener.accept()[0], selectors.EVENT_READ)
                elif isinstance(key.fileobj, socket.socket):
                    if process := fork(key.fileobj):
                        selector.register(os.pidfd_open(process[0]), selectors.EVENT_READ, process)
                    elif key.fileobj is connection:
                        return
                    else:
                        selector.unregister(key.fileobj)
                        key.fileobj.close()
                else:
                    selector.unregister(key.fileobj)
                    pid, report = key.data
                    status = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
                    with contextlib.suppress(BrokenPipeError):  # the process that started it was killed
                        os.write(report, str(status).encode())
                    os.close(report)
                    os.close(key.fd)


def fork(connection: socket.socket) -> tuple[int, int] | None:
    """Fork a program for the next request of a connection.

    Returns:
        The process id and the pipe for the exit status. None if the connection is closed.
    """
    try:
        message, fds, _, _ = socket.recv_fds(connection, MAX_REQUEST_SIZE, MAX_FDS)
    except ConnectionError:
        return None
    if not message:
        return None
    request = json.loads(message)
    with contextlib.suppress(ImportError):  # the program itself reports a missing module
        for name in request["imports"]:
            importlib.import_module(name)
    gc.collect()
    gc.freeze()
    assert len(list(Path("/proc/self/task").iterdir())) == 1, f"{request['imports']} start threads when imported"
    if (pid := os.fork()) == 0:
        become(request, fds)
    with contextlib.suppress(BrokenPipeError):
        connection.send(str(pid).encode())
    for fd in (*fds[:2], *fds[3:]):
        os.close(fd)
    return pid, fds[2]


def become(request: dict[str, Any], fds: list[int]) -> NoReturn:
    """Run a program in this forked process as `python -m` does, and end with its exit status.

    Args:
        request: Request of `tests.forking.Forker`.
        fds: Standard output and error, the pipe for the exit status, and the inherited files.
    """
    module, inherited = request["module"], request["inherited"]
    os.dup2(fds[0], 1)
    os.dup2(fds[1], 2)
    if request["stdin"]:
        os.dup2(fds.pop(), 0)
    first_kept = max([_LARGEST_FILE, *inherited]) + 1
    kept = [fcntl.fcntl(fd, fcntl.F_DUPFD, first_kept) for fd in fds[3:]]
    os.closerange(3, first_kept)
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
    os.environ.update(request["environment"])
    time.tzset()
    tempfile.tempdir = None  # it depends on the environment
    os.chdir(request["directory"])
    os.umask(request["umask"])
    if request["name"]:
        Path("/proc/self/comm").write_text(request["name"])
        del sys.path[0]
    else:
        sys.path[0] = request["directory"]
    sys.argv[:] = ["-m", *request["arguments"]]
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
    main(socket.socket(fileno=int(sys.argv[1])), socket.socket(fileno=int(sys.argv[2])))
