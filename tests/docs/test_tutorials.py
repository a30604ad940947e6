"""Run the tutorials: write their files, run their commands, and compare the output."""

import os
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

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

    def __init__(self, command: str, wanted: list[str], directory: Path, environment: dict[str, str]) -> None:
        self.process = subprocess.Popen(
            ["bash", "-c", f"exec {command}"],
            cwd=directory,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self.output = ""
        self.ready = threading.Event()
        self.pattern = expected(wanted)
        self.thread = threading.Thread(target=self.read)
        self.thread.start()

    def read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.output += line
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


@pytest.mark.parametrize("tutorial", TUTORIALS, ids=lambda path: path.stem)
def test_commands_of_a_tutorial_print_the_stated_output(tutorial: Path, tmp_path: Path) -> None:
    environment = dict(
        os.environ,
        PATH=f"{Path(sys.executable).parent}:{os.environ['PATH']}",
        # Load only the plugin of this project, as for a user. Other installed plugins take seconds to load.
        PYTEST_DISABLE_PLUGIN_AUTOLOAD="1",
        PYTEST_PLUGINS="arcor2_hw.testing.plugin",
    )
    background: list[Background] = []
    ran = 0
    try:
        for kind, info, text in BLOCK.findall(tutorial.read_text()):
            if title := re.search(r'title="([\w./-]+)"', info):
                (tmp_path / title.group(1)).write_text(text)
            elif kind == "console" and "background" in info:
                for command, printed in commands(text):
                    started = Background(command, printed, tmp_path, environment)
                    background.append(started)
                    assert started.ready.wait(TIMEOUT), f"{command}\n{started.output}"
                    assert started.pattern.search(started.output), f"{command}\n{started.output}"
            elif kind == "console":
                for command, printed in commands(text):
                    done = subprocess.run(
                        ["bash", "-c", command],
                        cwd=tmp_path,
                        env=environment,
                        capture_output=True,
                        text=True,
                        timeout=TIMEOUT,
                        check=False,
                    )
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
