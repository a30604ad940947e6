"""Lead a person through the first day with a real device, in a process of its own.

`python -m arcor2_hw.testing.first_day cell.yaml NAME FOLDER [--plan]` speaks the messages of
`arcor2_hw.data.first_day` on standard input and output. When its terminal ends, it stops the device and ends.
"""

import argparse
import os
import queue
import signal
import sys
import threading
from pathlib import Path
from typing import Any, BinaryIO, Final

import msgspec

from arcor2_hw.data.cell import read_cell
from arcor2_hw.data.first_day import Answer, Ask, Input, Output, Say, Show
from arcor2_hw.exceptions import Arcor2Error, NotFound
from arcor2_hw.testing.first_day.bench import real_bench
from arcor2_hw.testing.first_day.person import Interrupted
from arcor2_hw.testing.first_day.session import Session, show_plan
from arcor2_hw.testing.time_limit import CallHangs

EXIT_FAILED: Final = 1
EXIT_UNUSABLE: Final = 2
EXIT_UNREACHABLE: Final = 3
EXIT_INTERRUPTED: Final = 130


class Terminal:
    """The person at the other end of the pipes. The methods may be called from any thread."""

    def __init__(self, commands: BinaryIO, results: BinaryIO) -> None:
        self._commands, self._results = commands, results
        self._answers: queue.Queue[str | None] = queue.Queue()
        self._one = threading.Lock()
        self._over = False

    def listen(self) -> None:
        """Start to receive. An interrupt, or the end of the input, raises KeyboardInterrupt in the main thread."""
        threading.Thread(target=self._receive, name="terminal", daemon=True).start()

    def _receive(self) -> None:
        decoder = msgspec.json.Decoder(Input)
        for line in self._commands:
            message = decoder.decode(line)
            if not isinstance(message, Answer):
                break
            self._answers.put(message.text)
        self._over = True
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
        self._answers.put(None)

    def _send(self, message: Output) -> None:
        try:
            self._results.write(msgspec.json.encode(message) + b"\n")
            self._results.flush()
        except OSError:  # the terminal has ended, which is an interrupt
            return

    def say(self, text: str, style: Any = "text") -> None:
        """Show a line."""
        self._send(Say(text, style))

    def show(self, columns: list[str], rows: list[list[str]]) -> None:
        """Show a table."""
        self._send(Show(columns, rows))

    def _asked(self, question: Ask) -> str:
        with self._one:
            if not self._over:
                self._send(question)
            answer = self._answers.get()
            if answer is None:
                self._answers.put(None)
                raise Interrupted("The session was ended.")
            return answer

    def confirm(self, question: str) -> bool:
        """Ask a question that is answered by yes or no."""
        return self._asked(Ask(question, "yes_no")) == "yes"

    def done(self, instruction: str) -> None:
        """Wait until something is done."""
        self._asked(Ask(instruction, "done"))

    def ask(self, question: str) -> str:
        """Ask for a text."""
        return self._asked(Ask(question, "text"))


def _run(options: argparse.Namespace, terminal: Terminal) -> int:
    try:
        entry = read_cell(options.file).device(options.name)
        if entry is None:
            raise NotFound("{file} has no device {name}", file=options.file, name=options.name)
        bench = real_bench(entry, options.file)()
    except Arcor2Error as error:
        terminal.say(f"{error} {error.detail}".strip(), "bad")
        return EXIT_UNUSABLE
    if options.plan:
        show_plan(bench, terminal)
        return 0
    # Started with an ignored SIGINT, as from a script in the background, Python would not install this handler.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        terminal.listen()
        return 0 if Session(bench, terminal, options.folder).run() else EXIT_FAILED
    except (KeyboardInterrupt, Interrupted):
        return EXIT_INTERRUPTED
    except (Arcor2Error, CallHangs):  # the session has shown it
        return EXIT_UNREACHABLE
    except Exception:  # noqa: BLE001 - of a faulty driver, shown too
        return EXIT_FAILED


def main() -> None:
    """Run a session and end the process, even if a library still runs threads."""
    parser = argparse.ArgumentParser(description="Lead a person through the first day with a real device.")
    parser.add_argument("file", type=Path)
    parser.add_argument("name")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--plan", action="store_true", help="only show what would be done")
    options = parser.parse_args()
    # Drivers and their processes must neither read the answers nor write among the messages.
    commands, results = os.fdopen(os.dup(0), "rb", buffering=0), os.fdopen(os.dup(1), "wb")
    with Path(os.devnull).open() as nothing:
        os.dup2(nothing.fileno(), 0)
    os.dup2(2, 1)
    status = _run(options, Terminal(commands, results))
    sys.stderr.flush()
    os._exit(status)


if __name__ == "__main__":
    main()
