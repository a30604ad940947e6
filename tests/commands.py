"""Run `arcor2-hw` and pytest to their end, forked from a process that has already imported them.

Tests of the start of a command run the real one.
"""

import signal
import subprocess
import tempfile
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any, Final

from tests.forking import Forked, Forker

CLI: Final = "arcor2_server.cli.main"
PYTEST: Final = "pytest"
_PYTEST_PLUGINS: Final = ("assertion.rewrite", "cacheprovider", "fixtures", "junitxml", "python", "terminal", "tmpdir")
_IMPORTS: Final[Mapping[str, tuple[str, ...]]] = {
    CLI: (CLI, "arcor2_server.cli.device_cell", "arcor2_server.cli.device_new"),
    # Without the modules whose assertions pytest rewrites.
    PYTEST: (
        *("pytest", *(f"_pytest.{each}" for each in _PYTEST_PLUGINS), "numpy", "msgspec.yaml", "arcor2_fakes.control"),
        *("arcor2_hw.analysis", "arcor2_hw.objects.polled_control", "arcor2_hw.objects.robot"),
    ),
}
_forkers: Final = {module: Forker() for module in _IMPORTS}
"""One each, because commands work differently where pytest is imported: Cyclopts warns that it runs in a test."""


def start(
    module: str,
    *arguments: object,
    stderr: IO[Any] | int,
    cwd: Path | None = None,
    env: Mapping[str, str] | None = None,
    stdin: int | None = None,
) -> "Forked | subprocess.Popen[bytes]":
    """Start `python -m MODULE ARGUMENTS`. The arguments are those of `run` and `Forker.start`."""
    words = [str(each) for each in arguments]
    group = [f"arcor2_server.cli.{words[0].replace('-', '_')}"] if module == CLI else []
    imports = [*_IMPORTS[module], *group]
    return _forkers[module].start(module, words, imports, stderr, env, directory=cwd, stdin=stdin)


def run(
    module: str,
    *arguments: object,
    cwd: Path | None = None,
    env: Mapping[str, str] | None = None,
    given: str = "",
    timeout: float = 120.0,
) -> "subprocess.CompletedProcess[str]":
    """Run `python -m MODULE ARGUMENTS` and return its exit status and output.

    Args:
        module: CLI or PYTEST.
        arguments: of the command.
        cwd: directory in which it runs.
        env: its environment.
        given: text on its standard input.
        timeout: time in which it has to end, s.

    Raises:
        subprocess.TimeoutExpired: It has not ended in time, and was killed.
    """
    with tempfile.TemporaryFile("w+") as stdin, tempfile.TemporaryFile("w+") as stderr:
        stdin.write(given)
        stdin.seek(0)
        process = start(module, *arguments, stderr=stderr, cwd=cwd, env=env, stdin=stdin.fileno())
        assert process.stdout is not None
        late = threading.Timer(timeout, process.kill)
        late.start()
        with process.stdout as stdout:
            output = stdout.read().decode()
        late.cancel()
        late.join()
        status = process.wait()
        if status == -signal.SIGKILL:
            raise subprocess.TimeoutExpired(module, timeout, output)
        stderr.seek(0)
        return subprocess.CompletedProcess((module, *map(str, arguments)), status, output, stderr.read())
