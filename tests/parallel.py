"""Run pytest in several workers, forked from a process that has collected the tests, next to the editor's unit tests.

A worker that has to import all tests itself needs 11 s of processor time before its first test; a forked one needs 2 s.

    python -m tests.parallel WORKERS ARGUMENTS-OF-PYTEST...
"""

import contextlib
import gc
import os
import select
import shlex
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import traceback
from pathlib import Path
from types import ModuleType
from typing import NoReturn

import pytest

from arcor2_fakes import process

EDITOR = (sys.executable, "editor/build.py", "test")
THREADS = "OPENBLAS_NUM_THREADS"
GATEWAY = "import sys;exec(eval(sys.stdin.readline()))"
"""The program that execnet, the library below pytest-xdist, passes to the Python process of a worker."""
WORKER = "tests/parallel_worker.py"
"""The command that execnet starts instead of Python; it asks this process for a worker."""


def main(workers: str, *arguments: str) -> int:
    """Run the unit tests of the editor and then pytest; return the exit status."""
    if THREADS not in os.environ:  # a pool of threads does not survive the fork
        os.execve(sys.executable, [sys.executable, "-m", "tests.parallel", *sys.argv[1:]], os.environ | {THREADS: "1"})
    editor = subprocess.Popen(EDITOR)
    with (
        Path(os.devnull).open("w") as nowhere,
        contextlib.redirect_stdout(nowhere),
        contextlib.redirect_stderr(nowhere),
    ):
        pytest.main(["--collect-only", *arguments])  # errors are shown by the run below
    del os.environ[THREADS]
    if status := editor.wait():
        return status
    assert len(list(Path("/proc/self/task").iterdir())) == 1, "a module of tests starts a thread when it is imported"
    with tempfile.TemporaryDirectory() as folder, socket.socket(socket.AF_UNIX) as listener:
        address = f"{folder}/workers"
        listener.bind(address)
        listener.listen()
        gateways = f"{workers}*popen//python={shlex.join([sys.executable, '-I', '-S', WORKER, address])}"
        return serve(listener, subprocess.Popen([sys.executable, "-m", "pytest", "--tx", gateways, *arguments]))


def serve(listener: socket.socket, run: "subprocess.Popen[bytes]") -> int:
    """Fork a worker for each connection until the run of pytest ends; return its exit status."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # pytest ends its workers and shows what failed
    ended = os.pidfd_open(run.pid)
    workers = []
    while ended not in select.select([listener.fileno(), ended], [], [])[0]:
        connection, _ = listener.accept()
        _, streams, _, _ = socket.recv_fds(connection, 1, 3)
        gc.collect()
        gc.freeze()
        if (pid := os.fork()) == 0:
            become_worker(connection, streams)
        workers.append(pid)
        connection.close()
        for stream in streams:
            os.close(stream)
    for pid in workers:  # execnet has waited for them, and has given up those that still run
        os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)
    return run.wait()


def become_worker(connection: socket.socket, streams: list[int]) -> NoReturn:
    """Run the program of execnet in this forked process. The connection closes when it ends."""
    kept = connection.detach()
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
    os.closerange(3, kept)
    os.closerange(kept + 1, 1024)
    sys.stdin = sys.__stdin__ = open(0, closefd=False)  # type: ignore[misc]  # noqa: SIM115
    sys.stdout = sys.__stdout__ = open(1, "w", closefd=False)  # type: ignore[misc]  # noqa: SIM115
    sys.stderr = sys.__stderr__ = open(2, "w", closefd=False)  # type: ignore[misc]  # noqa: SIM115
    signal.signal(signal.SIGINT, signal.default_int_handler)
    process._PARENT = os.getppid()  # fakes end with the process that was their parent when this was loaded
    sys.argv[:] = ["-c"]
    sys.modules["__main__"] = main = ModuleType("__main__")
    try:
        exec(GATEWAY, vars(main))
        threading._shutdown()  # type: ignore[attr-defined]
    except SystemExit:
        pass
    except BaseException:  # shown as by the interpreter
        traceback.print_exc()
    sys.stderr.flush()
    os._exit(0)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
