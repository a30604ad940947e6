"""Run the tutorials and how-to pages: write their files, run their commands, and compare the output.

The commands of tutorials are started as a user starts them. Those of how-to pages are forked from a process that has
imported them, except lines that need a shell.
"""

import os
import re
import shlex
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests import commands as forked
from tests.forking import Forked
from tests.server.core.serving import fork_server

DOCS = Path(__file__).parents[2] / "docs"
ELSEWHERE = ("install", "postgresql")
"""Pages whose commands need another environment. Separate tests execute them."""
TUTORIALS = sorted(
    path
    for folder in ("tutorials", "how-to")
    for path in (DOCS / folder).glob("*.md")
    if ("```console" in path.read_text() or folder == "tutorials") and path.stem not in ELSEWHERE
)
BLOCK = re.compile(r"^```(\w+)([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
TIMEOUT = 150  # s, of a command; one runs the conformance suite, on a busy machine for more than a minute
FORKED = re.compile(r"(?:cd (?P<folder>\w+) && )?(?P<program>arcor2-hw|python -m pytest) (?P<words>[^|<>&;$*]*)")
MODULES = {"arcor2-hw": forked.CLI, "python -m pytest": forked.PYTEST}


def expected(lines: list[str]) -> re.Pattern[str]:
    """Return a pattern that the output must contain. `...` matches anything."""
    return re.compile(".*?".join(".*?".join(map(re.escape, line.split("..."))) for line in lines), re.DOTALL)


def commands(text: str) -> Iterator[tuple[str, list[str]]]:
    """Yield the commands of a console block, each with the lines printed after it."""
    command, printed = "", []
    for line in text.splitlines():
        if line.startswith("$ "):
            if command:
                yield command, printed
            command, printed = line[2:], []
        else:
            printed.append(line)
    yield command, printed


class Background:
    """A command that keeps running; its output is read until it reports that it is ready."""

    def __init__(
        self, command: str, wanted: list[str], directory: Path, environment: dict[str, str], fork: bool
    ) -> None:
        self.process: Forked | subprocess.Popen[bytes]
        program, *words = shlex.split(command)
        if not fork or program != "arcor2-hw":
            self.process = subprocess.Popen(
                ["bash", "-c", f"exec {command}"],
                cwd=directory,
                env=environment,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
            )
        elif words[0] == "serve":
            at = words.index("--data-dir")
            data, options = Path(words[at + 1]), (*words[1:at], *words[at + 2 :])
            self.process = fork_server(data, *options, stderr=subprocess.STDOUT, environment=environment)
        else:
            self.process = forked.start(forked.CLI, *words, cwd=directory, env=environment, stderr=subprocess.STDOUT)
        self.output = ""
        self.ready = threading.Event()
        self.pattern = expected(wanted)
        self.thread = threading.Thread(target=self.read)
        self.thread.start()

    def read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.output += line.decode()
            if self.pattern.search(self.output):
                self.ready.set()
        self.ready.set()
        self.process.stdout.close()

    def stop(self) -> None:
        self.process.send_signal(signal.SIGTERM)
        try:
            self.process.wait(60)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self.thread.join()


def run(command: str, directory: Path, environment: dict[str, str], fork: bool) -> "subprocess.CompletedProcess[str]":
    """Run a command of a page to its end."""
    if fork and (found := FORKED.fullmatch(command)):
        module, words = MODULES[found["program"]], shlex.split(found["words"])
        return forked.run(module, *words, cwd=directory / (found["folder"] or ""), env=environment, timeout=TIMEOUT)
    return subprocess.run(
        ["bash", "-c", command],
        cwd=directory,
        env=environment,
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
        check=False,
    )


@pytest.mark.parametrize("tutorial", TUTORIALS, ids=lambda path: path.stem)
def test_commands_of_a_tutorial_print_the_stated_output(
    tutorial: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    environment = dict(
        os.environ,
        PATH=f"{Path(sys.executable).parent}:{os.environ['PATH']}",
        # Load only the plugin of this project, as for a user. Other installed plugins take seconds to load.
        PYTEST_DISABLE_PLUGIN_AUTOLOAD="1",
        PYTEST_PLUGINS="arcor2_hw.testing.plugin",
    )
    background: list[Background] = []
    ran = 0
    fork = tutorial.parent.name == "how-to"
    try:
        for kind, info, text in BLOCK.findall(tutorial.read_text()):
            if title := re.search(r'title="([\w./-]+)"', info):
                (tmp_path / title.group(1)).write_text(text)
            elif kind == "console" and "background" in info:
                for command, printed in commands(text):
                    started = Background(command, printed, tmp_path, environment, fork)
                    background.append(started)
                    assert started.ready.wait(TIMEOUT), f"{command}\n{started.output}"
                    assert started.pattern.search(started.output), f"{command}\n{started.output}"
            elif kind == "console":
                for command, printed in commands(text):
                    done = run(command, tmp_path, environment, fork)
                    output = done.stdout + done.stderr
                    assert done.returncode == 0, f"{command}\n{output}"
                    assert expected(printed).search(output), f"{command}\n{output}"
                    ran += 1
    finally:
        for started in reversed(background):
            started.stop()
    assert ran > 0, "the tutorial runs no command"


def test_the_how_to_states_the_length_of_its_example() -> None:
    text = (DOCS / "how-to" / "add-a-device.md").read_text()
    written = {
        title.group(1): sum(bool(line.strip()) for line in block.splitlines())
        for _, info, block in BLOCK.findall(text)
        if (title := re.search(r'title="([\w./-]+\.py)"', info))
    }
    stated = re.search(r"The example\s+has (\d+) lines of driver\s+and (\d+) lines of a fake", text)
    assert stated is not None
    assert written == {
        "sealer/sealer/sealer.py": int(stated.group(1)),
        "sealer/sealer/sealer_fake.py": int(stated.group(2)),
    }
