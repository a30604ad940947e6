"""The worker process: it reads a message, computes, answers. All of its state can be sent again by the server."""

import argparse
import contextlib
import faulthandler
import importlib
import os
import resource
import signal
import socket
import sys
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Final

import msgspec

from arcor2_hw.compute import messages as m
from arcor2_hw.compute.task import NotInstalled, Task
from arcor2_hw.compute.worker_state import WorkerState
from arcor2_hw.exceptions import Arcor2Error, InvalidData
from arcor2_hw.framing import PREFIX_SIZE
from arcor2_hw.messages import Message

NICENESS: Final = 5
"""Scheduling priority below that of devices and the server."""
KILL_DELAY: Final = 1.0
"""Time after the limit of a computation at which the kernel ends the process, s."""
MAX_ANSWER: Final = 128 * 1024 * 1024
"""Maximum size of an answer, bytes."""


def main(arguments: Sequence[str]) -> int:
    """Serve the socket with the given file descriptor until it is closed."""
    parser = argparse.ArgumentParser(prog="arcor2_hw.compute")
    parser.add_argument("--fd", type=int, required=True)
    # A crash in a library leaves a stack trace on standard error, but no core file.
    faulthandler.enable()
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with contextlib.suppress(OSError):
        os.nice(NICENESS)
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is handled by the server, which ends this process
    with socket.socket(fileno=parser.parse_args(arguments).fd) as sock:
        sock.setblocking(True)
        serve(sock)
    return 0


def serve(sock: socket.socket) -> None:
    """Answer messages until the socket is closed."""

    def send(message: m.FromWorker) -> None:
        sock.sendall(m.encode(message))

    state = WorkerState(lambda share, text: send(m.Progress(share, text)))
    with contextlib.suppress(OSError):
        for message in _messages(sock):
            match message:
                case m.ChangeWorld():
                    state.change(message.place, message.put, message.remove)
                case m.ForgetWorld():
                    state.forget(message.place)
                case m.RunTask():
                    state.place = message.place
                    send(_answer(message, state))


def _answer(work: m.RunTask, state: WorkerState) -> m.Done | m.Failed:
    # The default action of the signal ends the process even inside a library call that never returns.
    signal.setitimer(signal.ITIMER_REAL, work.within + KILL_DELAY)
    try:
        value = m.encode_value(function_of(work.task)(work.task, state))
        if len(value) > MAX_ANSWER:
            raise InvalidData(
                "The answer is larger than allowed: {count} bytes, at most {max_answer}.",
                count=len(value),
                max_answer=MAX_ANSWER,
            )
        return m.Done(value)
    except Arcor2Error as error:
        return failed(error)
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] == "arcor2_hw":
            raise
        if error.name == "duckdb":
            return failed(
                NotInstalled("{name} is not installed. Install arcor2-hw with the extra history.", name="duckdb")
            )
        return failed(
            NotInstalled(
                "{name} is not installed. Install arcor2-hw with the extras vision and kinematics.",
                str(error),
                name=error.name,
            )
        )
    except MemoryError:
        return failed(InvalidData("This computation needs more memory than is available."))
    except Exception as error:  # noqa: BLE001 - a library may raise anything; the caller receives it
        sys.excepthook(type(error), error, error.__traceback__)
        return m.Failed(
            ["compute", "error"],
            Message.of("The computation failed with an internal error. See the log of the server."),
            repr(error),
        )
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)


def function_of(task: Task[Any]) -> Callable[[Any, WorkerState], Any]:
    """Import and return the function of a task."""
    module, _, name = task.function.partition(":")
    function: Callable[[Any, WorkerState], Any] = getattr(importlib.import_module(module), name)
    return function


def failed(error: Arcor2Error) -> m.Failed:
    """Return an error as a message."""
    codes = [kind.code for kind in type(error).__mro__ if issubclass(kind, Arcor2Error)]
    return m.Failed(list(dict.fromkeys(codes)), error.message, error.detail, str(getattr(error, "reason", "")))


def _messages(sock: socket.socket) -> Iterator[m.ToWorker]:
    while (prefix := _exactly(sock, PREFIX_SIZE)) is not None:
        body = _exactly(sock, m.body_length(bytes(prefix)))
        if body is None:
            return
        try:
            yield m.decode_to_worker(body)
        except msgspec.MsgspecError as error:
            raise SystemExit(f"the server sent an invalid message: {error}") from None


def _exactly(sock: socket.socket, size: int) -> bytearray | None:
    """Read exactly `size` bytes, or None if the socket is closed before."""
    buffer = bytearray(size)
    view, got = memoryview(buffer), 0
    while got < size:
        count = sock.recv_into(view[got:])
        if not count:
            return None
        got += count
    return buffer
