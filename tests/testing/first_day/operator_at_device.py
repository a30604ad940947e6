"""A simulated person at a terminal: runs the command line on a pseudo terminal, reads its output, and types."""

import fcntl
import os
import pty
import re
import select
import signal
import struct
import subprocess
import sys
import termios
import time
from collections.abc import Callable
from pathlib import Path

ANSI = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")
PROMPT = re.compile(r"\n([^\n]*?(?:\?|Enter\.)) (?:\[y/N\] )?(?:$|The connection to )")
"""A question, possibly with a message about the connection behind it."""
SHOWN_WITHIN = 90.0  # s, on a busy machine
END_TIMEOUT = 60.0  # s


class Operator:
    """A running `arcor2-hw device check --real` with its terminal."""

    def __init__(self, folder: Path, name: str, *arguments: str) -> None:
        self.shown = ""
        """Everything that was shown."""
        self.reactions: dict[str, Callable[[], object]] = {}
        """Actions of the person for each text that is shown."""
        self._read = self._reacted = 0
        self._ours, theirs = pty.openpty()
        fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 60, 220, 0, 0))
        command = [sys.executable, "-m", "arcor2_server.cli.main", "device", "check", "cell.yaml", "--real", name]
        # setsid makes the pseudo terminal the controlling one, so that Ctrl-C becomes a signal. A script in the
        # background starts its commands with SIGINT ignored; Ctrl-C must work then, too.
        self.process = subprocess.Popen(
            ["env", "--ignore-signal=INT", "setsid", "--ctty", "--wait", *command, "--report", "report", *arguments],
            cwd=folder,
            stdin=theirs,
            stdout=theirs,
            stderr=theirs,
            env=os.environ | {"TERM": "xterm", "COLUMNS": "220"},
        )
        os.close(theirs)

    def _more(self, until: float) -> bool:
        """Read the output; return False at the end of the command."""
        ready, _, _ = select.select([self._ours], [], [], max(0.0, until - time.monotonic()))
        assert ready, f"nothing more was shown within {SHOWN_WITHIN} s:\n{self.shown[-3000:]}"
        try:
            data = os.read(self._ours, 65536)
        except OSError:
            return False
        self.shown += ANSI.sub("", data.decode(errors="replace")).replace("\r", "")
        for text, react in self.reactions.items():
            if (at := self.shown.find(text, self._reacted)) >= 0:
                self._reacted = at + len(text)
                react()
        return bool(data)

    def question(self) -> str | None:
        """Wait for the next question and return it, or None when the command has ended."""
        until = time.monotonic() + SHOWN_WITHIN
        while not (found := PROMPT.search(self.shown, max(0, self._read - 1))):
            if not self._more(until):
                return None
        self._read = len(self.shown)
        return found[1]

    def type(self, text: str) -> None:
        """Type a line."""
        os.write(self._ours, f"{text}\n".encode())

    def ctrl_c(self) -> None:
        """Press Ctrl-C."""
        os.write(self._ours, b"\x03")

    def answers(self, answer: Callable[[str], str]) -> int:
        """Answer all questions; return the exit status."""
        while (question := self.question()) is not None:
            self.type(answer(question))
        return self.ends()

    def ends(self) -> int:
        """Wait for the end and return the exit status."""
        until = time.monotonic() + SHOWN_WITHIN
        while self._more(until):
            pass
        return self.process.wait(END_TIMEOUT)

    def close(self) -> None:
        """End the command, if it still runs, as when the terminal is closed."""
        os.close(self._ours)
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)
            self.process.wait(END_TIMEOUT)
