"""Client of the control process: requests and answers over its pipes."""

import contextlib
import itertools
import json
import os
import selectors
import subprocess
import sys
import threading
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any, Final

from arcor2_hw.exceptions import DeviceError, DeviceFault
from arcor2_hw.messages import Message

_SCRIPT: Final = Path(__file__).with_name("control_process.py")


class ControlClient:
    """A running control process. Killing it ends its watchdog signals at once.

    Args:
        who: Name of the controller, for errors.
        arguments: Arguments of `ControlProgram`.
        on_output: Called with each line that the library prints.
        on_exit: Called with the exit status; returns the error of the requests without an answer.
    """

    def __init__(
        self,
        who: str | Message,
        arguments: dict[str, Any],
        on_output: Callable[[bytes], None],
        on_exit: Callable[[int], DeviceError],
    ) -> None:
        self._who, self._on_output, self._on_exit = who, on_output, on_exit
        self._numbers = itertools.count(1)
        self.opened: Future[Any] = Future()
        """Future that is done when the control program plays."""
        self._waiting: dict[int, Future[Any]] = {0: self.opened}
        self._process = subprocess.Popen(  # noqa: S603 - our own script
            [sys.executable, "-P", str(_SCRIPT), json.dumps(arguments)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,  # its own share of processor time
        )
        self.pid, self.kill = self._process.pid, self._process.kill
        self._listening = threading.Thread(target=self._listen, name=f"control answers {who}", daemon=True)
        self._listening.start()

    def wait(self, timeout: float) -> None:
        """Wait at most `timeout` s for the end of the process and of its connections."""
        self._listening.join(timeout)

    def request(self, command: str, arguments: tuple[Any, ...]) -> "Future[Any]":
        """Send a command and return the future of its result."""
        number, future = next(self._numbers), Future[Any]()
        self._waiting[number] = future
        self.write(json.dumps({"n": number, "do": command, "args": arguments}).encode() + b"\n")
        return future

    def write(self, line: bytes) -> None:
        """Write a line, if the process lives."""
        assert self._process.stdin is not None
        with contextlib.suppress(OSError, ValueError):  # the process has ended; the listening thread detects it
            os.write(self._process.stdin.fileno(), line)

    def _listen(self) -> None:
        process = self._process
        assert process.stdin is not None
        assert process.stdout is not None
        assert process.stderr is not None
        handlers = {process.stdout: self._on_answer, process.stderr: self._on_output}
        buffers = dict.fromkeys(handlers, b"")
        with selectors.DefaultSelector() as selector:
            for pipe in handlers:
                selector.register(pipe, selectors.EVENT_READ, pipe)
            while selector.get_map():
                for key, _ in selector.select():
                    data = os.read(key.fd, 65536)
                    if not data:
                        selector.unregister(key.data)
                        continue
                    *lines, buffers[key.data] = (buffers[key.data] + data).split(b"\n")
                    for line in lines:
                        handlers[key.data](line)
        error = self._on_exit(process.wait())
        for pipe in (process.stdin, *handlers):
            pipe.close()
        while self._waiting:
            self._waiting.popitem()[1].set_exception(error)

    def _on_answer(self, line: bytes) -> None:
        answer = json.loads(line)
        future = self._waiting.pop(answer["n"], None)
        if future is None:
            return
        if "error" in answer:
            future.set_exception(
                DeviceFault("The control interface of {device} failed.", answer["error"], device=self._who)
            )
        else:
            future.set_result(answer["data"])
