"""The process: takes one message after the other, computes, answers. It keeps nothing that could not be told again."""

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
from arcor2_hw.compute.desk import Desk
from arcor2_hw.compute.task import NotInstalled, Task
from arcor2_hw.exceptions import Arcor2Error, InvalidData
from arcor2_hw.framing import PREFIX_SIZE

NICENESS: Final = 5
"""Devices, and the server, go first."""
LATE: Final = 1.0
"""Seconds beyond what a computation may take after which the process is ended by the kernel, whatever it does."""
MAX_ANSWER: Final = 128 * 1024 * 1024
"""Bytes of one answer."""


def main(arguments: Sequence[str]) -> int:
    """Serve the socket of this number until it is closed."""
    parser = argparse.ArgumentParser(prog="arcor2_hw.compute")
    parser.add_argument("--fd", type=int, required=True)
    # A library that crashes leaves a trace on standard error, and no core file.
    faulthandler.enable()
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with contextlib.suppress(OSError):
        os.nice(NICENESS)
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the server, which ends this process
    with socket.socket(fileno=parser.parse_args(arguments).fd) as sock:
        sock.setblocking(True)
        serve(sock)
    return 0


def serve(sock: socket.socket) -> None:
    """Answer what comes until the socket is closed."""

    def say(message: m.FromWorker) -> None:
        sock.sendall(m.encode(message))

    desk = Desk(lambda share, text: say(m.Progress(share, text)))
    with contextlib.suppress(OSError):
        for message in _messages(sock):
            match message:
                case m.ChangeWorld():
                    desk.change(message.place, message.put, message.remove)
                case m.ForgetWorld():
                    desk.forget(message.place)
                case m.Work():
                    desk.place = message.place
                    say(_answer(message, desk))


def _answer(work: m.Work, desk: Desk) -> m.Done | m.Failed:
    # Not a handler but the default of the signal: it ends the process also inside a library that never returns.
    signal.setitimer(signal.ITIMER_REAL, work.within + LATE)
    try:
        value = m.encode_value(function_of(work.task)(work.task, desk))
        if len(value) > MAX_ANSWER:
            raise InvalidData(f"What was asked has an answer of {len(value)} bytes; {MAX_ANSWER} are sent.")
        return m.Done(value)
    except Arcor2Error as error:
        return failed(error)
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] == "arcor2_hw":
            raise
        return failed(
            NotInstalled(
                f"{error.name} is not installed: install arcor2-hw with the extras vision and kinematics.", str(error)
            )
        )
    except MemoryError:
        return failed(InvalidData("There is not enough memory for this."))
    except Exception as error:  # noqa: BLE001 - whatever a library raises is told to who asked
        sys.excepthook(type(error), error, error.__traceback__)
        return m.Failed(["compute", "error"], "An error inside the computation: see the server's log.", repr(error))
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)


def function_of(task: Task[Any]) -> Callable[[Any, Desk], Any]:
    """Give what computes a task; what it needs is imported only now."""
    module, _, name = task.runs.partition(":")
    function: Callable[[Any, Desk], Any] = getattr(importlib.import_module(module), name)
    return function


def failed(error: Arcor2Error) -> m.Failed:
    """Give an error as it crosses the process border."""
    codes = [kind.code for kind in type(error).__mro__ if issubclass(kind, Arcor2Error)]
    return m.Failed(list(dict.fromkeys(codes)), str(error), error.detail, str(getattr(error, "reason", "")))


def _messages(sock: socket.socket) -> Iterator[m.ToWorker]:
    while (prefix := _exactly(sock, PREFIX_SIZE)) is not None:
        body = _exactly(sock, m.body_length(bytes(prefix)))
        if body is None:
            return
        try:
            yield m.decode_to_worker(body)
        except msgspec.MsgspecError as error:
            raise SystemExit(f"the server sent what is no message: {error}") from None


def _exactly(sock: socket.socket, size: int) -> bytearray | None:
    """Read so many bytes; None when the socket is closed before."""
    buffer = bytearray(size)
    view, got = memoryview(buffer), 0
    while got < size:
        count = sock.recv_into(view[got:])
        if not count:
            return None
        got += count
    return buffer
